"""Which instrument is broken: the watch over the instruments' redundancy (redundancy.py).

One instrument is taken to fail at a time. The test that is furthest beyond its bound says what kind it is,
the tests that hold say which it cannot be. A gyro and the attitude beside it move the same tests; between
them the rates' own dynamics decide: a jump of a gyro is an acceleration that no model explains, a jump of the
attitude is none. With D the damping of the axis, the filter W' = -D W + innovation follows a gyro's error e
exactly, and stays within its bound for an attitude's.

From the alarm on no surface is named. A broken instrument that is named is replaced by what the others say
of it, for the diagnosis and for the laws (`stand_in`); it is not trusted again in the flight.
"""

import numpy as np

from beaver_ftc.compiled import kernel
from beaver_ftc.diagnosis.detection.bank import alarm
from beaver_ftc.diagnosis.detection.thresholds import bound_step
from beaver_ftc.diagnosis.monitors import accelerometers, redundancy, since_start
from beaver_ftc.diagnosis.monitors.sensor_records import (
    AIRSPEED,
    ALPHA,
    ALPHA_FLOW,
    ANGLE,
    BETA,
    BETA_FLOW,
    CLIMB,
    DENSITY,
    EQUAL_READING,
    EQUAL_SENSOR,
    EQUAL_SHOWS,
    N_COMPUTED,
    N_TESTS,
    NEVER_STILL,
    NO,
    NOBODY,
    OF_PHI,
    OF_SPEED,
    PRESSURE,
    QDYN,
    RPM,
    SPEED,
    STARTERS,
    THETA,
    TURN,
    UNKNOWN,
    YES,
)
from beaver_ftc.plant.instruments import (
    ALTITUDE,
    AX,
    ENGINE_SPEED,
    MANIFOLD,
    N_SENSORS,
    PHI,
    note_slipstream,
    share_out,
)
from beaver_ftc.scenario.sensors import N_IN_EQUATIONS

INVOLVED = 0.03  # of the largest residual of its kind: less is what a large error does to its neighbours
ASKED = 3  # `begun`: after the first look 1, with the first whole frame 2, from the next one on 3
BESIDE_S = 0.5  # a surface found earlier than this before the alarm was found without the broken instrument
SETTLED_S = 1.0  # after the watch has begun: an alarm of the surfaces by then may be an instrument's
SLACK = 0.2  # of the damping, away from trim
GONE = 0.003  # of what an attitude's jump has shown: what is left of it afterwards
QUICK_PER_S = 10.0  # the second of watch.POLES_PER_S
FORGETTING_S = 20.0  # of a vane that is replaced, back to trim: kinematics alone drift
CROSS_DAMPING_PER_S = 10.0  # by which a gyro's own error moves the innovation


@kernel
def monitor(watch, belief, measured, conclusion, bank, bound, dt, t):
    """Look at the instruments at one instant, t s; replace in `measured` what is known to be broken.

    bank, bound: of the innovation of the elapsed frame, of dt s. conclusion: about the surfaces, so far.
    """
    step, signal = watch.step, measured.signal
    if not watch.memory.begun:
        begin(watch, measured, t)
        return
    if watch.memory.past == 0:
        follow_rates(watch, bank.output.innovation, bound.eta_bar, dt)
    redundancy.check(step, signal, watch.config.engine)
    if N_TESTS > N_COMPUTED:
        redundancy.compare_equals(step, signal, measured.fresh)
        note_agreement(watch, measured.fresh)
    since_start.follow(step, watch.since, signal)
    accelerometers.note_stillness(watch, signal)
    if watch.memory.past == 0:
        watch.memory.gyro_error_then[:], watch.memory.spike_before[:] = (
            watch.memory.gyro_error,
            watch.memory.spike_then,
        )
        watch.memory.spike_then[:] = watch.memory.spike
        watch.memory.spike[:] = 0.0
    for i in range(3):
        error = -step.test[TURN + i].residual / step.config.h
        if watch.memory.past == 0:
            watch.memory.gyro_error[i] = error
        else:
            watch.memory.spike[i] = max(watch.memory.spike[i], abs(error))
    if watch.memory.begun < ASKED:
        note_first_errors(watch)
    if watch.config.blurred:
        clear_gyros(watch)
    decide(watch, measured, conclusion, bank, bound, dt, t)
    replace(watch, belief, measured)
    accelerometers.discard(watch, measured)
    watch.memory.earlier[:] = step.memory.then
    redundancy.look(step, signal, measured.force)
    watch.memory.past = (watch.memory.past + 1) % watch.config.instants


