"""The user's copy of the aerodynamic data base, a MATLAB file of NASA's: read, and checked.

Every table: coefficients over angles in deg and dimensionless rates, the outputs on the last axis.
"""

import warnings
from dataclasses import dataclass
from functools import reduce
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from beaver_ftc.documents import BadInput

WHERE = "github.com/nasa/GTM_DesignSim, gtm_design/config/T2_polynomial_aerodatabase.mat"
_VERSION = "with damage"
_MOST_BYTES = 50_000_000
# Of each table: where it is, its axes with their sizes, and how many outputs.
_TABLES: dict[str, tuple[dict[str, int], int]] = {
    "C6_bas": ({"alpha": 32, "beta": 27}, 6),
    "dC3_ele": ({"alpha": 32, "beta": 27, "stab": 4, "elev": 6}, 3),
    "dC6_ail": ({"alpha": 32, "beta": 27, "ail": 7}, 6),
    "dC6_rud": ({"alpha": 32, "beta": 27, "rud": 4}, 6),
    "dC6_spo": ({"alpha": 32, "beta": 27, "spo": 3}, 6),
    "dC6_w": ({"alpha": 24, "what": 9, "beta": 21}, 6),
    "dC3_p": ({"alpha": 24, "phat": 15}, 3),
    "dC3_q": ({"alpha": 24, "qhat": 15}, 3),
    "dC3_r": ({"alpha": 25, "rhat": 15}, 3),
    "dC3_lgr": ({"alpha": 32, "(gear)": 2}, 3),
    "dC6_damage.bas": ({"alpha": 18, "beta": 13, "(case)": 6}, 6),
    "dC6_damage.ddscale": ({"alpha": 18, "(case)": 6, "(rate)": 3}, 6),
    "dC6_damage.ddinc": ({"alpha": 24, "(case)": 6, "(rate)": 3}, 6),
}
_FLAPS = ("flaplib", "flaplob", "flaprib", "flaprob")


@dataclass(frozen=True)
class Table:
    """Breakpoints of each axis by name, and the values, one axis more: the outputs."""

    axes: dict[str, np.ndarray]
    data: np.ndarray


@dataclass(frozen=True)
class Database:
    """The tables by name; flaps: six coefficients per degree, by name."""

    tables: dict[str, Table]
    flaps: dict[str, np.ndarray]

    def __getitem__(self, name: str) -> Table:
        return self.tables[name]


def read(path: Path) -> Database:
    """Read the data base. Raises BadInput, one line, for any other file."""
    content = _content(path)
    try:
        tables = {name: _table(content, name) for name in _TABLES}
        flaps = {name: _numbers(_at(content, f"flaps.{name}"), name, (6,)) for name in _FLAPS}
    except _Wrong as wrong:
        raise _refused(path, str(wrong)) from None
    return Database(tables, flaps)


class _Wrong(ValueError):
    """A part of the file has not the required form."""


def _refused(path: Path, says: str) -> BadInput:
    return BadInput(f"{path}: {says}, allowed: the data base of {WHERE}")


def _content(path: Path) -> dict[str, Any]:
    from scipy.io import loadmat  # some tenths of a second, for this command alone

    try:
        size = path.stat().st_size
    except OSError as error:
        raise _refused(path, f"cannot be read ({error.strerror})") from None
    if not path.is_file() or size > _MOST_BYTES:
        raise _refused(path, "is no file of this kind")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            content: dict[str, Any] = loadmat(path, struct_as_record=False, squeeze_me=True)
    except Exception as error:  # whatever scipy makes of bytes that are no MATLAB file, or only half of one
        says = " ".join(str(error).split())[:80]
        raise _refused(path, f"is no whole MATLAB file ({says or type(error).__name__})") from None
    version = str(content.get("ver", ""))
    if _VERSION not in version:
        raise _refused(path, f"has the version {version[:60]!r}")
    return content


def _at(content: dict[str, Any], where: str) -> Any:
    """Return the entry at a dotted name."""
    first, *others = where.split(".")
    try:
        return reduce(getattr, others, content[first])
    except (KeyError, AttributeError):
        raise _Wrong(f"has no {where}") from None


def _numbers(given: Any, where: str, shape: tuple[int, ...]) -> np.ndarray:
    try:
        values = np.asarray(given, dtype=float)
    except (TypeError, ValueError):
        raise _Wrong(f"{where} is no table of numbers") from None
    if values.shape != shape:
        raise _Wrong(f"{where} is of {values.shape} values, not {shape}")
    if not np.isfinite(values).all():
        raise _Wrong(f"{where} has values that are not finite")
    return values


def _table(content: dict[str, Any], name: str) -> Table:
    sizes, outputs = _TABLES[name]
    data = _numbers(_at(content, f"{name}.data"), f"{name}.data", (*sizes.values(), outputs))
    axes = {}
    for axis, size in sizes.items():
        if axis.startswith("("):
            axes[axis.strip("()")] = np.arange(size, dtype=float)
            continue
        axes[axis] = _numbers(_at(content, f"{name}.{axis}"), f"{name}.{axis}", (size,))
        if not all(low < high for low, high in pairwise(axes[axis])):
            raise _Wrong(f"{name}.{axis} does not rise")
    return Table(axes, data)
