"""Compiled schemes: their contract with the frame, our scheme, and those of a plug-in and of no diagnosis.

Our scheme (SCHEME) detects by the bank of filters and the statistical detector, and isolates by fault class.
The acceleration by known faults is part of the prediction, so the estimator of the unknown explains the rest.
A Python plug-in has a scheme of its own (PYTHON_PLUGIN): its verdict replaces ours, and our estimators run
on, because the laws use them. The scheme `none` (NO_DIAGNOSIS) only begins the detection filters.

The isolation depends on the fault class and on the detectors in authority; a row of
ISOLATION_VARIANT_BY_CLASS_AND_AUTHORITY for each:

    class        of the bank of estimators excludes  and decides
    published    worst case, statistics, or either   the estimator that is left: a loss of one surface
    all          worst case, or parity views as well  the type of a fault on each surface, alone or in pairs

`isolation_variant_index` chooses the row when a flight is assembled.
"""

from collections.abc import Callable
from typing import NamedTuple

from beaver_ftc.compiled import apart, kernel, one_of
from beaver_ftc.design.model import AIRSPEED, ALPHA, BETA, unanticipated_pitch
from beaver_ftc.diagnosis import conclusion, gusts, isolation, monitors
from beaver_ftc.diagnosis.detection import attitude, filters, forces, parity, statistical
from beaver_ftc.diagnosis.detection.parity import fill_block_signatures
from beaver_ftc.diagnosis.model_prediction import (
    fill_surface_effects_with_previous_G,
    form_innovation_after_known_faults,
)
from beaver_ftc.diagnosis.monitors import sensor_monitor
from beaver_ftc.diagnosis.state import UNANTICIPATED, YAW
from beaver_ftc.diagnosis.types import pairs, registry, verdict
from beaver_ftc.scenario.diagnosis import FdiConfig


class CompiledScheme(NamedTuple):
    """Lazy kernels (compiled.py), called with `fdi` (`fdi_dtype`), and `prediction` and `measured`, the
    records of the prediction and the sensors. A row of plugins.yaml names
    the scheme: `module`, whose SCHEME it is, or `module:NAME`.

    begin_scheme(fdi, prediction, measured): start the estimators at the first frame.
    advance_estimators_to_frame(fdi, prediction, measured, k, t): bring the estimators from the frame before
    to frame k at t s.
    update_verdict(fdi, prediction, measured, t): from residuals to the alarm, and from then on to a verdict.
    prepare_next_frame(fdi, prediction, measured, k): prepare the estimators for the next frame.
    accumulate_substep(fdi, prediction, measured): add one JSBSim frame inside the next frame.
    """

    begin_scheme: Callable[..., None]
    advance_estimators_to_frame: Callable[..., None]
    update_verdict: Callable[..., None]
    prepare_next_frame: Callable[..., None]
    accumulate_substep: Callable[..., None]


@apart
def skip_advance_to_frame(fdi, prediction, measured, k, t):
    """The `advance_estimators_to_frame` of a scheme without estimators."""


@apart
def skip_update_verdict(fdi, prediction, measured, t):
    """The `update_verdict` of a scheme without a verdict."""


@apart
def skip_prepare_next_frame(fdi, prediction, measured, k):
    """The `prepare_next_frame` of a scheme whose estimators need nothing but the means over the frame."""


@apart
def skip_accumulate_substep(fdi, prediction, measured):
    """The `accumulate_substep` of such a scheme."""


@kernel
def start_detection_filters(fdi, x):
    """Begin the detection filters at the first measurement x (3,) rad/s."""
    filters.start_fdae_rates_and_gyro_bounds(fdi.fdae, fdi.bound.changing_gyro_error_bound, x)
    filters.start_bank_gyro_error_bounds(fdi.bank, fdi.bound.changing_gyro_error_bound)


