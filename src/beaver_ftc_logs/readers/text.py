"""A CSV table as people write it: commas, semicolons or tabs, a decimal comma, a header below other lines.

Read in blocks, the columns wanted alone. A cell that holds no number costs itself, a line with too few or too
many cells costs itself; both are counted.
"""

import csv as lines_of
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from beaver_ftc.documents import BadInput
from beaver_ftc_logs.recording import Floats

_DELIMITERS = {",": "commas", ";": "semicolons", "\t": "tabs", "|": "bars"}
_HEAD_BYTES, _HEAD_LINES, _BLOCK_BYTES = 200_000, 60, 1_000_000
_NUMBER = r"^[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?$"
_MOST_BROKEN = 0.1
"""Share of lines with another number of cells that a table may have."""


@dataclass(frozen=True)
class Layout:
    """How a table is written: the place of the line with the names, what is between cells and in numbers."""

    header: int
    names: tuple[str, ...]
    delimiter: str
    decimal: str


@dataclass
class Cells:
    """What was read: numbers by column, nan where there is none; of each column its cells of text, the first
    of them with its row; the lines left out, by their beginnings; how many rows there are, and before."""

    numbers: dict[str, Floats]
    rows: int
    before: int = 0
    text: dict[str, tuple[int, int, str]] = field(default_factory=dict)
    broken: list[str] = field(default_factory=list)

    def rows_from(self, first: int, end: int | None = None) -> "Cells":
        """The rows from the first to the end, of which nothing else is said."""
        numbers = {name: values[first:end].copy() for name, values in self.numbers.items()}
        return Cells(numbers, len(range(self.rows)[first:end]), self.before + first)


def joined(blocks: Sequence[Cells]) -> Cells:
    """Blocks that follow one another as one; they are used up."""
    first = blocks[0]
    names = list(first.numbers)
    numbers = {name: np.concatenate([one.numbers.pop(name) for one in blocks]) for name in names}
    found = Cells(numbers, sum(one.rows for one in blocks), first.before)
    for one in blocks:
        found.broken += one.broken
        for name, (many, row, cell) in one.text.items():
            known = found.text.get(name, (0, row, cell))
            found.text[name] = (known[0] + many, *known[1:])
    return found


def layout_of(path: Path) -> Layout:
    """How a file's table is written, by its first lines. Raises BadInput with what was found instead."""
    with path.open("rb") as file:
        head = file.read(_HEAD_BYTES)
    if head[:2] in (b"\xff\xfe", b"\xfe\xff"):
        raise _no_table(path, "is written in UTF-16, not in UTF-8")
    lines = head.decode("utf-8-sig", errors="replace").splitlines()[:_HEAD_LINES]
    found = [layout for delimiter in _DELIMITERS if (layout := _layout(lines, delimiter))]
    if not found:
        raise _no_table(path, _instead(lines))
    return max(found, key=lambda layout: len(layout.names))


def _no_table(path: Path, says: str) -> BadInput:
    return BadInput(f"{path}: is no table that can be read ({says}), allowed: CSV or Parquet")


def _layout(lines: Sequence[str], delimiter: str) -> Layout | None:
    """The table that lines hold if this is what is between cells; None if they hold none."""
    rows = [_cells(line, delimiter) for line in lines]
    for place, names in enumerate(rows):
        below = [row for row in rows[place + 1 :] if row][:4]
        if not below and place == 0 and len(names) > 1:
            return Layout(place, tuple(names), delimiter, ".")  # a table of no rows
        counts = [len(row) == len(names) for row in below]
        if len(names) < 2 or any(_is_number(name) for name in names) or not any(counts):
            continue
        numbers = [cell for row in below if len(row) == len(names) for cell in row if _is_number(cell)]
        if numbers:
            comma = delimiter != "," and any("," in cell for cell in numbers)
            named = tuple(name.strip() for name in (names[0].lstrip("# "), *names[1:]))
            return Layout(place, named, delimiter, "," if comma else ".")
    return None


def _cells(line: str, delimiter: str) -> list[str]:
    try:
        return next(lines_of.reader([line], delimiter=delimiter), [])
    except lines_of.Error:  # a cell longer than any
        return []


def _is_number(cell: str) -> bool:
    return bool(re.match(_NUMBER, cell.strip().replace(",", ".")))


