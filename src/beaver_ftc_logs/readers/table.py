"""A CSV or Parquet table with a time column `t_s`, or another: one row a sample, one column a quantity."""

from collections import Counter
from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from beaver_ftc.documents import BadInput
from beaver_ftc_logs.readers import LAST_PART_FACTOR, PART_OVERLAP_SHARE, check_is_log_itself
from beaver_ftc_logs.readers.text import (
    TableCells,
    TableLayout,
    check_broken_lines,
    find_layout,
    join_blocks,
    read_cells,
    table_remarks,
)
from beaver_ftc_logs.recording import Column, Floats, RecordedFlight, nearest_names_text
from beaver_ftc_logs.units import TIME_UNITS

TIME_COLUMN = "t_s"
_BYTES_PER_NUMBER = 8
_MAX_ROWS, _MAX_NUMBER_BYTES = 10_000_000, 2_000_000_000
"""Largest part of a file that is read at once: 2.8 h at 1000 Hz."""
_BATCH_ROWS = 50_000

NumberTable = dict[str, Floats]
TablePart = tuple[TableCells, list[tuple[str, str]], bool]
"""Cells, of each column what is said of it, and whether there is more."""


def read(
    path: Path, time_column: str | None = None, time_unit: str = "s", columns: Collection[str] | None = None
) -> RecordedFlight:
    """The flight in a table. Columns and cells that hold no number are nan.

    time_column, time_unit: the column of the time and its unit, `t_s` in s where None. columns: what is
    read, all where None; the others are nan.
    """
    return next(read_parts(path, time_column, time_unit, columns))


def read_parts(
    path: Path,
    given_time_column: str | None = None,
    time_unit: str = "s",
    columns: Collection[str] | None = None,
    part_rows: int | None = None,
) -> Iterator[RecordedFlight]:
    """The flight in a table as `read` gives it, one of more than 1.2 times so many rows in parts of so many,
    numbered, each of which begins with the end of the one before: memory does not grow with the file."""
    time = given_time_column or TIME_COLUMN
    names, parts = _names_and_parts(path, None if columns is None else {time, *columns}, part_rows)
    if time not in names:
        allowed = f"a table with {TIME_COLUMN} in seconds, or its `time` in the vehicle file"
        nearest = nearest_names_text(time, names)
        raise BadInput(f"{path}: no column {time}, allowed: {allowed}; it has {nearest}")
    for part, (cells, remarks, has_more) in enumerate(parts, 1):
        table = _whole_table(names, cells)
        notes: dict[str, str] = {}
        for column, remark in remarks:
            notes[column] = f"{notes[column]}\n{remark}" if column in notes else remark
        t_s = table.pop(time) * TIME_UNITS[time_unit]
        kept, left_out = _timed_rows(path, time, t_s, cells)
        select = slice(None) if kept is None else kept
        t_s = t_s[select]
        check_time(path, t_s, time, cells.n_rows_before)
        read = {name: Column(t_s, values[select], notes.get(name, "")) for name, values in table.items()}
        name = path.stem if part == 1 and not has_more else f"{path.stem}-part-{part}"
        lines = (*filter(None, notes.get("", "").split("\n")), *left_out)
        yield RecordedFlight(name, read, notes=lines)


def _whole_table(names: Sequence[str], cells: TableCells) -> NumberTable:
    """All columns, those that were not read nan."""
    blank = np.broadcast_to(np.nan, cells.n_rows)
    return {name: cells.numbers.get(name, blank) for name in names}


def _timed_rows(path: Path, time: str, t_s: Floats, cells: TableCells) -> tuple[Floats | None, list[str]]:
    """Rows whose time is a number, None for all, and a line on the others."""
    n_bad = int(np.isnan(t_s).sum())
    if not n_bad:
        return None, []
    if n_bad > len(t_s) // 2:
        reason = f"{n_bad} of {len(t_s)} rows hold no number{text_of_column_phrase(cells, time)}"
        raise BadInput(f"{path}: {time}: {reason}, allowed: increasing time")
    return np.isfinite(t_s), [f"{time}: rows without a number, left out: {n_bad} of {len(t_s)}"]


def text_of_column_phrase(cells: TableCells, name: str) -> str:
    """`, but text such as '7 ticks'` for a column with cells of text, else nothing."""
    if name not in cells.text_cells:
        return ""
    return f", but text such as {cells.text_cells[name][2][:30]!r}"


def read_numbers(path: Path, columns: Sequence[str] | None = None) -> NumberTable:
    """The columns of a table, or those named that it has, nan where there is no number. Raises BadInput where
    it is no table, or larger than any flight."""
    names, parts = _names_and_parts(path, columns, None)
    table = _whole_table(names, next(parts)[0])
    return {name: values for name, values in table.items() if columns is None or name in columns}


def column_names(path: Path) -> list[str]:
    """The names of a table's columns. Raises BadInput where it is no table."""
    return _names_and_parts(path, [], None)[0]


def first_cells_of_column(path: Path, name: str) -> TableCells:
    """The first cells of a column."""
    return next(_names_and_parts(path, [name], _BATCH_ROWS)[1])[0]


def _text_table_layout(path: Path) -> TableLayout:
    try:
        return find_layout(path)
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        raise BadInput(f"{path}: is no table that can be read ({reason}), allowed: CSV or Parquet") from None


