"""The statistical detector: likelihood-ratio tests on the whitened innovation (likelihood.py, parity.py).

Pitch is one block; roll and yaw, whose noise is correlated, are another. Roll and yaw have two blocks with
different models of the drift. A random walk reacts fast and ignores constant errors. A drift that returns to
zero gathers evidence for longer. Pitch has only the latter if no vane measures its gust. The worst-case
scheme needs no probability; the scenario's `fdi.authority` sets whose alarms and exclusions count.

The noise model follows from what a scenario declares, and the declared rate of false alarms holds for the
declared noise. An error e of an air-data reading changes f + G u by e times its derivative with that reading,
to first order. The derivative depends on the flight condition and is evaluated in flight. A steady error is a
constant times a known regressor, like an error of a coefficient; noise is model noise. dpt is worked out from
the engine's power, airspeed and dynamic pressure, so it has their errors.
"""

from collections.abc import Iterator
from math import exp, hypot, sqrt
from statistics import NormalDist
from sys import float_info

import numpy as np

from beaver_ftc.aircraft import AXES, Aircraft, MassProperties
from beaver_ftc.aircraft.schema import MAX_MONOMIALS, MAX_TERMS
from beaver_ftc.compiled import kernel, record, sized
from beaver_ftc.design import rotation_lengths
from beaver_ftc.design.model import (
    AIRSPEED,
    ALPHA,
    BETA,
    N_SIGNALS,
    PH,
    QDYN,
    RH,
    directional,
    evaluate,
    jacobian,
    regressors,
    slipstream_slopes,
    whole_sum,
)
from beaver_ftc.diagnosis import gusts
from beaver_ftc.diagnosis.bounds import (
    ERROR_BOUND_OFF_MAP_IN_FILTERS_RAD_S2,
    add_published_bound,
    additional_error_bound_at_travel_level,
    equivalent_coefficient_error_bounds,
    moment_axis_of_term,
)
from beaver_ftc.diagnosis.detection import likelihood, parity
from beaver_ftc.diagnosis.detection.attitude import attitude_dtype, configure_attitude
from beaver_ftc.diagnosis.detection.forces import (
    MEASURED_FORCES_RECORD,
    RatesReadingsDeflections,
    configure_forces,
)
from beaver_ftc.diagnosis.detection.likelihood import (
    ALPHA_CUBED_MOMENT,
    GROWING_LOSS,
    LATERAL_BLOCK,
    LOSS_END,
    N_FILTER_BLOCKS,
    N_INPUT_READINGS,
    N_ONSET_SLOTS,
    STEP_FAULT,
    block_dtype,
)
from beaver_ftc.diagnosis.detection.parity import (
    AXIS_VIEW,
    N_TONE_FREQUENCIES,
    TONE_CONFIG_RECORD,
    USUAL_RECORD_SIZE,
    ParityDirection,
    StatisticalRecordSize,
    configure_parity_views,
    configure_tone_tests,
    iterate_parity_directions,
    parity_view_dtype,
)
from beaver_ftc.diagnosis.gusts import (
    GUST_RECORD,
    MIN_UNMEASURED_GUST_INTENSITY_SHARES,
    UNMEASURED_SHARE_FROM_FORCE_ERROR,
    configure_gust_estimate,
    configure_gust_velocity_and_speed_error,
    fill_and_add_gust_estimate_noise,
)
from beaver_ftc.diagnosis.state import DAMAGE_MAY_HAVE_EXCLUDED_OTHERS, LOSS, SIDE_FORCE
from beaver_ftc.plant.instruments import NOISE_LIMIT_SIGMA
from beaver_ftc.scenario.declared import Declared, SensorErrors
from beaver_ftc.scenario.diagnosis import FdiConfig, Statistical

PITCH_AXES, LATERAL_AXES = (1,), (0, 2)
_READING_INDEX_BY_SENSOR = {"alpha": ALPHA, "beta": BETA, "V": AIRSPEED, "qdyn": QDYN}
_ENGINE_POWER_READING_INDEX = N_INPUT_READINGS - 1  # of the engine, kW
_SLIPSTREAM_SIGNAL_INDEX = RH + 1  # the first of the declared signals
N_TESTED_SIGNS_BY_KIND = {
    LOSS: 1,
    GROWING_LOSS: 1,
    LOSS_END: 1,
    STEP_FAULT: 2,
    ALPHA_CUBED_MOMENT: 2,
}  # a loss has a sign, a step may go either way
# Rate kappa of the growing-loss hypothesis. It explains a third of a loss that grows ten times slower or
# faster; a constant loss explains the rest.
LOSS_GROWTH_RATE_PER_S = 1.5

# Share of the alarm level reserved for noise in addition to an uncertainty at its bound (statistical.md).
NOISE_SHARE_OF_ALARM_LEVEL = 0.5
# 42 of 75 flights of a GTM not found before; 15: 23, 8: 36, 0.2 and less: 35 and fewer
MAX_DRIFT_FREQUENCY_WITH_DAMAGE_RAD_S = 3.0
MIN_GYRO_NOISE_STD_RAD_S = (
    1e-9  # of a gyro: exact ones are still doubles, and a variance no difference of zeros
)
# (kind, surface, axis, raises alarms)
HypothesisEntry = tuple[int, int, int, int]


def axes_and_hypotheses_by_block(
    aircraft: Aircraft,
) -> tuple[tuple[tuple[int, ...], tuple[HypothesisEntry, ...]], ...]:
    """Axes and hypotheses of each block: the losses of the surfaces that turn about its axes, and what they
    are held against. Roll and yaw are there twice, see above."""
    pitch_hypotheses = (
        *_loss_hypotheses(aircraft, PITCH_AXES),
        *_step_fault_hypotheses(PITCH_AXES),
        (ALPHA_CUBED_MOMENT, -1, 1, 0),
    )
    lateral_hypotheses = (*_loss_hypotheses(aircraft, LATERAL_AXES), *_step_fault_hypotheses(LATERAL_AXES))
    pitch_hypotheses, lateral_hypotheses = (
        (*hypotheses, *_growing_and_ending_hypotheses(hypotheses))
        for hypotheses in (pitch_hypotheses, lateral_hypotheses)
    )
    return (
        (PITCH_AXES, pitch_hypotheses),
        (LATERAL_AXES, lateral_hypotheses),
        (LATERAL_AXES, lateral_hypotheses),
    )


def _loss_hypotheses(aircraft: Aircraft, axes: tuple[int, ...]) -> Iterator[HypothesisEntry]:
    for s, (surface_name, axis) in enumerate(zip(aircraft.surfaces, aircraft.dominant_axis, strict=True)):
        if surface_name in aircraft.class_of_losses and axis in axes:
            yield LOSS, s, axis, 1


def _growing_and_ending_hypotheses(hypotheses: tuple[HypothesisEntry, ...]) -> Iterator[HypothesisEntry]:
    surface_index_and_axis_of_losses = [
        (surface_index, axis) for kind, surface_index, axis, _ in hypotheses if kind == LOSS
    ]
    return (
        (kind, surface_index, axis, 0)
        for surface_index, axis in surface_index_and_axis_of_losses
        for kind in (GROWING_LOSS, LOSS_END)
    )


