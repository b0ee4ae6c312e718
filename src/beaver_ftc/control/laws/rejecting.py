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

Gains. A loop has Kp = s and w_o = RATIO s; loop_design.py derives s, 1/s, from what is declared.

Effectiveness of a surface at fault. The law takes the diagnosis' estimate, or that from the observer's
innovation if it is larger (evidence.py), and withdraws a surface that stays at its stop (withdrawal.py). If
the aircraft has many surfaces, the law estimates all of them at once while an alarm names none
(effectiveness_estimator.py).
"""

from math import exp, sqrt

import numpy as np

from beaver_ftc.aircraft import AXES
from beaver_ftc.compiled import apart, copy, fill, kernel, record, sized
from beaver_ftc.control import CompiledLaw, accommodation, allocation, laws
from beaver_ftc.control.accommodation import approach, begin_frame, give_up, start_of, take_offsets
from beaver_ftc.control.laws.effectiveness_estimator import (
    OBSERVER_ERROR,
    begin_estimator,
    effectiveness_of,
    estimate,
    estimator_dtype,
)
from beaver_ftc.control.laws.evidence import (
    SUMS,
    accumulate,
    derive_fading,
    larger_estimate,
    restart_at_naming,
)
from beaver_ftc.control.laws.loop_design import Loop, corrections, fastest, lead_of
from beaver_ftc.control.laws.reference import advance
from beaver_ftc.control.laws.withdrawal import is_doubtful, is_replaced, withdraw
from beaver_ftc.control.thrust import between
from beaver_ftc.design.plain_model import effectiveness as control_effectiveness
from beaver_ftc.design.plain_model import own_damping
from beaver_ftc.design.table import AIRSPEED, QDYN
from beaver_ftc.diagnosis.model_prediction import DEFAULT_RATE_RAD_S, servo_data
from beaver_ftc.diagnosis.state import PITCH
from beaver_ftc.diagnosis.types import GIVE_UP
from beaver_ftc.scenario.declared import Declared
from beaver_ftc.scenario.sensors import RateGyro

N_POINTS = 5  # points of the schedule over dynamic pressure
N_LOOPS = 4  # rows of the tables of gains: roll, pitch, yaw, and pitch by the surface that stands in
STAND_IN = 3  # the last of these rows


def configure(law: np.void, control: np.void, prediction: np.void, declared: Declared, y: np.ndarray) -> None:
    """Fill the law's configuration (control.CompiledLaw; fields: `config_dtype`) in three steps:

        1  the lead of each surface, which goes the share `approach` of the way to its command in a frame
        2  the loops, each an axis with the surface s that moves it: roll, pitch, yaw and, if a surface can
           stand in, pitch by that surface; this order is that of the rows of the tables of gains
        3  the gains of each loop at each point of the schedule: the fastest Kp that margins and noise allow

    y (n_y,): the signals measured in trim. G (points, 3, n) rad/s2 per rad. keep: pole of a gyro's lag over a
    frame, exp(-bandwidth dt); 0 for a gyro without lag.
    """
    config, layout, design = law["config"], control["layout"], prediction["design"]
    dt, share = 1.0 / declared.rate_hz, 1.0 / declared.substeps
    points = schedule_points(declared, y)  # step 1
    G = np.array([control_effectiveness(design, point) for point in points])
    approach = 1.0 - (1.0 - prediction["actuators"]["approach"]) ** declared.substeps
    lead = [lead_of(float(share_of_way)) for share_of_way in approach]
    fill(config, dt=dt, share=share, qdyn=points[:, QDYN], fading=derive_fading(dt), lead=lead)
    loops = list(enumerate(layout["main"].tolist()))  # step 2
    if layout["stand_in"] >= 0:
        loops.append((PITCH, int(layout["stand_in"])))
    speed_rad_s = allowed_speeds(declared, loops, np.abs(own_damping(design, y)))
    margin = declared.control.gain_margin_db, declared.control.phase_margin_deg
    for row, (axis, s) in enumerate(loops):  # step 3
        gyro: RateGyro = getattr(declared.instruments, AXES[axis])
        keep = exp(-gyro.bandwidth_rad_s * dt) if gyro.bandwidth_rad_s else 0.0
        loop = Loop(dt, share, float(approach[s]), config["lead"][s], gyro.delay_s, keep)
        for j in range(N_POINTS):
            Kp = fastest(loop, margin, gyro.random_error, float(G[j, axis, s]), speed_rad_s[s])
            config["Kp_at"][row, j] = Kp
            config["L_rate_at"][row, j], config["L_disturbance_at"][row, j] = corrections(Kp, dt)


def allowed_speeds(declared: Declared, loops: list[tuple[int, int]], D: np.ndarray) -> dict[int, float]:
    """The speed, rad/s, at which the noise of a gyro may move the surface s of each loop (axis, s):

        noise_share sqrt(D_axis / D_max) rate limit        D (3,) 1/s: own damping of the axes; D_max: largest

    A surface that leads two axes has the speed of the second one.
    """
    limits_rad_s = servo_data(declared)["rate_limit_rad_s"]
    return {
        s: declared.control.noise_share
        * sqrt(D[axis] / D.max())
        * float(limits_rad_s[s] or DEFAULT_RATE_RAD_S)
        for axis, s in loops
    }


def schedule_points(declared: Declared, y: np.ndarray) -> np.ndarray:
    """The signals at the points of the schedule, (N_POINTS, n_y): those in trim, y (n_y,), except airspeed V
    m/s, which spans the envelope, and dynamic pressure, Pa, which goes with V^2."""
    points = np.tile(y, (N_POINTS, 1))
    points[:, AIRSPEED] = V = np.linspace(*declared.aircraft.envelope.airspeed_mps, N_POINTS)
    points[:, QDYN] = y[QDYN] * (V / y[AIRSPEED]) ** 2
    return points


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
    law, surfaces, layout = control.rejecting, control.surfaces, control.layout
    memory, output = law.memory, surfaces.output
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
def schedule(config, memory, qdyn, transfer_share):
    """Fill the gains (3,) of the axes at a dynamic pressure qdyn, Pa; beyond the schedule, take those at its
    end. In pitch

        gain <- gain + transfer_share (gain of the stand-in - gain)

    transfer_share: the part of pitch that the stand-in carries.
    """
    for table, gains in (
        (config.Kp_at, memory.Kp),
        (config.L_rate_at, memory.L_rate),
        (config.L_disturbance_at, memory.L_disturbance),
    ):
        for i in range(3):
            gains[i] = between(qdyn, N_POINTS, config.qdyn, table[i])
        if transfer_share > 0.0:
            by_stand_in = between(qdyn, N_POINTS, config.qdyn, table[STAND_IN])
            gains[PITCH] += transfer_share * (by_stand_in - gains[PITCH])


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
    observer, memory = law.observer, law.memory
    xhat, d = observer.rate, observer.disturbance
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
    law, output = control.rejecting, control.surfaces.output
    config, memory, means = law.config, law.memory, prediction.means
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
    config, output = reference.config, reference.output
    xm_0, acceleration = output.governed_rate[i], output.governed_acceleration[i]
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