@kernel
def update_detection_filters(fdi, prediction, measured):
    """Bring the detection filters from the frame before to this one: innovation, residuals and thresholds."""
    filters.update_innovation_and_filter_bank(
        fdi.bank,
        fdi.bound,
        measured.x,
        prediction.x_before,
        prediction.frame_means.predicted_acceleration,
        fdi.config.dt,
    )


@kernel
def update_fault_effects_and_isolation_estimators(fdi, prediction):
    """Bring the isolation estimators from the frame before to this one, once the bank has its innovation.

    With a broken sensor they stay as they are: the reading in its place follows from the design model.
    """
    config = fdi.config
    bound_record = fdi.bound
    isolation_record = fdi.isolation
    frame_means = prediction.frame_means
    is_detected = fdi.verdict.detected
    isolation.update_all_fault_effects_and_reach(
        isolation_record,
        fdi.bank,
        bound_record,
        config,
        is_detected,
        frame_means.G,
        frame_means.Gu,
        frame_means.Gu_tolerance_for_fault_change,
    )
    if is_detected and not sensor_monitor.has_alarm(fdi.sensor_monitor):
        isolation.advance_estimators(
            isolation_record, bound_record, prediction.x_before, frame_means.predicted_acceleration, config.dt
        )


@apart
def begin_only_detection_filters(fdi, prediction, measured):
    """Begin the detection filters, which the log records (CompiledScheme)."""
    start_detection_filters(fdi, measured.x)


NO_DIAGNOSIS = CompiledScheme(
    begin_only_detection_filters, skip_advance_to_frame, skip_update_verdict, skip_prepare_next_frame,
    skip_accumulate_substep
)  # fmt: skip


class IsolationVariant(NamedTuple):
    """Lazy kernels of a row.

    begin_at_alarm(fdi): start with no knowledge of any fault.
    record_commands(fdi, prediction): record what each surface was commanded in the elapsed frame.
    isolate(fdi, measured, t, isolation_started_earlier): exclude faults at t s, and decide;
    isolation_started_earlier: it started a frame or more ago.
    """

    begin_at_alarm: Callable[..., None]
    record_commands: Callable[..., None]
    isolate: Callable[..., None]


@kernel
def start_or_continue_isolation(fdi, measured, t, was_detected_before):
    """From the alarm on, exclude faults and decide; was_detected_before: the alarm came a frame or more ago.

    Where sensors are monitored, the isolation starts one frame after the alarm, because the attitude reveals
    a gyro fault one frame late (later where it is noisy). With a broken sensor or engine nothing is isolated.
    """
    variant_index, monitor = fdi.config.isolation_variant, fdi.sensor_monitor
    if not was_detected_before:
        isolation.start_estimators(fdi.isolation, fdi.bound.changing_gyro_error_bound, measured.x)
        begin_isolation_variant_at_alarm(variant_index, fdi)
    alarm_is_not_initial_sensor_error = not sensor_monitor.surface_alarm_may_be_initial_sensor_error(
        monitor, fdi.verdict.detected_at_s
    )
    if (
        alarm_is_not_initial_sensor_error
        and sensor_monitor.allows_surface_isolation(monitor, was_detected_before)
        and not fdi.engine_monitor.output.engine_failed
    ):
        isolate_by_variant(variant_index, fdi, measured, t, was_detected_before)


@kernel
def update_and_test_if_possible_in_worst_case(fdi, fie, x, isolation_started_earlier):
    """Whether the fault of estimator fie is possible in the worst case; x (3,) rad/s: measured."""
    return isolation.update_and_test_if_fault_possible(
        fdi.isolation,
        fie,
        fdi.bank,
        fdi.bound.frame_innovation_bound,
        fdi.config.abrupt,
        x,
        isolation_started_earlier,
    )


