"""The log of a flight as a parquet file: one row a frame, written in row groups to keep memory bounded.

Columns are plain float64, snappy-compressed and without dictionaries. PlotJuggler, pandas and other readers
open this form directly, and writing it costs the loop least.

    written by a flight (`LogSink`)     ParquetLog (file), MemoryLog, Columns (some columns), SpooledLog
    read (`Log`)                        MemoryLog, StoredLog (file)
"""

import contextlib
import math
import shutil
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from beaver_ftc.documents.errors import BadInput
from beaver_ftc.results.model import Metrics

if TYPE_CHECKING:
    from pandas import DataFrame

Values = dict[str, np.ndarray]
"""Values (rows,) by the name of their column."""

ROWS_PER_GROUP = 16384  # 12 MB of 90 columns: large enough to compress well, small enough to hold
_ROWS_PER_BLOCK = 256  # rows transposed at a time: a block fits the cache of the processor, four times faster
_MAX_ROWS_PER_GROUP = 1_000_000  # a file with more is refused: a run writes ROWS_PER_GROUP


class ParquetLog:
    """A `LogSink` that writes a parquet file. `close` completes it; before that the file is unreadable.

    _buffer (columns, rows_per_group): the row group that is being filled; _used: how many of its rows are.
    """

    def __init__(self, path: Path, rows_per_group: int = ROWS_PER_GROUP) -> None:
        self._path = path
        self._rows_per_group = rows_per_group
        self._used = 0
        self._writer: Any = None
        self._file: Any = None
        self._schema: Any = None
        self._buffer = np.empty((0, 0))

    def open(self, columns: Sequence[str]) -> None:
        """Start the file; `columns` name the log's columns in order, `t_s` first."""
        import pyarrow as pa
        from pyarrow.parquet import ParquetWriter

        self._schema = pa.schema([pa.field(name, pa.float64(), nullable=False) for name in columns])
        # The file is opened here, because Arrow refuses a path that is not UTF-8.
        self._file = self._path.open("wb")
        self._writer = ParquetWriter(
            self._file, self._schema, compression="snappy", use_dictionary=False, write_statistics=False
        )
        self._buffer = np.empty((len(columns), self._rows_per_group))

    def write(self, rows: np.ndarray) -> None:
        """Append `rows`, shape (n, columns), float64. The array may be reused by the caller."""
        start = 0
        while start < len(rows):
            count = min(len(rows) - start, self._rows_per_group - self._used, _ROWS_PER_BLOCK)
            self._buffer[:, self._used : self._used + count] = rows[start : start + count].T
            self._used += count
            start += count
            if self._used == self._rows_per_group:
                self._flush(self._writer)

    def close(self) -> None:
        """Write the rows of the last, shorter group and complete the file."""
        if self._writer is None:
            return
        writer = self._writer
        self._writer = None
        try:
            if self._used:
                self._flush(writer)
        finally:
            writer.close()
            self._file.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, *about: object) -> None:
        if kind is not None:
            self._used = 0  # after an exception the caller removes the file: do not write the rest
        self.close()

    def _flush(self, writer: Any) -> None:
        """Write the filled part of the buffer as a row group."""
        import pyarrow as pa

        # pa.array would import pandas, if it is installed, to test whether its argument is a series.
        used = self._used
        float64 = pa.float64()
        arrays = [
            pa.Array.from_buffers(float64, used, [None, pa.py_buffer(column[:used])])
            for column in self._buffer
        ]
        writer.write_table(pa.Table.from_arrays(arrays, schema=self._schema))
        self._used = 0


class Log:
    """A log that can be read: the names of its columns, and its rows a chunk at a time."""

    columns: tuple[str, ...] = ()

    def read_chunks(self, columns: Sequence[str] | None = None) -> Iterator[Values]:
        """Yield the log in chunks of rows, each as name -> values, shape (rows,)."""
        raise NotImplementedError

    def row_count(self) -> int:
        """Number of frames."""
        raise NotImplementedError

    def copy_to(self, path: Path) -> None:
        """Write the rows into a file with the format of the log.parquet of `run`."""
        raise NotImplementedError

    def read(self, columns: Sequence[str] | None = None) -> Values:
        """The whole log, or the named columns of it, as name -> values, shape (frames,)."""
        chunks = list(self.read_chunks(columns))
        names = self.columns if columns is None else columns
        return {name: np.concatenate([chunk[name] for chunk in chunks] or [np.empty(0)]) for name in names}

    @property
    def frame_s(self) -> float:
        """Time from the first row to the next, s; infinite in a log of fewer than two rows."""
        first = next(self.read_chunks(["t_s"]), {"t_s": np.empty(0)})["t_s"][:2]
        return float(first[1] - first[0]) if first.size == 2 else math.inf


