"""A reference signal from a CSV file: of bounded size, in the scenario's own folder, time increasing."""

import csv
from collections.abc import Sequence
from itertools import pairwise
from math import isfinite
from pathlib import Path
from typing import Any

from beaver_ftc.documents.base import refuse
from beaver_ftc.documents.files import UnreadableError, read_text
from beaver_ftc.documents.paths import inside

MAX_ROWS = 20_000
_MAX_BYTES = 2_000_000
_LATEST_S = 360_000.0
_LARGEST_DEG_S = 1000.0
_FORMAT = "comma-separated text with a header line, times in column t_s, rates in deg/s"


def read_column(file: Any, column: Any, folder: Path | None) -> dict[str, list[float]]:
    """The named column of a CSV file (deg/s) against its `t_s` (s); refuses what is not a table."""
    if not isinstance(file, str) or not isinstance(column, str) or not file:
        return {
            "time_s": [0.0],
            "values_deg_s": [0.0],
        }  # the schema reports `file` or `column`, and only them
    path = _inside(folder, file)
    try:
        lines = read_text(path, _MAX_BYTES).splitlines()
        return _parse(lines, column)
    except UnreadableError as error:
        refuse([(("file",), f"{file!r} line {error.line}: {error}")])
    raise AssertionError("refuse always raises here")


def _inside(folder: Path | None, file: str) -> Path:
    """The file's path, resolved, if it is in the folder or below it: a scenario reads nothing else."""
    if folder is None:
        refuse(
            [
                (
                    ("file",),
                    "there is no folder to read it from, allowed: csv in a scenario that is a file itself",
                )
            ]
        )
    assert folder is not None
    path = inside(folder, file)
    if path is None:
        refuse(
            [(("file",), f"{file!r} is outside, allowed: a file in the scenario's own folder or below it")]
        )
    assert path is not None
    return path


def _parse(lines: Sequence[str], column: str) -> dict[str, list[float]]:
    header = [name.strip() for name in next(csv.reader(lines[:1]), [])]
    for name in ("t_s", column):
        if header.count(name) != 1:
            raise UnreadableError(f"the header has no column {name!r}, allowed: {_FORMAT}")
    if len(lines) - 1 > MAX_ROWS:
        raise UnreadableError(f"too many rows ({len(lines) - 1}), allowed: at most {MAX_ROWS}")
    at, of = header.index("t_s"), header.index(column)
    rows = [_row(line, number, (at, of)) for number, line in enumerate(lines[1:], start=2) if line.strip()]
    if not rows:
        raise UnreadableError(f"there are no rows, allowed: {_FORMAT}", 2)
    return {"time_s": [row[0] for row in rows], "values_deg_s": [row[1] for row in rows]}


def _row(line: str, number: int, columns: tuple[int, int]) -> tuple[float, float]:
    cells = line.split(",")
    try:
        at, of = float(cells[columns[0]]), float(cells[columns[1]])
    except (ValueError, IndexError):
        raise UnreadableError(f"{line[:40]!r} is not a row of numbers, allowed: {_FORMAT}", number) from None
    if not (isfinite(at) and isfinite(of)):
        raise UnreadableError(f"{line[:40]!r} is not finite, allowed: finite numbers", number)
    return at, of


def check_table(time_s: Sequence[float], values_deg_s: Sequence[float]) -> None:
    """Refuse columns of different length, times that do not increase, values that no aircraft flies."""
    if len(time_s) != len(values_deg_s):
        refuse([((), f"{len(time_s)} times but {len(values_deg_s)} values, allowed: as many of each")])
    if not all(a < b for a, b in pairwise(time_s)) or time_s[0] < 0 or time_s[-1] > _LATEST_S:
        refuse([((), f"times do not increase from 0, allowed: strictly increasing, 0 to {_LATEST_S:g} s")])
    if max(map(abs, values_deg_s)) > _LARGEST_DEG_S:
        refuse([((), f"rates out of range, allowed: -{_LARGEST_DEG_S:g} to {_LARGEST_DEG_S:g} deg/s")])
