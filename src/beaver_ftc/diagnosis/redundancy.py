"""What the instruments must have in common, whatever the aircraft does: kinematics, air data, engine.

    turning     attitude[k+1] = attitude[k] turned by h (p, q, r)[k]         in body axes, and angle by angle
    flow        v[k+1] = v[k] turned by -h (p, q, r), + h (force + gravity)  v from alpha, beta, airspeed
    density     2 qdyn / V^2 changes with height only
    climb       altitude[k+1] = altitude[k] + h (v upwards)
    engine      speed and manifold pressure are as commanded

h is the time between two looks, a JSBSim frame: the truth's own integrators are followed (rates held over the
step; velocity by Adams and Bashforth's second order), so that residuals of sound instruments are what is left
out here: the Earth turns and is round. Every residual goes through filters of several poles, with a
bound on what the declared errors of all instruments together can make of it, as in bank.py. Declared
turbulence widens the bounds of flow and climb by what its gusts do within a filter's memory.
"""

from math import pi

import numpy as np

from beaver_ftc.compiled import kernel
from beaver_ftc.diagnosis.thresholds import bound_step, noise_step
from beaver_ftc.diagnosis.watch import (
    AIRSPEED,
    ALPHA,
    ALPHA_FLOW,
    ANGLE,
    BETA,
    BETA_FLOW,
    CLIMB,
    DENSITY,
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
from beaver_ftc.plant.instruments import ALTITUDE, AX, ENGINE_SPEED, MANIFOLD, N_SENSORS, PHI

TURNING_RAD_S = 4e-5  # Earth rate is in the rates; the level turns with the flight over the round Earth
FALLING_M_S2 = 0.03  # Coriolis, centrifugal, and gravity's change with place
CLIMBING_M_S = 1.0  # vertical wind
DENSITY_HEIGHT_M = 7000.0  # over which the density falls by no more than a factor e
STEEPEST_RAD = 1.3  # beyond, roll and heading are not to be told apart


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
def wrapped(angle):
    """The angle within -pi and pi."""
    return angle - 2.0 * pi * np.floor(angle / (2.0 * pi) + 0.5)


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
def note_declared(step, signal):
    """Fill error and changing (N_SENSORS,): how far each reading can be off, and by how much that changes."""
    for i in range(N_SENSORS):
        whole = (step.offset[i] + step.slope[i] * abs(signal[i])) / (1.0 - step.slope[i])
        step.error[i] = whole
        step.changing[i] = whole - step.steady[i] + 1e-10 * abs(signal[i])


@kernel
def look(step, signal, force):
    """Keep this instant for the next look; signal (N_SENSORS,) SI, force (3,) m/s2."""
    step.then[:] = signal
    quaternion(signal[PHI], signal[THETA], signal[PSI], step.turned)
    alpha, beta, V = signal[ALPHA], signal[BETA], signal[AIRSPEED]
    step.velocity[0] = V * np.cos(alpha) * np.cos(beta)
    step.velocity[1], step.velocity[2] = V * np.sin(beta), V * np.sin(alpha) * np.cos(beta)
    tilt, bank = signal[THETA], signal[PHI]
    step.acceleration[0] = force[0] - step.gravity * np.sin(tilt)
    step.acceleration[1] = force[1] + step.gravity * np.cos(tilt) * np.sin(bank)
    step.acceleration[2] = force[2] + step.gravity * np.cos(tilt) * np.cos(bank)
    step.size = np.sqrt(step.acceleration[0] ** 2 + step.acceleration[1] ** 2 + step.acceleration[2] ** 2)


@kernel
def predict(step):
    """Fill predicted (N_SENSORS,): what the look before says of attitude, flow and altitude now."""
    rates, h, out, moved = step.then[:3], step.h, step.predicted, step.scratch[:3]
    turn(step.turned, rates, h, step.now)
    a, b, c, d = step.now[0], step.now[1], step.now[2], step.now[3]
    out[PHI] = np.arctan2(2.0 * (a * b + c * d), 1.0 - 2.0 * (b * b + c * c))
    out[THETA] = np.arcsin(min(max(2.0 * (a * c - b * d), -1.0), 1.0))
    out[PSI] = np.arctan2(2.0 * (a * d + b * c), 1.0 - 2.0 * (c * c + d * d))
    tilt, bank, v = step.then[THETA], step.then[PHI], step.velocity
    up = v[0] * np.sin(tilt) - v[1] * np.sin(bank) * np.cos(tilt) - v[2] * np.cos(bank) * np.cos(tilt)
    out[ALTITUDE] = step.then[ALTITUDE] + h * up
    for i in range(3):
        moved[i] = v[i] + h * (1.5 * step.acceleration[i] - 0.5 * step.acceleration_then[i])
    turn_back(rates, h, moved, v)
    turn_back(rates, h, step.acceleration, step.acceleration_then)
    speed = np.sqrt(v[0] ** 2 + v[1] ** 2 + v[2] ** 2)
    out[AIRSPEED] = speed
    out[ALPHA], out[BETA] = np.arctan2(v[2], v[0]), np.arcsin(v[1] / max(speed, 1e-3))


@kernel
def compare(step, signal):
    """Fill the residual of each test with what the readings (N_SENSORS,) are beyond what was predicted."""
    test, predicted = step.test, step.predicted
    quaternion(signal[PHI], signal[THETA], signal[PSI], step.scratch)
    steep = abs(signal[THETA]) > STEEPEST_RAD
    for i in range(3):
        test[TURN + i].residual = 0.0 if steep else angle_between(step.now, step.scratch, i + 1)
        apart = wrapped(signal[PHI + i] - predicted[PHI + i])
        test[ANGLE + i].residual = 0.0 if steep else apart
    test[SPEED].residual = signal[AIRSPEED] - predicted[AIRSPEED]
    test[ALPHA_FLOW].residual = signal[ALPHA] - predicted[ALPHA]
    test[BETA_FLOW].residual = signal[BETA] - predicted[BETA]
    dense, dense_then = signal[QDYN] / signal[AIRSPEED] ** 2, step.then[QDYN] / step.then[AIRSPEED] ** 2
    test[DENSITY].residual = np.log(max(dense, 1e-9) / max(dense_then, 1e-9))
    test[CLIMB].residual = signal[ALTITUDE] - predicted[ALTITUDE]


@kernel
def misfelt(step):
    """How far off accelerometers can be, m/s2: what of it changes counts twice, by the two steps of Adams and
    Bashforth."""
    total = 0.0
    for i in range(3):
        total += (2.0 * step.error[AX + i] - step.steady[AX + i]) ** 2
    return np.sqrt(total)


@kernel
def allow(step, signal):
    """Fill what sound instruments with the declared errors may add to each residual: per second, at all."""
    test, e, n = step.test, step.error, step.changing
    V = max(signal[AIRSPEED], 1.0)
    turning = abs(step.then[P]) + abs(step.then[Q]) + abs(step.then[R])
    rates, tilt = e[P] + e[Q] + e[R], e[PHI] + e[THETA] + e[PSI]
    level = 1.0 / max(np.cos(signal[THETA]), 0.1)
    for i in range(3):
        test[TURN + i].rate = TURNING_RAD_S + step.drift + e[P + i] + 2.0 * turning * tilt
        test[ANGLE + i].rate = level * (TURNING_RAD_S + rates + 2.0 * level * turning * tilt) + step.drift
        test[ANGLE + i].noise = n[PHI + i]
    tilted, banked = abs(np.sin(signal[THETA])), abs(np.sin(signal[PHI]))
    test[TURN].noise = n[PHI] + (tilted + turning * step.h) * n[PSI]
    test[TURN + 1].noise = n[THETA] + (banked + turning * step.h) * n[PSI]
    test[TURN + 2].noise = n[PSI] + (banked + turning * step.h) * n[THETA]
    acceleration = FALLING_M_S2 + step.gravity * (e[PHI] + e[THETA]) + step.size * (e[ALPHA] + e[BETA])
    acceleration += misfelt(step)
    flow = (acceleration + step.size * e[AIRSPEED] / V) / V + rates + turning * (e[ALPHA] + e[BETA])
    test[SPEED].air, test[ALPHA_FLOW].air, test[BETA_FLOW].air = 1.0, 1.0 / V, 1.0 / V
    test[SPEED].rate, test[SPEED].noise = acceleration, n[AIRSPEED]
    test[ALPHA_FLOW].rate, test[ALPHA_FLOW].noise = flow, n[ALPHA]
    test[BETA_FLOW].rate, test[BETA_FLOW].noise = flow, n[BETA]
    test[DENSITY].rate = V / DENSITY_HEIGHT_M
    test[DENSITY].noise = n[QDYN] / max(signal[QDYN], 1.0) + 2.0 * n[AIRSPEED] / V
    test[CLIMB].rate = CLIMBING_M_S + step.gust + V * (tilt + e[ALPHA] + e[BETA]) + e[AIRSPEED]
    test[CLIMB].noise = n[ALTITUDE]


@kernel
def follow(step, test):
    """Pass one residual through its filters; note the largest share of a bound."""
    test.share = 0.0
    for m in range(step.decay.size):
        a = step.decay[m]
        test.filtered[m] = a * test.filtered[m] + test.residual
        test.bound_rate[m] = bound_step(test.bound_rate[m], test.rate, a, step.h)
        test.bound_noise[m] = noise_step(test.bound_noise[m], test.noise_then, a)
        noise = test.bound_noise[m] + test.noise
        test.bound[m] = test.bound_rate[m] + noise + test.air * step.gusts[m]
        test.share = max(test.share, abs(test.filtered[m]) / test.bound[m])
    test.noise_then = test.noise


@kernel
def follow_engine(step, signal):
    """The engine's instruments against what was commanded: no filter, an error is there or not."""
    step.test[RPM].residual = signal[ENGINE_SPEED] - step.command[0]
    step.test[RPM + 1].residual = signal[MANIFOLD] - step.command[1]
    for which in range(2):
        size = step.error[ENGINE_SPEED + which] + 1e-6
        step.test[RPM + which].share = abs(step.test[RPM + which].residual) / size


@kernel
def check(step, signal, engine):
    """Hold this instant's readings (N_SENSORS,) against the look before; engine: it has instruments."""
    note_declared(step, signal)
    predict(step)
    compare(step, signal)
    allow(step, signal)
    for c in range(RPM):
        follow(step, step.test[c])
    if engine:
        follow_engine(step, signal)
