"""What the instruments must have in common, whatever the aircraft does: kinematics, air data, engine.

    turning     attitude[k+1] = attitude[k] turned by h (p, q, r)[k]         in body axes, and angle by angle
    flow        v[k+1] = v[k] turned by -h (p, q, r), + h (force + gravity)  v from alpha, beta, airspeed
    density     2 qdyn / V^2 changes with height only
    climb       altitude[k+1] = altitude[k] + h (v upwards)
    engine      speed and manifold pressure are as commanded
    equal       a sensor that no equation uses, and the reading that its row says it should equal

h is the time between two looks, a JSBSim frame: the truth's own integrators are followed (rates held over the
step; velocity by Adams and Bashforth's second order), so that residuals of sound instruments are what is left
out here: the Earth turns and is round. Every residual goes through filters of several poles, with a
bound on what the declared errors of all instruments together can make of it, as in bank.py. Declared
turbulence widens the bounds of flow and climb by what its gusts do within a filter's memory.
"""

import numpy as np

from beaver_ftc.compiled import kernel
from beaver_ftc.design.dryden import LEAST_HEIGHT_M
from beaver_ftc.diagnosis.detection.thresholds import bound_step, noise_step
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
    EQUAL_WITHIN,
    LEAP_M_S2,
    N_COMPUTED,
    PSI,
    QDYN,
    RPM,
    SPEED,
    THETA,
    TURN,
    P,
    Q,
    R,
)
from beaver_ftc.plant.instruments import ALTITUDE, AX, ENGINE_SPEED, MANIFOLD, N_SENSORS, PHI, wrapped
from beaver_ftc.scenario.sensors import N_IN_EQUATIONS

TURNING_RAD_S = 4e-5  # Earth rate is in the rates; the level turns with the flight over the round Earth
FALLING_M_S2 = 0.03  # Coriolis, centrifugal, and gravity's change with place
DENSITY_HEIGHT_M = 6300.0  # over which the density falls by no more than a factor e: in the stratosphere
STEEPEST_RAD = 1.3  # beyond it, roll and heading cannot be distinguished


@kernel
def quaternion(phi, theta, psi, out):
    """Fill out (4,): the rotation from body to level axes, scalar first."""
    a, b, c = np.cos(phi / 2), np.cos(theta / 2), np.cos(psi / 2)
    d, e, f = np.sin(phi / 2), np.sin(theta / 2), np.sin(psi / 2)
    out[0] = a * b * c + d * e * f
    out[1] = d * b * c - a * e * f
    out[2] = a * e * c + d * b * f
    out[3] = a * b * f - d * e * c


@kernel
def turn(q, x, h, out):
    """Fill out (4,) with q after h s at the rates x (3,) rad/s, one step of Euler's, to unit length."""
    p, r, s = 0.5 * h * x[0], 0.5 * h * x[1], 0.5 * h * x[2]
    length = np.sqrt(1.0 + p * p + r * r + s * s)
    out[0] = (q[0] - q[1] * p - q[2] * r - q[3] * s) / length
    out[1] = (q[1] + q[0] * p + q[2] * s - q[3] * r) / length
    out[2] = (q[2] + q[0] * r + q[3] * p - q[1] * s) / length
    out[3] = (q[3] + q[0] * s + q[1] * r - q[2] * p) / length


@kernel
def angle_between(one, other, axis):
    """Component (1, 2, 3) along a body axis of the small rotation from one attitude to the other, rad."""
    a, b, c = axis, axis % 3 + 1, (axis + 1) % 3 + 1
    along = one[0] * other[a] - one[a] * other[0] - one[b] * other[c] + one[c] * other[b]
    same = one[0] * other[0] + one[1] * other[1] + one[2] * other[2] + one[3] * other[3]
    return 2.0 * along if same >= 0.0 else -2.0 * along


@kernel
def turned_by(step, axis, i):
    """By how much a body axis turns for what angle i changes by."""
    bank, tilt = step.memory.then[PHI], step.memory.then[THETA]
    if axis == 0:
        return (1.0, 0.0, -np.sin(tilt))[i]
    if axis == 1:
        return (0.0, np.cos(bank), np.sin(bank) * np.cos(tilt))[i]
    return (0.0, -np.sin(bank), np.cos(bank) * np.cos(tilt))[i]


