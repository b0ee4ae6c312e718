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
    chances, y, bounded = fdi.statistical, measured.y, fdi.statistical.noise.bounded
    tests, blocks, seen, felt = chances.tests, chances.block, chances.air, chances.forces
    views, inertial, mean = chances.views[: chances.n_views], chances.inertial_air, belief.means
    innovation, dt = fdi.bank.output.innovation, fdi.config.dt
    air.average_frame(seen, belief.share)
    if inertial.output.moving:
        air.average_frame(inertial, belief.share)
    predict_next(mean)
    fill_block_signatures(blocks, mean.Gu_predicted, unanticipated_pitch(belief.design, y, 1.0))
    latched, ends = chances.alarm.detected_at_s >= 0.0, not fdi.config.abrupt
    statistical.update_blocks(tests, bounded, blocks, seen, innovation, dt, k, latched, ends)
    parity.update_directions(views, felt, seen, fdi.bound, mean.G_predicted, mean.Gu_predicted)
    parity.project_innovation(
        views, tests.tolerated, chances.noise, blocks, felt, seen, inertial, innovation, y[AIRSPEED]
    )
    parity.update_views(views, tests, chances.tone_config, y, dt, k, latched)
    known = fdi.bound.error_map.outside == 0
    statistical.update_alarm(chances.alarm, tests, blocks, views, felt, seen, t, known)
    form_innovation(belief, measured.x, dt)
    statistical.track_residual_mean(blocks, seen, belief.innovation_after_known_faults, dt)


@apart
def prepare(fdi, belief, measured, k):
    """Prepare the tests of the frame after frame k: the gust that the vanes measure, noise, coefficients."""
    chances, dt = fdi.statistical, fdi.config.dt
    tests, noise, seen = chances.tests, chances.noise, chances.air
    see_air(seen, chances.inertial_air, chances.forces, belief, measured, k, dt)
    statistical.prepare(tests, noise, chances.block, seen, fdi.bound, belief.design, measured, belief.u, dt)


@apart
def accumulate(fdi, belief, measured):
    """Take in the gust that the vanes measure inside a frame, and what it does to the aircraft."""
    chances, dt = fdi.statistical, belief.share * fdi.config.dt
    tests, noise, seen = chances.tests, chances.noise, chances.air
    statistical.accumulate_substep(
        tests, noise, chances.block, seen, fdi.bound, belief.design, measured, belief.u, dt
    )


@kernel
def see_air(seen, inertial, felt, belief, measured, k, dt):
    """Take in the air as the vanes see it, and what the accelerometers say of it (forces.py)."""
    if seen.output.moving:
        air.set_intensity(seen, measured.altitude)
        air.update(seen, measured.y, measured.attitude, belief.share * dt, k)
    if (felt.known or seen.output.uses_accelerometers) and not measured.inertial:
        forces.do_without(felt, seen, inertial)
    if felt.known or seen.output.uses_accelerometers:
        air.take_accelerometers(seen, measured.force)
    if felt.known:
        weigh_forces(seen, inertial, felt, belief, measured, k, dt)


@kernel
def weigh_forces(seen, inertial, felt, belief, measured, k, dt):
    """Take in what the accelerometers say, and the air as it follows from them without the vanes."""
    forces.look(felt, seen, measured, belief.u, dt)
    if inertial.output.moving:
        forces.without_vanes(felt, inertial.memory.rotation, measured.y)
        air.take_accelerometers(inertial, measured.force)
        air.set_intensity(inertial, measured.altitude)
        air.update(inertial, felt.y, measured.attitude, dt, k)
        air.fill_effect(inertial, belief.design, measured.x, felt.y, belief.u)
        air.begin_sums(inertial, felt.y[AIRSPEED], dt)
