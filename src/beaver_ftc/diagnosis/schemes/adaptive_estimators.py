"""Our scheme: detection by the bank of filters and the statistical detector, isolation by fault class.

The acceleration by known faults is part of the prediction, so the estimator of the unknown explains the rest.
A Python plug-in has a scheme of its own (PLUGGED): its verdict replaces ours, and our estimators run on,
because the laws use them.

The isolation depends on the fault class and on the detectors in authority; a row of FAULT_CLASSES for each:

    class        of the bank of estimators excludes  and decides
    published    worst case, statistics, or either   the estimator that is left: a loss of one surface
    all          worst case, or parity views as well  the type of a fault on each surface, alone or in pairs

`fault_class_number` chooses the row when a flight is assembled.
"""

from collections.abc import Callable
from typing import NamedTuple

from beaver_ftc.compiled import apart, kernel, one_of
from beaver_ftc.design.model import AIRSPEED, ALPHA, BETA, unanticipated_pitch
from beaver_ftc.diagnosis import conclusion, gusts, isolation
from beaver_ftc.diagnosis.detection import filters, forces, parity, statistical
from beaver_ftc.diagnosis.detection.parity import fill_block_signatures
from beaver_ftc.diagnosis.expectation import form_innovation, predict_control_effect
from beaver_ftc.diagnosis.monitors import engine_symmetry, sensor_monitor
from beaver_ftc.diagnosis.schemes import contract
from beaver_ftc.diagnosis.schemes.contract import CompiledScheme
from beaver_ftc.diagnosis.state import UNANTICIPATED, YAW
from beaver_ftc.diagnosis.types import pairs, registry, verdict
from beaver_ftc.scenario.diagnosis import FdiConfig


class FaultClass(NamedTuple):
    """Lazy kernels of a row.

    begin(fdi): start, at the alarm, with no knowledge of any fault.
    observe(fdi, belief): record what each surface was commanded in the elapsed frame.
    isolate(fdi, measured, t, started): exclude faults at t s, and decide; started: a frame or more ago.
    """

    begin: Callable[..., None]
    observe: Callable[..., None]
    isolate: Callable[..., None]


@kernel
def isolate_fault(fdi, measured, t, known):
    """From the alarm on, exclude faults and decide; known: whether the alarm came a frame or more ago.

    Where sensors are monitored, the isolation starts one frame after the alarm, because the attitude reveals
    a gyro fault one frame late (later where it is noisy). With a broken sensor or engine nothing is isolated.
    """
    row, monitor = fdi.config.fault_class, fdi.sensor_monitor
    if not known:
        isolation.start_estimators(fdi.isolation, fdi.bound.noise, measured.x)
        begin_by_class(row, fdi)
    sound = not sensor_monitor.alarm_is_at_start(monitor, fdi.verdict.detected_at_s)
    if sound and sensor_monitor.allows_isolation(monitor, known) and not fdi.engines.output.failed:
        isolate_by_class(row, fdi, measured, t, known)


@kernel
def is_possible_in_worst_case(fdi, fie, x, started):
    """Whether the fault of estimator fie is possible in the worst case; x (3,) rad/s: measured."""
    return isolation.is_possible(fdi.isolation, fie, fdi.bank, fdi.bound.frame, fdi.config.abrupt, x, started)


@kernel
def likelihood_excludes(fdi, fie):
    """Whether the statistical detector excludes the loss of estimator fie, once it has raised its alarm."""
    detector, config = fdi.statistical, fdi.config
    if detector.alarm.detected_at_s < 0.0:
        return False
    vane_error_can_hide = fdi.sensor_monitor.config.enabled and detector.air.output.moving
    isolation.update_likelihood_exclusion(
        fie,
        detector.tests,
        detector.block,
        fdi.isolation,
        fdi.layout.loss_estimator,
        config.abrupt,
        vane_error_can_hide,
    )
    return fie.excluded_by_likelihood == 1


@kernel
def parity_excludes(fdi, fie):
    """Whether a parity view shows motion that the surface of estimator fie cannot cause."""
    detector, position = fdi.statistical, fdi.layout.position_estimator[fie.surface]
    views, column = detector.views[: detector.n_views], fdi.isolation.estimator[position].effect.Z
    return parity.excludes_surface(views, detector.tests, detector.forces, detector.air, fie.surface, column)


