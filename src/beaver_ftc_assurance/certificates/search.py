"""Which inequalities are tried for an event, in their order. `first_violated` takes the first one that the
data violate.

    event                      inequalities, each in both directions along each axis
    alarm                      of frame k by itself, then of each detection filter
    exclusion of a surface     of frame k, of the detection filters, of the isolation filter since the alarm;
                               then, if the scenario declares a constant theta, of this theta
                               (`of_constant_theta`)
    exclusion of a type        of the last frames, or of those that health does not explain (`of_type`); of a
                               block, as a sum over its frames (`of_block`)

A *test* is the list of the terms of one inequality, in frames up to the last one, k.
"""

from collections.abc import Iterable, Iterator
from itertools import combinations
from math import inf

import numpy as np

from beaver_ftc_assurance.certificates.history import History
from beaver_ftc_assurance.certificates.inequality import ANY, Hypothesis, Term

Tests = Iterator[list[Term]]
ALL_AXES = (0, 1, 2)
ADDING_POLE_PER_S = 0.1  # so slow that the filter is nearly the sum over a block


def axis_directions(axes: Iterable[int]) -> Iterator[np.ndarray]:
    """Both directions (3,) along each of the axes."""
    return (way for d in np.eye(3)[[*axes]] for way in (d, 0.0 - d))  # -d would write -0.0


def filters(pole_per_s: float, start: int, last: int, axes: Iterable[int] = ALL_AXES) -> Tests:
    """Of one filter, in both directions along each axis."""
    return ([Term(d, pole_per_s, start, last)] for d in axis_directions(axes))


def of_alarm(history: History, poles: Iterable[float], k: int) -> Tests:
    """Of the alarm: the innovation of frame k, and the detection filters since the diagnosis began."""
    yield from filters(inf, k - 1, k)
    for pole in poles:
        yield from filters(pole, history.tape.since, k)


def of_one_frame(hypothesis: Hypothesis, k: int) -> Tests:
    """Of frame k: along each axis; and for each two axes in the direction, and its opposite, that is
    perpendicular to the slope, so that theta drops out."""
    yield from filters(inf, k - 1, k, hypothesis.axes)
    slope = hypothesis.slope[k - hypothesis.first_frame]
    for i, j in combinations(hypothesis.axes, 2):
        if slope[i] or slope[j]:
            d = np.zeros(3)
            d[i] = slope[j]
            d[j] = -slope[i]
            d /= np.abs(d).max()
            yield from ([Term(way, inf, k - 1, k)] for way in (d, -d))


def of_detection_filters(
    hypothesis: Hypothesis, poles: Iterable[float], e: int, across: np.ndarray, k: int
) -> Tests:
    """Of the detection filters, each with a bound on the effect in it of the fault of estimator e before the
    first kept frame (reach). across (3,): direction in which the fault has no effect, zeros if there is none;
    it is used if the fault is tested on all axes. The last axis of `reach_low` and `reach_high` has the three
    axes, and this direction as the fourth."""
    tape = hypothesis.history.tape
    directions = [([*axis_directions((i,))], i) for i in hypothesis.axes]
    directions += [([across, -across], 3)] if across.any() and hypothesis.axes == ALL_AXES else []
    for m, pole in enumerate(poles):
        for both_ways, i in directions:
            for d, reach in zip(both_ways, (tape.reach_high, -tape.reach_low), strict=True):
                yield [Term(d, pole, tape.since, k, effect_before=float(reach[e, m, i]))]


def theta_bounds_by_frame(
    hypothesis: Hypothesis, frames: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Bounds on theta by each frame and axis, and the slope from which they follow; (n, 3), for the n frames
    from the first to the last of `frames`:

        |nu - offset - theta slope| <= bound on |nu| of health + spread

    Infinite, with a slope of 1, in frames that are not among `frames`, on axes on which the hypothesis is not
    tested, and where the slope is 0.
    """
    history = hypothesis.history
    rows = slice(int(frames[0]), int(frames[-1]) + 1)
    is_bound = np.zeros((rows.stop - rows.start, 3), bool)
    is_bound[np.ix_(frames - rows.start, np.array(hypothesis.axes))] = True
    kept_rows = slice(rows.start - hypothesis.first_frame, rows.stop - hypothesis.first_frame)
    slope = hypothesis.slope[kept_rows]
    tolerance = history.innovation_bound(rows) + hypothesis.spread[kept_rows]
    effect = history.innovation_rad_s2[rows] - hypothesis.offset[kept_rows]
    is_bound &= slope != 0.0
    size = np.where(is_bound, np.abs(slope), 1.0)
    middle = effect * np.sign(slope) / size
    lower = np.where(is_bound, middle - tolerance / size, -inf)
    upper = np.where(is_bound, middle + tolerance / size, inf)
    return lower, upper, np.where(is_bound, slope, 1.0)


def of_constant_theta(hypothesis: Hypothesis, frames: np.ndarray) -> list[Term]:
    """The test of the two frames that bound a constant theta most: the one with the largest lower bound and
    the one with the least upper bound. The data violate their sum if these bounds contradict one another. A
    term is left out if the end of the range bounds theta as much; empty without frames.
    """
    if not len(frames):
        return []
    lower, upper, slope = theta_bounds_by_frame(hypothesis, frames)
    terms = []
    for place, sign, is_bound in (
        (lower.argmax(), 1.0, lower.max() > hypothesis.theta_low),
        (upper.argmin(), -1.0, upper.min() < hypothesis.theta_high),
    ):
        if is_bound:  # the term that bounds theta from below, or above
            row, axis = divmod(int(place), 3)
            frame = int(frames[0]) + row
            direction = np.zeros(3)
            direction[axis] = sign * np.sign(slope[row, axis])
            weight = 1.0 / (hypothesis.history.dt * abs(float(slope[row, axis])))
            terms.append(Term(direction, inf, frame - 1, frame, weight))
    return terms


def of_type(hypothesis: Hypothesis, k: int) -> Tests:
    """Of the last two frames, if theta may change in each; otherwise, of the frames since the alarm that
    health does not explain, two that one theta does not explain, or one of the last three. None needs a frame
    before the first kept one, because no effect is known there.
    """
    history = hypothesis.history
    first = hypothesis.first_frame
    if hypothesis.theta == ANY:
        for frame in range(max(k - 1, first), k + 1):
            yield from of_one_frame(hypothesis, frame)
        return
    frames = np.arange(max(history.alarm, first), k + 1)
    if not len(frames):
        return
    frames = frames[history.is_unexplained(frames)]
    if hypothesis.slope.any():
        yield of_constant_theta(hypothesis, frames)
    for frame in frames[-3:].tolist():
        yield from filters(inf, frame - 1, frame)


def of_block(hypothesis: Hypothesis, blocks: History, k: int) -> Tests:
    """Of the block before block k, and of block k, as a sum over its frames, in which theta may differ. The
    effects of a fault must be kept from the row before the block on. hypothesis: by frames."""
    L = blocks.length
    for start in (blocks.begin + block * L - 1 for block in (k - 1, k)):
        if start >= hypothesis.first_frame:
            yield from filters(ADDING_POLE_PER_S, start, start + L, hypothesis.axes)
