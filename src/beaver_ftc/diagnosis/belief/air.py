"""What the vanes and the airspeed know of the air's rotation.

A gust that changes along the flight path pitches the aircraft like a pitch rate, and so does one that changes
sideways in yaw [MIL-F-8785C, 3.7]:

    tau_q q_g' + q_g = w_g' / V,  tau_q = 4 b / pi V        tau_r r_g' + r_g = v_g' / V,  tau_r = 3 b / pi V

Vanes and airspeed give the velocity through the moving air; the forces, attitude and gravity say how that
through still air would have changed. The difference is the gust's own change. The rolling gust, which
changes across the span, is seen by no instrument. Where the design model has no forces, as the
GTM's, accelerometers say them; without these no gust is seen: a change of the aircraft's own velocity
would be taken for one. It is only shown, as it would be if lift held the weight: fast changes are the gust's,
and a law that answers the vanes moves the surfaces along with its rotation, as if they were lost.

V in these equations is the speed at which the aircraft passes through the field of gusts. The mean wind
carries that field [MIL-F-8785C, 3.7.1], so V is the speed through the mean air. The airspeed differs from it
by the gust itself. The changes of the gust are seen, so their sum is known but for what it was at the start,
and for the drift of accelerometers and attitude: `blown` is that sum, and forgets as slowly as that drift
lets it. A speed that is off by a share e lets a gust be off by e of itself where it turns as slowly as it
returns: of its intensity that is e^2 / 4 (`passing_doubt`).

The strength of turbulence is that above 2000 ft, or that at the height flown where this is more.

Velocity is followed as JSBSim moves it, by Adams and Bashforth's two steps: v' = v + dt (3 a - a_before) / 2.
"""

from math import pi

import numpy as np

from beaver_ftc.aircraft import MassProperties
from beaver_ftc.aircraft.aircraft import FORCES
from beaver_ftc.aircraft.schema import MAX_MONOMIALS
from beaver_ftc.aircraft.units import EARTH_RATE_RAD_S, GRAVITY_MPS2
from beaver_ftc.compiled import kernel, record
from beaver_ftc.design.dryden import SCALE_M, rotation_lengths
from beaver_ftc.design.model import rate_damping
from beaver_ftc.design.terms import AIRSPEED, ALPHA, BETA, QDYN, TABLE, evaluate, fill_table, whole_sum
from beaver_ftc.diagnosis.bounds.variances import flow_noise, jitter
from beaver_ftc.diagnosis.bounds.worst_case import least_height
from beaver_ftc.diagnosis.monitors.redundancy import FALLING_M_S2
from beaver_ftc.plant.instruments import wrapped
from beaver_ftc.scenario.declared import MASS_TOLERANCE, Declared, SensorErrors

# Share of the intensity of the rolling, pitching and yawing gust that the vanes leave; on exact vanes and
# over a filter's memory it is less (`tests/diagnosis/test_air.py`).
UNSEEN = (1.0, 0.003, 0.03)
BY_FORCE = 0.01  # share of the intensity that errors of a tenth leave of the gusts that forces show
TWO_STEPS = 1.6  # times its noise does an acceleration scatter by Adams and Bashforth: sqrt(1.5^2 + 0.5^2)
STEEP = 0.5  # cosine of the steepest bank at which lift is taken to hold the weight
STRONGEST = 4.0  # standard deviations: no gust is taken for stronger
SLOPE_RAD = 0.3  # of the path, along which gravity acts
DRAG = 0.3  # of the weight, at most: what errors of the coefficients are a share of
LEAST_SWING = 0.01  # of a gust's own intensity: less is not reckoned with

