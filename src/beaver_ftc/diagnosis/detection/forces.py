"""Innovations of the side force and the normal force from accelerometers, as an addition to the rates.

Elevator and flap both pitch the aircraft, so the rates alone do not separate their faults. Their forces do.
The innovation of a force, i = Y (side) or Z (normal), is scaled as if the force acted at the chord c, m:

    e_i = (a_i - qdyn S C_i / m) / c       rad/s2

a_i, m/s2, is the reading; qdyn, Pa, the dynamic pressure; S, m2, the wing area; m, kg, the mass; C_i the
model's coefficient at the measured flow and the commanded surfaces. A fault of a surface changes e_i and the
angular acceleration in the ratio of the surface's terms. An error of a vane changes both in another ratio.
Terms of forces have the same declared tolerance as those of moments, and the whole force has that of the
mass. Noise of the accelerometers is model noise; their declared bias and slope are tolerated constants.

The side force has a term in the rate of sideslip. It is worked out from the accelerometers. JSBSim uses the
rate of the run before.
"""

import numpy as np

from beaver_ftc.aircraft import AXES, Aircraft, Term
from beaver_ftc.aircraft.aircraft import EARTH_RATE_RAD_S, FORCES
from beaver_ftc.aircraft.schema import MAX_SURFACES, MAX_TERMS_OF_ONE, SIDESLIP_RATE
from beaver_ftc.compiled import kernel, record
from beaver_ftc.design.model import AIRSPEED, ALPHA, BETA, DPT, N_Y, QDYN, evaluate, slipstream_slopes
from beaver_ftc.diagnosis.gusts import stop_gust_estimate, stop_using_accelerometers
from beaver_ftc.diagnosis.monitors.redundancy import EARTH_ACCELERATION_BOUND_M_S2
from beaver_ftc.plant.instruments import NOISE_LIMIT_SIGMA
from beaver_ftc.scenario.declared import MASS_TOLERANCE, Declared, SensorErrors
from beaver_ftc.scenario.sensors import ACCELEROMETERS

SIDE_INDEX_AMONG_FORCES, NORMAL_INDEX_AMONG_FORCES = range(2)  # across the body, and normal to it
FORCE_COEFFICIENT_NAMES = ("CY", "CZ")
SIDE_FORCE_INDEX_IN_TABLE = FORCES.index("CY")
TYPICAL_BODY_RATE_RAD_S, TYPICAL_PATH_SLOPE_RAD = 0.2, 0.3  # typical rates and path slope, for the drift
MIN_FORCE_UPDATES = 2  # from the second one on the rate of sideslip of the run before is known
# Time between force and flow of one instant in JSBSim, at most; 0.001 was measured.
MAX_LAG_BETWEEN_FORCE_AND_FLOW_S = 0.002
FLOW_ANGLE_DRIFT_CHANGE_SHARE_PER_S = 0.3  # share of a drift that may change within a second
SIDESLIP_RATE_TERM_TOLERANCE_BY_WHETHER_AIR_MOVES = {
    False: 0.05,
    True: 0.2,
}  # of the term in the rate of sideslip: gusts have a part in it
# The rate of sideslip, the bias of the accelerometer and the force as a whole come last.
MAX_FORCE_REGRESSORS = MAX_TERMS_OF_ONE + 3

RatesReadingsDeflections = tuple[np.ndarray, np.ndarray, np.ndarray]  # x (3,) rad/s, y and u rad