class MemoryLog(Log):
    """A log in memory, for the argument `log` of `Simulation`.

    - `columns`: names of the columns, in order. Empty until `open` is called.
    - `rows` (frames, columns): all rows so far.
    """

    def __init__(self) -> None:
        self.columns: tuple[str, ...] = ()
        self._chunks: list[np.ndarray] = []

    def open(self, columns: Sequence[str]) -> None:
        """Start an empty log with these columns, in this order."""
        self.columns = tuple(columns)
        self._chunks = []

    def write(self, rows: np.ndarray) -> None:
        """Append a copy of `rows`, a float64 array (n, columns)."""
        self._chunks.append(rows.copy())

    def close(self) -> None:
        """End the log. For a log in memory the call has no effect."""

    @property
    def rows(self) -> np.ndarray:
        """The whole log, (frames, columns)."""
        if len(self._chunks) != 1:
            self._chunks = [np.concatenate(self._chunks or [np.empty((0, len(self.columns)))])]
        return self._chunks[0]

    def frozen_copy(self) -> "MemoryLog":
        """A second log with a copy of the rows. Rows that are later written to the first log are not added to
        the second.
        """
        copy = MemoryLog()
        copy.columns = self.columns
        copy._chunks = list(self._chunks)
        return copy

    def copy_to(self, path: Path) -> None:
        """Write the rows into a file with the format of the log.parquet of `run`."""
        with ParquetLog(path) as log:
            log.open(self.columns)
            log.write(self.rows)

    def row_count(self) -> int:
        """Number of frames."""
        return sum(len(chunk) for chunk in self._chunks)

    def read_chunks(self, columns: Sequence[str] | None = None) -> Iterator[Values]:
        """Yield the log in chunks of rows. A chunk is a mapping from the name of a column to its values (n,).

        - `columns`: names of the wanted columns; None for all.
        """
        wanted = self.columns if columns is None else columns
        places = [self.columns.index(name) for name in wanted]
        for chunk in self._chunks:
            yield {name: chunk[:, place] for name, place in zip(wanted, places, strict=True)}


class Columns(dict[str, np.ndarray]):
    """A `LogSink` that maps names of columns to values (frames,) once the flight is over.

    names: the columns to keep; if there are none, all columns are kept.
    """

    def __init__(self, *names: str) -> None:
        super().__init__()
        self._wanted = names

    def open(self, columns: Sequence[str]) -> None:
        """A flight begins, with these columns in its rows."""
        self._names = self._wanted or tuple(columns)
        self._places = [columns.index(name) for name in self._names]
        self._chunks: list[np.ndarray] = []

    def write(self, rows: np.ndarray) -> None:
        """Append a copy of the kept columns of `rows` (n, columns)."""
        # A copy, because the loop reuses the memory of `rows`; transposed at once, to read by column.
        self._chunks.append(np.ascontiguousarray(rows.T[self._places]))

    def close(self) -> None:
        """The flight is over."""
        values = np.concatenate([np.empty((len(self._names), 0)), *self._chunks], axis=1)
        self.update(zip(self._names, values, strict=True))

    def since(self, from_s: float) -> Values:
        """Every column from an instant on, `t_s` >= from_s."""
        late = self["t_s"] >= from_s
        return {name: column[late] for name, column in self.items()}