CONFIG = record(
    modelled=int,  # whether the design model has forces
    glimpsed=int,  # whether the vanes show a gust but roughly
    area_per_mass=float, gravity=float, span=float,
    aloft=3, low=3,  # intensity of the rotation's drift over airspeed above 2000 ft; at a height of 1 m
    altitude_off=float, altitude_slope=float,  # how far the altimeter's reading can be off, m; as a share
    # Largest component of a gust, m/s; how fast its sum is forgotten, 1/s.
    strongest=float, forgets=float,
    # Variance, (m/s)2, that the speed is off by; that of a gust there was at the start; share of a gust's
    # intensity per square of the relative error.
    spread=float, gusty=float, doubt=float,
    rolling=float,  # lag of the rolling gust times airspeed, m
    scale=float,  # of the gusts, m
    in_flight=int,  # whether the diagnosis begins in air that is moving by then
)  # fmt: skip

MEMORY = record(
    started=int,  # whether `pull` is known
    felt=3,  # what accelerometers say, m/s2
    forces=TABLE, scratch=MAX_MONOMIALS,  # force coefficients, evaluated at this instant
    velocity=3, force=3, turn=(3, 3), heading=float,
    pull=3,  # forces and gravity an instant before, m/s2 in the level axes of this one
    gust=3, rotation=3,
    total=3,  # over the instants of a frame
    per_metre=3,  # intensity of the rotation's drift over airspeed, rad2/s3 per m/s, at this height
    unseen=3,  # share of it that the vanes do not show
    # The gust's velocity since the start, m/s ahead, right, down; which share of the variance of a gust there
    # was at the start is still unknown.
    blown=3, fresh=float,
    # Share of a yawing gust that turning loses at this instant, and that is lost; share of a pitching gust
    # unseen because the diagnosis begins in flight.
    lost=float, turning=float, late=float,
    # How fast the axes of the gusts turn in the body, 1/s, and whether that matters.
    swing=(3, 3), swings=int,
    # Variance of what that moves the accelerations by, (rad/s2)2: in the frame that goes on, in the one
    # before it; for how many frames there is any.
    leaping=(3, 3), leapt=(3, 3), leaps=int,
)  # fmt: skip

OUTPUT = record(
    # Whether there is turbulence; whether accelerometers are read, and whether the vanes tell a gust. These
    # are filled by configure, and end with the accelerometers.
    moving=int, read=int, seen=int,
    acceleration=3, mean=3,  # rad/s2: of the gust that is seen, at this instant; mean over the elapsed frame
    shown=3,  # the same of a gust that the vanes show but roughly
    leap=(3, 3),  # (rad/s2)2: `leaping` and `leapt` together
    speed=float,  # through the mean air, m/s
    damping=(3, 3), axes=(3, 3),  # 1/s; from the gusts' axes to body axes
)  # fmt: skip

AIR = record(config=CONFIG, memory=MEMORY, output=OUTPUT)


@kernel
def specific_force(air, x, y, u, out):
    """Fill out (3,) m/s2: aerodynamic and propulsive force over mass, body axes; x (3,) rad/s, y (4 +
    declared,), u (surfaces,) rad. The term in the rate of sideslip is left out: it is below a hundredth of
    the side force."""
    table = air.memory.forces
    evaluate(table, x, y)
    for i in range(3):
        out[i] = y[QDYN] * air.config.area_per_mass * whole_sum(table, i, table.power, u)


@kernel
def level_axes(phi, theta, turn):
    """Fill turn (3, 3), from level axes to body axes; level: forward, right, down. Angles rad."""
    sin_phi, cos_phi, sin_theta, cos_theta = np.sin(phi), np.cos(phi), np.sin(theta), np.cos(theta)
    turn[0, 0], turn[0, 1], turn[0, 2] = cos_theta, 0.0, -sin_theta
    turn[1, 0], turn[1, 1], turn[1, 2] = sin_phi * sin_theta, cos_phi, sin_phi * cos_theta
    turn[2, 0], turn[2, 1], turn[2, 2] = cos_phi * sin_theta, -sin_phi, cos_phi * cos_theta


@kernel
def to_level(turn, body, i):
    """Component i of a body vector (3,) in level axes."""
    return turn[0, i] * body[0] + turn[1, i] * body[1] + turn[2, i] * body[2]


