"""One frame of the closed loop, compiled: measure, diagnose, decide, command, record.

    measure     plant/sensing.py          the truth, and what the instruments make of it
    diagnose    diagnosis/                what is believed of the aircraft, and whether it still holds
    decide      control/supervisor.py     the mode
    command     control/                  the surfaces, and the engine
    outer loops control/outer/            the reference of the next frame, if a profile is to be flown
    record      accounts.py, log_row.py   the metrics' sums, a row of the log

Each stage has records of its own; what a flight remembers is all of them in one (assembly.py), which only the
kernels of this file see whole. Python calls them through stepping.py. The command computed in a frame is in
effect from the next on.
"""

import numpy as np

from beaver_ftc.compiled import apart, kernel
from beaver_ftc.control import allocation, power, reference, supervisor
from beaver_ftc.control.laws import table
from beaver_ftc.control.outer.autopilot import judge, steer
from beaver_ftc.design.model import AIRSPEED, ALPHA, BETA, unanticipated_pitch
from beaver_ftc.diagnosis import assessment as assessed
from beaver_ftc.diagnosis import conclusion, scheme
from beaver_ftc.diagnosis.assessment import assess, assess_unknown
from beaver_ftc.diagnosis.belief import air
from beaver_ftc.diagnosis.belief.expectation import (
    begin_frame,
    expect,
    follow_command,
    foresee,
    form_innovation,
    look,
    look_back,
    respond,
)
from beaver_ftc.diagnosis.detection import bank, fdae, parity, statistical
from beaver_ftc.diagnosis.detection.signatures import sign_blocks
from beaver_ftc.diagnosis.isolation import by_chance, estimators
from beaver_ftc.diagnosis.monitors import engine_symmetry, sensor_monitor
from beaver_ftc.diagnosis.schemes import table as schemes
from beaver_ftc.diagnosis.state import PITCH, STATISTICS, WORST_CASE
from beaver_ftc.diagnosis.types import examine, verdict
from beaver_ftc.loop import accounts, log_row
from beaver_ftc.loop.log_row import put
from beaver_ftc.plant import channels as ch
from beaver_ftc.plant.sensing import NOT_FINITE, flight_status, hand_over, measure


@apart
def watch_instruments(frame):
    """Hold the instruments against one another; what is known to be broken is replaced. What an instant
    inside a frame shows is known with that frame."""
    fdi, watch, engine = frame.fdi, frame.fdi.watch, frame.control.power.output
    before, t = watch.output.alarmed, frame.k * frame.dt
    if engine.in_use:
        sensor_monitor.note_command(watch, engine.command[0])
    sensor_monitor.monitor(watch, frame.belief, frame.measured, fdi.verdict, fdi.bank, fdi.bound, frame.dt, t)
    if watch.output.alarmed and not (before or watch.output.beside):
        reset_surface_diagnosis(fdi)


@kernel
def reset_surface_diagnosis(fdi):
    """Discard what the diagnosis of the surfaces made of a broken sensor."""
    conclusion.void(fdi.verdict)
    verdict.clear_modes(fdi.types.surface)
    fdae.reset_network(fdi.fdae.network)


@kernel
def sense(frame):
    """Measure, and see what the design model makes of this instant. Returns the flight's status."""
    truth, belief, measured = frame.truth, frame.belief, frame.measured
    measure(truth, frame.instruments, measured)
    if frame.fdi.watch.config.enabled:
        watch_instruments(frame)
    status = flight_status(truth.value, truth.ground_m, truth.slow_mps)
    if status != NOT_FINITE:
        respond(belief, measured)
        accounts.effect_of_faults(frame.accounts.guarantee, truth, belief, measured.y)
    return status


@kernel
def start_clock(frame):
    """Set the time of the frame, s since the start."""
    frame.t = frame.k * frame.dt


@kernel
def advance_clock(frame):
    """Count the frame: it is over."""
    frame.k += 1


@kernel
def begin(frame):
    """Measure, and see what the design model makes of the elapsed frame. Returns the flight's status."""
    start_clock(frame)
    status = sense(frame)
    if status != NOT_FINITE:
        look_back(frame.belief, frame.fdi.bound, frame.measured, frame.k, frame.dt)
    return status


