"""A CSV table as people write it: commas, semicolons or tabs, a decimal comma, a header below other lines.

Read in blocks, the columns wanted alone. A cell that holds no number costs itself, a line with too few or too
many cells costs itself; both are counted.
"""

import csv as csv_lines
import re
from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from beaver_ftc.documents import BadInput
from beaver_ftc_logs.readers.time_text import DayCount
from beaver_ftc_logs.recording import Floats

_DELIMITER_TITLES = {",": "commas", ";": "semicolons", "\t": "tabs", "|": "bars"}
_LAYOUT_HEAD_BYTES = 200_000  # of a file, in which its layout is looked for
_MAX_LAYOUT_LINES = 60  # in them
_BLOCK_BYTES = 1_000_000  # that are read at once
_NUMBER_PATTERN = r"^[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?$"
# Share of lines with another number of cells that a table may have.
_BROKEN_SHARE = 0.1


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

    def select_rows(self, first: int, end_row: int | None = None, with_remarks: bool = False) -> "TableCells":
        """The rows from `first` to before `end_row`; with_remarks: and what is said of the whole."""
        numbers = {name: values[first:end_row].copy() for name, values in self.numbers.items()}
        said = (self.text_cells, self.broken_lines) if with_remarks else ()
        return TableCells(numbers, len(range(self.n_rows)[first:end_row]), self.n_rows_before + first, *said)

    def notes(self) -> dict[str, str]:
        """For each column that holds numbers, too, a line on its cells of text."""
        return {
            name: f"{name}: {'1 cell holds' if n == 1 else f'{n} cells hold'} no number, the first in row "
            f"{row}: {cell[:30]!r}"
            for name, (n, row, cell) in self.text_cells.items()
            if np.isfinite(self.numbers[name]).any()
        }


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


@dataclass(frozen=True)
class TextTable:
    """How a table is written: the place of the line with the names, what is between cells and in numbers.

    names: each once. Columns that share a name, one of doubled_names, have their places with it:
    `p (column 2)`."""

    header_line_index: int
    names: tuple[str, ...]
    delimiter: str
    decimal_mark: str
    doubled_names: frozenset[str]

    @property
    def readable_names(self) -> tuple[str, ...]:
        """The columns that may hold numbers: all."""
        return self.names

    @classmethod
    def find(cls, path: Path) -> "TextTable":
        """The table in a file, by its first lines. Raises BadInput with what was found instead."""
        with path.open("rb") as file:
            head = file.read(_LAYOUT_HEAD_BYTES)
        if head[:2] in (b"\xff\xfe", b"\xfe\xff"):
            raise unreadable_error(path, "is written in UTF-16, not in UTF-8")
        lines = head.decode("utf-8-sig", errors="replace").splitlines()[:_MAX_LAYOUT_LINES]
        tables = [*filter(None, (cls._with_delimiter(lines, delimiter) for delimiter in _DELIMITER_TITLES))]
        if not tables:
            raise unreadable_error(path, _describe_unreadable(lines))
        return max(tables, key=lambda table: len(table.names))

    @classmethod
    def _with_delimiter(cls, lines: Sequence[str], delimiter: str) -> "TextTable | None":
        """The table that lines hold if this is what is between cells; None if they hold none: no line of
        names above a line of as many cells with a number, among the next four that are not empty; nor a
        first line of several cells with nothing below."""
        rows = [_split_cells(line_text, delimiter) for line_text in lines]
        for line, header in enumerate(rows):
            below = [row for row in rows[line + 1 :] if row][:4]
            whole = [row for row in below if len(row) == len(header)]
            numbers = [cell for row in whole for cell in row if _is_number_cell(cell)]
            has_names = len(header) > 1 and not any(_is_number_cell(name) for name in header)
            is_without_rows = len(header) > 1 and not below and line == 0
            if not (has_names and numbers) and not is_without_rows:
                continue
            comma = delimiter != "," and any("," in cell for cell in numbers)
            names = [name.strip() for name in (header[0].lstrip("# "), *header[1:])]
            doubled = frozenset(name for name, n in Counter(names).items() if n > 1)
            places = enumerate(names, 1)
            unique = (f"{name} (column {i})".strip() if name in doubled else name for i, name in places)
            return cls(line, tuple(unique), delimiter, "," if comma else ".", doubled)
        return None

    def remarks(self, cells: TableCells) -> Iterator[str]:
        """Yield a line for all that is unusual about the table."""
        if self.header_line_index:
            yield f"names are in line {self.header_line_index + 1}, what is above is left out"
        if self.delimiter != ",":
            comma = ", with a decimal comma" if self.decimal_mark == "," else ""
            yield f"cells are parted by {_DELIMITER_TITLES[self.delimiter]}{comma}"
        if cells.broken_lines:
            yield f"lines with too few or too many cells, left out: {len(cells.broken_lines)}"

    def check_broken_lines(self, path: Path, cells: TableCells) -> None:
        """Raise BadInput where too many lines have another number of cells than the header."""
        n_broken = len(cells.broken_lines)
        n_lines = cells.n_rows + len(cells.broken_lines)
        if n_broken > _BROKEN_SHARE * n_lines:
            reason = f"{n_broken} of {n_lines} lines have another number of cells than the header"
            raise unreadable_error(path, f"{reason}, {len(self.names)}: the first {cells.broken_lines[0]!r}")

    def blocks(self, path: Path, wanted: Sequence[str]) -> Iterator[TableCells]:
        """The numbers of some columns, block by block, one at least. Every cell is read as text: which of
        them hold numbers is found out here, and not by the first block."""
        import pyarrow as pa
        from pyarrow import csv

        broken: list[str] = []

        def record(row: Any) -> str:
            broken.append((row.text or "")[:60])
            return "skip"

        with csv.open_csv(
            path,
            csv.ReadOptions(
                column_names=self.names, skip_rows=self.header_line_index + 1, block_size=_BLOCK_BYTES
            ),
            csv.ParseOptions(delimiter=self.delimiter, invalid_row_handler=record),
            csv.ConvertOptions(
                include_columns=list(wanted) or self.names[:1],
                column_types=dict.fromkeys(self.names, pa.string()),
                strings_can_be_null=True,
            ),
        ) as blocks:
            n_read = 0
            days: defaultdict[str, DayCount] = defaultdict(DayCount)
            for block in blocks:
                cells = TableCells({}, block.num_rows, n_read)
                for name in wanted:
                    numbers = _convert_column(block[name], self.decimal_mark, name, cells, days[name])
                    cells.numbers[name] = numbers
                cells.broken_lines = broken[:]
                broken[:] = []
                n_read += block.num_rows
                yield cells
        yield TableCells({name: np.empty(0) for name in wanted}, 0, n_read, broken_lines=broken)


