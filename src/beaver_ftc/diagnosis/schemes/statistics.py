"""The statistical detector within our scheme: how its stages (air, noise, likelihoods, parity) follow."""

from beaver_ftc.compiled import apart, kernel
from beaver_ftc.design.model import AIRSPEED, unanticipated_pitch
from beaver_ftc.diagnosis.belief import air
from beaver_ftc.diagnosis.belief.expectation import form_innovation, predict_next
from beaver_ftc.diagnosis.detection import forces, parity, statistical
from beaver_ftc.diagnosis.detection.signatures import fill_block_signatures


@apart
def compare_likelihoods(fdi, belief, measured, k, t):
    """Test the innovation of the elapsed frame, which ends frame k at t s, for every hypothesis."""
    detector, y, bounded = fdi.statistical, measured.y, fdi.statistical.noise.bounded
    tests, blocks, gust, force_record = detector.tests, detector.block, detector.air, detector.forces
    views, inertial, mean = detector.views[: detector.n_views], detector.inertial_air, belief.means
    innovation, dt = fdi.bank.output.innovation, fdi.config.dt
    air.average_frame(gust, belief.share)
    if inertial.output.moving:
        air.average_frame(inertial, belief.share)
    predict_next(mean)
    fill_block_signatures(blocks, mean.Gu_predicted, unanticipated_pitch(belief.design, y, 1.0))
    latched, ends = detector.alarm.detected_at_s >= 0.0, not fdi.config.abrupt
    statistical.update_blocks(tests, bounded, blocks, gust, innovation, dt, k, latched, ends)
    parity.update_directions(views, force_record, gust, fdi.bound, mean.G_predicted, mean.Gu_predicted)
    parity.project_innovation(
        views, tests.tolerated, detector.noise, blocks, force_record, gust, inertial, innovation, y[AIRSPEED]
    )
    parity.update_views(views, tests, detector.tone_config, y, dt, k, latched)
    known = fdi.bound.error_map.outside == 0
    statistical.update_alarm(detector.alarm, tests, blocks, views, force_record, gust, t, known)
    form_innovation(belief, measured.x, dt)
    statistical.track_residual_mean(blocks, gust, belief.innovation_after_known_faults, dt)


@apart
def prepare(fdi, belief, measured, k):
    """Prepare the tests of the frame after frame k: the gust that the vanes measure, noise, coefficients."""
    detector, dt = fdi.statistical, fdi.config.dt
    tests, noise, gust = detector.tests, detector.noise, detector.air
    update_air(gust, detector.inertial_air, detector.forces, belief, measured, k, dt)
    statistical.prepare(tests, noise, detector.block, gust, fdi.bound, belief.design, measured, belief.u, dt)


@apart
def accumulate(fdi, belief, measured):
    """Take in the gust that the vanes measure inside a frame, and what it does to the aircraft."""
    detector, dt = fdi.statistical, belief.share * fdi.config.dt
    tests, noise, gust = detector.tests, detector.noise, detector.air
    statistical.accumulate_substep(
        tests, noise, detector.block, gust, fdi.bound, belief.design, measured, belief.u, dt
    )


@kernel
def update_air(gust, inertial, force_record, belief, measured, k, dt):
    """Take in the air as the vanes see it, and what the accelerometers say of it (forces.py)."""
    if gust.output.moving:
        air.set_intensity(gust, measured.altitude)
        air.update(gust, measured.y, measured.attitude, belief.share * dt, k)
    if (force_record.known or gust.output.uses_accelerometers) and not measured.inertial:
        forces.stop_forces(force_record, gust, inertial)
    if force_record.known or gust.output.uses_accelerometers:
        air.take_accelerometers(gust, measured.force)
    if force_record.known:
        update_inertial_air(gust, inertial, force_record, belief, measured, k, dt)


@kernel
def update_inertial_air(gust, inertial, force_record, belief, measured, k, dt):
    """Take in what the accelerometers say, and the air as it follows from them without the vanes."""
    forces.update(force_record, gust, measured, belief.u, dt)
    if inertial.output.moving:
        forces.fill_readings_without_vanes(force_record, inertial.memory.rotation, measured.y)
        air.take_accelerometers(inertial, measured.force)
        air.set_intensity(inertial, measured.altitude)
        air.update(inertial, force_record.y, measured.attitude, dt, k)
        air.fill_effect(inertial, belief.design, measured.x, force_record.y, belief.u)
        air.begin_sums(inertial, force_record.y[AIRSPEED], dt)
