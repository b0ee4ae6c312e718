"""A CSV or Parquet table with a time column `t_s`: one row a sample, one column a quantity."""

from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from beaver_ftc.documents.errors import BadInput
from beaver_ftc.flights.recording import Column, Floats, Recording

TIME = "t_s"
_BYTES = 8
_MOST_ROWS, _MOST_BYTES = 10_000_000, 2_000_000_000
"""What is read of a Parquet file at most: 2.8 h at 1000 Hz."""


def read(path: Path) -> Recording:
    """The flight in a table. Columns and cells that hold no number are nan."""
    table = read_numbers(path)
    if TIME not in table:
        raise BadInput(f"{path}: no column {TIME}, allowed: a table with {TIME} in seconds")
    t_s = table.pop(TIME)
    check_time(path, t_s)
    return Recording(path.stem, {name: Column(t_s, values) for name, values in table.items()})


def read_numbers(path: Path, columns: Sequence[str] | None = None) -> dict[str, Floats]:
    """The columns of a table, or those named that it has, nan where there is no number. Raises BadInput where
    it is no table, or larger than any flight."""
    import pyarrow as pa

    try:
        table = _parquet(path, columns) if path.suffix.lower() == ".parquet" else _csv(path)
    except (pa.ArrowException, OSError, ValueError) as error:
        says = " ".join(str(error).split())[:200]
        raise BadInput(f"{path}: is no table that can be read ({says}), allowed: CSV or Parquet") from None
    return {name: values for name, values in table.items() if columns is None or name in columns}


def check_time(path: Path, t_s: Floats) -> None:
    """Raise BadInput unless the stamps are finite and increase."""
    if len(t_s) < 2:
        raise BadInput(f"{path}: has {len(t_s)} rows, allowed: at least 2")
    wrong = np.flatnonzero(~np.isfinite(t_s) | (np.diff(t_s, prepend=-np.inf) <= 0))
    if wrong.size:
        row = int(wrong[0]) + 1
        raise BadInput(f"{path}: {TIME}: row {row}: time does not increase, allowed: increasing seconds")


def _csv(path: Path) -> dict[str, Floats]:
    from pyarrow import csv

    table = csv.read_csv(path)
    _check_names(path, table.column_names)
    return {name: _numbers(table[name]) for name in table.column_names}


def _parquet(path: Path, columns: Sequence[str] | None) -> dict[str, Floats]:
    """The columns of numbers are read, the others not even looked into: a list in a cell may be any size."""
    from pyarrow import parquet

    with parquet.ParquetFile(path) as file:
        schema, rows = file.schema_arrow, file.metadata.num_rows
        _check_names(path, schema.names)
        numbers = [
            field.name
            for field in schema
            if _is_number(field.type) and (columns is None or field.name in columns)
        ]
        _check_size(path, file.metadata, numbers)
        table = file.read(columns=numbers)
    nothing = np.broadcast_to(np.nan, rows)
    return {name: _numbers(table[name]) if name in numbers else nothing for name in schema.names}


def _check_names(path: Path, names: Sequence[str]) -> None:
    twice = next((name for name, count in Counter(names).items() if count > 1), None)
    if twice is not None:
        raise BadInput(f"{path}: has two columns {twice}, allowed: one of a name")


def _check_size(path: Path, metadata: Any, names: Sequence[str]) -> None:
    """Raise BadInput for more rows or numbers than a flight has: a few bytes may stand for billions."""
    if metadata.num_rows > _MOST_ROWS:
        raise BadInput(f"{path}: has {metadata.num_rows:,} rows, allowed: up to {_MOST_ROWS:,}")
    groups = [metadata.row_group(i) for i in range(metadata.num_row_groups)]
    chunks = [group.column(i) for group in groups for i in range(group.num_columns)]
    stored = sum(chunk.total_uncompressed_size for chunk in chunks if chunk.path_in_schema in set(names))
    size = max(stored, _BYTES * metadata.num_rows * len(names))
    if size > _MOST_BYTES:
        raise BadInput(
            f"{path}: holds {size / 1e9:,.1f} GB of numbers, allowed: up to {_MOST_BYTES / 1e9:g} GB"
        )


def _is_number(kind: Any) -> bool:
    import pyarrow as pa

    return bool(pa.types.is_integer(kind) or pa.types.is_floating(kind))


def _numbers(column: Any) -> Floats:
    if not _is_number(column.type):
        return np.broadcast_to(np.nan, len(column))
    return np.asarray(column.to_numpy(), dtype=float)
