"""The inequality that an alarm or an exclusion is, and the search for it.

    c_1 (d_1 . E_1[k_1]) + c_2 (d_2 . E_2[k_2]) + ... > the most that hypothesis and declared errors allow

E[k] rad/s: the innovation through a filter of pole lam up to frame k; for an infinite pole the innovation of
frame k alone, times dt. d (3,): a direction; c > 0: a weight. With one term the fault's parameter theta may
take any value in its range in every frame, or the fault be absent; with `theta_is_constant` theta is one
number for all terms. docs/explanation/certificates.md, "The inequality", derives it.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import exp, inf, isinf, nan
from typing import Any

import numpy as np

from beaver_ftc.design import AXES
from beaver_ftc.diagnosis import ROUNDING_RAD_S2
from beaver_ftc.loop import FrameReadout
from beaver_ftc.results import Document

N_WRITTEN_FRAMES = 16  # of a filter; what was before them is stated as the filter's state
MIN_RELATIVE_MARGIN = 1e-9  # by which the left side is larger, over the larger side: summation may do less
ROUNDING_SHARE = 4e-15  # of a bound: a smaller part of it is rounding
MIN_EFFECT_RAD_S2 = 1e-12  # a smaller effect of a fault is rounding
MIN_SLOPE = 1e-12  # of a sum in theta: a smaller one comes from rounding, where theta drops out of two terms
MEMORY_TIME_CONSTANTS = 16.0  # of a filter: of an older innovation less than e^-16 is left


@dataclass(frozen=True)
class DeclaredErrors:
    """Declared errors that the bound on the model's error contains, by axis (3,).

    inertia_coupling: largest error of the model's coefficient of a product of two rates, 1/rad.
    constant_rad_s2: constant part. earth_rad_s: rate of the Earth, which the model leaves out; earth_gain:
    largest coefficient of a product with it, 1/rad, at least 1. Error of a gyro's reading: at most
    gyro_offset_rad_s + gyro_slope |rate|, of which gyro_constant_rad_s does not change.
    """

    inertia_coupling: np.ndarray
    constant_rad_s2: np.ndarray
    earth_rad_s: float
    earth_gain: np.ndarray
    gyro_offset_rad_s: np.ndarray
    gyro_constant_rad_s: np.ndarray
    gyro_slope: np.ndarray


@dataclass(frozen=True)
class History:
    """Columns of a log, (rows, 3) by axis: measured body rates; angular acceleration of the design model, and
    bound on its error, of the frame that ends with the row.

    dt: of a frame, s. instant_share: 1 / number of instants (JSBSim frames) in a frame.
    """

    dt: float
    instant_share: float
    rates_rad_s: np.ndarray
    model_rad_s2: np.ndarray
    eta_bar_rad_s2: np.ndarray
    declared: DeclaredErrors

    def with_constant_gyro_errors_on(self, axes: np.ndarray) -> "History":
        """The same, with a constant gyro error on the axes where `axes` (3,) is 1 alone; on others all of the
        error may change."""
        constant = self.declared.gyro_constant_rad_s * axes
        return replace(self, declared=replace(self.declared, gyro_constant_rad_s=constant))

    @property
    def statement_fields(self) -> Document:
        """Fields of a statement that say which rows make a frame: none, each row is one."""
        return {}

    @cached_property
    def gyro_error_change_rad_s(self) -> np.ndarray:
        """n of docs/explanation/detection.md, "Changing error of a gyro", (rows, 3)."""
        declared = self.declared
        changing = declared.gyro_offset_rad_s - declared.gyro_constant_rad_s
        max_rates = np.abs(self.rates_rad_s) + self.gyro_error_rad_s
        return np.asarray(changing + declared.gyro_slope * max_rates)

    @cached_property
    def gyro_error_rad_s(self) -> np.ndarray:
        """Bound on |true rate - reading|, (rows, 3)."""
        offset, slope = self.declared.gyro_offset_rad_s, self.declared.gyro_slope
        return np.asarray((offset + slope * np.abs(self.rates_rad_s)) / (1.0 - slope))

    @cached_property
    def _innovation(self) -> np.ndarray:
        rates = self.rates_rad_s
        return np.asarray(np.diff(rates, axis=0, prepend=np.nan * rates[:1]) / self.dt - self.model_rad_s2)

    def innovation(self, rows: slice) -> np.ndarray:
        """nu of these rows, (rows, 3) rad/s2; not a number in the log's first row."""
        return self._innovation[rows]

    def innovation_bound(self, rows: slice) -> np.ndarray:
        """Bound on |nu| without a fault, (rows, 3) rad/s2; not a number in the first row."""
        change = self.gyro_error_change_rad_s
        return np.asarray(self.eta_bar_rad_s2[rows] + (change + _row_before(change))[rows] / self.dt)

    def unstated_bound(self, rows: slice) -> np.ndarray:
        """The part of eta_bar that does not follow from the declared errors, (rows, 3) rad/s2: it is without
        inertia, constant and Earth, at the row before."""
        declared = self.declared
        rates = _row_before(np.abs(self.rates_rad_s) + self.gyro_error_rad_s)[rows]
        earth, gain = declared.earth_rad_s, declared.earth_gain
        products = _products_of_other_axes(rates)
        by_earth = earth * ((1.0 + gain) * rates.sum(axis=1, keepdims=True) + gain * earth) + ROUNDING_RAD_S2
        stated = declared.inertia_coupling * products + declared.constant_rad_s2 + by_earth
        return np.asarray(self.eta_bar_rad_s2[rows] - self.instant_share * stated)