@kernel
def note_command(watch, manifold_pressure_inhg):
    """Expect of the engine's sensors what a law in charge of the engine commands."""
    watch.step.memory.command[1] = manifold_pressure_inhg


@kernel
def begin(watch, measured, t):
    """The first look, at t s: nothing to compare with."""
    watch.memory.begun, watch.memory.begun_at_s = 1, t
    watch.step.memory.drifted = watch.step.config.drift * t
    redundancy.begin(watch.step, measured.signal, measured.force)
    since_start.begin(watch.since, measured.signal)
    watch.memory.earlier[:] = watch.step.memory.then
    watch.memory.past = (watch.memory.past + 1) % watch.config.instants


@kernel
def note_first_errors(watch):
    """A gyro's error e of the first look has brought no innovation: W is e less exp(-D t) times the first e,
    which its bound therefore begins with. The first frame shows no change of an error."""
    if watch.memory.past == 0:
        watch.memory.begun += 1
    if watch.memory.begun == ASKED - 1 and watch.memory.past == 0:
        for i in range(3):
            watch.memory.W_bound[i] += abs(watch.memory.gyro_error[i])


@kernel
def follow_rates(watch, innovation, eta_bar, dt):
    """Bring W (3,) rad/s and its bound to the frame whose innovation is there."""
    W, bound, D = watch.memory.W, watch.memory.W_bound, watch.config.damping
    watch.memory.W_then[:] = bound
    before = watch.memory.before
    before[:] = W
    for i in range(3):
        lost, spread = 0.0, 0.0
        for j in range(3):
            lost += D[i, j] * before[j]
            spread += (-D[i, j] if i == j else abs(D[i, j])) * watch.memory.W_then[j]
        W[i] += dt * (innovation[i] - lost)
        bound[i] = max(watch.memory.W_then[i] + dt * (eta_bar[i] + spread), 0.0)


@kernel
def clear_gyros(watch):
    """Note when what the rates show cannot be any gyro's error: by W it would be there, by the attitude not.

    Where the attitude is blurred a surface is named only then.
    """
    step = watch.step
    for i in range(3):
        test, rate = step.test[TURN + i], watch.memory.W_bound[i] + SLACK * abs(watch.memory.W[i])
        for m, a in enumerate(step.config.decay):
            watch.memory.apart[i, m] = (
                a * watch.memory.apart[i, m] + test.residual + step.config.h * watch.memory.W[i]
            )
            watch.memory.apart_bound[i, m] = bound_step(
                watch.memory.apart_bound[i, m], rate, a, step.config.h
            )
            if abs(watch.memory.apart[i, m]) > watch.memory.apart_bound[i, m] + test.bound[m]:
                watch.memory.no_gyro = 1


@kernel
def decide(watch, measured, conclusion, bank, bound, dt, t):
    """Raise the alarm, and name the instrument once there is but one it can be."""
    note_furthest(watch)
    if watch.output.named != NOBODY:
        return
    for i in range(N_SENSORS):
        if measured.missing[i] and watch.output.named == NOBODY:
            raise_alarm(watch, conclusion, t)
            name(watch, i, t)
    if watch.output.named != NOBODY:
        return
    if watch.output.share > 1.0 and not watch.output.alarmed:
        raise_alarm(watch, conclusion, t)
        watch.output.lead = watch.output.furthest
        since_start.hold(watch.since)
    if watch.output.alarmed:
        if watch.memory.past == 0 and watch.memory.begun == ASKED:
            ask_rates(watch, bank, bound, dt)
        note_fired(watch)
        accelerometers.weigh(watch, measured.signal)
        suspect(watch)
        left, last = 0, NOBODY
        for i in range(N_SENSORS):
            if watch.output.suspect[i]:
                left, last = left + 1, i
        if left == 1:
            name(watch, last, t)


