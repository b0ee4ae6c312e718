"""Our scheme: it detects by the bank of filters and the statistical detector, and isolates by fault class.

The acceleration by known faults is part of the prediction, so the estimator of the unknown (FDAE) explains
the rest. The verdict of a Python plug-in replaces ours; bank and FDAE go on, because the laws use what the
FDAE estimates.

The isolation depends on the fault class, and on the detectors whose exclusions count (`exclusion_authority`):

    class        what excludes a fault                what is decided
    published    worst case, likelihoods, or either   the only remaining estimator: a loss of one surface
    all          worst case, or parity views as well  the type of a fault on each surface, one or two faults

    fdi             record of `schemes.fdi_dtype`
    pred, meas      prediction of the design model, readings of the sensors
    j, fie          estimator: its number, its record
    k, t            number of the frame; its time, s
"""

from beaver_ftc.compiled import apart, kernel
from beaver_ftc.design.model import unanticipated_pitch
from beaver_ftc.design.table import AIRSPEED, ALPHA, BETA
from beaver_ftc.diagnosis import conclusion, estimators, gusts, isolation
from beaver_ftc.diagnosis.detection import attitude, fdae, filters, forces, parity, statistical
from beaver_ftc.diagnosis.detection.flow_angles import fill_vaneless_y
from beaver_ftc.diagnosis.detection.rates import finish_rows
from beaver_ftc.diagnosis.model_prediction import fill_old_effects, innovation_known
from beaver_ftc.diagnosis.monitors import engine_monitor, gyro_or_attitude, sensor_monitor
from beaver_ftc.diagnosis.state import (
    STATISTICAL_DETECTOR,
    UNANTICIPATED,
    WORST_CASE_DETECTOR,
    YAW,
)
from beaver_ftc.diagnosis.types import examination, modes, pairs, verdict


@kernel
def update_filters(fdi, pred, meas):
    """Bring the detection filters from the frame before to this one: innovation, residuals and thresholds."""
    filters.update_bank(fdi.bank, fdi.bound, meas.x, pred.x_before, pred.means.F, fdi.config.dt)


@kernel
def update_estimators(fdi, pred):
    """Bring the isolation estimators from the frame before to this one; the bank must have its innovation.

    With a broken sensor they stay as they are: the reading that replaces it follows from the design model.
    """
    cfg, iso, bound, means, detected = fdi.config, fdi.isolation, fdi.bound, pred.means, fdi.verdict.detected
    isolation.update_effects(iso, fdi.bank, bound, cfg, detected, means.G, means.Gu, means.e_Gu)
    if detected and not sensor_monitor.has_alarm(fdi.sensor_monitor):
        estimators.advance_estimators(iso, bound, pred.x_before, means.F, cfg.dt)


@kernel
def follow_alarm(fdi, meas, axis, t):
    """Latch an alarm at t s on an axis (-1: no alarm in this frame). From the first alarm on, isolate its
    cause."""
    before = fdi.verdict.detected
    if axis >= 0:
        conclusion.latch_alarm(fdi.verdict, axis, t)
    if fdi.verdict.detected:
        continue_isolation(fdi, meas, t, before)


@kernel
def continue_isolation(fdi, meas, t, before):
    """From the alarm on, exclude faults and decide; before: whether the alarm came a frame or more ago.

    Where sensors are monitored, the isolation starts one frame after the alarm, because the attitude reveals
    a gyro fault one frame late (later where it is noisy). With a broken sensor or engine nothing is isolated.
    """
    monitor = fdi.sensor_monitor
    if not before:
        estimators.start_estimators(fdi.isolation, fdi.bound.n_gyro, meas.x)
        if fdi.config.diagnoses_all_types:
            begin_types(fdi)
    allowed = sensor_monitor.allows_isolation(monitor, before, fdi.verdict.detected_at_s)
    if allowed and not fdi.engine_monitor.output.engine_failed:
        isolate(fdi, meas, t, before)


