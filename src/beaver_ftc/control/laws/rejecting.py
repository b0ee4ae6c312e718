"""Inversion with a disturbance observer: gusts and model errors are rejected from the first frame on.

    xhat' = f + G u + d + 2 w_o (x - xhat),   d' = w_o^2 (x - xhat)    [Han2009, Chen2016]   `observe`
    G u_c = xm' + Kp (xm - x+) - f - d                                                       `demand`

    x, xhat, xm   (3,) rad/s      body rates: measured, of the observer, of the reference model
    x+            (3,) rad/s      xhat at the instant from which the command acts (`look_ahead`)
    e             (3,) rad/s      innovation of the observer, x - xhat
    d             (3,) rad/s2     disturbance
    f, G          (3,), (3, n)    design model: rad/s2 without surfaces, rad/s2 per rad
    u, u_c        (n,) rad        positions of the actuators; command
    w_o, Kp       1/s             bandwidth of the observer, feedback

d is the acceleration that the model does not explain: rotation of the air, wrong coefficients, a fault that
is not named yet. u are the positions of the actuators, not their commands. So neither their lag nor their
stops count as a disturbance, and nothing can wind up. The command acts one JSBSim frame from now, and xm is
taken at that instant too.

Gains. A loop has Kp = s and w_o = RATIO s; loop_design.py derives s, 1/s, from what is declared, and
gain_schedule.py has the table over dynamic pressure.

Effectiveness of a surface at fault. The law takes the diagnosis' estimate, or that from the observer's
innovation if it is larger (evidence.py), and withdraws a surface that stays at its stop (withdrawal.py). If
the aircraft has many surfaces, the law estimates all of them at once while an alarm names none
(effectiveness_estimator.py).
"""

import numpy as np

from beaver_ftc.compiled import apart, copy, kernel, record, sized
from beaver_ftc.control import CompiledLaw, accommodation, allocation, laws
from beaver_ftc.control.accommodation import approach, begin_frame, give_up, start_of, take_offsets
from beaver_ftc.control.laws.effectiveness_estimator import (
    OBSERVER_ERROR,
    begin_estimator,
    effectiveness_of,
    estimate,
    estimator_dtype,
)
from beaver_ftc.control.laws.evidence import SUMS, accumulate, larger_estimate, restart_at_naming
from beaver_ftc.control.laws.gain_schedule import N_LOOPS, N_POINTS, configure, schedule
from beaver_ftc.control.laws.reference import advance
from beaver_ftc.control.laws.withdrawal import is_doubtful, is_replaced, withdraw
from beaver_ftc.design.table import QDYN
from beaver_ftc.diagnosis.types import GIVE_UP

# xhat and d: rate (3,) rad/s, disturbance (3,) rad/s2. begun: whether the observer has begun. `begin` takes
# this record over from the law before.
OBSERVER = record(begun=int, rate=3, disturbance=3)


@sized
def config_dtype(n: int) -> np.dtype:
    """Configuration for n surfaces.

    dt                                    s, length of a frame
    share                                 part of a frame until a command acts
    fading                                share of SUMS (evidence.py) that is forgotten in a frame
    qdyn (N_POINTS,)                      Pa, points of the schedule, ascending
    Kp_at (N_LOOPS, N_POINTS)             1/s, gain of the feedback
    L_rate_at, L_disturbance_at (same)    1 and 1/s, gains of the observer
    lead (n,)                             factor on command - position (`allocation.lead_compensate`)
    """
    table = (N_LOOPS, N_POINTS)
    return record(
        dt=float, share=float, fading=float, qdyn=N_POINTS, Kp_at=table, L_rate_at=table,
        L_disturbance_at=table, lead=n,
    )  # fmt: skip


@sized
def memory_dtype(n: int) -> np.dtype:
    """Memory for n surfaces.

    Kp, L_rate, L_disturbance (3,)          gains of this frame
    ahead, innovation (3,)                  rad/s, x+ and e
    at_stop_s, out_of_use_s, withdrawn (n,) see withdrawal.py
    healthy, assumed                        answers of the observer to the moments of healthy main surfaces,
                                            and to the assumed moments minus these (evidence.py)
    sums                                    see `accumulate`
    estimator                               see effectiveness_estimator.py
    """
    return record(
        Kp=3, L_rate=3, L_disturbance=3, ahead=3, innovation=3, at_stop_s=n, out_of_use_s=n,
        withdrawn=(int, n), healthy=OBSERVER_ERROR, assumed=OBSERVER_ERROR, sums=SUMS,
        estimator=estimator_dtype(n),
    )  # fmt: skip