@kernel
def update_and_test_if_likelihood_excludes(fdi, fie):
    """Whether the statistical detector excludes the loss of estimator fie, once it has raised its alarm."""
    statistical_detector, config = fdi.statistical, fdi.config
    if statistical_detector.alarm.detected_at_s < 0.0:
        return False
    gust_can_hide_vane_error = (
        fdi.sensor_monitor.config.enabled and statistical_detector.gust.output.accounts_for_gusts
    )
    isolation.update_likelihood_confirmation_and_exclusion(
        fie,
        statistical_detector.test_config,
        statistical_detector.block,
        fdi.isolation,
        fdi.layout.loss_estimator,
        config.abrupt,
        gust_can_hide_vane_error,
    )
    return fie.excluded_by_likelihood == 1


@kernel
def parity_excludes(fdi, fie):
    """Whether a parity view shows motion that the surface of estimator fie cannot cause."""
    statistical_detector = fdi.statistical
    position_estimator_index = fdi.layout.position_estimator[fie.surface]
    parity_view_records = statistical_detector.views[: statistical_detector.n_views]
    surface_G_column = fdi.isolation.estimator[position_estimator_index].frame_mean_effect.regressor
    return parity.views_exclude_surface(
        parity_view_records,
        statistical_detector.test_config,
        statistical_detector.forces,
        statistical_detector.gust,
        fie.surface,
        surface_G_column,
    )


@kernel
def exclude_or_wait_for_sensors(fdi, fie, is_possible, t):
    """Exclude the fault of estimator fie at t s, unless it is possible.

    Where sensors are monitored, a fault that has been isolated is excluded a frame later: it may be a gyro
    that contradicts it, and the attitude shows that a frame late.
    """
    if not is_possible or fie.exclusion_is_pending:
        is_isolated = fdi.verdict.isolated_from_s[fie.surface] >= 0.0
        isolation.exclude_fault(fie, t, fdi.sensor_monitor.config.enabled and is_isolated)


@kernel
def update_and_exclude_by_worst_case(fdi, x, t, isolation_started_earlier):
    """Exclude the faults that are not possible in the worst case."""
    for fie in fdi.isolation.estimator[: fdi.isolation.config.n_estimators]:
        is_possible = update_and_test_if_possible_in_worst_case(fdi, fie, x, isolation_started_earlier)
        exclude_or_wait_for_sensors(fdi, fie, is_possible, t)


@kernel
def decide_isolated_loss(fdi, t):
    """Isolate the loss of effectiveness whose estimator is the only one left."""
    conclusion.set_isolated_estimator_and_time(fdi.verdict, isolation.decide_isolation(fdi.isolation, t), t)


@apart
def isolate_loss_by_worst_case(fdi, measured, t, isolation_started_earlier):
    """Isolate by the worst case alone (IsolationVariant)."""
    update_and_exclude_by_worst_case(fdi, measured.x, t, isolation_started_earlier)
    decide_isolated_loss(fdi, t)


@apart(long_loops=True)
def isolate_loss_by_either_detector(fdi, measured, t, isolation_started_earlier):
    """Isolate by the worst case and the statistical detector (IsolationVariant)."""
    for fie in fdi.isolation.estimator[: fdi.isolation.config.n_estimators]:
        is_possible = update_and_test_if_possible_in_worst_case(
            fdi, fie, measured.x, isolation_started_earlier
        ) and not update_and_test_if_likelihood_excludes(fdi, fie)
        exclude_or_wait_for_sensors(fdi, fie, is_possible, t)
    decide_isolated_loss(fdi, t)


@apart(long_loops=True)
def isolate_loss_by_statistics(fdi, measured, t, isolation_started_earlier):
    """Isolate by the statistical detector alone (IsolationVariant); the residuals are logged all the same."""
    for fie in fdi.isolation.estimator[: fdi.isolation.config.n_estimators]:
        update_and_test_if_possible_in_worst_case(fdi, fie, measured.x, isolation_started_earlier)
        exclude_or_wait_for_sensors(fdi, fie, not update_and_test_if_likelihood_excludes(fdi, fie), t)
    decide_isolated_loss(fdi, t)


