"""A recorded flight as a reader returns it: named columns, each with its own time stamps."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Column:
    """One logged quantity. t_s (n,) s, increasing; values (n,) in the unit its name carries; note: a line on
    rows that were left out."""

    t_s: Floats
    values: Floats
    note: str = ""


@dataclass(frozen=True)
class Event:
    """What the log itself says happened: for scoring only, `diagnose` never reads it."""

    t_s: float
    surface: str


@dataclass(frozen=True)
class Recording:
    """One flight: its columns by name, what went wrong by the log's own word, and remarks on the reading."""

    name: str
    columns: Mapping[str, Column]
    events: tuple[Event, ...] = ()
    notes: tuple[str, ...] = field(default=())