def _products_of_other_axes(rates: np.ndarray) -> np.ndarray:
    """q r, p r, p q of rates (rows, 3)."""
    return np.column_stack((rates[:, 1] * rates[:, 2], rates[:, 0] * rates[:, 2], rates[:, 0] * rates[:, 1]))


def _row_before(values: np.ndarray) -> np.ndarray:
    """Values (rows, 3) moved by a row: in each row those of the row before; in the first not a number."""
    return np.concatenate([np.full_like(values[:1], nan), values[:-1]])


def declared_errors_of(frame: FrameReadout) -> DeclaredErrors:
    """The declared errors in a flight's record, with the coefficients of inertia that they multiply."""
    bound, inertia = frame.diagnosis.declared_bounds, frame.inertia
    size = {name: abs(value) for name, value in inertia._asdict().items()}
    gains = (
        size["Ppq"] + size["Pqr"],
        size["Qpr"] + 2.0 * max(size["Qpp"], size["Qrr"]),
        size["Rpq"] + size["Rqr"],
    )
    return DeclaredErrors(
        inertia_coupling=bound.inertia_coupling_error_share * np.abs([inertia.Pqr, inertia.Qpr, inertia.Rpq]),
        constant_rad_s2=bound.constant_error_rad_s2,
        earth_rad_s=bound.earth_rate_rad_s, earth_gain=np.maximum(gains, 1.0),
        gyro_offset_rad_s=bound.gyro_error_bound_at_rest_rad_s,
        gyro_constant_rad_s=bound.constant_gyro_error_bound_rad_s,
        gyro_slope=bound.gyro_error_bound_per_rate,
    )  # fmt: skip


def declared_fields(history: History, frames: list[np.ndarray], axes: np.ndarray) -> Document:
    """The field `declared` of a certificate, by letter and axis (docs/explanation/certificates.md, "The
    fields"): what is not zero, and adds to the bounds of these frames. axes (3,): 1 where a constant error of
    the gyro counts."""
    declared = history.declared
    gyro = {
        "o": declared.gyro_offset_rad_s,
        "B": declared.gyro_constant_rad_s * axes,
        "m": declared.gyro_slope,
    }
    if not frames:
        return _by_axis(gyro | {name: [] for name in "cbg"})
    rows = np.concatenate(frames)
    products = _products_of_other_axes((np.abs(history.rates_rad_s) + history.gyro_error_rad_s)[rows - 1])
    coupling = declared.inertia_coupling.copy()
    added = coupling * products * history.instant_share
    coupling[(added <= ROUNDING_SHARE * history.eta_bar_rad_s2[rows]).all(axis=0)] = 0.0
    gain = declared.earth_gain if declared.earth_rad_s else np.empty(0)
    return _by_axis(gyro | {"c": coupling, "b": declared.constant_rad_s2, "g": gain})


def _by_axis(numbers: Mapping[str, Sequence[float] | np.ndarray]) -> Document:
    """By name and axis the numbers that are not zero."""
    return {
        name: {axis: float(v) for axis, v in zip(AXES, values, strict=False) if v}
        for name, values in numbers.items()
    }


