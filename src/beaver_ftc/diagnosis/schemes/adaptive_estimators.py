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

from beaver_ftc.aircraft import YAW
from beaver_ftc.compiled import apart, kernel
from beaver_ftc.design.table import ALPHA, BETA
from beaver_ftc.diagnosis import conclusion, estimators, isolation
from beaver_ftc.diagnosis.conclusion import UNANTICIPATED
from beaver_ftc.diagnosis.config import STATISTICAL_DETECTOR, WORST_CASE_DETECTOR
from beaver_ftc.diagnosis.detection import fdae, filters
from beaver_ftc.diagnosis.monitors import engine_monitor, sensor_monitor
from beaver_ftc.diagnosis.schemes.statistical_frame import update_tests
from beaver_ftc.diagnosis.types import examination, frame_blocks, modes, pairs, verdict


@kernel
def update_filters(fdi, pred, meas):
    """Bring the detection filters from the frame before to this one: innovation, residuals and thresholds."""
    filters.update_bank(fdi.bank, fdi.bound, meas.x, pred.x_before, pred.means.F, fdi.config.dt)


@kernel
def update_estimators(fdi, pred):
    """Bring the isolation estimators from the frame before to this one; the bank must have its innovation.

    With a broken sensor they stay as they are: the reading that replaces it follows from the design model.
    """
    iso = fdi.isolation
    means = pred.means
    detected = fdi.verdict.detected
    isolation.update_effects(iso, fdi.bank, fdi.bound, fdi.config, detected, means.G, means.Gu, means.e_Gu)
    if detected and not sensor_monitor.has_alarm(fdi.sensor_monitor):
        estimators.advance_estimators(iso, fdi.bound, pred.x_before, means.F, fdi.config.dt)


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

    Where sensors are monitored, the isolation starts when `sensor_monitor.allows_isolation` holds: one frame
    after the alarm, because the attitude reveals a gyro fault one frame late, or later where it is noisy.
    While a gyro is in doubt, exclusions are only pending. With a broken engine nothing is isolated.
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
    stat = fdi.statistical
    iso = fdi.isolation
    if stat.alarm.detected_at_s >= 0.0:
        hidden = fdi.sensor_monitor.config.enabled and stat.gust.output.gusty
        isolation.update_likelihood(
            iso.estimator[j], stat.test, stat.block, iso, fdi.layout.loss, fdi.config.abrupt, hidden
        )


@apart(long_loops=True)
def weigh_position(fdi, j):
    """Fill `unlikely` of estimator j by the parity views."""
    fies = fdi.isolation.estimator
    G = fies[fdi.layout.position[fies[j].surface]].effect.Z
    isolation.weigh_views(fies[j], fdi.statistical, G)


@kernel
def exclude_or_wait(fdi, fie, possible, t):
    """Exclude the fault of estimator fie at t s, unless it is possible and no exclusion is pending.

    Where sensors are monitored, a fault that has been isolated is excluded a frame later: a broken gyro may
    have contradicted it, and the attitude reveals the gyro a frame late. While a gyro may be the cause of the
    alarm, an exclusion is only pending.
    """
    if not possible or fie.pending:
        monitor = fdi.sensor_monitor
        waits = monitor.config.enabled and fdi.verdict.from_s[fie.surface] >= 0.0
        isolation.exclude_fault(fie, t, waits, sensor_monitor.doubts_gyros(monitor))


@kernel
def isolate(fdi, meas, t, before):
    """Exclude faults at t s, and decide; before: whether the alarm came a frame or more ago. If only
    the exclusions of the statistical detector count, the worst case excludes nothing. While a gyro may be the
    cause of the alarm, nothing is decided."""
    cfg = fdi.config
    iso = fdi.isolation
    nu_max = fdi.bound.nu_max
    for j, fie in enumerate(iso.estimator[: iso.config.n_estimators]):
        possible = isolation.fault_possible(iso, fie, fdi.bank, nu_max, cfg.abrupt, meas.x, before)
        possible = possible or cfg.exclusion_authority == STATISTICAL_DETECTOR
        if possible and cfg.exclusion_authority != WORST_CASE_DETECTOR:
            if cfg.diagnoses_all_types:
                weigh_position(fdi, j)
            else:
                weigh_loss(fdi, j)
            possible = not fie.unlikely
        exclude_or_wait(fdi, fie, possible, t)
    if cfg.diagnoses_all_types:
        decide_type(fdi, t, before)
    elif not sensor_monitor.doubts_gyros(fdi.sensor_monitor):
        conclusion.set_isolated(fdi.verdict, isolation.decide_isolation(iso, t), t)