@kernel
def note_furthest(watch):
    """Keep the test furthest towards its bound, or beyond it, of the looks of this frame."""
    if watch.memory.past == 0:
        watch.output.furthest, watch.output.share = 0, 0.0
    for c in range(N_TESTS):
        if watch.step.test[c].share > watch.output.share:
            watch.output.furthest, watch.output.share = c, watch.step.test[c].share


@kernel
def raise_alarm(watch, conclusion, t):
    """Raise the alarm of the sensors at t s. A surface detected long before was detected with sound sensors:
    then the alarm is `beside` it. Otherwise the conclusion about surfaces is void."""
    if watch.output.alarmed:
        return
    watch.output.alarmed, watch.output.alarmed_at_s = 1, t
    if conclusion.detected and conclusion.detected_at_s < t - BESIDE_S:
        watch.output.beside = 1
        return
    if conclusion.detected:
        watch.output.alarmed_at_s = conclusion.detected_at_s  # the same fault, seen first in the rates
    watch.output.misnamed = conclusion.isolated >= 0


@kernel
def name(watch, i, t):
    """Instrument i is the one."""
    watch.output.named, watch.output.named_at_s = i, t
    watch.output.replaced[i] = 1


@kernel
def ask_rates(watch, bank, bound, dt):
    """By axis, whether the rates' dynamics have seen what the attitude shows: YES or NO once it is certain.

    What has shown inside a frame and is gone for all of the next is no gyro's: its error would have come to
    stay, and one that varies is not as small at every look.
    """
    alarmed, innovation = alarm(bank), bank.output.innovation
    for i in range(3):
        if watch.memory.rates_say[i] != UNKNOWN:
            continue
        error, jump = (
            watch.memory.gyro_error[i],
            (watch.memory.gyro_error[i] - watch.memory.gyro_error_then[i]) / dt,
        )
        own = CROSS_DAMPING_PER_S * max(abs(error), abs(watch.memory.gyro_error_then[i])) + 0.1 * abs(jump)
        blur = (
            4.0 * watch.step.test[TURN + i].noise / watch.step.config.h
        )  # of `error`, by the attitude's noise
        most = bound.frame[i] + 1e-6
        seen = (
            abs(innovation[i]) > most
            or alarmed >= 0
            or abs(watch.memory.W[i]) > watch.memory.W_bound[i] + 1e-6
        )
        spike, left = (
            watch.memory.spike_before[i],
            max(abs(watch.memory.gyro_error_then[i]), watch.memory.spike_then[i], abs(error)),
        )
        sudden = left < GONE * spike and spike > 2.0 * blur
        explained = abs(innovation[i] - jump) <= most + own + blur / dt
        slow = 0.7 * abs(error) <= watch.memory.W_bound[i] + abs(watch.memory.W[i]) + blur
        if not explained or (not seen and (sudden or not slow)):
            watch.memory.rates_say[i] = NO
        elif seen:
            watch.memory.rates_say[i] = YES


@kernel
def involved(watch, c, first):
    """Whether test c of three alike, from `first` on, is beyond its bound, and not for a neighbour's sake."""
    size = 0.0
    for i in range(3):
        size = max(size, abs(watch.step.test[first + i].filtered[0]))
    test = watch.step.test[c]
    return test.share > 1.0 and abs(test.filtered[0]) > INVOLVED * size


