"""The inequality of an alarm or of an exclusion; search.py has those that are tried.

    c_1 (d_1 . E_1[k_1]) + c_2 (d_2 . E_2[k_2]) + ... > the largest value under hypothesis and declared errors

E[k] (3,) rad/s: the innovation up to frame k through a filter; if its pole is infinite, the innovation of
frame k alone, times dt. d (3,): a direction; c > 0: a weight. The parameter theta of the fault either may
have any value of its range in every frame, and the fault may be absent; or it is constant, i.e. one number
for all terms. docs/explanation/certificates.md, "The inequality", derives it.

Letters: nu innovation and eta_bar its declared bound (frames, 3) rad/s2; h, Z, r the fault's effect along d,
i.e. between h + theta Z - r and h + theta Z + r, rad/s2.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import compress
from math import exp, isinf

import numpy as np

from beaver_ftc.results import Document
from beaver_ftc_assurance.certificates.check_certificate import MIN_EFFECT_RAD_S2
from beaver_ftc_assurance.certificates.history import ROUNDING_SHARE, History

# Last frames of a filter that are written out if theta may change; earlier ones are in the filter's state.
N_WRITTEN_FRAMES = 16
MIN_RELATIVE_MARGIN = 1e-9  # least margin of the left side over the larger side: rounding of sums is smaller
MIN_SLOPE = 1e-12  # a smaller factor of theta in a sum is rounding, as where theta drops out of two terms
# Values of the field theta of a statement, as in `Hypothesis`.
ANY = "any"
CONSTANT = "constant"
CONSTANT_WHILE_SHOWN = "constant while it shows"
MEMORY_TIME_CONSTANTS = 16.0  # a filter forgets an innovation after this time: its weight is then below e^-16


@dataclass(frozen=True)
class Hypothesis:
    """A fault's effect on the innovation: offset + theta slope, within +-spread, rad/s2; theta in
    [theta_low, theta_high]. Arrays (frames, 3), of the frames of the history's tape: none is kept before.

    theta:
        any                       in each frame any value of the range, or the fault is absent
        constant                  one value in all frames
        constant while it shows   one value in the frames that health does not explain, while in others the
                                  fault may be absent

    axes: axes of the innovation on which the hypothesis is tested.
    """

    history: History
    offset: np.ndarray
    slope: np.ndarray
    spread: np.ndarray
    theta_low: float
    theta_high: float
    theta: str = ANY
    axes: tuple[int, ...] = (0, 1, 2)

    @property
    def first_frame(self) -> int:
        """The first frame of which the effect is kept."""
        return self.history.tape.first

    def along(self, direction: np.ndarray, frames: slice) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Offset h, slope Z and spread r (frames,) along a direction (3,) in these frames."""
        here = slice(frames.start - self.first_frame, frames.stop - self.first_frame)
        size = np.abs(direction)
        return self.offset[here] @ direction, self.slope[here] @ direction, self.spread[here] @ size

    def max_effects(self, direction: np.ndarray, frames: slice) -> np.ndarray:
        """Largest effect of a fault that may be absent, max(h + theta Z, 0) + r, (frames,). An effect up to
        MIN_EFFECT_RAD_S2 is rounding, and counts as 0."""
        h, Z, r = self.along(direction, frames)
        ends = np.maximum(h + self.theta_low * Z, h + self.theta_high * Z)
        return np.where(ends > MIN_EFFECT_RAD_S2, ends, 0.0) + r


