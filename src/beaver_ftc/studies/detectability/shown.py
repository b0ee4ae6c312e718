"""The table of all answers of `detectability`: its columns and cells, and the name of its files."""

from collections.abc import Callable, Sequence

from beaver_ftc.results.model import Document
from beaver_ftc.studies.detectability.grid import WITHIN_S
from beaver_ftc.studies.present.page import Table
from beaver_ftc.studies.present.tables import known_values, percent

NAME = "detectability"
SOON = f"found within {'/'.join(f'{s:g}' for s in WITHIN_S)} s, %"
HEAD = (
    "loss of", "taken for", "flown", "scheme", "certain from", "half of onsets from", "delay", "half: delay",
    "doublet", "doublet time", "found in 90 % from", "95 % interval", "flights", "false alarms/h",
    "before faults/h", SOON, "median delay",
)  # fmt: skip
Line = dict[str, str]  # the cells of a row by their column of HEAD


def table(lines: Sequence[Line]) -> Table:
    """The table with those columns of HEAD that at least one line has."""
    head = [name for name in HEAD if any(name in line for line in lines)]
    return Table(head, [[line.get(name, "") for name in head] for line in lines])


def times_reference(scale: float) -> str:
    """References of this size in words."""
    return f"{scale:g} x reference"


def span(rows: Sequence[Document], key: str, form: Callable[[float], str] = percent) -> str:
    """The smallest and the largest value over the places that have one; then (places with a value / all
    places)."""
    values = known_values(rows, key)
    ends = dict.fromkeys(map(form, (min(values), max(values)))) if values else ["-"]
    return f"{' to '.join(ends)} ({len(values)}/{len(rows)})"
