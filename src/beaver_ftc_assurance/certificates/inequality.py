"""The inequality that an alarm or an exclusion is, and the search for it (docs/explanation/certificates.md).

    c_1 (d_1 . E_1[k_1]) + c_2 (d_2 . E_2[k_2]) + ... > the most that hypothesis and declared errors allow

E is the innovation through a filter of pole lam, the frame's own for a pole of infinity; d is a direction.
With one term the fault's parameter may move as it likes, or the fault be absent, in every frame; with
`constant` it is one number for all terms.
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

WINDOW = 16  # frames that are written out; what was before them is the filter's state
_LEAST = 1e-9  # of a margin, as a share of the limit: more than another order of summation makes
_ROUNDING = 4e-15  # of a bound: a smaller part of it is rounding
_LEAST_EFFECT = 1e-12  # rad/s2, of a fault: less is rounding
_LEAST_SLOPE = 1e-12  # of a theta that two terms let drop out
_FORGOTTEN = 16.0  # time constants of a filter: of what is older e^-16 is left


@dataclass(frozen=True)
class DeclaredErrors:
    """Declared errors that the bound on the model's error has in it, by axis (3,).

    coupled: share by which the inertial coupling may be off, times its coefficient; of products of two rates.
    constant_rad_s2. earth_rad_s: rate of the Earth that the model leaves out, earth_share: what of it each
    axis feels. gyro: error of a reading, offset + slope |rate|; steady: what of the offset does not change.
    """

    coupled: np.ndarray
    constant_rad_s2: np.ndarray
    earth_rad_s: float
    earth_share: np.ndarray
    gyro_offset_rad_s: np.ndarray
    gyro_steady_rad_s: np.ndarray
    gyro_slope: np.ndarray


@dataclass(frozen=True)
class History:
    """Rows of a log, (rows, 3): rates x, model, eta_bar; and of the declared errors of gyros what a reading's
    changes by, noise. declared: what they follow from."""

    dt: float
    share: float  # one over the instants in a frame
    x: np.ndarray
    model: np.ndarray
    eta_bar: np.ndarray
    declared: DeclaredErrors

    def asking(self, axes: np.ndarray) -> "History":
        """The same, with what gyros are always off by on these axes alone, (3,); on others it may change."""
        steady = self.declared.gyro_steady_rad_s * axes
        return replace(self, declared=replace(self.declared, gyro_steady_rad_s=steady))

    @property
    def said(self) -> Document:
        """What a statement says of the rows that it goes by: frames."""
        return {}

    @cached_property
    def noise(self) -> np.ndarray:
        """n of theory, section 2, (rows, 3) rad/s."""
        declared = self.declared
        changing = declared.gyro_offset_rad_s - declared.gyro_steady_rad_s
        return np.asarray(changing + declared.gyro_slope * (np.abs(self.x) + self.off))

    @cached_property
    def off(self) -> np.ndarray:
        """How far a rate can be from its reading, (rows, 3) rad/s."""
        slope = self.declared.gyro_slope
        return np.asarray((self.declared.gyro_offset_rad_s + slope * np.abs(self.x)) / (1.0 - slope))

    @cached_property
    def _nu(self) -> np.ndarray:
        return np.asarray(np.diff(self.x, axis=0, prepend=np.nan * self.x[:1]) / self.dt - self.model)

    def innovation(self, rows: slice) -> np.ndarray:
        """nu of rows after the first, (rows, 3) rad/s2."""
        return self._nu[rows]

    def frame_bound(self, rows: slice) -> np.ndarray:
        """The bound on it, (rows, 3) rad/s2; not a number in the first row, before which nothing is known."""
        return np.asarray(self.eta_bar[rows] + (self.noise[rows] + _before(self.noise)[rows]) / self.dt)

    def rest(self, rows: slice) -> np.ndarray:
        """What of eta_bar is neither published nor the Earth's, nor of the row before; (rows, 3) rad/s2."""
        declared, f = self.declared, _before(np.abs(self.x) + self.off)[rows]
        earth, g = declared.earth_rad_s, declared.earth_share
        pairs = np.column_stack((f[:, 1] * f[:, 2], f[:, 0] * f[:, 2], f[:, 0] * f[:, 1]))
        of_earth = earth * ((1.0 + g) * f.sum(axis=1, keepdims=True) + g * earth) + ROUNDING_RAD_S2
        declared_now = declared.coupled * pairs + declared.constant_rad_s2 + of_earth
        return np.asarray(self.eta_bar[rows] - self.share * declared_now)