@kernel
def advance_axes(air, y, attitude):
    """Bring `turn`, `heading` and the `velocity` through the air, m/s in level axes, to this frame.

    y (5,) and attitude (3,) rad as measured.
    """
    alpha, beta, V = y[ALPHA], y[BETA], y[AIRSPEED]
    level_axes(attitude[0], attitude[1], air.memory.turn)
    air.memory.heading = attitude[2]
    u, v, w = V * np.cos(alpha) * np.cos(beta), V * np.sin(beta), V * np.sin(alpha) * np.cos(beta)
    for i in range(3):
        air.memory.velocity[i] = (
            air.memory.turn[0, i] * u + air.memory.turn[1, i] * v + air.memory.turn[2, i] * w
        )


@kernel
def begin(air, y, attitude):
    """The first frame of a diagnosis: no gust has been seen to change yet. One that is there already, of a
    diagnosis that begins in flight, fades unseen."""
    advance_axes(air, y, attitude)
    turn_gusts(air, 0.0, 1.0)
    air.memory.gust[:] = 0.0
    air.memory.started, air.memory.lost = 0, 0.0
    air.memory.turning = air.memory.late = air.memory.fresh = float(air.config.in_flight)
    air.memory.blown[:], air.output.speed = 0.0, y[AIRSPEED]
    air.memory.leaping[:], air.memory.leapt[:], air.output.leap[:], air.memory.leaps = 0.0, 0.0, 0.0, 0


@kernel
def turn_gusts(air, sin, cos):
    """Bring `axes` to this instant, and keep those of the one before in `swing`.

    sin, cos: of what the heading has turned. JSBSim's gusts point along the heading of the step before.
    """
    air.memory.swing[:] = air.output.axes
    for i in range(3):
        ahead, right = air.memory.turn[i, 0], air.memory.turn[i, 1]
        air.output.axes[i, 0], air.output.axes[i, 1] = ahead * cos - right * sin, ahead * sin + right * cos
        air.output.axes[i, 2] = air.memory.turn[i, 2]


@kernel
def note_swing(air, dt, V):
    """How fast the axes of the gusts have turned in the body since `swing` held them, dt s ago.

    A gust unseen that keeps its size, sigma = sqrt(intensity lag / 2), then changes in the body by sigma
    times that; over its lag like a walk of (swing lag)^2 / 2 of the gust's own intensity.
    """
    most = 0.0
    for i in range(3):
        for g in range(3):
            air.memory.swing[i, g] = (air.output.axes[i, g] - air.memory.swing[i, g]) / dt
            most = max(most, abs(air.memory.swing[i, g]))
    air.memory.swings = 0.5 * (most * air.config.rolling / V) ** 2 > LEAST_SWING


@kernel
def lost_by_turning(air, V, rate):
    """Share of the yawing gust's changes that the vanes do not show while the heading turns, at rate rad/s.

    The gusts turn with the aircraft, so one from ahead, of standard deviation sigma, is soon one from aside:
    that is a change by rate sigma, besides a walk of intensity 3 sigma^2 V / scale. Over the lag of the
    yawing gust, 3 span / pi V, the square of the one over that of the other.
    """
    return rate * rate * air.config.span * air.config.scale / (pi * V * V)