@apart
def isolate_fault_type_by_worst_case(fdi, measured, t, isolation_started_earlier):
    """Isolate a fault of any type by the worst case alone (IsolationVariant)."""
    update_and_exclude_by_worst_case(fdi, measured.x, t, isolation_started_earlier)
    judge_frame_and_decide_fault_type(fdi, t, isolation_started_earlier)


@apart(long_loops=True)
def isolate_fault_type_by_either_detector(fdi, measured, t, isolation_started_earlier):
    """Isolate a fault of any type by the worst case and the parity views (IsolationVariant)."""
    for fie in fdi.isolation.estimator[: fdi.isolation.config.n_estimators]:
        is_possible = update_and_test_if_possible_in_worst_case(
            fdi, fie, measured.x, isolation_started_earlier
        ) and not parity_excludes(fdi, fie)
        exclude_or_wait_for_sensors(fdi, fie, is_possible, t)
    judge_frame_and_decide_fault_type(fdi, t, isolation_started_earlier)


@kernel
def judge_frame_and_decide_fault_type(fdi, t, isolation_started_earlier):
    """Decide which fault of every type, alone or two at a time, is there."""
    types, conclusion_record, layout, filter_bank = fdi.types, fdi.verdict, fdi.layout, fdi.bank
    estimators, bound_record = fdi.isolation.estimator, fdi.bound
    verdict.record_position_estimator_exclusions(types.surface, layout, estimators)
    if types.pair.enabled:
        pairs.observe_pairs_and_judge_previous(
            types, layout, estimators, filter_bank, bound_record.frame_innovation_bound
        )
        conclusion.record_isolation_and_accommodation(
            conclusion_record,
            pairs.decide_pair_isolation_and_accommodation(types, conclusion_record, layout, t),
        )
        return
    if isolation_started_earlier or fdi.isolation.config.uses_reach_test:
        registry.observe_frame_and_judge_previous(
            types, layout, estimators, filter_bank.output.innovation, bound_record
        )
    conclusion.record_isolation_and_accommodation(
        conclusion_record,
        verdict.decide_isolation_and_accommodation(types, conclusion_record, layout, estimators, t),
    )


@apart
def skip_begin_at_alarm_for_losses(fdi):
    """The estimators are all that a loss needs (IsolationVariant)."""


@apart
def begin_fault_type_isolation_at_alarm(fdi):
    """Start the feasible sets of all types (IsolationVariant)."""
    registry.restart_fault_types(fdi.types)


@apart
def skip_record_commands_for_losses(fdi, prediction):
    """The estimators have observed all that a loss needs (IsolationVariant)."""


@apart
def record_surface_commands(fdi, prediction):
    """Record the orders to each surface (IsolationVariant)."""
    registry.record_commands(fdi.types, prediction.commanded, prediction.frame_means)


ISOLATION_VARIANT_BY_CLASS_AND_AUTHORITY = {
    ("published", "worst-case"): IsolationVariant(
        skip_begin_at_alarm_for_losses, skip_record_commands_for_losses, isolate_loss_by_worst_case
    ),
    ("published", "either"): IsolationVariant(
        skip_begin_at_alarm_for_losses, skip_record_commands_for_losses, isolate_loss_by_either_detector
    ),
    ("published", "statistical"): IsolationVariant(
        skip_begin_at_alarm_for_losses, skip_record_commands_for_losses, isolate_loss_by_statistics
    ),
    ("all", "worst-case"): IsolationVariant(
        begin_fault_type_isolation_at_alarm, record_surface_commands, isolate_fault_type_by_worst_case
    ),
    ("all", "either"): IsolationVariant(
        begin_fault_type_isolation_at_alarm, record_surface_commands, isolate_fault_type_by_either_detector
    ),
}
PUBLISHED_WORST_CASE_VARIANT_INDEX = 0  # the place of the published class without statistics