def _before(values: np.ndarray) -> np.ndarray:
    """Of each row the one before, (rows, 3); before the first there is none."""
    return np.concatenate([np.full_like(values[:1], nan), values[:-1]])


def declared_of(frame: FrameReadout) -> DeclaredErrors:
    """What a flight's record holds of the declared bounds, and of the coefficients in them."""
    bound, of = frame.diagnosis.bound, frame.inertia
    most = {name: abs(value) for name, value in of._asdict().items()}
    shares = (
        most["Ppq"] + most["Pqr"],
        most["Qpr"] + 2.0 * max(most["Qpp"], most["Qrr"]),
        most["Rpq"] + most["Rqr"],
    )
    return DeclaredErrors(
        coupled=bound.inertia * np.abs([of.Pqr, of.Qpr, of.Rpq]), constant_rad_s2=bound.constant_rad_s2,
        earth_rad_s=bound.earth_rate_rad_s, earth_share=np.maximum(shares, 1.0),
        gyro_offset_rad_s=bound.gyro_offset_rad_s, gyro_steady_rad_s=bound.gyro_steady_rad_s,
        gyro_slope=bound.gyro_slope,
    )  # fmt: skip


def declaration(history: History, frames: list[np.ndarray], asked: np.ndarray) -> Document:
    """What the certificate says of it, in the letters of theory, section 2, by axis: what is not zero, and
    adds anything to the bounds of these rows, on the axes `asked` (3,)."""
    declared = history.declared
    steady = declared.gyro_steady_rad_s * asked
    of = {"o": declared.gyro_offset_rad_s, "B": steady, "m": declared.gyro_slope}
    if not frames:
        return _by_axis(of | {name: [] for name in "cbg"})
    rows = np.concatenate(frames)
    f = (np.abs(history.x) + history.off)[rows - 1]
    pairs = np.column_stack((f[:, 1] * f[:, 2], f[:, 0] * f[:, 2], f[:, 0] * f[:, 1]))
    c = declared.coupled.copy()
    c[(c * pairs * history.share <= _ROUNDING * history.eta_bar[rows]).all(axis=0)] = 0.0
    g = declared.earth_share if declared.earth_rad_s else np.empty(0)
    return _by_axis(of | {"c": c, "b": declared.constant_rad_s2, "g": g})


def _by_axis(of: Mapping[str, Sequence[float] | np.ndarray]) -> Document:
    return {
        name: {axis: float(v) for axis, v in zip(AXES, values, strict=False) if v}
        for name, values in of.items()
    }


@dataclass(frozen=True)
class Hypothesis:
    """What a fault adds to the innovation: offset + theta slope, give or take spread; theta in [low, high].

    Arrays (frames, 3) from frame `first` on. constant: theta is one number; shown: in frames that health does
    not explain. asked: the axes on which it is held against the data.
    """

    first: int
    offset: np.ndarray
    slope: np.ndarray
    spread: np.ndarray
    low: float
    high: float
    constant: bool = False
    shown: bool = False
    asked: tuple[int, ...] = (0, 1, 2)


def nothing(first: int, frames: int) -> Hypothesis:
    """No fault."""
    zero = np.zeros((frames, 3))
    return Hypothesis(first, zero, zero, zero, 0.0, 0.0)


@dataclass(frozen=True)
class Term:
    """One filter in one direction (3,), up to a frame: begun, with no residual, at frame `since`.

    before: rad/s, what the fault can have done to it by the frame `known_from`, before which nothing is kept.
    """

    direction: np.ndarray
    pole_per_s: float
    since: int
    frame: int
    weight: float = 1.0
    known_from: int = 0
    before: float = 0.0

    def decay(self, dt: float) -> float:
        """What a frame leaves of the residual."""
        return 0.0 if isinf(self.pole_per_s) else exp(-self.pole_per_s * dt)


