"""A CSV or Parquet table with a time column `t_s`, or another: one row a sample, one column a quantity."""

from collections import Counter
from collections.abc import Collection, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from beaver_ftc.documents.errors import BadInput
from beaver_ftc.flights.readers.text import Layout, layout_of, read_cells, remarks
from beaver_ftc.flights.recording import Column, Floats, Recording, nearest_ten
from beaver_ftc.flights.units import SECONDS

TIME = "t_s"
_BYTES = 8
_MOST_ROWS, _MOST_BYTES = 10_000_000, 2_000_000_000
"""What is read of a file at most: 2.8 h at 1000 Hz."""

Table = dict[str, Floats]


def read(
    path: Path, time: str | None = None, unit: str = "s", columns: Collection[str] | None = None
) -> Recording:
    """The flight in a table. Columns and cells that hold no number are nan.

    time, unit: the column of the time and its unit, `t_s` in s where None. columns: what is read, all where
    None; the others are nan.
    """
    name = time or TIME
    table, notes = _read(path, None if columns is None else {name, *columns})
    if name not in table:
        says = f"a table with {TIME} in seconds, or its `time` in the vehicle file"
        raise BadInput(f"{path}: no column {name}, allowed: {says}; it has {nearest_ten(name, table)}")
    t_s = table.pop(name) * SECONDS[unit]
    kept, said = _stamped(path, name, t_s)
    rows = slice(None) if kept is None else kept
    t_s = t_s[rows]
    check_time(path, t_s, name)
    found = {key: Column(t_s, values[rows], notes.get(key, "")) for key, values in table.items()}
    return Recording(path.stem, found, notes=(*filter(None, notes.get("", "").split("\n")), *said))


def _stamped(path: Path, name: str, t_s: Floats) -> tuple[Floats | None, list[str]]:
    """Rows whose time is a number, None for all, and a line on the others."""
    lost = int(np.isnan(t_s).sum())
    if not lost:
        return None, []
    if lost > len(t_s) // 2:
        raise BadInput(f"{path}: {name}: {lost} of {len(t_s)} rows hold no number, allowed: increasing time")
    return np.isfinite(t_s), [f"{name}: rows without a number, left out: {lost} of {len(t_s)}"]


def read_numbers(path: Path, columns: Sequence[str] | None = None) -> Table:
    """The columns of a table, or those named that it has, nan where there is no number. Raises BadInput where
    it is no table, or larger than any flight."""
    table = _read(path, columns)[0]
    return {name: values for name, values in table.items() if columns is None or name in columns}


def names_of(path: Path) -> list[str]:
    """The names of a table's columns. Raises BadInput where it is no table."""
    return list(_read(path, [])[0]) if path.suffix.lower() == ".parquet" else list(_layout(path).names)


def _layout(path: Path) -> Layout:
    try:
        return layout_of(path)
    except OSError as error:
        says = (error.strerror or str(error)).lower()
        raise BadInput(f"{path}: is no table that can be read ({says}), allowed: CSV or Parquet") from None


def _read(path: Path, columns: Collection[str] | None) -> tuple[Table, dict[str, str]]:
    """All columns, those not asked for nan, and of each a line on what is wrong with it."""
    import pyarrow as pa

    try:
        return (_parquet(path, columns), {}) if path.suffix.lower() == ".parquet" else _csv(path, columns)
    except (pa.ArrowException, OSError, ValueError) as error:
        says = " ".join(str(error).split())[:200]
        raise BadInput(f"{path}: is no table that can be read ({says}), allowed: CSV or Parquet") from None


def check_time(path: Path, t_s: Floats, name: str = TIME) -> None:
    """Raise BadInput unless the stamps are finite and increase."""
    if len(t_s) < 2:
        raise BadInput(f"{path}: has {len(t_s)} rows, allowed: at least 2")
    wrong = np.flatnonzero(~np.isfinite(t_s) | (np.diff(t_s, prepend=-np.inf) <= 0))
    if wrong.size:
        row = int(wrong[0]) + 1
        raise BadInput(f"{path}: {name}: row {row}: time does not increase, allowed: increasing seconds")


def _csv(path: Path, columns: Collection[str] | None) -> tuple[Table, dict[str, str]]:
    layout, found = read_cells(path, columns, _MOST_ROWS)
    _check_names(path, layout.names)
    notes: dict[str, str] = {}
    for name, says in remarks(layout, found):
        notes[name] = f"{notes[name]}\n{says}" if name in notes else says
    return found.numbers, notes


def _parquet(path: Path, columns: Collection[str] | None) -> Table:
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
    return np.asarray(column.to_numpy(), dtype=float)
