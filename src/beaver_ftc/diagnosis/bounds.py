"""The declared uncertainty: the worst case that it allows in xdot, and the same as variances.

The design model is a sum of products: inertia coefficient times dynamic pressure times aerodynamic
coefficient times powers of measured signals. If every factor f is known to within e, then

    |prod (f + e) - prod f| <= prod (|f| + |e|) - prod |f|

and the sum of these over the terms bounds |F(truth) - F(measured)| at this state. If all errors have one
sign, each term reaches its bound. The same bound serves the isolation estimators: a lost share of a surface
multiplies its terms by 1 + theta in [0, 1], and with them their error.

A gyro's error appears once more, because xdot is computed from the gyro's readings. Its constant part drops
out of the difference. Of the changing part n with |n| <= nbar the filter eps[k+1] = a eps[k] + n[k+1] - n[k]
keeps n[k] - m[k], m[k+1] = a m[k] + (1 - a) n[k]. This is at most nbar[k] plus the filtered nbar: 2 nbar at
any frame rate.

A derived aircraft declares a map of its model's error. The map has a few boxes of states, one inside the
other. Each box has the largest error found in it for surfaces within a share of their travel (stand-ins:
within less). Healthy surfaces are where their commands put them, and a surface that has lost effectiveness
acts like one with a smaller deflection: the bound is that of the share of travel in use. A stuck surface may
be anywhere: the additional error of its share, `additional_error_bound_by_travel_level`, belongs to the
hypothesis that it is off its command (isolation.py). If two surfaces may be off, the bound itself takes the
whole travel. Outside all boxes nothing has been measured, so nothing is concluded.

Variances: for plug-ins, and for the filters and tests of the statistical detector.
"""

from dataclasses import replace
from functools import lru_cache
from itertools import product
from math import exp, hypot, log, pi
from typing import TYPE_CHECKING, Any

import numpy as np

from beaver_ftc.aircraft import AXES, Aircraft, MassProperties, Term
from beaver_ftc.aircraft.aircraft import EARTH_RATE_RAD_S, MOMENTS
from beaver_ftc.aircraft.schema import MAX_AGES, MAX_BOXES, MAX_LEVELS, MAX_MONOMIALS, MAX_TERMS, RATE_SIGNALS
from beaver_ftc.compiled import kernel, record, sized
from beaver_ftc.design import LEAST_HEIGHT_M
from beaver_ftc.design.model import (
    AIRSPEED,
    DPT,
    DPT_0,
    KW_TO_DPT,
    N_SIGNALS,
    N_Y,
    PH,
    QDYN,
    QH,
    RH,
    DesignFunctions,
    coefficient_slopes,
    density_ratio,
    inertia_coefficients,
    jacobian,
    mass_of,
    monomials,
    power_error_kw,
    signals,
)
from beaver_ftc.plant.faults import OF_THE_SLIPSTREAM
from beaver_ftc.scenario.declared import Declared, SensorErrors
from beaver_ftc.scenario.sensors import ENGINE, NOISE_LIMIT_SIGMA

if TYPE_CHECKING:
    from beaver_ftc.design.context import DeclaredErrors

_FURTHER_READINGS = ("phi", "theta", "psi", "ax", "ay", "az", "altitude")  # of a plug-in, after SIGNALS
_FIRST_AIR_DATA_SIGNAL_INDEX = (
    3  # gyros come first among the signals, then alpha, beta, airspeed, dynamic pressure
)
_MIN_TRUE_OVER_MEASURED_AIRSPEED = 0.1
# Double precision leaves 1e-16 of a rate below 6 rad/s, divided by a frame of 1 ms or more, and of the terms
# of f + G u, which stay below 100 rad/s2; a few operations each. Where a frame is of fifty instants it leaves
# more, 1e-10: the Earth's rate squared, 5e-9, covers that.
ROUNDING_RAD_S2 = 1e-11
UNMAPPED_ERROR_RAD_S2 = 1e6  # terms fitted near trim are off by thousands at 0.5 rad
# The same for filters with a covariance, whose noise is 1e-4: above the acceleration of any aircraft.
ERROR_BOUND_OFF_MAP_IN_FILTERS_RAD_S2 = 100.0
_MAP_EDGE_ROUNDING_SHARE = 1e-9
N_MAP_COORDINATES = 3 + N_Y  # rates, then y with the density of the air in place of dynamic pressure


@sized
def declared_errors_dtype(n: int) -> np.dtype:
    """The declared errors beyond the published bound, of an aircraft with n surfaces."""
    return record(
        has_declared_errors=int,
        coefficient_tolerance=MAX_TERMS,  # of each moment coefficient, as the design model has them
        inertia_coefficient_tolerance=12,  # of each inertia coefficient, in the order of design.model
        # error of a signal: offset + slope |signal|
        signal_error_bound_at_zero=7, signal_error_bound_per_unit=7,
        constant_gyro_error_bound=3,  # of the offset of a gyro, what does not change
        air_rotation_bound=3, deflection_error_bound=float,
        # of the air's rotation, rad/s: above 2000 ft; below 1000 ft, times the root of the height in m; how
        # far the reading of the altitude can be off: offset, m, and slope
        air_rotation_bound_aloft=float, air_rotation_bound_at_1_m=float, altitude_error_bound_at_zero_m=float,
        altitude_error_bound_per_m=float,
        # of dpt: see `slipstream_error_bound`
        has_engine_instrument_errors=int, power_error_kw_by_instruments=float,
        power_error_kw_per_density_ratio=float,
        # scratch: magnitudes as measured, and as large as they can be
        magnitude_x=3, magnitude_y=N_Y, magnitude_u=n, max_magnitude_x=3, magnitude_bound_y=N_Y,
        max_magnitude_u=n, max_air_relative_rate=3,
        signal_magnitude=N_SIGNALS,
        monomial_magnitude=MAX_MONOMIALS, max_monomial_magnitude=MAX_MONOMIALS,
        acceleration_error_bound_per_rad=(3, n), moment_term_magnitude_sum=3,
        moment_error_bound=3,
    )  # fmt: skip