@kernel
def turn_back(x, h, vector, out):
    """Fill out (3,): a vector (3,) that stays put, in body axes that turned at x (3,) rad/s for h s."""
    size = np.sqrt(x[0] ** 2 + x[1] ** 2 + x[2] ** 2)
    angle = 2.0 * np.arctan(0.5 * h * size)
    sine = np.sin(angle) / size if size > 0.0 else 0.0
    rest = (1.0 - np.cos(angle)) / size**2 if size > 0.0 else 0.0
    along = x[0] * vector[0] + x[1] * vector[1] + x[2] * vector[2]
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        across = x[j] * vector[k] - x[k] * vector[j]
        out[i] = vector[i] - sine * across + rest * (x[i] * along - size**2 * vector[i])


@kernel
def bound_errors(step, signal):
    """Fill error and changing (N_SENSORS,): how far each reading can be off, and by how much that changes."""
    for i in range(N_SENSORS):
        size = abs(wrapped(signal[i])) if i == PSI else abs(signal[i])
        whole = (step.config.offset[i] + step.config.slope[i] * size) / (1.0 - step.config.slope[i])
        step.memory.error[i] = whole
        step.memory.changing[i] = whole - step.config.steady[i] + 1e-10 * abs(signal[i])
    for i in range(PHI, PHI + 3):
        step.memory.error[i] += step.memory.drifted


@kernel
def look(step, signal, force):
    """Keep this instant for the next look; signal (N_SENSORS,) SI, force (3,) m/s2."""
    step.memory.then[:], step.memory.error_before[:] = signal, step.memory.error_then
    step.memory.error_then[:] = step.memory.error
    quaternion(signal[PHI], signal[THETA], signal[PSI], step.memory.turned)
    alpha, beta, V = signal[ALPHA], signal[BETA], signal[AIRSPEED]
    step.memory.velocity[0] = V * np.cos(alpha) * np.cos(beta)
    step.memory.velocity[1], step.memory.velocity[2] = V * np.sin(beta), V * np.sin(alpha) * np.cos(beta)
    tilt, bank = signal[THETA], signal[PHI]
    step.memory.acceleration[0] = force[0] - step.config.gravity * np.sin(tilt)
    step.memory.acceleration[1] = force[1] + step.config.gravity * np.cos(tilt) * np.sin(bank)
    step.memory.acceleration[2] = force[2] + step.config.gravity * np.cos(tilt) * np.cos(bank)


@kernel
def length(vector):
    """The length of a vector (3,)."""
    return np.sqrt(vector[0] ** 2 + vector[1] ** 2 + vector[2] ** 2)


@kernel
def predict(step):
    """Fill predicted (N_SENSORS,): what the look before says of attitude, flow and altitude now."""
    rates, h, out, moved = step.memory.then[:3], step.config.h, step.memory.predicted, step.memory.scratch[:3]
    turn(step.memory.turned, rates, h, step.memory.now)
    a, b, c, d = step.memory.now[0], step.memory.now[1], step.memory.now[2], step.memory.now[3]
    out[PHI] = np.arctan2(2.0 * (a * b + c * d), 1.0 - 2.0 * (b * b + c * c))
    out[THETA] = np.arcsin(min(max(2.0 * (a * c - b * d), -1.0), 1.0))
    out[PSI] = np.arctan2(2.0 * (a * d + b * c), 1.0 - 2.0 * (c * c + d * d))
    tilt, bank, v = step.memory.then[THETA], step.memory.then[PHI], step.memory.velocity
    up = v[0] * np.sin(tilt) - v[1] * np.sin(bank) * np.cos(tilt) - v[2] * np.cos(bank) * np.cos(tilt)
    out[ALTITUDE] = step.memory.then[ALTITUDE] + h * up
    step.memory.sizes_before[1], step.memory.sizes_before[0] = step.memory.sizes_before[0], step.memory.size
    step.memory.size_then = length(step.memory.acceleration_then)
    for i in range(3):
        moved[i] = 1.5 * step.memory.acceleration[i] - 0.5 * step.memory.acceleration_then[i]
    step.memory.size = length(moved)
    for i in range(3):
        moved[i] = v[i] + h * moved[i]
    turn_back(rates, h, moved, v)
    turn_back(rates, h, step.memory.acceleration, step.memory.acceleration_then)
    speed = length(v)
    out[AIRSPEED] = speed
    out[ALPHA], out[BETA] = np.arctan2(v[2], v[0]), np.arcsin(v[1] / max(speed, 1e-3))