def _step_fault_hypotheses(axes: tuple[int, ...]) -> Iterator[HypothesisEntry]:
    return ((STEP_FAULT, -1, axis, 1) for axis in axes)


def n_tests_per_frame(aircraft: Aircraft, *parity_directions: ParityDirection) -> int:
    """The number of one-sided tests that the detector makes in a frame, those of these views included."""
    kind_of_each_alarm_hypothesis = [
        kind
        for _, hypotheses in axes_and_hypotheses_by_block(aircraft)
        for kind, _, _, raises_alarm in hypotheses
        if raises_alarm
    ]
    n_tone_tests = 0
    for parity_direction in parity_directions:
        if parity_direction.orthogonal_to_surface >= 0 and any(
            parity_direction.initial_direction[SIDE_FORCE:]
        ):
            kind_of_each_alarm_hypothesis += [
                STEP_FAULT,
                *(LOSS for _ in parity_direction.loss_tested_surface_indices),
            ]
            n_tone_tests += N_TONE_FREQUENCIES
        elif (
            parity_direction.orthogonal_to_surface == AXIS_VIEW
            and not parity_direction.uses_inertial_flow_angle
        ):
            n_tone_tests += N_TONE_FREQUENCIES
    return (
        N_ONSET_SLOTS * sum(N_TESTED_SIGNS_BY_KIND[kind] for kind in kind_of_each_alarm_hypothesis)
        + n_tone_tests
    )


def _quantile(probability: float) -> float:
    """Of the normal distribution; of a probability that is too small for a number, that of the smallest."""
    return NormalDist().inv_cdf(max(probability, float_info.min))


def derive_alarm_level(false_alarms_per_h: float, rate_hz: float, n_tests: int) -> float:
    """The alarm level, standard deviations, for a rate of false alarms per hour with so many tests a frame.

    By the union bound the rate is at most `false_alarms_per_h`.
    """
    return -_quantile(false_alarms_per_h / (3600.0 * rate_hz * n_tests))


def derive_isolation_llr_margin(
    wrong_isolation_probability: float, rate_hz: float, aircraft: Aircraft
) -> float:
    """Difference of log-likelihood ratios that noise exceeds in a second with this probability at most."""
    return 0.5 * _quantile(wrong_isolation_probability / (rate_hz * n_tests_per_frame(aircraft))) ** 2


def configure_statistical_detector(
    fdi: np.void,
    fdi_config: FdiConfig,
    declared: Declared,
    design_model: np.void,
    mass_properties: MassProperties,
    trim: RatesReadingsDeflections,
    rate_hz: float,
) -> None:
    """Fill the statistical part of a diagnosis record; trim: x (3,), y and u (surfaces,) in trim."""
    statistical, statistical_settings = fdi["statistical"], fdi_config.statistical
    statistical["alarm"]["detected_at_s"] = -1.0
    if statistical_settings is None or not fdi["config"]["enabled"]:  # a plug-in diagnoses, or nothing does
        return
    test_config, gust_estimate, aircraft = statistical["test_config"], statistical["gust"], declared.aircraft
    sensor_errors, dt_s = declared.sensors, 1.0 / rate_hz
    n_instants_per_frame = int(fdi["config"]["n_substeps"])
    test_config["enabled"], test_config["frame_share_per_instant"] = 1, 1.0 / max(n_instants_per_frame, 1)
    airspeed_mps = float(trim[1][AIRSPEED])
    frame_uncertainty_change_over_bound = uncertainty_change_over_bound_per_frame(
        statistical_settings, aircraft, dt_s
    )
    statistical["forces"]["in_use"] = declared.uses_accelerometers
    gust_estimate["output"]["uses_accelerometers"] = declared.follows_gusts_by_accelerometers
    configure_gust_estimate(gust_estimate, declared, mass_properties)
    uses_parity_views = fdi_config.compares_across(n_instants_per_frame)
    n_tests = n_tests_per_frame(
        aircraft,
        *(iterate_parity_directions(aircraft, declared.uses_accelerometers) if uses_parity_views else ()),
    )
    _configure_levels(test_config, fdi_config, aircraft, n_tests, rate_hz)
    configure_gust_velocity_and_speed_error(
        gust_estimate, declared, float(test_config["alarm_level"]), airspeed_mps
    )
    _configure_blocks(statistical, sensor_errors, aircraft)
    _configure_uncertainty_and_loss_growth(
        statistical, fdi_config, declared, frame_uncertainty_change_over_bound, dt_s
    )
    statistical["noise"]["base_frame_uncertainty_change_over_bound"] = (
        statistical_settings.uncertainty_rad_s * dt_s
    )
    _configure_drift_and_model_noise(
        statistical,
        drift_uncertainty_frequency_rad_s(statistical_settings, aircraft),
        declared,
        design_model,
        trim,
        dt_s,
    )
    absolute_term_tolerances = equivalent_coefficient_error_bounds(
        declared, design_model, mass_properties, *trim[1:]
    )
    _configure_regressor_tolerances(statistical, aircraft, absolute_term_tolerances)
    configure_reading_regressors(statistical, sensor_errors, fdi["bound"]["declared_errors"])
    if uses_parity_views:
        configure_tone_tests(
            statistical["tone_test_config"],
            statistical_settings.false_alarms_per_h / (3600.0 * rate_hz * n_tests),
            airspeed_mps,
            frame_uncertainty_change_over_bound * rate_hz,
            dt_s,
        )
        if declared.uses_accelerometers:
            configure_forces(fdi, declared, trim, jacobian(design_model, *trim)[3], dt_s)
            _configure_inertial_gust_estimate(statistical, declared)
        configure_parity_views(statistical, aircraft)
    _configure_drift_correlation_lengths(statistical, airspeed_mps, rate_hz)
    monitor_config = fdi["sensor_monitor"]["config"]
    if monitor_config["enabled"] and monitor_config["attitude_is_noisy"]:
        configure_attitude(
            statistical["attitude"],
            monitor_config["rate_damping_per_s"],
            max(sensor_errors[angle].random for angle in ("phi", "theta", "psi")),
            max(sensor_errors[rate].random for rate in AXES),
            float(test_config["isolation_llr_margin"]),
            dt_s,
        )
    if gust_estimate["output"]["accounts_for_gusts"]:
        # the filters that assume no gust: they trim as the others, with a drift in any direction
        for field_name in ("n_axes", "drift_decay_factor", "gyro_noise_variance", "P_xx", "P_dd"):
            statistical["block"]["no_gust_filter"][field_name] = statistical["block"][field_name]
        fill_and_add_gust_estimate_noise(statistical, sensor_errors, design_model, *trim[1:], dt_s)


def _configure_levels(
    test_config: np.void, fdi_config: FdiConfig, aircraft: Aircraft, n_tests: int, rate_hz: float
) -> None:
    """Fill the level of the alarm, the margin of isolation, and how evidence is forgotten and bounded."""
    settings = fdi_config.statistical
    assert settings is not None
    test_config["alarm_level"] = derive_alarm_level(settings.false_alarms_per_h, rate_hz, n_tests)
    test_config["isolation_llr_margin"] = derive_isolation_llr_margin(settings.misnaming, rate_hz, aircraft)
    test_config["evidence_decay_factor"] = exp(-1.0 / (rate_hz * fdi_config.forgetting_time_s))
    test_config["non_loss_llr_bounds_include_uncertainty"] = (
        aircraft.file.model_error_map is not None and not aircraft.loses_surfaces
    )


