"""The rows of the compiled laws: what plugins.yaml says of each by its name."""

from functools import cache
from typing import NamedTuple

from beaver_ftc.plugins import LAWS, compiled_rows

_ROWS = compiled_rows(LAWS)
MODULES = tuple(
    dict.fromkeys(row["kernels"] for row in _ROWS.values())
)  # of kernels, in order of their places
_GIVEN = {"uses_verdict": False, "reallocates": False, "informed": False, "pitch_by_power": True}


class Row(NamedTuple):
    """A law by name. place: of its file among those of compiled laws; file: its name without `.py`.
    uses_verdict, reallocates, informed, pitch_by_power: what the law is given, see plugins.yaml."""

    name: str
    place: int
    file: str
    uses_verdict: bool
    reallocates: bool
    informed: bool
    pitch_by_power: bool


def file_of(module: str) -> str:
    """The name of a module's file, without `.py`."""
    return module.rpartition(".")[2]


@cache
def row_of(name: str) -> Row:
    """The row of a compiled law; of a plug-in the first row, whose law makes no use of the verdict."""
    row = _ROWS.get(name) or next(iter(_ROWS.values()))
    given = {key: bool(row.get(key, default)) for key, default in _GIVEN.items()}
    return Row(name, MODULES.index(row["kernels"]), file_of(row["kernels"]), **given)


def has_kernels(name: str) -> bool:
    """Whether a law, perhaps a plug-in of ours, has a compiled form."""
    return name in _ROWS


def flown_by(file: str) -> list[str]:
    """Names of the laws whose kernels are in this file."""
    return [name for name in _ROWS if row_of(name).file == file]
