"""One frame of the closed loop, compiled: measure, predict, detect, isolate, decide, command, record.

Everything a flight remembers between frames is one record, so that a frame is one call from Python. The
order matters and is JSBSim's: after `run()` number k the rates x[k] and the accelerations a[k] = F(x[k],
u[k]) are there, u[k] being the command written before that run; the next run moves the rates by dt a[k].
The command computed here is u[k+1]. With n JSBSim frames in one of ours the rates move by dt/n a[k], and
then by the accelerations on the way, already under u[k+1]: see `elapse`.
"""

import numpy as np

from beaver_ftc.compiled import kernel
from beaver_ftc.control import adaptive, allocation, authority, nominal, power, probing, reference_model
from beaver_ftc.control.state import CONTROL, NOMINAL, ORACLE
from beaver_ftc.control.supervisor import (
    MODE_ADAPTIVE,
    MODE_NOMINAL,
    MODE_REALLOCATED,
    MODE_UNANTICIPATED,
    mode_of,
    next_mode,
)
from beaver_ftc.design.actuators import ACTUATORS, move
from beaver_ftc.design.model import (
    AIRSPEED,
    ALPHA,
    BETA,
    DPT,
    ELEVATOR,
    N_Y,
    QDYN,
    design_dtype,
    unanticipated_pitch,
)
from beaver_ftc.design.variants import response
from beaver_ftc.diagnosis import air, bank, detection, guarantee, isolation, network, statistical
from beaver_ftc.diagnosis.derived import changing_error, derived_bound, slack_per_rad
from beaver_ftc.diagnosis.state import DIAGNOSIS, NOT_ISOLATED, WORST_CASE
from beaver_ftc.diagnosis.thresholds import uncertainty_bound
from beaver_ftc.diagnosis.types import candidates, examine, verdict
from beaver_ftc.plant import channels as ch
from beaver_ftc.plant.instruments import INSTRUMENTS, N_SIGNALS, read_all
from beaver_ftc.plant.native import read_nodes, write_nodes

MAX_EVENTS = 64
FLYING, DEPARTED, NOT_FINITE = 0, 1, 2
SURE = 400.0  # one over the variance of an effectiveness known to 0.05
DEPARTURE_ANGLE_RAD = 0.6
DEPARTURE_RATE_RAD_S = 6.0
DEPARTURE_SIGNALS = ("p", "q", "r", "alpha", "beta", "altitude")

FRAME = np.dtype(
    [
        ("design", design_dtype(4)), ("fdi", DIAGNOSIS), ("control", CONTROL),
        ("instruments", INSTRUMENTS), ("actuators", ACTUATORS),
        ("k", "i8"), ("row", "i8"), ("dt", "f8"), ("t", "f8"), ("share", "f8"),
        # the truth's nodes
        ("native", "i8"), ("getter", "i8"), ("setter", "i8"),
        ("n_truth", "i8"), ("read_pointers", "i8", (ch.most_channels(4),)), ("write_pointers", "i8", (4,)),
        ("engine_pointer", "i8", (1,)),
        ("factor", "f8", (ch.most_channels(4),)), ("truth", "f8", (ch.most_channels(4),)),
        ("latitude_0", "f8"), ("longitude_0", "f8"), ("radius_m", "f8"), ("parallel_radius_m", "f8"),
        # the truth's faults, for the oracle and for the analyst
        ("faulted", "i8"), ("fault_at_s", "f8"), ("immovable", "i8", (4,)),
        ("Cm_alpha3", "f8"), ("phi", "f8", (3,)),
        # what is measured and believed
        ("seen", "f8", (N_SIGNALS,)), ("x", "f8", (3,)), ("y", "f8", (N_Y,)), ("u", "f8", (4,)),
        ("u_then", "f8", (4,)),
        ("commanded", "f8", (4,)),  # u is where the healthy surfaces are under it, u_then where they were
        ("f", "f8", (3,)), ("G", "f8", (3, 4)), ("G_believed", "f8", (3, 4)),
        # the frame before, and means over the frame that elapsed since
        ("x_then", "f8", (3,)), ("f_sum", "f8", (3,)), ("G_sum", "f8", (3, 4)), ("Gu_sum", "f8", (3, 4)),
        ("eta_bar_sum", "f8", (3,)), ("own_per_rad_sum", "f8", (3, 4)), ("own_sum", "f8", (3, 4)),
        ("phi_sum", "f8", (3,)), ("phi_mean", "f8", (3,)),
        ("Gu_first", "f8", (3, 4)), ("Gu_spread", "f8", (3, 4)),
        ("G_mean", "f8", (3, 4)), ("Gu_mean", "f8", (3, 4)), ("believed", "f8", (3,)),
        ("design_mean", "f8", (3,)), ("surprise", "f8", (3,)),
        ("fhat", "f8", (3,)), ("target", "f8", (4,)),
        # what happened
        ("mode", "i8"), ("n_modes", "i8"),
        ("mode_at_s", "f8", (MAX_EVENTS,)), ("mode_is", "i8", (MAX_EVENTS,)),
        ("pre_fault_square", "f8", (3,)), ("pre_fault_frames", "i8"),
        ("post_fault_square", "f8", (3,)), ("post_fault_frames", "i8"),
        ("saturated_frames", "i8", (4,)), ("travelled", "f8", (4,)), ("position_then", "f8", (4,)),
        ("demanded", "f8", (3,)), ("lacking", "f8", (3,)), ("beyond_frames", "i8", (3,)),
        ("outside", "i8"), ("n_exits", "i8"), ("outside_frames", "i8"), ("ground_m", "f8"),
        ("exit_at_s", "f8", (MAX_EVENTS,)), ("return_at_s", "f8", (MAX_EVENTS,)),
        ("departed", "i8"),
    ],
    align=True,
)  # fmt: skip