FORCE_RECORD = record(
    innovation=float,  # e at the start of the elapsed frame, rad/s2
    # e at the flow angle from inertial motion; that angle, rad; bound on its drift, rad/s; integral of the
    # force's slope, e per rad/s of drift; intensity of the drift of e by errors and gusts, (rad/s2)2/s
    innovation_at_inertial_flow_angle=float, inertial_flow_angle=float, flow_angle_drift_bound=float,
    innovation_per_flow_angle_drift=float, inertial_innovation_drift_intensity=float,
    # of each surface: e per rad, now and with the readings before; e at the command; error of e per rad
    specific_force_over_chord_per_surface_rad=MAX_SURFACES,
    previous_specific_force_over_chord_per_surface_rad=MAX_SURFACES,
    specific_force_over_chord_of_surface_at_command=MAX_SURFACES,
    specific_force_over_chord_per_surface_rad_error_bound=MAX_SURFACES,
    # of an error of the vane, per rad: angular acceleration and e, angular acceleration in roll
    axis_and_force_innovation_per_vane_error=2, roll_innovation_per_vane_error=float,
    # variance of e in trim and now: with the vane, without it; (rad/s2)2
    trim_noise_variance_with_without_vane=2, noise_variance_with_without_vane=2,
    # e per rad/s of rotation of the air; bound on e by errors of deflections
    innovation_per_air_rotation=3, deflection_error_effect_bound=float,
    predicted_specific_force_over_chord=float,  # e of the model, rad/s2
    force_flow_lag_error_bound=float,  # bound on its error by a time lag, rad/s2
    # variance of e by noise of the accelerometer; independent of the pressure
    accelerometer_innovation_variance=float,
    n_regressors=int, regressor_tolerance=MAX_FORCE_REGRESSORS, regressor=MAX_FORCE_REGRESSORS,
)  # fmt: skip
MEASURED_FORCES_RECORD = record(
    in_use=int, inverse_chord_per_m=float,  # whether forces are used
    gravity=float, wing_span=float,  # m/s2; m
    trim_dynamic_pressure=float, dynamic_pressure_noise_std=float,  # Pa
    dynamic_pressure_over_trim=float,  # forces scale with it
    # coefficient of the rate of sideslip; rates of sideslip and incidence of the instant before, rad/s
    sideslip_rate_coefficient=float, flow_angle_rate=2,
    n_updates_capped_at_minimum=int,  # updates so far, up to MIN_FORCE_UPDATES
    angular_acceleration_by_gust_noise_std=3,  # noise of the gust estimate from forces, rad/s2
    y_without_vanes=N_Y, component=(FORCE_RECORD, 2),
)  # fmt: skip


@kernel
def update_all_force_innovations(forces, gust, measured_signals, u, dt):
    """Update the innovations of the forces at this instant, dt s after the last; u (n,) rad: surfaces.

    At the first instant the rate of sideslip of the run before is not known; that of this instant is used.
    """
    if forces.n_updates_capped_at_minimum == 0:
        fill_flow_angle_rates(forces, measured_signals)
    evaluate(gust.memory.force_table, measured_signals.x, measured_signals.y)
    forces.dynamic_pressure_over_trim = measured_signals.y[QDYN] / forces.trim_dynamic_pressure
    for force_index in range(2):
        previous_predicted_specific_force_over_chord = forces.component[
            force_index
        ].predicted_specific_force_over_chord
        update_force_innovation_and_regressors(forces, gust, force_index, measured_signals, u)
        fill_force_flow_lag_error_bound(
            forces.component[force_index],
            previous_predicted_specific_force_over_chord,
            forces.n_updates_capped_at_minimum,
            dt,
        )
        update_inertial_flow_angle_and_force_innovation(
            forces, forces.component[force_index], force_index, measured_signals.y, dt
        )
    fill_flow_angle_rates(forces, measured_signals)
    forces.n_updates_capped_at_minimum = min(forces.n_updates_capped_at_minimum + 1, MIN_FORCE_UPDATES)


@kernel
def fill_force_flow_lag_error_bound(
    force_record, previous_predicted_specific_force_over_chord, has_earlier_update, dt
):
    """Fill `force_flow_lag_error_bound` from the change of the model's e since
    `previous_predicted_specific_force_over_chord`: force and flow differ in time."""
    force_record.force_flow_lag_error_bound = (
        MAX_LAG_BETWEEN_FORCE_AND_FLOW_S
        * abs(force_record.predicted_specific_force_over_chord - previous_predicted_specific_force_over_chord)
        / dt
        if has_earlier_update
        else 0.0
    )