@kernel
def compare(step, signal):
    """Fill the residual of each test with what the readings (N_SENSORS,) are beyond what was predicted."""
    test, predicted = step.test, step.memory.predicted
    quaternion(signal[PHI], signal[THETA], signal[PSI], step.memory.scratch)
    for i in range(3):
        test[TURN + i].residual = angle_between(step.memory.now, step.memory.scratch, i + 1)
        test[ANGLE + i].residual = wrapped(signal[PHI + i] - predicted[PHI + i])
    test[SPEED].residual = signal[AIRSPEED] - predicted[AIRSPEED]
    test[ALPHA_FLOW].residual = signal[ALPHA] - predicted[ALPHA]
    test[BETA_FLOW].residual = signal[BETA] - predicted[BETA]
    dense, dense_then = (
        signal[QDYN] / signal[AIRSPEED] ** 2,
        step.memory.then[QDYN] / step.memory.then[AIRSPEED] ** 2,
    )
    test[DENSITY].residual = np.log(max(dense, 1e-9) / max(dense_then, 1e-9))
    test[CLIMB].residual = signal[ALTITUDE] - predicted[ALTITUDE]


@kernel
def steepest(step, signal):
    """How far from level the nose can have been since the look before, rad."""
    return max(
        abs(signal[THETA]) + step.memory.error[THETA],
        abs(step.memory.then[THETA]) + step.memory.error_then[THETA],
    )


@kernel
def stepped(step, i):
    """How far off 3/2 a - 1/2 a_then can be by what reading i is off at the two instants: a constant counts
    once."""
    return 1.5 * step.memory.error_then[i] + 0.5 * step.memory.error_before[i] - step.config.steady[i]


@kernel
def misjudged(step, turning, rates):
    """How far off the acceleration of the elapsed step can be, m/s2: by accelerometers, by gravity sought
    where the attitude has it, by turning the one before back. turning; rates: of gyros, errors; rad/s."""
    tilt, g = stepped(step, PHI) + stepped(step, THETA), step.config.gravity
    felt, steady = 0.0, g * (step.config.steady[PHI] + step.config.steady[THETA])
    for i in range(AX, AX + 3):
        felt += stepped(step, i) ** 2
        steady += step.config.steady[i]
    back = step.config.h * (turning * steady + 0.5 * rates * step.memory.size_then)
    return FALLING_M_S2 + step.memory.unknown + g * tilt + np.sqrt(felt) + back


@kernel
def allow_turning(step, signal, turning, rates):
    """The same as `allow`, of attitude. That a constant error of it turns with the aircraft: of the rates
    J(phi, theta) (phi', theta', psi') it changes J. An error of a moment turns an axis when it comes and back
    when it goes, and J has changed between."""
    test, E, n = step.test, step.memory.error_then, step.memory.changing
    level = 1.0 / np.cos(min(steepest(step, signal), STEEPEST_RAD))
    tilt, around = E[PHI] + E[THETA] + E[PSI], step.config.h * turning
    tipped = abs(signal[PHI] - step.memory.then[PHI]) + abs(signal[THETA] - step.memory.then[THETA])
    momentary = E[THETA] - step.config.steady[THETA] + E[PSI] - step.config.steady[PSI] + n[THETA] + n[PSI]
    for i in range(3):
        by_attitude = turning * (tilt + level * E[THETA]) + tipped * momentary / step.config.h
        test[TURN + i].rate = (
            TURNING_RAD_S + 2.0 * step.config.drift + E[P + i] + around * rates + by_attitude
        )
        by_attitude = 2.0 * level * turning * (E[PHI] + E[THETA])
        off = TURNING_RAD_S + (1.0 + level * around) * rates + by_attitude
        test[ANGLE + i].rate, test[ANGLE + i].noise = level * off + step.config.drift, n[PHI + i]
    tilted, banked = abs(np.sin(signal[THETA])) + n[THETA], abs(np.sin(signal[PHI])) + n[PHI]
    test[TURN].noise = n[PHI] + tilted * n[PSI]
    test[TURN + 1].noise = n[THETA] + banked * n[PSI]
    test[TURN + 2].noise = n[PSI] + banked * n[THETA]


