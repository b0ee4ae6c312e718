"""A CSV table as people write it: commas, semicolons or tabs, a decimal comma, a header below other lines.

Read in blocks, the columns wanted alone. A cell that holds no number costs itself, a line with too few or too
many cells costs itself; both are counted.
"""

import csv as lines_of
import re
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from beaver_ftc.documents.errors import BadInput
from beaver_ftc.flights.recording import Floats

_DELIMITERS = {",": "commas", ";": "semicolons", "\t": "tabs", "|": "bars"}
_HEAD_BYTES, _HEAD_LINES, _BLOCK_BYTES = 200_000, 60, 4_000_000
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
    of them with its row; the lines left out."""

    numbers: dict[str, Floats]
    text: dict[str, tuple[int, int, str]] = field(default_factory=dict)
    broken: int = 0


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


def read_cells(path: Path, columns: Collection[str] | None, most_rows: int) -> tuple[Layout, Cells]:
    """The numbers of a file's columns, or of those named alone. Raises BadInput where it is no table, or has
    more rows than `most_rows`."""
    from pyarrow import csv

    layout = layout_of(path)
    wanted = [name for name in dict.fromkeys(layout.names) if columns is None or name in columns]
    found = Cells({})
    broken: list[str] = []
    options = {
        "read_options": csv.ReadOptions(
            column_names=layout.names, skip_rows=layout.header + 1, block_size=_BLOCK_BYTES
        ),
        "parse_options": csv.ParseOptions(delimiter=layout.delimiter, invalid_row_handler=_left_out(broken)),
        "convert_options": _as_text(layout.names, wanted),
    }
    parts: dict[str, list[Floats]] = {name: [] for name in wanted}
    rows = 0
    with csv.open_csv(path, **options) as blocks:
        for block in blocks:
            for name in wanted:
                parts[name].append(_numbers(block[name], layout.decimal, name, rows, found))
            rows += block.num_rows
            if rows > most_rows:
                raise BadInput(f"{path}: has more than {most_rows:,} rows, allowed: up to {most_rows:,}")
    found.broken = len(broken)
    if found.broken > _MOST_BROKEN * (rows + found.broken):
        many = f"{found.broken} of {rows + found.broken} lines have another number of cells than the header"
        raise _no_table(path, f"{many}, {len(layout.names)}: the first {broken[0]!r}")
    nothing = np.broadcast_to(np.nan, rows)
    numbers = {
        name: np.concatenate([*parts.pop(name), np.empty(0)]) for name in wanted
    }  # one column twice at most
    found.numbers = {name: numbers.get(name, nothing) for name in layout.names}
    return layout, found


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


def _numbers(cells: Any, decimal: str, name: str, before: int, found: Cells) -> Floats:
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
        _count(name, cells, fine, before, found)
        numbers = compute.cast(compute.if_else(fine, cells, None), pa.float64())
    values = numbers.to_numpy(zero_copy_only=False)
    return np.where(np.isfinite(values), values, np.nan)


def _count(name: str, cells: Any, fine: Any, before: int, found: Cells) -> None:
    places = np.flatnonzero(~fine.to_numpy(zero_copy_only=False))
    texts = [place for place in places.tolist() if cells[place].as_py()]
    if texts:
        many, row, first = found.text.get(name, (0, before + texts[0] + 1, str(cells[texts[0]])))
        found.text[name] = (many + len(texts), row, first)


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
        yield "", f"lines with too few or too many cells, left out: {found.broken}"