@sized
def error_map_dtype(n: int, n_boxes: int = MAX_BOXES) -> np.dtype:
    """The map of the error of an aircraft's model, with n surfaces.

    one_surface_may_be_anywhere: one surface may be anywhere in its travel; several_surfaces_may_be_anywhere:
    more than one may.
    is_outside_all_boxes: whether the state is outside all boxes; box_index, time_row_index: where it is
    in the map.
    surface_positions_before: deflections in the frame before, rad; error_bound_now: error here, rad/s2.
    engine_asymmetry_bound: bound on the yawing moment of healthy engines, by box."""
    return record(
        n_boxes=int, n_travel_levels=int, n_time_rows=int, one_surface_may_be_anywhere=int,
        several_surfaces_may_be_anywhere=int,
        is_outside_all_boxes=int, box_index=int, time_row_index=int,
        time_s=float, until_s=MAX_AGES, box_low=(n_boxes, N_MAP_COORDINATES), box_high=(n_boxes,
        N_MAP_COORDINATES),
        travel_share_by_level=MAX_LEVELS,
        error_bound=(MAX_AGES, n_boxes, MAX_LEVELS, 3), travel_low=n, travel_high=n,
        surface_positions_before=n, coordinates=N_MAP_COORDINATES, error_bound_now=3,
        engine_asymmetry_bound=n_boxes, engine_asymmetry_bound_now=float,
    )  # fmt: skip


@sized
def bound_dtype(n: int, n_boxes: int = MAX_BOXES) -> np.dtype:
    """Bounds on the uncertainty. eta_bar, eta_bar_now: over the elapsed frame and at this instant, rad/s2.
    changing_gyro_error_bound: on the changing part of a gyro's error, rad/s. frame_innovation_bound: on the
    innovation of one frame, rad/s2. surface_term_error_bound_per_rad, surface_term_error_bound_at_command: on
    the error of each surface's own terms in the acceleration, per rad of deflection (rad/s2 per rad) and at
    the command (rad/s2), means over the frame.
    additional_error_bound_by_travel_level: by how much the map's error with a surface at each share of its
    travel exceeds that in eta_bar."""
    return record(
        inertia_coupling_error_share=3, constant_error_bound=3, earth_rate_rad_s=float,
        declared_errors=declared_errors_dtype(n),
        error_map=error_map_dtype(n, n_boxes), eta_bar=3, eta_bar_now=3,
        changing_gyro_error_bound=3, changing_gyro_error_bound_before=3,
        frame_innovation_bound=3,
        has_surface_term_errors=int, surface_term_error_bound_per_rad=(3, n),
        surface_term_error_bound_at_command=(3, n),
        additional_error_bound_by_travel_level=(MAX_LEVELS, 3),
    )  # fmt: skip


def fill_error_map(
    error_map: np.void,
    aircraft: Aircraft,
    one_surface_may_be_anywhere: bool,
    several_surfaces_may_be_anywhere: bool,
) -> None:
    """Write the map of the aircraft, if it has one. one_surface_may_be_anywhere: a faulty surface may be
    anywhere in its travel; several_surfaces_may_be_anywhere: more than one may."""
    model_error_map = aircraft.file.model_error_map
    if model_error_map is None:
        return
    n_travel_levels, n_time_rows = len(model_error_map.travel_share), len(model_error_map.until_s)
    error_map["one_surface_may_be_anywhere"] = one_surface_may_be_anywhere
    error_map["several_surfaces_may_be_anywhere"] = several_surfaces_may_be_anywhere
    error_map["n_boxes"] = len(model_error_map.boxes)
    error_map["n_travel_levels"], error_map["n_time_rows"] = (
        n_travel_levels,
        n_time_rows,
    )
    error_map["until_s"][:n_time_rows] = model_error_map.until_s
    error_map["travel_share_by_level"][:n_travel_levels] = model_error_map.travel_share
    mapped_travel_share_of_surface = np.array(
        [model_error_map.stand_ins if s in aircraft.stand_ins else 1.0 for s in aircraft.surfaces]
    )
    error_map["travel_low"] = mapped_travel_share_of_surface * [
        surface_travel.min_rad for surface_travel in aircraft.travel.values()
    ]
    error_map["travel_high"] = mapped_travel_share_of_surface * [
        surface_travel.max_rad for surface_travel in aircraft.travel.values()
    ]
    for box_index, box in enumerate(model_error_map.boxes):
        box_limits = np.array(box.ends(aircraft.signals))
        error_map["box_low"][box_index, : len(box_limits)] = box_limits[:, 0]
        error_map["box_high"][box_index, : len(box_limits)] = box_limits[:, 1]
        error_bound_tables_by_axis = box.error_p_rad_s2, box.error_q_rad_s2, box.error_r_rad_s2
        error_map["error_bound"][:n_time_rows, box_index, :n_travel_levels] = np.stack(
            error_bound_tables_by_axis, axis=-1
        )
        error_map["engine_asymmetry_bound"][box_index] = box.engines_apart or 0.0


@kernel
def reading_error_bound(declared_errors, signal_index, reading):
    """Bound the error of the reading of a signal, in its unit."""
    return (
        declared_errors.signal_error_bound_at_zero[signal_index]
        + declared_errors.signal_error_bound_per_unit[signal_index] * abs(reading)
    ) / (1.0 - declared_errors.signal_error_bound_per_unit[signal_index])


@kernel
def changing_gyro_error_bound(declared_errors, axis, reading):
    """Bound the changing error of the gyro of an axis, rad/s: noise, resolution, slope times the true
    rate."""
    changing_error_bound_at_rest = (
        declared_errors.signal_error_bound_at_zero[axis] - declared_errors.constant_gyro_error_bound[axis]
    )
    return changing_error_bound_at_rest + declared_errors.signal_error_bound_per_unit[axis] * (
        abs(reading) + reading_error_bound(declared_errors, axis, reading)
    )


@kernel
def slipstream_error_bound(declared_errors, y):
    """Bound the error of dpt, which is computed from the engine's instruments and the air data.

    dpt = a + b P / (qdyn V) [FDC]: the power's error, by the instruments power_error_kw_by_instruments and by
    the density power_error_kw_per_density_ratio for all of it; and the share that dynamic pressure and
    airspeed are off.
    """
    relative_qdyn_error_bound = (
        reading_error_bound(declared_errors, _FIRST_AIR_DATA_SIGNAL_INDEX + QDYN, y[QDYN]) / y[QDYN]
    )
    relative_airspeed_error_bound = (
        reading_error_bound(declared_errors, _FIRST_AIR_DATA_SIGNAL_INDEX + AIRSPEED, y[AIRSPEED])
        / y[AIRSPEED]
    )
    max_measured_over_true_qdyn_times_V = 1.0 / (
        (1.0 - min(relative_qdyn_error_bound, 0.9)) * (1.0 - min(relative_airspeed_error_bound, 0.9))
    )
    relative_density_error_bound = (1.0 + relative_qdyn_error_bound) / (
        1.0 - min(relative_airspeed_error_bound, 0.9)
    ) ** 2 - 1.0
    power_error_bound_kw = (
        declared_errors.power_error_kw_by_instruments
        + declared_errors.power_error_kw_per_density_ratio * relative_density_error_bound * density_ratio(y)
    )
    return max_measured_over_true_qdyn_times_V * KW_TO_DPT * power_error_bound_kw / (
        y[QDYN] * y[AIRSPEED]
    ) + (max_measured_over_true_qdyn_times_V - 1.0) * abs(y[DPT] - DPT_0)


