"""Bounds on the residuals of the redundancy tests: the largest effect of sound sensors with declared errors.

The residual of one sample (redundancy.py) is at most h per_s + per_sample + past: per_s by errors of the
sample before, which act through the prediction; per_sample by those of this sample, through the reading that
is compared with it; past: per_sample of the sample before. The causes of the terms of first order are in
docs/explanation/instruments.md (Bounds of the sensor monitor). Letters as in redundancy.py, and:

    n                  (N_SENSORS,)  bound on the part of an error that changes from sample to sample
    w_max                            bound on |p| + |q| + |r|, rad/s
    e_w                              sum of the bounds on the errors of the three gyros, rad/s
"""

import numpy as np

from beaver_ftc.compiled import kernel
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


@kernel
def bound_readings(mon, y):
    """Fill the bounds on the errors of the readings y by the declaration:

        e = (e_zero + e_slope |y|) / (1 - e_slope) [+ e_drift]      n = e - const + READING_ROUNDING |y|

    The attitude drifts by e_drift, slowly, so the drift is no part of n. A heading counts as an angle within
    a half turn.
    """
    for i in range(N_SENSORS):
        e = largest_error(mon.e_zero[i], mon.e_slope[i], wrapped(y[i]) if i == PSI else y[i])
        mon.n[i] = e - mon.const[i] + READING_ROUNDING * abs(y[i])
        mon.e[i] = e + mon.e_drift if PHI <= i <= PSI else e


@kernel
def highest(mon, y, i):
    """Largest |y_i| that the truth may have in this sample or the one before: |y| + e."""
    return max(abs(y[i]) + mon.e[i], abs(mon.y_past[i]) + mon.e_past[i])


@kernel
def lowest(mon, y, i):
    """Smallest y_i that the truth may have in this sample or the one before: y - e."""
    return min(y[i] - mon.e[i], mon.y_past[i] - mon.e_past[i])


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
def set_bound(mon, j, per_s, per_sample):
    """Set the bound on the residual of test j, from the sample before, and by the reading of this sample."""
    mon.per_s[j] = per_s
    mon.per_sample[j] = per_sample