@kernel
def observe(air, y, attitude, dt):
    """Follow the gust over the elapsed frame: `gust` (3,) rad/s in level axes, the rolling one unknown.

    y (5,) and attitude (3,) rad as measured now, dt s after `force` and `turn`. Where the heading turns so
    fast that what the vanes show is mostly that, as it does when the nose passes the vertical, a yawing gust
    is let fade, unseen; an instant longer, since JSBSim's gusts turn a step after the heading.
    """
    pulled = air.memory.scratch
    for i in range(3):
        pulled[i] = to_level(air.memory.turn, air.memory.force, i)
    pulled[2] += air.config.gravity
    if not air.memory.started:
        air.memory.pull[:] = pulled[:3]
        air.memory.started = 1
    for i in range(3):
        air.memory.velocity[i] += dt * (1.5 * pulled[i] - 0.5 * air.memory.pull[i])
    turned = wrapped(attitude[2] - air.memory.heading)
    sin, cos = np.sin(turned), np.cos(turned)
    ahead, right = (
        air.memory.velocity[0] * cos + air.memory.velocity[1] * sin,
        air.memory.velocity[1] * cos - air.memory.velocity[0] * sin,
    )
    down = air.memory.velocity[2]
    air.memory.pull[0], air.memory.pull[1] = (
        pulled[0] * cos + pulled[1] * sin,
        pulled[1] * cos - pulled[0] * sin,
    )
    air.memory.pull[2] = pulled[2]
    advance_axes(air, y, attitude)
    pass_through(air, ahead, right, down, y[AIRSPEED], dt)
    V = air.output.speed
    turn_gusts(air, sin, cos)
    note_swing(air, dt, V)
    pitching, yawing = 4.0 * air.config.span / (pi * V), 3.0 * air.config.span / (pi * V)  # lags, s
    before, air.memory.lost = air.memory.lost, lost_by_turning(air, V, turned / dt)
    lost = max(before, air.memory.lost)
    air.memory.turning = min(max(np.exp(-dt / yawing) * air.memory.turning, lost), 1.0)
    air.memory.late *= np.exp(-dt / pitching)
    air.memory.gust[1] = np.exp(-dt / pitching) * air.memory.gust[1] + (down - air.memory.velocity[2]) / (
        V * pitching
    )
    air.memory.gust[2] = np.exp(-dt / yawing) * air.memory.gust[2]
    if lost < 1.0:
        air.memory.gust[2] += (right - air.memory.velocity[1]) / (V * yawing)
    else:
        air.memory.blown[:], air.memory.fresh = 0.0, 1.0


@kernel
def pass_through(air, ahead, right, down, V, dt):
    """Bring `blown` and `speed` to this instant, dt s after the one before: ahead, right, down, m/s, is the
    velocity through air whose gust had not changed. V m/s: airspeed, which serves where no gust is seen."""
    air.output.speed = V
    if not air.output.seen:
        return
    kept = np.exp(-air.config.forgets * dt)
    air.memory.fresh *= kept * kept
    air.memory.blown[0] = kept * air.memory.blown[0] + ahead - air.memory.velocity[0]
    air.memory.blown[1] = kept * air.memory.blown[1] + right - air.memory.velocity[1]
    air.memory.blown[2] = kept * air.memory.blown[2] + down - air.memory.velocity[2]
    squared = 0.0
    for i in range(3):
        air.memory.blown[i] = min(max(air.memory.blown[i], -air.config.strongest), air.config.strongest)
        squared += (air.memory.velocity[i] + air.memory.blown[i]) ** 2
    air.output.speed = max(np.sqrt(squared), 0.5 * V)


@kernel
def reach_height(air, altitude):
    """Bring the strength of the turbulence to this altitude, m as measured."""
    height = least_height(altitude, air.config.altitude_off, air.config.altitude_slope)
    air.memory.per_metre[0] = max(air.config.aloft[0], air.config.low[0] / height**1.5)
    for g in range(1, 3):
        air.memory.per_metre[g] = max(air.config.aloft[g], air.config.low[g] / height)


@kernel
def follow(air, y, attitude, dt, k):
    """Begin with the first frame, of number k = 0, and observe those that follow."""
    if k > 0:
        observe(air, y, attitude, dt)
    else:
        begin(air, y, attitude)


@kernel
def effect(air, design, x, y, u):
    """Fill `acceleration` (3,) rad/s2 with what the gust seen does from here on, and `force` for next time.

    x (3,) rad/s, y (5,), u (4,) rad: measured, and the surfaces in effect.
    """
    if air.output.read:
        air.memory.force[:] = air.memory.felt
    elif air.config.glimpsed:  # lift holds the weight, and turns as far as the bank goes
        air.memory.force[0] = air.memory.force[1] = 0.0
        air.memory.force[2] = -air.config.gravity / max(air.memory.turn[2, 2], STEEP)
    else:
        specific_force(air, x, y, u, air.memory.force)
    rate_damping(design, x, y, u, air.memory.scratch, air.output.damping)
    for i in range(3):
        known = air.output.axes[i, 1] * air.memory.gust[1] + air.output.axes[i, 2] * air.memory.gust[2]
        air.memory.rotation[i] = known if air.output.seen or air.config.glimpsed else 0.0
    for i in range(3):
        moved = 0.0
        for j in range(3):
            moved -= air.output.damping[i, j] * air.memory.rotation[j]
        air.output.acceleration[i], air.output.shown[i] = (moved, 0.0) if air.output.seen else (0.0, moved)


