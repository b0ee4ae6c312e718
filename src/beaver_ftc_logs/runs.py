"""Rows of a log: runs of them, the last one up to a row or a time, sums over the last ones."""

from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from beaver_ftc_logs.recording import Floats, Ints, Mask

# Begin and end of runs of rows.
Runs = list[tuple[int, int]]


def last_true_row(mask: Mask) -> Ints:
    """The last row up to each at which a mask (n,) is true, (n,); -1 before the first."""
    return np.maximum.accumulate(np.where(mask, np.arange(len(mask)), -1))


def last_row_at(stamps: Floats, t_s: Floats) -> Ints:
    """The row of the last stamp up to each time; the first before it."""
    return np.maximum(np.searchsorted(stamps, t_s, side="right") - 1, 0)


def runs_between(is_edge: Mask) -> Runs:
    """Begin and end of each run of n rows; is_edge (n - 1,): whether one ends behind the row."""
    return list(pairwise([0, *(np.flatnonzero(is_edge) + 1).tolist(), len(is_edge) + 1]))


def true_runs(mask: Mask) -> Runs:
    """Begin and end of each run of rows at which a mask (n,) is true."""
    edges = np.flatnonzero(np.diff(mask.astype(np.int8), prepend=0, append=0)).reshape(-1, 2)
    return [(begin, end) for begin, end in edges.tolist()]


def constant_stretches(values: Floats) -> Runs:
    """Begin and end of each stretch of equal rows; nan is equal to nan."""
    known = np.nan_to_num(values, nan=-1.0)
    return runs_between(np.any(np.diff(known, axis=0) != 0.0, axis=1))


def trailing_sums(x: NDArray[Any], n: float) -> tuple[Floats, Ints]:
    """Sums of x (k, ...) over the last n rows, each row's own included, and how many rows these are, (k,)."""
    end = np.arange(1, len(x) + 1)
    begin = np.maximum(end - max(round(n), 1), 0)
    sums = np.concatenate([np.zeros((1, *x.shape[1:])), np.cumsum(x, axis=0)])
    return sums[end] - sums[begin], end - begin