@kernel
def begin_filters(fdi, x):
    """Begin the detection filters at the first measurement x (3,) rad/s."""
    fdae.begin(fdi.fdae, fdi.bound.noise, x)
    bank.begin(fdi.bank, fdi.bound.noise)


@kernel
def diagnose(frame):
    """The built-in diagnosis, from prediction to verdict; with scheme `none`, nothing is concluded."""
    fdi, k = frame.fdi, frame.k - frame.since
    if k == 0:
        begin_filters(fdi, frame.measured.x)
    if fdi.config.enabled:
        if k > 0:
            predict(frame, k)
        else:
            bank.align(fdi.isolation, frame.belief.G)
        differences = frame.control.power.output.command[1:]
        engine_symmetry.disable_if_differential_thrust(fdi.engines, differences)
        conclude(fdi, frame.belief, frame.measured, frame.t)
    make_ready(frame, k)


@kernel
def take_verdict(frame):
    """Take a plug-in's verdict, which is in frame.verdict, in place of the built-in diagnosis; the estimator
    that serves the laws is brought up to date."""
    fdi, measured, k = frame.fdi, frame.measured, frame.k - frame.since
    if k == 0:
        begin_filters(fdi, measured.x)
    else:
        predict(frame, k)
    fdae.form_residual(fdi.fdae, measured.x)
    conclusion.note_plugin(fdi.verdict, frame.verdict, frame.t)
    estimators.take_estimate(fdi.isolation, fdi.verdict.isolated, frame.verdict.theta)
    if fdi.verdict.detected:
        fdae.evaluate(fdi.fdae.network, measured.y[ALPHA], measured.y[BETA])
    make_ready(frame, k)


@kernel
def predict(frame, k):
    """Bring the estimators from the frame before to this one; k: number of the diagnosis' frame.

    What the law takes each surface for is expected: what is known of a fault is no surprise.
    """
    fdi, belief, chances, surfaces = frame.fdi, frame.belief, frame.fdi.statistical, frame.control.surfaces
    config, bound, found, dt = fdi.config, fdi.bound, fdi.verdict, fdi.config.dt
    x, x_then, mean = frame.measured.x, belief.x_then, belief.means
    bank.innovate(fdi.bank, bound, x, x_then, mean.acceleration, dt)
    if chances.tests.enabled:
        compare_likelihoods(frame, k)
    known, spread = found.detected, mean.Gu_spread
    estimators.suppose_all(fdi.isolation, fdi.bank, bound, config, known, mean.G, mean.Gu, spread)
    if config.every_type:
        examine.note_orders(fdi.types, belief.commanded, mean)
    if known:
        estimators.predict_all(fdi.isolation, bound, x_then, mean.acceleration, dt)
    expect(belief, known, surfaces.output.effectiveness, surfaces.output.offset, config.every_type)
    if chances.tests.enabled:
        form_innovation(belief, x, dt)
        statistical.follow_rest(chances.block, chances.air, belief.innovation_after_known_faults, dt)
    schemes.predict(config.scheme, fdi, belief)


@apart
def compare_likelihoods(frame, k):
    """Show the statistical detector the elapsed frame."""
    fdi, belief, chances, y = frame.fdi, frame.belief, frame.fdi.statistical, frame.measured.y
    tests, noise, blocks, felt = chances.tests, chances.noise, chances.block, chances.forces
    seen, inertial, views = chances.air, chances.inertial_air, chances.views[: chances.n_views]
    mean, innovation, dt = belief.means, fdi.bank.output.innovation, fdi.config.dt
    air.elapse(seen, belief.share)
    if inertial.output.moving:
        air.elapse(inertial, belief.share)
    foresee(mean)
    sign_blocks(blocks, mean.Gu_foreseen, unanticipated_pitch(belief.design, y, 1.0))
    latched, ends = chances.alarm.detected_at_s >= 0.0, not fdi.config.abrupt
    statistical.observe(tests, noise.bounded, blocks, seen, innovation, dt, k, latched, ends)
    parity.face(views, felt, seen, fdi.bound, mean.G_foreseen, mean.Gu_foreseen)
    parity.compose(views, tests.tolerated, noise, blocks, felt, seen, inertial, innovation, y[AIRSPEED])
    parity.observe(views, tests, chances.listening, y, dt, k, latched)
    known = fdi.bound.error_map.outside == 0
    statistical.score(chances.alarm, tests, blocks, views, felt, seen, frame.t, known)