class SpooledLog:
    """A `LogSink` that keeps the rows in a temporary file: an hour of flight is 0.3 GB. `frozen_copy` reads
    them."""

    def open(self, columns: Sequence[str]) -> None:
        """Start an empty log in a new file. Earlier copies of `frozen_copy` stay readable."""
        self.columns = tuple(columns)
        self._file = tempfile.TemporaryFile()  # noqa: SIM115 -- removed with this log, or with the process
        self._frames = 0

    def write(self, rows: np.ndarray) -> None:
        """Keep a copy of `rows`, shape (n, columns), float64."""
        self._file.write(rows.tobytes())
        self._frames += len(rows)

    def close(self) -> None:
        """The file stays open for copies."""

    def frozen_copy(self) -> MemoryLog:
        """The log as it is now. The values are read from the file when they are used."""
        copy = MemoryLog()
        copy.columns = self.columns
        if self._frames:
            self._file.flush()
            shape = self._frames, len(self.columns)
            copy._chunks = [np.memmap(self._file, np.float64, "r", shape=shape)]
        return copy


class StoredLog(Log):
    """The log in a parquet file. Each call reads the file."""

    def __init__(self, path: Path) -> None:
        self._path = path
        with open_parquet_log(path) as file:
            self.columns = tuple(file.schema_arrow.names)
            self._frames = int(file.metadata.num_rows)

    def copy_to(self, path: Path) -> None:
        """Copy the file."""
        shutil.copyfile(self._path, path)

    def row_count(self) -> int:
        """Number of frames."""
        return self._frames

    def read_chunks(self, columns: Sequence[str] | None = None) -> Iterator[Values]:
        """Yield the log a row group at a time, each as name -> values, shape (rows,)."""
        with open_parquet_log(self._path) as file:
            wanted = list(self.columns if columns is None else columns)
            for group in range(file.num_row_groups):
                table = file.read_row_group(group, columns=wanted)
                yield {name: _column_values(table.column(name)) for name in wanted}


@contextlib.contextmanager
def open_parquet_log(path: Path) -> Iterator[Any]:
    """Open a log during the block. Raises BadInput if the file is no log of a run, or only a part of one."""
    from pyarrow import ArrowException, float64
    from pyarrow.parquet import ParquetFile

    with path.open("rb") as content:
        try:
            with ParquetFile(content, pre_buffer=False) as file:
                groups = (file.metadata.row_group(i) for i in range(file.num_row_groups))
                largest = max((group.num_rows for group in groups), default=0)
                if largest > _MAX_ROWS_PER_GROUP:  # a few bytes may stand for billions of equal rows
                    too_long = f"has {largest:,} rows in a row group"
                    raise BadInput(f"{path}: {too_long}, allowed: up to {_MAX_ROWS_PER_GROUP:,}")
                if {*file.schema_arrow.types} - {float64()}:
                    raise BadInput(f"{path}: has other numbers than a run writes, allowed: float64 alone")
                yield file
        except (ArrowException, OSError) as error:
            if getattr(error, "errno", None) is not None:
                raise  # an error of the disk, not of the content
            damage = "is damaged or cut short, allowed: a log that a run has written"
            raise BadInput(f"{path}: {damage}") from error


def _column_values(column: Any) -> np.ndarray:
    """The values of a column (rows,) without nulls. The method to_numpy of the column would import pandas."""
    parts = [
        np.frombuffer(part.buffers()[1], np.float64, len(part), 8 * part.offset) for part in column.chunks
    ]
    return np.concatenate(parts or [np.empty(0)])


def log_dataframe(log: "Log", metrics: Metrics) -> "DataFrame":
    """The log as a DataFrame, float64, with scenario, seed, verdict and units in `attrs`."""
    from pandas import DataFrame

    from beaver_ftc.results.units import units

    if isinstance(log, MemoryLog):
        table = DataFrame(np.asfortranarray(log.rows), columns=list(log.columns), copy=False)
    else:
        table = DataFrame(log.read())
    detection = metrics.detection
    isolation = metrics.isolation
    verdict = {
        "passed": metrics.passed, "false_alarm": metrics.false_alarm,
        "detected": detection.detected, "detection_delay_s": detection.delay_s,
        "isolated": isolation.fault, "type": isolation.type, "isolation_delay_s": isolation.delay_s,
        "departed": metrics.departure is not None,
    }  # fmt: skip
    table.attrs = {
        "scenario": metrics.scenario, "seed": metrics.seed, "verdict": verdict, "units": units(log.columns),
    }  # fmt: skip
    return table