@dataclass(frozen=True)
class Hypothesis:
    """A fault's effect on the innovation: offset + theta slope, within +-spread, rad/s2; theta in
    [theta_low, theta_high]. Arrays (frames, 3), from frame first_frame on.

    theta_is_constant: theta is one number; only_where_shown: one in frames that health does not explain,
    while elsewhere the fault may be absent. axes: those of the innovation that the hypothesis is tested on.
    """

    first_frame: int
    offset: np.ndarray
    slope: np.ndarray
    spread: np.ndarray
    theta_low: float
    theta_high: float
    theta_is_constant: bool = False
    only_where_shown: bool = False
    axes: tuple[int, ...] = (0, 1, 2)

    def along(self, direction: np.ndarray, frames: slice) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Offset, slope and spread (frames,) along a direction (3,) in these frames."""
        here = slice(frames.start - self.first_frame, frames.stop - self.first_frame)
        size = np.abs(direction)
        return self.offset[here] @ direction, self.slope[here] @ direction, self.spread[here] @ size


def no_fault(first_frame: int, n_frames: int) -> Hypothesis:
    """The hypothesis of health."""
    zero = np.zeros((n_frames, 3))
    return Hypothesis(first_frame, zero, zero, zero, 0.0, 0.0)


@dataclass(frozen=True)
class Term:
    """One filter along a direction (3,), from frame filter_start, where its residual is zero, to last_frame.

    effect_before: rad/s, largest effect of the fault on the filter up to frame first_kept_frame, before which
    the fault's effects are not kept.
    """

    direction: np.ndarray
    pole_per_s: float
    filter_start: int
    last_frame: int
    weight: float = 1.0
    first_kept_frame: int = 0
    effect_before: float = 0.0

    def decay(self, dt: float) -> float:
        """Share of the residual that is left after a frame of dt s."""
        return 0.0 if isinf(self.pole_per_s) else exp(-self.pole_per_s * dt)


def evaluate_term(
    term: Term, hypothesis: Hypothesis, history: History, first_frame: int
) -> tuple[float, float, float, float]:
    """The term's value, rad/s; the limit on it without a constant theta; the factor of a constant theta in
    that limit; and the largest effect of the fault before first_frame."""
    decay, direction, dt = term.decay(history.dt), term.direction, history.dt
    abs_direction = np.abs(direction)
    gyro = history.gyro_error_change_rad_s @ abs_direction
    filtered_frames = slice(term.filter_start + 1, term.last_frame + 1)
    weights = _filter_weights(decay, term.last_frame - term.filter_start)
    value = dt * weights @ (history.innovation(filtered_frames) @ direction)
    gyro_limit = (
        decay * weights[0] * gyro[term.filter_start]
        + (1.0 - decay) * weights @ gyro[term.filter_start : term.last_frame]
        + gyro[term.last_frame]
    )
    limit = dt * weights @ (history.eta_bar_rad_s2[filtered_frames] @ abs_direction) + gyro_limit
    offset, slope, spread = hypothesis.along(direction, slice(first_frame, term.last_frame + 1))
    weights = _filter_weights(decay, term.last_frame + 1 - first_frame)
    before = _max_effect_before(term, hypothesis, dt, first_frame)
    if hypothesis.theta_is_constant:
        effect = decay * weights[0] * before + dt * weights @ (offset + spread)
        return value, limit + effect, float(dt * weights @ slope), before
    effects = (
        _max_effect(offset + hypothesis.theta_low * slope, offset + hypothesis.theta_high * slope) + spread
    )
    return value, limit + decay * weights[0] * before + dt * weights @ effects, 0.0, before


def _max_effect(at_low: np.ndarray, at_high: np.ndarray) -> np.ndarray:
    """Largest effect of a fault that may be absent, of its effects at both ends of theta's range."""
    return np.asarray(np.maximum(0.0, np.maximum(at_low, at_high)))


def _filter_weights(decay: float, n: int) -> np.ndarray:
    """Weights of the last n frames in a filter, (n,), the last of them 1."""
    return np.asarray(decay ** np.arange(n - 1.0, -1.0, -1.0))


def _max_effect_before(term: Term, hypothesis: Hypothesis, dt: float, first_frame: int) -> float:
    """Largest effect of the fault on a filter before first_frame, rad/s."""
    decay = term.decay(dt)
    begin = max(term.filter_start, term.first_kept_frame) + 1
    if first_frame <= begin:
        return term.effect_before
    offset, slope, spread = hypothesis.along(term.direction, slice(begin, first_frame))
    effects = (
        _max_effect(offset + hypothesis.theta_low * slope, offset + hypothesis.theta_high * slope) + spread
    )
    weights = _filter_weights(decay, first_frame - begin)
    return float(decay * weights[0] * term.effect_before + dt * weights @ effects)


