"""A CSV table as people write it: commas, semicolons or tabs, a decimal comma, a header below other lines.

Only the wanted columns are read, in blocks. A cell without a number becomes nan, and a line with too few or
too many cells is left out. Both are counted.
"""

import csv as csv_lines
import re
from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from beaver_ftc.documents import BadInput
from beaver_ftc_logs.readers.cells import TableCells
from beaver_ftc_logs.readers.time_text import DayCount
from beaver_ftc_logs.recording import Floats

_DELIMITER_TITLES = {",": "commas", ";": "semicolons", "\t": "tabs", "|": "bars"}
_LAYOUT_HEAD_BYTES = 200_000  # the layout of a file is found from its first bytes,
_MAX_LAYOUT_LINES = 60  # and from these lines of them at most
_BLOCK_BYTES = 1_000_000  # number of bytes that are read at once
_NUMBER_PATTERN = r"^[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?$"


@dataclass(frozen=True)
class TextTable:
    """The layout of a table.

    header_line_index: position of the line with the names. names: each occurs once; columns that share a
    name, one of doubled_names, get their positions: `p (column 2)`. delimiter: between cells. decimal_mark:
    in numbers.
    """

    header_line_index: int
    names: tuple[str, ...]
    delimiter: str
    decimal_mark: str
    doubled_names: frozenset[str]

    @classmethod
    def find(cls, path: Path) -> "TextTable":
        """The table in a file, by its first lines: of the delimiters that fit, the one with most columns.
        Raises BadInput with a description of another content.
        """
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
        """The table in the lines if this delimiter is between cells; None if there is none.

        The header is the first line of several cells that

        - are no numbers, if one of the next four lines that are not empty has as many cells, with a number;
        - or are all that the lines hold, i.e. it is the first line, with nothing below.
        """
        rows = [_split_cells(line_text, delimiter) for line_text in lines]
        for line, header in enumerate(rows):
            next_rows = [row for row in rows[line + 1 :] if row][:4]
            full_rows = [row for row in next_rows if len(row) == len(header)]
            numbers = [cell for row in full_rows for cell in row if _is_number_cell(cell)]
            has_names = len(header) > 1 and not any(_is_number_cell(name) for name in header)
            is_without_rows = len(header) > 1 and not next_rows and line == 0
            if not (has_names and numbers) and not is_without_rows:
                continue
            comma = delimiter != "," and any("," in cell for cell in numbers)
            names = [name.strip() for name in (header[0].lstrip("# "), *header[1:])]
            doubled = frozenset(name for name, n in Counter(names).items() if n > 1)
            positions = enumerate(names, 1)
            unique = (f"{name} (column {i})".strip() if name in doubled else name for i, name in positions)
            return cls(line, tuple(unique), delimiter, "," if comma else ".", doubled)
        return None

    def remarks(self, cells: TableCells) -> Iterator[str]:
        """Yield a line for each unusual property of the table."""
        if self.header_line_index:
            yield f"names are in line {self.header_line_index + 1}, what is above is left out"
        if self.delimiter != ",":
            comma = ", with a decimal comma" if self.decimal_mark == "," else ""
            yield f"cells are parted by {_DELIMITER_TITLES[self.delimiter]}{comma}"
        if cells.broken_lines:
            yield f"lines with too few or too many cells, left out: {len(cells.broken_lines)}"

    def blocks(self, path: Path, wanted: Sequence[str]) -> Iterator[TableCells]:
        """The numbers of some columns in blocks, at least one. Every cell is read as text and then converted
        here, so that the type of a column does not depend on its first block.
        """
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
    """The error for a file without a readable table."""
    return BadInput(f"{path}: is no table that can be read ({reason}), allowed: CSV or Parquet")


def _split_cells(line: str, delimiter: str) -> list[str]:
    """The cells of a line; none if the line cannot be read."""
    try:
        return next(csv_lines.reader([line], delimiter=delimiter), [])
    except csv_lines.Error:  # a cell is longer than the reader allows
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
    """A column of a block as numbers. Times as text become seconds (`DayCount`); other text is nan, and is
    counted in the table's text_cells. mark: decimal mark.
    """
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