@kernel
def exclude_by_worst_case(fdi, x, t, started):
    """Exclude the faults that are not possible in the worst case."""
    for fie in fdi.isolation.estimator[: fdi.isolation.config.n]:
        if not is_possible_in_worst_case(fdi, fie, x, started):
            isolation.exclude_fault(fie, t)


@kernel
def decide_loss(fdi, t):
    """Isolate the loss of effectiveness whose estimator is the only one left."""
    conclusion.record_isolated(fdi.verdict, isolation.decide_isolation(fdi.isolation, t), t)


@apart
def isolate_loss(fdi, measured, t, started):
    """Isolate by the worst case alone (FaultClass)."""
    exclude_by_worst_case(fdi, measured.x, t, started)
    decide_loss(fdi, t)


@apart
def isolate_loss_by_either(fdi, measured, t, started):
    """Isolate by the worst case and the statistical detector (FaultClass)."""
    for fie in fdi.isolation.estimator[: fdi.isolation.config.n]:
        if not is_possible_in_worst_case(fdi, fie, measured.x, started) or likelihood_excludes(fdi, fie):
            isolation.exclude_fault(fie, t)
    decide_loss(fdi, t)


@apart
def isolate_loss_by_statistics(fdi, measured, t, started):
    """Isolate by the statistical detector alone (FaultClass); the residuals are logged all the same."""
    for fie in fdi.isolation.estimator[: fdi.isolation.config.n]:
        is_possible_in_worst_case(fdi, fie, measured.x, started)
        if likelihood_excludes(fdi, fie):
            isolation.exclude_fault(fie, t)
    decide_loss(fdi, t)


@apart
def isolate_type(fdi, measured, t, started):
    """Isolate a fault of any type by the worst case alone (FaultClass)."""
    exclude_by_worst_case(fdi, measured.x, t, started)
    decide_type(fdi, t, started)


@apart
def isolate_type_by_either(fdi, measured, t, started):
    """Isolate a fault of any type by the worst case and the parity views (FaultClass)."""
    for fie in fdi.isolation.estimator[: fdi.isolation.config.n]:
        if not is_possible_in_worst_case(fdi, fie, measured.x, started) or parity_excludes(fdi, fie):
            isolation.exclude_fault(fie, t)
    decide_type(fdi, t, started)


@kernel
def decide_type(fdi, t, started):
    """Decide which fault of every type, alone or two at a time, is there."""
    types, found, layout, bank = fdi.types, fdi.verdict, fdi.layout, fdi.bank
    records, bound = fdi.isolation.estimator, fdi.bound
    verdict.record_refuted(types.surface, layout, records)
    if types.pair.enabled:
        pairs.examine_pairs(types, layout, records, bank, bound.frame)
        conclusion.record_finding(found, pairs.decide_pairs(types, found, layout, t))
        return
    if started or fdi.isolation.config.memory:
        registry.examine_frame(types, layout, records, bank.output.innovation, bound)
    conclusion.record_finding(found, verdict.decide_surface_and_type(types, found, layout, records, t))


@apart
def begin_losses(fdi):
    """The estimators are all that a loss needs (FaultClass)."""


@apart
def begin_types(fdi):
    """Start the feasible sets of all types (FaultClass)."""
    registry.restart_types(fdi.types)


@apart
def observe_losses(fdi, belief):
    """The estimators have observed all that a loss needs (FaultClass)."""


@apart
def observe_types(fdi, belief):
    """Record the orders to each surface (FaultClass)."""
    registry.record_commands(fdi.types, belief.commanded, belief.means)


FAULT_CLASSES = {
    ("published", "worst-case"): FaultClass(begin_losses, observe_losses, isolate_loss),
    ("published", "either"): FaultClass(begin_losses, observe_losses, isolate_loss_by_either),
    ("published", "statistical"): FaultClass(begin_losses, observe_losses, isolate_loss_by_statistics),
    ("all", "worst-case"): FaultClass(begin_types, observe_types, isolate_type),
    ("all", "either"): FaultClass(begin_types, observe_types, isolate_type_by_either),
}
PUBLISHED_CLASS = 0  # the place of the published class without statistics

