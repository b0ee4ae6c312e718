"""A CSV table as people write it: commas, semicolons or tabs, a decimal comma, a header below other lines.

Read in blocks, the columns wanted alone. A cell that holds no number costs itself, a line with too few or too
many cells costs itself; both are counted.
"""

import csv as csv_lines
import re
from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from beaver_ftc.documents import BadInput
from beaver_ftc_logs.readers.time_text import DayCount, is_clock, seconds_of_text
from beaver_ftc_logs.recording import Floats

_DELIMITER_TITLES = {",": "commas", ";": "semicolons", "\t": "tabs", "|": "bars"}
_LAYOUT_HEAD_BYTES, _MAX_LAYOUT_LINES, _BLOCK_BYTES = 200_000, 60, 1_000_000
_NUMBER_PATTERN = r"^[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?$"
_BROKEN_SHARE = 0.1
"""Share of lines with another number of cells that a table may have."""


@dataclass(frozen=True)
class TableLayout:
    """How a table is written: the place of the line with the names, what is between cells and in numbers.

    column_names: each once. Columns that share a name, one of doubled_names, have their places with it:
    `p (column 2)`."""

    header_line_index: int
    column_names: tuple[str, ...]
    delimiter: str
    decimal_mark: str
    doubled_names: frozenset[str] = frozenset()


@dataclass
class TableCells:
    """Cells that were read: numbers by column, nan where there is none; of each column its cells of text, the
    first of them with its row; the lines left out, by their beginnings; how many rows there are, and
    before."""

    numbers: dict[str, Floats]
    n_rows: int
    n_rows_before: int = 0
    text_cells: dict[str, tuple[int, int, str]] = field(default_factory=dict)
    broken_lines: list[str] = field(default_factory=list)

    def select_rows(self, first: int, end_row: int | None = None) -> "TableCells":
        """The rows from `first` to before `end_row`, of which nothing else is said."""
        numbers = {name: values[first:end_row].copy() for name, values in self.numbers.items()}
        return TableCells(numbers, len(range(self.n_rows)[first:end_row]), self.n_rows_before + first)


def join_blocks(blocks: Sequence[TableCells]) -> TableCells:
    """Blocks that follow one another as one; they are used up."""
    first = blocks[0]
    column_names = list(first.numbers)
    numbers = {name: np.concatenate([block.numbers.pop(name) for block in blocks]) for name in column_names}
    joined = TableCells(numbers, sum(block.n_rows for block in blocks), first.n_rows_before)
    for block in blocks:
        joined.broken_lines += block.broken_lines
        for name, (n_texts, row, cell) in block.text_cells.items():
            earlier = joined.text_cells.get(name, (0, row, cell))
            joined.text_cells[name] = (earlier[0] + n_texts, *earlier[1:])
    return joined


def find_layout(path: Path) -> TableLayout:
    """How a file's table is written, by its first lines. Raises BadInput with what was found instead."""
    with path.open("rb") as file:
        head = file.read(_LAYOUT_HEAD_BYTES)
    if head[:2] in (b"\xff\xfe", b"\xfe\xff"):
        raise _unreadable_error(path, "is written in UTF-16, not in UTF-8")
    lines = head.decode("utf-8-sig", errors="replace").splitlines()[:_MAX_LAYOUT_LINES]
    layouts = [*filter(None, (_layout_with_delimiter(lines, delimiter) for delimiter in _DELIMITER_TITLES))]
    if not layouts:
        raise _unreadable_error(path, _describe_unreadable(lines))
    return max(layouts, key=lambda layout: len(layout.column_names))


def _unreadable_error(path: Path, reason: str) -> BadInput:
    return BadInput(f"{path}: is no table that can be read ({reason}), allowed: CSV or Parquet")


def _layout_with_delimiter(lines: Sequence[str], delimiter: str) -> TableLayout | None:
    """The table that lines hold if this is what is between cells; None if they hold none."""
    rows = [_split_cells(line_text, delimiter) for line_text in lines]
    for line, header in enumerate(rows):
        below = [row for row in rows[line + 1 :] if row][:4]
        if not below and line == 0 and len(header) > 1:
            return _layout_of_header(line, header, delimiter, ".")  # a table of no rows
        fits = [len(row) == len(header) for row in below]
        if len(header) < 2 or any(_is_number_cell(name) for name in header) or not any(fits):
            continue
        numbers = [cell for row in below if len(row) == len(header) for cell in row if _is_number_cell(cell)]
        if numbers:
            comma = delimiter != "," and any("," in cell for cell in numbers)
            return _layout_of_header(line, header, delimiter, "," if comma else ".")
    return None


def _layout_of_header(line: int, header: Sequence[str], delimiter: str, mark: str) -> TableLayout:
    names = [name.strip() for name in (header[0].lstrip("# "), *header[1:])]
    doubled = frozenset(name for name, n in Counter(names).items() if n > 1)
    unique = (
        f"{name} (column {place})".strip() if name in doubled else name for place, name in enumerate(names, 1)
    )
    return TableLayout(line, tuple(unique), delimiter, mark, doubled)


def _split_cells(line: str, delimiter: str) -> list[str]:
    try:
        return next(csv_lines.reader([line], delimiter=delimiter), [])
    except csv_lines.Error:  # a cell longer than any
        return []


def _is_number_cell(cell: str) -> bool:
    return bool(re.match(_NUMBER_PATTERN, cell.strip().replace(",", ".")))