@kernel
def bound_residuals(mon, y):
    """Fill per_s, per_sample and gust of each test of the equations before those of the engine."""
    e_w = w_max = 0.0
    for i in range(3):
        e_w += mon.e_past[i]
        w_max += abs(mon.y_past[i]) + mon.e_past[i]
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

    The rates are J(phi, theta) (phi', theta', psi'). e, n, const: bounds of the readings; tilt: change of phi
    and theta in the sample, rad; momentary: bounds on the changing errors of theta and psi, in the sample
    before and now, rad; coupled_i: turn about axis i by a momentary error of psi or theta, rad.
    """
    h = mon.h
    e = mon.e_past
    n = mon.n
    past = mon.y_past
    const = mon.const
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
        per_s = EARTH_TURN_RAD_S + 2.0 * mon.drift + e[i] + axes
        set_bound(mon, i, per_s, n[PHI + i] + coupled[i])
        set_bound(mon, ANGLE_TEST + i, sec * angles + mon.drift, n[PHI + i])


@kernel
def bound_acceleration(mon, w_max, e_w):
    """e_a: bound on the error of the acceleration of the elapsed step, m/s2:

        EARTH + e_first + h/2 e_w |a_past| + g sum (e_i + h w_max const_i)        i: phi, theta
              + sum h w_max const_i + sqrt(sum e_i^2)                             i: accelerometers

        e_i = 3/2 e_past_i + 1/2 e_older_i - const_i

    e_i is the largest error that sensor i adds to 3/2 y - 1/2 y_before: its constant part counts once. The
    attitude gives gravity its direction. The previous acceleration is turned into the present axes, by rates
    with the error e_w, and with it the constant errors.
    """
    e_a = EARTH_M_S2 + mon.e_first + mon.h * AB_PAST * e_w * mon.a_size_past
    force2 = 0.0
    for i in (PHI, THETA, AX, AX + 1, AX + 2):
        e = AB_NOW * mon.e_past[i] + AB_PAST * mon.e_older[i] - mon.const[i]
        e_turn = mon.h * w_max * mon.const[i]
        if i < AX:
            e_a += mon.g * (e + e_turn)
        else:
            e_a += e_turn
            force2 += e**2
    return e_a + np.sqrt(force2)


@kernel
def bound_flow(mon, y, w_max, e_w):
    """Fill the bounds of the tests of flow and climb. per_sample is n of the test's reading. per_s is the
    largest derivative of the kinematics with respect to each reading, times the bound e of the reading:

        speed         e_a + growth a vane + h (a / V)^2 e_V
        each angle    growth (sec^2 ((e_a + a (vane + e_V / V)) / V + w_max vane) + sec e_w)
        climb         gusts and wind + (V + e_V) (e_phi + e_theta + vane) + e_V + lag

    a m/s2: bound on the acceleration; V m/s: smallest airspeed (in climb its reading); vane = e_alpha +
    e_beta; sec: largest 1 / cos(beta); growth: 1 + the second order in h; lag m/s: difference of the
    integration of the altitude from h v, over h.

    A gust of 1 m/s changes the speed by `gust`, and each angle by gust sec / V: gust is the factor by which
    gusts change faster than `gust_change` at this airspeed and height.
    """
    h = mon.h
    e = mon.e_past
    n = mon.n
    a_size = mon.a_size
    V = max(lowest(mon, y, I_AIRSPEED), MIN_AIRSPEED_MPS)
    sec = secant(highest(mon, y, I_BETA))
    vane = e[I_ALPHA] + e[I_BETA]
    e_V = e[I_AIRSPEED]
    e_a = bound_acceleration(mon, w_max, e_w)
    a = a_size[0] + e_a
    growth = 1.0 + h * (2.0 * a_size[0] / V + w_max)
    height = max(lowest(mon, y, ALTITUDE), LEAST_HEIGHT_M)
    gust = np.sqrt(max(y[I_AIRSPEED] / mon.max_airspeed_mps, 1.0) * max(mon.low_m / height, 1.0))
    angle = growth * (sec**2 * ((e_a + a * (vane + e_V / V)) / V + w_max * vane) + sec * e_w)
    set_bound(mon, SPEED_TEST, e_a + growth * a * vane + h * (a / V) ** 2 * e_V, n[I_AIRSPEED])
    set_bound(mon, ALPHA_TEST, angle, n[I_ALPHA])
    set_bound(mon, BETA_TEST, angle, n[I_BETA])
    mon.gust[SPEED_TEST] = gust
    mon.gust[ALPHA_TEST] = mon.gust[BETA_TEST] = gust * sec / V
    path = (mon.y_past[I_AIRSPEED] + e_V) * (e[PHI] + e[THETA] + vane)
    lag = POSITION_FACTOR * h * max(a, a_size[1], a_size[2])
    set_bound(mon, CLIMB_TEST, mon.wind_max + mon.gust_max + path + e_V + lag, n[ALTITUDE])


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
    past = mon.y_past
    climb = past[I_AIRSPEED] + mon.e_past[I_AIRSPEED] + mon.wind_max + mon.gust_max
    per_s = climb / DENSITY_SCALE_HEIGHT_M
    per_sample = 0.0
    for i, power, floor in ((I_QDYN, 1.0, MIN_QDYN_PA), (I_AIRSPEED, 2.0, MIN_AIRSPEED_MPS)):
        e = mon.const[i]
        y1 = max(y[i], floor)
        y0 = max(past[i], floor)
        e_log = e * abs(1.0 / y1 - 1.0 / y0) / max(1.0 - e / min(y1, y0), MIN_SHARE_LEFT)
        per_s += power * e_log / mon.h
        per_sample += power * mon.n[i] / max(y[i] - mon.e[i], floor)
    set_bound(mon, DENSITY_TEST, per_s, per_sample)