@kernel
def measure(frame):
    """Read the truth and form what the sensors give: x (3,) rad/s and y (5,)."""
    truth = frame.truth
    if frame.native:
        read_nodes(frame.getter, frame.read_pointers[: frame.n_truth], truth)
    for i in range(frame.n_truth):
        truth[i] *= frame.factor[i]
    seen = frame.seen
    for i in range(N_SIGNALS):
        seen[i] = truth[i]
    if frame.instruments.real:
        read_all(frame.instruments, seen)
    for i in range(3):
        frame.x[i] = seen[i]
    y = frame.y
    y[ALPHA], y[BETA], y[AIRSPEED], y[QDYN] = seen[ch.ALPHA], seen[ch.BETA], seen[ch.AIRSPEED], seen[ch.QDYN]
    first = ch.POS + 3 * frame.u.size
    for k in range(frame.n_truth - first):
        y[DPT + k] = truth[first + k]


@kernel
def flight_status(truth, ground_m):
    """FLYING, NOT_FINITE, or DEPARTED + the index in DEPARTURE_SIGNALS of what left its limits, times ten."""
    for i in range(truth.size):
        if not np.isfinite(truth[i]):
            return NOT_FINITE
    for i in range(3):
        if abs(truth[i]) > DEPARTURE_RATE_RAD_S:
            return DEPARTED + 10 * i
    if abs(truth[ch.ALPHA]) > DEPARTURE_ANGLE_RAD:
        return DEPARTED + 30
    if abs(truth[ch.BETA]) > DEPARTURE_ANGLE_RAD:
        return DEPARTED + 40
    if truth[ch.ALTITUDE] < ground_m:
        return DEPARTED + 50
    return FLYING


@kernel
def fault_effect(frame):
    """Fill frame.phi (3,) rad/s2: what the truth's faults do to the angular acceleration, as the design
    model weighs it."""
    G, truth = frame.G, frame.truth
    for i in range(3):
        frame.phi[i] = 0.0
        if frame.faulted:
            for s in range(4):
                frame.phi[i] += G[i, s] * (truth[ch.POS + frame.u.size + s] - frame.u[s])
    if frame.faulted:
        frame.phi[1] += unanticipated_pitch(frame.design, frame.y, frame.Cm_alpha3)


@kernel
def sum_up(frame):
    """Add what the design model makes of this instant to the sums over the frame."""
    for i in range(3):
        frame.f_sum[i] += frame.f[i]
        frame.eta_bar_sum[i] += frame.fdi.eta_bar_now[i]
        frame.phi_sum[i] += frame.phi[i]
        for s in range(4):
            frame.G_sum[i, s] += frame.G[i, s]
            frame.Gu_sum[i, s] += frame.G[i, s] * frame.u[s]
    if frame.fdi.own_errors:
        sum_up_own_errors(frame)


