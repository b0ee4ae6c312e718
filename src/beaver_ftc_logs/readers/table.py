"""A CSV or Parquet table with a column of the time, `t_s` or another: one row a sample, one column a
quantity."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from beaver_ftc.documents import BadInput
from beaver_ftc_logs.readers import LAST_PART_FACTOR, PART_OVERLAP_SHARE, check_is_log_itself
from beaver_ftc_logs.readers.cells import TableCells, join_blocks
from beaver_ftc_logs.readers.parquet_table import BATCH_ROWS, MAX_ROWS, ParquetTable
from beaver_ftc_logs.readers.text import TextTable, unreadable_error
from beaver_ftc_logs.recording import (
    Column,
    Floats,
    Ints,
    Mask,
    RecordedFlight,
    TimeSource,
    Wanted,
    nearest_names_text,
)
from beaver_ftc_logs.refusals import refusal
from beaver_ftc_logs.units import TIME_UNITS

TIME_COLUMN = "t_s"
_BROKEN_SHARE = 0.1  # largest share of lines with another number of cells than the header

NumberTable = dict[str, Floats]


def read_parts(
    path: Path,
    time: TimeSource | None = None,
    columns: Wanted = None,
    part_rows: int | None = None,
) -> Iterator[RecordedFlight]:
    """The flight in a table. A table of more than LAST_PART_FACTOR times part_rows rows is returned in parts
    of part_rows rows, so that memory does not grow with the file; only the last part may be longer, up to
    LAST_PART_FACTOR times part_rows. The parts are numbered, and each begins with the end of the part before.

    Cells without a number, and columns that are not read, are nan. time: column of the time and its unit,
    `t_s` in s if None. columns: the columns that are read, all if None. part_rows: if None, the table is one
    part.
    """
    name, unit = time or (TIME_COLUMN, "s")
    table = _open(path)
    parts = _parts(path, table, None if columns is None else {name, *columns}, part_rows)
    if name not in table.names:
        allowed = f"a table with {TIME_COLUMN} in seconds, or its `time` in the vehicle file"
        nearest = nearest_names_text(name, table.names)
        raise refusal(path, f"no column {name}", f"{allowed}; it has {nearest}")
    for part, (cells, has_more) in enumerate(parts, 1):
        numbers = _whole(table, cells)
        t_s = numbers.pop(name) * TIME_UNITS[unit]
        kept, left_out = _timed_rows(path, name, t_s, cells)
        check_time(path, t_s[kept], name, cells.n_rows_before + 1 + np.flatnonzero(kept))
        t_s = t_s[kept]
        notes = cells.notes()
        read = {key: Column(t_s, values[kept], notes.get(key, "")) for key, values in numbers.items()}
        title = f"{path.stem}-part-{part}" if has_more or part > 1 else path.stem
        yield RecordedFlight(title, read, notes=(*table.remarks(cells), *left_out))


def _timed_rows(path: Path, time: str, t_s: Floats, cells: TableCells) -> tuple[Mask, list[str]]:
    """Whether the time of each row is a finite number (n,), and a line on the others. Raises BadInput if
    these are more than half. time: name of the column."""
    kept = np.isfinite(t_s)
    n_bad = int((~kept).sum())
    if not n_bad:
        return kept, []
    if n_bad > len(t_s) // 2:
        reason = f"{n_bad} of {len(t_s)} rows hold no number{text_of_column_phrase(cells, time)}"
        raise refusal(path, f"{time}: {reason}", "increasing time")
    return kept, [f"{time}: rows without a number, left out: {n_bad} of {len(t_s)}"]


def text_of_column_phrase(cells: TableCells, name: str) -> str:
    """`, but text such as '7 ticks'` for a column with cells of text; empty for another one."""
    return f", but text such as {cells.text_cells[name][2][:30]!r}" if name in cells.text_cells else ""


def read_numbers(path: Path, columns: Sequence[str] | None = None) -> NumberTable:
    """The numbers of the columns of a table, nan where there is none: of all columns, or of those named that
    the table has. Raises BadInput if the file is no table, or larger than any flight.
    """
    table = _open(path)
    numbers = _whole(table, next(_parts(path, table, columns))[0])
    return {name: values for name, values in numbers.items() if columns is None or name in columns}


def column_names(path: Path) -> list[str]:
    """The names of the columns of a table. Raises BadInput if the file is no table."""
    return list(_open(path).names)


def first_cells_of_column(path: Path, name: str) -> TableCells:
    """The first BATCH_ROWS cells of a column, or all if there are at most LAST_PART_FACTOR times as many."""
    return next(_parts(path, _open(path), [name], BATCH_ROWS))[0]


def check_time(path: Path, t_s: Floats, time: str = TIME_COLUMN, rows: Ints | None = None) -> None:
    """Raise BadInput unless the stamps are finite and increase. rows (n,): numbers of their rows in the
    table, from 1; 1 to n if None."""
    if len(t_s) < 2:
        raise refusal(path, f"has {len(t_s)} rows", "at least 2")
    wrong = np.flatnonzero(~np.isfinite(t_s) | (np.diff(t_s, prepend=-np.inf) <= 0))
    if wrong.size:
        row = wrong[0] + 1 if rows is None else rows[wrong[0]]
        raise refusal(path, f"{time}: row {row}: time does not increase", "increasing seconds")


@contextmanager
def _read_errors(path: Path) -> Iterator[None]:
    """Context in which a table is read: errors of the packages become BadInput."""
    import pyarrow as pa

    try:
        yield
    except (pa.ArrowException, OSError, ValueError) as error:
        system_text = getattr(error, "strerror", None)
        reason = system_text.lower() if system_text else " ".join(str(error).split())[:200]
        raise unreadable_error(path, reason) from None


def _open(path: Path) -> TextTable | ParquetTable:
    """The table in a file. Raises BadInput if the file is no table."""
    check_is_log_itself(path)
    with _read_errors(path):
        return ParquetTable(path) if path.suffix.lower() == ".parquet" else TextTable.find(path)


def _parts(
    path: Path, table: TextTable | ParquetTable, columns: Wanted, part_rows: int | None = None
) -> Iterator[tuple[TableCells, bool]]:
    """Yield the columns that are wanted, all if None, in parts of part_rows rows that overlap, one part if
    None; and whether further parts follow. Raises BadInput for a wanted name that several columns have.

    held: the blocks of the next part so far, which begin with the end of the part before.
    """
    doubled = table.doubled_names
    ambiguous = sorted(name for name in doubled if columns is not None and name in columns)
    if ambiguous:
        raise refusal(path, f"has two columns {ambiguous[0]}", "one of a name")
    wanted = [name for name in table.names if name not in doubled and (columns is None or name in columns)]
    held: list[TableCells] = []
    with _read_errors(path):
        for block in table.blocks(path, wanted):
            held.append(block)
            n_held = sum(held_block.n_rows for held_block in held)
            if part_rows is None and n_held > MAX_ROWS:
                reason = f"has more than {MAX_ROWS:,} rows, allowed: up to {MAX_ROWS:,}"
                raise BadInput(f"{path}: {reason}")
            while part_rows is not None and n_held > LAST_PART_FACTOR * part_rows:
                joined = _joined(path, table, held)
                remainder = joined.select_rows(part_rows - round(PART_OVERLAP_SHARE * part_rows))
                held = [remainder]
                n_held = remainder.n_rows
                yield joined.select_rows(0, part_rows, with_remarks=True), True
        yield _joined(path, table, held), False


def _joined(path: Path, table: TextTable | ParquetTable, held: list[TableCells]) -> TableCells:
    """The blocks as one. Raises BadInput if too many lines have another number of cells than the header."""
    cells = join_blocks(held)
    n_broken = len(cells.broken_lines)
    n_lines = cells.n_rows + n_broken
    if n_broken > _BROKEN_SHARE * n_lines:
        reason = f"{n_broken} of {n_lines} lines have another number of cells than the header"
        raise unreadable_error(path, f"{reason}, {len(table.names)}: the first {cells.broken_lines[0]!r}")
    return cells


def _whole(table: TextTable | ParquetTable, cells: TableCells) -> NumberTable:
    """The cells of all columns; a column that was not read is nan."""
    blank = np.broadcast_to(np.nan, cells.n_rows)
    return {name: cells.numbers.get(name, blank) for name in table.names}
