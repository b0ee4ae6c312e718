"""Flies the batches of a study with a crew: hands out tasks, gathers rows, lands whole batches.

A lost worker's task is flown again. One that is lost twice is taken apart into single cases, so that the
case that kills its process is found: lost alone three times, it is given the row of a case that was lost.
"""

import math
from collections import Counter, deque
from collections.abc import Callable, Iterable, Sequence
from typing import Any, NamedTuple, Protocol

from beaver_ftc.studies.engine.crew import Crew, Row, Task

POLL_S = 0.2
MOST_LOSSES = 3
TASKS_A_SLOT = 4  # towards the end tasks get smaller, so that no worker is left with a long last one
LOST = "the process that flies it ends, each time it is tried"


class Batch(NamedTuple):
    """Cases that land together; each has a `run`."""

    number: int
    cases: tuple[Any, ...]


class Source(Protocol):
    """Where batches come from."""

    def next_batch(self) -> Batch | None:
        """The next batch to fly; None while (or when) there is none."""

    def cases_left(self) -> int:
        """How many cases are still to come after those handed out."""

    def landed(self, batch: Batch, rows: list[Row]) -> None:
        """All rows of a batch, in the order of its cases."""


class Batches:
    """A source that knows all its batches beforehand. of: number of cases in them."""

    def __init__(self, batches: Iterable[Batch], of: int, land: Callable[[Batch, list[Row]], None]) -> None:
        self._coming, self._left, self.landed = iter(batches), of, land

    def next_batch(self) -> Batch | None:
        batch = next(self._coming, None)
        self._left -= len(batch.cases) if batch else 0
        return batch

    def cases_left(self) -> int:
        return self._left


class Campaign:
    """One crew at work on one source. lost: the row of a case that kills its process."""

    def __init__(self, source: Source, crew: Crew, lost: Callable[[Any, str], Row]) -> None:
        self._source, self._crew, self._lost = source, crew, lost
        self._waiting: deque[Task] = deque()
        self._flying = 0
        self._batches: dict[int, tuple[Batch, dict[int, Row]]] = {}
        self._losses: Counter[tuple[int, ...]] = Counter()

    def fly(self, stopped: Callable[[], bool] = lambda: False) -> None:
        """Fly until there is nothing left; once `stopped`, only what is in the air."""
        while True:
            self._hand_out(stopped())
            if not self._flying:
                return
            whole = [batch for outcome in self._crew.outcomes(POLL_S) for batch in self._gather(*outcome)]
            self._hand_out(stopped())  # first put the crew to work, then see to the disk
            for batch, rows in whole:
                self._source.landed(batch, [rows[case.run] for case in batch.cases])

    def _hand_out(self, stopped: bool) -> None:
        while self._flying < self._crew.slots and not stopped:
            if not self._waiting and not self._open_batch():
                return
            self._crew.submit(self._waiting.popleft())
            self._flying += 1

    def _open_batch(self) -> bool:
        batch = self._source.next_batch()
        if batch is None:
            return False
        self._batches[batch.number] = (batch, {})
        left = len(batch.cases) + self._source.cases_left()
        size = max(1, math.ceil(left / (self._crew.slots * TASKS_A_SLOT)))
        self._waiting.extend(_tasks(batch.number, batch.cases, size))
        return True

    def _gather(self, task: Task, rows: list[Row] | None) -> list[tuple[Batch, dict[int, Row]]]:
        """The batch that these rows complete, if they do."""
        self._flying -= 1
        batch, so_far = self._batches[task.batch]
        flown = self._fly_again(task) if rows is None else zip(task.cases, rows, strict=True)
        so_far.update((case.run, row) for case, row in flown)
        if len(so_far) < len(batch.cases):
            return []
        del self._batches[task.batch]
        return [(batch, so_far)]

    def _fly_again(self, task: Task) -> list[tuple[Any, Row]]:
        """See to a lost task; the (case, row) it yields all the same."""
        key = tuple(case.run for case in task.cases)
        self._losses[key] += 1
        if len(key) == 1 and self._losses[key] >= MOST_LOSSES:
            return [(task.cases[0], self._lost(task.cases[0], LOST))]
        size = 1 if self._losses[key] > 1 else len(key)
        self._waiting.extendleft(reversed(_tasks(task.batch, task.cases, size)))
        return []


def _tasks(batch: int, cases: Sequence[Any], size: int) -> list[Task]:
    return [Task(batch, tuple(cases[i : i + size])) for i in range(0, len(cases), size)]
