"""Bounds on the residuals of the redundancy tests: the largest effect of sound sensors with declared errors.

The residual of one sample (redundancy.py) is at most h per_s + per_sample + past: per_s by errors of the
sample before, which act through the prediction; per_sample by those of this sample, through the reading that
is compared with it; past: per_sample of the sample before. The causes of the terms of first order are in
docs/explanation/instruments.md (Bounds of the sensor monitor).

    y, y_past          (N_SENSORS,)  readings now, and in the sample before, SI
    e, e_past          (N_SENSORS,)  bounds on their errors
    n, const           (N_SENSORS,)  bounds on the part of an error that changes from sample to sample, and on
                                     the part that does not
    w_max                            bound on the sum of the sizes of the three body rates, rad/s
    e_w                              sum of the bounds on the errors of the three gyros, rad/s
    h                                time between two samples, s
    i, j                             sensor or axis, test
    mon                              record of the monitor (records.py)
"""

import numpy as np

from beaver_ftc.compiled import kernel, record
from beaver_ftc.design.turbulence import LEAST_HEIGHT_M
from beaver_ftc.diagnosis.bounds import largest_error
from beaver_ftc.diagnosis.monitors.numbering import (
    ALPHA_TEST,
    ANGLE_TEST,
    BETA_TEST,
    CLIMB_TEST,
    DENSITY_TEST,
    I_AIRSPEED,
    I_ALPHA,
    I_BETA,
    I_QDYN,
    PSI,
    SPEED_TEST,
    THETA,
)
from beaver_ftc.plant.instruments import ALTITUDE, AX, N_SENSORS, PHI, wrapped

# Turn of the attitude that the integration leaves out: the gyros measure the rates against the rotating
# Earth, and the level turns while the aircraft flies over the round Earth.
EARTH_TURN_RAD_S = 4e-5
# Acceleration that it leaves out: of Coriolis, the centrifugal one, and the change of gravity with place.
EARTH_M_S2 = 0.03
DENSITY_SCALE_HEIGHT_M = 6300.0  # smallest height over which the density falls by e: in the stratosphere
MAX_PITCH_RAD = 1.3  # beyond it, roll and heading cannot be distinguished: the attitude tests restart
MIN_AIRSPEED_MPS = 1.0  # lower limit of an airspeed that divides, or of which the logarithm is taken
MIN_QDYN_PA = 1.0  # lower limit of a dynamic pressure of which the logarithm is taken
MIN_SHARE_LEFT = 0.01  # lower limit of 1 - e / y in a bound on log(y): e is the constant error of y
READING_ROUNDING = 1e-10  # part of each bound that covers rounding, as a share of the reading
# JSBSim integrates the velocity by Adams and Bashforth's second order, v + h (3/2 a - 1/2 a_before).
AB_NOW, AB_PAST = 1.5, 0.5
# It integrates the position by their third order, h (23 v - 16 v_before + 5 v_earlier) / 12. That differs
# from h v, which predicts the altitude, by at most h^2 (11 + 5) / 12 of the largest acceleration.
POSITION_FACTOR = 4.0 / 3.0

# Errors of the readings, SI.
#     e_zero, e_slope    declared: |error| <= e_zero + e_slope |y|; const: the part that does not change
#     e, n               bounds on them (see the top); e_past, e_older: e of the two samples before
#     drift, e_drift     drift of the attitude, rad/s, and the part of e by it so far, rad
ERRORS_RECORD = record(
    e_zero=N_SENSORS, e_slope=N_SENSORS, const=N_SENSORS, drift=float,
    e=N_SENSORS, n=N_SENSORS, e_drift=float, e_past=N_SENSORS, e_older=N_SENSORS,
)  # fmt: skip


@kernel
def bound_readings(errors, y):
    """Fill the bounds on the errors of the readings y by the declaration:

        e = (e_zero + e_slope |y|) / (1 - e_slope) [+ e_drift]      n = e - const + READING_ROUNDING |y|

    The attitude drifts by e_drift, slowly, so the drift is no part of n. A heading counts as an angle within
    a half turn.
    """
    for i in range(N_SENSORS):
        e = largest_error(errors.e_zero[i], errors.e_slope[i], wrapped(y[i]) if i == PSI else y[i])
        errors.n[i] = e - errors.const[i] + READING_ROUNDING * abs(y[i])
        errors.e[i] = e + errors.e_drift if PHI <= i <= PSI else e


@kernel
def highest(mon, y, i):
    """Largest |y_i| that the truth may have in this sample or the one before: |y| + e."""
    return max(abs(y[i]) + mon.errors.e[i], abs(mon.sample.y_past[i]) + mon.errors.e_past[i])


