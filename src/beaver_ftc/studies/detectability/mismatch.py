"""The fault mismatch function and the magnitudes from which detection and isolation are certain.

A loss of effectiveness of surface s, of magnitude m, changes the innovation by -m z_s. An admissible
uncertainty can hide eta_bar_i of it on axis i, and another fault, or none, survives as long as what is left
is within eta_bar_i of what it predicts. So

    detection is certain at a frame where    max_i  m |z_s,i| / 2 eta_bar_i  > 1
    fault j is excluded for certain where    M_sj(m) = min_{0 <= b <= 1} max_i |m z_s,i - b z_j,i| / 2
    eta_bar_i  > 1

M_sj is the fault mismatch function [Zhang2002] of the sharpened scheme; it grows with m. Both hold for the
frame-by-frame test of the innovation, whatever the fault's course; z is taken along the healthy flight, so
the loop's answer to the fault within the window is neglected.
"""

from itertools import combinations

import numpy as np

_BISECTIONS = 16  # magnitudes to 2^-16


def detection_magnitude(z: np.ndarray, bound: np.ndarray) -> np.ndarray:
    """Smallest magnitude (n,) certain to be detected by each frame alone; above 1 where a total loss is not.

    z, bound (n, 3) rad/s2.
    """
    with np.errstate(divide="ignore", over="ignore"):
        return np.min(2.0 * bound / np.abs(z), axis=1)


def mismatch(z: np.ndarray, other: np.ndarray, bound: np.ndarray) -> np.ndarray:
    """M_sj (n,) of m z_s = `z` and z_j = `other`, (n, 3): convex and piecewise linear in b."""
    a, b = z / (2.0 * bound), other / (2.0 * bound)
    best = np.full(len(a), np.inf)
    for candidate in _corners(a, b):
        b_share = np.clip(np.nan_to_num(candidate, nan=0.0, posinf=1.0, neginf=0.0), 0.0, 1.0)
        best = np.minimum(best, np.abs(a - b_share[:, None] * b).max(axis=1))
    return best


def _corners(a: np.ndarray, b: np.ndarray):
    """Where max_i |a_i - b_i t| may be least: the ends, the zeros, where two axes are equal; (n,) each."""
    yield np.zeros(len(a))
    yield np.ones(len(a))
    with np.errstate(all="ignore"):
        for i in range(3):
            yield a[:, i] / b[:, i]
        for i, j in combinations(range(3), 2):
            yield (a[:, i] - a[:, j]) / (b[:, i] - b[:, j])
            yield (a[:, i] + a[:, j]) / (b[:, i] + b[:, j])


def exclusion_magnitude(z: np.ndarray, other: np.ndarray, bound: np.ndarray) -> np.ndarray:
    """Smallest magnitude (n,) for which each frame alone excludes the other fault; inf where 1 does not."""
    low, high = np.zeros(len(z)), np.ones(len(z))
    possible = mismatch(z, other, bound) > 1.0
    for _ in range(_BISECTIONS):
        middle = 0.5 * (low + high)
        enough = mismatch(middle[:, None] * z, other, bound) > 1.0
        low, high = np.where(enough, low, middle), np.where(enough, middle, high)
    return np.where(possible, high, np.inf)


def best_in_window(values: np.ndarray, frames: int) -> np.ndarray:
    """The smallest of each run of so many values, (n - frames + 1,)."""
    return np.lib.stride_tricks.sliding_window_view(values, frames).min(axis=1)