@kernel
def sum_up_own_errors(frame):
    """Add what the declared errors do to the surfaces' own terms now, per rad and at the command."""
    per_rad = frame.fdi.admitted.per_rad
    for i in range(3):
        for s in range(4):
            frame.own_per_rad_sum[i, s] += per_rad[i, s]
            frame.own_sum[i, s] += per_rad[i, s] * abs(frame.u[s])


@kernel
def elapse(frame):
    """Means over the frame that has elapsed: G, the moment of each surface, f + G u, and the bound.

    The truth is a left sum over n JSBSim frames, the first under the old command; so are these means.
    """
    share = frame.share
    for i in range(3):
        rate = share * frame.f_sum[i]
        for s in range(4):
            frame.G_mean[i, s] = share * frame.G_sum[i, s]
            frame.Gu_mean[i, s] = share * frame.Gu_sum[i, s]
            rate += frame.Gu_mean[i, s]
        frame.believed[i] = frame.design_mean[i] = rate
        frame.fdi.eta_bar[i] = share * frame.eta_bar_sum[i]
        frame.phi_mean[i] = share * frame.phi_sum[i]
    if frame.fdi.own_errors:
        frame.fdi.own_per_rad[:] = share * frame.own_per_rad_sum
        frame.fdi.own[:] = share * frame.own_sum
    if share < 1.0:
        spread(frame)


@kernel
def spread(frame):
    """Fill Gu_spread (3, 4) rad/s2: by how much the mean over the frame can mislead about a fault that
    changed in it.

    A fault grows, strikes or goes from one frame to the next, so the first JSBSim frame and the others may
    differ in it. With z0 and z the moments of a surface in the first and the others, the mean effect lies
    no further outside the extremes for the mean moment than |z0 - z| / n.
    """
    share = frame.share
    for i in range(3):
        for s in range(4):
            first = frame.Gu_first[i, s]
            others = (frame.Gu_sum[i, s] - first) * share / (1.0 - share)
            frame.Gu_spread[i, s] = share * abs(first - others)


@kernel
def predict(frame):
    """Bring the estimators from the frame before to this one."""
    fdi = frame.fdi
    guarantee.track(fdi, frame.phi_mean)
    bank.innovate(fdi, frame.x, frame.x_then, frame.believed)
    if fdi.statistical.enabled:
        compare_likelihoods(frame)
    isolation.suppose_all(fdi, frame.G_mean, frame.Gu_mean, frame.Gu_spread)
    if fdi.every_type:
        examine.note_orders(fdi, frame.commanded)
    if fdi.detected:
        isolation.predict_all(fdi, frame.x_then, frame.believed)
        for s in range(4):
            lost = 1.0 - frame.control.effectiveness[s]
            for i in range(3):
                frame.believed[i] -= lost * frame.Gu_mean[i, s]
        if fdi.every_type:
            believe_offsets(frame)
    if fdi.statistical.enabled:
        for i in range(3):
            frame.surprise[i] = (frame.x[i] - frame.x_then[i]) / fdi.dt - frame.believed[i]
        statistical.follow_rest(fdi.statistical, frame.surprise, fdi.dt)
    detection.predict(fdi, frame.x_then, frame.believed, fdi.isolated >= 0 or fdi.lead >= 0)


@kernel
def compare_likelihoods(frame):
    """Show the statistical detector the elapsed frame."""
    fdi = frame.fdi
    cubic = unanticipated_pitch(frame.design, frame.y, 1.0)
    statistical.signatures(fdi.statistical, frame.Gu_mean, cubic)
    statistical.observe(fdi.statistical, fdi.innovation, fdi.dt, frame.k, fdi.detected)
    statistical.score(fdi.statistical, frame.t)


@kernel
def look_ahead(frame):
    """Ready the statistical detector for the next frame: the air as the vanes see it, noise, coefficients."""
    fdi = frame.fdi
    attitude = frame.truth[ch.PHI : ch.PHI + 3]
    if fdi.statistical.air.moving:
        if frame.k > 0:
            air.observe(fdi.statistical.air, frame.y, attitude, fdi.dt)
        else:
            air.advance_axes(fdi.statistical.air, frame.y, attitude)
    statistical.prepare(fdi.statistical, fdi, frame.design, frame.x, frame.y, frame.u)