@kernel
def begin_frame(air, V, dt):
    """Begin the sums over the next frame's instants, dt s apart, with this one; V m/s."""
    air.memory.total[:] = air.output.acceleration
    note_leap(air, V, dt)


@kernel
def look(air, design, x, y, u, attitude, dt):
    """Follow the gust to an instant inside a frame, dt s after the one before; arguments as in `effect`."""
    observe(air, y, attitude, dt)
    effect(air, design, x, y, u)
    for i in range(3):
        air.memory.total[i] += air.output.acceleration[i]
    note_leap(air, y[AIRSPEED], dt)


@kernel
def take_force(air, force):
    """Take in what the accelerometers say, force (3,) m/s2."""
    air.memory.felt[:] = force


@kernel
def stop(air):
    """Follow no gust from now on."""
    air.output.moving = 0


@kernel
def no_longer_read(air):
    """Do without the accelerometers from now on. A gust that they alone showed is there, unseen: its whole
    variance counts."""
    air.output.read = 0
    if air.output.seen and not air.config.modelled:
        air.output.seen, air.memory.unseen[:] = 0, 1.0
        pitching, yawing = 0.5 * length(air, 1), 0.5 * length(air, 2)
        for i in range(3):
            for j in range(3):
                air.memory.leaping[i, j] += (
                    pitching * air.memory.per_metre[1] * together(air, air.output.axes, i, j, 1)
                )
                air.memory.leaping[i, j] += (
                    yawing * air.memory.per_metre[2] * together(air, air.output.axes, i, j, 2)
                )
        air.memory.leaps = 3


@kernel
def hidden(air, g):
    """Share of the gust about axis g that the vanes do not show in this frame."""
    if g == 0:
        return min(air.memory.unseen[g], 1.0)
    off = (
        air.config.doubt
        * (air.config.spread + air.memory.fresh * air.config.gusty)
        / max(air.output.speed, 1.0) ** 2
        if air.output.seen
        else 0.0
    )
    return min(air.memory.unseen[g] + off + (air.memory.late if g == 1 else air.memory.turning), 1.0)


@kernel
def sooner(air, g):
    """How much less of the gust about axis g is slow than if it returned as late as the rolling one. What
    vanes leave of a gust that they tell returns as it likes."""
    return (length(air, g) / air.config.rolling) ** 2 if air.config.glimpsed else 1.0


@kernel
def length(air, g):
    """Way flown within which the gust about axis g returns, m, as `design.dryden.rotation_lengths`."""
    return air.config.rolling if g == 0 else (4.0 if g == 1 else 3.0) * air.config.span / pi


@kernel
def unseen_drift(air, V, i, j, slow=False):
    """Intensity, (rad/s2)2/s, with which the air's unseen rotation moves accelerations i and j; V m/s.
    `slow`: as of a gust that returns with the rolling one and moves them as much where it is slow."""
    total = 0.0
    for g in range(3):
        share = sooner(air, g) if slow else 1.0
        total += together(air, air.output.axes, i, j, g) * hidden(air, g) * air.memory.per_metre[g] * share
    return total * max(V, air.output.speed)


@kernel
def note_leap(air, V, dt):
    """Add what the swing of the gusts' axes, dt s long, does to the accelerations, while V m/s is flown."""
    if not air.memory.swings:
        return
    rolling = 0.5 * (air.config.rolling / V) ** 2 * air.memory.per_metre[0]
    yawing = 0.5 * (3.0 * air.config.span / (pi * V)) ** 2 * air.memory.per_metre[2] * air.memory.turning
    for i in range(3):
        for j in range(3):
            roll, yaw = together(air, air.memory.swing, i, j, 0), together(air, air.memory.swing, i, j, 2)
            air.memory.leaping[i, j] += dt * V * (rolling * roll + yawing * yaw)
    air.memory.leaps = 3