@kernel
def fill_y_without_vanes(forces, air_rotation, y):
    """Fill `y` with the readings y, but alpha and beta worked out from the forces.

    air_rotation (3,) rad/s: of the air in body axes; it damps like the aircraft's own rotation.
    """
    forces.y_without_vanes[:] = y
    for force_index in range(2):
        force_record = forces.component[force_index]
        vane_index_in_y = BETA if force_index == SIDE_INDEX_AMONG_FORCES else ALPHA
        air_rotation_part_of_innovation = 0.0
        for k in range(3):
            air_rotation_part_of_innovation += force_record.innovation_per_air_rotation[k] * air_rotation[k]
        forces.y_without_vanes[vane_index_in_y] -= (
            force_record.innovation / forces.dynamic_pressure_over_trim + air_rotation_part_of_innovation
        ) / force_record.axis_and_force_innovation_per_vane_error[1]


@kernel
def stop_using_forces_and_accelerometers(forces, gust, inertial_gust):
    """Stop using forces, and estimate the gust without accelerometers."""
    stop_using_accelerometers(gust)
    stop_gust_estimate(inertial_gust)
    forces.in_use = 0


@kernel
def update_inertial_flow_angle_and_force_innovation(forces, force_record, force_index, y, dt):
    """Integrate the flow angle of a vane from inertial motion, and fill the force's innovation at it."""
    vane_angle = y[BETA if force_index == SIDE_INDEX_AMONG_FORCES else ALPHA]
    innovation_per_vane_rad = (
        force_record.axis_and_force_innovation_per_vane_error[1] * forces.dynamic_pressure_over_trim
    )
    force_record.inertial_flow_angle = (
        force_record.inertial_flow_angle + dt * forces.flow_angle_rate[force_index]
        if forces.n_updates_capped_at_minimum
        else vane_angle
    )
    force_record.innovation_per_flow_angle_drift += dt * innovation_per_vane_rad
    force_record.innovation_at_inertial_flow_angle = force_record.innovation - innovation_per_vane_rad * (
        vane_angle - force_record.inertial_flow_angle
    )


@kernel
def update_force_innovation_and_regressors(forces, gust, force_index, measured_signals, u):
    """Update one force: its innovation e, the effects of surfaces, and the regressors of its errors."""
    all_forces_term_table, force_record = gust.memory.force_table, forces.component[force_index]
    first_term_index = all_forces_term_table.free_from[SIDE_FORCE_INDEX_IN_TABLE + force_index]
    end_term_index = all_forces_term_table.surface_to[SIDE_FORCE_INDEX_IN_TABLE + force_index]
    specific_force_over_chord_per_coefficient = (
        measured_signals.y[QDYN] * gust.config.wing_area_per_mass * forces.inverse_chord_per_m
    )
    predicted_specific_force_over_chord = 0.0
    force_record.previous_specific_force_over_chord_per_surface_rad[:] = (
        force_record.specific_force_over_chord_per_surface_rad
    )
    force_record.specific_force_over_chord_per_surface_rad[:] = 0.0
    force_record.specific_force_over_chord_per_surface_rad_error_bound[:] = 0.0
    for k in range(first_term_index, end_term_index):
        s = all_forces_term_table.surface[k]
        term_regressor_per_unit_coefficient = (
            specific_force_over_chord_per_coefficient
            * all_forces_term_table.power[all_forces_term_table.monomial[k]]
        )
        if s >= 0:
            force_record.specific_force_over_chord_per_surface_rad[s] += (
                all_forces_term_table.value[k] * term_regressor_per_unit_coefficient
            )
            force_record.specific_force_over_chord_per_surface_rad_error_bound[s] += (
                force_record.regressor_tolerance[k - first_term_index]
                * abs(term_regressor_per_unit_coefficient)
            )
            term_regressor_per_unit_coefficient *= u[s]
        force_record.regressor[k - first_term_index] = term_regressor_per_unit_coefficient
        predicted_specific_force_over_chord += (
            all_forces_term_table.value[k] * term_regressor_per_unit_coefficient
        )
    if force_index == SIDE_INDEX_AMONG_FORCES:
        side_force_over_chord_due_to_sideslip_rate = (
            specific_force_over_chord_per_coefficient
            * forces.sideslip_rate_coefficient
            * forces.flow_angle_rate[SIDE_INDEX_AMONG_FORCES]
            * forces.wing_span
            / (2.0 * measured_signals.y[AIRSPEED])
        )
        force_record.regressor[end_term_index - first_term_index] = side_force_over_chord_due_to_sideslip_rate
        predicted_specific_force_over_chord += side_force_over_chord_due_to_sideslip_rate
    force_record.regressor[force_record.n_regressors - 1] = predicted_specific_force_over_chord
    force_record.predicted_specific_force_over_chord = predicted_specific_force_over_chord
    if forces.n_updates_capped_at_minimum == 0:
        force_record.previous_specific_force_over_chord_per_surface_rad[:] = (
            force_record.specific_force_over_chord_per_surface_rad
        )
    for s in range(u.size):
        force_record.specific_force_over_chord_of_surface_at_command[s] = (
            force_record.previous_specific_force_over_chord_per_surface_rad[s] * u[s]
        )
    force_record.innovation = (
        measured_signals.force[1 + force_index] * forces.inverse_chord_per_m
        - predicted_specific_force_over_chord
    )
    pressure_noise_innovation_std = (
        predicted_specific_force_over_chord * forces.dynamic_pressure_noise_std / measured_signals.y[QDYN]
    )
    for k in range(2):
        force_record.noise_variance_with_without_vane[k] = (
            force_record.trim_noise_variance_with_without_vane[k] * forces.dynamic_pressure_over_trim**2
            + pressure_noise_innovation_std * pressure_noise_innovation_std
            + force_record.accelerometer_innovation_variance
        )


