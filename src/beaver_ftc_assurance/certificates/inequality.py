"""The inequality that an alarm or an exclusion is, and the search for it.

    c_1 (d_1 . E_1[k_1]) + c_2 (d_2 . E_2[k_2]) + ... > the most that hypothesis and declared errors allow

E[k] rad/s: the innovation through a filter of pole lam up to frame k; for an infinite pole the innovation of
frame k alone, times dt. d (3,): a direction; c > 0: a weight. With one term the fault's parameter theta may
take any value in its range in every frame, or the fault be absent; where theta is constant it is one number
for all terms. docs/explanation/certificates.md, "The inequality", derives it.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import combinations, compress
from math import exp, inf, isinf

import numpy as np

from beaver_ftc.results import Document
from beaver_ftc_assurance.certificates.check_certificate import MIN_EFFECT_RAD_S2
from beaver_ftc_assurance.certificates.history import ROUNDING_SHARE, History

N_WRITTEN_FRAMES = 16  # of a filter; what was before them is stated as the filter's state
MIN_RELATIVE_MARGIN = 1e-9  # by which the left side is larger, over the larger side: summation may do less
MIN_SLOPE = 1e-12  # of a sum in theta: a smaller one is rounding, as where theta drops out of two terms
ANY = "any"  # theta of a statement
CONSTANT = "constant"
CONSTANT_WHILE_SHOWN = "constant while it shows"
MEMORY_TIME_CONSTANTS = 16.0  # of a filter: of an older innovation less than e^-16 is left


@dataclass(frozen=True)
class Hypothesis:
    """A fault's effect on the innovation: offset + theta slope, within +-spread, rad/s2; theta in
    [theta_low, theta_high]. Arrays (frames, 3), from frame first_frame on, before which none is kept.

    theta: `any` in each frame, one that is `constant`, or `constant while it shows`: one in frames that
    health does not explain, while elsewhere the fault may be absent. axes: those of the innovation that the
    hypothesis is tested on.
    """

    first_frame: int
    offset: np.ndarray
    slope: np.ndarray
    spread: np.ndarray
    theta_low: float
    theta_high: float
    theta: str = ANY
    axes: tuple[int, ...] = (0, 1, 2)

    def along(self, direction: np.ndarray, frames: slice) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Offset h, slope Z and spread r (frames,) along a direction (3,) in these frames."""
        here = slice(frames.start - self.first_frame, frames.stop - self.first_frame)
        size = np.abs(direction)
        return self.offset[here] @ direction, self.slope[here] @ direction, self.spread[here] @ size

    def max_effects(self, direction: np.ndarray, frames: slice) -> np.ndarray:
        """Largest effect of a fault that may be absent, (frames,); one of no more than rounding is none."""
        h, Z, r = self.along(direction, frames)
        ends = np.maximum(h + self.theta_low * Z, h + self.theta_high * Z)
        return np.where(ends > MIN_EFFECT_RAD_S2, ends, 0.0) + r


def no_fault(first_frame: int, n_frames: int) -> Hypothesis:
    """The hypothesis of a healthy aircraft."""
    zero = np.zeros((n_frames, 3))
    return Hypothesis(first_frame, zero, zero, zero, 0.0, 0.0)


@dataclass(frozen=True)
class Term:
    """One filter along a direction (3,), from frame filter_start, where its residual is zero, to last_frame.

    effect_before: rad/s, largest effect of the fault on the filter before its effects are kept.
    """

    direction: np.ndarray
    pole_per_s: float
    filter_start: int
    last_frame: int
    weight: float = 1.0
    effect_before: float = 0.0


