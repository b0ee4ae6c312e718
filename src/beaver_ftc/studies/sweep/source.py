"""Where the batches of an ordinary sweep come from: the folder knows what is missing."""

from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING

from beaver_ftc.scenario.sweep_loader import Sweep
from beaver_ftc.studies.sweep.engine import Batch
from beaver_ftc.studies.sweep.sampling import Plan
from beaver_ftc.studies.sweep.store import Store
from beaver_ftc.studies.sweep.table import Row, table_of

if TYPE_CHECKING:
    import pyarrow as pa

FRAMES_A_BATCH = 50_000  # a third of a second of work: little to lose, and a file costs no share worth saying
MOST_A_BATCH = 256
MOST_BATCHES = 20_000  # of a sweep of millions: so many files are still handled with ease

Landed = Callable[[Sequence[Row]], None]


def batch_size(sweep: Sweep) -> int:
    """Flights a batch, from the sweep alone, so that a resumed sweep has the same batches."""
    scenario = sweep.scenario({})
    frames = scenario.duration_s * scenario.rate_hz * scenario.substeps
    size = max(1, min(MOST_A_BATCH, round(FRAMES_A_BATCH / frames)))
    return max(size, -(-sweep.flights // MOST_BATCHES))


class SweepSource:
    """A `Source`: the batches that have not landed yet, in order."""

    def __init__(self, sweep: Sweep, store: Store, on_landed: Landed) -> None:
        self._sweep, self._store, self._on_landed = sweep, store, on_landed
        self._size = batch_size(sweep)
        self._plan = Plan(sweep)
        self._missing = self._find_missing()
        self._left = sum(len(self._runs(batch)) for batch in self._missing)
        self._next = iter(self._missing)

    def next_batch(self) -> Batch | None:
        number = next(self._next, None)
        if number is None:
            return None
        runs = self._runs(number)
        self._left -= len(runs)
        return Batch(number, tuple(self._plan.assignments(runs)))

    def flights_left(self) -> int:
        return self._left

    def landed(self, batch: Batch, rows: list[Row]) -> None:
        self._store.land(batch.number, table_of(self._sweep, self._store.schema, rows))
        self._on_landed(rows)

    def tables(self) -> "Iterator[pa.Table]":
        """Every batch's table, in order; all must have landed."""
        for number in range(self._batches):
            table = self._store.landed(number, self._runs(number))
            assert table is not None
            yield table

    @property
    def _batches(self) -> int:
        return -(-self._sweep.flights // self._size)

    def _runs(self, number: int) -> range:
        return range(number * self._size, min((number + 1) * self._size, self._sweep.flights))

    def _find_missing(self) -> list[int]:
        missing = []
        for number in range(self._batches):
            table = self._store.landed(number, self._runs(number))
            if table is None:
                missing.append(number)
            else:
                self._on_landed(table.select(["fault.type", "detection.detected", "status"]).to_pylist())
        return missing