def _instead(lines: Sequence[str]) -> str:
    """What a file has in the place of names and numbers."""
    first = next((line for line in lines if line.strip()), None)
    if first is None:
        return "it is empty"
    if not all(character.isprintable() or character == "\t" for character in first[:80]):
        return "it holds bytes that are no text"
    cells = max((_cells(first, delimiter) for delimiter in _DELIMITERS), key=len)
    if all(map(_is_number, cells)):
        return f"its first line holds numbers and no names: {first[:60]!r}"
    return f"no line of names with a line of as many numbers below it; it begins {first[:60]!r}"


def read_cells(path: Path, layout: Layout, wanted: Sequence[str]) -> Iterator[Cells]:
    """The numbers of some of a file's columns, block by block, one at least."""
    from pyarrow import csv

    broken: list[str] = []
    options = {
        "read_options": csv.ReadOptions(
            column_names=layout.names, skip_rows=layout.header + 1, block_size=_BLOCK_BYTES
        ),
        "parse_options": csv.ParseOptions(delimiter=layout.delimiter, invalid_row_handler=_left_out(broken)),
        "convert_options": _as_text(layout.names, wanted),
    }
    rows = 0
    with csv.open_csv(path, **options) as blocks:
        for block in blocks:
            found = Cells({}, block.num_rows, rows)
            found.numbers = {name: _numbers(block[name], layout.decimal, name, found) for name in wanted}
            found.broken, broken[:] = broken[:], []
            rows += block.num_rows
            yield found
    yield Cells({name: np.empty(0) for name in wanted}, 0, rows, broken=broken)


def check_broken(path: Path, layout: Layout, found: Cells) -> None:
    """Raise BadInput where too many lines have another number of cells than the header."""
    lost, lines = len(found.broken), found.rows + len(found.broken)
    if lost > _MOST_BROKEN * lines:
        many = f"{lost} of {lines} lines have another number of cells than the header"
        raise _no_table(path, f"{many}, {len(layout.names)}: the first {found.broken[0]!r}")


def _left_out(broken: list[str]) -> Callable[[Any], str]:
    def note(row: Any) -> str:
        broken.append((row.text or "")[:60])
        return "skip"

    return note


def _as_text(names: Sequence[str], wanted: Sequence[str]) -> Any:
    """Every cell as text: which of them hold numbers is found out here, and not by the first block."""
    import pyarrow as pa
    from pyarrow import csv

    return csv.ConvertOptions(
        include_columns=list(wanted) or list(islice(names, 1)),
        column_types=dict.fromkeys(names, pa.string()),
        strings_can_be_null=True,
    )


def _numbers(cells: Any, decimal: str, name: str, found: Cells) -> Floats:
    """A block's column as numbers; text in it is counted."""
    import pyarrow as pa
    from pyarrow import compute

    cells = compute.utf8_trim_whitespace(cells)
    if decimal == ",":
        cells = compute.replace_substring(cells, ",", ".")
    try:
        numbers = compute.cast(cells, pa.float64())
    except pa.ArrowInvalid:
        fine = compute.fill_null(compute.match_substring_regex(cells, _NUMBER), True)
        _count(name, cells, fine, found)
        numbers = compute.cast(compute.if_else(fine, cells, None), pa.float64())
    values = numbers.to_numpy(zero_copy_only=False)
    return np.where(np.isfinite(values), values, np.nan)


def _count(name: str, cells: Any, fine: Any, found: Cells) -> None:
    places = np.flatnonzero(~fine.to_numpy(zero_copy_only=False))
    texts = [place for place in places.tolist() if cells[place].as_py()]
    if texts:
        found.text[name] = (len(texts), found.before + texts[0] + 1, str(cells[texts[0]]))


def remarks(layout: Layout, found: Cells) -> Iterator[tuple[str, str]]:
    """Of each column a line on its cells of text, where it holds numbers too; under an empty name what is
    unusual about the whole."""
    for name, (many, row, first) in found.text.items():
        if np.isfinite(found.numbers[name]).any():
            cells = "1 cell holds" if many == 1 else f"{many} cells hold"
            yield name, f"{name}: {cells} no number, the first in row {row}: {first[:30]!r}"
    if layout.header:
        yield "", f"names are in line {layout.header + 1}, what is above is left out"
    if layout.delimiter != ",":
        comma = ", with a decimal comma" if layout.decimal == "," else ""
        yield "", f"cells are parted by {_DELIMITERS[layout.delimiter]}{comma}"
    if found.broken:
        yield "", f"lines with too few or too many cells, left out: {len(found.broken)}"