def unreadable_error(path: Path, reason: str) -> BadInput:
    """The error of a file that holds no table."""
    return BadInput(f"{path}: is no table that can be read ({reason}), allowed: CSV or Parquet")


def _split_cells(line: str, delimiter: str) -> list[str]:
    """The cells of a line, none of one that cannot be read."""
    try:
        return next(csv_lines.reader([line], delimiter=delimiter), [])
    except csv_lines.Error:  # a cell longer than any
        return []


def _is_number_cell(cell: str) -> bool:
    """Whether a cell holds a number, with a decimal point or comma."""
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


def _convert_column(cells: Any, mark: str, name: str, table: TableCells, days: DayCount) -> Floats:
    """A block's column as numbers, a time in words as its seconds; other text in it is counted."""
    import pyarrow as pa
    from pyarrow import compute

    cells = compute.utf8_trim_whitespace(cells)
    if mark == ",":
        cells = compute.replace_substring(cells, ",", ".")
    try:
        values = compute.cast(cells, pa.float64()).to_numpy(zero_copy_only=False)
    except pa.ArrowInvalid:
        is_number = compute.fill_null(compute.match_substring_regex(cells, _NUMBER_PATTERN), True)
        numbers = compute.cast(compute.if_else(is_number, cells, None), pa.float64())
        values = numbers.to_numpy(zero_copy_only=False).copy()
        texts = []
        for row in np.flatnonzero(~is_number.to_numpy(zero_copy_only=False)).tolist():
            text = cells[row].as_py()
            values[row] = days.seconds_of_text(text)
            if text and np.isnan(values[row]):
                texts.append((table.n_rows_before + row + 1, text))
        if texts:
            table.text_cells[name] = (len(texts), *texts[0])
    return np.where(np.isfinite(values), values, np.nan)