@kernel
def fill_signal_magnitudes(declared_errors, x, y, u):
    """Fill the scratch fields with |signal| as measured and the largest |signal| that the errors allow; for
    airspeed, the smallest."""
    for i in range(3):
        declared_errors.magnitude_x[i] = abs(x[i])
        declared_errors.max_magnitude_x[i] = abs(x[i]) + reading_error_bound(declared_errors, i, x[i])
        declared_errors.max_air_relative_rate[i] = (
            declared_errors.max_magnitude_x[i] + declared_errors.air_rotation_bound[i]
        )
    for i in range(DPT):
        declared_errors.magnitude_y[i] = abs(y[i])
        declared_errors.magnitude_bound_y[i] = abs(y[i]) + reading_error_bound(
            declared_errors, _FIRST_AIR_DATA_SIGNAL_INDEX + i, y[i]
        )
    for i in range(DPT, y.size):
        declared_errors.magnitude_y[i] = declared_errors.magnitude_bound_y[i] = abs(y[i])
    if declared_errors.has_engine_instrument_errors:
        declared_errors.magnitude_bound_y[DPT] += slipstream_error_bound(declared_errors, y)
    for s in range(u.size):
        declared_errors.magnitude_u[s] = abs(u[s])
        declared_errors.max_magnitude_u[s] = abs(u[s]) + declared_errors.deflection_error_bound
    V = y[AIRSPEED]
    declared_errors.magnitude_bound_y[AIRSPEED] = max(
        2.0 * V - declared_errors.magnitude_bound_y[AIRSPEED], _MIN_TRUE_OVER_MEASURED_AIRSPEED * V
    )


@kernel
def fill_moment_magnitudes_and_error_bounds(declared_errors, design):
    """Fill moment_term_magnitude_sum (3,), the sum of the magnitudes of a moment's terms, and
    moment_error_bound (3,), the bound on the error of this sum; N m."""
    measured_dynamic_pressure = declared_errors.magnitude_y[QDYN]
    max_dynamic_pressure = declared_errors.magnitude_bound_y[QDYN]
    moment_table = design.moments
    for i in range(3):
        term_magnitude_sum, max_term_magnitude_sum = 0.0, 0.0
        for k in range(moment_table.free_from[i], moment_table.surface_to[i]):
            term_coefficient_magnitude, s = abs(moment_table.value[k]), moment_table.surface[k]
            term_magnitude_sum += (
                term_coefficient_magnitude
                * declared_errors.monomial_magnitude[moment_table.monomial[k]]
                * (declared_errors.magnitude_u[s] if s >= 0 else 1.0)
            )
            max_signal_factor_magnitude = declared_errors.max_monomial_magnitude[moment_table.monomial[k]] * (
                declared_errors.max_magnitude_u[s] if s >= 0 else 1.0
            )
            max_term_magnitude_sum += (
                term_coefficient_magnitude + declared_errors.coefficient_tolerance[k]
            ) * max_signal_factor_magnitude
        wing_area_times_length = design.S * (design.c if i == 1 else design.b)
        declared_errors.moment_term_magnitude_sum[i] = (
            wing_area_times_length * measured_dynamic_pressure * term_magnitude_sum
        )
        declared_errors.moment_error_bound[i] = wing_area_times_length * (
            max_dynamic_pressure * max_term_magnitude_sum - measured_dynamic_pressure * term_magnitude_sum
        )


@kernel
def product_error_bound(coefficient, coefficient_error_bound, signal_magnitude, max_signal_magnitude):
    """Bound the error of a coefficient times a signal; coefficient_error_bound: absolute."""
    return (abs(coefficient) + coefficient_error_bound) * max_signal_magnitude - abs(
        coefficient
    ) * signal_magnitude


@kernel
def acceleration_error_bound_from_moment(declared_errors, axis, coefficient, coefficient_error_bound):
    """Bound the error of an inertia coefficient times the moment about an axis, rad/s2."""
    moment_term_magnitude_sum = declared_errors.moment_term_magnitude_sum[axis]
    return product_error_bound(
        coefficient,
        coefficient_error_bound,
        moment_term_magnitude_sum,
        moment_term_magnitude_sum + declared_errors.moment_error_bound[axis],
    )


@kernel
def acceleration_error_bound_from_rate_product(declared_errors, i, j, coefficient, coefficient_error_bound):
    """Bound the error of an inertia coefficient times the rates i and j, rad/s2."""
    rate_magnitudes, max_rate_magnitudes = declared_errors.magnitude_x, declared_errors.max_magnitude_x
    return product_error_bound(
        coefficient,
        coefficient_error_bound,
        rate_magnitudes[i] * rate_magnitudes[j],
        max_rate_magnitudes[i] * max_rate_magnitudes[j],
    )


@kernel
def surface_moment_magnitudes_per_rad(declared_errors, design, axis, s):
    """Return the part of surface s in the moment about an axis per rad: its magnitude, and with all errors; N
    m."""
    term_magnitude_sum_per_rad, max_term_magnitude_sum_per_rad = 0.0, 0.0
    moment_table = design.moments
    for k in range(moment_table.free_to[axis], moment_table.surface_to[axis]):
        if moment_table.surface[k] == s:
            term_coefficient_magnitude = abs(moment_table.value[k])
            term_magnitude_sum_per_rad += (
                term_coefficient_magnitude * declared_errors.monomial_magnitude[moment_table.monomial[k]]
            )
            max_term_magnitude_sum_per_rad += (
                term_coefficient_magnitude + declared_errors.coefficient_tolerance[k]
            ) * declared_errors.max_monomial_magnitude[moment_table.monomial[k]]
    wing_area_times_length = design.S * (design.c if axis == 1 else design.b)
    moment_per_unit_coefficient = wing_area_times_length * declared_errors.magnitude_y[QDYN]
    max_moment_per_unit_coefficient = wing_area_times_length * declared_errors.magnitude_bound_y[QDYN]
    return (
        moment_per_unit_coefficient * term_magnitude_sum_per_rad,
        max_moment_per_unit_coefficient * max_term_magnitude_sum_per_rad,
    )