@kernel
def conclude(fdi, belief, measured, t):
    """From residuals to alarm, and from then on to a verdict.

    Where instruments are watched, a surface waits a frame after the alarm: that much later the attitude shows
    what a gyro did; a blurred one, later. Once it or an engine is found broken, no surface is named.
    """
    if sensor_monitor.speaks(fdi.watch):
        return
    known, every_type = fdi.verdict.detected, fdi.config.every_type
    fdae.form_residual(fdi.fdae, measured.x)
    schemes.detect(fdi.config.scheme, fdi, belief, measured, t)
    if not fdi.verdict.detected:
        return
    if not known:
        scheme.begin_isolation(fdi.isolation, fdi.types, every_type, fdi.bound.noise, measured.x)
    sound = not sensor_monitor.shown_from_the_start(fdi.watch, fdi.verdict.detected_at_s)
    if sound and sensor_monitor.clears_surfaces(fdi.watch, known) and not fdi.engines.output.failed:
        isolate(fdi, measured.x, t, known)
    schemes.evaluate(fdi.config.scheme, fdi, measured)


@kernel
def isolate(fdi, x, t, started):
    """Test every estimator against the measured x (3,) rad/s, and decide; started: a frame or more ago."""
    config, records, bound = fdi.config, fdi.isolation, fdi.bound
    for s in range(records.config.n):
        fie = records.estimator[s]
        can_be = estimators.possible(records, fie, fdi.bank, bound.frame, config.abrupt, x, started)
        if rules_out(fdi, fie, can_be):
            estimators.exclude(fie, t)
    if config.every_type:
        scheme.isolate_type(fdi.types, fdi.verdict, fdi.layout, records, fdi.bank, bound, t, started)
    else:
        conclusion.note_isolated(fdi.verdict, estimators.decide(records, t), t)


@kernel
def rules_out(fdi, fie, within):
    """Whether a fault is excluded by those in authority; `within`: it is possible in the worst case.

    Of faults of every type the sets know the course; chance, which axes are moved. Within the class, chance
    that has raised no alarm has nothing to say about the alarm of the sets.
    """
    config, chances, layout, estimators = fdi.config, fdi.statistical, fdi.layout, fdi.isolation.estimator
    tests = chances.tests
    if config.authority == WORST_CASE or (config.every_type and not within):
        return not within
    if config.every_type:
        column, views = estimators[layout.position_of[fie.surface]].effect.Z, chances.views[: chances.n_views]
        felt, seen = chances.forces, chances.air
        return tests.enabled and parity.excludes(views, tests, felt, seen, fie.surface, column)
    if config.authority != STATISTICS and not within:
        return True
    if not tests.enabled or chances.alarm.detected_at_s < 0.0:
        return False
    hidden = fdi.watch.config.enabled and chances.air.output.moving
    by_chance.weigh(fie, tests, chances.block, fdi.isolation, layout.loss_of, config.abrupt, hidden)
    return fie.improbable == 1


@kernel
def make_ready(frame, k):
    """Make ready for the frame to come: begin its sums, and put where the law reads it what is concluded."""
    fdi, belief = frame.fdi, frame.belief
    if fdi.statistical.tests.enabled:
        look_ahead(frame, k)
    begin_frame(belief, fdi.bound, fdi.layout, fdi.config.every_type, frame.measured)
    accounts.follow_guarantee(frame.accounts.guarantee, fdi.bank, fdi.config.dt, belief.share, k, frame.t)
    assess_faults(frame)
    note_names(fdi, frame.t)


