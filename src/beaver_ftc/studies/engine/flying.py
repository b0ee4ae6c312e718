"""Batches of cases flown by workers, as tasks that get smaller towards the end; lost ones are flown again.

A lost worker's task is flown again. One that is lost twice is taken apart into single cases, so that the case
that kills its process is found: lost alone three times, it is given the row of a case that was lost.
"""

import math
from collections import Counter, deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from beaver_ftc.studies.engine.workers import Batch, Number, Row, Workers

Lost = Callable[[Any, str], Row]
POLL_S = 0.2
MOST_LOSSES = 3
TASKS_A_SLOT = 4  # tasks that the cases left are divided into: no worker is left with a long last one
LOST = "the process that flies it ends, each time it is tried"


class _Tasks:
    """The tasks of batches, and the rows of each batch so far.

    _coming: batches of which no task is waiting yet; _left: cases in these. _waiting: tasks for the next free
    worker; flying: how many tasks workers have. _flown: by number, each batch begun and its rows by run.
    _losses: by the runs of a task, how often a worker was lost over it. _lost: the row of a case that kills
    its process.
    """

    def __init__(self, batches: Iterator[Batch], cases: int, lost: Lost) -> None:
        self._coming = batches
        self._left = cases
        self._lost = lost
        self._waiting = deque[Batch]()
        self.flying = 0
        self._flown = dict[Number, tuple[Batch, dict[int, Row]]]()
        self._losses = Counter[tuple[int, ...]]()

    def hand_out(self, workers: Workers) -> None:
        """Give each worker a task; a batch is taken apart when the tasks of those before are handed out."""
        while self.flying < workers.slots:
            if not self._waiting and (batch := next(self._coming, None)):
                self._flown[batch.number] = (batch, {})
                size = max(1, math.ceil(self._left / (workers.slots * TASKS_A_SLOT)))
                self._left -= len(batch.cases)
                self._waiting.extend(_apart(batch, size))
            if not self._waiting:
                return
            workers.submit(self._waiting.popleft())
            self.flying += 1

    def gather(self, task: Batch, rows: Sequence[Row] | None) -> tuple[Batch, list[Row]] | None:
        """Take the rows of a task, None if its worker was lost; the batch that they complete, with all of its
        rows."""
        self.flying -= 1
        batch, so_far = self._flown[task.number]
        so_far.update(zip(task.runs, self._fly_again(task) if rows is None else rows, strict=False))
        if len(so_far) < len(batch.runs):
            return None
        del self._flown[task.number]
        return batch, [so_far[run] for run in batch.runs]

    def _fly_again(self, task: Batch) -> list[Row]:
        """See to a lost task; the rows that it yields all the same: of one case that is given up."""
        key = tuple(task.runs)
        self._losses[key] += 1
        if len(key) == 1 and self._losses[key] >= MOST_LOSSES:
            return [self._lost(task.cases[0], LOST)]
        size = 1 if self._losses[key] > 1 else len(key)
        self._waiting.extendleft(reversed(_apart(task, size)))
        return []


def _apart(batch: Batch, size: int) -> list[Batch]:
    """A batch in tasks of so many cases."""
    parts = [slice(i, i + size) for i in range(0, len(batch.runs), size)]
    return [Batch(batch.number, batch.runs[part], batch.cases[part]) for part in parts]


@dataclass
class Flying:
    """Flies batches of which nothing has landed: workers fly tasks, rows are gathered, whole batches land.

    landed: the rows of a batch by its number and runs, None if they are not there. land: keeps them. make:
    workers, when the first batch is missing, for so many cases. lost: the row of a case that kills its
    process.
    """

    landed: Callable[[Number, Sequence[int]], Any]
    land: Callable[[Number, Any], None]
    make: Callable[[int], Workers]
    lost: Lost
    _workers: Workers | None = None

    def close(self) -> None:
        """Terminate the workers."""
        if self._workers:
            self._workers.close()

    def fly(
        self,
        batches: Iterable[tuple[Number, Sequence[int]]],
        cases_of: Callable[[Sequence[int]], Sequence[Any]],
        there: Callable[[Number, Any], None],
        stopped: Callable[[], bool] = lambda: False,
    ) -> None:
        """Fly what is missing; once `stopped`, only what is in the air. cases_of: these runs. there: takes
        the number and the rows of each batch, once they are there."""
        missing: dict[Number, Sequence[int]] = {}
        for number, runs in batches:
            rows = self.landed(number, runs)
            if rows is None:
                missing[number] = runs
            else:
                there(number, rows)
        if not missing:
            return
        cases = sum(map(len, missing.values()))
        coming = (Batch(number, runs, cases_of(runs)) for number, runs in missing.items())
        tasks = _Tasks(coming, cases, self.lost)
        workers = self._workers = self._workers or self.make(cases)
        while True:
            if not stopped():
                tasks.hand_out(workers)
            if not tasks.flying:
                return
            whole = [tasks.gather(*outcome) for outcome in workers.outcomes(POLL_S)]
            if not stopped():  # first put the workers to work, then see to the disk
                tasks.hand_out(workers)
            for batch, rows in filter(None, whole):
                self.land(batch.number, rows)
                there(batch.number, rows)