begin_isolation_variant_at_alarm = one_of(
    [variant.begin_at_alarm for variant in ISOLATION_VARIANT_BY_CLASS_AND_AUTHORITY.values()]
)
record_commands_in_variant = one_of(
    [variant.record_commands for variant in ISOLATION_VARIANT_BY_CLASS_AND_AUTHORITY.values()]
)
isolate_by_variant = one_of(
    [variant.isolate for variant in ISOLATION_VARIANT_BY_CLASS_AND_AUTHORITY.values()]
)


def isolation_variant_index(config: FdiConfig) -> int:
    """The place of a diagnosis' row. The worst case excludes types of fault for any authority."""
    isolation_authority = config.authority if config.weighs_chance else "worst-case"
    if config.fault_class == "all" and isolation_authority == "statistical":
        isolation_authority = "either"
    return list(ISOLATION_VARIANT_BY_CLASS_AND_AUTHORITY).index((config.fault_class, isolation_authority))


@apart(long_loops=True)
def update_statistical_tests(fdi, prediction, measured, k, t):
    """Test the innovation of the elapsed frame, which ends frame k at t s, for every hypothesis."""
    statistical_detector = fdi.statistical
    y = measured.y
    uncertainty_bound_rad_s2 = fdi.statistical.noise.uncertainty_bound
    test_config = statistical_detector.test_config
    blocks = statistical_detector.block
    gust = statistical_detector.gust
    forces_record = statistical_detector.forces
    parity_view_records = statistical_detector.views[: statistical_detector.n_views]
    inertial_gust = statistical_detector.inertial_gust
    frame_means = prediction.frame_means
    acceleration_innovation, dt = fdi.bank.output.innovation, fdi.config.dt
    gusts.finish_gust_mean_and_turn_variance(gust, prediction.frame_share_per_instant)
    if inertial_gust.output.accounts_for_gusts:
        gusts.finish_gust_mean_and_turn_variance(inertial_gust, prediction.frame_share_per_instant)
    fill_surface_effects_with_previous_G(frame_means)
    fill_block_signatures(
        blocks, frame_means.Gu_with_previous_G, unanticipated_pitch(prediction.design, y, 1.0)
    )
    has_statistical_alarm_been_raised = statistical_detector.alarm.detected_at_s >= 0.0
    may_loss_end = not fdi.config.abrupt
    statistical.update_blocks(
        test_config,
        uncertainty_bound_rad_s2,
        blocks,
        gust,
        acceleration_innovation,
        dt,
        k,
        has_statistical_alarm_been_raised,
        may_loss_end,
    )
    if statistical_detector.attitude.enabled:
        attitude.compare_attitude(
            statistical_detector.attitude, blocks, uncertainty_bound_rad_s2, test_config.uses_regressors, dt
        )
        if fdi.verdict.detected and statistical_detector.attitude.score > 1.0:
            fdi.sensor_monitor.memory.gyros_excluded = 1
    parity.set_view_use_directions_signatures(
        parity_view_records,
        forces_record,
        gust,
        fdi.bound,
        frame_means.previous_G,
        frame_means.Gu_with_previous_G,
    )
    parity.fill_view_innovations_noise_regressors(
        parity_view_records,
        test_config.uses_regressors,
        statistical_detector.noise,
        blocks,
        forces_record,
        gust,
        inertial_gust,
        acceleration_innovation,
        y[AIRSPEED],
    )
    parity.update_view_tests(
        parity_view_records,
        test_config,
        statistical_detector.tone_test_config,
        y,
        dt,
        k,
        has_statistical_alarm_been_raised,
    )
    model_error_bound_applies = fdi.bound.error_map.is_outside_all_boxes == 0
    statistical.update_alarm(
        statistical_detector.alarm,
        test_config,
        blocks,
        parity_view_records,
        forces_record,
        gust,
        t,
        model_error_bound_applies,
    )
    form_innovation_after_known_faults(prediction, measured.x, dt)
    statistical.filter_innovation_after_known_faults(
        blocks, gust, prediction.innovation_after_known_faults, dt
    )


