"""A recorded flight as a reader returns it: named columns, each with its own time stamps."""

from collections.abc import Collection, Iterable
from dataclasses import dataclass, field
from difflib import SequenceMatcher
from math import isnan

import numpy as np
from numpy.typing import NDArray

from beaver_ftc.documents import BadInput

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Mask = NDArray[np.bool_]
# Reason -> rows (n,) that are not credible for it.
Reasons = dict[str, Mask]
# Names of the columns that are read; all columns if None.
Wanted = Collection[str] | None
# Name of a parameter of an autopilot -> its value in the log; if it changes, its first and its last value.
Parameters = dict[str, tuple[float, ...]]
# The column of the time and its unit.
TimeSource = tuple[str, str]
_N_LISTED_NEAREST_NAMES = 10
# Least value of a divisor that could otherwise be 0; its square is still a normal number.
MIN_DIVISOR = float(np.sqrt(np.finfo(float).tiny))


def largest_magnitude(values: Floats) -> float:
    """The largest magnitude of the numbers, nan left out; 0 without a number."""
    return float(np.nanmax(np.abs(values), initial=0.0))


@dataclass(frozen=True)
class Column:
    """One logged quantity. t_s (n,) s, increasing; values (n,) in the unit that the name states; note: a line
    on rows that were left out.
    """

    t_s: Floats
    values: Floats
    note: str = ""


# Name -> column.
Columns = dict[str, Column]


@dataclass(frozen=True)
class LoggedFailure:
    """A failure that the log itself states, only for scores: `diagnose` never reads it."""

    t_s: float
    surface: str


@dataclass(frozen=True)
class RecordedFlight:
    """One flight: its columns by name, the failures that the log states, remarks on the reading, and the
    parameters of the autopilot in the log.

    unread_column_names: names of all columns of the log, also of those that were not read. A reader that
    reads only wanted columns sets them if one of these is missing; the error message lists them.
    """

    name: str
    columns: Columns
    logged_failures: tuple[LoggedFailure, ...] = ()
    notes: tuple[str, ...] = ()
    parameters: Parameters = field(default_factory=dict)
    unread_column_names: tuple[str, ...] = ()

    def check_has(self, names: Iterable[str]) -> None:
        """Raise BadInput, with the nearest names, if a column is missing."""
        for name in names:
            if name not in self.columns:
                nearest = nearest_names_text(name, {*self.columns, *self.unread_column_names})
                allowed = f"allowed: a log that has it; it has {nearest}"
                raise BadInput(f"{self.name}: no column {name}, {allowed}")


def add_parameter(values_by_name: Parameters, name: str, value: float) -> None:
    """Add a value of a parameter in the log: as its first value, or as its last one if it has changed."""
    values = values_by_name.get(name, ())
    is_as_before = bool(values) and (values[-1] == value or (isnan(values[-1]) and isnan(value)))
    if not is_as_before:
        values_by_name[name] = (*values[:1], float(value))


def last_value(parameters: Parameters, name: str) -> float | None:
    """The last value of a parameter, None if the log has none."""
    values = parameters.get(name)
    return values[-1] if values else None


def nearest_names_text(wanted_name: str, names: Iterable[str]) -> str:
    """The _N_LISTED_NEAREST_NAMES names nearest to the wanted one, and the number of further names."""
    wanted = wanted_name.lower()
    ranked = sorted(names)
    ranked.sort(key=lambda name: -SequenceMatcher(None, name.lower(), wanted).ratio())
    nearest = [name if name.isprintable() else repr(name) for name in ranked[:_N_LISTED_NEAREST_NAMES]]
    n_more = len(ranked) - len(nearest)
    return (", ".join(nearest) or "none") + (f", and {n_more} more" if n_more else "")