@kernel
def note_fired(watch):
    """Note the tests that have been beyond their bounds since the alarm."""
    for c in range(N_TESTS):
        triple = TURN if c < ANGLE else ANGLE
        beyond = involved(watch, c, triple) if c < SPEED else watch.step.test[c].share > 1.0
        if beyond:
            watch.memory.fired[c] = 1
    since_start.note_refuted(watch.step, watch.since, watch.memory.fired)


@kernel
def suspect(watch):
    """Fill suspect (N_SENSORS,) with the instruments that can have brought the tests here."""
    who, lead, fired = watch.output.suspect, watch.output.lead, watch.memory.fired
    who[:] = 0
    if lead >= N_COMPUTED:
        suspect_unequal(watch, lead - N_COMPUTED)
        return
    if lead < SPEED:
        suspect_attitude(watch)
    if lead == SPEED:
        accelerometers.suspect_accelerometers(watch, False)
        who[AIRSPEED] = not watch.memory.cleared[AIRSPEED]
    elif lead == DENSITY:
        may_be_frozen = watch.memory.still[AIRSPEED] > 0  # then it need not show how it is wrong
        who[AIRSPEED] = fired[SPEED] == 1 or not would_show(watch) or may_be_frozen
    who[QDYN] = lead == DENSITY and shown_alone(watch, DENSITY)
    suspect_vane(watch, ALPHA, ALPHA_FLOW, 1)
    suspect_vane(watch, BETA, BETA_FLOW, 2)
    who[ALTITUDE] = lead == CLIMB and shown_alone(watch, CLIMB)
    who[ENGINE_SPEED], who[MANIFOLD] = lead == RPM, lead == PRESSURE
    frozen = one_is_frozen(watch)
    for i in range(STARTERS):
        if not frozen and since_start.explains(watch.since, i, lead):
            who[(ALPHA, BETA, AIRSPEED, PHI, THETA)[i]] = 1


@kernel
def note_agreement(watch, fresh):
    """Note which sensors have equalled the reading that they should, before any alarm."""
    for k in range(EQUAL_SENSOR.size):
        equal = watch.step.test[N_COMPUTED + k].share <= 1.0
        if fresh[EQUAL_SENSOR[k] - N_IN_EQUATIONS] and equal and not watch.output.alarmed:
            watch.memory.agreed[k] = 1


@kernel
def suspect_unequal(watch, k):
    """Of a sensor and the reading that it no longer equals: the reading if its own test shows an error, the
    sensor if an error of the reading of this size would have shown there, both where neither is certain.

    No test shows an error that a reading has had from the first look on, nor one that is frozen.
    """
    step, reading, shows = watch.step, EQUAL_READING[k], EQUAL_SHOWS[k]
    own, test = step.test[shows], step.test[N_COMPUTED + k]
    least = abs(test.residual) - test.bound[0]  # of the error, if it is the reading's
    hidden = least <= 2.0 * max(own.bound[0], step.memory.error[reading])
    frozen = accelerometers.stands_still(watch, reading)
    watch.output.suspect[EQUAL_SENSOR[k]] = not watch.memory.fired[shows]
    watch.output.suspect[reading] = (
        watch.memory.fired[shows] == 1 or hidden or frozen or not watch.memory.agreed[k]
    )


@kernel
def shown_alone(watch, test):
    """Whether no test but this one has shown anything: its instrument is in none of the others."""
    for c in range(RPM):
        if c != test and watch.memory.fired[c]:
            return False
    return True


@kernel
def one_is_frozen(watch):
    """Whether a suspect stands still: no first error of another explains that. A sound one may read zero."""
    for i in range(N_SENSORS):
        if (
            watch.output.suspect[i]
            and watch.step.memory.then[i] != 0.0
            and accelerometers.stands_still(watch, i)
        ):
            return True
    return False


