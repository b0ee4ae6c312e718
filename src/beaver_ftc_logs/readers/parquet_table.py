"""The table in a Parquet file, batch by batch."""

from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from beaver_ftc_logs.readers.cells import TableCells
from beaver_ftc_logs.refusals import refusal

_BYTES_PER_NUMBER = 8
# Largest number of rows, 2.8 h at 1000 Hz, and of bytes of numbers in memory.
MAX_ROWS = 10_000_000
_MAX_NUMBER_BYTES = 2_000_000_000
BATCH_ROWS = 50_000  # number of rows that are read at once


class ParquetTable:
    """The table in a Parquet file.

    It has the members of `TextTable`, so that table.py reads both alike. readable_names: its columns of
    numbers; table.py reads no others, since a list in a cell may have any size. doubled_names: names that
    several columns have.
    """

    def __init__(self, path: Path) -> None:
        import pyarrow as pa
        from pyarrow import parquet

        with parquet.ParquetFile(path) as file:
            schema = file.schema_arrow
            self._metadata = file.metadata
        self.names = list(schema.names)
        self.doubled_names = {name for name, n in Counter(self.names).items() if n > 1}
        is_number = [pa.types.is_integer(field.type) or pa.types.is_floating(field.type) for field in schema]
        self.readable_names = [name for name, readable in zip(self.names, is_number, strict=True) if readable]

    def remarks(self, cells: TableCells) -> Iterator[str]:
        """No remarks: a Parquet file has one layout."""
        return iter(())

    def check_broken_lines(self, path: Path, cells: TableCells) -> None:
        """Nothing to check: a Parquet file has no lines."""

    def blocks(self, path: Path, names: Sequence[str]) -> Iterator[TableCells]:
        """The rows of some columns in batches. The last batch is empty. Raises BadInput for a table that is
        too large."""
        _check_parquet_size(path, self._metadata, names)
        return _parquet_batches(path, names)


def _parquet_batches(path: Path, names: Sequence[str]) -> Iterator[TableCells]:
    """Yield the cells of a file in batches, nan for a null; the last batch is empty."""
    from pyarrow import parquet

    n_read = 0
    with parquet.ParquetFile(path) as file:
        for batch in file.iter_batches(BATCH_ROWS, columns=list(names)):
            numbers = {name: batch[name].to_numpy(zero_copy_only=False).astype(float) for name in names}
            yield TableCells(numbers, batch.num_rows, n_read)
            n_read += batch.num_rows
    yield TableCells({name: np.empty(0) for name in names}, 0, n_read)


def _check_parquet_size(path: Path, metadata: Any, names: Sequence[str]) -> None:
    """Raise BadInput for more rows or numbers than a flight has. The size comes from the metadata, since a
    few bytes of a file may stand for billions of rows.
    """
    if metadata.num_rows > MAX_ROWS:
        raise refusal(path, f"has {metadata.num_rows:,} rows", f"up to {MAX_ROWS:,}")
    groups = [metadata.row_group(i) for i in range(metadata.num_row_groups)]
    chunks = [group.column(i) for group in groups for i in range(group.num_columns)]
    total = sum(chunk.total_uncompressed_size for chunk in chunks if chunk.path_in_schema in names)
    size = max(total, _BYTES_PER_NUMBER * metadata.num_rows * len(names))
    if size > _MAX_NUMBER_BYTES:
        raise refusal(path, f"holds {size / 1e9:,.1f} GB of numbers", f"up to {_MAX_NUMBER_BYTES / 1e9:g} GB")
