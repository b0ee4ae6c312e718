"""What mechanics says of a log's units: the integral of p is the change of roll, and the mean of the specific
force is 1 g.

    phi' = p + tan(theta) (q sin(phi) + r cos(phi))        [SL03, eq. 1.4-4]
"""

from dataclasses import dataclass

import numpy as np

from beaver_ftc.flights.recording import Column, Floats
from beaver_ftc.flights.units import ACCELERATION, ANGLE, RATE, UNITS, nearest_unit

_WINDOW_S, _LEAST_WINDOWS = 1.0, 20
_SURE, _APART = 0.7, 1.5
_NEAR, _APART_FROM = 1.3, 0.4
_G = UNITS["g"][1]
_GRAVITY = (0.5, 2.0)


@dataclass(frozen=True)
class Roll:
    """slope: change of roll over the integral of p; correlation of the two; windows: how many were seen."""

    slope: float
    correlation: float
    windows: int


def roll_of(rates: list[Column], roll: Column, pitch: Column | None) -> Roll | None:
    """How the roll angle follows the rates; None where too little moves. All of them as the log says, in SI.

    rates: p, q, r.
    """
    t_s = rates[0].t_s
    p, q, r = (_at(column, t_s) for column in rates)
    phi, full = _at(roll, t_s), _turn(roll.values)
    angle = phi * 2.0 * np.pi / full  # the circle is known whatever the unit
    rate = p
    if pitch is not None:
        theta = _at(pitch, t_s) * 2.0 * np.pi / _turn(np.append(4.0 * pitch.values, roll.values))
        rate = p + np.tan(np.clip(theta, -1.0, 1.0)) * (q * np.sin(angle) + r * np.cos(angle))
    step = np.diff(t_s)
    integral = np.concatenate([[0.0], np.cumsum(np.where(step < _WINDOW_S, step, 0.0) * _mean(rate))])
    length = max(round(_WINDOW_S / max(float(np.median(step)), 1e-9)), 1)
    begin, end = np.arange(0, len(t_s) - length, length), np.arange(length, len(t_s), length)
    whole = (t_s[end] - t_s[begin]) < 2.0 * _WINDOW_S
    turned, moved = (phi[end] - phi[begin])[whole], (integral[end] - integral[begin])[whole]
    turned = (turned + 0.5 * full) % full - 0.5 * full
    known = np.isfinite(turned) & np.isfinite(moved)
    return _slope(moved[known], turned[known])


def _slope(moved: Floats, turned: Floats) -> Roll | None:
    power, answer = float(moved @ moved), float(turned @ turned)
    if len(moved) < _LEAST_WINDOWS or not power * answer > 0.0:
        return None
    cross = float(moved @ turned)
    return Roll(np.sign(cross) * np.sqrt(answer / power), cross / np.sqrt(power * answer), len(moved))


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


def roll_says(rates: dict[str, Column], roll: Column, pitch: Column | None, name: str) -> str | None:
    """What is wrong with the rates (p, q, r by column) or the roll angle `name`; None where nothing is."""
    (p, *others), columns = list(rates), list(rates.values())
    found = roll_of(columns, roll, pitch)
    if found is None or abs(found.correlation) >= _APART_FROM:
        return None if found is None else roll_remark(found, p, name)
    for other in others:
        moved = roll_of([rates[other], *(one for one in columns if one is not rates[other])], roll, None)
        if moved is not None and abs(moved.correlation) > _SURE:
            return (
                f"{name} does not follow {p} (correlation {found.correlation:.2f}) but {other} "
                f"({moved.correlation:.2f}): {other} is the roll rate"
            )
    return None


def roll_remark(found: Roll, rate: str, roll: str) -> str | None:
    """What is wrong with p or roll by their proportion, and which factor fits; None where nothing is.

    rate, roll: their columns.
    """
    size = abs(found.slope)
    near = 1.0 / _APART < size < _APART
    if abs(found.correlation) < _SURE or (near and found.slope > 0.0):
        return None
    fits = f"the change of {roll} is {found.slope:.4g} times the integral of {rate}"
    if near:
        return f"{fits}: one of them has the other sign, `scale: -1` fits"
    if size > 1.0 and (unit := nearest_unit(ANGLE, 1.0 / size, _NEAR)):
        return f"{fits}: {roll} is in {unit}, a factor of {UNITS[unit][1]:.4g} fits"
    if size < 1.0 and (unit := nearest_unit(RATE, size, _NEAR)):
        return f"{fits}: {rate} is in {unit}, a factor of {UNITS[unit][1]:.4g} fits"
    return f"{fits}: a factor of {size:.4g} on {rate} fits"


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