@kernel
def fill_flow_angle_rates(forces, measured_signals):
    """Fill `flow_angle_rate` with d beta / dt and d alpha / dt in still air, rad/s.

    They follow from accelerometers, rates, attitude and flow.
    """
    gravity, x, specific_force = forces.gravity, measured_signals.x, measured_signals.force
    phi, theta = measured_signals.attitude[0], measured_signals.attitude[1]
    alpha, beta, V = measured_signals.y[ALPHA], measured_signals.y[BETA], measured_signals.y[AIRSPEED]
    unit_velocity_forward, unit_velocity_right = np.cos(alpha) * np.cos(beta), np.sin(beta)
    unit_velocity_down = np.sin(alpha) * np.cos(beta)
    forward_acceleration = specific_force[0] - gravity * np.sin(theta)
    right_acceleration = specific_force[1] + gravity * np.cos(theta) * np.sin(phi)
    down_acceleration = specific_force[2] + gravity * np.cos(theta) * np.cos(phi)
    airspeed_rate = (
        unit_velocity_forward * forward_acceleration
        + unit_velocity_right * right_acceleration
        + unit_velocity_down * down_acceleration
    )
    right_velocity_rate = right_acceleration + V * (x[0] * unit_velocity_down - x[2] * unit_velocity_forward)
    forces.flow_angle_rate[SIDE_INDEX_AMONG_FORCES] = (
        right_velocity_rate - airspeed_rate * unit_velocity_right
    ) / (V * np.cos(beta))
    forward_velocity_rate = forward_acceleration + V * (
        x[2] * unit_velocity_right - x[1] * unit_velocity_down
    )
    down_velocity_rate = down_acceleration + V * (x[1] * unit_velocity_forward - x[0] * unit_velocity_right)
    forces.flow_angle_rate[NORMAL_INDEX_AMONG_FORCES] = (
        down_velocity_rate * np.cos(alpha) - forward_velocity_rate * np.sin(alpha)
    ) / (V * np.cos(beta))


def terms_of_one_force(aircraft: Aircraft, force_index: int) -> list[Term]:
    """The terms of one direction, as `update_force_innovation_and_regressors` goes through them."""
    return [
        term
        for term in aircraft.measurable_forces
        if term.coefficient == FORCE_COEFFICIENT_NAMES[force_index]
    ]