@kernel
def lowest(step, signal):
    """The least height of the two looks, m, that the altimeter leaves."""
    now, then = (
        signal[ALTITUDE] - step.memory.error[ALTITUDE],
        step.memory.then[ALTITUDE] - step.memory.error_then[ALTITUDE],
    )
    return max(min(now, then), LEAST_HEIGHT_M)


@kernel
def allow_flow(step, signal, turning, rates):
    """The same, of flow and climb: slopes of their kinematics with each reading, where they are greatest."""
    test, e, E, n = step.test, step.memory.error, step.memory.error_then, step.memory.changing
    slow = max(min(signal[AIRSPEED] - e[AIRSPEED], step.memory.then[AIRSPEED] - E[AIRSPEED]), 1.0)
    slip = max(abs(signal[BETA]) + e[BETA], abs(step.memory.then[BETA]) + E[BETA])
    aslant, vanes = 1.0 / np.cos(min(slip, STEEPEST_RAD)), E[ALPHA] + E[BETA]
    off = misjudged(step, turning, rates)
    pull, coarse = step.memory.size + off, 1.0 + step.config.h * (2.0 * step.memory.size / slow + turning)
    gusty = np.sqrt(
        max(signal[AIRSPEED] / step.config.swift, 1.0) * max(step.config.low / lowest(step, signal), 1.0)
    )
    flow = aslant**2 * ((off + pull * (vanes + E[AIRSPEED] / slow)) / slow + turning * vanes) + aslant * rates
    test[SPEED].air, test[SPEED].noise = gusty, n[AIRSPEED]
    test[SPEED].rate = off + coarse * pull * vanes + step.config.h * (pull / slow) ** 2 * E[AIRSPEED]
    for c, vane in ((ALPHA_FLOW, ALPHA), (BETA_FLOW, BETA)):
        test[c].air, test[c].noise, test[c].rate = gusty * aslant / slow, n[vane], coarse * flow
    tilt, hardest = E[PHI] + E[THETA], max(pull, step.memory.sizes_before[0], step.memory.sizes_before[1])
    climb = (step.memory.then[AIRSPEED] + E[AIRSPEED]) * (tilt + vanes) + E[AIRSPEED]
    test[CLIMB].rate = step.config.rising + step.config.gust + climb + 4.0 / 3.0 * step.config.h * hardest
    test[CLIMB].noise = n[ALTITUDE]


@kernel
def reciprocal_moved(step, signal, i):
    """How far the logarithm of a quantity can seem to move, the reading of which is off by a constant."""
    least = max(min(signal[i], step.memory.then[i]), 1.0)
    moved = step.config.steady[i] * abs(1.0 / max(signal[i], 1.0) - 1.0 / max(step.memory.then[i], 1.0))
    return moved / max(1.0 - step.config.steady[i] / least, 0.01)


@kernel
def allow_density(step, signal):
    """The same, of the logarithm of the density."""
    test, e, n = step.test[DENSITY], step.memory.error, step.memory.changing
    fastest = (
        step.memory.then[AIRSPEED] + step.memory.error_then[AIRSPEED] + step.config.rising + step.config.gust
    )
    seems = reciprocal_moved(step, signal, QDYN) + 2.0 * reciprocal_moved(step, signal, AIRSPEED)
    test.rate = fastest / DENSITY_HEIGHT_M + seems / step.config.h
    test.noise = n[QDYN] / max(signal[QDYN] - e[QDYN], 1.0)
    test.noise += 2.0 * n[AIRSPEED] / max(signal[AIRSPEED] - e[AIRSPEED], 1.0)