def _configure_inertial_gust_estimate(statistical: np.void, declared: Declared) -> None:
    """Fill the gust estimate of the views that use the accelerometers in place of the vanes."""
    gust_estimate = statistical["gust"]
    # the monitor of the sensors may find the accelerometers broken
    gust_estimate["output"]["uses_accelerometers"] = not declared.monitors_sensors
    statistical["inertial_gust"] = gust_estimate
    inertial_gust = statistical["inertial_gust"]
    inertial_gust["output"]["accounts_for_gusts"] *= gust_estimate["output"]["uses_accelerometers"]
    inertial_gust["memory"]["unmeasured_intensity_share"] = np.minimum(
        np.add(MIN_UNMEASURED_GUST_INTENSITY_SHARES, UNMEASURED_SHARE_FROM_FORCE_ERROR), 1.0
    )


def _configure_drift_correlation_lengths(statistical: np.void, airspeed_mps: float, rate_hz: float) -> None:
    """Fill the correlation length of the drift, m, of the block whose drift reverts to its mean and, where no
    vane measures the gust, of the pitch block; fill how much of a gust's drift each of them then has."""
    gust_config, gust_output = statistical["gust"]["config"], statistical["gust"]["output"]
    mean_reverting_block, pitch_block = statistical["block"][-1], statistical["block"][likelihood.PITCH_BLOCK]
    rolling_gust_correlation_length_m = (
        float(gust_config["rolling_gust_correlation_length"]) if gust_output["accounts_for_gusts"] else 0.0
    )
    gust_correlation_lengths_m = (
        rotation_lengths(gust_config["wing_span"])
        if gust_config["has_only_coarse_estimate"]
        else [rolling_gust_correlation_length_m]
    )
    mean_reverting_block["drift_correlation_length_m"] = derive_drift_correlation_length_m(
        statistical, airspeed_mps, rate_hz, float(min(gust_correlation_lengths_m))
    )
    if not gust_output["accounts_for_gusts"]:
        return
    mean_reverting_block["gust_drift_intensity_factor"] = (
        rolling_gust_correlation_length_m / mean_reverting_block["drift_correlation_length_m"]
    ) ** 2
    if gust_output["is_gust_measured"]:
        return
    pitching_gust_correlation_length_m = float(rotation_lengths(gust_config["wing_span"])[1])
    pitch_block["drift_correlation_length_m"] = derive_drift_correlation_length_m(
        statistical, airspeed_mps, rate_hz, pitching_gust_correlation_length_m
    )
    pitch_block["gust_drift_intensity_factor"] = (
        pitching_gust_correlation_length_m / pitch_block["drift_correlation_length_m"]
    ) ** 2


def _configure_blocks(statistical: np.void, sensor_errors: SensorErrors, aircraft: Aircraft) -> None:
    axes_and_hypotheses = axes_and_hypotheses_by_block(aircraft)
    all_loss_surface_indices = [
        aircraft.surfaces.index(surface_name) for surface_name in aircraft.class_of_losses
    ]
    statistical["test_config"]["n_score_columns"] = len(all_loss_surface_indices) + len(AXES)
    for block, (axes, hypothesis_entries) in zip(statistical["block"], axes_and_hypotheses, strict=True):
        block["n_axes"], block["n_hypotheses"] = len(axes), len(hypothesis_entries)
        block["n_regressors"] = sum(
            moment_axis_of_term(moment_term) in axes for moment_term in aircraft.moments
        )
        block["drift_decay_factor"], block["gust_drift_intensity_factor"] = 1.0, 1.0
        for i, axis in enumerate(axes):
            block["axes"][i] = axis
            gyro_noise_variance = max(sensor_errors[AXES[axis]].random, MIN_GYRO_NOISE_STD_RAD_S) ** 2
            block["gyro_noise_variance"][i] = block["P_xx"][i, i] = gyro_noise_variance
            block["P_dd"][i, i] = likelihood.PRIOR_DRIFT_STD_RAD_S2**2
        likelihood.set_supporting_correlation_signs(block, [kind for kind, *_ in hypothesis_entries])
        for hypothesis, (kind, surface_index, axis, raises_alarm) in zip(
            block["hypothesis"], hypothesis_entries, strict=False
        ):
            hypothesis["kind"], hypothesis["surface"] = kind, surface_index
            hypothesis["axis"], hypothesis["raises_alarm"] = axis, raises_alarm
            hypothesis["score_column_index"] = (
                all_loss_surface_indices.index(surface_index)
                if kind == LOSS
                else len(all_loss_surface_indices) + axis
            )


def uncertainty_change_over_bound_per_frame(
    statistical_settings: Statistical, aircraft: Aircraft, dt_s: float
) -> float:
    """Largest change of a bounded uncertainty within a frame, over its bound.

    The error of an aircraft's own terms changes with its surfaces, which a law may move fully within a frame:
    from one end of the bound to the other. If the error is mapped, its rate of change is worked out in flight
    (`statistical.update_uncertainty_change`).
    """
    return 2.0 if any(aircraft.model_error_rad_s2) else statistical_settings.uncertainty_rad_s * dt_s


def drift_uncertainty_frequency_rad_s(statistical_settings: Statistical, aircraft: Aircraft) -> float:
    """Frequency, rad/s, of the bounded uncertainty that the drift of the filters represents.

    The evidence that the uncertainty explains is bounded by its declared rate of change in any case
    (`likelihood.max_correlation_by_uncertainty`). The drift only sets how much of it the filters remove. If
    damage may take surfaces, a weaker drift detects most: motion that no loss explains is then rarely an
    error of the model.
    """
    return (
        min(MAX_DRIFT_FREQUENCY_WITH_DAMAGE_RAD_S, statistical_settings.uncertainty_rad_s)
        if aircraft.loses_surfaces
        else statistical_settings.uncertainty_rad_s
    )


def _configure_uncertainty_and_loss_growth(
    statistical: np.void,
    fdi_config: FdiConfig,
    declared: Declared,
    frame_uncertainty_change_over_bound: float,
    dt_s: float,
) -> None:
    """Fill level, noise share and rate of change of the bounded uncertainty. A loss declared constant does
    not grow."""
    is_noise_free = declared.is_noise_free
    for block in statistical["block"]:
        block["alarm_level"] = statistical["test_config"]["alarm_level"]
        block["noise_share_of_alarm_level"] = 0.0 if is_noise_free else NOISE_SHARE_OF_ALARM_LEVEL
        block["uncertainty_change_over_bound_per_frame"] = frame_uncertainty_change_over_bound
        kind_of_each_hypothesis = block["hypothesis"]["kind"][: block["n_hypotheses"]]
        if fdi_config.fault_profile == "abrupt":
            block["n_hypotheses"] = np.sum(
                (kind_of_each_hypothesis != GROWING_LOSS) & (kind_of_each_hypothesis != LOSS_END)
            )
        block["hypothesis"]["remaining_growth_decay_factor"] = exp(-LOSS_GROWTH_RATE_PER_S * dt_s)