@apart(long_loops=True)
def weigh_loss(fdi, j):
    """Fill `unlikely` of estimator j: whether the statistical detector excludes its loss, after its alarm."""
    stat, cfg = fdi.statistical, fdi.config
    if stat.alarm.detected_at_s >= 0.0:
        hidden, fie = fdi.sensor_monitor.config.enabled and stat.gust.output.gusty, fdi.isolation.estimator[j]
        isolation.update_likelihood(
            fie, stat.test, stat.block, fdi.isolation, fdi.layout.loss, cfg.abrupt, hidden
        )


@apart(long_loops=True)
def weigh_position(fdi, j):
    """Fill `unlikely` of estimator j: whether a parity view shows motion that its surface cannot cause."""
    stat, fies = fdi.statistical, fdi.isolation.estimator
    G = fies[fdi.layout.position[fies[j].surface]].effect.Z
    fies[j].unlikely = parity.views_exclude(stat, fies[j].surface, G)


@kernel
def exclude_or_wait(fdi, fie, possible, t):
    """Exclude the fault of estimator fie at t s, unless it is possible and no exclusion is pending.

    Where sensors are monitored, a fault that has been isolated is excluded a frame later: a broken gyro may
    have contradicted it, and the attitude reveals the gyro a frame late. While a gyro may be the cause of the
    alarm, an exclusion is only pending.
    """
    if not possible or fie.pending:
        monitor, isolated = fdi.sensor_monitor, fdi.verdict.from_s[fie.surface] >= 0.0
        in_doubt = sensor_monitor.doubts_gyros(monitor)
        isolation.exclude_fault(fie, t, monitor.config.enabled and isolated, in_doubt)


@kernel
def isolate(fdi, meas, t, started):
    """Exclude faults at t s, and decide; started: whether the isolation started a frame or more ago. If only
    the exclusions of the statistical detector count, the worst case excludes nothing. While a gyro may be the
    cause of the alarm, nothing is decided."""
    cfg, iso, bank = fdi.config, fdi.isolation, fdi.bank
    for j, fie in enumerate(iso.estimator[: iso.config.n_estimators]):
        possible = isolation.fault_possible(iso, fie, bank, fdi.bound.nu_max, cfg.abrupt, meas.x, started)
        possible = possible or cfg.exclusion_authority == STATISTICAL_DETECTOR
        if possible and cfg.exclusion_authority != WORST_CASE_DETECTOR:
            if cfg.diagnoses_all_types:
                weigh_position(fdi, j)
            else:
                weigh_loss(fdi, j)
            possible = not fie.unlikely
        exclude_or_wait(fdi, fie, possible, t)
    if cfg.diagnoses_all_types:
        decide_type(fdi, t, started)
    elif not sensor_monitor.doubts_gyros(fdi.sensor_monitor):
        conclusion.set_isolated(fdi.verdict, isolation.decide_isolation(iso, t), t)


@apart
def decide_type(fdi, t, started):
    """Examine the frame, in the first one of the isolation only with pairs or `reach`. Then decide on which
    surface, or two of them, there is a fault, and of which type, unless a gyro may be the cause of the alarm.
    """
    types, concluded, layout, bank = fdi.types, fdi.verdict, fdi.layout, fdi.bank
    fies, bound = fdi.isolation.estimator, fdi.bound
    verdict.record_exclusions(types.surface, layout, fies)
    if types.pair.enabled:
        pairs.observe_pairs(types, layout, fies, bank, bound.nu_max)
    elif started or fdi.isolation.config.reach:
        examination.observe_frame(types, layout, fies, bank.output.innovation, bound)
    if sensor_monitor.doubts_gyros(fdi.sensor_monitor):
        return
    if types.pair.enabled:
        finding = pairs.decide_pairs(types, concluded, layout, t)
    else:
        finding = verdict.decide_single(types, concluded, layout, t)
    conclusion.record_decision(concluded, finding, modes.accommodate(types, layout))


