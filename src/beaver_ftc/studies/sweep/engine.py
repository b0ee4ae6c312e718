"""Flies the batches of a sweep with a crew: hands out tasks, gathers rows, lands whole batches.

A lost worker's task is flown again. One that is lost twice is taken apart into single flights, so that the
flight that kills its process is found: lost alone three times, it becomes a row that says so.
"""

import math
from collections import Counter, deque
from collections.abc import Callable, Sequence
from typing import NamedTuple, Protocol

from beaver_ftc.studies.sweep.crew import Crew, Task
from beaver_ftc.studies.sweep.sampling import Assignment, flight_seed
from beaver_ftc.studies.sweep.table import CRASHED, Row, row_of_failure

POLL_S = 0.2
MOST_LOSSES = 3
TASKS_A_SLOT = 4  # towards the end tasks get smaller, so that no worker is left with a long last one


class Batch(NamedTuple):
    """Flights that land together."""

    number: int
    flights: tuple[Assignment, ...]


class Source(Protocol):
    """Where batches come from."""

    def next_batch(self) -> Batch | None:
        """The next batch to fly; None while (or when) there is none."""

    def flights_left(self) -> int:
        """How many flights are still to come after those handed out."""

    def landed(self, batch: Batch, rows: list[Row]) -> None:
        """All rows of a batch, in order of their runs."""


class Engine:
    """One crew at work on one source."""

    def __init__(self, source: Source, crew: Crew, sweep_seed: int) -> None:
        self._source, self._crew, self._seed = source, crew, sweep_seed
        self._waiting: deque[Task] = deque()
        self._flying = 0
        self._batches: dict[int, tuple[Batch, list[Row]]] = {}
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
                self._source.landed(batch, sorted(rows, key=lambda row: row["run"]))

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
        self._batches[batch.number] = (batch, [])
        left = len(batch.flights) + self._source.flights_left()
        size = max(1, math.ceil(left / (self._crew.slots * TASKS_A_SLOT)))
        self._waiting.extend(_tasks(batch.number, batch.flights, size))
        return True

    def _gather(self, task: Task, rows: list[Row] | None) -> list[tuple[Batch, list[Row]]]:
        """The batch that these rows complete, if they do."""
        self._flying -= 1
        if rows is None:
            rows = self._fly_again(task)
        batch, so_far = self._batches[task.batch]
        so_far.extend(rows)
        if len(so_far) < len(batch.flights):
            return []
        del self._batches[task.batch]
        return [(batch, so_far)]

    def _fly_again(self, task: Task) -> list[Row]:
        """See to a lost task; the rows it yields all the same."""
        key = tuple(flight.run for flight in task.flights)
        self._losses[key] += 1
        if len(key) == 1 and self._losses[key] >= MOST_LOSSES:
            return [self._crashed(task.flights[0])]
        size = 1 if self._losses[key] > 1 else len(key)
        self._waiting.extendleft(reversed(_tasks(task.batch, task.flights, size)))
        return []

    def _crashed(self, flight: Assignment) -> Row:
        seed = flight_seed(self._seed, flight.run)
        return row_of_failure(*flight, seed, CRASHED, "the process that flies it ends, each time it is tried")


def _tasks(batch: int, flights: Sequence[Assignment], size: int) -> list[Task]:
    return [Task(batch, tuple(flights[i : i + size])) for i in range(0, len(flights), size)]
