"""Checks of a log's units by mechanics: the integrals of p, q and r are the changes of roll, pitch and yaw,
and the median magnitude of the acceleration along z is 1 g.

    phi' = p + tan(theta) (q sin(phi) + r cos(phi))        [SL03, eq. 1.4-4]
    theta' = q cos(phi) - r sin(phi)
    psi' = (q sin(phi) + r cos(phi)) / cos(theta)

t (n,) s are the stamps of the rates; p, q, r (n,) and the angles have the unit of the log; phi and theta (n,)
are in rad. gyros: the columns of p, q and r. axis: 0, 1 and 2 are p with roll, q with pitch and r with yaw.
named: the columns of p, q and r by name, in this order.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import chain

import numpy as np

from beaver_ftc_logs.recording import Column, Columns, Floats, Mask, largest_magnitude
from beaver_ftc_logs.units import ACCELERATION, ANGLE, RATE, SI_UNITS, UNIT_FACTORS, nearest_unit

_ANGLE_WINDOW_S = 1.0  # the change of an angle is compared with the integral of its rate in windows of 1 s
_MIN_WINDOWS = 8  # with fewer windows, angle and rate are not compared
# Magnitudes of the correlation of an angle's change with the integral of a rate:
_EXCHANGED = 0.2  # below this the rate is that of another axis
_AGREEING = 0.7  # above this the two belong together, whatever the unit of the rate
# From _AGREEING to this, another column replaces the rate only if its correlation is above _EXACT
_CLOSE = 0.95
_EXACT = 0.99  # above this the angle confirms the rate, if the slope is within _UNIT_RATIO of 1
# Slopes between its inverse and itself show no other unit: no two units differ by so little
_SLOPE_FACTOR = 1.8
_UNIT_RATIO = 1.3  # the most by which a slope differs from the factor of a unit that fits
# The directions of level and north turn with the Earth, by 7.3e-5 rad/s, and with the motion over it, by
# 4.7e-5 rad/s at 300 m/s. A change of an angle must be far above these to test a rate.
_MIN_RMS_RAD_S = 1e-3
_GRAVITY_MPS2 = SI_UNITS["g"][1]
_GRAVITIES_G = (0.5, 2.0)  # a column whose median magnitude along z is between these is in m/s2
_CIRCLE_SLACK = 1.02  # an angle exceeds its full circle by 2 % at most, by rounding and filters
_MAX_ANGLE_RAD = _CIRCLE_SLACK * 2.0 * np.pi
_MAX_PITCH_RAD = _CIRCLE_SLACK * 0.5 * np.pi  # a quarter of the circle
FAST_RAD_S = 12.0  # no vehicle turns so fast, though a spike of its gyro may be larger
_STEEP_PITCH_RAD = 1.0  # above it roll and yaw are hard to distinguish


@dataclass(frozen=True)
class AngleFit:
    """How one of roll, pitch and yaw follows its rate. slope: change of the angle over the integral of the
    rate; correlation of the two; max_angle_magnitude, max_rate_magnitude: largest of each, in the unit of the
    log."""

    slope: float
    correlation: float
    max_angle_magnitude: float
    max_rate_magnitude: float


def fit_angle(gyros: Sequence[Column], angles: Sequence[Column | None], axis: int) -> AngleFit | None:
    """Fit the angle of an axis to the rates; None if too little moves, if fewer than _MIN_WINDOWS windows
    remain, or if this angle or roll is not known.

    Rates and angles are in the units of the log, all rates in one unit. Without a pitch angle, theta is 0.
    Where the nose is steep, roll and yaw are hard to distinguish: such windows are left out for both.
    """
    angle = angles[axis]
    t = gyros[0].t_s
    if angles[0] is None or angle is None:
        return None
    rates = [_interpolate(gyro, t) for gyro in gyros]
    phi, _ = _angle_in_rad(angles, 0, t)
    theta, _ = _angle_in_rad(angles, 1, t)
    eta, circle = _angle_in_rad(angles, axis, t)
    is_steep = (axis != 1) & (np.abs(theta) > _STEEP_PITCH_RAD)
    fit = _fit_first_term(*_changes_by_window(t, eta, _terms_of_change(rates, phi, theta, axis), is_steep))
    if fit is None:
        return None
    slope, correlation = fit
    slope = slope * circle / (2.0 * np.pi)
    return AngleFit(slope, correlation, largest_magnitude(angle.values), largest_magnitude(rates[axis]))


def _angle_in_rad(angles: Sequence[Column | None], axis: int, t: Floats) -> tuple[Floats, float]:
    """The angle of an axis at the stamps t (n,), rad, 0 if it is not known; and a full circle in the unit of
    the log: the first of rad, deg and cdeg whose circle holds all of the angle.

    Pitch goes up to a quarter of the circle only, and is in the unit of roll if that is larger.
    """
    angle = angles[axis]
    if angle is None:
        return np.zeros(len(t)), 2.0 * np.pi
    largest = largest_magnitude(angle.values)
    if axis == 1 and angles[0] is not None:
        largest = max(4.0 * largest, largest_magnitude(angles[0].values))
    circle = next((circle for circle in (2.0 * np.pi, 360.0) if largest <= _CIRCLE_SLACK * circle), 36000.0)
    return _interpolate(angle, t, circle) * 2.0 * np.pi / circle, circle


def _terms_of_change(rates: list[Floats], phi: Floats, theta: Floats, axis: int) -> list[Floats]:
    """The terms (n,) whose sum is the rate of change of an angle (equations above), that of its own rate
    first; for yaw the two terms are summed."""
    p, q, r = rates
    if axis == 1:
        return [q * np.cos(phi), -r * np.sin(phi)]
    turn = np.array([q * np.sin(phi), r * np.cos(phi)])
    return [p, *np.tan(theta) * turn] if axis == 0 else [turn.sum(axis=0) / np.cos(theta)]


def _changes_by_window(
    t: Floats, angle: Floats, terms: list[Floats], is_steep: Mask
) -> tuple[Floats, Floats]:
    """Changes of an angle within half a circle, y (w,) rad, and of the integrals S of m terms, X (w, m), in w
    windows from a to b:

        y = angle(b) - angle(a),   X = S(b) - S(a)

    A window with a gap, with a steep row (n,), or without a number of the angle at an end, is left out; a
    rate without a number counts as 0.
    """
    h = np.diff(t)
    means = [np.nan_to_num(0.5 * (term[1:] + term[:-1])) for term in terms]
    S = np.cumsum(np.where(h < _ANGLE_WINDOW_S, h, 0.0) * means, axis=1).T
    S = np.vstack([np.zeros(len(terms)), S])
    n = max(round(_ANGLE_WINDOW_S / max(float(np.median(h)), 1e-9)), 1)
    a = np.arange(0, len(t) - n, n)
    b = a + n
    y = (angle[b] - angle[a] + np.pi) % (2.0 * np.pi) - np.pi
    X = S[b] - S[a]
    steep = np.cumsum(is_steep)
    ok = (t[b] - t[a] < 2.0 * _ANGLE_WINDOW_S) & np.isfinite(y) & np.isfinite(X).all(axis=1)
    ok &= steep[b] == steep[a]
    return y[ok], X[ok]


def _fit_first_term(y: Floats, X: Floats) -> tuple[float, float] | None:
    """Slope and correlation of y (w,) with the first column of X (w, m); None if too little moves, or if w is
    less than _MIN_WINDOWS:

        y = X beta + error,   v = y - X[:, 1:] beta[1:],   x = X[:, 0]
        slope = sign(x' v) sqrt(v' v / x' x),   correlation = x' v / sqrt(x' x v' v)

    The other columns of X may have any unit. The slope is a ratio of sizes and not x' v / x' x, because noise
    in the rate makes x' v / x' x smaller than the true slope.
    """
    if len(y) < _MIN_WINDOWS or y @ y < len(y) * (_MIN_RMS_RAD_S * _ANGLE_WINDOW_S) ** 2:
        return None
    beta = np.linalg.lstsq(X, y, rcond=None)[0]
    v = y - X[:, 1:] @ beta[1:]
    x = X[:, 0]
    xx = float(x @ x)
    xv = float(x @ v)
    vv = float(v @ v)
    if not xx * vv > 0.0:
        return None
    return np.sign(xv) * np.sqrt(vv / xx), xv / np.sqrt(xx * vv)


def _interpolate(column: Column, t: Floats, circle: float | None = None) -> Floats:
    """The numbers of a column at the stamps t (n,) s, nan before its first and after its last.

    circle: a full circle in the unit of an angle that may go round: a step of more than half of it is a
    passage through its end.
    """
    if np.array_equal(column.t_s, t):
        return column.values
    known = np.isfinite(column.values)
    if not known.any():
        return np.full(len(t), np.nan)
    values = column.values[known]
    if circle is not None:
        values = np.unwrap(values, period=circle)
    return np.interp(t, column.t_s[known], values, left=np.nan, right=np.nan)


# The name of a column, and the column.
NamedColumn = tuple[str, Column]
# Words for the rate of each axis.
_RATE_TITLES = ("roll rate", "pitch rate", "yaw rate")


def attitude_mistake(named: Columns, angles: Sequence[NamedColumn | None], others: Columns) -> str | None:
    """Text of the first mistake in the rates or the angles of roll, pitch and yaw; None if there is none.

    angles: None where one is not known. others: columns that may have been exchanged with a rate.
    """
    axes = range(len(_RATE_TITLES))
    return next(chain.from_iterable(_mistakes_of_axis(named, angles, others, axis) for axis in axes), None)


def _mistakes_of_axis(
    named: Columns, angles: Sequence[NamedColumn | None], others: Columns, axis: int
) -> Iterator[str]:
    """Yield the texts of mistakes in one rate and its angle, the surest first:

    1. the size of a pitch angle, 2. another column follows the angle, 3. the slope, 4. another unit of the
    rate.
    """
    angle = angles[axis]
    rate = [*named][axis]
    if angle is None:
        return
    if axis == 1 and (remark := _pitch_remark(*angle)):
        yield remark
    fit = _fit_with(named, angles, axis, named[rate])
    if fit is None:
        return
    for name, column in (named | others).items():
        trial = _fit_with(named, angles, axis, column)
        if trial is not None and abs(trial.correlation) > _replacing_correlation(fit, name in named):
            yield (
                f"{angle[0]} does not follow {rate} (correlation {fit.correlation:.2f}) "
                f"but {name} ({trial.correlation:.2f}): {name} is the {_RATE_TITLES[axis]}"
            )
    if remark := _factor_remark(fit, rate, angle[0]):
        yield remark
    if abs(fit.correlation) < _AGREEING:
        # In a banked flight, q turns the yaw angle too, so a yaw rate in another unit need not correlate with
        # it.
        for factor in UNIT_FACTORS:
            scaled = replace(named[rate], values=factor * named[rate].values)
            if _is_exact(_fit_with(named, angles, axis, scaled)):
                yield (
                    f"the {_RATE_TITLES[axis]} {rate} does not make the change of its angle "
                    f"(correlation {fit.correlation:.2f}): a factor of {factor:.4g} on {rate} fits"
                )


def _fit_with(
    named: Columns, angles: Sequence[NamedColumn | None], axis: int, rate: Column
) -> AngleFit | None:
    """Fit of the angle of an axis to the rates, with the column `rate` as the rate of this axis."""
    gyros = [rate if i == axis else gyro for i, gyro in enumerate(named.values())]
    return fit_angle(gyros, [angle and angle[1] for angle in angles], axis)


def confirmed_rates(named: Columns, angles: Sequence[NamedColumn | None]) -> frozenset[str]:
    """The columns of p, q and r whose integral is the change of roll, pitch and yaw, in sign and unit too."""
    axes = enumerate(named.items())
    return frozenset(name for axis, (name, rate) in axes if _is_exact(_fit_with(named, angles, axis, rate)))


def _is_exact(fit: AngleFit | None) -> bool:
    """Whether the angle confirms the rate, in sign and unit too."""
    return fit is not None and fit.correlation > _EXACT and 1.0 / _UNIT_RATIO < fit.slope < _UNIT_RATIO


def _replacing_correlation(fit: AngleFit, is_rate: bool) -> float:
    """Correlation above which another column, rather than the named one, is the rate of an angle.

        correlation of the named rate        another column is the rate above
        below _EXCHANGED                     _AGREEING if it is a named rate, otherwise _CLOSE
        below _AGREEING                      _CLOSE
        below _CLOSE                         _EXACT
        otherwise                            never

    fit: of the named rate. is_rate: whether the other column is a named rate, too.
    """
    corr = abs(fit.correlation)
    if is_rate and corr < _EXCHANGED:
        return _AGREEING
    return _CLOSE if corr < _AGREEING else _EXACT if corr < _CLOSE else np.inf


def _factor_remark(fit: AngleFit, rate: str, angle: str) -> str | None:
    """Text of a mistake in a rate or its angle by the slope, with the factor that fits; None if there is
    none. rate, angle: names of their columns.

    A slope near -1 is a wrong sign. Otherwise either may be wrong: the angle if it exceeds a full circle;
    else the rate if no vehicle turns so fast; else the text offers both. There is no text if they hardly
    correlate.
    """
    slope = abs(fit.slope)
    is_near_one = 1.0 / _SLOPE_FACTOR < slope < _SLOPE_FACTOR
    if abs(fit.correlation) < _AGREEING or (is_near_one and fit.slope > 0.0):
        return None
    ratio = f"the change of {angle} is {fit.slope:.4g} times the integral of {rate}"
    if is_near_one:
        return f"{ratio}: one of them has the other sign, `scale: -1` fits"
    if fit.max_angle_magnitude > _MAX_ANGLE_RAD and (unit := nearest_unit(ANGLE, 1.0 / slope, _UNIT_RATIO)):
        return f"{ratio}: {angle} {_unit_text(unit)}"
    if fit.max_rate_magnitude > FAST_RAD_S and (unit := nearest_unit(RATE, slope, _UNIT_RATIO)):
        return f"{ratio}: {rate} {_unit_text(unit)}"
    return f"{ratio}: a factor of {slope:.4g} on {rate} fits, or of {1.0 / slope:.4g} on {angle}"


def _unit_text(unit: str) -> str:
    """Words for a column that is in this unit, with the factor to SI."""
    return f"is in {unit}, a factor of {SI_UNITS[unit][1]:.4g} fits"


def _pitch_remark(name: str, pitch: Column) -> str | None:
    """Text of a mistake in a pitch angle by its size, with the unit that fits; None if there is none. No
    comparison with rates shows this mistake if rates and angles are scaled alike."""
    largest = largest_magnitude(pitch.values)
    if largest <= _MAX_PITCH_RAD:
        return None
    unit = next((u for u in ("deg", "cdeg") if largest * SI_UNITS[u][1] <= _MAX_PITCH_RAD), None)
    hint = f"it {_unit_text(unit)}" if unit else "no unit fits"
    return f"{name} reaches {largest:.4g} rad, a pitch angle at most 1.571: {hint}; look at the rates' too"


def gravity_remark(az: Column, name: str) -> str | None:
    """Text of a mistake in the acceleration along z by its median magnitude, with the unit that fits; None if
    there is none."""
    known = az.values[np.isfinite(az.values)]
    median = float(np.median(np.abs(known))) if known.size else 0.0
    if _GRAVITIES_G[0] < median / _GRAVITY_MPS2 < _GRAVITIES_G[1]:
        return None
    unit = nearest_unit(ACCELERATION, _GRAVITY_MPS2 / median, 2.0) if median > 0.0 else None
    hint = f"it {_unit_text(unit)}" if unit else "no unit fits: is 1 g in it?"
    return f"{name}: its median magnitude is {median:.4g} m/s2, 1 g is {_GRAVITY_MPS2:.4g}: {hint}"