def configure_forces(
    fdi: np.void,
    declared: Declared,
    trim: RatesReadingsDeflections,
    acceleration_slopes_by_air_data: np.ndarray,
    dt_s: float,
) -> None:
    """Fill the record of forces that are `known` from what is declared.

    acceleration_slopes_by_air_data (3, y.size): the slopes of the angular accelerations with y. dt_s: of a
    frame.
    """
    y = trim[1]
    statistical_record = fdi["statistical"]
    aircraft = declared.aircraft
    sensor_errors = declared.sensors
    forces, gust, geometry = statistical_record["forces"], statistical_record["gust"], aircraft.geometry
    forces["inverse_chord_per_m"], forces["gravity"] = 1.0 / geometry.chord_m, gust["config"]["gravity"]
    forces["trim_dynamic_pressure"] = y[QDYN]
    forces["dynamic_pressure_noise_std"] = sensor_errors["qdyn"].random
    side_force_sideslip_rate_coefficients = [
        t.value for t in aircraft.forces if t.coefficient == "CY" and t.of == ((SIDESLIP_RATE, 1),)
    ]
    forces["wing_span"] = geometry.span_m
    forces["sideslip_rate_coefficient"] = sum(side_force_sideslip_rate_coefficients)
    for force_index in range(2):
        _configure_force(fdi, declared, trim, acceleration_slopes_by_air_data, force_index, dt_s)


def _configure_force(
    fdi: np.void,
    declared: Declared,
    trim: RatesReadingsDeflections,
    acceleration_slopes_by_air_data: np.ndarray,
    force_index: int,
    dt_s: float,
) -> None:
    """Fill the record of one force; the arguments are those of `configure_forces`."""
    y, aircraft, sensor_errors = trim[1], declared.aircraft, declared.sensors
    forces, gust_config = fdi["statistical"]["forces"], fdi["statistical"]["gust"]["config"]
    force_record, terms = forces["component"][force_index], terms_of_one_force(aircraft, force_index)
    vane_index_in_y, axis = ((BETA, 2), (ALPHA, 1))[force_index]
    specific_force_over_chord_per_coefficient = (
        y[QDYN] * gust_config["wing_area_per_mass"] * forces["inverse_chord_per_m"]
    )
    specific_force_over_chord_slopes_with_slipstream = (
        specific_force_over_chord_per_coefficient
        * _force_coefficient_slopes(aircraft, FORCE_COEFFICIENT_NAMES[force_index], trim)
    )
    specific_force_over_chord_slopes = specific_force_over_chord_slopes_with_slipstream[:-1]
    force_record["axis_and_force_innovation_per_vane_error"] = (
        -acceleration_slopes_by_air_data[axis, vane_index_in_y],
        -specific_force_over_chord_slopes[vane_index_in_y],
    )
    force_record["roll_innovation_per_vane_error"] = -acceleration_slopes_by_air_data[0, vane_index_in_y]
    force_record["innovation_per_air_rotation"] = specific_force_over_chord_slopes[3:]
    force_record["trim_noise_variance_with_without_vane"] = _force_prediction_noise_variances(
        fdi, sensor_errors, y, specific_force_over_chord_slopes_with_slipstream, vane_index_in_y
    )
    accelerometer_noise_std = sensor_errors[ACCELEROMETERS[1 + force_index]].random
    force_record["accelerometer_innovation_variance"] = (
        forces["inverse_chord_per_m"] * accelerometer_noise_std
    ) ** 2
    _configure_force_regressors_and_tolerances(
        force_record,
        declared,
        terms,
        y,
        specific_force_over_chord_slopes[vane_index_in_y] / specific_force_over_chord_per_coefficient,
        force_index,
        forces["inverse_chord_per_m"],
    )
    max_specific_force_over_chord_per_deflection_rad = specific_force_over_chord_per_coefficient * sum(
        abs(term.value) for term in terms if term.surface
    )
    force_record["deflection_error_effect_bound"] = (
        max_specific_force_over_chord_per_deflection_rad * declared.deflection_rad
    )
    force_record["flow_angle_drift_bound"] = _flow_angle_drift_rate_bound(
        sensor_errors, gust_config["gravity"], y[AIRSPEED], force_index
    )
    flow_angle_drift_intensity = (
        FLOW_ANGLE_DRIFT_CHANGE_SHARE_PER_S * force_record["flow_angle_drift_bound"]
    ) ** 2 + dt_s * (accelerometer_noise_std / y[AIRSPEED]) ** 2
    force_record["inertial_innovation_drift_intensity"] = specific_force_over_chord_slopes[
        vane_index_in_y
    ] ** 2 * (flow_angle_drift_intensity + declared.air.angle_walk(y[AIRSPEED]))