@kernel
def assess_faults(frame):
    """Put what the diagnosis says of each surface, and of what is unknown, where the law reads it."""
    fdi, assessment = frame.fdi, frame.assessment
    config, found, types, layout, chances = fdi.config, fdi.verdict, fdi.types, fdi.layout, fdi.statistical
    assess(assessment, config, found, types, layout, fdi.isolation.estimator, chances)
    assess_unknown(assessment, config, found, types, layout, chances, fdi.fdae, fdi.bound)


@kernel
def note_names(fdi, t):
    """Note which surfaces are named: those of a pair, or the one isolated; none once an instrument is found
    broken."""
    pairs, void = fdi.config.every_type and fdi.types.pair.enabled, sensor_monitor.speaks(fdi.watch)
    only = conclusion.isolated_surface(fdi.verdict, fdi.isolation.estimator)
    for s in range(fdi.types.surface.size):
        named = fdi.types.surface[s].status.named if pairs else s == only
        conclusion.note_name(fdi.verdict, s, named and not (void and not fdi.watch.output.beside), t)


@apart
def look_ahead(frame, k):
    """Ready the statistical detector for the next frame: the air as it is seen, noise, coefficients."""
    fdi, belief, measured, chances = frame.fdi, frame.belief, frame.measured, frame.fdi.statistical
    tests, noise, seen, dt = chances.tests, chances.noise, chances.air, fdi.config.dt
    scheme.see_air(seen, chances.inertial_air, chances.forces, belief, measured, k, dt)
    statistical.prepare(tests, noise, chances.block, seen, fdi.bound, belief.design, measured, belief.u, dt)


@apart
def look_at_air(frame):
    """Take in the gust that the vanes see by now, and what it does."""
    fdi, belief, measured, chances = frame.fdi, frame.belief, frame.measured, frame.fdi.statistical
    tests, noise, seen, dt = chances.tests, chances.noise, chances.air, belief.share * fdi.config.dt
    statistical.look(tests, noise, chances.block, seen, fdi.bound, belief.design, measured, belief.u, dt)


@kernel
def look_on(frame):
    """Take in an instant inside a frame: what is believed of it, and the gust that the vanes see by then."""
    fdi = frame.fdi
    if fdi.statistical.tests.enabled:
        look_at_air(frame)
    look(frame.belief, fdi.bound, fdi.layout, fdi.config.every_type, frame.measured)


@kernel
def isolated_theta(fdi, s):
    """Estimated theta of the isolated loss of surface s: see assessment.py."""
    return assessed.isolated_theta(
        fdi.config, fdi.verdict, fdi.layout, fdi.isolation.estimator, fdi.statistical, s
    )


@kernel
def decide(frame):
    """The mode for this frame."""
    control, layout, informed = frame.control, frame.control.layout, frame.control.config.informed
    accounts.share_faults(frame.truth, frame.faults, informed)
    if informed:
        wanted = supervisor.true_mode(layout.main[PITCH], frame.faults)
    else:
        wanted = supervisor.mode_from(control.config, layout, frame.fdi.verdict, frame.assessment)
    supervisor.supervise(frame.supervisor, wanted, frame.t)


@kernel
def accommodate(frame):
    """How effective the law takes each surface to be."""
    law, belief = frame.control.config.law, frame.belief
    table.accommodate(law, frame.control, frame.assessment, frame.faults, belief, frame.measured)


@kernel
def take_command(frame, deflections):
    """A command (n,) rad from outside, within the travel of each surface."""
    accommodate(frame)
    allocation.take_command(frame.control.allocation.output, frame.control.layout, deflections)


@kernel
def command(frame):
    """The law's command; or that of whoever commands in its place."""
    control, mode = frame.control, frame.supervisor.mode
    if frame.held:
        take_command(frame, frame.held_rad)
        return
    accommodate(frame)
    table.command(
        control.config.law, control, frame.assessment, frame.faults, frame.belief, frame.measured, mode,
        frame.t,
    )  # fmt: skip