@kernel
def believe_offsets(frame):
    """What the surfaces are known to give without being asked is no surprise to the FDAE."""
    for s in range(4):
        for i in range(3):
            frame.believed[i] += frame.G_mean[i, s] * frame.control.offset[s]


@kernel
def remember(frame):
    """Begin the next frame's sums with this instant, the command in effect still the old one."""
    frame.x_then[:] = frame.x
    frame.fdi.noise_then[:] = frame.fdi.noise
    frame.f_sum[:], frame.eta_bar_sum[:], frame.phi_sum[:] = 0.0, 0.0, 0.0
    frame.G_sum[:], frame.Gu_sum[:] = 0.0, 0.0
    if frame.fdi.statistical.enabled:
        look_ahead(frame)
    if frame.fdi.own_errors:
        frame.own_per_rad_sum[:], frame.own_sum[:] = 0.0, 0.0
    sum_up(frame)
    frame.Gu_first[:] = frame.Gu_sum


@kernel
def bound_now(frame):
    """The bound on the uncertainty at this instant."""
    fdi = frame.fdi
    x = frame.x
    fdi.eta_bar_now[:] = 0.0
    if fdi.admitted.any:
        derived_bound(fdi.admitted, frame.design, x, frame.y, frame.u, fdi.eta_bar_now)
        if fdi.own_errors:
            for s in range(4):
                slack_per_rad(fdi.admitted, frame.design, s)
        x = fdi.admitted.far_x
    uncertainty_bound(x, frame.design, fdi.inertia, fdi.constant, fdi.earth_rate, fdi.eta_bar_now)


@kernel
def diagnose(frame):
    """Predict, compare, raise the alarm, exclude, decide."""
    look_back(frame)
    conclude(frame)
    remember(frame)


@kernel
def look_back(frame):
    """What the design model makes of the frame that has elapsed: its bound and its means."""
    fdi = frame.fdi
    bound_now(frame)
    fdi.eta_bar[:] = fdi.eta_bar_now
    if fdi.admitted.any:
        for i in range(3):
            fdi.noise[i] = changing_error(fdi.admitted, i, frame.x[i])
    if frame.k > 0:
        elapse(frame)
    else:
        detection.begin(fdi, frame.x)


@kernel
def conclude(frame):
    """The built-in estimators, from prediction to verdict."""
    fdi, x, t = frame.fdi, frame.x, frame.t
    if fdi.enabled:
        if frame.k > 0:
            predict(frame)
        else:
            bank.align(fdi, frame.G)
        guarantee.judge(fdi, t)
        decide(fdi, frame.y, x, t)


@kernel
def decide(fdi, y, x, t):
    """From residuals to alarm, and from then on to a verdict."""
    known = fdi.detected
    detection.detect(fdi, x, t)
    if not fdi.detected:
        return
    if not known:
        isolation.start(fdi, x)
    isolation.isolate(fdi, x, t, known)
    network.evaluate(fdi.network, y[ALPHA], y[BETA])


@kernel
def isolated_surface(fdi):
    """The surface of the isolated fault, or -1."""
    return fdi.estimator[fdi.isolated].surface if fdi.isolated >= 0 else -1


@kernel
def likelihood_counts(fdi):
    """Whether the statistical detector's estimates are the ones to use."""
    return fdi.statistical.enabled and fdi.authority != WORST_CASE


@kernel
def isolated_theta(fdi, s):
    """Estimated theta of the isolated loss of surface s: under noise, the most likely one."""
    if likelihood_counts(fdi):
        return statistical.loss_of(fdi.statistical, s)[0]
    return fdi.estimator[fdi.isolated].theta[fdi.dominant_axis[s]]


@kernel
def true_mode(frame):
    """The mode for one who is told the true fault the moment it occurs."""
    if not frame.faulted:
        return MODE_NOMINAL
    if frame.Cm_alpha3 != 0.0:
        return MODE_UNANTICIPATED
    if frame.truth[ch.POS + 2 * frame.u.size + ELEVATOR] < 1.0 or frame.immovable[ELEVATOR]:
        return MODE_REALLOCATED
    return MODE_ADAPTIVE


