"""A CSV or Parquet table with a time column `t_s`, or another: one row a sample, one column a quantity."""

from collections import Counter
from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from beaver_ftc.documents import BadInput
from beaver_ftc_logs.readers import MAX_LAST_PART_FACTOR, PART_OVERLAP_SHARE, check_is_log_itself
from beaver_ftc_logs.readers.text import (
    TableCells,
    TableLayout,
    check_broken_lines,
    find_layout,
    join_and_consume_blocks,
    read_cells,
    text_cell_and_layout_remarks,
)
from beaver_ftc_logs.recording import Column, Floats, RecordedFlight, nearest_names_text
from beaver_ftc_logs.units import SECONDS_PER_TIME_UNIT

TIME_COLUMN = "t_s"
_BYTES_PER_NUMBER = 8
_MAX_ROWS, _MAX_NUMBER_BYTES = 10_000_000, 2_000_000_000
"""Largest part of a file that is read at once: 2.8 h at 1000 Hz."""
_BATCH_ROWS = 50_000

NumberTable = dict[str, Floats]
TablePart = tuple[TableCells, list[tuple[str, str]], bool]
"""Cells, of each column what is said of it, and whether there is more."""


def read(
    path: Path,
    given_time_column: str | None = None,
    time_unit: str = "s",
    columns: Collection[str] | None = None,
) -> RecordedFlight:
    """The flight in a table. Columns and cells that hold no number are nan.

    given_time_column, time_unit: the column of the time and its unit, `t_s` in s where None. columns: what is
    read, all where None; the others are nan.
    """
    return next(read_parts(path, given_time_column, time_unit, columns))


def read_parts(
    path: Path,
    given_time_column: str | None = None,
    time_unit: str = "s",
    columns: Collection[str] | None = None,
    rows_per_part: int | None = None,
) -> Iterator[RecordedFlight]:
    """The flight in a table as `read` gives it, one of more than 1.2 times so many rows in parts of so many,
    numbered, each of which begins with the end of the one before: memory does not grow with the file."""
    time_column = given_time_column or TIME_COLUMN
    all_columns, parts = _column_names_and_parts(
        path, None if columns is None else {time_column, *columns}, rows_per_part
    )
    if time_column not in all_columns:
        allowed_table_phrase = f"a table with {TIME_COLUMN} in seconds, or its `time` in the vehicle file"
        raise BadInput(
            f"{path}: no column {time_column}, allowed: {allowed_table_phrase}; it has "
            f"{nearest_names_text(time_column, all_columns)}"
        )
    for part_number, (cells, column_remarks, has_more) in enumerate(parts, 1):
        table = _with_unread_columns_as_nan(all_columns, cells)
        note_of_column: dict[str, str] = {}
        for column, remark in column_remarks:
            note_of_column[column] = (
                f"{note_of_column[column]}\n{remark}" if column in note_of_column else remark
            )
        t_s = table.pop(time_column) * SECONDS_PER_TIME_UNIT[time_unit]
        is_row_kept, left_out_row_notes = _timed_row_mask_and_notes(path, time_column, t_s, cells)
        row_selection = slice(None) if is_row_kept is None else is_row_kept
        t_s = t_s[row_selection]
        check_row_count_and_time(path, t_s, time_column, cells.n_rows_before)
        flight_columns = {
            column_name: Column(t_s, values[row_selection], note_of_column.get(column_name, ""))
            for column_name, values in table.items()
        }
        is_whole_table = part_number == 1 and not has_more
        table_notes = (*filter(None, note_of_column.get("", "").split("\n")), *left_out_row_notes)
        yield RecordedFlight(
            path.stem if is_whole_table else f"{path.stem}-part-{part_number}",
            flight_columns,
            notes=table_notes,
        )


def _with_unread_columns_as_nan(all_columns: Sequence[str], cells: TableCells) -> NumberTable:
    """All columns, those that were not read nan."""
    nan_values = np.broadcast_to(np.nan, cells.n_rows)
    return {name: cells.numbers.get(name, nan_values) for name in all_columns}


