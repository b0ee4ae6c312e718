"""Fit an angle to the rates: the integrals of p, q and r are the changes of roll, pitch and yaw.

    phi' = p + tan(theta) (q sin(phi) + r cos(phi))        [SL03, eq. 1.4-4]
    theta' = q cos(phi) - r sin(phi)
    psi' = (q sin(phi) + r cos(phi)) / cos(theta)

t (n,) s are the stamps of the rates; p, q, r (n,) and the angles have the unit of the log; phi and theta (n,)
are in rad. gyros: the columns of p, q and r. axis: 0, 1 and 2 are p with roll, q with pitch and r with yaw.
`unit_mistakes` judges the fits.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from beaver_ftc_logs.recording import Column, Floats, Mask, largest_magnitude

_ANGLE_WINDOW_S = 1.0  # the change of an angle is compared with the integral of its rate in windows of 1 s
_MIN_WINDOWS = 8  # with fewer windows, angle and rate are not compared
# The directions of level and north turn with the Earth, by 7.3e-5 rad/s, and with the motion over it, by
# 4.7e-5 rad/s at 300 m/s. A change of an angle must be far above these to test a rate.
_MIN_RMS_RAD_S = 1e-3
CIRCLE_SLACK = 1.02  # an angle exceeds its full circle by 2 % at most, by rounding and filters
_STEEP_PITCH_RAD = 1.0  # above it roll and yaw are hard to distinguish


@dataclass(frozen=True)
class AngleFit:
    """How one of roll, pitch and yaw follows its rate. slope: change of the angle over the integral of the
    rate, in the units of the log; correlation of the two."""

    slope: float
    correlation: float


def fit_angle(gyros: Sequence[Column], angles: Sequence[Column | None], axis: int) -> AngleFit | None:
    """Fit the angle of an axis to the rates; None if too little moves, if fewer than _MIN_WINDOWS windows
    remain, or if this angle or roll is not known.

    Rates and angles are in the units of the log, all rates in one unit. Without a pitch angle, theta is 0.
    Where the nose is steep, roll and yaw are hard to distinguish: such windows are left out for both.
    """
    t = gyros[0].t_s
    if angles[0] is None or angles[axis] is None:
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
    return AngleFit(slope * circle / (2.0 * np.pi), correlation)


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
    circle = next((circle for circle in (2.0 * np.pi, 360.0) if largest <= CIRCLE_SLACK * circle), 36000.0)
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