def _configure_drift_and_model_noise(
    statistical: np.void,
    uncertainty_frequency_rad_s: float,
    declared: Declared,
    design_model: np.void,
    trim: RatesReadingsDeflections,
    dt_s: float,
) -> None:
    """Fill the drift, for an uncertainty of frequency omega, rad/s, and the model noise by noise of f + G
    u."""
    reading_noise_std = declared.sensors.each("random")
    largest_gyro_noise_std = float(reading_noise_std[:3].max())
    largest_constant_bound_over_axes_rad_s2 = max(declared.constant_rad_s2)
    alarm_level = float(statistical["test_config"]["alarm_level"])
    statistical["noise"]["drift_intensity_over_squared_bound"] = derive_drift_intensity_over_squared_bound(
        largest_constant_bound_over_axes_rad_s2,
        uncertainty_frequency_rad_s,
        largest_gyro_noise_std,
        alarm_level,
        dt_s,
    )
    _, G, acceleration_slopes_by_rates, acceleration_slopes_by_air_data = jacobian(design_model, *trim)
    statistical["noise"]["acceleration_variance_without_air_data"] = (
        acceleration_slopes_by_rates**2 @ reading_noise_std[:3] ** 2
    )
    acceleration_variance_by_air_data = (
        acceleration_slopes_by_air_data[:, [ALPHA, BETA, AIRSPEED, QDYN]] ** 2 @ reading_noise_std[3:] ** 2
    )  # later as `add_reading_regressors_and_fill_noise` says
    statistical["noise"]["acceleration_variance_by_input_noise"] = (
        statistical["noise"]["acceleration_variance_without_air_data"] + acceleration_variance_by_air_data
    )
    statistical["noise"]["deflection_error_effect_bound"] = np.abs(G).sum(axis=1) * declared.deflection_rad


def derive_drift_intensity_over_squared_bound(
    eta_bar: float, uncertainty_frequency_rad_s: float, gyro_noise_std: float, alarm_level: float, dt_s: float
) -> float:
    """Intensity of the random walk that stands for a bounded uncertainty, over its bound squared, 1/s.

    An uncertainty of eta_bar sin(omega t) moves the test for a step by eta_bar omega sqrt(2 sqrt 2 / i w0),
    w0 = (i / n)^(1/4), for a walk of intensity i and gyro noise of density n = noise^2 dt (statistical.md).
    Almost without noise w0 is the frame rate. The evidence for a loss under a moving command grows together
    with the uncertainty while both have the same sign: by eta_bar sqrt(omega / i) times 1.204, the largest
    value of sin(z) / sqrt(z / 2), z half of omega t. Half the alarm level is left for it: noise alone then
    takes up no more than the other half. eta_bar rad/s2; omega, noise rad/s; level in standard deviations.
    """
    eta_bar = max(eta_bar, likelihood.MIN_UNCERTAINTY_BOUND_FOR_DRIFT_RAD_S2)
    intensity_times_bandwidth_of_step_test = (
        8.0 * sqrt(2.0) * (eta_bar * uncertainty_frequency_rad_s / alarm_level) ** 2
    )  # of i w0
    intensity_for_loss_test = 4.0 * (1.204 * eta_bar / alarm_level) ** 2 * uncertainty_frequency_rad_s
    intensity_for_step_test = (
        intensity_times_bandwidth_of_step_test * (gyro_noise_std**2 * dt_s) ** 0.25
    ) ** 0.8
    return (
        max(
            hypot(intensity_for_step_test, intensity_for_loss_test),
            intensity_times_bandwidth_of_step_test * dt_s,
        )
        / eta_bar**2
    )


def derive_drift_correlation_length_m(
    statistical: np.void, airspeed_mps: float, rate_hz: float, gust_correlation_length_m: float
) -> float:
    """Return length, m, of the drift in the second block of roll and yaw, or of pitch without gust estimate.

    gust_correlation_length_m: correlation length of the gust, m; 0 in still air. The drift returns as soon as
    a bounded uncertainty permits: over the longest window T an uncertainty that oscillates with the fault
    moves a test, for a drift of intensity i and lag tau, by eta_bar sqrt(T / 2 i) / tau; half the alarm level
    is left for this. The drift returns no later than the gust. A gust with a longer correlation length is
    represented by a stronger one, of equal power at low frequency and more power at high frequency.
    """
    if statistical["noise"]["drift_intensity_over_squared_bound"] == 0.0:
        # 0 in still air: nothing is declared that drifts, and the two views are one
        return gust_correlation_length_m
    longest_window_s = 2 ** (N_ONSET_SLOTS - 1) / rate_hz
    alarm_level = float(statistical["test_config"]["alarm_level"])
    drift_time_constant_s = (
        sqrt(2.0 * longest_window_s / statistical["noise"]["drift_intensity_over_squared_bound"])
        / alarm_level
    )
    return min(airspeed_mps * drift_time_constant_s, gust_correlation_length_m or np.inf)


def _configure_regressor_tolerances(
    statistical: np.void, aircraft: Aircraft, absolute_term_tolerances: np.ndarray
) -> None:
    """Fill the tolerances of unknown constants: coefficients, inertia, steady sensor errors."""
    axis_of_term = np.array([moment_axis_of_term(moment_term) for moment_term in aircraft.moments])
    for block, axes in zip(statistical["block"], (PITCH_AXES, LATERAL_AXES, LATERAL_AXES), strict=True):
        block_term_tolerances = absolute_term_tolerances[np.isin(axis_of_term, axes)]
        block["regressor_tolerance"][: block_term_tolerances.size] = block_term_tolerances
    statistical["test_config"]["uses_regressors"] = bool(np.any(absolute_term_tolerances))


def configure_reading_regressors(
    statistical: np.void, sensor_errors: SensorErrors, declared_error_record: np.void
) -> None:
    """Add the readings of the air data to the regressors of the blocks."""
    steady_error_bounds = np.zeros(N_INPUT_READINGS)
    reading_noise_std = statistical["noise"]["reading_noise_std"]
    for sensor_name, reading_index in _READING_INDEX_BY_SENSOR.items():
        steady_error_bounds[reading_index] = sensor_errors[sensor_name].steady
        reading_noise_std[reading_index] = sensor_errors[sensor_name].random
    steady_error_bounds[_ENGINE_POWER_READING_INDEX] = declared_error_record[
        "power_error_kw_by_instruments"
    ]  # all of it: so many standard deviations are part of that
    reading_noise_std[_ENGINE_POWER_READING_INDEX] = (
        declared_error_record["power_error_kw_by_instruments"] / NOISE_LIMIT_SIGMA
    )
    if not (steady_error_bounds.any() or reading_noise_std.any()):
        return
    statistical["noise"]["has_reading_errors"] = statistical["test_config"]["uses_regressors"] = 1
    for block in statistical["block"]:
        first_reading_regressor_index = int(block["n_regressors"])
        block["n_regressors"] = first_reading_regressor_index + N_INPUT_READINGS
        block["regressor_tolerance"][
            first_reading_regressor_index : first_reading_regressor_index + N_INPUT_READINGS
        ] = steady_error_bounds