@apart
def decide_type(fdi, t, before):
    """Examine the frame, in the frame of the alarm only with pairs or `reach`. Then decide on which
    surface, or two of them, there is a fault, and of which type, unless a gyro may be the cause of the alarm.
    """
    types = fdi.types
    layout = fdi.layout
    fies = fdi.isolation.estimator
    for s, srf in enumerate(types.surface):
        srf.not_at_position = fies[layout.position[s]].excluded
    if types.pair.enabled:
        pairs.observe_pairs(types, layout, fies, fdi.bank, fdi.bound.nu_max)
    elif before or fdi.isolation.config.reach:
        examination.observe_frame(types, layout, fies, fdi.bank.output.innovation, fdi.bound)
    if sensor_monitor.doubts_gyros(fdi.sensor_monitor):
        return
    if types.pair.enabled:
        finding = pairs.decide_pairs(types, fdi.verdict, layout, t)
    else:
        finding = verdict.decide_single(types, fdi.verdict, layout, t)
    conclusion.record_decision(fdi.verdict, finding, modes.accommodate(types, layout))


@apart
def begin_types(fdi):
    """Start the feasible sets of all types at the alarm, with no knowledge of any fault."""
    for srf in fdi.types.surface:
        examination.restart_surface(srf)


@apart
def record_orders(fdi, prediction):
    """Record what each surface was commanded in the elapsed frame."""
    frame_blocks.record_commands(fdi.types, prediction.commanded, prediction.means)


@apart
def advance_estimators_to_frame(fdi, prediction, measured, k, t):
    """Bring bank, likelihoods, isolation and FDAE to this frame."""
    concluded = fdi.verdict
    update_filters(fdi, prediction, measured)
    if fdi.statistical.test.enabled:
        update_tests(fdi, prediction, measured, k, t)
    update_estimators(fdi, prediction)
    if fdi.config.diagnoses_all_types:
        record_orders(fdi, prediction)
    leaks = concluded.isolated_estimator >= 0 or concluded.target >= 0
    fdae.advance_fdae(
        fdi.fdae, fdi.bank, fdi.bound, prediction.x_before, prediction.F_known, concluded.detected, leaks,
        fdi.config.dt,
    )  # fmt: skip


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
    the class: the alarm is in yaw, the verdict UNANTICIPATED, and no surface is isolated. y: measured
    signals."""
    limit = fdi.bound.error_map.Cn_now
    concluded = fdi.verdict
    if not concluded.detected and engine_monitor.detect_engine_failure(fdi.engine_monitor, limit, y):
        conclusion.set_isolated(concluded, UNANTICIPATED, t)
        return YAW
    return filters.alarm_axis(fdi.bank, fdi.config.authority, fdi.statistical.alarm)


@apart
def plugin_update(fdi, measured, t):
    """Take the plug-in's verdict, fdi.plugin_verdict. Its theta replaces that of the isolated estimator; an
    estimator has the number of its surface here (loop/plugin_setup.py)."""
    fdae.fdae_residual(fdi.fdae, measured.x)
    conclusion.record_plugin_verdict(fdi.verdict, fdi.plugin_verdict, t)
    if fdi.verdict.isolated_estimator >= 0:
        fdi.isolation.estimator[fdi.verdict.isolated_estimator].theta[:] = fdi.plugin_verdict.theta
    if fdi.verdict.detected:
        fdae.evaluate_network(fdi.fdae.network, measured.y[ALPHA], measured.y[BETA])