@sized
def rejecting_dtype(n: int) -> np.dtype:
    """The law's records for n surfaces."""
    return record(config=config_dtype(n), observer=OBSERVER, memory=memory_dtype(n))


@apart
def accommodate(control, assessment, faults, prediction, measured):
    """Bring the effectiveness of all surfaces to this frame (control.CompiledLaw). A law that is informed
    takes the truth. Otherwise the target of a surface is

        the diagnosis names none, the estimator is active   its estimate
        a loss of a main surface that no other replaces     the larger of the diagnosis' and the observer's
                                                            (`larger_estimate`)
        otherwise                                           the diagnosis' estimate

    The second row needs a surface that the diagnosis does not give up, and estimates that it does not hold.
    A surface that is withdrawn is given up, whatever its target.
    """
    if control.config.informed:
        accommodation.accommodate(control, assessment, faults, prediction, measured)
        return
    law = control.rejecting
    surfaces = control.surfaces
    layout = control.layout
    memory = law.memory
    output = surfaces.output
    dt = law.config.dt
    least = surfaces.config.least_effectiveness
    begin_frame(output, assessment.lags)
    take_offsets(output, assessment)
    start_or_end_estimator(memory, layout, assessment.detected, dt)
    for s in range(output.target.size):
        target = assessment.effectiveness[s]
        if assessment.no_target and memory.estimator.active:
            target = effectiveness_of(memory.estimator, s)
        elif assessment.accommodation_mode[s] != GIVE_UP and not assessment.held:
            for i in range(3):
                if s == layout.main[i] and target < 1.0 and not is_replaced(layout, s):
                    restart_at_naming(memory.sums, i)
                    target = larger_estimate(memory.sums, target, i, least)
        named = assessment.detected and s == assessment.isolated_surface
        suspected = named and is_doubtful(assessment, memory.sums, layout, s, target, least)
        withdraw(memory, layout, s, control.allocation.output.saturated[s], suspected, dt)
        if memory.withdrawn[s]:
            give_up(output, s)
        else:
            approach(surfaces, s, start_of(output, assessment, s), target)


@apart
def command(control, assessment, faults, prediction, measured, mode, t):
    """From what is measured to the command of each surface (control.CompiledLaw)."""
    laws.prepare(control, assessment, prediction, mode, t)
    demand(control, prediction, measured)
    laws.command_surfaces(control, assessment, faults, prediction, laws.WITH_OBSERVER)
    laws.complete(control, assessment, measured, t)
    config = control.rejecting.config
    allocation.lead_compensate(control.allocation.output, control.layout, config.lead, prediction.u)


@kernel
def start_or_end_estimator(memory, layout, detected, dt):
    """Activate the estimator at the alarm, if the allocation is general and the estimator has room for all
    surfaces; end it without an alarm. Its noise model is that of the innovation up to the alarm."""
    if not (detected and layout.general and memory.estimator.parameters.size > 1):
        memory.estimator.active = 0
    elif not memory.estimator.active:
        begin_estimator(memory.estimator, memory.sums.innovation, memory.sums.frames, dt)


@kernel
def explained(output, i, design, moments, G):
    """Acceleration of axis i that the law assumes, f + G u with the faults in it, rad/s2:

        design_i + sum_s (effectiveness_s - 1) moments_is + G_is offset_s

    design (3,): f + G u of healthy surfaces; moments (3, n): of each, G u, rad/s2; output: that of
    accommodation.py, with effectiveness and offset (n,) rad.
    """
    total = design[i]
    for s in range(G.shape[1]):
        total += (output.effectiveness[s] - 1.0) * moments[i, s] + G[i, s] * output.offset[s]
    return total