@contextmanager
def _read_errors(path: Path) -> Iterator[None]:
    """Within this a table is read. Raises BadInput where it is none."""
    import pyarrow as pa

    try:
        yield
    except (pa.ArrowException, OSError, ValueError) as error:
        reason = " ".join(str(error).split())[:200]
        raise BadInput(f"{path}: is no table that can be read ({reason}), allowed: CSV or Parquet") from None


def check_time(path: Path, t_s: Floats, time: str = TIME_COLUMN, n_rows_before: int = 0) -> None:
    """Raise BadInput unless the stamps, of rows with so many before them, are finite and increase."""
    if len(t_s) < 2:
        raise BadInput(f"{path}: has {len(t_s)} rows, allowed: at least 2")
    wrong = np.flatnonzero(~np.isfinite(t_s) | (np.diff(t_s, prepend=-np.inf) <= 0))
    if wrong.size:
        row = n_rows_before + int(wrong[0]) + 1
        raise BadInput(f"{path}: {time}: row {row}: time does not increase, allowed: increasing seconds")


def _names_and_parts(
    path: Path, columns: Collection[str] | None, part_rows: int | None
) -> tuple[list[str], Iterator[TablePart]]:
    """The names of a table's columns, and its parts of so many rows; the whole where None.

    Raises BadInput for a wanted name that several columns have."""
    check_is_log_itself(path)
    layout = None if path.suffix.lower() == ".parquet" else _text_table_layout(path)
    with _read_errors(path):
        names, readable = (list(layout.column_names),) * 2 if layout else _parquet_columns(path, columns)
    doubled = layout.doubled_names if layout else {name for name, n in Counter(names).items() if n > 1}
    ambiguous = sorted(name for name in doubled if columns is not None and name in columns)
    if ambiguous:
        raise BadInput(f"{path}: has two columns {ambiguous[0]}, allowed: one of a name")
    wanted = [name for name in readable if name not in doubled and (columns is None or name in columns)]
    blocks = _read_parquet_batches(path, wanted) if layout is None else read_cells(path, layout, wanted)
    return names, _join_blocks(path, layout, blocks, part_rows)


def _join_blocks(
    path: Path, layout: TableLayout | None, blocks: Iterator[TableCells], part_rows: int | None
) -> Iterator[TablePart]:
    held: list[TableCells] = []
    with _read_errors(path):
        for block in blocks:
            held.append(block)
            n_held = sum(held_block.n_rows for held_block in held)
            if part_rows is None and n_held > _MAX_ROWS:
                raise BadInput(f"{path}: has more than {_MAX_ROWS:,} rows, allowed: up to {_MAX_ROWS:,}")
            while part_rows is not None and n_held > LAST_PART_FACTOR * part_rows:
                joined = join_blocks(held)
                done = joined.select_rows(0, part_rows)
                rest = joined.select_rows(part_rows - round(PART_OVERLAP_SHARE * part_rows))
                done.text_cells = joined.text_cells
                done.broken_lines = joined.broken_lines
                held, n_held = [rest], rest.n_rows
                yield (done, list(table_remarks(layout, done)) if layout else [], True)
        joined = join_blocks(held)
        if layout:
            check_broken_lines(path, layout, joined)
        yield joined, list(table_remarks(layout, joined)) if layout else [], False


def _parquet_columns(path: Path, columns: Collection[str] | None) -> tuple[list[str], list[str]]:
    """The columns of a Parquet file, and those of numbers: the others are not even looked into, a list in a
    cell may be any size."""
    from pyarrow import parquet

    with parquet.ParquetFile(path) as file:
        schema = file.schema_arrow
        numeric = [field.name for field in schema if _is_numeric_type(field.type)]
        wanted = [name for name in numeric if columns is None or name in columns]
        _check_parquet_size(path, file.metadata, wanted)
    return list(schema.names), numeric


def _read_parquet_batches(path: Path, names: Sequence[str]) -> Iterator[TableCells]:
    """The rows of a Parquet file, batch by batch, none last."""
    from pyarrow import parquet

    n_read = 0
    with parquet.ParquetFile(path) as file:
        for batch in file.iter_batches(_BATCH_ROWS, columns=list(names)):
            yield TableCells(
                {name: np.asarray(batch[name].to_numpy(), dtype=float) for name in names},
                batch.num_rows,
                n_read,
            )
            n_read += batch.num_rows
    yield TableCells({name: np.empty(0) for name in names}, 0, n_read)


def _check_parquet_size(path: Path, metadata: Any, names: Sequence[str]) -> None:
    """Raise BadInput for more rows or numbers than a flight has: a few bytes may stand for billions."""
    if metadata.num_rows > _MAX_ROWS:
        raise BadInput(f"{path}: has {metadata.num_rows:,} rows, allowed: up to {_MAX_ROWS:,}")
    groups = [metadata.row_group(i) for i in range(metadata.num_row_groups)]
    chunks = [group.column(i) for group in groups for i in range(group.num_columns)]
    total = sum(chunk.total_uncompressed_size for chunk in chunks if chunk.path_in_schema in set(names))
    size = max(total, _BYTES_PER_NUMBER * metadata.num_rows * len(names))
    if size > _MAX_NUMBER_BYTES:
        allowed = f"up to {_MAX_NUMBER_BYTES / 1e9:g} GB"
        raise BadInput(f"{path}: holds {size / 1e9:,.1f} GB of numbers, allowed: {allowed}")


def _is_numeric_type(kind: Any) -> bool:
    import pyarrow as pa

    return bool(pa.types.is_integer(kind) or pa.types.is_floating(kind))
