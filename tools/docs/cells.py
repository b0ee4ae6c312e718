"""The tables of a page as a document, so that prose can take its numbers from the table that it explains."""

import csv
import re
from collections.abc import Iterable
from itertools import takewhile
from pathlib import Path

from tools.docs.pages import chosen

_CAPTION = re.compile(r"\*Table (\d+)\. ")
_RULE = re.compile(r"\|(?: ?:?-+:? ?\|)+")
_COLUMNS = re.compile(r"(?<!\\)\|")


_FILE = re.compile(r"\]\(([\w./-]+\.csv)\)")

Rows = list[dict[str, str | int | float]]


def of_page(name: str = "") -> dict[str, Rows]:
    """Of a page by its name."""
    page = chosen([name])[0]
    return cells(page.read_text(encoding="utf-8"), page.parent)


def cells(text: str, folder: Path = Path()) -> dict[str, Rows]:
    """{number of a table, or name of a CSV file that the page links: its rows, by the names of the columns};
    what stands above the first column without a name is `row`. Names are in small letters without units and
    brackets: `delay, s (32)` is `delay`. folder: that of the page.
    """
    found: dict[str, Rows] = {}
    lines = text.splitlines()
    number = ""
    for at, line in enumerate(lines):
        caption = _CAPTION.match(line)
        number = caption[1] if caption else number
        if number and number not in found and _RULE.fullmatch(line.strip()):
            rows = takewhile(lambda line: line.startswith("|"), lines[at + 1 :])
            found[number] = _records(map(_row, (lines[at - 1], *rows)))
    for name in _FILE.findall(text):
        found[Path(name).stem] = _records(csv.reader((folder / name).read_text("utf-8").splitlines()))
    return found


def _records(rows: Iterable[list[str]]) -> Rows:
    """Rows by the names of the columns, which the first one has."""
    head, *others = rows
    names = [_name(one) for one in head]
    return [dict(zip(names, map(_value, row), strict=True)) for row in others]


def _row(line: str) -> list[str]:
    return [cell.strip().strip("*`") for cell in _COLUMNS.split(line.strip())[1:-1]]


def _name(head: str) -> str:
    plain = re.sub(r"\(.*?\)|, [^,]*$", "", head)
    return re.sub(r"\W+", "_", plain).strip("_").lower() or "row"


def _value(cell: str) -> str | int | float:
    for kind in (int, float):
        try:
            return kind(cell)
        except ValueError:
            continue
    return cell