@kernel
def fill_acceleration_error_bound_per_rad(declared_errors, design, s):
    """Fill acceleration_error_bound_per_rad[:, s], rad/s2 per rad: on the error of the effect of surface s.

    The declared bound is affine in |u_s|; this is its slope. Call
    `fill_magnitudes_and_add_declared_bound` first: it fills the scratch fields.
    """
    inertia_coefficient_error_bounds = declared_errors.inertia_coefficient_tolerance
    error_bounds_per_rad = declared_errors.acceleration_error_bound_per_rad
    roll_moment_magnitude_per_rad, max_roll_moment_magnitude_per_rad = surface_moment_magnitudes_per_rad(
        declared_errors, design, 0, s
    )
    pitch_moment_magnitude_per_rad, max_pitch_moment_magnitude_per_rad = surface_moment_magnitudes_per_rad(
        declared_errors, design, 1, s
    )
    yaw_moment_magnitude_per_rad, max_yaw_moment_magnitude_per_rad = surface_moment_magnitudes_per_rad(
        declared_errors, design, 2, s
    )
    error_bounds_per_rad[0, s] = product_error_bound(
        design.Pl,
        inertia_coefficient_error_bounds[2],
        roll_moment_magnitude_per_rad,
        max_roll_moment_magnitude_per_rad,
    )
    error_bounds_per_rad[0, s] += product_error_bound(
        design.Pn,
        inertia_coefficient_error_bounds[3],
        yaw_moment_magnitude_per_rad,
        max_yaw_moment_magnitude_per_rad,
    )
    error_bounds_per_rad[1, s] = product_error_bound(
        design.Qm,
        inertia_coefficient_error_bounds[7],
        pitch_moment_magnitude_per_rad,
        max_pitch_moment_magnitude_per_rad,
    )
    error_bounds_per_rad[2, s] = product_error_bound(
        design.Rl,
        inertia_coefficient_error_bounds[10],
        roll_moment_magnitude_per_rad,
        max_roll_moment_magnitude_per_rad,
    )
    error_bounds_per_rad[2, s] += product_error_bound(
        design.Rn,
        inertia_coefficient_error_bounds[11],
        yaw_moment_magnitude_per_rad,
        max_yaw_moment_magnitude_per_rad,
    )


@kernel
def fill_magnitudes_and_add_declared_bound(declared_errors, design, x, y, u, eta_bar):
    """Add to eta_bar (3,) rad/s2 the bound by the declared errors; x (3,), y, u (surfaces,) as measured."""
    fill_signal_magnitudes(declared_errors, x, y, u)
    signals(
        design.moments,
        declared_errors.magnitude_x,
        declared_errors.magnitude_y,
        declared_errors.signal_magnitude,
    )
    monomials(design.moments, declared_errors.signal_magnitude, declared_errors.monomial_magnitude)
    signals(
        design.moments,
        declared_errors.max_air_relative_rate,
        declared_errors.magnitude_bound_y,
        declared_errors.signal_magnitude,
    )
    monomials(design.moments, declared_errors.signal_magnitude, declared_errors.max_monomial_magnitude)
    fill_moment_magnitudes_and_error_bounds(declared_errors, design)
    inertia_coefficient_error_bounds = declared_errors.inertia_coefficient_tolerance
    eta_bar[0] += acceleration_error_bound_from_moment(
        declared_errors, 0, design.Pl, inertia_coefficient_error_bounds[2]
    ) + acceleration_error_bound_from_moment(
        declared_errors, 2, design.Pn, inertia_coefficient_error_bounds[3]
    )
    eta_bar[0] += acceleration_error_bound_from_rate_product(
        declared_errors, 0, 1, design.Ppq, inertia_coefficient_error_bounds[0]
    ) + acceleration_error_bound_from_rate_product(
        declared_errors, 1, 2, design.Pqr, inertia_coefficient_error_bounds[1]
    )
    eta_bar[1] += acceleration_error_bound_from_moment(
        declared_errors, 1, design.Qm, inertia_coefficient_error_bounds[7]
    ) + acceleration_error_bound_from_rate_product(
        declared_errors, 0, 2, design.Qpr, inertia_coefficient_error_bounds[5]
    )
    eta_bar[1] += acceleration_error_bound_from_rate_product(
        declared_errors, 0, 0, design.Qpp, inertia_coefficient_error_bounds[4]
    ) + acceleration_error_bound_from_rate_product(
        declared_errors, 2, 2, design.Qrr, inertia_coefficient_error_bounds[6]
    )
    eta_bar[2] += acceleration_error_bound_from_moment(
        declared_errors, 0, design.Rl, inertia_coefficient_error_bounds[10]
    ) + acceleration_error_bound_from_moment(
        declared_errors, 2, design.Rn, inertia_coefficient_error_bounds[11]
    )
    eta_bar[2] += acceleration_error_bound_from_rate_product(
        declared_errors, 0, 1, design.Rpq, inertia_coefficient_error_bounds[8]
    ) + acceleration_error_bound_from_rate_product(
        declared_errors, 1, 2, design.Rqr, inertia_coefficient_error_bounds[9]
    )


@kernel
def is_inside_box(error_map, box_index):
    """Whether the state is in this box of the map."""
    is_inside = True
    for i in range(error_map.coordinates.size):
        rounding_margin = _MAP_EDGE_ROUNDING_SHARE * (1.0 + abs(error_map.coordinates[i]))
        is_inside = (
            is_inside
            and error_map.box_low[box_index, i] - rounding_margin
            <= error_map.coordinates[i]
            <= error_map.box_high[box_index, i] + rounding_margin
        )
    return is_inside


@kernel
def is_coordinate_outside_span_of_boxes(error_map, state_coordinate_index):
    """Whether this coordinate of the state is outside the range that the boxes span together."""
    lowest_box_low, highest_box_high = np.inf, -np.inf
    for box_index in range(error_map.n_boxes):
        lowest_box_low = min(lowest_box_low, error_map.box_low[box_index, state_coordinate_index])
        highest_box_high = max(highest_box_high, error_map.box_high[box_index, state_coordinate_index])
    rounding_margin = _MAP_EDGE_ROUNDING_SHARE * (1.0 + abs(error_map.coordinates[state_coordinate_index]))
    return (
        not lowest_box_low - rounding_margin
        <= error_map.coordinates[state_coordinate_index]
        <= highest_box_high + rounding_margin
    )


@kernel
def travel_level_index_for_positions(error_map, u):
    """Index of the least share of the travel that covers surfaces at u (n,) rad; the last index if all of the
    travel may be used."""
    if error_map.several_surfaces_may_be_anywhere:
        return error_map.n_travel_levels - 1
    max_travel_share = 0.0
    for s in range(u.size):
        if u[s] != 0.0:
            travel_limit = error_map.travel_high[s] if u[s] > 0.0 else error_map.travel_low[s]
            max_travel_share = max(max_travel_share, u[s] / travel_limit) if travel_limit != 0.0 else 1.0
    return travel_level_index_for_share(error_map, max_travel_share)


