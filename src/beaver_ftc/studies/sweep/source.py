"""The batches of an ordinary sweep: the folder knows which are missing."""

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

from beaver_ftc.scenario.sweep_loader import Sweep
from beaver_ftc.studies.engine.store import batches_of
from beaver_ftc.studies.engine.study import Batch, Batches
from beaver_ftc.studies.sweep.sampling import Plan
from beaver_ftc.studies.sweep.store import Store
from beaver_ftc.studies.sweep.table import counts_of_rows, counts_of_table

if TYPE_CHECKING:
    import pyarrow as pa

FRAMES_A_BATCH = 50_000  # a third of a second of work: little to lose, and a file costs no share worth saying
MOST_A_BATCH = 256
MOST_BATCHES = 4_000  # of a sweep of millions: so many files are read again in seconds

Landed = Callable[[Any], None]  # takes the counts of a batch


def batch_size(sweep: Sweep) -> int:
    """Flights a batch, from the sweep alone, so that a resumed sweep has the same batches."""
    scenario = sweep.scenario({})
    frames = scenario.duration_s * scenario.rate_hz * scenario.substeps
    size = max(1, min(MOST_A_BATCH, round(FRAMES_A_BATCH / frames)))
    return max(size, -(-sweep.flights // MOST_BATCHES))


class SweepSource(Batches):
    """The batches that have not landed yet, in order."""

    def __init__(self, sweep: Sweep, store: Store, on_landed: Landed) -> None:
        self._store, self._on_landed = store, on_landed
        self._batches = dict(batches_of(sweep.flights, batch_size(sweep)))
        plan, missing = Plan(sweep), self._find_missing()
        super().__init__(
            (Batch(number, tuple(plan.assignments(self._batches[number]))) for number in missing),
            sum(len(self._batches[number]) for number in missing),
            lambda batch, rows: on_landed(counts_of_rows(rows)),
            store.parts,
        )

    def tables(self) -> "Iterator[pa.Table]":
        """Every batch's table, in order; all must have landed."""
        return (self._store.landed(number, runs) for number, runs in self._batches.items())

    def _find_missing(self) -> list[int]:
        missing = []
        for number, runs in self._batches.items():
            table = self._store.landed(number, runs)
            if table is None:
                missing.append(number)
            else:
                self._on_landed(counts_of_table(table))
        return missing
