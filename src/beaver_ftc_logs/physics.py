"""Checks of a log's units by mechanics: the integrals of p, q and r are the changes of roll, pitch and yaw,
and the mean of the specific force is 1 g.

    phi' = p + tan(theta) (q sin(phi) + r cos(phi))        [SL03, eq. 1.4-4]
    theta' = q cos(phi) - r sin(phi)
    psi' = (q sin(phi) + r cos(phi)) / cos(theta)

t (n,) s are the stamps of the rates; p, q, r (n,) and the angles have the unit of the log; phi and theta (n,)
are in rad. gyros: the columns of p, q and r.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from beaver_ftc_logs.recording import Column, Columns, Floats, largest_magnitude
from beaver_ftc_logs.units import ACCELERATION, ANGLE, RATE, SI_UNITS, UNIT_FACTORS, nearest_unit

_ANGLE_WINDOW_S, _MIN_WINDOWS = 1.0, 8
_EXCHANGED, _AGREEING, _CLOSE, _EXACT = 0.2, 0.7, 0.95, 0.99
_SLOPE_FACTOR, _UNIT_RATIO = 1.8, 1.3
_MIN_RMS_RAD_S = 1e-3
"""Level and north turn with the earth, by 7.3e-5 rad/s, and with the way over it, by 4.7e-5 rad/s at 300 m/s.
A change of an angle that is not far above them says nothing of a rate."""
_GRAVITY_MPS2 = SI_UNITS["g"][1]
_GRAVITIES_G = (0.5, 2.0)
_MAX_ANGLE_RAD, _FAST_RAD_S = 1.02 * 2.0 * np.pi, 12.0
_MAX_PITCH_RAD, _STEEP_PITCH_RAD = 1.02 * 0.5 * np.pi, 1.0


@dataclass(frozen=True)
class AngleFit:
    """slope: change of an angle over the integral of its rate; correlation of the two; max_angle_magnitude,
    max_rate_magnitude: as the log says."""

    slope: float
    correlation: float
    max_angle_magnitude: float
    max_rate_magnitude: float


def fit_angle(gyros: Sequence[Column], angles: Sequence[Column | None], axis: int) -> AngleFit | None:
    """How one of roll, pitch and yaw follows the rates, all as the log says, the rates in one unit; None
    where too little moves, or this angle or roll is not known.

    Not where the nose is so steep that roll and yaw are hard to distinguish.
    """
    roll, pitch, _ = angles
    angle, t = angles[axis], gyros[0].t_s
    if roll is None or angle is None:
        return None
    p, q, r = (_interpolate(gyro, t) for gyro in gyros)
    # The circle is known whatever the unit.
    phi = _interpolate(roll, t) * 2.0 * np.pi / _full_circle(roll.values)
    theta = np.zeros(len(t))
    if pitch is not None:
        circle = _full_circle(np.append(4.0 * pitch.values, roll.values))
        theta = _interpolate(pitch, t) * 2.0 * np.pi / circle
    turn = [q * np.sin(phi), r * np.cos(phi)]
    if axis == 1:
        return _fit_angle(t, _interpolate(angle, t), [q * np.cos(phi), -r * np.sin(phi)])
    if axis == 0:
        terms = [p, *(np.tan(theta) * part for part in turn)]
    else:
        terms = [(turn[0] + turn[1]) / np.cos(theta)]
    return _fit_angle(t, _interpolate(angle, t), terms, _full_circle(angle.values), theta)


def _fit_angle(
    t: Floats, angle: Floats, terms: list[Floats], circle: float | None = None, theta: Floats | None = None
) -> AngleFit | None:
    """How an angle follows the first term of its rate of change, the others in whatever unit they are.

        y = X beta + error,   y = angle(b) - angle(a),   X = S(b) - S(a),   S: integral of the terms

    y (w,), X (w, m): changes from the begin a to the end b of w windows. circle: a circle, where the angle
    may go round. theta: windows in which the pitch angle is steep say nothing.
    """
    h = np.diff(t)
    means = [np.nan_to_num(0.5 * (term[1:] + term[:-1])) for term in terms]
    S = np.cumsum(np.where(h < _ANGLE_WINDOW_S, h, 0.0) * means, axis=1).T
    S = np.vstack([np.zeros(len(terms)), S])
    n = max(round(_ANGLE_WINDOW_S / max(float(np.median(h)), 1e-9)), 1)
    a = np.arange(0, len(t) - n, n)
    b = a + n
    ok = (t[b] - t[a]) < 2.0 * _ANGLE_WINDOW_S
    if theta is not None:
        steep = np.cumsum(np.abs(theta) > _STEEP_PITCH_RAD)
        ok &= steep[b] == steep[a]
    y = (angle[b] - angle[a])[ok]
    X = (S[b] - S[a])[ok]
    if circle is not None:
        y = (y + 0.5 * circle) % circle - 0.5 * circle
    known = np.isfinite(y) & np.isfinite(X).all(axis=1)
    y, X = y[known], X[known]
    if len(y) < _MIN_WINDOWS or y @ y < len(y) * (_MIN_RMS_RAD_S * _ANGLE_WINDOW_S) ** 2:
        return None
    beta = np.linalg.lstsq(X, y, rcond=None)[0]
    y = y - X[:, 1:] @ beta[1:]
    x = X[:, 0]
    xx, xy, yy = float(x @ x), float(x @ y), float(y @ y)
    if not xx * yy > 0.0:
        return None
    return AngleFit(
        slope=np.sign(xy) * np.sqrt(yy / xx),
        correlation=xy / np.sqrt(xx * yy),
        max_angle_magnitude=largest_magnitude(angle),
        max_rate_magnitude=largest_magnitude(terms[0]),
    )


def _interpolate(column: Column, t: Floats) -> Floats:
    if np.array_equal(column.t_s, t):
        return column.values
    known = np.isfinite(column.values)
    if not known.any():
        return np.full(len(t), np.nan)
    return np.interp(t, column.t_s[known], column.values[known], left=np.nan, right=np.nan)


def _full_circle(angle: Floats) -> float:
    """A full circle in the unit that the angles seem to have: the least of rad, deg and cdeg that fits."""
    largest = largest_magnitude(angle)
    return next((circle for circle in (2.0 * np.pi, 360.0) if largest <= 1.02 * circle), 36000.0)


NamedColumn = tuple[str, Column]
_RATE_TITLES = ("roll rate", "pitch rate", "yaw rate")


def attitude_mistake(named: Columns, angles: Sequence[NamedColumn | None], others: Columns) -> str | None:
    """Describe a mistake in the rates (p, q, r by column) or the angles: roll, pitch and yaw, None where one
    is not known. The first that is wrong; None where nothing is. others: what may have taken the place of a
    rate."""
    for axis, (rate, angle) in enumerate(zip(named, angles, strict=True)):
        if angle is None:
            continue
        if axis == 1 and (remark := _pitch_remark(*angle)):
            return remark
        fit = _fit_with(named, angles, axis, named[rate])
        if fit is None:
            continue
        for name, column in {**named, **others}.items():
            trial = _fit_with(named, angles, axis, column)
            if trial is not None and abs(trial.correlation) > _replacing_correlation(fit, name in named):
                return (
                    f"{angle[0]} does not follow {rate} (correlation {fit.correlation:.2f}) "
                    f"but {name} ({trial.correlation:.2f}): {name} is the {_RATE_TITLES[axis]}"
                )
        if remark := _factor_remark(fit, rate, angle[0]):
            return remark
        # in a banked flight a yaw rate in another unit does not even correlate with the angle: q turns it too
        for factor in UNIT_FACTORS if abs(fit.correlation) < _AGREEING else ():
            scaled = replace(named[rate], values=factor * named[rate].values)
            if _is_exact(_fit_with(named, angles, axis, scaled)):
                return (
                    f"the {_RATE_TITLES[axis]} {rate} does not make the change of its angle "
                    f"(correlation {fit.correlation:.2f}): a factor of {factor:.4g} on {rate} fits"
                )
    return None


def _fit_with(
    named: Columns, angles: Sequence[NamedColumn | None], axis: int, rate: Column
) -> AngleFit | None:
    """How the angle of a place follows the rates with this one in its place."""
    gyros = [rate if i == axis else gyro for i, gyro in enumerate(named.values())]
    return fit_angle(gyros, [angle and angle[1] for angle in angles], axis)


def confirmed_rates(named: Columns, angles: Sequence[NamedColumn | None]) -> frozenset[str]:
    """The columns of p, q and r whose integral is the change of roll, pitch and yaw, in sign and unit too."""
    places = enumerate(named.items())
    return frozenset(n for axis, (n, rate) in places if _is_exact(_fit_with(named, angles, axis, rate)))


def _is_exact(fit: AngleFit | None) -> bool:
    return fit is not None and fit.correlation > _EXACT and 1.0 / _UNIT_RATIO < fit.slope < _UNIT_RATIO


def _replacing_correlation(fit: AngleFit, is_rate: bool) -> float:
    """How well another column has to agree with an angle to be its rate, where the one named agrees so."""
    corr = abs(fit.correlation)
    if is_rate and corr < _EXCHANGED:
        return _AGREEING
    return _CLOSE if corr < _AGREEING else _EXACT if corr < _CLOSE else np.inf


def _factor_remark(fit: AngleFit, rate: str, angle: str) -> str | None:
    """Describe a mistake in a rate or its angle by their proportion, and which factor fits; None where
    nothing is. rate, angle: their columns.

    Either may be; an angle that goes round more than once is, and a rate that no vehicle turns at.
    """
    slope = abs(fit.slope)
    near = 1.0 / _SLOPE_FACTOR < slope < _SLOPE_FACTOR
    if abs(fit.correlation) < _AGREEING or (near and fit.slope > 0.0):
        return None
    ratio = f"the change of {angle} is {fit.slope:.4g} times the integral of {rate}"
    if near:
        return f"{ratio}: one of them has the other sign, `scale: -1` fits"
    if fit.max_angle_magnitude > _MAX_ANGLE_RAD and (unit := nearest_unit(ANGLE, 1.0 / slope, _UNIT_RATIO)):
        return f"{ratio}: {angle} is in {unit}, a factor of {SI_UNITS[unit][1]:.4g} fits"
    if fit.max_rate_magnitude > _FAST_RAD_S and (unit := nearest_unit(RATE, slope, _UNIT_RATIO)):
        return f"{ratio}: {rate} is in {unit}, a factor of {SI_UNITS[unit][1]:.4g} fits"
    return f"{ratio}: a factor of {slope:.4g} on {rate} fits, or of {1.0 / slope:.4g} on {angle}"


def _pitch_remark(name: str, pitch: Column) -> str | None:
    """Describe a mistake in a pitch angle by its size, and which unit fits; None where nothing is: it says
    what no comparison can, where rates and angles are scaled alike."""
    largest = largest_magnitude(pitch.values)
    if largest <= _MAX_PITCH_RAD:
        return None
    unit = next((u for u in ("deg", "cdeg") if largest * SI_UNITS[u][1] <= _MAX_PITCH_RAD), None)
    hint = f"it is in {unit}, a factor of {SI_UNITS[unit][1]:.4g} fits" if unit else "no unit fits"
    return f"{name} reaches {largest:.4g} rad, a pitch angle at most 1.571: {hint}; look at the rates' too"


def gravity_remark(az: Column, name: str) -> str | None:
    """Describe a mistake in the acceleration along z by its mean, and which unit fits; None where nothing
    is."""
    known = az.values[np.isfinite(az.values)]
    g = float(np.median(np.abs(known))) if known.size else 0.0
    if _GRAVITIES_G[0] < g / _GRAVITY_MPS2 < _GRAVITIES_G[1]:
        return None
    unit = nearest_unit(ACCELERATION, _GRAVITY_MPS2 / g, 2.0) if g > 0.0 else None
    hint = (
        f"it is in {unit}, a factor of {SI_UNITS[unit][1]:.4g} fits"
        if unit
        else "no unit fits: is 1 g in it?"
    )
    return f"{name}: is {g:.4g} m/s2 on the middle of the flight, 1 g is {_GRAVITY_MPS2:.4g}: {hint}"
