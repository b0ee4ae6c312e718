"""Mistakes in the units of rates, angles and the acceleration of a log, found by mechanics.

The integrals of p, q and r are the changes of roll, pitch and yaw (`physics`), and the median magnitude of
the acceleration along z is 1 g. named: the columns of p, q and r by name, in this order. axis: as in
`physics`.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from beaver_ftc.aircraft import GRAVITY_MPS2
from beaver_ftc_logs.physics import CIRCLE_SLACK, AngleFit, fit_angle
from beaver_ftc_logs.recording import Column, Columns, largest_magnitude
from beaver_ftc_logs.units import ACCELERATION, ANGLE, RATE, SI_UNITS, UNIT_FACTORS, nearest_unit

# Magnitudes of the correlation of an angle's change with the integral of a rate:
_AGREEING = 0.7  # above this the two belong together, whatever the unit of the rate
_CLOSE = 0.95  # above this another column is the rate of an angle that does not agree with the named one
_EXACT = 0.99  # above this the angle confirms the rate, if the slope is within _UNIT_RATIO of 1
# Slopes between its inverse and itself show no other unit: no two units differ by so little
_SLOPE_FACTOR = 1.8
_UNIT_RATIO = 1.3  # the most by which a slope differs from the factor of a unit that fits
_GRAVITIES_G = (0.5, 2.0)  # a column whose median magnitude along z is between these is in m/s2
_MAX_ANGLE_RAD = CIRCLE_SLACK * 2.0 * np.pi
_MAX_PITCH_RAD = CIRCLE_SLACK * 0.5 * np.pi  # a quarter of the circle
FAST_RAD_S = 12.0  # no vehicle turns so fast, though a spike of its gyro may be larger
# The name of a column, and the column.
NamedColumn = tuple[str, Column]
# Words for the rate of each axis.
_RATE_TITLES = ("roll rate", "pitch rate", "yaw rate")


def attitude_mistake(named: Columns, angles: Sequence[NamedColumn | None], others: Columns) -> str | None:
    """Text of the first mistake in the rates or the angles of roll, pitch and yaw; None if there is none.

    Of each axis: the size of a pitch angle; then, if rate and angle agree, the slope; otherwise other columns
    and other units of the rate that agree with the angle.

    angles: None where one is not known. others: columns that may have been exchanged with a rate.
    """
    for axis, (angle, rate) in enumerate(zip(angles, named, strict=True)):
        if angle is None:
            continue
        if axis == 1 and (remark := _pitch_remark(*angle)):
            return remark
        fit = _fit_with(named, angles, axis, named[rate])
        if fit is None:
            continue
        if abs(fit.correlation) >= _AGREEING:
            if remark := _factor_remark(fit, (rate, named[rate]), angle):
                return remark
            continue
        for name, column in (named | others).items():
            trial = _fit_with(named, angles, axis, column)
            if trial is not None and abs(trial.correlation) > _CLOSE:
                return (
                    f"{angle[0]} does not follow {rate} (correlation {fit.correlation:.2f}) "
                    f"but {name} ({trial.correlation:.2f}): {name} is the {_RATE_TITLES[axis]}"
                )
        # In a banked flight, q turns the yaw angle too: a yaw rate in another unit need not follow it.
        for factor in UNIT_FACTORS:
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


def _factor_remark(fit: AngleFit, named_rate: NamedColumn, named_angle: NamedColumn) -> str | None:
    """Text of a mistake in a rate or its angle by the slope, with the factor that fits; None if there is
    none.

    A slope near -1 is a wrong sign. Otherwise either may be wrong. The text names the angle if it exceeds a
    full circle and a unit fits; else the rate if no vehicle turns so fast and a unit fits; else both. Its
    factors are magnitudes: if the slope, which the text shows, is negative, the sign is wrong too.
    """
    slope = abs(fit.slope)
    is_near_one = 1.0 / _SLOPE_FACTOR < slope < _SLOPE_FACTOR
    if is_near_one and fit.slope > 0.0:
        return None
    rate_name, rate = named_rate
    angle_name, angle = named_angle
    ratio = f"the change of {angle_name} is {fit.slope:.4g} times the integral of {rate_name}"
    if is_near_one:
        return f"{ratio}: one of them has the other sign, `scale: -1` fits"
    angle_unit = nearest_unit(ANGLE, 1.0 / slope, _UNIT_RATIO)
    if angle_unit and largest_magnitude(angle.values) > _MAX_ANGLE_RAD:
        return f"{ratio}: {angle_name} {_unit_text(angle_unit)}"
    rate_unit = nearest_unit(RATE, slope, _UNIT_RATIO)
    if rate_unit and largest_magnitude(rate.values) > FAST_RAD_S:
        return f"{ratio}: {rate_name} {_unit_text(rate_unit)}"
    return f"{ratio}: a factor of {slope:.4g} on {rate_name} fits, or of {1.0 / slope:.4g} on {angle_name}"


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
    return (
        f"{name} reaches {largest:.4g} rad, a pitch angle at most {0.5 * np.pi:.4g}: {hint}; look at the "
        "rates' too"
    )


def gravity_remark(az: Column, name: str) -> str | None:
    """Text of a mistake in the acceleration along z by its median magnitude, with the unit that fits; None if
    there is none."""
    known = az.values[np.isfinite(az.values)]
    median = float(np.median(np.abs(known))) if known.size else 0.0
    if _GRAVITIES_G[0] < median / GRAVITY_MPS2 < _GRAVITIES_G[1]:
        return None
    unit = nearest_unit(ACCELERATION, GRAVITY_MPS2 / median, _GRAVITIES_G[1]) if median > 0.0 else None
    hint = f"it {_unit_text(unit)}" if unit else "no unit fits: is 1 g in it?"
    return f"{name}: its median magnitude is {median:.4g} m/s2, 1 g is {GRAVITY_MPS2:.4g}: {hint}"