@kernel
def lowest(mon, y, i):
    """Smallest y_i that the truth may have in this sample or the one before: y - e."""
    return min(y[i] - mon.errors.e[i], mon.sample.y_past[i] - mon.errors.e_past[i])


@kernel
def secant(angle):
    """1 / cos(angle) of an angle, rad, that is limited to MAX_PITCH_RAD."""
    return 1.0 / np.cos(min(abs(angle), MAX_PITCH_RAD))


@kernel
def speed(y):
    """The airspeed V of the readings, m/s, at least MIN_AIRSPEED_MPS because others are divided by it."""
    return max(y[I_AIRSPEED], MIN_AIRSPEED_MPS)


@kernel
def too_steep(mon, y):
    """Whether the pitch may exceed MAX_PITCH_RAD in this sample or the one before: then the tests of turning
    and of the angles restart."""
    return highest(mon, y, THETA) > MAX_PITCH_RAD


@kernel
def set_bound(tests, j, per_s, per_sample):
    """Set the bound on the residual of test j, from the sample before, and by the reading of this sample."""
    tests.per_s[j] = per_s
    tests.per_sample[j] = per_sample


@kernel
def bound_residuals(mon, y):
    """Fill per_s, per_sample and gust of each test of the equations before those of the engine."""
    e_w = w_max = 0.0
    for i in range(3):
        e_w += mon.errors.e_past[i]
        w_max += abs(mon.sample.y_past[i]) + mon.errors.e_past[i]
    bound_attitude(mon, y, w_max, e_w)
    bound_flow(mon, y, w_max, e_w)
    bound_density(mon, y)


@kernel
def bound_attitude(mon, y, w_max, e_w):
    """Fill the bounds of the tests of turning and of the angles; sec: largest 1 / cos(theta).

        turning, axis i   per_s = EARTH_TURN + 2 drift + e_i + axes      per_sample = n_i + coupled_i
        axes =   w_max (e_phi + (1 + sec) e_theta + e_psi)        constant error: it changes J
               + tilt momentary / h                               it turns an axis, and back with another J
               + h w_max e_w                                      gyros, to second order in h
        angles            per_s = sec angles + drift               per_sample = n_i
        angles = EARTH_TURN + (1 + sec h w_max) e_w               gyros, to second order in h
               + 2 sec w_max (e_phi + e_theta)                    constant error in the inverse of J

    The rates are J(phi, theta) (phi', theta', psi'). e: e_past; tilt: change of phi and theta in the sample,
    rad; momentary: bounds on the changing errors of theta and psi, in the sample
    before and now, rad; coupled_i: turn about axis i by a momentary error of psi or theta, rad.
    """
    h = mon.config.h
    errors = mon.errors
    e = errors.e_past
    n = errors.n
    const = errors.const
    past = mon.sample.y_past
    sec = secant(highest(mon, y, THETA))
    turn = h * w_max
    tilt = abs(y[PHI] - past[PHI]) + abs(y[THETA] - past[THETA])
    momentary = e[THETA] - const[THETA] + e[PSI] - const[PSI] + n[THETA] + n[PSI]
    axes = w_max * (e[PHI] + (1.0 + sec) * e[THETA] + e[PSI]) + tilt * momentary / h + turn * e_w
    angles = EARTH_TURN_RAD_S + (1.0 + sec * turn) * e_w + 2.0 * sec * w_max * (e[PHI] + e[THETA])
    s_theta = abs(np.sin(y[THETA])) + n[THETA]
    s_phi = abs(np.sin(y[PHI])) + n[PHI]
    coupled = s_theta * n[PSI], s_phi * n[PSI], s_phi * n[THETA]
    for i in range(3):
        per_s = EARTH_TURN_RAD_S + 2.0 * errors.drift + e[i] + axes
        set_bound(mon.tests, i, per_s, n[PHI + i] + coupled[i])
        set_bound(mon.tests, ANGLE_TEST + i, sec * angles + errors.drift, n[PHI + i])


@kernel
def bound_acceleration(mon, w_max, e_w):
    """e_a: bound on the error of the acceleration of the elapsed step, m/s2:

        EARTH_M_S2 + e_first + h/2 e_w |a_past| + g sum (e_i + h w_max const_i)        i: phi, theta
              + sum h w_max const_i + sqrt(sum e_i^2)                             i: accelerometers

        e_i = 3/2 e_past_i + 1/2 e_older_i - const_i

    e_i is the largest error that sensor i adds to 3/2 y - 1/2 y_before: its constant part counts once. The
    attitude gives gravity its direction. The previous acceleration is turned into the present axes, by rates
    with the error e_w, and with it the constant errors.
    """
    h = mon.config.h
    errors = mon.errors
    e_a = EARTH_M_S2 + mon.sample.e_first + h * AB_PAST * e_w * mon.sample.a_size_past
    force2 = 0.0
    for i in (PHI, THETA, AX, AX + 1, AX + 2):
        e = AB_NOW * errors.e_past[i] + AB_PAST * errors.e_older[i] - errors.const[i]
        e_turn = h * w_max * errors.const[i]
        if i < AX:
            e_a += mon.config.g * (e + e_turn)
        else:
            e_a += e_turn
            force2 += e**2
    return e_a + np.sqrt(force2)