begin_by_class = one_of([row.begin for row in FAULT_CLASSES.values()])
observe_by_class = one_of([row.observe for row in FAULT_CLASSES.values()])
isolate_by_class = one_of([row.isolate for row in FAULT_CLASSES.values()])


def fault_class_number(config: FdiConfig) -> int:
    """The place of a diagnosis' row. The worst case excludes types of fault for any authority."""
    authority = config.authority if config.weighs_chance else "worst-case"
    if config.fault_class == "all" and authority == "statistical":
        authority = "either"
    return list(FAULT_CLASSES).index((config.fault_class, authority))


@apart
def update_statistical_tests(fdi, belief, measured, k, t):
    """Test the innovation of the elapsed frame, which ends frame k at t s, for every hypothesis."""
    detector, y, bounded = fdi.statistical, measured.y, fdi.statistical.noise.bounded
    tests, blocks, gust, force_record = detector.tests, detector.block, detector.air, detector.forces
    views, inertial, mean = detector.views[: detector.n_views], detector.inertial_air, belief.means
    innovation, dt = fdi.bank.output.innovation, fdi.config.dt
    gusts.average_gust_frame(gust, belief.share)
    if inertial.output.moving:
        gusts.average_gust_frame(inertial, belief.share)
    predict_control_effect(mean)
    fill_block_signatures(blocks, mean.Gu_predicted, unanticipated_pitch(belief.design, y, 1.0))
    latched, ends = detector.alarm.detected_at_s >= 0.0, not fdi.config.abrupt
    statistical.update_blocks(tests, bounded, blocks, gust, innovation, dt, k, latched, ends)
    parity.update_directions(views, force_record, gust, fdi.bound, mean.G_predicted, mean.Gu_predicted)
    parity.project_innovation(
        views,
        tests.has_tolerances,
        detector.noise,
        blocks,
        force_record,
        gust,
        inertial,
        innovation,
        y[AIRSPEED],
    )
    parity.update_views(views, tests, detector.tone_config, y, dt, k, latched)
    known = fdi.bound.error_map.outside == 0
    statistical.update_alarm(detector.alarm, tests, blocks, views, force_record, gust, t, known)
    form_innovation(belief, measured.x, dt)
    statistical.track_residual_mean(blocks, gust, belief.innovation_after_known_faults, dt)


@apart
def prepare_statistical(fdi, belief, measured, k):
    """Prepare the tests of the frame after frame k: the gust that the vanes measure, noise, coefficients."""
    detector, dt = fdi.statistical, fdi.config.dt
    tests, noise, gust = detector.tests, detector.noise, detector.air
    update_gusts(gust, detector.inertial_air, detector.forces, belief, measured, k, dt)
    statistical.prepare_tests(
        tests, noise, detector.block, gust, fdi.bound, belief.design, measured, belief.u, dt
    )


@apart
def accumulate_statistical(fdi, belief, measured):
    """Add an instant inside a frame to the gust that the vanes measure, and to its effect on the aircraft."""
    detector, dt = fdi.statistical, belief.share * fdi.config.dt
    tests, noise, gust = detector.tests, detector.noise, detector.air
    statistical.accumulate_test_substep(
        tests, noise, detector.block, gust, fdi.bound, belief.design, measured, belief.u, dt
    )


@kernel
def update_gusts(gust, inertial, force_record, belief, measured, k, dt):
    """Update the gust estimate from vanes and accelerometers, and the innovations of the forces."""
    if gust.output.moving:
        gusts.set_gust_intensity(gust, measured.altitude)
        gusts.update_gust_estimate(gust, measured.y, measured.attitude, belief.share * dt, k)
    if (force_record.known or gust.output.uses_accelerometers) and not measured.inertial:
        forces.stop_forces(force_record, gust, inertial)
    if force_record.known or gust.output.uses_accelerometers:
        gusts.store_accelerometers(gust, measured.force)
    if force_record.known:
        update_inertial_gusts(gust, inertial, force_record, belief, measured, k, dt)