@apart
def begin_types(fdi):
    """Start the feasible sets of all types at the alarm, with no knowledge of any fault."""
    for srf in fdi.types.surface:
        examination.restart_surface(srf)


@apart
def record_orders(fdi, prediction):
    """Record what each surface was commanded in the elapsed frame."""
    examination.record_commands(fdi.types, prediction.commanded, prediction.means)


@apart(long_loops=True)
def update_tests(fdi, prediction, measured, k, t):
    """Test the innovation of the elapsed frame, which ends at frame k, t s, for every hypothesis: in the
    blocks of the rates, against the attitude, and in the parity views."""
    stat, y, dt = fdi.statistical, measured.y, fdi.config.dt
    alarmed = stat.alarm.detected_at_s >= 0.0
    fill_rows(fdi, prediction, y)
    statistical.update_blocks(stat, dt, k, alarmed, not fdi.config.abrupt)
    if stat.attitude.enabled:
        compare_attitude(fdi, measured.x)
    parity.update_views(stat, gust_of_views(stat), y, dt, k, alarmed)
    statistical.update_alarm(stat, t, fdi.bound.error_map.outside == 0)
    innovation_known(prediction, measured.x, dt)
    statistical.filter_known(stat.block, stat.gust, prediction.nu_known, dt)


@kernel
def fill_rows(fdi, prediction, y):
    """Finish the gust estimates of the elapsed frame, and fill the rows that blocks and views read."""
    stat, means, nu = fdi.statistical, prediction.means, fdi.bank.output.innovation
    gusts.finish_gust(stat.gust, prediction.w)
    for gust in (stat.vaneless, stat.vaned):
        if gust.output.gusty:
            gusts.finish_gust(gust, prediction.w)
    fill_old_effects(means)
    alpha_cubed = unanticipated_pitch(prediction.design, y, 1.0)
    finish_rows(
        stat.rows, stat.noise, stat.forces, stat.gust, gust_of_views(stat), stat.vaneless, fdi.bound, means,
        nu, alpha_cubed,
    )  # fmt: skip


@kernel
def compare_attitude(fdi, x):
    """Compare the turn of the attitude with the measured rates x, rad/s. After an alarm, if the attitude
    turns as well (score above 1), no gyro is the cause."""
    stat, att, detected = fdi.statistical, fdi.statistical.attitude, fdi.verdict.detected
    attitude.compare_attitude(att, stat.block, stat.rows.eta[0, :3], x, fdi.config.dt, detected)
    if detected and att.score > 1.0:
        gyro_or_attitude.rule_out_gyros(fdi.sensor_monitor)


@apart(long_loops=True)
def prepare_gusts(fdi, prediction, measured, k):
    """Prepare the tests of the frame after frame k: the gust that the vanes measure, noise, coefficients."""
    stat, dt = fdi.statistical, fdi.config.dt
    update_gusts(stat, fdi.bound.declared_errors.du, prediction, measured, k, dt)
    statistical.prepare_tests(stat, fdi.bound, prediction.design, measured, prediction.u, dt)


@apart(long_loops=True)
def add_gust_instant(fdi, prediction, measured):
    """Add an instant inside a frame to the gust that the vanes measure, and to its effect on the aircraft."""
    h = prediction.w * fdi.config.dt
    statistical.add_test_instant(fdi.statistical, fdi.bound, prediction.design, measured, prediction.u, h)


@kernel
def update_gusts(stat, du, pred, meas, k, dt):
    """Update the gust estimates, and the rows of the forces. If the inertial readings cannot be trusted, stop
    using accelerometers. du (n,) rad: errors of the deflections. k: number of the frame; dt s."""
    gust, vaneless, vaned, force = stat.gust, stat.vaneless, stat.vaned, stat.forces
    if gust.output.gusty:
        gusts.set_intensity(gust, meas.altitude)
        gusts.step_gust(gust, meas.y, meas.attitude, pred.w * dt, k)
    if not meas.inertial:
        forces.drop_forces(force, gust, vaneless, vaned)
    if force.in_use or gust.output.uses_accelerometers:
        gust.memory.f_read = meas.force
    if force.in_use:
        forces.update_forces(stat.rows, force, gust, du, meas, pred.u, dt)
        if vaneless.output.gusty:
            fill_vaneless_y(force, vaneless.memory.w_body, meas.y)
            step_view_gust(vaneless, force.y_free, pred, meas, k, dt)
        if vaned.output.gusty:
            step_view_gust(vaned, meas.y, pred, meas, k, dt)


