"""Whether a logged signal lives: how long it has stood still, whether it is clipped, where it jumps.

A measured quantity never repeats for long to the last bit. A command may: for how long, the flights say that
a model was fitted to.
"""

import numpy as np
from numpy.typing import NDArray

from beaver_ftc_logs.recording import Column, Floats

STILL_S, STILL_ROWS = 1.5, 12
"""A measured rate that repeats for longer than both is frozen."""
_CLIPPED_ROWS, _CLIPPED_SEEN = 3, 10
_JUMP, _MOST_JUMPS = 40.0, 0.01

Mask = NDArray[np.bool_]


def still_s(column: Column) -> Floats:
    """How long a column's value has been the same at each row, (n,) s; 0 for fewer than STILL_ROWS."""
    rows = np.arange(len(column.values))
    since = np.maximum.accumulate(np.where(_moved(column.values), rows, 0))
    return np.where(rows - since >= STILL_ROWS, column.t_s - column.t_s[since], 0.0)


def _moved(values: Floats) -> Mask:
    """Rows whose value is another than the row's before, the first among them; what is no number moves."""
    return np.concatenate([[True], values[1:] != values[:-1]])[: len(values)]


def clipped(values: Floats) -> Mask:
    """Rows at the largest value seen so far, either way, that stands for three rows and was met ten times.

    Uses nothing later than the row.
    """
    found = np.zeros(len(values), dtype=bool)
    for side in (values, -values):
        known = np.where(np.isfinite(side), side, -np.inf)
        at_most = (side == np.maximum.accumulate(known)) & (side > 0.0)
        rows = np.arange(len(side))
        since = np.maximum.accumulate(np.where(_moved(side) | ~at_most, rows, 0))
        level = np.cumsum(
            _moved(np.maximum.accumulate(known)).astype(np.int64)
        )  # a larger value begins the count again
        met = np.cumsum(at_most) - _before_level(at_most, level)
        found |= at_most & (rows - since >= _CLIPPED_ROWS - 1) & (met >= _CLIPPED_SEEN)
    return found


def _before_level(at_most: Mask, level: NDArray[np.int64]) -> NDArray[np.int64]:
    """How many rows were at the largest value before the present one was reached."""
    total = np.cumsum(at_most)
    first = np.flatnonzero(np.diff(level, prepend=0))
    return (total - at_most)[first][level - 1] if len(first) else np.zeros(len(level), dtype=np.int64)


def jumps(values: Floats) -> NDArray[np.int64]:
    """Single rows that leave the signal by 40 times its usual step and come back, where these are few."""
    known = np.flatnonzero(np.isfinite(values))
    if len(known) < STILL_ROWS:
        return known[:0]
    steps = np.diff(values[known])
    usual = float(np.median(np.abs(steps[steps != 0.0]))) if (steps != 0.0).any() else 0.0
    away = (np.abs(steps[:-1]) > _JUMP * usual) & (np.abs(steps[1:]) > _JUMP * usual)
    away &= steps[:-1] * steps[1:] < 0.0
    found = known[1:-1][away]
    return found if usual > 0.0 and len(found) <= _MOST_JUMPS * len(known) else known[:0]


def remarks(name: str, column: Column, measured: bool) -> list[str]:
    """What is wrong with a column over the whole flight, in lines. measured: a rate, not a command."""
    values, said = column.values, [column.note] if column.note else []
    lost = int((~np.isfinite(values)).sum())
    if lost:
        said.append(f"{name}: rows without a number: {lost} of {len(values)}")
    longest = float(still_s(column).max(initial=0.0))
    if measured and longest > STILL_S:
        said.append(f"{name}: frozen, the same to the last bit for {longest:.1f} s")
    if not measured and values.size and np.nanmin(values) == np.nanmax(values):
        said.append(f"{name}: does not move, nothing can be said of what it moves alone")
    if measured and (rows := clipped(values)).any():
        said.append(f"{name}: clipped at {np.abs(values[rows]).max():.4g} in {rows.sum()} rows")
    if measured and len(places := jumps(values)):
        many = "1 jump" if len(places) == 1 else f"{len(places)} jumps"
        said.append(f"{name}: {many}, the first at {column.t_s[places[0]]:.2f} s")
    return said