def _force_prediction_noise_variances(
    fdi: np.void,
    sensor_errors: SensorErrors,
    y: np.ndarray,
    specific_force_over_chord_slopes_with_slipstream: np.ndarray,
    vane_index_in_y: int,
) -> tuple[float, float]:
    """Variance of a predicted force by the noise of all readings, and without that of its vane."""
    specific_force_over_chord_slopes = specific_force_over_chord_slopes_with_slipstream[:-1].copy()
    specific_force_over_chord_per_slipstream = specific_force_over_chord_slopes_with_slipstream[-1]
    slipstream_slope_per_airspeed, slipstream_variance_from_other_readings = (
        _slipstream_slope_and_noise_variance(y, fdi["bound"]["declared_errors"], sensor_errors)
    )
    specific_force_over_chord_slopes[AIRSPEED] += (
        specific_force_over_chord_per_slipstream * slipstream_slope_per_airspeed
    )
    innovation_variance_by_reading = (
        specific_force_over_chord_slopes * sensor_errors.each("random", ("alpha", "beta", "V", *AXES))
    ) ** 2
    total_variance = (
        innovation_variance_by_reading.sum()
        + specific_force_over_chord_per_slipstream**2 * slipstream_variance_from_other_readings
    )
    return total_variance, total_variance - innovation_variance_by_reading[vane_index_in_y]


def _slipstream_slope_and_noise_variance(
    y: np.ndarray, declared_errors: np.void, sensor_errors: SensorErrors
) -> tuple[float, float]:
    """How dpt moves with the reading of the airspeed, s/m; its variance by those of pressure and power."""
    if not declared_errors["has_engine_instrument_errors"]:
        return 0.0, 0.0
    slipstream_slope_per_airspeed, slipstream_per_pressure, slipstream_slope_per_kw = slipstream_slopes(
        y, declared_errors["power_error_kw_per_density_ratio"]
    )
    power_noise_kw = declared_errors["power_error_kw_by_instruments"] / NOISE_LIMIT_SIGMA
    return slipstream_slope_per_airspeed, float(
        (slipstream_per_pressure * sensor_errors["qdyn"].random) ** 2
        + (slipstream_slope_per_kw * power_noise_kw) ** 2
    )


def _flow_angle_drift_rate_bound(
    sensor_errors: SensorErrors, gravity: float, airspeed_mps: float, force_index: int
) -> float:
    """Bound the drift of the flow angle from inertial motion, rad/s. Gravity acts along the path's slope only
    on the incidence, and in full on sideslip."""
    attitude_error_bound = sensor_errors["phi"].steady + sensor_errors["theta"].steady
    gyro_error_bound = sum(
        sensor_errors[gyro_name].steady + TYPICAL_BODY_RATE_RAD_S * sensor_errors[gyro_name].slope
        for gyro_name in AXES
    )
    # how far accelerometers can be off across the flow in level flight: that of the axis, and of the one
    # ahead as much as the flow's angle lets it
    accelerometer_errors = sensor_errors[ACCELEROMETERS[1 + force_index]]
    accelerometer_error_bound = (
        accelerometer_errors.steady
        + TYPICAL_PATH_SLOPE_RAD * sensor_errors["ax"].steady
        + gravity * (accelerometer_errors.slope if force_index == NORMAL_INDEX_AMONG_FORCES else 0.0)
    )
    acceleration_error_bound = (
        gravity
        * attitude_error_bound
        * (TYPICAL_PATH_SLOPE_RAD if force_index == NORMAL_INDEX_AMONG_FORCES else 1.0)
        + EARTH_ACCELERATION_BOUND_M_S2
        + accelerometer_error_bound
    )
    return float(EARTH_RATE_RAD_S + gyro_error_bound + acceleration_error_bound / airspeed_mps)