@kernel
def travel_level_index_for_share(error_map, travel_share):
    """Index of the least share of the travel in the map that is not below `travel_share`; else the last."""
    last_level_index = error_map.n_travel_levels - 1
    for j in range(last_level_index):
        if travel_share <= error_map.travel_share_by_level[j]:
            return j
    return last_level_index


@kernel
def max_travel_share_used(error_map, s, mean_position_interval, travel_share_before, n_instants):
    """The largest share of its travel that surface s can use at any of so many instants of a frame.

    mean_position_interval: (low, high) rad, of the mean position over the instants; travel_share_before: the
    share at the start of the frame, where the surface may still be at the first instant.
    """
    max_share_used, (mean_position_low, mean_position_high) = 0.0, mean_position_interval
    if mean_position_high > 0.0:
        max_share_used = (
            mean_position_high / error_map.travel_high[s] if error_map.travel_high[s] != 0.0 else 1.0
        )
    if mean_position_low < 0.0:
        max_share_used = max(
            max_share_used,
            mean_position_low / error_map.travel_low[s] if error_map.travel_low[s] != 0.0 else 1.0,
        )
    if n_instants > 1:
        max_share_used = max(
            travel_share_before, (n_instants * max_share_used + travel_share_before) / (n_instants - 1)
        )
    return min(max_share_used, 1.0)


@kernel
def error_map_time_row_index(error_map):
    """The row of the map for the present flight time, -1 if the map ends before."""
    for time_row_index in range(error_map.n_time_rows):
        if error_map.time_s <= error_map.until_s[time_row_index]:
            return time_row_index
    return -1


@kernel
def look_up_error_map(error_map, x, y, u):
    """Fill `coordinates` and `error_bound_now`, the mapped error at this state; x (3,) rad/s, y (4 +
    declared,), u (n,) rad."""
    coordinates = error_map.coordinates
    coordinates[:3], coordinates[3 : 3 + y.size] = x, y
    coordinates[3 + QDYN] = 2.0 * y[QDYN] / (y[AIRSPEED] * y[AIRSPEED])
    travel_level_index = travel_level_index_for_positions(error_map, u)
    time_row_index = error_map_time_row_index(error_map)
    for box_index in range(error_map.n_boxes if time_row_index >= 0 else 0):
        if is_inside_box(error_map, box_index):
            error_map.is_outside_all_boxes = 0
            error_map.error_bound_now[:] = error_map.error_bound[
                time_row_index, box_index, travel_level_index
            ]
            error_map.box_index, error_map.time_row_index = (
                box_index,
                time_row_index,
            )
            error_map.engine_asymmetry_bound_now = error_map.engine_asymmetry_bound[box_index]
            return
    error_map.is_outside_all_boxes = 1
    error_map.error_bound_now[:] = UNMAPPED_ERROR_RAD_S2
    error_map.engine_asymmetry_bound_now = UNMAPPED_ERROR_RAD_S2


@kernel
def additional_error_bound_at_travel_level(error_map, travel_level_index, axis):
    """By how much the mapped error of an axis at this instant is larger if a surface is at this level of
    travel, rad/s2."""
    if error_map.is_outside_all_boxes:
        return 0.0
    return max(
        error_map.error_bound[
            error_map.time_row_index,
            error_map.box_index,
            travel_level_index,
            axis,
        ]
        - error_map.error_bound_now[axis],
        0.0,
    )


@kernel
def look_up_and_add_mapped_error(error_map, x, y, u, eta_bar):
    """Add to eta_bar (3,) rad/s2 the mapped error at this state; x (3,) rad/s, y, u (n,) rad."""
    look_up_error_map(error_map, x, y, u)
    for i in range(3):
        eta_bar[i] += error_map.error_bound_now[i]


@kernel
def add_published_bound(
    x, design, inertia_coupling_error_share, constant_error_bound, earth_rate_rad_s, eta_bar
):
    """Add to eta_bar (3,) rad/s2 the published bound, and what the Earth's rotation adds.

    Published: inertia_i |cross term_i| + constant_i [Zhang2005, sec. VII]. JSBSim integrates rates against
    inertial space and reports them against the Earth: the difference turns with the body, at no more than
    earth_rate_rad_s |x| on any axis, and the inertia coupling multiplies it by
    `max_inertia_coupling_factors`.
    """
    p, q, r = x[0], x[1], x[2]
    sum_of_rate_magnitudes = abs(p) + abs(q) + abs(r)
    max_roll_coupling_factor, max_pitch_coupling_factor, max_yaw_coupling_factor = (
        max_inertia_coupling_factors(design)
    )
    eta_bar[0] += (
        inertia_coupling_error_share[0] * abs(design.Pqr * q * r)
        + constant_error_bound[0]
        + earth_rotation_and_rounding_bound(
            earth_rate_rad_s, sum_of_rate_magnitudes, max_roll_coupling_factor
        )
    )
    eta_bar[1] += (
        inertia_coupling_error_share[1] * abs(design.Qpr * p * r)
        + constant_error_bound[1]
        + earth_rotation_and_rounding_bound(
            earth_rate_rad_s, sum_of_rate_magnitudes, max_pitch_coupling_factor
        )
    )
    eta_bar[2] += (
        inertia_coupling_error_share[2] * abs(design.Rpq * p * q)
        + constant_error_bound[2]
        + earth_rotation_and_rounding_bound(earth_rate_rad_s, sum_of_rate_magnitudes, max_yaw_coupling_factor)
    )


@kernel
def max_inertia_coupling_factors(design):
    """The largest factor by which the inertia coupling multiplies a product of two rates, on each axis; at
    least 1."""
    max_roll_coupling_factor = abs(design.Ppq) + abs(design.Pqr)
    max_yaw_coupling_factor = abs(design.Rpq) + abs(design.Rqr)
    max_pitch_coupling_factor = abs(design.Qpr) + 2.0 * max(abs(design.Qpp), abs(design.Qrr))
    return (
        max(max_roll_coupling_factor, 1.0),
        max(max_pitch_coupling_factor, 1.0),
        max(max_yaw_coupling_factor, 1.0),
    )