def no_fault(history: History) -> Hypothesis:
    """The hypothesis of a healthy aircraft."""
    zero = np.zeros((history.tape.frames, 3))
    return Hypothesis(history, zero, zero, zero, 0.0, 0.0)


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
    """A sum over filters, and the hypothesis under which it is at most a limit."""

    terms: list[Term]
    hypothesis: Hypothesis

    def statement(self) -> Document | None:
        """The fields of a statement: every number that the inequality needs, and no other. None unless the
        data exceed the limit of the hypothesis by more than rounding.

        by_theta: the largest part of a constant theta in the limit, rad/s. decides (2,): whether the least,
        and the greatest, theta is needed.
        """
        hypothesis = self.hypothesis
        terms, weighted_sums, deciding = zip(*map(self._evaluate, self.terms), strict=True)
        value, limit, slope = np.sum(weighted_sums, axis=0).tolist()
        by_theta = (
            max(hypothesis.theta_low * slope, hypothesis.theta_high * slope)
            if abs(slope) > MIN_SLOPE
            else 0.0
        )
        limit += by_theta
        if not value - limit > MIN_RELATIVE_MARGIN * max(abs(limit), abs(value)):
            return None
        decides = np.any(deciding, axis=0)
        if hypothesis.theta != ANY:
            decides = np.array([slope < 0.0, slope > 0.0]) & bool(by_theta)
            if abs(slope) > MIN_SLOPE and not by_theta:  # the end of the range that counts is zero: no effect
                terms = [{name: entry for name, entry in fields.items() if name != "Z"} for fields in terms]
        ends = dict(compress({"least": hypothesis.theta_low, "most": hypothesis.theta_high}.items(), decides))
        common = {**hypothesis.history.statement_fields, "theta": hypothesis.theta, **ends}
        return {**common, "terms": list(terms), "sides": [value, limit]}

    def _evaluate(self, term: Term) -> tuple[Document, np.ndarray, tuple[bool, bool]]:
        """Fields of a term; sums (3,): weighted value, and limit without a constant theta, rad/s, and the
        factor of a constant theta in that limit; and whether the least, and the greatest, theta gives the
        largest effect in any frame.

            E     = sum_{s<j<=k} a^(k-j) dt nu[j].d
            limit = sum_{s<j<=k} a^(k-j) dt eta_bar[j].|d| + noise + largest effect of the fault
            noise = n[k] + a^(k-s-1) n[s] + (1-a) sum_{s<j<k} a^(k-1-j) n[j],   n = |change of gyro error|.|d|

        s: filter_start; k: last_frame; a: decay of the filter in a frame, 0 for an infinite pole. h, Z, r:
        the fault's effect along d in the frames that are written out, from `first` on. before, rad/s: largest
        value of the filter at frame first - 1 that the fault can cause. adds (frames,): whether the effect is
        more than rounding."""
        hypothesis = self.hypothesis
        history = hypothesis.history
        d = term.direction
        dt = history.dt
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
        begin = min(max(start, hypothesis.first_frame) + 1, first)
        before = _filtered(a, dt, hypothesis.max_effects(d, slice(begin, first)), term.effect_before)
        rows = slice(first, last + 1)
        h, Z, r = hypothesis.along(d, rows)
        at_low = h + hypothesis.theta_low * Z
        at_high = h + hypothesis.theta_high * Z
        if hypothesis.theta == ANY:
            effects = hypothesis.max_effects(d, rows)
            slope = 0.0
            adds = np.maximum(at_low, at_high) > MIN_EFFECT_RAD_S2
        else:
            effects = h + r
            slope = float(dt * _filter_weights(a, len(Z)) @ Z)
            adds = np.ones(len(h), bool)
        limit += _filtered(a, dt, effects, before)
        decides = bool((adds & (at_low > at_high)).any()), bool((adds & (at_high > at_low)).any())
        sums = term.weight * np.array([value, limit, slope])
        return self._fields_of(term, rows, before, adds), sums, decides

    def _fields_of(self, term: Term, rows: slice, before: float, adds: np.ndarray) -> Document:
        """The fields of a term whose frames `rows` are written out. before: largest effect of the fault
        before them, rad/s; adds (frames,): whether the fault's effect is more than rounding."""
        history = self.hypothesis.history
        is_filtered = not isinf(term.pole_per_s)
        fields: Document = {"weight": term.weight, "d": term.direction.tolist()}
        fields |= {"pole_per_s": term.pole_per_s, "since": term.filter_start} if is_filtered else {}
        fields |= {"first": rows.start, "frame": term.last_frame}
        fields |= {"fault": before} if is_filtered and before else {}
        logged = {"x": history.rates_rad_s, "F": history.model_rad_s2, "eta_bar": history.eta_bar_rad_s2}
        fields |= {name: values[rows].tolist() for name, values in logged.items()}
        unstated = history.unstated_bound_rad_s2[rows]
        unstated = np.where(np.abs(unstated) < ROUNDING_SHARE * history.eta_bar_rad_s2[rows], 0.0, unstated)
        fields |= {"rest": unstated.tolist()} if unstated.any() else {}
        h, Z, r = self.hypothesis.along(term.direction, rows)
        for name, values in (("h", h), ("Z", Z)):
            if (values * adds).any():
                fields[name] = [float(v) if there else None for v, there in zip(values, adds, strict=True)]
        return fields | ({"r": r.tolist()} if r.any() else {})

    def _first_written_frame(self, term: Term) -> int:
        """The first frame that is written out, of those that the filter has not forgotten: the last
        N_WRITTEN_FRAMES, or, for a constant theta, all. None is earlier than the filter or the kept
        effects."""
        last = term.last_frame
        if isinf(term.pole_per_s):
            return last
        hypothesis = self.hypothesis
        start = term.filter_start
        longest = N_WRITTEN_FRAMES if hypothesis.theta == ANY else last - start
        remembered = int(MEMORY_TIME_CONSTANTS / (term.pole_per_s * hypothesis.history.dt))
        first = last + 1 - max(min(longest, remembered), 1)
        return max(first, start + 1, hypothesis.first_frame + 1)


def _filter_weights(decay: float, n: int) -> np.ndarray:
    """Weights of the last n frames in a filter, decay^(n - 1), ..., decay, 1, (n,)."""
    return np.asarray(decay ** np.arange(n - 1.0, -1.0, -1.0))


def _filtered(decay: float, dt: float, effects: np.ndarray, before: float) -> float:
    """Value of a filter, rad/s, after effects (n,) rad/s2, if its value before them was `before`, rad/s:

    decay^n before + dt sum_j decay^(n - 1 - j) effects[j]
    """
    if not len(effects):
        return before
    weights = _filter_weights(decay, len(effects))
    return float(decay * weights[0] * before + dt * weights @ effects)


def first_violated(candidates: Iterable[list[Term]], hypothesis: Hypothesis) -> Document | None:
    """The statement of the first inequality that the data violate; None if there is none."""
    statements = (Inequality(terms, hypothesis).statement() for terms in candidates if terms)
    return next(filter(None, statements), None)
