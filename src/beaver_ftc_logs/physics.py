"""What mechanics says of a log's units: the integrals of p, q and r are the changes of roll, pitch and yaw,
and the mean of the specific force is 1 g.

    phi' = p + tan(theta) (q sin(phi) + r cos(phi))        [SL03, eq. 1.4-4]
    theta' = q cos(phi) - r sin(phi)
    psi' = (q sin(phi) + r cos(phi)) / cos(theta)
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from beaver_ftc_logs.recording import Column, Floats
from beaver_ftc_logs.units import ACCELERATION, ANGLE, RATE, UNITS, nearest_unit

_WINDOW_S, _LEAST_WINDOWS = 1.0, 8
_MANY_WINDOWS, _SURE, _NEAR = 20, 0.7, 1.3
_SURELY, _EXACTLY = 0.95, 0.99
_APART, _APART_OF_FEW = 1.5, 1.8
_UNLIKE, _UNLIKE_OF_FEW = 0.4, 0.2
_G = UNITS["g"][1]
_GRAVITY = (0.5, 2.0)
_CIRCLE_RAD, _FAST_RAD_S = 1.02 * 2.0 * np.pi, 12.0
_UPRIGHT_RAD, _STEEP_RAD = 1.02 * 0.5 * np.pi, 1.0


@dataclass(frozen=True)
class Followed:
    """slope: change of an angle over the integral of its rate; correlation of the two; windows: how many were
    seen; angle, rate: the largest, as the log says."""

    slope: float
    correlation: float
    windows: int
    angle: float
    rate: float

    @property
    def many(self) -> bool:
        """Whether so many windows were seen that less is needed to tell."""
        return self.windows >= _MANY_WINDOWS


def roll_of(rates: list[Column], roll: Column, pitch: Column | None) -> Followed | None:
    """How the roll angle follows the rates; None where too little moves. All of them as the log says, in SI.

    rates: p, q, r. Not where the nose is so steep that roll and yaw are hard to distinguish.
    """
    t_s = rates[0].t_s
    p, q, r = (_at(column, t_s) for column in rates)
    phi, full = _at(roll, t_s), _turn(roll.values)
    angle = phi * 2.0 * np.pi / full  # the circle is known whatever the unit
    terms, theta = [p], None
    if pitch is not None:
        theta = _pitched(roll, pitch, t_s)
        terms += [np.tan(theta) * q * np.sin(angle), np.tan(theta) * r * np.cos(angle)]
    return _followed(t_s, phi, terms, full, theta)


def pitch_of(rates: list[Column], roll: Column, pitch: Column) -> Followed | None:
    """How the pitch angle follows the rates, as `roll_of`."""
    t_s = rates[0].t_s
    _, q, r = (_at(column, t_s) for column in rates)
    angle = _at(roll, t_s) * 2.0 * np.pi / _turn(roll.values)
    return _followed(t_s, _at(pitch, t_s), [q * np.cos(angle), -r * np.sin(angle)])


def yaw_of(rates: list[Column], roll: Column, pitch: Column | None, yaw: Column) -> Followed | None:
    """How the yaw angle follows the rates, as `roll_of`: r and q in one unit, since what a turn makes of them
    is alike."""
    t_s = rates[0].t_s
    _, q, r = (_at(column, t_s) for column in rates)
    angle = _at(roll, t_s) * 2.0 * np.pi / _turn(roll.values)
    theta = np.zeros(len(t_s)) if pitch is None else _pitched(roll, pitch, t_s)
    turning = (q * np.sin(angle) + r * np.cos(angle)) / np.cos(theta)
    return _followed(t_s, _at(yaw, t_s), [turning], _turn(yaw.values), theta)


def _pitched(roll: Column, pitch: Column, t_s: Floats) -> Floats:
    """The pitch angle at given times, rad, of two angles in one unit."""
    return _at(pitch, t_s) * 2.0 * np.pi / _turn(np.append(4.0 * pitch.values, roll.values))


def _followed(
    t_s: Floats, angle: Floats, terms: list[Floats], full: float | None = None, theta: Floats | None = None
) -> Followed | None:
    """How an angle follows the first term of its rate of change, window by window, the others in whatever
    unit they are; full: a circle, where it may go round; theta: the pitch angle, where windows in which it is
    steep say nothing."""
    step = np.diff(t_s)
    gaps_out = np.where(step < _WINDOW_S, step, 0.0)
    integrals = np.vstack(
        [np.zeros(len(terms)), np.cumsum([gaps_out * _mean(one) for one in terms], axis=1).T]
    )
    length = max(round(_WINDOW_S / max(float(np.median(step)), 1e-9)), 1)
    begin, end = np.arange(0, len(t_s) - length, length), np.arange(length, len(t_s), length)
    whole = (t_s[end] - t_s[begin]) < 2.0 * _WINDOW_S
    if theta is not None:
        steep = np.cumsum(np.abs(theta) > _STEEP_RAD)
        whole &= steep[end] == steep[begin]
    turned, moved = (angle[end] - angle[begin])[whole], (integrals[end] - integrals[begin])[whole]
    if full is not None:
        turned = (turned + 0.5 * full) % full - 0.5 * full
    known = np.isfinite(turned) & np.isfinite(moved).all(axis=1)
    turned, moved = turned[known], moved[known]
    by_terms = np.linalg.lstsq(moved, turned, rcond=None)[0]
    turned, moved = turned - moved[:, 1:] @ by_terms[1:], moved[:, 0]
    power, answer = float(moved @ moved), float(turned @ turned)
    if len(moved) < _LEAST_WINDOWS or not power * answer > 0.0:
        return None
    cross = float(moved @ turned)
    return Followed(
        slope=np.sign(cross) * np.sqrt(answer / power),
        correlation=cross / np.sqrt(power * answer),
        windows=len(moved),
        angle=float(np.nanmax(np.abs(angle))),
        rate=float(np.nanmax(np.abs(terms[0]))),
    )


def _mean(values: Floats) -> Floats:
    return np.nan_to_num(0.5 * (values[1:] + values[:-1]))


def _at(column: Column, t_s: Floats) -> Floats:
    if len(column.t_s) == len(t_s) and np.array_equal(column.t_s, t_s):
        return column.values
    known = np.isfinite(column.values)
    if not known.any():
        return np.full(len(t_s), np.nan)
    return np.interp(t_s, column.t_s[known], column.values[known], left=np.nan, right=np.nan)


def _turn(roll: Floats) -> float:
    """A full circle in the unit that the angles seem to have: the least of rad, deg and cdeg that fits."""
    largest = float(np.nanmax(np.abs(roll), initial=0.0))
    return next((full for full in (2.0 * np.pi, 360.0) if largest <= 1.02 * full), 36000.0)


Named = tuple[str, Column]
_RATES = ("roll rate", "pitch rate", "yaw rate")


def attitude_says(
    rates: Mapping[str, Column], angles: Sequence[Named | None], others: Mapping[str, Column]
) -> str | None:
    """What is wrong with the rates (p, q, r by column) or the angles: roll, pitch and yaw, None where one is
    not known. The first that is wrong; None where nothing is. others: what may have taken the place of a
    rate."""
    columns = list(rates.values())
    for place, (rate, angle) in enumerate(zip(rates, angles, strict=True)):
        if angle is None:
            continue
        if place == 1 and (says := pitch_remark(angle[1], angle[0])):
            return says
        found = _follows(columns, angles, place)
        if found is None:
            continue
        for other, column in {**rates, **others}.items():
            moved = _follows([*columns[:place], column, *columns[place + 1 :]], angles, place)
            if moved is not None and abs(moved.correlation) > _asked(found, other in rates):
                return _another_is(angle[0], (rate, found), (other, moved), _RATES[place])
        if says := angle_remark(found, rate, angle[0]):
            return says
    return None


def _asked(found: Followed, is_rate: bool) -> float:
    """How well another column has to agree with an angle to be its rate, where the one named agrees so."""
    own = abs(found.correlation)
    if is_rate and own < (_UNLIKE if found.many else _UNLIKE_OF_FEW):
        return _SURE
    return _SURELY if own < _SURE else _EXACTLY if own < _SURELY else np.inf


def _follows(rates: list[Column], angles: Sequence[Named | None], place: int) -> Followed | None:
    """How the angle of a place follows the rates; None where too little moves, or it is not known."""
    (roll, pitch, yaw) = (None if one is None else one[1] for one in angles)
    if roll is None or (known := (roll, pitch, yaw)[place]) is None:
        return None
    if place == 2:
        return yaw_of(rates, roll, pitch, known)
    return pitch_of(rates, roll, known) if place else roll_of(rates, roll, pitch)


def _another_is(angle: str, of: tuple[str, Followed], by: tuple[str, Followed], rate: str) -> str:
    (own, found), (other, moved) = of, by
    return (
        f"{angle} does not follow {own} (correlation {found.correlation:.2f}) but {other} "
        f"({moved.correlation:.2f}): {other} is the {rate}"
    )


def angle_remark(found: Followed, rate: str, angle: str) -> str | None:
    """What is wrong with a rate or its angle by their proportion, and which factor fits; None where nothing
    is. rate, angle: their columns.

    Either may be; an angle that goes round more than once is, and a rate that no vehicle turns at.
    """
    size = abs(found.slope)
    apart = _APART if found.many else _APART_OF_FEW
    near = 1.0 / apart < size < apart
    if abs(found.correlation) < _SURE or (near and found.slope > 0.0):
        return None
    fits = f"the change of {angle} is {found.slope:.4g} times the integral of {rate}"
    if near:
        return f"{fits}: one of them has the other sign, `scale: -1` fits"
    if found.angle > _CIRCLE_RAD and (unit := nearest_unit(ANGLE, 1.0 / size, _NEAR)):
        return f"{fits}: {angle} is in {unit}, a factor of {UNITS[unit][1]:.4g} fits"
    if found.rate > _FAST_RAD_S and (unit := nearest_unit(RATE, size, _NEAR)):
        return f"{fits}: {rate} is in {unit}, a factor of {UNITS[unit][1]:.4g} fits"
    return f"{fits}: a factor of {size:.4g} on {rate} fits, or of {1.0 / size:.4g} on {angle}"


def pitch_remark(pitch: Column, name: str) -> str | None:
    """What is wrong with a pitch angle by its size, and which unit fits; None where nothing is: it says what
    no comparison can, where rates and angles are scaled alike."""
    largest = float(np.nanmax(np.abs(pitch.values), initial=0.0))
    if largest <= _UPRIGHT_RAD:
        return None
    unit = next((one for one in ("deg", "cdeg") if largest * UNITS[one][1] <= _UPRIGHT_RAD), None)
    fits = f"it is in {unit}, a factor of {UNITS[unit][1]:.4g} fits" if unit else "no unit fits"
    return f"{name} reaches {largest:.4g} rad, a pitch angle at most 1.571: {fits}; look at the rates' too"


def gravity_remark(acceleration: Column, name: str) -> str | None:
    """What is wrong with the acceleration along z by its mean, and which unit fits; None where nothing is."""
    values = acceleration.values[np.isfinite(acceleration.values)]
    mean = float(np.median(np.abs(values))) if values.size else 0.0
    if _GRAVITY[0] < mean / _G < _GRAVITY[1]:
        return None
    unit = nearest_unit(ACCELERATION, _G / mean, 2.0) if mean > 0.0 else None
    fits = (
        f"it is in {unit}, a factor of {UNITS[unit][1]:.4g} fits" if unit else "no unit fits: is 1 g in it?"
    )
    return f"{name}: is {mean:.4g} m/s2 on the middle of the flight, 1 g is {_G:.4g}: {fits}"