@kernel
def earth_rotation_and_rounding_bound(earth_rate_rad_s, sum_of_rate_magnitudes, max_coupling_factor):
    """Bound the angular acceleration on an axis by the Earth's rotation and by rounding, rad/s2;
    sum_of_rate_magnitudes: |p| + |q| + |r|, rad/s."""
    return (
        earth_rate_rad_s
        * ((1.0 + max_coupling_factor) * sum_of_rate_magnitudes + max_coupling_factor * earth_rate_rad_s)
        + ROUNDING_RAD_S2
    )


@kernel
def min_true_height_m(measured_altitude_m, error_bound_at_zero_m, error_bound_per_m):
    """The least true height, m. The error of `measured_altitude_m` is up to error_bound_at_zero_m +
    error_bound_per_m |truth|. The ground is at sea level; the model of turbulence has no height below
    LEAST_HEIGHT_M."""
    return max(
        measured_altitude_m
        - (error_bound_at_zero_m + error_bound_per_m * abs(measured_altitude_m)) / (1.0 - error_bound_per_m),
        LEAST_HEIGHT_M,
    )


@kernel
def set_air_rotation_bound(declared_errors, measured_altitude_m):
    """Set the bound on the air's rotation, rad/s, for this altitude."""
    if declared_errors.air_rotation_bound_at_1_m > 0.0:
        min_height_m = min_true_height_m(
            measured_altitude_m,
            declared_errors.altitude_error_bound_at_zero_m,
            declared_errors.altitude_error_bound_per_m,
        )
        declared_errors.air_rotation_bound[:] = max(
            declared_errors.air_rotation_bound_aloft,
            declared_errors.air_rotation_bound_at_1_m / np.sqrt(min_height_m),
        )


@kernel
def fill_uncertainty_bound_now(bound_record, design, measured, u):
    """Fill eta_bar_now (3,) rad/s2, the bound on the uncertainty at this instant; u (n,) rad."""
    x, y = measured.x, measured.y
    bound_record.eta_bar_now[:] = 0.0
    if bound_record.declared_errors.has_declared_errors:
        set_air_rotation_bound(bound_record.declared_errors, measured.altitude)
        fill_magnitudes_and_add_declared_bound(
            bound_record.declared_errors, design, x, y, u, bound_record.eta_bar_now
        )
        if bound_record.has_surface_term_errors:
            for s in range(u.size):
                fill_acceleration_error_bound_per_rad(bound_record.declared_errors, design, s)
    if bound_record.error_map.n_boxes > 0:
        look_up_and_add_mapped_error(bound_record.error_map, x, y, u, bound_record.eta_bar_now)
    rates_for_published_bound = (
        bound_record.declared_errors.max_magnitude_x
        if bound_record.declared_errors.has_declared_errors
        else x
    )
    add_published_bound(
        rates_for_published_bound,
        design,
        bound_record.inertia_coupling_error_share,
        bound_record.constant_error_bound,
        bound_record.earth_rate_rad_s,
        bound_record.eta_bar_now,
    )


GUST_LIMIT_SIGMA = 6.0  # exceeded once in 5e8 independent samples
_INERTIA_NAMES = ("Ix_kg_m2", "Iy_kg_m2", "Iz_kg_m2", "Jxz_kg_m2")
POLE_DESIGN_DELAYS_S = (0.1, 0.5, 2.0)  # within which a pole of the bank finds the smallest fault


@lru_cache(maxsize=64)
def max_inertia_coefficient_errors(
    relative_inertia_tolerance: float, mass_properties: MassProperties
) -> np.ndarray:
    """Largest change of the twelve inertia coefficients for every inertia within its tolerance.

    Each coefficient is monotonic in each inertia while the others are constant, so the largest change is at a
    corner.
    """
    nominal_coefficients = np.array(inertia_coefficients(mass_properties))
    max_coefficient_changes = np.zeros(12)
    for signs in product((-1.0, 1.0), repeat=4):
        changed_inertias = {
            inertia_name: getattr(mass_properties, inertia_name) * (1 + relative_inertia_tolerance * sign)
            for inertia_name, sign in zip(_INERTIA_NAMES, signs, strict=True)
        }
        changed_coefficients = np.array(inertia_coefficients(replace(mass_properties, **changed_inertias)))
        max_coefficient_changes = np.maximum(
            max_coefficient_changes, np.abs(changed_coefficients - nominal_coefficients)
        )
    max_coefficient_changes.flags.writeable = False  # kept: the same for every flight of a design
    return max_coefficient_changes


def configure_uncertainty_bound(bound_record: np.void, declared: Declared, design: np.void) -> None:
    """Fill in the declared bound and the error of the aircraft's design model: its map, or else one constant
    for all states. design: record of the design model."""
    fdi_config, aircraft = declared.fdi, declared.aircraft
    bound_record["inertia_coupling_error_share"], bound_record["earth_rate_rad_s"] = (
        declared.coupling,
        EARTH_RATE_RAD_S,
    )
    bound_record["constant_error_bound"] = declared.constant_rad_s2
    diagnoses_all_types = fdi_config.fault_class == "all"
    fill_error_map(
        bound_record["error_map"],
        aircraft,
        diagnoses_all_types,
        diagnoses_all_types and fdi_config.pairs,
    )
    if aircraft.file.model_error_map is None:
        bound_record["constant_error_bound"] += aircraft.model_error_rad_s2
    declared_errors = bound_record["declared_errors"]
    fill_declared_errors(declared_errors, declared, design, mass_of(declared.design_model, aircraft))
    fill_declared_engine_instrument_errors(declared_errors, declared)
    bound_record["has_surface_term_errors"] = declared_errors["has_declared_errors"] and diagnoses_all_types


def fill_declared_errors(
    declared_errors: np.void, declared: Declared, design: np.void, mass_properties: MassProperties
) -> None:
    """Fill the declared errors; design, mass_properties: record and mass properties of the design model."""
    coefficient_error_bounds = declared.coefficients.absolute(
        declared.aircraft.moments, design["moments"]["value"]
    )
    declared_errors["coefficient_tolerance"][: coefficient_error_bounds.size] = coefficient_error_bounds
    declared_errors["inertia_coefficient_tolerance"] = max_inertia_coefficient_errors(
        declared.inertia, mass_properties
    )
    declared_errors["deflection_error_bound"] = declared.deflection_rad
    sensor_errors, turbulence, span_m = declared.sensors, declared.air, declared.aircraft.geometry.span_m
    declared_errors["air_rotation_bound_aloft"] = GUST_LIMIT_SIGMA * turbulence.rotation_limit_rad_s(span_m)
    declared_errors["air_rotation_bound_at_1_m"] = GUST_LIMIT_SIGMA * turbulence.low_rotation_limit_rad_s(
        span_m
    )
    declared_errors["air_rotation_bound"] = declared_errors["air_rotation_bound_aloft"]
    declared_errors["altitude_error_bound_at_zero_m"] = sensor_errors["altitude"].worst
    declared_errors["altitude_error_bound_per_m"] = sensor_errors["altitude"].slope
    declared_errors["signal_error_bound_at_zero"] = sensor_errors.each("worst")
    declared_errors["signal_error_bound_per_unit"] = sensor_errors.each("slope")
    declared_errors["constant_gyro_error_bound"] = sensor_errors.each("steady", AXES)
    non_sensor_error_bounds = (
        declared_errors["coefficient_tolerance"],
        declared_errors["inertia_coefficient_tolerance"],
        declared_errors["deflection_error_bound"],
        declared_errors["air_rotation_bound"],
    )
    declared_errors["has_declared_errors"] = (
        any(np.any(bounds_of_one_source) for bounds_of_one_source in non_sensor_error_bounds)
        or not sensor_errors.is_ideal
    )