@kernel
def bound_flow(mon, y, w_max, e_w):
    """Fill the bounds of the tests of flow and climb. per_sample is n of the test's reading. per_s is the
    largest derivative of the kinematics with respect to each reading, times the bound e of the reading:

        speed         e_a + growth a_max vane + h (a_max / V)^2 e_V
        each angle    growth (sec^2 ((e_a + a_max (vane + e_V / V)) / V + w_max vane) + sec e_w)
        climb         gusts and wind + (V + e_V) (e_phi + e_theta + vane) + e_V + lag

    e: e_past; a_max, e_a m/s2: bounds on the acceleration and on its error; V m/s: smallest airspeed (in
    climb its reading); vane = e_alpha + e_beta; sec: largest 1 / cos(beta); growth: 1 + the second order in
    h; lag m/s: difference of the integration of the altitude from h V, over h.

    A gust of 1 m/s changes the speed by `gust`, and each angle by gust sec / V: gust is the factor by which
    gusts change faster than `gust_change` at this airspeed and height.
    """
    h = mon.config.h
    e = mon.errors.e_past
    n = mon.errors.n
    a_size = mon.sample.a_size
    air = mon.air
    tests = mon.tests
    V = max(lowest(mon, y, I_AIRSPEED), MIN_AIRSPEED_MPS)
    sec = secant(highest(mon, y, I_BETA))
    vane = e[I_ALPHA] + e[I_BETA]
    e_V = e[I_AIRSPEED]
    e_a = bound_acceleration(mon, w_max, e_w)
    a_max = a_size[0] + e_a
    growth = 1.0 + h * (2.0 * a_size[0] / V + w_max)
    height = max(lowest(mon, y, ALTITUDE), LEAST_HEIGHT_M)
    gust = np.sqrt(max(y[I_AIRSPEED] / air.max_airspeed_mps, 1.0) * max(air.low_m / height, 1.0))
    angle = growth * (sec**2 * ((e_a + a_max * (vane + e_V / V)) / V + w_max * vane) + sec * e_w)
    set_bound(tests, SPEED_TEST, e_a + growth * a_max * vane + h * (a_max / V) ** 2 * e_V, n[I_AIRSPEED])
    set_bound(tests, ALPHA_TEST, angle, n[I_ALPHA])
    set_bound(tests, BETA_TEST, angle, n[I_BETA])
    tests.gust[SPEED_TEST] = gust
    tests.gust[ALPHA_TEST] = tests.gust[BETA_TEST] = gust * sec / V
    path = (mon.sample.y_past[I_AIRSPEED] + e_V) * (e[PHI] + e[THETA] + vane)
    lag = POSITION_FACTOR * h * max(a_max, a_size[1], a_size[2])
    set_bound(tests, CLIMB_TEST, air.wind_max + air.gust_max + path + e_V + lag, n[ALTITUDE])


@kernel
def bound_density(mon, y):
    """Fill the bound of the logarithm of the density, log(qdyn) - 2 log(V):

        per_s         climb / DENSITY_SCALE_HEIGHT_M + sum power e_log / h
        e_log         const |1 / y - 1 / y_past| / (1 - const / y_min)
        per_sample    sum power n / (y - e)

    The sums are over the dynamic pressure (power 1) and the airspeed (power 2): const is the constant error
    of the reading y, n its changing error, y_min the smaller of y and y_past. climb m/s: largest vertical
    speed.
    """
    errors = mon.errors
    past = mon.sample.y_past
    climb = past[I_AIRSPEED] + errors.e_past[I_AIRSPEED] + mon.air.wind_max + mon.air.gust_max
    per_s = climb / DENSITY_SCALE_HEIGHT_M
    per_sample = 0.0
    for i, power, floor in ((I_QDYN, 1.0, MIN_QDYN_PA), (I_AIRSPEED, 2.0, MIN_AIRSPEED_MPS)):
        const = errors.const[i]
        y1 = max(y[i], floor)
        y0 = max(past[i], floor)
        e_log = const * abs(1.0 / y1 - 1.0 / y0) / max(1.0 - const / min(y1, y0), MIN_SHARE_LEFT)
        per_s += power * e_log / mon.config.h
        per_sample += power * errors.n[i] / max(y[i] - errors.e[i], floor)
    set_bound(mon.tests, DENSITY_TEST, per_s, per_sample)
