"""How the statistical detector is brought to a frame, in the order of the calls:

add_gust_instant    each JSBSim frame inside: the gust that the vanes measure, its effect, rows of the rates
update_tests        at its end: the innovation against every hypothesis
prepare_gusts       then for the next frame: gust estimates, rows of the forces, noise, coefficients

fdi             record of `schemes.fdi_dtype`
prediction      of the design model (pred)
measured        readings of the sensors (meas)
k, t            number of the frame; its time, s
"""

from beaver_ftc.compiled import apart, kernel
from beaver_ftc.design.model import unanticipated_pitch
from beaver_ftc.design.table import AIRSPEED
from beaver_ftc.diagnosis import gusts
from beaver_ftc.diagnosis.detection import attitude, forces, parity, statistical
from beaver_ftc.diagnosis.detection.flow_angles import fill_vaneless_y
from beaver_ftc.diagnosis.detection.rates import finish_rows
from beaver_ftc.diagnosis.model_prediction import innovation_known
from beaver_ftc.diagnosis.monitors import gyro_or_attitude


@apart(long_loops=True)
def update_tests(fdi, prediction, measured, k, t):
    """Test the innovation of the elapsed frame, which ends at frame k, t s, for every hypothesis: in the
    blocks of the rates, against the attitude, and in the parity views. Then update the alarm, and filter for
    the law the innovation after known faults."""
    stat = fdi.statistical
    y = measured.y
    dt = fdi.config.dt
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
    stat = fdi.statistical
    means = prediction.means
    nu = fdi.bank.output.innovation
    gusts.finish_gust(stat.gust, prediction.w)
    for gust in (stat.vaneless, stat.vaned):
        if gust.output.gusty:
            gusts.finish_gust(gust, prediction.w)
    alpha_cubed = unanticipated_pitch(prediction.design, y, 1.0)
    finish_rows(
        stat.rows, stat.noise, stat.forces, stat.gust, gust_of_views(stat), stat.vaneless, fdi.bound, means,
        nu, alpha_cubed,
    )  # fmt: skip


@kernel
def compare_attitude(fdi, x):
    """Compare the turn of the attitude with the measured rates x, rad/s. After an alarm, if the attitude
    turns as well (score above 1), no gyro is the cause."""
    stat = fdi.statistical
    att = stat.attitude
    detected = fdi.verdict.detected
    attitude.compare_attitude(att, stat.block, stat.rows.eta[0, :3], x, fdi.config.dt, detected)
    if detected and att.score > 1.0:
        gyro_or_attitude.rule_out_gyros(fdi.sensor_monitor)


@apart(long_loops=True)
def prepare_gusts(fdi, prediction, measured, k):
    """Prepare the tests of the frame after frame k: gust estimates, rows of the forces, noise,
    coefficients."""
    stat = fdi.statistical
    dt = fdi.config.dt
    update_gusts(stat, fdi.bound.declared_errors.du, prediction, measured, k, dt)
    statistical.prepare_tests(stat, fdi.bound, prediction.design, measured, prediction.u, dt)


@apart(long_loops=True)
def add_gust_instant(fdi, prediction, measured):
    """Add an instant inside a frame to the gust that the vanes measure, its effect, and the rows of the
    rates."""
    dt = prediction.w * fdi.config.dt
    statistical.add_test_instant(fdi.statistical, fdi.bound, prediction.design, measured, prediction.u, dt)


@kernel
def update_gusts(stat, du, pred, meas, k, dt):
    """Update the gust estimates, and the rows of the forces. If the inertial readings cannot be trusted, stop
    using accelerometers. du (n,) rad: errors of the deflections. k: number of the frame; dt s."""
    gust = stat.gust
    vaneless = stat.vaneless
    vaned = stat.vaned
    force = stat.forces
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
    """Update, once a frame, a gust estimate by accelerometers that the views alone use; y (N_Y,): readings
    with the flow angles to be used."""
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
