"""A CSV table as people write it: commas, semicolons or tabs, a decimal comma, a header below other lines.

Read in blocks, the columns wanted alone. A cell that holds no number costs itself, a line with too few or too
many cells costs itself; both are counted.
"""

import csv as csv_lines
import re
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator, Sequence
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
_MAX_BROKEN_LINE_SHARE = 0.1
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
    text_cell_summaries: dict[str, tuple[int, int, str]] = field(default_factory=dict)
    broken_line_beginnings: list[str] = field(default_factory=list)

    def select_rows(self, first_row: int, end_row: int | None = None) -> "TableCells":
        """The rows from first_row to before end_row, of which nothing else is said."""
        numbers = {name: values[first_row:end_row].copy() for name, values in self.numbers.items()}
        return TableCells(numbers, len(range(self.n_rows)[first_row:end_row]), self.n_rows_before + first_row)


def join_and_consume_blocks(blocks: Sequence[TableCells]) -> TableCells:
    """Blocks that follow one another as one; they are used up."""
    first_block = blocks[0]
    column_names = list(first_block.numbers)
    numbers = {name: np.concatenate([block.numbers.pop(name) for block in blocks]) for name in column_names}
    joined_cells = TableCells(numbers, sum(block.n_rows for block in blocks), first_block.n_rows_before)
    for block in blocks:
        joined_cells.broken_line_beginnings += block.broken_line_beginnings
        for name, (n_text_cells, row, cell) in block.text_cell_summaries.items():
            earlier_summary = joined_cells.text_cell_summaries.get(name, (0, row, cell))
            joined_cells.text_cell_summaries[name] = (earlier_summary[0] + n_text_cells, *earlier_summary[1:])
    return joined_cells


def find_layout(path: Path) -> TableLayout:
    """How a file's table is written, by its first lines. Raises BadInput with what was found instead."""
    with path.open("rb") as file:
        first_bytes = file.read(_LAYOUT_HEAD_BYTES)
    if first_bytes[:2] in (b"\xff\xfe", b"\xfe\xff"):
        raise _unreadable_error(path, "is written in UTF-16, not in UTF-8")
    lines = first_bytes.decode("utf-8-sig", errors="replace").splitlines()[:_MAX_LAYOUT_LINES]
    layouts = [
        layout for delimiter in _DELIMITER_TITLES if (layout := _layout_with_delimiter(lines, delimiter))
    ]
    if not layouts:
        raise _unreadable_error(path, _describe_unreadable(lines))
    return max(layouts, key=lambda layout: len(layout.column_names))


def _unreadable_error(path: Path, reason: str) -> BadInput:
    return BadInput(f"{path}: is no table that can be read ({reason}), allowed: CSV or Parquet")


def _layout_with_delimiter(lines: Sequence[str], delimiter: str) -> TableLayout | None:
    """The table that lines hold if this is what is between cells; None if they hold none."""
    lines_of_cells = [_split_cells(line_text, delimiter) for line_text in lines]
    for line_index, header_cells in enumerate(lines_of_cells):
        first_rows_below = [row for row in lines_of_cells[line_index + 1 :] if row][:4]
        if not first_rows_below and line_index == 0 and len(header_cells) > 1:
            return _layout_of_header(line_index, header_cells, delimiter, ".")  # a table of no rows
        has_as_many_cells_as_header = [len(row) == len(header_cells) for row in first_rows_below]
        if (
            len(header_cells) < 2
            or any(_is_number_cell(name) for name in header_cells)
            or not any(has_as_many_cells_as_header)
        ):
            continue
        number_cells = [
            cell
            for row in first_rows_below
            if len(row) == len(header_cells)
            for cell in row
            if _is_number_cell(cell)
        ]
        if number_cells:
            has_decimal_comma = delimiter != "," and any("," in cell for cell in number_cells)
            return _layout_of_header(line_index, header_cells, delimiter, "," if has_decimal_comma else ".")
    return None


def _layout_of_header(
    line_index: int, header_cells: Sequence[str], delimiter: str, decimal_mark: str
) -> TableLayout:
    names = [name.strip() for name in (header_cells[0].lstrip("# "), *header_cells[1:])]
    doubled_names = frozenset(name for name, n_of_name in Counter(names).items() if n_of_name > 1)
    unique_names = (
        f"{name} (column {place})".strip() if name in doubled_names else name
        for place, name in enumerate(names, 1)
    )
    return TableLayout(line_index, tuple(unique_names), delimiter, decimal_mark, doubled_names)


def _split_cells(line: str, delimiter: str) -> list[str]:
    try:
        return next(csv_lines.reader([line], delimiter=delimiter), [])
    except csv_lines.Error:  # a cell longer than any
        return []


def _is_number_cell(cell: str) -> bool:
    return bool(re.match(_NUMBER_PATTERN, cell.strip().replace(",", ".")))


def _describe_unreadable(lines: Sequence[str]) -> str:
    """Describe the content of a file that has no names and numbers."""
    first_line = next((line for line in lines if line.strip()), None)
    if first_line is None:
        return "it is empty"
    if not all(character.isprintable() or character == "\t" for character in first_line[:80]):
        return "it holds bytes that are no text"
    cells = max((_split_cells(first_line, delimiter) for delimiter in _DELIMITER_TITLES), key=len)
    if all(map(_is_number_cell, cells)):
        return f"its first line holds numbers and no names: {first_line[:60]!r}"
    return f"no line of names with a line of as many numbers below it; it begins {first_line[:60]!r}"