@kernel
def supervise(frame):
    """Put the right law in charge and note every change."""
    fdi = frame.fdi
    if frame.control.law == ORACLE:
        mode = true_mode(frame)
    elif fdi.every_type:
        replaced = fdi.lead_kind in (examine.LOSES, examine.FIXED)
        isolated = fdi.lead if replaced else min(fdi.isolated, 0)
        mode = mode_of(frame.control.law, fdi.detected, isolated, fdi.lead if replaced else -1)
    else:
        mode = mode_of(frame.control.law, fdi.detected, fdi.isolated, isolated_surface(fdi))
    mode = next_mode(frame.mode, mode)
    if mode != frame.mode or frame.n_modes == 0:
        last = min(frame.n_modes, MAX_EVENTS - 1)  # of more than there is room for, the latest stays
        frame.mode_at_s[last] = frame.t
        frame.mode_is[last] = mode
        frame.n_modes += 1
    frame.mode = mode


@kernel
def tell_oracle(frame, s):
    """The true effectiveness of surface s, none if it does not move, and what it is off besides."""
    effective = frame.truth[ch.POS + frame.u.size + s]
    frame.target[s] = 0.0 if frame.immovable[s] else frame.truth[ch.POS + 2 * frame.u.size + s]
    if frame.faulted:
        frame.control.offset[s] = effective - frame.target[s] * frame.u[s]


@kernel
def act_on_lead(frame, s):
    """What the diagnosis of every type makes of surface s: effectiveness and offset. A jam cannot wait."""
    fdi, control = frame.fdi, frame.control
    surface, at_fault = fdi.surface[s], candidates.possible(fdi, s)
    if surface.measure == examine.LOSES:
        frame.target[s] = verdict.effectiveness_left(fdi, s)
    elif surface.measure == examine.FIXED:
        frame.target[s] = control.effectiveness[s] = 0.0
        control.offset[s] = surface.command + verdict.deflection_error(surface, at_fault)
    elif surface.measure == examine.SHIFTED:
        control.offset[s] = verdict.deflection_error(surface, at_fault)
    elif surface.measure == examine.LAGS:
        control.lag[s] = 0.5 * (surface.low + surface.high) - surface.command
        control.hedging = 1


@kernel
def accommodate(frame):
    """What the law believes of the surfaces and of the unknown: effectiveness (4,) and fhat (3,) rad/s2."""
    control, fdi = frame.control, frame.fdi
    surface = isolated_surface(fdi)
    for s in range(4):
        frame.target[s], control.offset[s], control.lag[s] = 1.0, 0.0, 0.0
        if control.law == ORACLE:
            tell_oracle(frame, s)
        elif fdi.estimates and fdi.detected:
            frame.target[s] = fdi.effectiveness[s]
        elif fdi.every_type and fdi.surface[s].measure >= 0:
            act_on_lead(frame, s)
        elif s == surface and not fdi.every_type:
            frame.target[s] = 1.0 + isolated_theta(fdi, s)
            if likelihood_counts(fdi) and statistical.loss_of(fdi.statistical, s)[1] > SURE:
                control.effectiveness[s] = frame.target[s]  # what is known well need not be eased in
    adaptive.approach(control, frame.target)
    frame.fhat[:] = 0.0
    if control.law == ORACLE:
        frame.fhat[1] = unanticipated_pitch(frame.design, frame.y, frame.Cm_alpha3)
    elif control.law != NOMINAL and fdi.detected:
        if likelihood_counts(fdi):
            statistical.unknown_acceleration(fdi.statistical, frame.fhat)
        else:
            detection.unknown_acceleration(fdi, frame.fhat)
        if fdi.lead >= 0 and fdi.lead_kind == examine.LAGS:
            frame.fhat[:] = 0.0  # to ask a slow surface for what it lacks would only wind the command up


@kernel
def give_up(frame):
    """Command a surface that does not follow to its trim: should it come loose, that is where it goes, and it
    shows. From then on the reference is bent to what is left."""
    control, fdi = frame.control, frame.fdi
    for s in range(4):
        told = frame.immovable[s] and control.law == ORACLE
        fixed = fdi.every_type and fdi.surface[s].measure == examine.FIXED
        if told or (fixed and control.effectiveness[s] == 0.0):
            control.command[s] = control.trim[s]
            control.saturated[s] = 0
            control.hedging = 1


@kernel
def in_doubt(frame):
    """Whether elevator or flap is at fault and it has long been open which."""
    fdi, law = frame.fdi, frame.control.law
    open_question = fdi.every_type and fdi.detected and fdi.isolated == NOT_ISOLATED
    return open_question and fdi.surface[ELEVATOR].evidence >= fdi.patience and law not in (NOMINAL, ORACLE)


