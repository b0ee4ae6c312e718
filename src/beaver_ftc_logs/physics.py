"""Checks of a log's units by mechanics: the integrals of p, q and r are the changes of roll, pitch and yaw,
and the mean of the specific force is 1 g.

    phi' = p + tan(theta) (q sin(phi) + r cos(phi))        [SL03, eq. 1.4-4]
    theta' = q cos(phi) - r sin(phi)
    psi' = (q sin(phi) + r cos(phi)) / cos(theta)
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from beaver_ftc_logs.recording import Column, Floats
from beaver_ftc_logs.units import (
    ACCELERATION,
    ANGLE,
    KIND_AND_SI_FACTOR_OF_UNIT,
    RATE,
    SIGN_AND_UNIT_FACTORS,
    nearest_unit,
)

_INTEGRATION_WINDOW_S, _MIN_WINDOWS = 1.0, 8
_MIN_MANY_WINDOWS, _MIN_AGREEING_CORRELATION, _MAX_RATIO_TO_UNIT_FACTOR = 20, 0.7, 1.3
_HIGH_CORRELATION, _EXACT_CORRELATION = 0.95, 0.99
_MAX_SLOPE_FACTOR, _MAX_SLOPE_FACTOR_OF_FEW_WINDOWS = 1.5, 1.8
_MAX_EXCHANGED_CORRELATION, _MAX_EXCHANGED_CORRELATION_OF_FEW_WINDOWS = 0.4, 0.2
_MIN_RMS_ANGLE_RATE_RAD_S = 1e-3
"""Level and north turn with the earth, by 7.3e-5 rad/s, and with the way over it, by 4.7e-5 rad/s at 300 m/s.
A change of an angle that is not far above them says nothing of a rate."""
_GRAVITY_MPS2 = KIND_AND_SI_FACTOR_OF_UNIT["g"][1]
_PLAUSIBLE_GRAVITY_RANGE_G = (0.5, 2.0)
_MAX_ROLL_YAW_RAD, _IMPLAUSIBLE_RATE_RAD_S = 1.02 * 2.0 * np.pi, 12.0
_MAX_PITCH_RAD, _STEEP_PITCH_RAD = 1.02 * 0.5 * np.pi, 1.0


@dataclass(frozen=True)
class AngleRateFit:
    """slope: change of an angle over the integral of its rate; correlation of the two; n_windows: how many
    were seen; max_angle_magnitude, max_rate_magnitude: as the log says."""

    slope: float
    correlation: float
    n_windows: int
    max_angle_magnitude: float
    max_rate_magnitude: float

    @property
    def has_many_windows(self) -> bool:
        """Whether so many windows were seen that less is needed to tell."""
        return self.n_windows >= _MIN_MANY_WINDOWS


def fit_roll_angle_to_rates(
    rate_columns: list[Column], roll_column: Column, pitch_column: Column | None
) -> AngleRateFit | None:
    """How the roll angle follows the rates; None where too little moves. All of them as the log says, in SI.

    rate_columns: p, q, r. Not where the nose is so steep that roll and yaw are hard to distinguish.
    """
    rate_times_s = rate_columns[0].t_s
    p, q, r = (_interpolate_column(body_rate_column, rate_times_s) for body_rate_column in rate_columns)
    roll_at_rate_times = _interpolate_column(roll_column, rate_times_s)
    full_circle = _full_circle(roll_column.values)
    # The circle is known whatever the unit.
    roll_rad_at_rate_times = roll_at_rate_times * 2.0 * np.pi / full_circle
    rate_terms, pitch_rad_at_rate_times = [p], None
    if pitch_column is not None:
        pitch_rad_at_rate_times = _interpolated_pitch_rad(roll_column, pitch_column, rate_times_s)
        rate_terms += [
            np.tan(pitch_rad_at_rate_times) * q * np.sin(roll_rad_at_rate_times),
            np.tan(pitch_rad_at_rate_times) * r * np.cos(roll_rad_at_rate_times),
        ]
    return _fit_angle_to_rate(
        rate_times_s, roll_at_rate_times, rate_terms, full_circle, pitch_rad_at_rate_times
    )


def fit_pitch_angle_to_rates(
    rate_columns: list[Column], roll_column: Column, pitch_column: Column
) -> AngleRateFit | None:
    """How the pitch angle follows the rates, as `fit_roll_angle_to_rates`."""
    rate_times_s = rate_columns[0].t_s
    _, q, r = (_interpolate_column(body_rate_column, rate_times_s) for body_rate_column in rate_columns)
    roll_rad_at_rate_times = (
        _interpolate_column(roll_column, rate_times_s) * 2.0 * np.pi / _full_circle(roll_column.values)
    )
    return _fit_angle_to_rate(
        rate_times_s,
        _interpolate_column(pitch_column, rate_times_s),
        [q * np.cos(roll_rad_at_rate_times), -r * np.sin(roll_rad_at_rate_times)],
    )


def fit_yaw_angle_to_rates(
    rate_columns: list[Column], roll_column: Column, pitch_column: Column | None, yaw_column: Column
) -> AngleRateFit | None:
    """How the yaw angle follows the rates, as `fit_roll_angle_to_rates`; r and q are in one unit, since a
    turn changes both alike."""
    rate_times_s = rate_columns[0].t_s
    _, q, r = (_interpolate_column(body_rate_column, rate_times_s) for body_rate_column in rate_columns)
    roll_rad_at_rate_times = (
        _interpolate_column(roll_column, rate_times_s) * 2.0 * np.pi / _full_circle(roll_column.values)
    )
    pitch_rad_at_rate_times = (
        np.zeros(len(rate_times_s))
        if pitch_column is None
        else _interpolated_pitch_rad(roll_column, pitch_column, rate_times_s)
    )
    euler_yaw_rate = (q * np.sin(roll_rad_at_rate_times) + r * np.cos(roll_rad_at_rate_times)) / np.cos(
        pitch_rad_at_rate_times
    )
    return _fit_angle_to_rate(
        rate_times_s,
        _interpolate_column(yaw_column, rate_times_s),
        [euler_yaw_rate],
        _full_circle(yaw_column.values),
        pitch_rad_at_rate_times,
    )


def _interpolated_pitch_rad(roll_column: Column, pitch_column: Column, t_s: Floats) -> Floats:
    """The pitch angle at given times, rad, of two angles in one unit."""
    return (
        _interpolate_column(pitch_column, t_s)
        * 2.0
        * np.pi
        / _full_circle(np.append(4.0 * pitch_column.values, roll_column.values))
    )


def _fit_angle_to_rate(
    t_s: Floats,
    logged_angle: Floats,
    rate_terms: list[Floats],
    full_circle: float | None = None,
    pitch_rad_at_samples: Floats | None = None,
) -> AngleRateFit | None:
    """How an angle follows the first term of its rate of change, window by window, the others in whatever
    unit they are; full_circle: a circle, where it may go round; pitch_rad_at_samples: the pitch angle, where
    windows in which it is steep say nothing."""
    step_s = np.diff(t_s)
    step_without_gaps = np.where(step_s < _INTEGRATION_WINDOW_S, step_s, 0.0)
    rate_term_integrals = np.vstack(
        [
            np.zeros(len(rate_terms)),
            np.cumsum(
                [step_without_gaps * _means_of_neighbours(rate_term) for rate_term in rate_terms], axis=1
            ).T,
        ]
    )
    window_samples = max(round(_INTEGRATION_WINDOW_S / max(float(np.median(step_s)), 1e-9)), 1)
    window_begin_rows = np.arange(0, len(t_s) - window_samples, window_samples)
    window_end_rows = np.arange(window_samples, len(t_s), window_samples)
    is_window_continuous_and_not_steep = (
        t_s[window_end_rows] - t_s[window_begin_rows]
    ) < 2.0 * _INTEGRATION_WINDOW_S
    if pitch_rad_at_samples is not None:
        cumulated_steep_count = np.cumsum(np.abs(pitch_rad_at_samples) > _STEEP_PITCH_RAD)
        is_window_continuous_and_not_steep &= (
            cumulated_steep_count[window_end_rows] == cumulated_steep_count[window_begin_rows]
        )
    angle_changes = (logged_angle[window_end_rows] - logged_angle[window_begin_rows])[
        is_window_continuous_and_not_steep
    ]
    rate_integrals = (rate_term_integrals[window_end_rows] - rate_term_integrals[window_begin_rows])[
        is_window_continuous_and_not_steep
    ]
    if full_circle is not None:
        angle_changes = (angle_changes + 0.5 * full_circle) % full_circle - 0.5 * full_circle
    is_known = np.isfinite(angle_changes) & np.isfinite(rate_integrals).all(axis=1)
    angle_changes, rate_integrals = angle_changes[is_known], rate_integrals[is_known]
    min_square_sum = len(angle_changes) * (_MIN_RMS_ANGLE_RATE_RAD_S * _INTEGRATION_WINDOW_S) ** 2
    if len(angle_changes) < _MIN_WINDOWS or angle_changes @ angle_changes < min_square_sum:
        return None
    coefficients = np.linalg.lstsq(rate_integrals, angle_changes, rcond=None)[0]
    angle_changes = angle_changes - rate_integrals[:, 1:] @ coefficients[1:]
    rate_integrals = rate_integrals[:, 0]
    rate_integral_square_sum = float(rate_integrals @ rate_integrals)
    angle_change_square_sum = float(angle_changes @ angle_changes)
    if not rate_integral_square_sum * angle_change_square_sum > 0.0:
        return None
    cross_product_sum = float(rate_integrals @ angle_changes)
    return AngleRateFit(
        slope=np.sign(cross_product_sum) * np.sqrt(angle_change_square_sum / rate_integral_square_sum),
        correlation=cross_product_sum / np.sqrt(rate_integral_square_sum * angle_change_square_sum),
        n_windows=len(rate_integrals),
        max_angle_magnitude=float(np.nanmax(np.abs(logged_angle))),
        max_rate_magnitude=float(np.nanmax(np.abs(rate_terms[0]))),
    )


def _means_of_neighbours(values: Floats) -> Floats:
    return np.nan_to_num(0.5 * (values[1:] + values[:-1]))


def _interpolate_column(column: Column, t_s: Floats) -> Floats:
    if len(column.t_s) == len(t_s) and np.array_equal(column.t_s, t_s):
        return column.values
    is_number = np.isfinite(column.values)
    if not is_number.any():
        return np.full(len(t_s), np.nan)
    return np.interp(t_s, column.t_s[is_number], column.values[is_number], left=np.nan, right=np.nan)


def _full_circle(angle: Floats) -> float:
    """A full circle in the unit that the angles seem to have: the least of rad, deg and cdeg that fits."""
    max_magnitude = float(np.nanmax(np.abs(angle), initial=0.0))
    return next((circle for circle in (2.0 * np.pi, 360.0) if max_magnitude <= 1.02 * circle), 36000.0)


NamedColumn = tuple[str, Column]
_RATE_TITLES = ("roll rate", "pitch rate", "yaw rate")


def find_attitude_mistake(
    rate_by_column_name: Mapping[str, Column],
    named_angles: Sequence[NamedColumn | None],
    possible_rate_columns: Mapping[str, Column],
) -> str | None:
    """Describe a mistake in the rates (p, q, r by column) or the angles: roll, pitch and yaw, None where one
    is not known. The first that is wrong; None where nothing is. possible_rate_columns: what may
    have taken the place of a rate."""
    rate_columns = list(rate_by_column_name.values())
    for axis, (rate_column_name, named_angle) in enumerate(
        zip(rate_by_column_name, named_angles, strict=True)
    ):
        if named_angle is None:
            continue
        if axis == 1 and (remark := pitch_angle_unit_remark(named_angle[1], named_angle[0])):
            return remark
        fit = _fit_angle_of_axis(rate_columns, named_angles, axis)
        if fit is None:
            continue
        for candidate_column_name, candidate_column in {
            **rate_by_column_name,
            **possible_rate_columns,
        }.items():
            candidate_fit = _fit_angle_of_axis(
                [*rate_columns[:axis], candidate_column, *rate_columns[axis + 1 :]], named_angles, axis
            )
            if candidate_fit is not None and abs(
                candidate_fit.correlation
            ) > _min_correlation_to_replace_rate(fit, candidate_column_name in rate_by_column_name):
                return _exchanged_column_text(
                    named_angle[0],
                    (rate_column_name, fit),
                    (candidate_column_name, candidate_fit),
                    _RATE_TITLES[axis],
                )
        if remark := angle_rate_factor_remark(
            fit, rate_column_name, named_angle[0]
        ) or _agreeing_rate_factor_remark(fit, rate_columns, named_angles, axis, rate_column_name):
            return remark
    return None


def rates_confirmed_by_attitude(
    rate_by_column_name: Mapping[str, Column], named_angles: Sequence[NamedColumn | None]
) -> frozenset[str]:
    """The columns of p, q and r whose integral is the change of roll, pitch and yaw, in sign and unit too."""
    rate_columns = list(rate_by_column_name.values())
    fits = {
        rate_column_name: _fit_angle_of_axis(rate_columns, named_angles, axis)
        for axis, rate_column_name in enumerate(rate_by_column_name)
    }
    return frozenset(name for name, fit in fits.items() if fit is not None and _is_exact(fit))


def _is_exact(fit: AngleRateFit) -> bool:
    return (
        fit.correlation > _EXACT_CORRELATION
        and 1.0 / _MAX_RATIO_TO_UNIT_FACTOR < fit.slope < _MAX_RATIO_TO_UNIT_FACTOR
    )


def _agreeing_rate_factor_remark(
    named_rate_fit: AngleRateFit,
    rate_columns: list[Column],
    named_angles: Sequence[NamedColumn | None],
    axis: int,
    rate_column_name: str,
) -> str | None:
    """Describe the sign or unit by which a rate explains its angle exactly, where it does not as it is; None
    where none does. In a banked flight a yaw rate in another unit does not even correlate with the yaw angle,
    since q turns it as well."""
    if abs(named_rate_fit.correlation) >= _MIN_AGREEING_CORRELATION:
        return None
    for factor in SIGN_AND_UNIT_FACTORS:
        scaled_column = replace(rate_columns[axis], values=factor * rate_columns[axis].values)
        scaled_fit = _fit_angle_of_axis(
            [*rate_columns[:axis], scaled_column, *rate_columns[axis + 1 :]], named_angles, axis
        )
        if scaled_fit is not None and _is_exact(scaled_fit):
            return (
                f"the {_RATE_TITLES[axis]} {rate_column_name} does not make the change of its angle "
                f"(correlation {named_rate_fit.correlation:.2f}): a factor of {factor:.4g} on "
                f"{rate_column_name} fits"
            )
    return None


def _min_correlation_to_replace_rate(named_rate_fit: AngleRateFit, is_candidate_a_rate: bool) -> float:
    """How well another column has to agree with an angle to be its rate, where the one named agrees so."""
    named_rate_correlation_magnitude = abs(named_rate_fit.correlation)
    if is_candidate_a_rate and named_rate_correlation_magnitude < (
        _MAX_EXCHANGED_CORRELATION
        if named_rate_fit.has_many_windows
        else _MAX_EXCHANGED_CORRELATION_OF_FEW_WINDOWS
    ):
        return _MIN_AGREEING_CORRELATION
    return (
        _HIGH_CORRELATION
        if named_rate_correlation_magnitude < _MIN_AGREEING_CORRELATION
        else _EXACT_CORRELATION
        if named_rate_correlation_magnitude < _HIGH_CORRELATION
        else np.inf
    )


def _fit_angle_of_axis(
    rate_columns: list[Column], named_angles: Sequence[NamedColumn | None], axis: int
) -> AngleRateFit | None:
    """How the angle of a place follows the rates; None where too little moves, or it is not known."""
    (roll_column, pitch_column, yaw_column) = (
        None if named_angle is None else named_angle[1] for named_angle in named_angles
    )
    if roll_column is None or (angle_column := (roll_column, pitch_column, yaw_column)[axis]) is None:
        return None
    if axis == 2:
        return fit_yaw_angle_to_rates(rate_columns, roll_column, pitch_column, angle_column)
    return (
        fit_pitch_angle_to_rates(rate_columns, roll_column, angle_column)
        if axis
        else fit_roll_angle_to_rates(rate_columns, roll_column, pitch_column)
    )


def _exchanged_column_text(
    angle_column_name: str,
    rate_name_and_fit: tuple[str, AngleRateFit],
    better_name_and_fit: tuple[str, AngleRateFit],
    rate_title: str,
) -> str:
    (rate_column_name, rate_fit), (better_column_name, better_fit) = rate_name_and_fit, better_name_and_fit
    return (
        f"{angle_column_name} does not follow {rate_column_name} (correlation {rate_fit.correlation:.2f}) "
        f"but {better_column_name} ({better_fit.correlation:.2f}): {better_column_name} is the {rate_title}"
    )


def angle_rate_factor_remark(fit: AngleRateFit, rate_column_name: str, angle_column_name: str) -> str | None:
    """Describe a mistake in a rate or its angle by their proportion, and which factor fits; None where
    nothing is. rate_column_name, angle_column_name: their columns.

    Either may be; an angle that goes round more than once is, and a rate that no vehicle turns at.
    """
    slope_magnitude = abs(fit.slope)
    max_slope_factor = _MAX_SLOPE_FACTOR if fit.has_many_windows else _MAX_SLOPE_FACTOR_OF_FEW_WINDOWS
    is_near_one = 1.0 / max_slope_factor < slope_magnitude < max_slope_factor
    if abs(fit.correlation) < _MIN_AGREEING_CORRELATION or (is_near_one and fit.slope > 0.0):
        return None
    angle_to_rate_integral_ratio_text = (
        f"the change of {angle_column_name} is {fit.slope:.4g} times the integral of {rate_column_name}"
    )
    if is_near_one:
        return f"{angle_to_rate_integral_ratio_text}: one of them has the other sign, `scale: -1` fits"
    if fit.max_angle_magnitude > _MAX_ROLL_YAW_RAD and (
        fitting_unit := nearest_unit(ANGLE, 1.0 / slope_magnitude, _MAX_RATIO_TO_UNIT_FACTOR)
    ):
        return (
            f"{angle_to_rate_integral_ratio_text}: {angle_column_name} is in {fitting_unit}, a factor of "
            f"{KIND_AND_SI_FACTOR_OF_UNIT[fitting_unit][1]:.4g} fits"
        )
    if fit.max_rate_magnitude > _IMPLAUSIBLE_RATE_RAD_S and (
        fitting_unit := nearest_unit(RATE, slope_magnitude, _MAX_RATIO_TO_UNIT_FACTOR)
    ):
        return (
            f"{angle_to_rate_integral_ratio_text}: {rate_column_name} is in {fitting_unit}, a factor of "
            f"{KIND_AND_SI_FACTOR_OF_UNIT[fitting_unit][1]:.4g} fits"
        )
    return (
        f"{angle_to_rate_integral_ratio_text}: a factor of {slope_magnitude:.4g} on {rate_column_name} fits, "
        f"or of {1.0 / slope_magnitude:.4g} on {angle_column_name}"
    )


def pitch_angle_unit_remark(pitch_column: Column, column_name: str) -> str | None:
    """Describe a mistake in a pitch angle by its size, and which unit fits; None where nothing is: it says
    what no comparison can, where rates and angles are scaled alike."""
    max_pitch = float(np.nanmax(np.abs(pitch_column.values), initial=0.0))
    if max_pitch <= _MAX_PITCH_RAD:
        return None
    plausible_unit = next(
        (
            candidate_unit
            for candidate_unit in ("deg", "cdeg")
            if max_pitch * KIND_AND_SI_FACTOR_OF_UNIT[candidate_unit][1] <= _MAX_PITCH_RAD
        ),
        None,
    )
    plausible_unit_text = (
        f"it is in {plausible_unit}, a factor of {KIND_AND_SI_FACTOR_OF_UNIT[plausible_unit][1]:.4g} fits"
        if plausible_unit
        else "no unit fits"
    )
    return (
        f"{column_name} reaches {max_pitch:.4g} rad, a pitch angle at most 1.571: {plausible_unit_text}; "
        "look at the rates' too"
    )


def gravity_remark(z_acceleration_column: Column, column_name: str) -> str | None:
    """Describe a mistake in the acceleration along z by its mean, and which unit fits; None where nothing
    is."""
    finite_accelerations = z_acceleration_column.values[np.isfinite(z_acceleration_column.values)]
    median_of_magnitudes_mps2 = (
        float(np.median(np.abs(finite_accelerations))) if finite_accelerations.size else 0.0
    )
    if (
        _PLAUSIBLE_GRAVITY_RANGE_G[0]
        < median_of_magnitudes_mps2 / _GRAVITY_MPS2
        < _PLAUSIBLE_GRAVITY_RANGE_G[1]
    ):
        return None
    plausible_unit = (
        nearest_unit(ACCELERATION, _GRAVITY_MPS2 / median_of_magnitudes_mps2, 2.0)
        if median_of_magnitudes_mps2 > 0.0
        else None
    )
    plausible_unit_text = (
        f"it is in {plausible_unit}, a factor of {KIND_AND_SI_FACTOR_OF_UNIT[plausible_unit][1]:.4g} fits"
        if plausible_unit
        else "no unit fits: is 1 g in it?"
    )
    return (
        f"{column_name}: is {median_of_magnitudes_mps2:.4g} m/s2 on the middle of the flight, 1 g is "
        f"{_GRAVITY_MPS2:.4g}: {plausible_unit_text}"
    )
