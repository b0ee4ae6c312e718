"""The table in a Parquet file, batch by batch."""

from collections import Counter
from collections.abc import Iterator, Sequence
from itertools import compress
from pathlib import Path

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
        self.names = list(schema.names)
        self.doubled_names = {name for name, n in Counter(self.names).items() if n > 1}
        is_number = [pa.types.is_integer(field.type) or pa.types.is_floating(field.type) for field in schema]
        self._readable_names = [*compress(self.names, is_number)]

    def remarks(self, cells: TableCells) -> Iterator[str]:
        """No remarks: a Parquet file has one layout."""
        return iter(())

    def blocks(self, path: Path, names: Sequence[str]) -> Iterator[TableCells]:
        """Yield the numbers of some columns in batches, nan for a null; the last batch is empty. Raises
        BadInput for more rows or numbers than a flight has: a few bytes of a file may stand for billions of
        rows, so the size comes from the metadata.
        """
        from pyarrow import parquet

        names = [name for name in names if name in self._readable_names]
        n_read = 0
        with parquet.ParquetFile(path) as file:
            metadata = file.metadata
            if metadata.num_rows > MAX_ROWS:
                raise refusal(path, f"has {metadata.num_rows:,} rows", f"up to {MAX_ROWS:,}")
            groups = [metadata.row_group(i) for i in range(metadata.num_row_groups)]
            chunks = [group.column(i) for group in groups for i in range(group.num_columns)]
            total = sum(chunk.total_uncompressed_size for chunk in chunks if chunk.path_in_schema in names)
            size = max(total, _BYTES_PER_NUMBER * metadata.num_rows * len(names))
            if size > _MAX_NUMBER_BYTES:
                raise refusal(
                    path, f"holds {size / 1e9:,.1f} GB of numbers", f"up to {_MAX_NUMBER_BYTES / 1e9:g} GB"
                )
            for batch in file.iter_batches(BATCH_ROWS, columns=names):
                numbers = {name: batch[name].to_numpy(zero_copy_only=False).astype(float) for name in names}
                yield TableCells(numbers, batch.num_rows, n_read)
                n_read += batch.num_rows
        yield TableCells({name: np.empty(0) for name in names}, 0, n_read)