@kernel
def advance_hand_over(frame):
    """Hand the pitch demand to the flap, or back. What a jammed elevator no longer carries goes at once."""
    control = frame.control
    if frame.mode == MODE_REALLOCATED:
        control.hand_over = min(control.hand_over + control.hand_over_step, 1.0)
        given_up = control.effectiveness[ELEVATOR] < control.least_effectiveness
        if control.hedging or (given_up and frame.fdi.every_type):
            control.hand_over = max(control.hand_over, 1.0 - control.effectiveness[ELEVATOR])
    elif frame.fdi.every_type:
        control.hand_over = max(control.hand_over - control.hand_over_step, 0.0)


@kernel
def command(frame, reference):
    """Fill control.command (4,) rad from the reference (3,) rad/s: the law in charge."""
    control = frame.control
    accommodate(frame)
    if control.law == NOMINAL:
        frame.G_believed[:] = frame.G
    else:
        adaptive.believed_effectiveness(control, frame.G, frame.G_believed)
    advance_hand_over(frame)
    if control.probe_frames > 0:
        probing.advance(control, in_doubt(frame), frame.t)
    nominal.demand(control, frame.x, frame.f, frame.fhat)
    if control.law != NOMINAL:
        adaptive.allow_for_offsets(control, frame.G)
    allocation.allocate(control, frame.G_believed, control.command)
    give_up(frame)
    nominal.integrate(control, frame.x, frame.G_believed, control.command)
    if frame.faulted or control.hedging or (control.power.enabled and frame.fdi.detected):
        authority.note_shortfall(control, frame.G_believed, control.command)
    if control.power.enabled:
        power.steer(control, frame.x, frame.y, frame.fdi.detected, frame.t)


@kernel
def account(frame):
    """Sums for the metrics: tracking error before and after the fault, saturation, surface travel,
    envelope exits."""
    control = frame.control
    after = frame.faulted
    for i in range(3):
        square = (control.model_rate[i] - frame.truth[i]) ** 2
        if after:
            frame.post_fault_square[i] += square
        else:
            frame.pre_fault_square[i] += square
    if after:
        frame.post_fault_frames += 1
        account_authority(frame)
    else:
        frame.pre_fault_frames += 1
        bank.note_closest_approach(frame.fdi)
    for s in range(4):
        frame.saturated_frames[s] += control.saturated[s]
        if frame.k > 0:
            frame.travelled[s] += abs(frame.truth[ch.POS + s] - frame.position_then[s])
        frame.position_then[s] = frame.truth[ch.POS + s]
    note_envelope(frame)


@kernel
def account_authority(frame):
    """How much of what was demanded after the fault the surfaces could not give, and for how long not even
    the rates could have been held."""
    control = frame.control
    for i in range(3):
        frame.demanded[i] += abs(control.demand[i])
        frame.lacking[i] += abs(control.shortfall[i])
        frame.beyond_frames[i] += control.beyond[i]


@kernel
def note_envelope(frame):
    """Note when the flight leaves the validated envelope and when it comes back."""
    outside = frame.truth[ch.ENVELOPE] < 0.5
    frame.outside_frames += frame.outside
    if outside and not frame.outside:
        frame.n_exits += 1
    last = min(frame.n_exits, MAX_EVENTS) - 1  # of more than there is room for, the latest stays
    if outside and not frame.outside:
        frame.exit_at_s[last], frame.return_at_s[last] = frame.t, np.inf
    elif frame.outside and not outside:
        frame.return_at_s[last] = frame.t
    frame.outside = outside


@kernel
def put(row, column, values):
    """Write values into row from column on; returns the next column."""
    for i in range(values.size):
        row[column + i] = values[i]
    return column + values.size


@kernel
def record_truth(frame, row):
    """The first columns of the log: time and the truth. Returns the next column."""
    truth = frame.truth
    row[0] = frame.t
    row[1], row[2], row[3] = truth[ch.AIRSPEED], truth[ch.ALPHA], truth[ch.BETA]
    column = put(row, 4, truth[0:3])
    column = put(row, column, truth[ch.PHI : ch.PHI + 3])
    row[column] = (truth[ch.LATITUDE] - frame.latitude_0) * frame.radius_m
    row[column + 1] = (truth[ch.LONGITUDE] - frame.longitude_0) * frame.parallel_radius_m
    row[column + 2] = truth[ch.ALTITUDE]
    column = put(row, column + 3, truth[ch.PDOT : ch.PDOT + 3])
    row[column] = truth[ch.QDYN]
    column = put(row, column + 1, truth[ch.POS + 3 * frame.u.size : frame.n_truth])
    row[column] = truth[ch.ENVELOPE]
    return column + 1