@kernel
def suspect_vane(watch, vane, flow, gyro):
    """A vane, an accelerometer, or the gyro that moves the flow as well, if its error need not show in the
    attitude yet. No instrument of the flow moves the attitude's tests."""
    if watch.output.lead != flow:
        return
    turns = watch.memory.fired[TURN] + watch.memory.fired[TURN + 1] + watch.memory.fired[TURN + 2]
    accelerometers.suspect_accelerometers(watch, turns > 0)
    watch.output.suspect[vane] = not (turns > 0 or watch.memory.cleared[vane])
    for i in range(3):
        shown = turns == 1 and watch.memory.fired[TURN + i] == 1
        watch.output.suspect[i] = shown or (turns == 0 and may_hide(watch, flow, i, i == gyro))


@kernel
def may_hide(watch, flow, i, own):
    """Whether gyro i may do what the test of the flow shows, and not show in that of its axis; own: it is the
    one that turns the flow with all of its error. Of the others it takes the share by kinematics."""
    step, alpha = watch.step, watch.step.memory.then[ALPHA]
    along = np.cos(alpha) if i == 0 else np.sin(alpha)
    share = abs(np.tan(step.memory.then[BETA]) * along) if flow == ALPHA_FLOW else abs(np.sin(alpha))
    test, turn = step.test[flow], step.test[TURN + i]
    for m in range(test.filtered.size):
        room = 2.0 * test.bound[m] if own else test.bound[m]
        if abs(test.filtered[m]) > 2.0 * (1.0 if own else share) * turn.bound[m] + room:
            return False
    return own or i == 0 or flow == ALPHA_FLOW  # the sideslip does not feel q


@kernel
def would_show(watch):
    """Whether an airspeed as wrong as the density has it would be beyond the bound of its own test."""
    density, speed = watch.step.test[DENSITY], watch.step.test[SPEED]
    most = 1.0 + watch.since.held[OF_SPEED]
    for m in range(density.filtered.size):
        shown = abs(density.filtered[m]) - since_start.hidden(watch.since, OF_SPEED, DENSITY, m)
        if 0.5 * watch.step.memory.then[AIRSPEED] * shown > 2.0 * most * speed.bound[m]:
            return True
    return False


@kernel
def suspect_attitude(watch):
    """The same of gyros and attitude: one axis alone, or one angle alone. An angle by itself may be the first
    to show what a gyro does; one that is frozen is no gyro's doing, and until that is seen it may be.
    Nor is it a gyro's as long as an angle's own test leaves room for all that has shown."""
    fired, who = watch.memory.fired, watch.output.suspect
    turns, frozen = 0, False
    for i in range(3):
        turns += fired[TURN + i]
        frozen = frozen or accelerometers.stands_still(watch, PHI + i)
    for i in range(3):
        alone = turns == 0 or (fired[TURN + i] == 1 and turns == 1)
        who[i] = alone and watch.memory.rates_say[i] != NO and not frozen
        fits = explains(watch, i)
        mine = no_other_angle(watch, i) and (fired[ANGLE + i] == 1 or fits)
        moved = mine and watch.memory.rates_say[axis_of(watch, i)] != YES
        still, longest = watch.memory.still[PHI + i], watch.config.longest_still[PHI + i]
        may_be_frozen = 0 < still < longest < NEVER_STILL  # too early to say
        who[PHI + i] = moved or (fits and may_be_frozen)


@kernel
def no_other_angle(watch, i):
    """Whether no test of another angle has shown what a first error of angle i leaves unexplained."""
    for j in range(3):
        shown = watch.memory.fired[ANGLE + j] if i == 2 else watch.since.refuted[OF_PHI + i, ANGLE + j]
        if j != i and shown:
            return False
    return True


@kernel
def explains(watch, i):
    """Whether what shows about the axes can be what angle i is off by, as far as its own test can hide it."""
    step, angle = watch.step, watch.step.test[ANGLE + i]
    unsure = step.memory.error[PHI] + step.memory.error[PHI + 1]
    for j in range(3):
        turn, per_angle = step.test[TURN + j], abs(redundancy.turned_by(step, j, i)) + unsure
        for m in range(step.config.decay.size):
            most = abs(angle.filtered[m]) + angle.bound[m]
            hidden = since_start.hidden(watch.since, OF_PHI + i, TURN + j, m) if i < 2 else 0.0
            if (
                watch.memory.fired[TURN + j]
                and abs(turn.filtered[m]) > per_angle * most + turn.bound[m] + hidden
            ):
                return False
    return True