@apart(long_loops=True)
def update_gusts_and_prepare_tests(fdi, prediction, measured, k):
    """Prepare the tests of the frame after frame k: the gust that the vanes measure, noise, coefficients."""
    statistical_detector, dt = fdi.statistical, fdi.config.dt
    update_gusts_and_force_innovations(
        statistical_detector.gust,
        statistical_detector.inertial_gust,
        statistical_detector.forces,
        prediction,
        measured,
        k,
        dt,
    )
    statistical.prepare_tests_of_next_frame(
        statistical_detector.test_config,
        statistical_detector.noise,
        statistical_detector.block,
        statistical_detector.gust,
        fdi.bound,
        prediction.design,
        measured,
        prediction.u,
        dt,
    )


@apart(long_loops=True)
def add_instant_to_gusts_and_tests(fdi, prediction, measured):
    """Add an instant inside a frame to the gust that the vanes measure, and to its effect on the aircraft."""
    statistical_detector = fdi.statistical
    instant_duration_s = prediction.frame_share_per_instant * fdi.config.dt
    statistical.add_instant_to_gust_and_regressors(
        statistical_detector.test_config,
        statistical_detector.noise,
        statistical_detector.block,
        statistical_detector.gust,
        fdi.bound,
        prediction.design,
        measured,
        prediction.u,
        instant_duration_s,
    )


@kernel
def update_gusts_and_force_innovations(gust, inertial_gust, forces_record, prediction, measured, k, dt):
    """Update the gust estimate from vanes and accelerometers, and the innovations of the forces."""
    if gust.output.accounts_for_gusts:
        gusts.set_gust_intensity_at_altitude(gust, measured.altitude)
        gusts.start_or_advance_gust_estimate(
            gust, measured.y, measured.attitude, prediction.frame_share_per_instant * dt, k
        )
    if (forces_record.in_use or gust.output.uses_accelerometers) and not measured.inertial:
        forces.stop_using_forces_and_accelerometers(forces_record, gust, inertial_gust)
    if forces_record.in_use or gust.output.uses_accelerometers:
        gusts.store_accelerometer_reading(gust, measured.force)
    if forces_record.in_use:
        update_force_innovations_and_inertial_gust(
            gust, inertial_gust, forces_record, prediction, measured, k, dt
        )


@kernel
def update_force_innovations_and_inertial_gust(
    gust, inertial_gust, forces_record, prediction, measured, k, dt
):
    """Update the innovations of the forces, and the gust estimate from accelerometers without vanes."""
    forces.update_all_force_innovations(forces_record, gust, measured, prediction.u, dt)
    if inertial_gust.output.accounts_for_gusts:
        forces.fill_y_without_vanes(forces_record, inertial_gust.memory.air_rotation_in_body_axes, measured.y)
        gusts.store_accelerometer_reading(inertial_gust, measured.force)
        gusts.set_gust_intensity_at_altitude(inertial_gust, measured.altitude)
        gusts.start_or_advance_gust_estimate(
            inertial_gust, forces_record.y_without_vanes, measured.attitude, dt, k
        )
        gusts.fill_gust_effect_and_specific_force(
            inertial_gust, prediction.design, measured.x, forces_record.y_without_vanes, prediction.u
        )
        gusts.begin_gust_sums_with_instant(inertial_gust, forces_record.y_without_vanes[AIRSPEED], dt)


@apart
def begin_scheme(fdi, prediction, measured):
    """Begin the filters, and fix the parity direction of each fault (CompiledScheme)."""
    start_detection_filters(fdi, measured.x)
    filters.set_estimator_parity_directions(fdi.isolation, prediction.G)