def measure(term: Term, of: Hypothesis, history: History, first: int) -> tuple[float, float, float, float]:
    """The term's value; the most that it can be, and what a constant theta multiplies in that; and what the
    fault can have done before frame `first`."""
    a, d, dt = term.decay(history.dt), term.direction, history.dt
    size, n = np.abs(d), history.noise @ np.abs(d)
    past = slice(term.since + 1, term.frame + 1)
    weight = _weights(a, term.frame - term.since)
    value = dt * weight @ (history.innovation(past) @ d)
    noise = a * weight[0] * n[term.since] + (1.0 - a) * weight @ n[term.since : term.frame] + n[term.frame]
    limit = dt * weight @ (history.eta_bar[past] @ size) + noise
    here = slice(first - of.first, term.frame + 1 - of.first)
    offset, slope, spread = of.offset[here] @ d, of.slope[here] @ d, of.spread[here] @ size
    weight = _weights(a, term.frame + 1 - first)
    before = _done_before(term, of, dt, first)
    if of.constant:
        done = a * weight[0] * before + dt * weight @ (offset + spread)
        return value, limit + done, float(dt * weight @ slope), before
    most = _most(offset + of.low * slope, offset + of.high * slope) + spread
    return value, limit + a * weight[0] * before + dt * weight @ most, 0.0, before