@kernel
def fill_signal_slopes_for_one_reading(
    moment_table, declared_error_record, y, reading_index, signal_slopes_for_one_reading
):
    """Fill signal_slopes_for_one_reading (N_SIGNALS,): change of a table's signals per unit of a reading."""
    signal_slopes_for_one_reading[:] = 0.0
    if reading_index < AIRSPEED:  # a vane
        signal_slopes_for_one_reading[reading_index] = 1.0
    if reading_index == AIRSPEED:
        for k in range(PH, RH + 1):
            signal_slopes_for_one_reading[k] = -moment_table.signal[k] / y[AIRSPEED]
    if declared_error_record.has_engine_instrument_errors and reading_index >= AIRSPEED:
        slipstream_slope_per_airspeed, slipstream_slope_per_qdyn, slipstream_slope_per_kw = slipstream_slopes(
            y, declared_error_record.power_error_kw_per_density_ratio
        )
        slipstream_slope_per_qdyn_or_kw = (
            slipstream_slope_per_qdyn if reading_index == QDYN else slipstream_slope_per_kw
        )
        signal_slopes_for_one_reading[_SLIPSTREAM_SIGNAL_INDEX] = (
            slipstream_slope_per_airspeed if reading_index == AIRSPEED else slipstream_slope_per_qdyn_or_kw
        )


@kernel
def fill_acceleration_slopes_for_one_reading(
    design_model, y, u, reading_index, monomial_slopes_for_one_reading, acceleration_slopes_for_one_reading
):
    """Fill acceleration_slopes_for_one_reading (3,), rad/s2 per unit of the reading.

    monomial_slopes_for_one_reading: the change of the monomials per unit of it.
    """
    moment_table, dynamic_force = design_model.moments, y[QDYN] * design_model.S
    for i in range(3):
        acceleration_slopes_for_one_reading[i] = whole_sum(
            moment_table, i, monomial_slopes_for_one_reading, u
        )
        if reading_index == QDYN:
            acceleration_slopes_for_one_reading[i] += (
                whole_sum(moment_table, i, moment_table.power, u) / y[QDYN]
            )
    rolling_moment_per_reading = dynamic_force * design_model.b * acceleration_slopes_for_one_reading[0]
    pitching_moment_per_reading = dynamic_force * design_model.c * acceleration_slopes_for_one_reading[1]
    yawing_moment_per_reading = dynamic_force * design_model.b * acceleration_slopes_for_one_reading[2]
    (
        acceleration_slopes_for_one_reading[0],
        acceleration_slopes_for_one_reading[1],
        acceleration_slopes_for_one_reading[2],
    ) = (
        design_model.Pl * rolling_moment_per_reading + design_model.Pn * yawing_moment_per_reading,
        design_model.Qm * pitching_moment_per_reading,
        design_model.Rl * rolling_moment_per_reading + design_model.Rn * yawing_moment_per_reading,
    )


@kernel
def add_reading_regressors_and_fill_noise(
    frame_share_per_instant, noise_model, blocks, declared_error_record, design_model, y, u
):
    """Add this instant, a `frame_share_per_instant` of the frame, to the readings' regressors, rad/s2 per
    unit, and fill the model noise, rad2/s4, as it is now; `design.moments` is evaluated there."""
    moment_table = design_model.moments
    acceleration_slopes_for_one_reading = noise_model.acceleration_change_per_reading
    noise_model.acceleration_variance_by_input_noise[:] = noise_model.acceleration_variance_without_air_data
    for reading_index in range(N_INPUT_READINGS):
        fill_signal_slopes_for_one_reading(
            moment_table, declared_error_record, y, reading_index, noise_model.signal_change_per_reading
        )
        directional(
            moment_table,
            moment_table.signal,
            moment_table.power,
            noise_model.signal_change_per_reading,
            noise_model.monomial_change_per_reading,
        )
        fill_acceleration_slopes_for_one_reading(
            design_model,
            y,
            u,
            reading_index,
            noise_model.monomial_change_per_reading,
            acceleration_slopes_for_one_reading,
        )
        for i in range(3):
            noise_model.acceleration_variance_by_input_noise[i] += (
                acceleration_slopes_for_one_reading[i] * noise_model.reading_noise_std[reading_index]
            ) ** 2
        pitch_block = blocks[likelihood.PITCH_BLOCK]
        pitch_block.regressor[pitch_block.n_regressors - N_INPUT_READINGS + reading_index, 0] += (
            frame_share_per_instant * acceleration_slopes_for_one_reading[1]
        )
        for lateral_block in blocks[LATERAL_BLOCK:]:
            j = lateral_block.n_regressors - N_INPUT_READINGS + reading_index
            lateral_block.regressor[j, 0] += frame_share_per_instant * acceleration_slopes_for_one_reading[0]
            lateral_block.regressor[j, 1] += frame_share_per_instant * acceleration_slopes_for_one_reading[2]


# Least share of the best log-likelihood ratio that a constant theta explains of a loss growing at any rate
# (docs/explanation/statistical.md).
MIN_LLR_SHARE_OF_CONSTANT_THETA = 0.25
# The error of a model moves from one end of its bound to the other, by 2 bounds, no faster than a surface
# moves by this share of its travel.
TRAVEL_SHARE_REVERSING_ERROR = 0.25
UNCERTAINTY_BOUNDS_CHANGED_PER_TRAVEL = 2.0 / TRAVEL_SHARE_REVERSING_ERROR
MIN_TRAVEL_RAD = 1e-6

# Configuration of the tests.
TEST_CONFIG_RECORD = record(
    enabled=int,
    alarm_level=float, isolation_llr_margin=float,  # standard deviations; difference of log-likelihood ratios
    evidence_decay_factor=float,  # factor by which evidence decays per frame after the alarm
    n_score_columns=int,
    uses_regressors=int,  # whether unknown constants have tolerances
    frame_share_per_instant=float,  # one over the number of instants in a frame
    non_loss_llr_bounds_include_uncertainty=int,  # if the error is mapped and no surface can be lost
)  # fmt: skip

# The noise model: accelerations that are not caused by a fault.
NOISE_MODEL_RECORD = record(
    # of the drift that represents a bounded uncertainty, over bound squared, 1/s
    drift_intensity_over_squared_bound=float,
    # share of its bound by which the uncertainty changes in a frame if no surface moves
    base_frame_uncertainty_change_over_bound=float,
    uncertainty_bound=3,  # bound on the uncertainty with healthy surfaces, now, rad/s2
    additional_bound_for_surface_anywhere=3,  # what one surface anywhere in its travel adds to it, rad/s2
    deflection_error_effect_bound=3,  # share of the bound by errors of the deflections, rad/s2
    # variance by noise of all inputs of the model; without the air data; (rad/s2)2
    acceleration_variance_by_input_noise=3, acceleration_variance_without_air_data=3,
    # whether errors of the air data count; their noise, units of the readings
    has_reading_errors=int, reading_noise_std=N_INPUT_READINGS,
    # scratch
    coefficient_regressor=MAX_TERMS, signal_change_per_reading=N_SIGNALS,
    monomial_change_per_reading=MAX_MONOMIALS, acceleration_change_per_reading=3,
)  # fmt: skip

# Output of the detector: largest score over the alarm level and its axis; the largest so far in healthy
# flight; time of the first alarm, s, or -1.
ALARM_RECORD = record(
    score_over_alarm_level=float, axis=int, max_score_over_alarm_level_so_far=float, detected_at_s=float
)