@kernel
def record_surfaces(frame, row, column):
    """Command in effect, position and effective deflection of each surface; then who was saturated."""
    for s in range(4):
        row[column] = frame.commanded[s]
        row[column + 1] = frame.truth[ch.POS + s]
        row[column + 2] = frame.truth[ch.POS + frame.u.size + s]
        column += 3
    return put(row, column, frame.control.saturated)


@kernel
def record_estimators(fdi, row, column):
    """Residuals between their limits, per estimator; not a number before the estimators start."""
    for s in range(fdi.n_estimators):
        fie = fdi.estimator[s]
        for i in range(3):
            row[column] = fie.residual[i] if fdi.detected else np.nan
            row[column + 1] = fie.lower[i] if fdi.detected else np.nan
            row[column + 2] = fie.upper[i] if fdi.detected else np.nan
            column += 3
        row[column] = fie.excluded
        column += 1
    return column


@kernel
def record(frame, reference, row):
    """Write one row of the log, in the order of channels.log_columns."""
    control, fdi = frame.control, frame.fdi
    column = record_truth(frame, row)
    column = put(row, column, frame.x)
    column = put(row, column, reference)
    column = put(row, column, control.model_rate)
    column = record_surfaces(frame, row, column)
    column = put(row, column, fdi.residual)
    column = put(row, column, fdi.threshold)
    column = put(row, column, fdi.eta_bar)
    column = put(row, column, fdi.network.output)
    column = put(row, column, frame.design_mean)
    column = record_estimators(fdi, row, column)
    column = put(row, column, control.effectiveness)
    row[column] = frame.mode
    row[column + 1] = fdi.detected
    if control.power.enabled:
        row[column + 2] = control.power.command[0]
    if fdi.statistical.enabled:
        statistical.record(fdi.statistical, row)


@kernel
def begin(frame):
    """Measure, and work out what the design model makes of it. Returns the flight's status."""
    frame.t = frame.k * frame.dt
    return sense(frame)


@kernel
def sense(frame):
    """Measure, and work out what the design model makes of it. Returns the flight's status."""
    measure(frame)
    status = flight_status(frame.truth, frame.ground_m)
    if status != NOT_FINITE:
        response(frame.design, frame.x, frame.y, frame.f, frame.G)
        fault_effect(frame)
    return status


@kernel
def finish(frame, reference, row):
    """Account, record and hand the command over; the reference model moves on."""
    account(frame)
    record(frame, reference, row)
    reference_model.follow(frame.control, reference)
    authority.govern(frame.control, reference)
    for s in range(4):
        frame.commanded[s] = frame.control.command[s]
    frame.u_then[:] = frame.u
    move(frame.actuators, frame.commanded, frame.u)
    if frame.native:
        write_nodes(frame.setter, frame.write_pointers, frame.commanded)
        if frame.control.power.in_use:
            write_nodes(frame.setter, frame.engine_pointer, frame.control.power.command)
    frame.k += 1
    frame.row += 1


@kernel
def look(frames):
    """See the truth inside a frame of the loop, for the means over that frame, and leave it alone.

    frames (1,) of dtype FRAME. A departure, or what is not finite, is left for `fly_frame` to find.
    """
    frame = frames[0]
    if sense(frame) != NOT_FINITE:
        bound_now(frame)
        sum_up(frame)
    move(frame.actuators, frame.commanded, frame.u)


@kernel
def fly_frame(frames, references, log):
    """One frame of the closed loop with the built-in diagnosis and law.

    frames (1,) of dtype FRAME; references (n, 3) rad/s and log (n, columns) of the present chunk, indexed
    by frame.row. Returns FLYING, or why the flight ends: the row of a departure is still recorded, that of
    a non-finite truth is not.
    """
    frame = frames[0]
    status = begin(frame)
    if status == NOT_FINITE:
        return status
    reference, row = references[frame.row], log[frame.row]
    diagnose(frame)
    supervise(frame)
    command(frame, reference)
    finish(frame, reference, row)
    return status