@apart
def fly_profile(frame, commanded):
    """Add the outer loops' body rates to what is commanded (3,) rad/s, and set the engine."""
    autopilot, control, belief, value = frame.autopilot, frame.control, frame.belief, frame.truth.value
    unexplained, elevator = control.axes.disturbance[PITCH], control.layout.main[PITCH]
    if unexplained != 0.0:
        unexplained /= belief.G[PITCH, elevator]  # rad of the elevator
    steer(autopilot, control, belief.u, frame.measured, unexplained, frame.t)
    if autopilot.sets_power:
        power.follow_autopilot(control.power, autopilot.setting, autopilot.power_airspeed)
    judge(autopilot, value[ch.ALTITUDE], value[ch.AIRSPEED], value[ch.PHI + 2], value[ch.PHI], frame.t)
    for i in range(3):
        commanded[i] += autopilot.rates[i]


@kernel
def account(frame):
    """Advance the metrics' sums by this frame; before a fault, the closest approach to an alarm."""
    control, truth, sums = frame.control, frame.truth, frame.accounts
    accounts.track(sums.tracking, truth, control.reference.output.model_rate)
    if truth.faulted:
        accounts.account_authority(sums.authority, control.axes)
    else:
        bank.note_closest_approach(frame.fdi.bank)
        statistical.note_closest_approach(frame.fdi.statistical.alarm)
    saturated, dt = control.allocation.output.saturated, control.reference.config.dt
    accounts.account_surfaces(sums, truth, saturated, frame.k, dt)
    accounts.note_envelope(sums.envelope, truth.value[ch.ENVELOPE] < 0.5, frame.t)
    accounts.note_inconclusive(sums.inconclusive, frame.fdi, frame.t)


@kernel
def record(frame, commanded, row):
    """Write the row of a frame in the order of channels.log_columns; commanded (3,) rad/s."""
    control, fdi, belief, logged = frame.control, frame.fdi, frame.belief, frame.logged
    saturated, effectiveness = control.allocation.output.saturated, control.surfaces.output.effectiveness
    row[:] = np.nan
    column = log_row.record_truth(frame.truth, frame.t, row)
    column = put(row, column, frame.measured.x)
    column = put(row, column, commanded)
    column = put(row, column, control.reference.output.model_rate)
    column = log_row.record_surfaces(frame.truth, belief.commanded, saturated, row, column)
    column = log_row.record_alarm(fdi.bank, row, column)
    column = put(row, column, fdi.fdae.output.residual)
    column = put(row, column, fdi.fdae.output.threshold)
    column = put(row, column, fdi.bound.eta_bar)
    column = put(row, column, fdi.fdae.network.output)
    column = put(row, column, belief.means.acceleration)
    for e in range(logged.estimators):
        if e < fdi.isolation.config.n:  # else another diagnosis has taken their place
            log_row.record_estimator(fdi.isolation.estimator[e], fdi.verdict.detected, row, column)
        column += log_row.PER_ESTIMATOR
    column = put(row, column, frame.assessment.effectiveness)
    column = log_row.record_used(effectiveness, control.config.uses_verdict, row, column)
    row[column], row[column + 1] = frame.supervisor.mode, fdi.verdict.detected or fdi.watch.output.alarmed
    column += 2
    if logged.watch:
        column = log_row.record_watch(fdi.watch, frame.measured.missing, row, column, logged.watch)
    column = log_row.record_sampled(frame.measured.signal, row, column, logged.sampled)
    column = put(row, column, control.power.output.command[: logged.power])
    if frame.autopilot.enabled:
        log_row.record_profile(frame.autopilot, row, column)
    chances = fdi.statistical
    if logged.tests and chances.tests.enabled:
        views = chances.views[: chances.n_views]
        statistical.write_shares(chances.tests, chances.block, views, chances.forces, chances.air, row)


@kernel
def finish(frame, commanded, row):
    """Account, record and hand the command over; the reference model moves on. commanded (3,) rad/s."""
    control, belief = frame.control, frame.belief
    if frame.autopilot.enabled:
        fly_profile(frame, commanded)
    account(frame)
    record(frame, commanded, row)
    reference.follow(control.reference.config, control.reference.output, commanded)
    authority_lost = control.surfaces.output.authority_lost
    reference.govern(control.reference, commanded, control.axes.shortfall, authority_lost)
    follow_command(belief, control.allocation.output.command)
    hand_over(frame.truth, belief.commanded, control.power.output)
    advance_clock(frame)
    frame.row += 1
