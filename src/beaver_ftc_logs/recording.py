"""A recorded flight as a reader returns it: named columns, each with its own time stamps.

Which rows of an autopilot's log are in order, and what is said of the others.
"""

from bisect import bisect_left
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, redirect_stdout
from dataclasses import dataclass, field
from difflib import SequenceMatcher
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from beaver_ftc.documents import BadInput

Floats = NDArray[np.float64]
_US = 1e-6
_NEAREST = 10
TINY = float(np.sqrt(np.finfo(float).tiny))
"""What a divisor is at least that may be zero."""


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


def nearest_ten(given: str, names: Iterable[str]) -> str:
    """The ten names nearest to what was given, and how many there are besides."""
    known = sorted(names)
    ranked = sorted(known, key=lambda name: -SequenceMatcher(None, name.lower(), given.lower()).ratio())
    shown = ", ".join(name if name.isprintable() else repr(name) for name in ranked[:_NEAREST]) or "none"
    return shown if len(known) <= _NEAREST else f"{shown}, and {len(known) - _NEAREST} more"


@contextmanager
def reading(path: Path, what: str, package: str, form: str) -> Iterator[None]:
    """Within this an autopilot's log is read with a package of others: what it prints of damaged files stays
    here. Raises BadInput where the package is missing, or the file is none that it can read.

    what: such a log is called; form: of the files that hold one.
    """
    try:
        with redirect_stdout(StringIO()):
            yield
    except ImportError:
        extra = f"reading a {what} needs {package}, allowed: pip install 'beaver-ftc[flights]'"
        raise BadInput(f"{path}: {extra}") from None
    except Exception as error:  # these packages raise whatever a damaged file makes them stumble over
        says = " ".join(str(error).split()) or type(error).__name__
        raise BadInput(f"{path}: is no {what} that can be read ({says}), allowed: {form}") from None


def columns_of(topics: dict[str, dict[str, Any]], stamp: str) -> tuple[dict[str, Column], float]:
    """The fields of all topics as columns `topic.field`, and the first stamp, from which time counts, s.

    topics: each topic's fields by name, one of them the stamps in us.
    """
    ordered = {name: in_order(name, _numbers(fields[stamp])) for name, fields in topics.items()}
    firsts = [float(topics[name][stamp][kept[0]]) for name, (kept, _) in ordered.items() if len(kept)]
    origin_us = min(firsts, default=0.0)
    columns: dict[str, Column] = {}
    for name, fields in topics.items():
        kept, note = ordered[name]
        t_s = (_numbers(fields[stamp])[kept] - origin_us) * _US
        columns |= {
            f"{name}.{field}": Column(t_s, _numbers(values)[kept], note)
            for field, values in fields.items()
            if field != stamp
        }
    return columns, origin_us * _US


def _numbers(values: Any) -> Floats:
    return np.asarray(values, dtype=float)


def in_order(topic: str, t_s: Floats) -> tuple[NDArray[np.int64], str]:
    """Places of the rows whose stamps increase, as many as can be, and a line on those left out.

    One damaged stamp costs its own row, not all rows after it. Of rows with one stamp the first is kept, and
    nothing is said: autopilots write a stamp twice.
    """
    if (np.diff(t_s) > 0).all() and np.isfinite(t_s).all():
        return np.arange(len(t_s)), ""
    stamped = np.flatnonzero(np.isfinite(t_s))
    kept = stamped[_longest_increasing(t_s[stamped])]
    left_out = np.setdiff1d(np.arange(len(t_s)), kept)
    wrong = [k for k in left_out.tolist() if k == 0 or t_s[k] != t_s[k - 1]]
    if not wrong:
        return kept, ""
    more = len(wrong) - 1
    others = f", as {'is' if more == 1 else 'are'} {more} more of {len(t_s)}" if more else ""
    return kept, f"{topic}: row {wrong[0] + 1}: its stamp is out of order, the row is left out{others}"


def _longest_increasing(t_s: Floats) -> NDArray[np.int64]:
    """Places of a longest strictly increasing subsequence, by patience sorting from the end.

    From the end, so that of a row and one that comes late behind it the late one is left out.
    """
    ends: list[float] = []
    places: list[int] = []
    after = np.full(len(t_s), -1)
    for k in range(len(t_s) - 1, -1, -1):
        length = bisect_left(ends, -t_s[k])
        after[k] = places[length - 1] if length else -1
        ends[length : length + 1] = [-t_s[k]]
        places[length : length + 1] = [k]
    kept = places[-1:]
    while kept and after[kept[-1]] >= 0:
        kept.append(int(after[kept[-1]]))
    return np.array(kept, dtype=np.int64)
