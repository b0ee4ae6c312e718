"""A CSV or Parquet table with a time column `t_s`, or another: one row a sample, one column a quantity."""

from collections import Counter
from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from beaver_ftc.documents import BadInput
from beaver_ftc_logs.readers.text import (
    Cells,
    Layout,
    check_broken,
    joined,
    layout_of,
    read_cells,
    remarks,
)
from beaver_ftc_logs.recording import Column, Floats, Recording, nearest_ten
from beaver_ftc_logs.units import SECONDS

TIME = "t_s"
_BYTES = 8
_MOST_ROWS, _MOST_BYTES = 10_000_000, 2_000_000_000
"""What is read of a file at most at once: 2.8 h at 1000 Hz."""
_LAST, _ONCE_MORE, _BATCH_ROWS = 1.2, 0.1, 50_000
"""So many times the rows of a part has the last at most; their share with which the next begins once more."""

Table = dict[str, Floats]
Part = tuple[Cells, list[tuple[str, str]], bool]
"""Cells, of each column what is said of it, and whether there is more."""


def read(
    path: Path, time: str | None = None, unit: str = "s", columns: Collection[str] | None = None
) -> Recording:
    """The flight in a table. Columns and cells that hold no number are nan.

    time, unit: the column of the time and its unit, `t_s` in s where None. columns: what is read, all where
    None; the others are nan.
    """
    return next(read_parts(path, time, unit, columns))


def read_parts(
    path: Path,
    time: str | None = None,
    unit: str = "s",
    columns: Collection[str] | None = None,
    rows: int | None = None,
) -> Iterator[Recording]:
    """The flight in a table as `read` gives it, one of more than 1.2 times so many rows in parts of so many,
    numbered, each of which begins with the end of the one before: memory does not grow with the file."""
    name = time or TIME
    names, found = _parts(path, None if columns is None else {name, *columns}, rows)
    if name not in names:
        says = f"a table with {TIME} in seconds, or its `time` in the vehicle file"
        raise BadInput(f"{path}: no column {name}, allowed: {says}; it has {nearest_ten(name, names)}")
    for number, (cells, said, more) in enumerate(found, 1):
        table = _filled(names, cells)
        notes: dict[str, str] = {}
        for column, line in said:
            notes[column] = f"{notes[column]}\n{line}" if column in notes else line
        t_s = table.pop(name) * SECONDS[unit]
        kept, lost = _stamped(path, name, t_s)
        of = slice(None) if kept is None else kept
        t_s = t_s[of]
        check_time(path, t_s, name, cells.before)
        flight = {key: Column(t_s, values[of], notes.get(key, "")) for key, values in table.items()}
        whole = number == 1 and not more
        told = (*filter(None, notes.get("", "").split("\n")), *lost)
        yield Recording(path.stem if whole else f"{path.stem}-part-{number}", flight, notes=told)


def _filled(names: Sequence[str], cells: Cells) -> Table:
    """All columns, those that were not read nan."""
    nothing = np.broadcast_to(np.nan, cells.rows)
    return {name: cells.numbers.get(name, nothing) for name in names}


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
    names, parts = _parts(path, columns, None)
    table = _filled(names, next(parts)[0])
    return {name: values for name, values in table.items() if columns is None or name in columns}


def names_of(path: Path) -> list[str]:
    """The names of a table's columns. Raises BadInput where it is no table."""
    return _parts(path, [], None)[0]


def first_of(path: Path, name: str) -> Floats:
    """The first numbers of a column."""
    return next(_parts(path, [name], _BATCH_ROWS)[1])[0].numbers[name]


def _layout(path: Path) -> Layout:
    try:
        return layout_of(path)
    except OSError as error:
        says = (error.strerror or str(error)).lower()
        raise BadInput(f"{path}: is no table that can be read ({says}), allowed: CSV or Parquet") from None


@contextmanager
def _readable(path: Path) -> Iterator[None]:
    """Within this a table is read. Raises BadInput where it is none."""
    import pyarrow as pa

    try:
        yield
    except (pa.ArrowException, OSError, ValueError) as error:
        says = " ".join(str(error).split())[:200]
        raise BadInput(f"{path}: is no table that can be read ({says}), allowed: CSV or Parquet") from None


def check_time(path: Path, t_s: Floats, name: str = TIME, before: int = 0) -> None:
    """Raise BadInput unless the stamps, of rows with so many before them, are finite and increase."""
    if len(t_s) < 2:
        raise BadInput(f"{path}: has {len(t_s)} rows, allowed: at least 2")
    wrong = np.flatnonzero(~np.isfinite(t_s) | (np.diff(t_s, prepend=-np.inf) <= 0))
    if wrong.size:
        row = before + int(wrong[0]) + 1
        raise BadInput(f"{path}: {name}: row {row}: time does not increase, allowed: increasing seconds")


def _parts(path: Path, columns: Collection[str] | None, rows: int | None) -> tuple[list[str], Iterator[Part]]:
    """The names of a table's columns, and its parts of so many rows; the whole where None."""
    layout = None if path.suffix.lower() == ".parquet" else _layout(path)
    with _readable(path):
        names, numbers = (
            _stored(path, columns) if layout is None else (list(layout.names), list(layout.names))
        )
    _check_names(path, names)
    wanted = [name for name in numbers if columns is None or name in columns]
    blocks = _batches(path, wanted) if layout is None else read_cells(path, layout, wanted)
    return names, _put_together(path, layout, blocks, rows)


def _put_together(
    path: Path, layout: Layout | None, blocks: Iterator[Cells], rows: int | None
) -> Iterator[Part]:
    held: list[Cells] = []
    with _readable(path):
        for block in blocks:
            held.append(block)
            many = sum(one.rows for one in held)
            if rows is None and many > _MOST_ROWS:
                raise BadInput(f"{path}: has more than {_MOST_ROWS:,} rows, allowed: up to {_MOST_ROWS:,}")
            while rows is not None and many > _LAST * rows:
                found = joined(held)
                part, rest = found.rows_from(0, rows), found.rows_from(rows - round(_ONCE_MORE * rows))
                part.text, part.broken = found.text, found.broken
                held, many = [rest], rest.rows
                yield part, list(remarks(layout, part)) if layout else [], True
        found = joined(held)
        if layout:
            check_broken(path, layout, found)
        yield found, list(remarks(layout, found)) if layout else [], False


def _stored(path: Path, columns: Collection[str] | None) -> tuple[list[str], list[str]]:
    """The columns of a Parquet file, and those of numbers: the others are not even looked into, a list in a
    cell may be any size."""
    from pyarrow import parquet

    with parquet.ParquetFile(path) as file:
        schema = file.schema_arrow
        numbers = [field.name for field in schema if _is_number(field.type)]
        _check_size(path, file.metadata, [name for name in numbers if columns is None or name in columns])
    return list(schema.names), numbers


def _batches(path: Path, names: Sequence[str]) -> Iterator[Cells]:
    """The rows of a Parquet file, batch by batch, none last."""
    from pyarrow import parquet

    rows = 0
    with parquet.ParquetFile(path) as file:
        for batch in file.iter_batches(_BATCH_ROWS, columns=list(names)):
            yield Cells({name: _numbers(batch[name]) for name in names}, batch.num_rows, rows)
            rows += batch.num_rows
    yield Cells({name: np.empty(0) for name in names}, 0, rows)


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