def _timed_row_mask_and_notes(
    path: Path, time_column: str, t_s: Floats, cells: TableCells
) -> tuple[Floats | None, list[str]]:
    """Rows whose time is a number, None for all, and a line on the others."""
    n_without_time = int(np.isnan(t_s).sum())
    if not n_without_time:
        return None, []
    if n_without_time > len(t_s) // 2:
        text_phrase = text_of_column_phrase(cells, time_column)
        raise BadInput(
            f"{path}: {time_column}: {n_without_time} of {len(t_s)} rows hold no number{text_phrase}, "
            "allowed: increasing time"
        )
    return np.isfinite(t_s), [
        f"{time_column}: rows without a number, left out: {n_without_time} of {len(t_s)}"
    ]


def text_of_column_phrase(cells: TableCells, name: str) -> str:
    """`, but text such as '7 ticks'` for a column with cells of text, else nothing."""
    return (
        f", but text such as {cells.text_cell_summaries[name][2][:30]!r}"
        if (name in cells.text_cell_summaries)
        else ""
    )


def read_numbers(path: Path, columns: Sequence[str] | None = None) -> NumberTable:
    """The columns of a table, or those named that it has, nan where there is no number. Raises BadInput where
    it is no table, or larger than any flight."""
    names, parts = _column_names_and_parts(path, columns, None)
    table = _with_unread_columns_as_nan(names, next(parts)[0])
    return {name: values for name, values in table.items() if columns is None or name in columns}


def column_names(path: Path) -> list[str]:
    """The names of a table's columns. Raises BadInput where it is no table."""
    return _column_names_and_parts(path, [], None)[0]


def first_cells_of_column(path: Path, name: str) -> TableCells:
    """The first cells of a column."""
    return next(_column_names_and_parts(path, [name], _BATCH_ROWS)[1])[0]


def _text_table_layout(path: Path) -> TableLayout:
    try:
        return find_layout(path)
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        raise BadInput(f"{path}: is no table that can be read ({reason}), allowed: CSV or Parquet") from None


@contextmanager
def _convert_read_errors_to_bad_input(path: Path) -> Iterator[None]:
    """Within this a table is read. Raises BadInput where it is none."""
    import pyarrow as pa

    try:
        yield
    except (pa.ArrowException, OSError, ValueError) as error:
        reason = " ".join(str(error).split())[:200]
        raise BadInput(f"{path}: is no table that can be read ({reason}), allowed: CSV or Parquet") from None


def check_row_count_and_time(
    path: Path, t_s: Floats, time_column: str = TIME_COLUMN, n_rows_before: int = 0
) -> None:
    """Raise BadInput unless the stamps, of rows with so many before them, are finite and increase."""
    if len(t_s) < 2:
        raise BadInput(f"{path}: has {len(t_s)} rows, allowed: at least 2")
    wrong_rows = np.flatnonzero(~np.isfinite(t_s) | (np.diff(t_s, prepend=-np.inf) <= 0))
    if wrong_rows.size:
        row = n_rows_before + int(wrong_rows[0]) + 1
        raise BadInput(
            f"{path}: {time_column}: row {row}: time does not increase, allowed: increasing seconds"
        )


def _column_names_and_parts(
    path: Path, columns: Collection[str] | None, rows_per_part: int | None
) -> tuple[list[str], Iterator[TablePart]]:
    """The names of a table's columns, and its parts of so many rows; the whole where None.

    Raises BadInput for a wanted name that several columns have."""
    check_is_log_itself(path)
    layout = None if path.suffix.lower() == ".parquet" else _text_table_layout(path)
    with _convert_read_errors_to_bad_input(path):
        names, readable_columns = (
            _check_size_and_list_parquet_columns(path, columns)
            if layout is None
            else (list(layout.column_names), list(layout.column_names))
        )
    doubled_names = layout.doubled_names if layout else _repeated_names(names)
    used_doubled_names = sorted(name for name in doubled_names if columns is not None and name in columns)
    if used_doubled_names:
        raise BadInput(f"{path}: has two columns {used_doubled_names[0]}, allowed: one of a name")
    wanted_columns = [
        name
        for name in readable_columns
        if name not in doubled_names and (columns is None or name in columns)
    ]
    blocks = (
        _read_parquet_batches(path, wanted_columns)
        if layout is None
        else read_cells(path, layout, wanted_columns)
    )
    return names, _join_blocks_into_parts(path, layout, blocks, rows_per_part)