@sized
def statistical_dtype(record_size: StatisticalRecordSize = USUAL_RECORD_SIZE) -> np.dtype:
    """The record of the detector, for an aircraft that needs these capacities."""
    return record(
        test_config=TEST_CONFIG_RECORD, noise=NOISE_MODEL_RECORD, alarm=ALARM_RECORD,
        block=(block_dtype(record_size.rate_block_capacity), N_FILTER_BLOCKS),
        n_views=int, views=(parity_view_dtype(record_size.view_block_capacity), record_size.n_views),
        tone_test_config=TONE_CONFIG_RECORD,
        forces=MEASURED_FORCES_RECORD, gust=GUST_RECORD, inertial_gust=GUST_RECORD,
        attitude=attitude_dtype(record_size.rate_block_capacity),
    )  # fmt: skip


@kernel
def update_blocks(
    test_config,
    uncertainty_bound,
    blocks,
    gust_estimate,
    acceleration_innovation,
    dt,
    frame_index,
    is_alarm_latched,
    losses_may_end=False,
):
    """Update the blocks with frame k, of dt s: innovation and bound `uncertainty_bound`, both (3,) rad/s2.

    is_alarm_latched: the detector has raised its alarm; losses_may_end: a loss may end.
    """
    evidence_decay_factor = test_config.evidence_decay_factor if is_alarm_latched else 1.0
    onset_slot_index_to_reset = likelihood.onset_slot_restarting_at_frame(frame_index)
    for block_index, block in enumerate(blocks):
        if not is_alarm_latched:
            likelihood.reset_onset_slot(block, onset_slot_index_to_reset)
        for i, axis in enumerate(block.axes[: block.n_axes]):
            block.frame_innovation[i] = (
                acceleration_innovation[axis] - gust_estimate.output.mean_angular_acceleration_by_gust[axis]
            )
        block.has_coarse_gust_estimate = gust_estimate.config.has_only_coarse_estimate
        if gust_estimate.config.has_only_coarse_estimate:
            likelihood.set_coarse_gust_effect_of_block(
                block, gust_estimate.output.angular_acceleration_by_coarse_gust
            )
        if gust_estimate.output.accounts_for_gusts:
            add_gust_axes_turn_to_drift_covariance(gust_estimate, block)
            if block_index < likelihood.MEAN_REVERTING_LATERAL_BLOCK:
                likelihood.whiten_by_no_gust_filter(block, dt)
            else:  # without gust both blocks of roll and yaw have the same filter
                block.no_gust_filter.unscaled_white_innovation_rad_s[:] = blocks[
                    LATERAL_BLOCK
                ].no_gust_filter.unscaled_white_innovation_rad_s
        upper_bound_decay_factor_per_frame = test_config.evidence_decay_factor if losses_may_end else 0.0
        likelihood.update_block(
            block,
            uncertainty_bound,
            test_config.uses_regressors,
            dt,
            evidence_decay_factor,
            upper_bound_decay_factor_per_frame,
            test_config.non_loss_llr_bounds_include_uncertainty,
        )


@kernel
def add_gust_axes_turn_to_drift_covariance(gust_estimate, block):
    """Add to the covariance of the drift what a fast turn of the gusts' axes may change in it."""
    for i in range(block.n_axes):
        for j in range(block.n_axes):
            block.P_dd[i, j] += (
                block.gust_drift_intensity_factor
                * gust_estimate.output.acceleration_variance_by_axes_turn[block.axes[i], block.axes[j]]
            )


@kernel
def filter_innovation_after_known_faults(blocks, gust_estimate, innovation_after_known_faults, dt):
    """Filter the innovation after known faults (3,) rad/s2; the state tracks its slowly varying mean."""
    for block in blocks[: likelihood.MEAN_REVERTING_LATERAL_BLOCK]:
        for i, axis in enumerate(block.axes[: block.n_axes]):
            block.frame_innovation[i] = (
                innovation_after_known_faults[axis]
                - gust_estimate.output.mean_angular_acceleration_by_gust[axis]
            )
        likelihood.advance_whitening_filter(
            block, block.filter_state_after_known_faults, block.frame_innovation, dt, block.frame_innovation
        )


@kernel
def fill_statistical_unmodelled_acceleration(blocks, gust_estimate, out):
    """Fill out (3,) rad/s2 with the estimated acceleration that the control law's model lacks.

    It is the estimated drift plus the effect of the gust estimated from the vanes.
    """
    for block in blocks[: likelihood.MEAN_REVERTING_LATERAL_BLOCK]:
        for i, axis in enumerate(block.axes[: block.n_axes]):
            out[axis] = (
                block.filter_state_after_known_faults[2 + i]
                + gust_estimate.output.angular_acceleration_by_gust[axis]
            )


@kernel
def update_alarm(
    alarm, test_config, blocks, views, measured_forces, gust_estimate, t, model_error_bound_applies=True
):
    """Fill the largest score over the alarm level, its axis, and at the first alarm its time t s.

    The score is 0 unless `model_error_bound_applies`: outside its map, the model's error has no bound.
    """
    alarm.score_over_alarm_level = 0.0
    if not model_error_bound_applies:
        return
    for block in blocks:
        for hypothesis in block.hypothesis[: block.n_hypotheses]:
            if hypothesis.raises_alarm:
                keep_largest_alarm_score(alarm, test_config.alarm_level, hypothesis.score, hypothesis.axis)
    for view in views:
        keep_largest_alarm_score(
            alarm,
            test_config.alarm_level,
            parity.view_alarm_score(view, views, test_config, measured_forces, gust_estimate),
            view.alarm_axis,
        )
    if alarm.score_over_alarm_level > 1.0 and alarm.detected_at_s < 0.0:
        alarm.detected_at_s = t


@kernel
def update_max_alarm_score_so_far(alarm):
    """Keep the largest score over the alarm level so far."""
    alarm.max_score_over_alarm_level_so_far = max(
        alarm.max_score_over_alarm_level_so_far, alarm.score_over_alarm_level
    )


@kernel
def keep_largest_alarm_score(alarm, alarm_level, score_in_standard_deviations, axis):
    """Keep a score if it is the largest."""
    score_over_alarm_level = score_in_standard_deviations / alarm_level
    if score_over_alarm_level > alarm.score_over_alarm_level:
        alarm.score_over_alarm_level, alarm.axis = score_over_alarm_level, axis


@kernel
def write_alarm_scores_to_log_row(test_config, blocks, views, measured_forces, gust_estimate, row):
    """Write the last columns of a log row: scores over the alarm level, first of losses, then of steps.

    Scores of forces and of oscillations are in the column of the step on their axis.
    """
    first_score_column = row.size - test_config.n_score_columns
    row[first_score_column:] = 0.0
    for block in blocks:
        for hypothesis in block.hypothesis[: block.n_hypotheses]:
            if hypothesis.raises_alarm:
                score_column = first_score_column + hypothesis.score_column_index
                row[score_column] = max(row[score_column], hypothesis.score / test_config.alarm_level)
    for view in views:
        score_column = row.size - 3 + view.alarm_axis
        row[score_column] = max(
            row[score_column],
            parity.view_alarm_score(view, views, test_config, measured_forces, gust_estimate)
            / test_config.alarm_level,
        )


@kernel
def is_loss_not_excluded(estimators, loss_estimator_indices, surface_index):
    """True if a loss of this surface has not been excluded."""
    return (
        loss_estimator_indices[surface_index] < 0
        or not estimators[loss_estimator_indices[surface_index]].excluded
    )