def fill_declared_engine_instrument_errors(declared_errors: np.void, declared: Declared) -> None:
    """Fill in the errors of dpt if errors are declared of an instrument from which dpt is computed.

    The engine may have any setting between the initial one and its highest manifold pressure.
    """
    sensor_errors = declared.sensors
    has_instrument_errors = any(
        not getattr(sensor_errors.declared, instrument_name).is_ideal for instrument_name in OF_THE_SLIPSTREAM
    )
    if not (has_instrument_errors and declared.aircraft.has_engine_instruments):
        return
    initial_condition: Any = declared.initial
    max_manifold_pressure = declared.aircraft.engine.settings["manifold_pressure_inhg"].range[1]
    max_readings = dict(zip(ENGINE, (initial_condition.engine_rpm, max_manifold_pressure), strict=True))
    reading_error_bounds = [
        sensor_errors[instrument_name].of_reading(max_reading)
        for instrument_name, max_reading in max_readings.items()
    ]
    declared_errors["has_engine_instrument_errors"] = 1
    declared_errors["power_error_kw_by_instruments"], declared_errors["power_error_kw_per_density_ratio"] = (
        power_error_kw(initial_condition.engine_rpm, max_manifold_pressure, *reading_error_bounds)
    )


def detection_poles_for_delays(
    sensor_errors: SensorErrors, max_constant_error_bound_rad_s2: float
) -> tuple[float, ...]:
    """Poles (1/s) that find the smallest constant fault phi within each of POLE_DESIGN_DELAYS_S, despite gyro
    noise.

    After T the residual is phi (1 - exp(-lam T)) / lam, its bound at most eta_bar / lam + 2 nbar. The excess
    of one over the other is greatest at lam = ln(phi T / (2 nbar)) / T; the smallest phi with any follows.
    """
    gyro_error_change_bound = 2 * NOISE_LIMIT_SIGMA * float(sensor_errors.each("noise", AXES).max())
    return (
        tuple(
            _detection_pole_per_s(delay_s, gyro_error_change_bound, max_constant_error_bound_rad_s2)
            for delay_s in POLE_DESIGN_DELAYS_S
        )
        if gyro_error_change_bound > 0
        else ()
    )


def _detection_pole_per_s(delay_s: float, gyro_error_change_bound: float, eta_bar: float) -> float:
    smallest_fault_rad_s2 = eta_bar + 8.0 * gyro_error_change_bound / delay_s
    for _ in range(50):
        pole_per_s = max(
            log(smallest_fault_rad_s2 * delay_s / gyro_error_change_bound) / delay_s, 0.1 / delay_s
        )
        smallest_fault_rad_s2 = (gyro_error_change_bound * pole_per_s + eta_bar) / (
            1.0 - exp(-pole_per_s * delay_s)
        )
    return pole_per_s


_GYRO_NAME_BY_RATE_SIGNAL = dict(zip(RATE_SIGNALS, AXES, strict=True))


def declared_errors_for_plugin(
    declared: Declared, design: np.ndarray, y: np.ndarray, u: np.ndarray
) -> "DeclaredErrors":
    """Return the declared errors for a plug-in, at the trim y and u rad; design: record of the design model,
    (1,)."""
    from beaver_ftc.design.context import DeclaredErrors  # for plug-ins alone

    aircraft, sensor_errors, servos = declared.aircraft, declared.sensors, declared.servos
    reading_noise_std, reading_bias, reading_resolution = (
        sensor_errors.each(error_attribute_name) for error_attribute_name in ("noise", "steady", "resolution")
    )
    coefficient_errors = declared.coefficients.absolute(aircraft.moments, design["moments"]["value"][0])
    gust_rotation_std_rad_s, gust_correlation_time_s = declared.air.rotation(
        float(y[2]), aircraft.geometry.span_m
    )
    air_data_error_std = np.sqrt(reading_noise_std**2 + reading_bias**2 + reading_resolution**2 / 12.0)[
        _FIRST_AIR_DATA_SIGNAL_INDEX:
    ]
    deflection_error_rad = declared.deflection_rad
    return DeclaredErrors(
        noise=reading_noise_std,
        bias=reading_bias,
        resolution=reading_resolution,
        slope=sensor_errors.each("slope"),
        **{
            f"further_{name}": sensor_errors.each("steady" if name == "bias" else name, _FURTHER_READINGS)
            for name in ("noise", "bias", "resolution", "slope")
        },
        gust_rad_s=gust_rotation_std_rad_s,
        gust_time_s=gust_correlation_time_s,
        gust_effect=acceleration_per_air_rotation(DesignFunctions(design.copy()), y),
        coefficients=coefficient_errors,
        inertia=declared.inertia,
        deflection_rad=deflection_error_rad,
        model_rad_s2=model_error_std(
            design, y, u, air_data_error_std, coefficient_errors, deflection_error_rad
        ),
        bandwidth_rad_s=np.array([getattr(servos, s).bandwidth_rad_s for s in aircraft.surfaces]),
        rate_limit_rad_s=np.radians([getattr(servos, s).rate_limit_deg_s for s in aircraft.surfaces]),
    )


def acceleration_per_air_rotation(model: DesignFunctions, y: np.ndarray) -> np.ndarray:
    """Angular acceleration of an aircraft at rest in air that rotates, (3, 3) 1/s: -df/dx without rates."""
    rate_step_rad_s = 1e-4
    derivative_columns = [
        (model.f(rate_step_rad_s * e, y) - model.f(-rate_step_rad_s * e, y)) / (2.0 * rate_step_rad_s)
        for e in np.eye(3)
    ]
    return -np.column_stack(derivative_columns)