@dataclass(frozen=True)
class Inequality:
    """A sum over filters, and the hypothesis that allows no more than its limit."""

    terms: list[Term]
    hypothesis: Hypothesis
    history: History

    def statement(self) -> Document | None:
        """The fields of a statement: every number that the inequality takes, and none that decides nothing.
        None unless the data exceed the limit of the hypothesis by more than rounding."""
        of = self.hypothesis
        said, sums, deciding = zip(*map(self._evaluate, self.terms), strict=True)
        value, limit, slope = np.sum(sums, axis=0).tolist()
        by_theta = max(of.theta_low * slope, of.theta_high * slope) if abs(slope) > MIN_SLOPE else 0.0
        limit += by_theta
        if not value - limit > MIN_RELATIVE_MARGIN * max(abs(limit), abs(value)):
            return None
        decides = np.any(deciding, axis=0)
        if of.theta != ANY:
            decides = np.array([slope < 0.0, slope > 0.0]) & bool(by_theta)
            if abs(slope) > MIN_SLOPE and not by_theta:  # the end of the range that counts is zero: no effect
                said = [{name: entry for name, entry in one.items() if name != "Z"} for one in said]
        ends = dict(compress({"least": of.theta_low, "most": of.theta_high}.items(), decides))
        about = {**self.history.statement_fields, "theta": of.theta, **ends}
        return {**about, "terms": list(said), "sides": [value, limit]}

    def _evaluate(self, term: Term) -> tuple[Document, np.ndarray, tuple[bool, bool]]:
        """Fields of a term; sums (3,): weighted value, and limit without a constant theta, rad/s, and the
        factor of a constant theta in that limit; whether the least, and the greatest, theta decides in any
        frame.

            E     = sum_{s<j<=k} a^(k-j) dt nu[j].d
            limit = sum_{s<j<=k} a^(k-j) dt eta_bar[j].|d| + noise + largest effect of the fault
            noise = n[k] + a^(k-s-1) n[s] + (1-a) sum_{s<j<k} a^(k-1-j) n[j],   n = |change of gyro error|.|d|

        s: filter_start; k: last_frame; a: decay of the filter in a frame, 0 for an infinite pole. h, Z, r:
        the fault's effect along d in the frames that are written out, from `first` on; before, rad/s: the
        largest that the filter has of it from the frames before them."""
        of = self.hypothesis
        history = self.history
        d = term.direction
        dt = self.history.dt
        start = term.filter_start
        last = term.last_frame
        first = self._first_written_frame(term)
        a = exp(-term.pole_per_s * dt)
        summed = slice(start + 1, last + 1)
        weights = _filter_weights(a, last - start)
        value = dt * weights @ (history.innovation_rad_s2[summed] @ d)
        noise = history.gyro_error_change_rad_s @ np.abs(d)
        gyro = a * weights[0] * noise[start] + (1.0 - a) * weights @ noise[start:last] + noise[last]
        limit = dt * weights @ (history.eta_bar_rad_s2[summed] @ np.abs(d)) + gyro
        begin = min(max(start, of.first_frame) + 1, first)
        before = _filtered(a, dt, of.max_effects(d, slice(begin, first)), term.effect_before)
        rows = slice(first, last + 1)
        h, Z, r = of.along(d, rows)
        at_low = h + of.theta_low * Z
        at_high = h + of.theta_high * Z
        if of.theta == ANY:
            done = of.max_effects(d, rows)
            slope = 0.0
            adds = np.maximum(at_low, at_high) > MIN_EFFECT_RAD_S2
        else:
            done = h + r
            slope = float(dt * _filter_weights(a, len(Z)) @ Z)
            adds = np.ones(len(h), bool)
        limit += _filtered(a, dt, done, before)
        decides = bool((adds & (at_low > at_high)).any()), bool((adds & (at_high > at_low)).any())
        sums = term.weight * np.array([value, limit, slope])
        return self._fields_of(term, rows, before, adds), sums, decides

    def _fields_of(self, term: Term, rows: slice, before: float, adds: np.ndarray) -> Document:
        """The fields of a term whose frames `rows` are written out. before: largest effect of the fault
        before them, rad/s; adds (frames,): whether the fault's effect is more than rounding."""
        history = self.history
        is_filtered = not isinf(term.pole_per_s)
        said: Document = {"weight": term.weight, "d": term.direction.tolist()}
        said |= {"pole_per_s": term.pole_per_s, "since": term.filter_start} if is_filtered else {}
        said |= {"first": rows.start, "frame": term.last_frame}
        said |= {"fault": before} if is_filtered and before else {}
        logged = {"x": history.rates_rad_s, "F": history.model_rad_s2, "eta_bar": history.eta_bar_rad_s2}
        said |= {name: values[rows].tolist() for name, values in logged.items()}
        rest = history.unstated_bound_rad_s2[rows]
        rest = np.where(np.abs(rest) < ROUNDING_SHARE * history.eta_bar_rad_s2[rows], 0.0, rest)
        said |= {"rest": rest.tolist()} if rest.any() else {}
        h, Z, r = self.hypothesis.along(term.direction, rows)
        for name, values in (("h", h), ("Z", Z)):
            if (values * adds).any():
                said[name] = [float(v) if there else None for v, there in zip(values, adds, strict=True)]
        return said | ({"r": r.tolist()} if r.any() else {})

    def _first_written_frame(self, term: Term) -> int:
        """The first frame that is written out: what the filter has forgotten would decide nothing. A constant
        theta needs all frames that the filter remembers."""
        last = term.last_frame
        if isinf(term.pole_per_s):
            return last
        of = self.hypothesis
        start = term.filter_start
        longest = N_WRITTEN_FRAMES if of.theta == ANY else last - start
        remembered = int(MEMORY_TIME_CONSTANTS / (term.pole_per_s * self.history.dt))
        first = last + 1 - max(min(longest, remembered), 1)
        return max(first, start + 1, of.first_frame + 1)