def _describe_unreadable(lines: Sequence[str]) -> str:
    """Describe the content of a file that has no names and numbers."""
    first = next((line for line in lines if line.strip()), None)
    if first is None:
        return "it is empty"
    if not all(sign.isprintable() or sign == "\t" for sign in first[:80]):
        return "it holds bytes that are no text"
    cells = max((_split_cells(first, delimiter) for delimiter in _DELIMITER_TITLES), key=len)
    if all(map(_is_number_cell, cells)):
        return f"its first line holds numbers and no names: {first[:60]!r}"
    return f"no line of names with a line of as many numbers below it; it begins {first[:60]!r}"


def read_cells(path: Path, layout: TableLayout, wanted: Sequence[str]) -> Iterator[TableCells]:
    """The numbers of some of a file's columns, block by block, one at least."""
    from pyarrow import csv

    broken: list[str] = []

    def record(row: Any) -> str:
        broken.append((row.text or "")[:60])
        return "skip"

    options = {
        "read_options": csv.ReadOptions(
            column_names=layout.column_names, skip_rows=layout.header_line_index + 1, block_size=_BLOCK_BYTES
        ),
        "parse_options": csv.ParseOptions(delimiter=layout.delimiter, invalid_row_handler=record),
        "convert_options": _all_text_conversion(layout.column_names, wanted),
    }
    n_read = 0
    days: defaultdict[str, DayCount] = defaultdict(DayCount)
    with csv.open_csv(path, **options) as blocks:
        for block in blocks:
            cells = TableCells({}, block.num_rows, n_read)
            for name in wanted:
                numbers = _convert_column(block[name], layout.decimal_mark, name, cells, days[name])
                cells.numbers[name] = numbers
            cells.broken_lines, broken[:] = broken[:], []
            n_read += block.num_rows
            yield cells
    yield TableCells({name: np.empty(0) for name in wanted}, 0, n_read, broken_lines=broken)


def check_broken_lines(path: Path, layout: TableLayout, cells: TableCells) -> None:
    """Raise BadInput where too many lines have another number of cells than the header."""
    n_broken, n_lines = len(cells.broken_lines), cells.n_rows + len(cells.broken_lines)
    if n_broken > _BROKEN_SHARE * n_lines:
        reason = f"{n_broken} of {n_lines} lines have another number of cells than the header"
        first = f"{len(layout.column_names)}: the first {cells.broken_lines[0]!r}"
        raise _unreadable_error(path, f"{reason}, {first}")


def _all_text_conversion(column_names: Sequence[str], wanted: Sequence[str]) -> Any:
    """Every cell as text: which of them hold numbers is found out here, and not by the first block."""
    import pyarrow as pa
    from pyarrow import csv

    return csv.ConvertOptions(
        include_columns=list(wanted) or list(islice(column_names, 1)),
        column_types=dict.fromkeys(column_names, pa.string()),
        strings_can_be_null=True,
    )


def _convert_column(cells: Any, mark: str, name: str, table: TableCells, days: DayCount) -> Floats:
    """A block's column as numbers, a time in words as its seconds; other text in it is counted."""
    import pyarrow as pa
    from pyarrow import compute

    cells = compute.utf8_trim_whitespace(cells)
    if mark == ",":
        cells = compute.replace_substring(cells, ",", ".")
    try:
        numbers = compute.cast(cells, pa.float64())
    except pa.ArrowInvalid:
        is_number = compute.fill_null(compute.match_substring_regex(cells, _NUMBER_PATTERN), True)
        numbers = compute.cast(compute.if_else(is_number, cells, None), pa.float64())
        values = numbers.to_numpy(zero_copy_only=False).copy()
        rows = np.flatnonzero(~is_number.to_numpy(zero_copy_only=False)).tolist()
        for row in rows:
            text = cells[row].as_py()
            values[row] = days.continued(seconds_of_text(text)) if is_clock(text) else seconds_of_text(text)
        _record_text_cells(name, cells, [row for row in rows if np.isnan(values[row])], table)
        return np.where(np.isfinite(values), values, np.nan)
    values = numbers.to_numpy(zero_copy_only=False)
    return np.where(np.isfinite(values), values, np.nan)


def _record_text_cells(name: str, cells: Any, bare: Sequence[int], table: TableCells) -> None:
    rows = [row for row in bare if cells[row].as_py()]
    if rows:
        table.text_cells[name] = (len(rows), table.n_rows_before + rows[0] + 1, str(cells[rows[0]]))


def table_remarks(layout: TableLayout, table: TableCells) -> Iterator[tuple[str, str]]:
    """Yield for each column a line on its cells of text, where it holds numbers too; under an empty name what
    is unusual about the whole."""
    for name, (n_texts, row, first_cell) in table.text_cells.items():
        if np.isfinite(table.numbers[name]).any():
            count_text = "1 cell holds" if n_texts == 1 else f"{n_texts} cells hold"
            yield (name, f"{name}: {count_text} no number, the first in row {row}: {first_cell[:30]!r}")
    if layout.header_line_index:
        yield "", f"names are in line {layout.header_line_index + 1}, what is above is left out"
    if layout.delimiter != ",":
        comma = ", with a decimal comma" if layout.decimal_mark == "," else ""
        yield "", f"cells are parted by {_DELIMITER_TITLES[layout.delimiter]}{comma}"
    if table.broken_lines:
        yield "", f"lines with too few or too many cells, left out: {len(table.broken_lines)}"