def _most(low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """The most that a fault between these does, if it may be absent."""
    return np.asarray(np.maximum(0.0, np.maximum(low, high)))


def _weights(a: float, n: int) -> np.ndarray:
    """What is left of the last n frames' inputs."""
    return np.asarray(a ** np.arange(n - 1.0, -1.0, -1.0))


def _done_before(term: Term, of: Hypothesis, dt: float, first: int) -> float:
    """The most the fault can have done to a filter before frame `first`."""
    a, d = term.decay(dt), term.direction
    begin = max(term.since, term.known_from) + 1
    if first <= begin:
        return term.before
    here = slice(begin - of.first, first - of.first)
    offset, slope, spread = of.offset[here] @ d, of.slope[here] @ d, of.spread[here] @ np.abs(d)
    most = _most(offset + of.low * slope, offset + of.high * slope) + spread
    weight = _weights(a, first - begin)
    return float(a * weight[0] * term.before + dt * weight @ most)


def sides(terms: list[Term], of: Hypothesis, history: History) -> tuple[float, float]:
    """Both sides of the inequality."""
    measured = [measure(term, of, history, _first(term, of, history.dt)) for term in terms]
    weights = np.array([term.weight for term in terms])
    value, limit, slope, _ = (float(weights @ column) for column in zip(*measured, strict=True))
    return value, limit + max(of.low * slope, of.high * slope)


def _first(term: Term, of: Hypothesis, dt: float) -> int:
    """The first frame that is written out: what is forgotten would decide nothing. A constant parameter needs
    all there are."""
    if isinf(term.pole_per_s):
        return term.frame
    longest = term.frame - term.since if of.constant else WINDOW
    known = int(_FORGOTTEN / (term.pole_per_s * dt))
    return max(term.frame + 1 - max(min(longest, known), 1), term.since + 1, term.known_from + 1)


def is_violated(terms: list[Term], of: Hypothesis, history: History) -> bool:
    """Whether the data are beyond what the hypothesis allows, by more than rounding."""
    value, limit = sides(terms, of, history)
    return value - limit > _LEAST * max(abs(limit), abs(value))


def written(terms: list[Term], of: Hypothesis, history: History) -> Document:
    """The inequality with every number it takes, and none that decides nothing."""
    theta = ("constant while it shows" if of.shown else "constant") if of.constant else "any"
    said = [_term(term, of, history) for term in terms]
    slope = sum(one["weight"] * one.pop("slope") for one in said)
    value, limit = (sum(one["weight"] * one.pop(side) for one in said) for side in ("value", "limit"))
    decides = [one.pop("decides") for one in said]
    most = max(of.low * slope, of.high * slope) if of.constant and abs(slope) > _LEAST_SLOPE else 0.0
    ends = {"least": of.low, "most": of.high}
    if of.constant:
        looked_at = {"least": most and slope < 0.0, "most": most and slope > 0.0}
        if abs(slope) > _LEAST_SLOPE and not most:  # a fault of this size does nothing
            for one in said:
                one.pop("Z", None)
    else:
        looked_at = {end: any(each[end] for each in decides) for end in ends}
    return {
        "theta": theta,
        **{end: number for end, number in ends.items() if looked_at[end]},
        "terms": said,
        "sides": [value, limit + most],
    }


def _term(term: Term, of: Hypothesis, history: History) -> Document:
    """A term: filter, direction, what the fault can have done to it before, its frames; and what they add up
    to: value, limit, slope; and which end of theta `decides`, in any frame."""
    first = _first(term, of, history.dt)
    value, limit, slope, fault = measure(term, of, history, first)
    rows, here = slice(first, term.frame + 1), slice(first - of.first, term.frame + 1 - of.first)
    d, filters = term.direction, not isinf(term.pole_per_s)
    h, Z, r = of.offset[here] @ d, of.slope[here] @ d, of.spread[here] @ np.abs(d)
    rest = history.rest(rows)
    rest[np.abs(rest) < _ROUNDING * history.eta_bar[rows]] = 0.0
    low, high = h + of.low * Z, h + of.high * Z
    adds = np.ones(len(h), bool) if of.constant else np.maximum(low, high) > _LEAST_EFFECT
    rounding = np.where(adds, 0.0, _most(low, high))
    limit -= float(history.dt * _weights(term.decay(history.dt), len(h)) @ rounding)
    said: Document = {"weight": term.weight, "d": d.tolist()}
    if filters:
        said |= {"pole_per_s": term.pole_per_s, "since": term.since}
    said |= {"first": first, "frame": term.frame}
    if filters and fault:
        said["fault"] = fault
    said |= {name: values[rows].tolist() for name, values in
             (("x", history.x), ("F", history.model), ("eta_bar", history.eta_bar))}  # fmt: skip
    if rest.any():
        said["rest"] = rest.tolist()
    for name, values in (("h", h), ("Z", Z)):
        if (values * adds).any():
            said[name] = [float(v) if there else None for v, there in zip(values, adds, strict=True)]
    if r.any():
        said["r"] = r.tolist()
    decides = {"least": bool((adds & (low > high)).any()), "most": bool((adds & (high > low)).any())}
    return said | {"value": value, "limit": limit, "slope": slope, "decides": decides}


def directions(asked: tuple[int, ...]) -> Iterator[np.ndarray]:
    """Both ways along each axis."""
    for i in asked:
        for sign in (1.0, -1.0):
            d = np.zeros(3)
            d[i] = sign
            yield d


def of_one_frame(k: int, of: Hypothesis) -> Iterator[list[Term]]:
    """The tests of a frame by itself: each axis; two of them such that theta drops out."""
    for d in directions(of.asked):
        yield [Term(d, inf, k - 1, k)]
    Z = of.slope[k - of.first]
    for i in of.asked:
        for j in of.asked:
            if i < j and (Z[i] or Z[j]):
                d = np.zeros(3)
                d[i], d[j] = Z[j], -Z[i]
                d /= np.abs(d).max()
                yield [Term(d, inf, k - 1, k)]
                yield [Term(-d, inf, k - 1, k)]


def by_each_frame(
    of: Hypothesis, history: History, frames: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """What each frame and axis says of a constant theta: at least, at most, and Z; (frames, 3) from the first
    to the last of `frames`, unlimited where not asked."""
    rows = slice(int(frames[0]), int(frames[-1]) + 1)
    asked = np.zeros((rows.stop - rows.start, 3), bool)
    asked[np.ix_(frames - rows.start, np.array(of.asked))] = True
    here = slice(rows.start - of.first, rows.stop - of.first)
    Z, room = of.slope[here], history.frame_bound(rows) + of.spread[here]
    value = history.innovation(rows) - of.offset[here]
    asked &= Z != 0.0
    size = np.where(asked, np.abs(Z), 1.0)
    middle = value * np.sign(Z) / size
    least = np.where(asked, middle - room / size, -inf)
    most = np.where(asked, middle + room / size, inf)
    return least, most, np.where(asked, Z, 1.0)


def constant_pair(of: Hypothesis, history: History, frames: np.ndarray) -> list[Term]:
    """Two frames that no one theta explains, or one that none in its set does; empty if there are none.

    frames: those that may be asked.
    """
    if not len(frames):
        return []
    least, most, Z = by_each_frame(of, history, frames)
    low, high = np.unravel_index(np.argmax(least), least.shape), np.unravel_index(np.argmin(most), most.shape)
    terms, first = [], int(frames[0])
    if least[low] > of.low:
        terms.append(_one_sided(low, 1.0, Z, first, history.dt))
    if most[high] < of.high:
        terms.append(_one_sided(high, -1.0, Z, first, history.dt))
    return terms


def _one_sided(place: tuple[Any, ...], sign: float, Z: np.ndarray, first: int, dt: float) -> Term:
    """The term that bounds theta from one side by one frame on one axis."""
    k, d = first + int(place[0]), np.zeros(3)
    d[place[1]] = sign * np.sign(Z[place])
    return Term(d, inf, k - 1, k, weight=1.0 / (dt * abs(float(Z[place]))))