def _configure_force_regressors_and_tolerances(
    force_record: np.void,
    declared: Declared,
    terms: list[Term],
    y: np.ndarray,
    coefficient_per_vane_rad: float,
    force_index: int,
    inverse_chord_per_m: float,
) -> None:
    """Fill the tolerances of each term: that of the coefficients, and what constant errors of vane and
    pressure do; of the accelerometer's bias, m/s2; of the whole."""
    relative_coefficient_tolerance, sensor_errors = declared.coefficients.largest, declared.sensors
    declared_errors_of_vane = sensor_errors["alpha" if force_index == NORMAL_INDEX_AMONG_FORCES else "beta"]
    accelerometer_errors = sensor_errors[ACCELEROMETERS[1 + force_index]]
    relative_pressure_error_bound = sensor_errors["qdyn"].steady / y[QDYN] + sensor_errors["qdyn"].slope
    for k, term in enumerate(terms):
        force_record["regressor_tolerance"][k] = (
            relative_coefficient_tolerance + relative_pressure_error_bound + declared_errors_of_vane.slope
        ) * abs(term.value)
        if term.is_constant:
            force_record["regressor_tolerance"][k] += declared_errors_of_vane.steady * abs(
                coefficient_per_vane_rad
            )
    n_regressors_so_far = len(terms)
    if force_index == SIDE_INDEX_AMONG_FORCES:
        force_record["regressor_tolerance"][n_regressors_so_far] = (
            relative_coefficient_tolerance
            + SIDESLIP_RATE_TERM_TOLERANCE_BY_WHETHER_AIR_MOVES[declared.air.moves]
        )
        n_regressors_so_far = n_regressors_so_far + 1
    if accelerometer_errors.steady:
        force_record["regressor_tolerance"][n_regressors_so_far] = accelerometer_errors.steady
        force_record["regressor"][n_regressors_so_far] = inverse_chord_per_m
        n_regressors_so_far = n_regressors_so_far + 1
    force_record["regressor_tolerance"][n_regressors_so_far] = MASS_TOLERANCE + accelerometer_errors.slope
    force_record["n_regressors"] = n_regressors_so_far + 1


def _force_coefficient(
    aircraft: Aircraft, coefficient_name: str, flight_state: RatesReadingsDeflections
) -> float:
    """A force coefficient at x (3,) rad/s, y, u rad."""
    x, y, u = flight_state
    geometry, V = aircraft.geometry, y[AIRSPEED]
    normalised_rates = x * (geometry.span_m / (2.0 * V), geometry.chord_m / V, geometry.span_m / (2.0 * V))
    value_by_factor_name = dict(zip(aircraft.surfaces, u, strict=True)) | dict(
        zip(aircraft.signals, y[4:], strict=True)
    )
    value_by_factor_name |= dict(
        zip(
            ("alpha", "beta", "ph", "qh", "rh", SIDESLIP_RATE),
            (y[0], y[1], *normalised_rates, 0.0),
            strict=True,
        )
    )
    return float(aircraft.coefficient(coefficient_name, value_by_factor_name))


def _force_coefficient_slopes(
    aircraft: Aircraft, coefficient_name: str, trim: RatesReadingsDeflections
) -> np.ndarray:
    """(7,): its derivatives with alpha, beta (1/rad), airspeed (s/m), rates (s/rad), dpt, by differences."""
    (x, y, u), difference_step = trim, 1e-5
    changed_states = [(x, y + difference_step * e, u) for e in np.eye(3, y.size)]
    changed_states += [(x + difference_step * e, y, u) for e in np.eye(3)]
    changed_states += [(x, y + difference_step * (np.arange(y.size) == DPT), u)]
    trim_coefficient = _force_coefficient(aircraft, coefficient_name, trim)
    return np.array(
        [
            (_force_coefficient(aircraft, coefficient_name, state) - trim_coefficient) / difference_step
            for state in changed_states
        ]
    )