@kernel
def best_alternative_llr_lower_bound(
    block, estimators, loss_estimator_indices, surface_index, includes_excluded_losses=False
):
    """The largest lower bound on the log-likelihood ratio of all alternatives to the loss of a surface.

    Excluded losses are no alternatives, unless `includes_excluded_losses`: as evidence decays, an uncertainty
    that correlates with the commands may support them again.
    """
    largest_lower_bound = 0.0
    for hypothesis in block.hypothesis[: block.n_hypotheses]:
        if hypothesis.kind in (GROWING_LOSS, LOSS_END):
            continue
        alternative_surface_index = hypothesis.surface
        if hypothesis.kind != LOSS or (
            alternative_surface_index != surface_index
            and (
                includes_excluded_losses
                or is_loss_not_excluded(estimators, loss_estimator_indices, alternative_surface_index)
            )
        ):
            largest_lower_bound = max(largest_lower_bound, hypothesis.llr_lower_bound)
    return largest_lower_bound


@kernel
def loss_llr_upper_bound(block, surface_index, is_loss_end):
    """Upper bound on the log-likelihood ratio of a loss of this surface, or, if `is_loss_end`, of its end.

    It is 0 if the block has no such hypothesis.
    """
    largest_upper_bound = 0.0
    for hypothesis in block.hypothesis[: block.n_hypotheses]:
        if hypothesis.surface == surface_index and (hypothesis.kind == LOSS_END) == is_loss_end:
            largest_upper_bound = max(largest_upper_bound, hypothesis.llr_upper_bound)
    return largest_upper_bound


@kernel
def confirms_loss(test_config, blocks, estimators, loss_estimator_indices, surface_index):
    """True if a loss of this surface explains the data better than all alternatives.

    Its log-likelihood ratio must be larger by more than `isolation_llr_margin`.

    estimators: of the isolation; loss_estimator_indices (n,): of each surface's loss, or -1. If the estimator
    is weakly excluded by DAMAGE_MAY_HAVE_EXCLUDED_OTHERS, excluded losses are alternatives as well.
    """
    includes_excluded_losses = (
        loss_estimator_indices[surface_index] >= 0
        and estimators[loss_estimator_indices[surface_index]].weakly_excluded
        == DAMAGE_MAY_HAVE_EXCLUDED_OTHERS
    )
    for block in blocks:
        loss_llr_lower_bound = 0.0
        for hypothesis in block.hypothesis[: block.n_hypotheses]:
            if hypothesis.surface == surface_index and hypothesis.kind in (LOSS, GROWING_LOSS):
                loss_llr_lower_bound = max(loss_llr_lower_bound, hypothesis.llr_lower_bound)
        if (
            loss_llr_lower_bound
            - best_alternative_llr_lower_bound(
                block, estimators, loss_estimator_indices, surface_index, includes_excluded_losses
            )
            > test_config.isolation_llr_margin
        ):
            return True
    return False


@kernel
def excludes_loss(
    test_config,
    blocks,
    estimators,
    loss_estimator_indices,
    surface_index,
    includes_loss_end_in_pitch,
    is_abrupt,
):
    """True if an alternative explains the data better than a loss of this surface.

    Its log-likelihood ratio must be larger by more than `isolation_llr_margin`.

    Each block of roll and yaw is compared together with that of pitch, because a loss acts on its own axes
    only. A loss that is not declared `is_abrupt` may grow. A constant theta then explains only a part of its
    effect, so the loss is excluded only if its ratio is also below MIN_LLR_SHARE_OF_CONSTANT_THETA of the
    best. The same holds for a loss that begins inside a frame of several instants, and for the end of a loss
    there. The end of a loss in pitch counts only if `includes_loss_end_in_pitch` is set: a fault outside the
    class may look like it. Arguments as in `confirms_loss`.
    """
    pitch_block = blocks[likelihood.PITCH_BLOCK]
    has_one_instant_per_frame = test_config.frame_share_per_instant == 1.0
    loss_llr_share_limit = 1.0 if is_abrupt and has_one_instant_per_frame else MIN_LLR_SHARE_OF_CONSTANT_THETA
    loss_end_llr_share_limit = 1.0 if has_one_instant_per_frame else MIN_LLR_SHARE_OF_CONSTANT_THETA
    for lateral_block in blocks[LATERAL_BLOCK:]:
        alternative_llr_lower_bound = best_alternative_llr_lower_bound(
            pitch_block, estimators, loss_estimator_indices, surface_index
        )
        alternative_llr_lower_bound = max(
            alternative_llr_lower_bound,
            best_alternative_llr_lower_bound(
                lateral_block, estimators, loss_estimator_indices, surface_index
            ),
        )
        upper_bound_of_loss_llr = max(
            loss_llr_upper_bound(pitch_block, surface_index, False),
            loss_llr_upper_bound(lateral_block, surface_index, False),
        )
        upper_bound_of_loss_end_llr = loss_llr_upper_bound(lateral_block, surface_index, True)
        if includes_loss_end_in_pitch:
            upper_bound_of_loss_end_llr = max(
                upper_bound_of_loss_end_llr, loss_llr_upper_bound(pitch_block, surface_index, True)
            )
        is_loss_llr_below_share_limits = (
            upper_bound_of_loss_llr < loss_llr_share_limit * alternative_llr_lower_bound
            and upper_bound_of_loss_end_llr < loss_end_llr_share_limit * alternative_llr_lower_bound
        )
        if (
            is_loss_llr_below_share_limits
            and alternative_llr_lower_bound - max(upper_bound_of_loss_llr, upper_bound_of_loss_end_llr)
            > test_config.isolation_llr_margin
        ):
            return True
    return False


@kernel
def estimate_loss_theta_and_information(blocks, surface_index):
    """Estimate of theta, in [-1, 0], of a loss of effectiveness of a surface, and one over its variance."""
    theta_estimate, theta_information = 0.0, 0.0
    for block in blocks:
        for hypothesis in block.hypothesis[: block.n_hypotheses]:
            if (
                hypothesis.kind == LOSS
                and hypothesis.surface == surface_index
                and hypothesis.theta_information > theta_information
            ):
                theta_estimate, theta_information = hypothesis.theta_estimate, hypothesis.theta_information
    return theta_estimate, theta_information


@kernel
def prepare_tests_of_next_frame(
    test_config, noise_model, blocks, gust_estimate, bound_record, design_model, measured, u, dt
):
    """Prepare the next frame, of dt s: gust, regressors, drift and model noise at this instant.

    bound_record: the declared bounds; u (n,) rad: positions of healthy surfaces.
    """
    x, y = measured.x, measured.y
    if gust_estimate.output.accounts_for_gusts:
        gusts.fill_gust_effect_and_specific_force(gust_estimate, design_model, x, y, u)
    if test_config.uses_regressors:
        for block in blocks:
            block.regressor[:] = 0.0
        add_regressors(
            test_config.frame_share_per_instant,
            noise_model,
            blocks,
            bound_record.declared_errors,
            design_model,
            measured,
            u,
        )
    fill_uncertainty_bound_drift_and_noise(
        noise_model, blocks, gust_estimate, bound_record, design_model, measured, dt
    )
    if bound_record.error_map.n_boxes > 0:
        update_uncertainty_change(noise_model, blocks, bound_record.error_map, u)
    if gust_estimate.output.accounts_for_gusts:
        gusts.begin_gust_sums_with_instant(
            gust_estimate, y[AIRSPEED], test_config.frame_share_per_instant * dt
        )