@apart
def advance_estimators_to_frame(fdi, prediction, measured, k, t):
    """Bring bank, likelihoods, isolation and FDAE to this frame (CompiledScheme)."""
    conclusion_record, bound_record, dt = fdi.verdict, fdi.bound, fdi.config.dt
    update_detection_filters(fdi, prediction, measured)
    if fdi.statistical.test_config.enabled:
        update_statistical_tests(fdi, prediction, measured, k, t)
    update_fault_effects_and_isolation_estimators(fdi, prediction)
    record_commands_in_variant(fdi.config.isolation_variant, fdi, prediction)
    do_weights_leak = conclusion_record.isolated_estimator >= 0 or conclusion_record.accommodated_surface >= 0
    filters.advance_fdae(
        fdi.fdae,
        bound_record,
        prediction.x_before,
        prediction.acceleration_with_known_faults,
        conclusion_record.detected,
        do_weights_leak,
        dt,
    )


@apart
def update_verdict(fdi, prediction, measured, t):
    """From residuals to the alarm and a verdict, unless a sensor is at fault (CompiledScheme)."""
    if sensor_monitor.has_alarm(fdi.sensor_monitor):
        return
    was_detected_before, conclusion_record = fdi.verdict.detected, fdi.verdict
    filters.form_fdae_residual(fdi.fdae, measured.x)
    alarm_axis = record_engine_failure_or_find_alarm_axis(fdi, measured.y, t)
    if alarm_axis >= 0:
        conclusion.latch_alarm(conclusion_record, alarm_axis, t)
    if conclusion_record.detected:
        start_or_continue_isolation(fdi, measured, t, was_detected_before)
        filters.evaluate_network(fdi.fdae.network, measured.y[ALPHA], measured.y[BETA])


@kernel
def record_engine_failure_or_find_alarm_axis(fdi, y, t):
    """The axis on which a detector raises the alarm, or -1. An engine that has failed is outside the class:
    no surface is isolated then. y: measured signals."""
    healthy_engine_asymmetry_bound = fdi.bound.error_map.engine_asymmetry_bound_now
    conclusion_record = fdi.verdict
    if not conclusion_record.detected and monitors.detect_engine_failure(
        fdi.engine_monitor, healthy_engine_asymmetry_bound, y
    ):
        conclusion.set_isolated_estimator_and_time(conclusion_record, UNANTICIPATED, t)
        return YAW
    return filters.alarm_axis(fdi.bank, fdi.config.alarm_authority, fdi.statistical.alarm)


@apart
def prepare_next_frame(fdi, prediction, measured, k):
    """Prepare the statistical detector, where it is declared (CompiledScheme)."""
    if fdi.statistical.test_config.enabled:
        update_gusts_and_prepare_tests(fdi, prediction, measured, k)


@apart
def accumulate_substep(fdi, prediction, measured):
    """The same for an instant inside the frame (CompiledScheme)."""
    if fdi.statistical.test_config.enabled:
        add_instant_to_gusts_and_tests(fdi, prediction, measured)


SCHEME = CompiledScheme(
    begin_scheme, advance_estimators_to_frame, update_verdict, prepare_next_frame, accumulate_substep
)


@apart
def update_verdict_from_plugin(fdi, prediction, measured, t):
    """Take the plug-in's verdict, fdi.plugin_verdict (CompiledScheme)."""
    filters.form_fdae_residual(fdi.fdae, measured.x)
    conclusion.record_plugin_verdict(fdi.verdict, fdi.plugin_verdict, t)
    isolation.replace_theta_by_plugin_estimate(
        fdi.isolation, fdi.verdict.isolated_estimator, fdi.plugin_verdict.theta
    )
    if fdi.verdict.detected:
        filters.evaluate_network(fdi.fdae.network, measured.y[ALPHA], measured.y[BETA])


PYTHON_PLUGIN = CompiledScheme(
    begin_only_detection_filters,
    advance_estimators_to_frame,
    update_verdict_from_plugin,
    prepare_next_frame,
    accumulate_substep,
)