@kernel
def step_view_gust(gust, y, pred, meas, k, dt):
    """Update a gust estimate by accelerometers that the views alone use, once a frame; y (5,) with its flow
    angles."""
    gust.memory.f_read = meas.force
    gusts.set_intensity(gust, meas.altitude)
    gusts.step_gust(gust, y, meas.attitude, dt, k)
    gusts.fill_gust_effect(gust, pred.design, meas.x, y, pred.u)
    gusts.begin_gust_sums(gust, y[AIRSPEED], dt)


@kernel
def gust_of_views(stat):
    """The gust estimate of the views that use vanes: their own, if accelerometers may break, or that of the
    rates."""
    return stat.vaned if stat.vaned.output.gusty else stat.gust


@apart
def advance_estimators_to_frame(fdi, prediction, measured, k, t):
    """Bring bank, likelihoods, isolation and FDAE to this frame."""
    concluded, bound, dt = fdi.verdict, fdi.bound, fdi.config.dt
    update_filters(fdi, prediction, measured)
    if fdi.statistical.test.enabled:
        update_tests(fdi, prediction, measured, k, t)
    update_estimators(fdi, prediction)
    if fdi.config.diagnoses_all_types:
        record_orders(fdi, prediction)
    leaks = concluded.isolated_estimator >= 0 or concluded.target >= 0
    x, F = prediction.x_before, prediction.F_known
    fdae.advance_fdae(fdi.fdae, fdi.bank, bound, x, F, concluded.detected, leaks, dt)


@apart
def update_verdict(fdi, prediction, measured, t):
    """From residuals to the alarm and a verdict, unless a sensor is at fault."""
    if sensor_monitor.has_alarm(fdi.sensor_monitor):
        return
    fdae.fdae_residual(fdi.fdae, measured.x)
    follow_alarm(fdi, measured, find_alarm_axis(fdi, measured.y, t), t)
    if fdi.verdict.detected:
        fdae.evaluate_network(fdi.fdae.network, measured.y[ALPHA], measured.y[BETA])


@kernel
def find_alarm_axis(fdi, y, t):
    """The axis on which a detector raises the alarm, or -1. An engine that fails before any alarm is outside
    the class: the alarm is in yaw, and no surface is isolated. y: measured signals."""
    limit = fdi.bound.error_map.Cn_now
    concluded = fdi.verdict
    if not concluded.detected and engine_monitor.detect_engine_failure(fdi.engine_monitor, limit, y):
        conclusion.set_isolated(concluded, UNANTICIPATED, t)
        return YAW
    return filters.alarm_axis(fdi.bank, fdi.config.authority, fdi.statistical.alarm)


@apart
def plugin_update(fdi, measured, t):
    """Take the plug-in's verdict, fdi.plugin_verdict. Its theta replaces that of the isolated estimator; an
    estimator has the number of its surface here (loop/plugin_frame.py)."""
    fdae.fdae_residual(fdi.fdae, measured.x)
    conclusion.record_plugin_verdict(fdi.verdict, fdi.plugin_verdict, t)
    if fdi.verdict.isolated_estimator >= 0:
        fdi.isolation.estimator[fdi.verdict.isolated_estimator].theta[:] = fdi.plugin_verdict.theta
    if fdi.verdict.detected:
        fdae.evaluate_network(fdi.fdae.network, measured.y[ALPHA], measured.y[BETA])