@kernel
def axis_of(watch, i):
    """The body axis whose rate shows what angle i does, as things are: the one furthest beyond its bound."""
    axis = i
    for j in range(3):
        if watch.step.test[TURN + j].share > watch.step.test[TURN + axis].share:
            axis = j
    return axis


@kernel
def clears_surfaces(watch, known):
    """Whether a surface may be named, a frame or more (`known`) after the alarm."""
    if not watch.config.enabled:
        return True
    return (
        known == 1
        and (watch.memory.no_gyro == 1 or not watch.config.blurred)
        and not flow_stands_still(watch)
    )


@kernel
def shown_from_the_start(watch, detected_at_s):
    """Whether the alarm of the surfaces came so early that a reading of the flow may have brought it by its
    first error, which in the model moves the aircraft from the first frame on. Then no surface is named."""
    return watch.config.enabled and detected_at_s < watch.memory.begun_at_s + SETTLED_S


@kernel
def flow_stands_still(watch):
    """Whether a reading of the flow does: a surface that moves the aircraft moves it. In symmetric flight a
    sideslip of zero stays one."""
    for i in (ALPHA, BETA, AIRSPEED, QDYN):
        if watch.step.memory.then[i] != 0.0 and accelerometers.stands_still(watch, i):
            return True
    return False


@kernel
def speaks(watch):
    """Whether the watch has the word: no surface is to be named."""
    return watch.config.enabled and watch.output.alarmed


@kernel
def replace(watch, belief, measured):
    """Put what the other instruments say in the place of those that are named or missing. Accelerometers are
    not replaced: then none of them is used."""
    signal, changed = measured.signal, 0
    for i in range(N_SENSORS):
        if measured.missing[i]:
            watch.output.replaced[i] = 1
        if watch.output.replaced[i] and i < AX:
            signal[i] = stand_in(watch, belief, signal, i)
            changed = 2 if i in (AIRSPEED, QDYN, ENGINE_SPEED, MANIFOLD) else max(changed, 1)
    if changed > 0:
        share_out(measured)
    if changed > 1 and watch.config.engine:
        note_slipstream(measured)


@kernel
def stand_in(watch, belief, signal, i):
    """What the other instruments say of instrument i."""
    step = watch.step
    if i < 3:
        return rate_from_attitude(watch, belief, i)
    if i in (ALPHA, BETA):
        return step.memory.predicted[i] + step.config.h / FORGETTING_S * (
            watch.config.trim[i] - step.memory.predicted[i]
        )
    density = 2.0 * step.memory.then[QDYN] / step.memory.then[AIRSPEED] ** 2
    if i == AIRSPEED:
        return np.sqrt(max(2.0 * signal[QDYN] / density, 1.0))
    if i == QDYN:
        return 0.5 * density * signal[AIRSPEED] ** 2
    if i >= ENGINE_SPEED:
        return step.memory.command[i - ENGINE_SPEED]
    return step.memory.predicted[i]


@kernel
def rate_from_attitude(watch, belief, i):
    """Rate i, rad/s: what the attitude has shown of it by the look before, and the model's change since.

    The rate itself is used for the next look: its own error shows there.
    """
    step = watch.step
    u = belief.u_then if watch.memory.past == 0 else belief.u
    acceleration = belief.f[i]
    for s in range(u.size):
        acceleration += belief.G[i, s] * u[s]
    shown = watch.config.follows * step.test[TURN + i].residual
    if not watch.memory.taken_over[i] and watch.config.follows < 1.0:
        shown = step.config.h * QUICK_PER_S * step.test[TURN + i].filtered[1]
    watch.memory.taken_over[i] = 1
    known = step.memory.then[i] + shown / step.config.h
    return known + step.config.h * acceleration
