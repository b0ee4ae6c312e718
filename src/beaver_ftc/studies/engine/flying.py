"""Batches of cases are flown by workers, as tasks that get smaller towards the end.

    case     one flight or one unit of a study, which gives one row
    batch    cases whose rows are kept together, in one file
    task     a batch, or some cases of it, that one worker flies in turn
    landed   the rows of a batch are complete and kept

The task of a lost worker is flown again. A task that is lost twice is divided into single cases, so that the
case that kills its process is found. A case that is lost alone three times gets the row of a lost case.
"""

import math
from collections import Counter, deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from beaver_ftc.studies.engine.workers import Batch, Number, Row, Workers

Lost = Callable[[Any, str], Row]  # from a case that kills its process, and the reason, to its row
POLL_S = 0.2  # longest wait for a task, after which `stopped` is tested again
MOST_LOSSES = 3  # a single case that is lost so often is given up
TASKS_A_SLOT = 4  # the remaining cases make so many tasks for each slot, so that the last tasks are short
LOST = "the process that flies it ends, each time it is tried"


class _Tasks:
    """The tasks of batches, and the rows of each batch so far.

    - _coming: batches that are not yet divided into tasks. _left: number of cases in these.
    - _waiting: tasks for the next free worker. flying: number of tasks that workers have.
    - _flown: by number, each batch that has begun, and its rows by run.
    - _losses: by the runs of a task, how often its worker was lost.
    - _lost: makes the row of a case that kills its process.
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
        """Give tasks to workers until all slots are filled or no task is left. A batch is divided once all
        tasks of earlier batches are with workers."""
        while self.flying < workers.slots:
            if not self._waiting and (batch := next(self._coming, None)):
                self._flown[batch.number] = (batch, {})
                size = max(1, math.ceil(self._left / (workers.slots * TASKS_A_SLOT)))
                self._left -= len(batch.cases)
                self._waiting.extend(_divided(batch, size))
            if not self._waiting:
                return
            workers.submit(self._waiting.popleft())
            self.flying += 1

    def gather(self, task: Batch, rows: Sequence[Row] | None) -> tuple[Batch, list[Row]] | None:
        """Take the rows of a task; None: its worker was lost. Returns the batch that is complete with these
        rows, and all rows of it; otherwise None."""
        self.flying -= 1
        batch, rows_by_run = self._flown[task.number]
        rows_by_run.update(zip(task.runs, self._fly_again(task) if rows is None else rows, strict=False))
        if len(rows_by_run) < len(batch.runs):
            return None
        del self._flown[task.number]
        return batch, [rows_by_run[run] for run in batch.runs]

    def _fly_again(self, task: Batch) -> list[Row]:
        """Put a lost task back into the queue, in single cases from the second loss on. Returns the row of a
        case that is given up, otherwise no rows."""
        key = tuple(task.runs)
        self._losses[key] += 1
        if len(key) == 1 and self._losses[key] >= MOST_LOSSES:
            return [self._lost(task.cases[0], LOST)]
        size = 1 if self._losses[key] > 1 else len(key)
        self._waiting.extendleft(reversed(_divided(task, size)))
        return []


def _divided(batch: Batch, size: int) -> list[Batch]:
    """Divide a batch into tasks of so many cases."""
    parts = [slice(i, i + size) for i in range(0, len(batch.runs), size)]
    return [Batch(batch.number, batch.runs[part], batch.cases[part]) for part in parts]


@dataclass
class Flying:
    """Flies the batches that have not landed: workers fly tasks, rows are gathered, complete batches land.

    - landed: from the number and runs of a batch to its rows; None if it has not landed.
    - land: keeps the rows of a batch.
    - make_workers: makes workers for so many cases; it is called when the first batch is missing.
    - lost: makes the row of a case that kills its process.
    """

    landed: Callable[[Number, Sequence[int]], Any]
    land: Callable[[Number, Any], None]
    make_workers: Callable[[int], Workers]
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
        on_landed: Callable[[Number, Any], None],
        stopped: Callable[[], bool] = lambda: False,
    ) -> None:
        """Fly the batches that have not landed. Once `stopped` is true, only the tasks that workers have are
        completed.

        cases_of: from runs to their cases. on_landed: called with the number and the rows of each batch, when
        these are known.
        """
        missing: dict[Number, Sequence[int]] = {}
        for number, runs in batches:
            rows = self.landed(number, runs)
            if rows is None:
                missing[number] = runs
            else:
                on_landed(number, rows)
        if not missing:
            return
        cases = sum(map(len, missing.values()))
        coming = (Batch(number, runs, cases_of(runs)) for number, runs in missing.items())
        tasks = _Tasks(coming, cases, self.lost)
        workers = self._workers = self._workers or self.make_workers(cases)
        while True:
            if not stopped():
                tasks.hand_out(workers)
            if not tasks.flying:
                return
            complete = [tasks.gather(*outcome) for outcome in workers.outcomes(POLL_S)]
            if not stopped():  # before the disk is written, so that no worker waits for it
                tasks.hand_out(workers)
            for batch, rows in filter(None, complete):
                self.land(batch.number, rows)
                on_landed(batch.number, rows)