@kernel
def allow(step, signal):
    """Fill what sound instruments with the declared errors may add to each residual: per second, at all.

    What was predicted is off by the errors of the readings it was predicted from (E, of the look before),
    what it is held against by those of now.
    """
    E = step.memory.error_then
    rates = E[P] + E[Q] + E[R]
    turning = abs(step.memory.then[P]) + abs(step.memory.then[Q]) + abs(step.memory.then[R]) + rates
    allow_turning(step, signal, turning, rates)
    allow_flow(step, signal, turning, rates)
    allow_density(step, signal)


@kernel
def follow(step, test):
    """Pass one residual through its filters; note the largest share of a bound."""
    test.share = 0.0
    for m, a in enumerate(step.config.decay):
        test.filtered[m] = a * test.filtered[m] + test.residual
        test.bound_rate[m] = bound_step(test.bound_rate[m], test.rate, a, step.config.h)
        test.bound_noise[m] = noise_step(test.bound_noise[m], test.noise_then, a)
        noise = test.bound_noise[m] + test.noise
        test.bound[m] = test.bound_rate[m] + noise + test.air * step.config.gusts[m]
        test.share = max(test.share, abs(test.filtered[m]) / test.bound[m])
    test.noise_then = test.noise


@kernel
def start(test):
    """Begin a test with this look: there is nothing in its filters yet, and all of the noise to come."""
    test.share = test.residual = 0.0
    test.filtered[:], test.bound_rate[:], test.bound_noise[:] = 0.0, 0.0, test.noise
    test.noise_then = test.noise


@kernel
def follow_engine(step, signal):
    """The engine's instruments against what was commanded: no filter, an error is there or not."""
    step.test[RPM].residual = signal[ENGINE_SPEED] - step.memory.command[0]
    step.test[RPM + 1].residual = signal[MANIFOLD] - step.memory.command[1]
    for which in range(2):
        size = step.memory.error[ENGINE_SPEED + which] + 1e-6
        step.test[RPM + which].share = abs(step.test[RPM + which].residual) / size


@kernel
def compare_equals(step, signal, fresh):
    """Compare each sensor that should equal a reading with that reading, when it gives a new sample, `fresh`:
    beyond what the errors of both and the two quantities may differ by, one of the two is broken."""
    for k in range(EQUAL_SENSOR.size):
        i, reading, test = EQUAL_SENSOR[k], EQUAL_READING[k], step.test[N_COMPUTED + k]
        test.share = 0.0
        if fresh[i - N_IN_EQUATIONS]:
            test.residual = signal[i] - signal[reading]
            if PHI <= reading <= PSI:
                test.residual = wrapped(test.residual)
            test.bound[0] = EQUAL_WITHIN[k] + step.memory.error[i] + step.memory.error[reading] + 1e-6
            test.share = abs(test.residual) / test.bound[0]


@kernel
def begin(step, signal, force):
    """The first look: what was before it is not known."""
    bound_errors(step, signal)
    look(step, signal, force)
    step.memory.error_before[:], step.memory.acceleration_then[:] = (
        step.memory.error_then,
        step.memory.acceleration,
    )
    step.memory.size = step.memory.sizes_before[0] = length(step.memory.acceleration) + LEAP_M_S2
    step.memory.unknown = 0.5 * LEAP_M_S2
    allow(step, signal)
    for c in range(RPM):
        start(step.test[c])


@kernel
def check(step, signal, engine):
    """Hold this instant's readings (N_SENSORS,) against the look before; engine: it has instruments."""
    step.memory.drifted += step.config.h * step.config.drift
    bound_errors(step, signal)
    predict(step)
    compare(step, signal)
    allow(step, signal)
    step.memory.unknown = 0.0
    steep = steepest(step, signal) > STEEPEST_RAD
    for c in range(RPM):
        if steep and c < SPEED:
            start(step.test[c])
        else:
            follow(step, step.test[c])
    if engine:
        follow_engine(step, signal)


@kernel
def set_drift(step, t):
    """Fill the bound on the attitude's drift by t s, which begins with the flight."""
    step.memory.drifted = step.config.drift * t