@kernel
def elapse(air, share):
    """Bring `mean` and `leap` to the elapsed frame; share: one over its instants.

    Axes that turn round within an instant do so in the midst of a frame: it shows a part of that, the next
    one the rest. So unlike a drift, which goes on from where the frame ends, the leap is there in both.
    """
    for i in range(3):
        air.output.mean[i] = share * air.memory.total[i]
    if air.memory.leaps > 0:
        air.memory.leaps -= 1
        for i in range(3):
            for j in range(3):
                air.output.leap[i, j] = air.memory.leapt[i, j] + air.memory.leaping[i, j]
                air.memory.leapt[i, j], air.memory.leaping[i, j] = air.memory.leaping[i, j], 0.0


@kernel
def whole_drift(air, V, felt, gust_on_forces):
    """Intensity, (rad/s2)2/s, of all of the air's rotation where rates feel it, `felt` (3,) 1/s about the
    body axes, and forces do: of one who does not ask the vanes."""
    total, longest_s = 0.0, air.config.rolling / V
    for g in range(3):
        by_both = abs(along(felt, air.output.axes, g)) + abs(along(gust_on_forces, air.output.axes, g))
        total += by_both**2 * air.memory.per_metre[g]
        if air.memory.swings:
            total += (
                0.5 * longest_s * longest_s * air.memory.per_metre[g] * along(felt, air.memory.swing, g) ** 2
            )
    return total * max(V, air.output.speed)


@kernel
def drift_beside(air, V, gust_on_rates, gust_on_forces):
    """Intensity of what the vanes leave of the rotation where rates feel it, and of all of it where forces
    do: (3,) 1/s each, about the body axes."""
    total = 0.0
    for g in range(3):
        of_rates = np.sqrt(hidden(air, g)) * abs(along(gust_on_rates, air.output.axes, g))
        total += (of_rates + abs(along(gust_on_forces, air.output.axes, g))) ** 2 * air.memory.per_metre[g]
    return total * max(V, air.output.speed)


@kernel
def along(felt, axes, g):
    """What axis g of the gusts does where rotation is `felt` (3,) about the body axes."""
    return felt[0] * axes[0, g] + felt[1] * axes[1, g] + felt[2] * axes[2, g]


@kernel
def together(air, axes, i, j, g):
    """How much axis g of the gusts moves accelerations i and j together, of 1 rad/s along it: 1/s2 of `axes`,
    1/s4 of their `swing`."""
    on_i, on_j = 0.0, 0.0
    for k in range(3):
        on_i += air.output.damping[i, k] * axes[k, g]
        on_j += air.output.damping[j, k] * axes[k, g]
    return on_i * on_j


def set_up_air(air: np.void, declared: Declared, mass: MassProperties) -> None:
    """Fill the record with the declared turbulence, for an aircraft of so much mass."""
    turbulence, errors, aircraft = declared.air, declared.sensors, declared.aircraft
    span_m = aircraft.geometry.span_m
    air["output"]["moving"], air["config"]["modelled"] = turbulence.moves, bool(aircraft.measurable_forces)
    air["output"]["seen"] = air["config"]["modelled"] or air["output"]["read"]  # only where forces are known
    air["config"]["glimpsed"] = air["output"]["moving"] and not air["output"]["seen"]
    fill_table(air["memory"]["forces"], aircraft, aircraft.measurable_forces, FORCES)
    air["config"]["area_per_mass"] = aircraft.geometry.wing_area_m2 / mass.mass_kg
    air["config"]["gravity"] = GRAVITY_MPS2  # standard; what is constant has no part in a change of the gust
    air["config"]["span"] = span_m
    air["config"]["aloft"], air["config"]["low"] = (
        turbulence.rotation_walk(span_m),
        turbulence.rotation_walk_at_1_m(span_m),
    )
    air["memory"]["per_metre"], air["memory"]["unseen"] = (
        air["config"]["aloft"],
        UNSEEN if air["output"]["seen"] else 1.0,
    )
    air["config"]["altitude_off"], air["config"]["altitude_slope"] = (
        errors["altitude"].worst,
        errors["altitude"].slope,
    )
    air["config"]["scale"] = SCALE_M
    air["config"]["rolling"] = rotation_lengths(span_m)[0]