def _filter_weights(decay: float, n: int) -> np.ndarray:
    """Weights of the last n frames in a filter, (n,), the last of them 1."""
    return np.asarray(decay ** np.arange(n - 1.0, -1.0, -1.0))


def _filtered(decay: float, dt: float, effects: np.ndarray, before: float) -> float:
    """A filter of effects (n,) rad/s2 that begins with `before`, rad/s."""
    if not len(effects):
        return before
    weights = _filter_weights(decay, len(effects))
    return float(decay * weights[0] * before + dt * weights @ effects)


def first_violated(candidates: Iterable[list[Term]], of: Hypothesis, history: History) -> Document | None:
    """The statement of the first inequality that the data violate; None if there is none."""
    said = (Inequality(terms, of, history).statement() for terms in candidates if terms)
    return next(filter(None, said), None)


def axis_directions(axes: tuple[int, ...]) -> Iterator[np.ndarray]:
    """Both directions (3,) along each of the axes."""
    return (way for d in np.eye(3)[[*axes]] for way in (d, 0.0 - d))  # -d would write -0.0


def filters(pole_per_s: float, start: int, last: int, axes: tuple[int, ...]) -> Iterator[list[Term]]:
    """Inequalities of one filter, both ways along each axis."""
    return ([Term(d, pole_per_s, start, last)] for d in axis_directions(axes))


def single_frame_tests(frame: int, hypothesis: Hypothesis) -> Iterator[list[Term]]:
    """The inequalities of one frame: along each axis; across two of them such that theta drops out."""
    yield from filters(inf, frame - 1, frame, hypothesis.axes)
    slope = hypothesis.slope[frame - hypothesis.first_frame]
    for i, j in combinations(hypothesis.axes, 2):
        if slope[i] or slope[j]:
            d = np.zeros(3)
            d[i] = slope[j]
            d[j] = -slope[i]
            d /= np.abs(d).max()
            yield from ([Term(way, inf, frame - 1, frame)] for way in (d, -d))


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
    effect = history.innovation_rad_s2[rows] - hypothesis.offset[here]
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
    terms = []
    for place, sign, is_bound in (
        (np.unravel_index(np.argmax(lower), lower.shape), 1.0, lower.max() > hypothesis.theta_low),
        (np.unravel_index(np.argmin(upper), upper.shape), -1.0, upper.min() < hypothesis.theta_high),
    ):
        if is_bound:  # the term that bounds theta from below, or above
            frame = int(frames[0] + place[0])
            direction = np.zeros(3)
            direction[place[1]] = sign * np.sign(slope[place])
            weight = 1.0 / (history.dt * abs(float(slope[place])))
            terms.append(Term(direction, inf, frame - 1, frame, weight))
    return terms