def model_error_std(
    design: np.ndarray,
    y: np.ndarray,
    u: np.ndarray,
    air_data_error_std: np.ndarray,
    coefficient_errors: np.ndarray,
    deflection_error_rad: float,
) -> np.ndarray:
    """Standard deviation (3,) rad/s2 of f + G u at y and u, all errors independent.

    air_data_error_std (4,): errors of alpha, beta, airspeed, dynamic pressure. coefficient_errors: absolute.
    """
    nominal_acceleration = _design_acceleration_at_zero_rates(design, y, u)
    air_data_error_vectors = np.pad(
        np.diag(air_data_error_std), ((0, 0), (0, y.size - air_data_error_std.size))
    )
    acceleration_deviations = [
        _design_acceleration_at_zero_rates(design, y + air_data_error_vector, u) - nominal_acceleration
        for air_data_error_vector in air_data_error_vectors
    ]
    acceleration_deviations += [
        _design_acceleration_at_zero_rates(design, y, u + deflection_error_rad * e) - nominal_acceleration
        for e in np.eye(u.size)
    ]
    for term_index in np.flatnonzero(coefficient_errors):
        changed_design = design.copy()
        changed_design["moments"]["value"][0][term_index] += coefficient_errors[term_index]
        acceleration_deviations.append(
            _design_acceleration_at_zero_rates(changed_design, y, u) - nominal_acceleration
        )
    return np.sqrt(np.square(acceleration_deviations).sum(axis=0))


def _design_acceleration_at_zero_rates(design: np.ndarray, y: np.ndarray, u: np.ndarray) -> np.ndarray:
    model = DesignFunctions(design)
    return model.f(np.zeros(3), y) + model.G(y) @ u


def flow_angle_in_level_axes_noise_std(sensor_errors: SensorErrors, airspeed_mps: float) -> np.ndarray:
    """Standard deviation (2,) rad of the noise of the flow's angles in level axes, computed from vanes,
    airspeed and attitude. An error of pitch attitude or heading turns the flow as much as an error of a
    vane."""
    max_attitude_and_flow_angle_rad = 0.3  # attitudes and incidences of up to 17 deg
    vane_attitude_pairs = (("alpha", "theta"), ("beta", "psi"))
    vane_and_attitude_noise_std = [
        hypot(sensor_errors[vane_name].random, sensor_errors[attitude_angle_name].random)
        for vane_name, attitude_angle_name in vane_attitude_pairs
    ]
    return np.array(vane_and_attitude_noise_std) + max_attitude_and_flow_angle_rad * (
        sensor_errors["V"].random / airspeed_mps + sensor_errors["phi"].random
    )


def angular_acceleration_by_gust_noise_std(
    flow_angle_noise_std: np.ndarray, design: np.void, y: np.ndarray, u: np.ndarray, span_m: float
) -> np.ndarray:
    """Standard deviation (3,) rad/s2 of the estimated effect of a gust, by the noise (2,) rad of the flow's
    angles."""
    V = y[AIRSPEED]
    pitching_gust_noise_std, yawing_gust_noise_std = (
        flow_angle_noise_std * pi * V / (np.array([4.0, 3.0]) * span_m)
    )
    # without rates all of it is aerodynamic
    acceleration_per_body_rate = jacobian(design, np.zeros(3), y, u)[2]
    return np.sqrt(
        (acceleration_per_body_rate[:, 1] * pitching_gust_noise_std) ** 2
        + (acceleration_per_body_rate[:, 2] * yawing_gust_noise_std) ** 2
    )


def moment_axis_of_term(term: Term) -> int:
    """The axis of the moment to which a term belongs."""
    return MOMENTS.index(term.coefficient)


def equivalent_coefficient_error_bounds(
    declared: Declared, design: np.void, mass_properties: MassProperties, y: np.ndarray, u: np.ndarray
) -> np.ndarray:
    """Tolerance of each moment's term that covers every declared constant error but those of the air data
    (statistical.py); y, u in trim."""
    aircraft, sensor_errors = declared.aircraft, declared.sensors
    coefficient_magnitudes = np.abs(design["moments"]["value"][: len(aircraft.moments)])
    inertia_coefficient_errors = max_inertia_coefficient_errors(declared.inertia, mass_properties)
    nominal_inertia_coefficient_magnitudes = np.abs(inertia_coefficients(mass_properties))
    own_axis_inertia_coefficient_indices = (2, 7, 11)  # what multiplies a moment there
    relative_errors_except_coefficient = np.full(
        coefficient_magnitudes.shape,
        max(
            inertia_coefficient_errors[i] / nominal_inertia_coefficient_magnitudes[i]
            for i in own_axis_inertia_coefficient_indices
        ),
    )
    relative_errors_except_coefficient += [
        _relative_signal_error_of_term(sensor_errors, term) for term in aircraft.moments
    ]
    equivalent_error_bounds = (
        declared.coefficients.absolute(aircraft.moments, coefficient_magnitudes)
        + relative_errors_except_coefficient * coefficient_magnitudes
    )
    coefficient_slope_magnitudes = np.abs(coefficient_slopes(design, np.zeros(3), y, u))
    span_m, chord_m = aircraft.geometry.span_m, aircraft.geometry.chord_m
    for gyro_name, signal_index, rate_normalisation_length_m in zip(
        AXES, (PH, QH, RH), (span_m / 2, chord_m, span_m / 2), strict=True
    ):
        normalised_rate_error = sensor_errors[gyro_name].steady * rate_normalisation_length_m / y[AIRSPEED]
        for k, term in enumerate(aircraft.moments):
            if term.is_constant:
                equivalent_error_bounds[k] += (
                    normalised_rate_error
                    * coefficient_slope_magnitudes[moment_axis_of_term(term), signal_index]
                )
    return equivalent_error_bounds


def _relative_signal_error_of_term(sensor_errors: SensorErrors, term: Term) -> float:
    """Relative error of the signals that a term multiplies, by the slopes of gyros, vanes, airspeed and
    pressure."""
    own_gyro_name = AXES[moment_axis_of_term(term)]  # a slope of it is counted once for all terms of the axis
    relative_error = sensor_errors[own_gyro_name].slope + sensor_errors["qdyn"].slope
    for signal_name, exponent in term.of:
        if signal_name in _GYRO_NAME_BY_RATE_SIGNAL:
            relative_error += exponent * sensor_errors["V"].slope
        signal_errors = sensor_errors.get(_GYRO_NAME_BY_RATE_SIGNAL.get(signal_name, signal_name))
        if signal_errors is not None and _GYRO_NAME_BY_RATE_SIGNAL.get(signal_name) != own_gyro_name:
            relative_error += exponent * signal_errors.slope
    return relative_error