def sides(terms: list[Term], hypothesis: Hypothesis, history: History) -> tuple[float, float]:
    """Both sides of the inequality."""
    evaluated = [
        evaluate_term(term, hypothesis, history, _first_written_frame(term, hypothesis, history.dt))
        for term in terms
    ]
    weights = np.array([term.weight for term in terms])
    value, limit, slope, _ = (float(weights @ column) for column in zip(*evaluated, strict=True))
    return value, limit + max(hypothesis.theta_low * slope, hypothesis.theta_high * slope)


def _first_written_frame(term: Term, hypothesis: Hypothesis, dt: float) -> int:
    """The first frame that is written out: what the filter has forgotten would decide nothing. A constant
    theta needs all frames that the filter remembers."""
    if isinf(term.pole_per_s):
        return term.last_frame
    longest = term.last_frame - term.filter_start if hypothesis.theta_is_constant else N_WRITTEN_FRAMES
    remembered = int(MEMORY_TIME_CONSTANTS / (term.pole_per_s * dt))
    first = term.last_frame + 1 - max(min(longest, remembered), 1)
    return max(first, term.filter_start + 1, term.first_kept_frame + 1)


def is_violated(terms: list[Term], hypothesis: Hypothesis, history: History) -> bool:
    """Whether the data exceed the limit of the hypothesis by more than rounding."""
    value, limit = sides(terms, hypothesis, history)
    return value - limit > MIN_RELATIVE_MARGIN * max(abs(limit), abs(value))


def inequality_fields(terms: list[Term], hypothesis: Hypothesis, history: History) -> Document:
    """The fields of a statement: every number that the inequality takes, and none that decides nothing."""
    low, high, is_constant = hypothesis.theta_low, hypothesis.theta_high, hypothesis.theta_is_constant
    theta = (
        ("constant while it shows" if hypothesis.only_where_shown else "constant") if is_constant else "any"
    )
    said = [_term_fields(term, hypothesis, history) for term in terms]
    slope = sum(one["weight"] * one.pop("slope") for one in said)
    value, limit = (sum(one["weight"] * one.pop(side) for one in said) for side in ("value", "limit"))
    decides = [one.pop("decides") for one in said]
    by_theta = max(low * slope, high * slope) if is_constant and abs(slope) > MIN_SLOPE else 0.0
    ends = {"least": low, "most": high}
    if is_constant:
        is_used = {"least": by_theta and slope < 0.0, "most": by_theta and slope > 0.0}
        if abs(slope) > MIN_SLOPE and not by_theta:  # the end of the range that counts is zero: no effect
            for one in said:
                one.pop("Z", None)
    else:
        is_used = {end: any(each[end] for each in decides) for end in ends}
    return {
        "theta": theta,
        **{end: number for end, number in ends.items() if is_used[end]},
        "terms": said,
        "sides": [value, limit + by_theta],
    }


def _term_fields(term: Term, hypothesis: Hypothesis, history: History) -> Document:
    """A term: filter, direction, effect of the fault before, its frames; and, to be added up by the caller,
    `value`, `limit` and `slope`, and which end of theta `decides` in any frame."""
    first = _first_written_frame(term, hypothesis, history.dt)
    value, limit, slope, before = evaluate_term(term, hypothesis, history, first)
    rows = slice(first, term.last_frame + 1)
    is_filtered = not isinf(term.pole_per_s)
    h, Z, r = hypothesis.along(term.direction, rows)
    rest = history.unstated_bound(rows)
    rest[np.abs(rest) < ROUNDING_SHARE * history.eta_bar_rad_s2[rows]] = 0.0
    at_low, at_high = h + hypothesis.theta_low * Z, h + hypothesis.theta_high * Z
    adds = (
        np.ones(len(h), bool)
        if hypothesis.theta_is_constant
        else np.maximum(at_low, at_high) > MIN_EFFECT_RAD_S2
    )
    rounding = np.where(adds, 0.0, _max_effect(at_low, at_high))
    limit -= float(history.dt * _filter_weights(term.decay(history.dt), len(h)) @ rounding)
    said: Document = {"weight": term.weight, "d": term.direction.tolist()}
    if is_filtered:
        said |= {"pole_per_s": term.pole_per_s, "since": term.filter_start}
    said |= {"first": first, "frame": term.last_frame}
    if is_filtered and before:
        said["fault"] = before
    logged = {"x": history.rates_rad_s, "F": history.model_rad_s2, "eta_bar": history.eta_bar_rad_s2}
    said |= {name: values[rows].tolist() for name, values in logged.items()}
    if rest.any():
        said["rest"] = rest.tolist()
    for name, values in (("h", h), ("Z", Z)):
        if (values * adds).any():
            said[name] = [float(v) if there else None for v, there in zip(values, adds, strict=True)]
    if r.any():
        said["r"] = r.tolist()
    decides = {
        "least": bool((adds & (at_low > at_high)).any()),
        "most": bool((adds & (at_high > at_low)).any()),
    }
    return said | {"value": value, "limit": limit, "slope": slope, "decides": decides}


