"""Rows of a log: runs of rows, the last row up to another row or a time, and sums over the last rows.

A run is a pair (begin, end) of row numbers; end is the number after the last row.
"""

from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from beaver_ftc_logs.recording import Floats, Ints, Mask

# Each run as (begin, end).
Runs = list[tuple[int, int]]


def shifted(values: Floats, n: float) -> Floats:
    """Values (n_rows, S) that act `n` samples later than these, i.e. that were logged n samples earlier."""
    rows = np.arange(len(values)) + n
    return np.column_stack([np.interp(rows, np.arange(len(values)), column) for column in values.T])


def last_true_row(mask: Mask) -> Ints:
    """For each row the last row up to it at which a mask (n,) is true, (n,); -1 before the first such row."""
    return np.maximum.accumulate(np.where(mask, np.arange(len(mask)), -1))


def last_row_at(stamps: Floats, t_s: Floats) -> Ints:
    """For each time the row of the last stamp up to it; row 0 before the first stamp."""
    return np.maximum(np.searchsorted(stamps, t_s, side="right") - 1, 0)


def runs_between(is_edge: Mask) -> Runs:
    """The runs of n rows; is_edge (n - 1,): whether a run ends with the row."""
    return list(pairwise([0, *(np.flatnonzero(is_edge) + 1).tolist(), len(is_edge) + 1]))


def true_runs(mask: Mask) -> Runs:
    """The runs of rows at which a mask (n,) is true."""
    edges = np.flatnonzero(np.diff(mask.astype(np.int8), prepend=0, append=0)).reshape(-1, 2)
    return [(begin, end) for begin, end in edges.tolist()]


def constant_runs(values: Floats) -> Runs:
    """The runs of equal rows of values (n, k). NaN is equal to NaN: it is read as -1."""
    known = np.nan_to_num(values, nan=-1.0)
    return runs_between(np.any(np.diff(known, axis=0) != 0.0, axis=1))


def trailing_sums(x: NDArray[Any], n: float) -> tuple[Floats, Ints]:
    """For each row the sum of x (k, ...) over the last n rows, itself included, and the number of these rows,
    (k,): n rounded, fewer at the start, and at least one. x is finite: since the sums are differences of one
    cumulative sum, a NaN makes all later ones NaN."""
    end = np.arange(1, len(x) + 1)
    begin = np.maximum(end - max(round(n), 1), 0)
    sums = np.concatenate([np.zeros((1, *x.shape[1:])), np.cumsum(x, axis=0)])
    return sums[end] - sums[begin], end - begin