@kernel
def update_uncertainty_change(noise_model, blocks, error_map, u):
    """Fill the rate of change of every block for the next frame: the model's mapped error changes with the
    surfaces."""
    max_travel_share_moved_in_frame = 0.0
    for s in range(u.size):
        travel_width_rad = max(error_map.travel_high[s] - error_map.travel_low[s], MIN_TRAVEL_RAD)
        max_travel_share_moved_in_frame = max(
            max_travel_share_moved_in_frame,
            abs(u[s] - error_map.surface_positions_before[s]) / travel_width_rad,
        )
        error_map.surface_positions_before[s] = u[s]
    for block in blocks:
        block.uncertainty_change_over_bound_per_frame = min(
            noise_model.base_frame_uncertainty_change_over_bound
            + UNCERTAINTY_BOUNDS_CHANGED_PER_TRAVEL * max_travel_share_moved_in_frame,
            UNCERTAINTY_BOUNDS_CHANGED_PER_TRAVEL * TRAVEL_SHARE_REVERSING_ERROR,
        )


@kernel
def add_instant_to_gust_and_regressors(
    test_config, noise_model, blocks, gust_estimate, bound_record, design_model, measured, u, dt
):
    """Add an instant inside a frame, dt s after the instant before, to gust and regressors."""
    if gust_estimate.output.accounts_for_gusts:
        gusts.update_gust_and_sums(
            gust_estimate, design_model, measured.x, measured.y, u, measured.attitude, dt
        )
    if test_config.uses_regressors:
        add_regressors(
            test_config.frame_share_per_instant,
            noise_model,
            blocks,
            bound_record.declared_errors,
            design_model,
            measured,
            u,
        )


@kernel
def add_regressors(
    frame_share_per_instant, noise_model, blocks, declared_error_record, design_model, measured, u
):
    """Add this instant, a `frame_share_per_instant` of the frame, to all regressors of unknown constants."""
    y = measured.y
    evaluate(design_model.moments, measured.x, y)
    add_coefficient_regressors(
        frame_share_per_instant, noise_model.coefficient_regressor, blocks, design_model, y, u
    )
    if noise_model.has_reading_errors:
        add_reading_regressors_and_fill_noise(
            frame_share_per_instant, noise_model, blocks, declared_error_record, design_model, y, u
        )


@kernel
def fill_uncertainty_bound_drift_and_noise(
    noise_model, blocks, gust_estimate, bound_record, design_model, measured, dt
):
    """Fill the bound on the uncertainty, and of each block the drift intensity and the model noise: for the
    bounded uncertainty and the unmeasured gust."""
    uncertainty_bound, V = noise_model.uncertainty_bound, measured.y[AIRSPEED]
    uncertainty_bound[:] = 0.0
    add_published_bound(
        measured.x,
        design_model,
        bound_record.inertia_coupling_error_share,
        bound_record.constant_error_bound,
        bound_record.earth_rate_rad_s,
        uncertainty_bound,
    )
    has_error_map = bound_record.error_map.n_boxes > 0
    for i in range(3):
        uncertainty_bound[i] += noise_model.deflection_error_effect_bound[i]
        if has_error_map:
            uncertainty_bound[i] += min(
                bound_record.error_map.error_bound_now[i], ERROR_BOUND_OFF_MAP_IN_FILTERS_RAD_S2
            )
        if bound_record.error_map.one_surface_may_be_anywhere:
            noise_model.additional_bound_for_surface_anywhere[i] = additional_error_bound_at_travel_level(
                bound_record.error_map,
                bound_record.error_map.n_travel_levels - 1,
                i,
            )
    for block_index, block in enumerate(blocks):
        for i, axis in enumerate(block.axes[: block.n_axes]):
            for j in range(block.n_axes):
                block.drift_intensity[i, j] = 0.0
                if gust_estimate.output.accounts_for_gusts:
                    gust_drift_intensity = gusts.unmeasured_gust_drift_intensity(
                        gust_estimate,
                        V,
                        axis,
                        block.axes[j],
                        block_index == likelihood.MEAN_REVERTING_LATERAL_BLOCK,
                    )
                    block.drift_intensity[i, j] = block.gust_drift_intensity_factor * gust_drift_intensity
            lower_limited_uncertainty_bound = max(
                uncertainty_bound[axis], likelihood.MIN_UNCERTAINTY_BOUND_FOR_DRIFT_RAD_S2
            )
            uncertainty_drift_intensity = (
                noise_model.drift_intensity_over_squared_bound
                * lower_limited_uncertainty_bound
                * lower_limited_uncertainty_bound
            )
            block.drift_intensity[i, i] += uncertainty_drift_intensity
            block.no_gust_filter.drift_intensity[i, i] = uncertainty_drift_intensity
            block.model_noise_variance[i] = block.no_gust_filter.model_noise_variance[i] = (
                noise_model.acceleration_variance_by_input_noise[axis]
            )
        block.drift_decay_factor = (
            np.exp(-dt * V / block.drift_correlation_length_m)
            if block.drift_correlation_length_m > 0.0
            else 1.0
        )


@kernel
def add_coefficient_regressors(
    frame_share_per_instant, dimensionless_regressor_by_term, blocks, design_model, y, u
):
    """Add this instant, a `frame_share_per_instant` of the frame, to the coefficients' regressors (n, 2)
    rad/s2."""
    moment_table = design_model.moments
    regressors(moment_table, moment_table.power, u, dimensionless_regressor_by_term)
    frame_share_of_dynamic_force = frame_share_per_instant * y[QDYN] * design_model.S
    lateral_moment_per_coefficient = frame_share_of_dynamic_force * design_model.b
    pitching_moment_per_coefficient = frame_share_of_dynamic_force * design_model.c
    pitch_block = blocks[likelihood.PITCH_BLOCK]
    first_term_index = moment_table.free_from[1]
    for j in range(moment_table.surface_to[1] - first_term_index):
        pitch_block.regressor[j, 0] += (
            design_model.Qm
            * pitching_moment_per_coefficient
            * dimensionless_regressor_by_term[first_term_index + j]
        )
    for lateral_block in blocks[LATERAL_BLOCK:]:
        n_roll_terms, first_term_index = moment_table.surface_to[0], moment_table.free_from[2]
        for j in range(n_roll_terms):
            roll_moment_per_term_coefficient = (
                lateral_moment_per_coefficient * dimensionless_regressor_by_term[j]
            )
            lateral_block.regressor[j, 0] += design_model.Pl * roll_moment_per_term_coefficient
            lateral_block.regressor[j, 1] += design_model.Rl * roll_moment_per_term_coefficient
        for j in range(moment_table.surface_to[2] - first_term_index):
            yaw_moment_per_term_coefficient = (
                lateral_moment_per_coefficient * dimensionless_regressor_by_term[first_term_index + j]
            )
            lateral_block.regressor[n_roll_terms + j, 0] += design_model.Pn * yaw_moment_per_term_coefficient
            lateral_block.regressor[n_roll_terms + j, 1] += design_model.Rn * yaw_moment_per_term_coefficient