def read_cells(path: Path, layout: TableLayout, wanted_columns: Sequence[str]) -> Iterator[TableCells]:
    """The numbers of some of a file's columns, block by block, one at least."""
    from pyarrow import csv

    broken_line_beginnings: list[str] = []
    options = {
        "read_options": csv.ReadOptions(
            column_names=layout.column_names, skip_rows=layout.header_line_index + 1, block_size=_BLOCK_BYTES
        ),
        "parse_options": csv.ParseOptions(
            delimiter=layout.delimiter, invalid_row_handler=_broken_line_recorder(broken_line_beginnings)
        ),
        "convert_options": _all_text_conversion(layout.column_names, wanted_columns),
    }
    n_rows_read = 0
    days_by_column: defaultdict[str, DayCount] = defaultdict(DayCount)
    with csv.open_csv(path, **options) as blocks:
        for block in blocks:
            cells = TableCells({}, block.num_rows, n_rows_read)
            cells.numbers = {
                name: _convert_column_and_record_text(
                    block[name], layout.decimal_mark, name, cells, days_by_column[name]
                )
                for name in wanted_columns
            }
            cells.broken_line_beginnings, broken_line_beginnings[:] = broken_line_beginnings[:], []
            n_rows_read += block.num_rows
            yield cells
    yield TableCells(
        {name: np.empty(0) for name in wanted_columns},
        0,
        n_rows_read,
        broken_line_beginnings=broken_line_beginnings,
    )


def check_broken_lines(path: Path, layout: TableLayout, cells: TableCells) -> None:
    """Raise BadInput where too many lines have another number of cells than the header."""
    n_broken, n_lines = len(cells.broken_line_beginnings), cells.n_rows + len(cells.broken_line_beginnings)
    if n_broken > _MAX_BROKEN_LINE_SHARE * n_lines:
        reason = f"{n_broken} of {n_lines} lines have another number of cells than the header"
        raise _unreadable_error(
            path, f"{reason}, {len(layout.column_names)}: the first {cells.broken_line_beginnings[0]!r}"
        )


def _broken_line_recorder(broken_line_beginnings: list[str]) -> Callable[[Any], str]:
    def record_line(row: Any) -> str:
        broken_line_beginnings.append((row.text or "")[:60])
        return "skip"

    return record_line


def _all_text_conversion(column_names: Sequence[str], wanted_columns: Sequence[str]) -> Any:
    """Every cell as text: which of them hold numbers is found out here, and not by the first block."""
    import pyarrow as pa
    from pyarrow import csv

    return csv.ConvertOptions(
        include_columns=list(wanted_columns) or list(islice(column_names, 1)),
        column_types=dict.fromkeys(column_names, pa.string()),
        strings_can_be_null=True,
    )


def _convert_column_and_record_text(
    cells: Any, decimal_mark: str, column_name: str, table_cells: TableCells, days: DayCount
) -> Floats:
    """A block's column as numbers, a time in words as its seconds; other text in it is counted."""
    import pyarrow as pa
    from pyarrow import compute

    cells = compute.utf8_trim_whitespace(cells)
    if decimal_mark == ",":
        cells = compute.replace_substring(cells, ",", ".")
    try:
        numbers = compute.cast(cells, pa.float64())
    except pa.ArrowInvalid:
        is_number_or_null = compute.fill_null(compute.match_substring_regex(cells, _NUMBER_PATTERN), True)
        numbers = compute.cast(compute.if_else(is_number_or_null, cells, None), pa.float64())
        values = numbers.to_numpy(zero_copy_only=False).copy()
        text_rows = np.flatnonzero(~is_number_or_null.to_numpy(zero_copy_only=False)).tolist()
        for row in text_rows:
            text = cells[row].as_py()
            values[row] = days.continued(seconds_of_text(text)) if is_clock(text) else seconds_of_text(text)
        _record_text_cells(
            column_name, cells, [row for row in text_rows if np.isnan(values[row])], table_cells
        )
        return np.where(np.isfinite(values), values, np.nan)
    values = numbers.to_numpy(zero_copy_only=False)
    return np.where(np.isfinite(values), values, np.nan)


def _record_text_cells(
    column_name: str, cells: Any, rows_without_number: Sequence[int], table_cells: TableCells
) -> None:
    text_rows = [row for row in rows_without_number if cells[row].as_py()]
    if text_rows:
        table_cells.text_cell_summaries[column_name] = (
            len(text_rows),
            table_cells.n_rows_before + text_rows[0] + 1,
            str(cells[text_rows[0]]),
        )


def text_cell_and_layout_remarks(layout: TableLayout, table_cells: TableCells) -> Iterator[tuple[str, str]]:
    """Yield for each column a line on its cells of text, where it holds numbers too; under an empty name what
    is unusual about the whole."""
    for name, (n_text_cells, first_text_row, first_cell) in table_cells.text_cell_summaries.items():
        if np.isfinite(table_cells.numbers[name]).any():
            count_text = "1 cell holds" if n_text_cells == 1 else f"{n_text_cells} cells hold"
            yield (
                name,
                f"{name}: {count_text} no number, the first in row {first_text_row}: {first_cell[:30]!r}",
            )
    if layout.header_line_index:
        yield "", f"names are in line {layout.header_line_index + 1}, what is above is left out"
    if layout.delimiter != ",":
        decimal_comma_text = ", with a decimal comma" if layout.decimal_mark == "," else ""
        yield "", f"cells are parted by {_DELIMITER_TITLES[layout.delimiter]}{decimal_comma_text}"
    if table_cells.broken_line_beginnings:
        yield "", f"lines with too few or too many cells, left out: {len(table_cells.broken_line_beginnings)}"