def _join_blocks_into_parts(
    path: Path, layout: TableLayout | None, blocks: Iterator[TableCells], rows_per_part: int | None
) -> Iterator[TablePart]:
    held_blocks: list[TableCells] = []
    with _convert_read_errors_to_bad_input(path):
        for block in blocks:
            held_blocks.append(block)
            n_held_rows = sum(held_block.n_rows for held_block in held_blocks)
            if rows_per_part is None and n_held_rows > _MAX_ROWS:
                raise BadInput(f"{path}: has more than {_MAX_ROWS:,} rows, allowed: up to {_MAX_ROWS:,}")
            while rows_per_part is not None and n_held_rows > MAX_LAST_PART_FACTOR * rows_per_part:
                joined_cells = join_and_consume_blocks(held_blocks)
                part_cells = joined_cells.select_rows(0, rows_per_part)
                remaining_cells = joined_cells.select_rows(
                    rows_per_part - round(PART_OVERLAP_SHARE * rows_per_part)
                )
                part_cells.text_cell_summaries, part_cells.broken_line_beginnings = (
                    joined_cells.text_cell_summaries,
                    joined_cells.broken_line_beginnings,
                )
                held_blocks, n_held_rows = [remaining_cells], remaining_cells.n_rows
                yield (
                    part_cells,
                    list(text_cell_and_layout_remarks(layout, part_cells)) if layout else [],
                    True,
                )
        joined_cells = join_and_consume_blocks(held_blocks)
        if layout:
            check_broken_lines(path, layout, joined_cells)
        yield joined_cells, list(text_cell_and_layout_remarks(layout, joined_cells)) if layout else [], False


def _check_size_and_list_parquet_columns(
    path: Path, columns: Collection[str] | None
) -> tuple[list[str], list[str]]:
    """The columns of a Parquet file, and those of numbers: the others are not even looked into, a list in a
    cell may be any size."""
    from pyarrow import parquet

    with parquet.ParquetFile(path) as file:
        schema = file.schema_arrow
        number_columns = [field.name for field in schema if _is_integer_or_float_type(field.type)]
        _check_parquet_size(
            path, file.metadata, [name for name in number_columns if columns is None or name in columns]
        )
    return list(schema.names), number_columns


def _read_parquet_batches(path: Path, names: Sequence[str]) -> Iterator[TableCells]:
    """The rows of a Parquet file, batch by batch, none last."""
    from pyarrow import parquet

    n_rows_read = 0
    with parquet.ParquetFile(path) as file:
        for batch in file.iter_batches(_BATCH_ROWS, columns=list(names)):
            yield TableCells(
                {name: _number_column_as_floats(batch[name]) for name in names}, batch.num_rows, n_rows_read
            )
            n_rows_read += batch.num_rows
    yield TableCells({name: np.empty(0) for name in names}, 0, n_rows_read)


def _repeated_names(names: Sequence[str]) -> frozenset[str]:
    return frozenset(name for name, n_of_name in Counter(names).items() if n_of_name > 1)


def _check_parquet_size(path: Path, metadata: Any, names: Sequence[str]) -> None:
    """Raise BadInput for more rows or numbers than a flight has: a few bytes may stand for billions."""
    if metadata.num_rows > _MAX_ROWS:
        raise BadInput(f"{path}: has {metadata.num_rows:,} rows, allowed: up to {_MAX_ROWS:,}")
    row_groups = [metadata.row_group(i) for i in range(metadata.num_row_groups)]
    all_column_chunks = [
        row_group.column(i) for row_group in row_groups for i in range(row_group.num_columns)
    ]
    uncompressed_bytes = sum(
        column_chunk.total_uncompressed_size
        for column_chunk in all_column_chunks
        if column_chunk.path_in_schema in set(names)
    )
    n_bytes = max(uncompressed_bytes, _BYTES_PER_NUMBER * metadata.num_rows * len(names))
    if n_bytes > _MAX_NUMBER_BYTES:
        raise BadInput(
            f"{path}: holds {n_bytes / 1e9:,.1f} GB of numbers, allowed: up to {_MAX_NUMBER_BYTES / 1e9:g} GB"
        )


def _is_integer_or_float_type(arrow_type: Any) -> bool:
    import pyarrow as pa

    return bool(pa.types.is_integer(arrow_type) or pa.types.is_floating(arrow_type))


def _number_column_as_floats(column: Any) -> Floats:
    return np.asarray(column.to_numpy(), dtype=float)