@kernel
def update_inertial_gusts(gust, inertial, force_record, belief, measured, k, dt):
    """Update the innovations of the forces, and the gust estimate from accelerometers without vanes."""
    forces.update_forces(force_record, gust, measured, belief.u, dt)
    if inertial.output.moving:
        forces.fill_readings_without_vanes(force_record, inertial.memory.rotation, measured.y)
        gusts.store_accelerometers(inertial, measured.force)
        gusts.set_gust_intensity(inertial, measured.altitude)
        gusts.update_gust_estimate(inertial, force_record.y, measured.attitude, dt, k)
        gusts.fill_gust_effect(inertial, belief.design, measured.x, force_record.y, belief.u)
        gusts.begin_gust_sums(inertial, force_record.y[AIRSPEED], dt)


@apart
def begin(fdi, belief, measured):
    """Begin the filters, and fix the parity direction of each fault (contract.CompiledScheme)."""
    contract.begin_filters(fdi, measured.x)
    filters.set_parity_directions(fdi.isolation, belief.G)


@apart
def predict(fdi, belief, measured, k, t):
    """Bring bank, likelihoods, isolation and FDAE to this frame (contract.CompiledScheme)."""
    found, bound, dt = fdi.verdict, fdi.bound, fdi.config.dt
    filters.update_bank(fdi.bank, bound, measured.x, belief.x_before, belief.means.acceleration, dt)
    if fdi.statistical.tests.enabled:
        update_statistical_tests(fdi, belief, measured, k, t)
    contract.update_estimators(fdi, belief)
    observe_by_class(fdi.config.fault_class, fdi, belief)
    leaking = found.isolated >= 0 or found.lead >= 0
    filters.predict_fdae(fdi.fdae, bound, belief.x_before, belief.expected, found.detected, leaking, dt)


@apart
def conclude(fdi, belief, measured, t):
    """From residuals to the alarm and a verdict, unless a sensor is at fault (contract.CompiledScheme)."""
    if sensor_monitor.has_alarm(fdi.sensor_monitor):
        return
    known, found = fdi.verdict.detected, fdi.verdict
    filters.form_fdae_residual(fdi.fdae, measured.x)
    axis = axis_of_alarm(fdi, measured.y, t)
    if axis >= 0:
        conclusion.latch_alarm(found, axis, t)
    if found.detected:
        isolate_fault(fdi, measured, t, known)
        filters.evaluate_network(fdi.fdae.network, measured.y[ALPHA], measured.y[BETA])


@kernel
def axis_of_alarm(fdi, y, t):
    """The axis on which a detector raises the alarm, or -1. An engine that has failed is outside the class:
    no surface is isolated then. y: measured signals."""
    apart_now, found = fdi.bound.error_map.apart_now, fdi.verdict
    if not found.detected and engine_symmetry.detect_engine_failure(fdi.engines, apart_now, y):
        conclusion.record_isolated(found, UNANTICIPATED, t)
        return YAW
    return filters.alarm_axis(fdi.bank, fdi.config.authority, fdi.statistical.alarm)


@apart
def prepare(fdi, belief, measured, k):
    """Prepare the statistical detector, where it is declared (contract.CompiledScheme)."""
    if fdi.statistical.tests.enabled:
        prepare_statistical(fdi, belief, measured, k)


@apart
def accumulate(fdi, belief, measured):
    """The same for an instant inside the frame (contract.CompiledScheme)."""
    if fdi.statistical.tests.enabled:
        accumulate_statistical(fdi, belief, measured)


SCHEME = CompiledScheme(begin, predict, conclude, prepare, accumulate)


@apart
def conclude_plugin(fdi, belief, measured, t):
    """Take the plug-in's verdict, fdi.plugin_verdict (contract.CompiledScheme)."""
    filters.form_fdae_residual(fdi.fdae, measured.x)
    conclusion.record_plugin_verdict(fdi.verdict, fdi.plugin_verdict, t)
    isolation.take_plugin_estimate(fdi.isolation, fdi.verdict.isolated, fdi.plugin_verdict.theta)
    if fdi.verdict.detected:
        filters.evaluate_network(fdi.fdae.network, measured.y[ALPHA], measured.y[BETA])


PLUGGED = CompiledScheme(contract.begin_none, predict, conclude_plugin, prepare, accumulate)