@kernel
def observe(law, output, main, x, design, moments, G):
    """Bring the observer's rate xhat (3,) rad/s and disturbance d (3,) rad/s2 to this frame:

        xhat <- xhat + dt (f + G u + d),    e = x - xhat
        xhat <- xhat + L_rate e,    d <- d + L_disturbance e        L: `loop_design.corrections`

    x (3,) rad/s: measured; e: the innovation, rad/s, which also enters the sums of evidence.py. f + G u is
    `explained`, a mean over the elapsed frame, as are design (3,), moments (3, n) and G (3, n); output: that
    of accommodation.py.
    """
    observer = law.observer
    memory = law.memory
    xhat = observer.rate
    d = observer.disturbance
    if not observer.begun:
        observer.begun = 1
        copy(x, xhat)
        return
    for i in range(3):
        xhat[i] += law.config.dt * (explained(output, i, design, moments, G) + d[i])
        e = memory.innovation[i] = x[i] - xhat[i]
        accumulate(law.config, memory, i, output.effectiveness[main[i]], moments[i, main[i]], e)
        xhat[i] += memory.L_rate[i] * e
        d[i] += memory.L_disturbance[i] * e


@kernel
def demand(control, prediction, measured):
    """Bring gains, observer and estimator to this frame, in this order: each needs the one before. Fill the
    law's demand G u_c, hold and disturbance d of the axes, (3,) rad/s2:

        demand = xm' + Kp (xm - x+) - f - d,    hold = -f - d

    xm, xm_after: at the instant from which the command acts, and a frame later (`targets`); xm' = (xm_after -
    xm) / dt; x+: `memory.ahead`.
    """
    law = control.rejecting
    output = control.surfaces.output
    config = law.config
    memory = law.memory
    means = prediction.means
    schedule(config, memory, measured.y[QDYN], control.allocation.output.transfer_share)
    observe(law, output, control.layout.main, measured.x, means.F, means.Gu, means.G)
    if memory.estimator.active:
        estimate(
            memory.estimator, memory.innovation, memory.L_rate, memory.L_disturbance, config.dt, measured.x,
            measured.y, output.effectiveness, means.Gu,
        )  # fmt: skip
    for i in range(3):
        d = law.observer.disturbance[i]
        look_ahead(law, output, i, prediction.f, prediction.G, prediction.u)
        xm, xm_after = targets(control.reference, i, config.share)
        feedback = memory.Kp[i] * (xm - memory.ahead[i])
        hold = -prediction.f[i] - d
        allocation.set_demand(control.axes, i, (xm_after - xm) / config.dt + feedback + hold, hold, d)


@kernel
def look_ahead(law, output, i, f, G, u):
    """Fill x+ of axis i, rad/s, the rate when the command acts, a `share` of a frame from now:

        x+ = xhat + share dt (f + d + sum_s G_is (effectiveness_s u_s + offset_s))

    f (3,) rad/s2, G (3, n) rad/s2 per rad, u (n,) rad: of this instant; output: that of accommodation.py.
    """
    acceleration = f[i] + law.observer.disturbance[i]
    for s in range(u.size):
        acceleration += G[i, s] * (output.effectiveness[s] * u[s] + output.offset[s])
    law.memory.ahead[i] = law.observer.rate[i] + law.config.share * law.config.dt * acceleration


@kernel
def targets(reference, i, share):
    """xm of axis i, rad/s, at the instant from which the command acts, a `share` of a frame from now, and a
    frame later; xm_k: k frames from now, linear in between:

    xm_0 + share (xm_1 - xm_0),    xm_1 + share (xm_2 - xm_1)
    """
    config = reference.config
    output = reference.output
    xm_0 = output.governed_rate[i]
    acceleration = output.governed_acceleration[i]
    wanted = reference.memory.scale[i] * output.commanded_rate[i]
    xm_1, acceleration = advance(config, xm_0, acceleration, wanted)
    xm_2, _ = advance(config, xm_1, acceleration, wanted)
    return xm_0 + share * (xm_1 - xm_0), xm_1 + share * (xm_2 - xm_1)


def unexplained(control: np.void) -> np.ndarray:
    """The acceleration that the law attributes to no model, d (3,) rad/s2 (control.CompiledLaw)."""
    return np.array(control["rejecting"]["observer"]["disturbance"])


def begin(control: np.void, before: np.void, unexplained: np.ndarray, learnt: np.ndarray) -> None:
    """Take over in flight (control.CompiledLaw): the observer of the law before goes on, with d =
    unexplained; if that law had none, it begins with the measured rates (`observe`)."""
    control["rejecting"]["observer"] = before["rejecting"]["observer"]
    control["rejecting"]["observer"]["disturbance"] = unexplained


LAW = CompiledLaw(rejecting_dtype, command, accommodate, configure, unexplained=unexplained, begin=begin)