def axis_directions(axes: tuple[int, ...]) -> Iterator[np.ndarray]:
    """Both directions (3,) along each of the axes."""
    for i in axes:
        for sign in (1.0, -1.0):
            direction = np.zeros(3)
            direction[i] = sign
            yield direction


def single_frame_tests(frame: int, hypothesis: Hypothesis) -> Iterator[list[Term]]:
    """The inequalities of one frame: along each axis; across two of them such that theta drops out."""
    for direction in axis_directions(hypothesis.axes):
        yield [Term(direction, inf, frame - 1, frame)]
    slope = hypothesis.slope[frame - hypothesis.first_frame]
    for i in hypothesis.axes:
        for j in hypothesis.axes:
            if i < j and (slope[i] or slope[j]):
                direction = np.zeros(3)
                direction[i], direction[j] = slope[j], -slope[i]
                direction /= np.abs(direction).max()
                yield [Term(direction, inf, frame - 1, frame)]
                yield [Term(-direction, inf, frame - 1, frame)]


def theta_bounds_by_frame(
    hypothesis: Hypothesis, history: History, frames: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Bounds on theta by each frame and axis: lower, upper, and the slope they come from; (n, 3), for the n
    frames from the first to the last of `frames`. Infinite, with a slope of 1, in frames that are not
    among `frames`, on axes that are not the hypothesis's, and where the slope is zero."""
    rows = slice(int(frames[0]), int(frames[-1]) + 1)
    is_bound = np.zeros((rows.stop - rows.start, 3), bool)
    is_bound[np.ix_(frames - rows.start, np.array(hypothesis.axes))] = True
    here = slice(rows.start - hypothesis.first_frame, rows.stop - hypothesis.first_frame)
    slope = hypothesis.slope[here]
    tolerance = history.innovation_bound(rows) + hypothesis.spread[here]
    effect = history.innovation(rows) - hypothesis.offset[here]
    is_bound &= slope != 0.0
    size = np.where(is_bound, np.abs(slope), 1.0)
    middle = effect * np.sign(slope) / size
    lower = np.where(is_bound, middle - tolerance / size, -inf)
    upper = np.where(is_bound, middle + tolerance / size, inf)
    return lower, upper, np.where(is_bound, slope, 1.0)


def constant_theta_tests(hypothesis: Hypothesis, history: History, frames: np.ndarray) -> list[Term]:
    """Terms of two frames that no one theta explains, or of one that no theta in its range does; empty if
    there are no frames to choose from."""
    if not len(frames):
        return []
    lower, upper, slope = theta_bounds_by_frame(hypothesis, history, frames)
    largest = np.unravel_index(np.argmax(lower), lower.shape)
    smallest = np.unravel_index(np.argmin(upper), upper.shape)
    terms, first = [], int(frames[0])
    if lower[largest] > hypothesis.theta_low:
        terms.append(_term_bounding_theta(largest, 1.0, slope, first, history.dt))
    if upper[smallest] < hypothesis.theta_high:
        terms.append(_term_bounding_theta(smallest, -1.0, slope, first, history.dt))
    return terms


def _term_bounding_theta(
    place: tuple[Any, ...], sign: float, slope: np.ndarray, first_frame: int, dt: float
) -> Term:
    """The term that bounds theta from below (sign 1) or above (-1); place: number of the frame from
    first_frame on, and axis."""
    frame, direction = first_frame + int(place[0]), np.zeros(3)
    direction[place[1]] = sign * np.sign(slope[place])
    return Term(direction, inf, frame - 1, frame, weight=1.0 / (dt * abs(float(slope[place]))))
