"""Checks of a logged signal: how long it has been constant, whether it is clipped, where it has spikes.

A measured quantity does not keep the same value, to the last bit, for long. A command may keep it: for how
long, the flights to which a model was fitted show.
"""

from collections.abc import Iterator

import numpy as np

from beaver_ftc_logs.recording import Column, Floats, Ints, Mask
from beaver_ftc_logs.runs import last_true_row

# A measured rate is frozen if its value stays for longer than both.
MIN_STILL_S = 1.5
MIN_STILL_ROWS = 12  # also the least number of rows in which spikes are searched
# Least number of successive rows, and of all rows, at the largest value of a clipped signal.
_CLIPPED_IN_TURN = 3
_CLIPPED_IN_ALL = 10
_SPIKE_RATIO = 40.0  # the steps to and from a spike exceed this times the usual step
_MAX_SPIKE_SHARE = 0.01  # if a larger share of the rows are spikes, the signal is noisy and has none


def time_since_change_s(column: Column) -> Floats:
    """How long a column's value has been the same at each row, (n,) s; 0 until it has stayed for
    MIN_STILL_ROWS rows after its first."""
    since = last_true_row(_changed_rows(column.values))
    return np.where(np.arange(len(since)) - since >= MIN_STILL_ROWS, column.t_s - column.t_s[since], 0.0)


def _changed_rows(values: Floats) -> Mask:
    """Rows (n,) whose value differs from that of the row before. The first row and each row without a number
    count as different."""
    return np.concatenate([[True], values[1:] != values[:-1]])[: len(values)]


def find_clipped_rows(values: Floats) -> Mask:
    """Rows (n,) at the largest value so far, of either sign, once the value has lasted for _CLIPPED_IN_TURN
    rows in turn and has been reached in _CLIPPED_IN_ALL rows in all.

    The result for a row depends on no later row. v (n,): the values with either sign; top: the largest of
    them so far; since: the last row that is not at the top or has just changed; before: number of rows at the
    top before it became so large.
    """
    clipped = np.zeros(len(values), dtype=bool)
    for v in (values, -values):
        top = np.maximum.accumulate(np.where(np.isfinite(v), v, -np.inf))
        at_top = (v == top) & (v > 0.0)
        since = last_true_row(_changed_rows(v) | ~at_top)
        total = np.cumsum(at_top)
        before = (total - at_top)[last_true_row(_changed_rows(top))]  # a larger value restarts the count
        lasts = np.arange(len(v)) - since >= _CLIPPED_IN_TURN - 1
        clipped |= at_top & lasts & (total - before >= _CLIPPED_IN_ALL)
    return clipped


def find_spike_rows(values: Floats) -> Ints:
    """Positions of single rows that differ from both neighbours, in the same direction, by more than
    _SPIKE_RATIO times the usual step; none if they are more than _MAX_SPIKE_SHARE of the rows. usual: median
    magnitude of the steps that are not 0.
    """
    finite = np.flatnonzero(np.isfinite(values))
    if len(finite) < MIN_STILL_ROWS:
        return finite[:0]
    steps = np.diff(values[finite])
    usual = float(np.median(np.abs(steps[steps != 0.0]))) if (steps != 0.0).any() else 0.0
    is_spike = (np.abs(steps[:-1]) > _SPIKE_RATIO * usual) & (np.abs(steps[1:]) > _SPIKE_RATIO * usual)
    is_spike &= steps[:-1] * steps[1:] < 0.0
    spikes = finite[1:-1][is_spike]
    return spikes if usual > 0.0 and len(spikes) <= _MAX_SPIKE_SHARE * len(finite) else finite[:0]


def column_defect_texts(name: str, column: Column, is_rate: bool) -> list[str]:
    """A line for each defect of a column in the whole flight. is_rate: whether it is a rate, not a command or
    a further signal."""
    values = column.values
    texts = [column.note] if column.note else []
    n = int((~np.isfinite(values)).sum())
    if n:
        texts.append(f"{name}: rows without a number: {n} of {len(values)}")
    if is_rate:
        return [*texts, *_rate_defect_texts(name, column)]
    if values.size and np.nanmin(values) == np.nanmax(values):
        texts.append(f"{name}: does not move, nothing can be said of what it moves alone")
    return texts


def _rate_defect_texts(name: str, column: Column) -> Iterator[str]:
    """Yield a line for each defect that only a measured rate shows: frozen, clipped, with spikes."""
    values = column.values
    still_s = float(time_since_change_s(column).max(initial=0.0))
    if still_s > MIN_STILL_S:
        yield f"{name}: frozen, the same to the last bit for {still_s:.1f} s"
    clipped = find_clipped_rows(values)
    if clipped.any():
        yield f"{name}: clipped at {np.abs(values[clipped]).max():.4g} in {clipped.sum()} rows"
    spikes = find_spike_rows(values)
    if len(spikes):
        jumps = "1 jump" if len(spikes) == 1 else f"{len(spikes)} jumps"
        yield f"{name}: {jumps}, the first at {column.t_s[spikes[0]]:.2f} s"