def set_up_jitter(
    statistical: np.void, errors: SensorErrors, design: np.void, y: np.ndarray, u: np.ndarray, dt_s: float
) -> None:
    """What noise adds to the gust that is followed: that of the vanes, and of the force that moves the air's
    velocity on from frame to frame; where the flow follows from the forces, that of the forces too."""
    flow, span_m = flow_noise(errors, y[AIRSPEED]), float(statistical["air"]["config"]["span"])
    if statistical["forces"]["known"] or statistical["air"]["output"]["read"]:
        flow += TWO_STEPS * errors.each("random", ("az", "ay")) * dt_s / y[AIRSPEED]
    if statistical["forces"]["known"]:
        forces = statistical["forces"]["component"][::-1]  # normal to the body, and across
        by_force = np.sqrt(forces["felt"]) / np.abs(forces["vane"][:, 1])
        statistical["forces"]["blurred"] = jitter(by_force, design, y, u, span_m)
    for name in ("own_jitter", "jitter"):
        statistical["noise"][name] += jitter(flow, design, y, u, span_m) ** 2


def set_up_passing(air: np.void, declared: Declared, level: float, airspeed_mps: float) -> None:
    """How well the speed through the mean air is known, from an airspeed in trim, and how fast the sum of the
    gust's changes is forgotten; level: of the alarm, in standard deviations.

    An acceleration off by b, m/s2, lets a sum that forgets at a rate a be off by b / a; and of a gust of
    deviation sigma that returns at a rate V / L such a sum misses a variance of sigma^2 a / (a + V / L). Both
    together are least near a^3 = 2 b^2 V / (L sigma^2).
    """
    sigma, errors = declared.air.sigma_mps, declared.sensors
    if not (air["output"]["moving"] and air["output"]["seen"]):
        return
    returns, V = airspeed_mps / SCALE_M, errors["V"]
    drift = 2.0 * EARTH_RATE_RAD_S * airspeed_mps + SLOPE_RAD * FALLING_M_S2  # Coriolis; gravity with place
    drift += GRAVITY_MPS2 * (errors["phi"].steady + errors["theta"].steady)
    if air["output"]["read"]:
        drift += errors["ax"].steady + GRAVITY_MPS2 * DRAG * errors["ax"].slope
    else:
        drift += GRAVITY_MPS2 * DRAG * (declared.coefficients.largest + MASS_TOLERANCE)
    forgets = (2.0 * drift**2 * returns / sigma**2) ** (1.0 / 3.0)
    air["config"]["gusty"], air["config"]["strongest"], air["config"]["forgets"] = (
        sigma**2,
        STRONGEST * sigma,
        forgets,
    )
    air["config"]["spread"] = sigma**2 * forgets / (forgets + returns) + (drift / forgets) ** 2 + V.random**2
    air["config"]["spread"] += (V.steady + V.slope * airspeed_mps) ** 2
    air["config"]["doubt"] = passing_doubt(level)


def passing_doubt(level: float) -> float:
    """Share of a gust's intensity that a relative error of the speed leaves, over its variance.

    A speed off by a share e leaves the gust's equation an error of (e / tau) q, of the spectrum
    e^2 (w / tau)^2 / (w^2 + 1 / tau^2)^2 times that of a walk of the gust's intensity: e^2 / 4 at most. e is
    a normal number of its own beside the noise: the product of two passes x deviations with a chance of
    exp(-x), which is that of the alarm level, exp(-level^2 / 2), where e is taken to be level / 2 deviations.
    """
    return (0.5 * level) ** 2 / 4.0
