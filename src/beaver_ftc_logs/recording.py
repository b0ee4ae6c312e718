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
# For each reason of a doubt its rows, (n,).
Reasons = dict[str, Mask]
# Columns that are read, all where None.
Wanted = Collection[str] | None
# Parameters of an autopilot by name: its value in the log; if it changes, the first and the last one.
Parameters = dict[str, tuple[float, ...]]
# The column of the time and its unit.
TimeSource = tuple[str, str]
_N_LISTED_NEAREST_NAMES = 10
# Least value of a divisor that may be zero.
MIN_DIVISOR = float(np.sqrt(np.finfo(float).tiny))


def largest_magnitude(values: Floats) -> float:
    """The largest of the numbers without sign, 0 of none."""
    return float(np.nanmax(np.abs(values), initial=0.0))


@dataclass(frozen=True)
class Column:
    """One logged quantity. t_s (n,) s, increasing; values (n,) in the unit its name carries; note: a line on
    rows that were left out."""

    t_s: Floats
    values: Floats
    note: str = ""


# Columns by name.
Columns = dict[str, Column]


@dataclass(frozen=True)
class LoggedFailure:
    """A failure that the log itself states: for scoring only, `diagnose` never reads it."""

    t_s: float
    surface: str


@dataclass(frozen=True)
class RecordedFlight:
    """One flight: its columns by name, what went wrong by the log's own word, remarks on the reading, and the
    autopilot's parameters that the log carries.

    unread_column_names: names of columns of the log, those that were not read among them, for the message
    that a wanted column is missing. A reader of wanted columns gives them where the log lacks one of these.
    """

    name: str
    columns: Columns
    logged_failures: tuple[LoggedFailure, ...] = ()
    notes: tuple[str, ...] = field(default=())
    parameters: Parameters = field(default_factory=dict)
    unread_column_names: tuple[str, ...] = ()

    def check_has(self, names: Iterable[str]) -> None:
        """Raise BadInput, with the names nearest to it, where the log lacks a column."""
        for name in names:
            if name not in self.columns:
                nearest = nearest_names_text(name, {*self.columns, *self.unread_column_names})
                allowed = f"allowed: a log that has it; it has {nearest}"
                raise BadInput(f"{self.name}: no column {name}, {allowed}")


def add_parameter(values_by_name: Parameters, name: str, value: float) -> None:
    """Note a value that a log gives to a parameter."""
    values = values_by_name.get(name, ())
    is_as_before = bool(values) and (values[-1] == value or (isnan(values[-1]) and isnan(value)))
    if not is_as_before:
        values_by_name[name] = (*values[:1], float(value))


def last_value(parameters: Parameters, name: str) -> float | None:
    """The last value of a parameter, None where the log does not give it."""
    values = parameters.get(name)
    return values[-1] if values else None


def nearest_names_text(wanted_name: str, names: Iterable[str]) -> str:
    """The ten names nearest to what was given, and how many there are besides."""
    wanted = wanted_name.lower()
    ranked = sorted(names)
    ranked.sort(key=lambda name: -SequenceMatcher(None, name.lower(), wanted).ratio())
    nearest = [name if name.isprintable() else repr(name) for name in ranked[:_N_LISTED_NEAREST_NAMES]]
    n_more = len(ranked) - len(nearest)
    return (", ".join(nearest) or "none") + (f", and {n_more} more" if n_more else "")
