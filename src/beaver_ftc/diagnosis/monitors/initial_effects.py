"""The effect on the redundancy tests of an error that a sensor has had since the monitor began.

There is one hypothesis for each reading from which others are predicted: that this sensor alone is broken,
with the error x (initial_errors.py). For each hypothesis b and test j the kernels fill, for the sample before
the present one,

    H    bound on |effect on residual j in one sample| / |x|, in the unit of the residual
    C    lower bound, with sign, on the effect of a unit of x in one sample on the tests of one row of
         `initial_errors.EVIDENCE` together; complex if the effect has two parts at right angles

What each effect follows from (v m/s: velocity, V its length; a m/s2: acceleration, gravity g included; both
in body axes; p, q, r rad/s; tests without their _TEST):

    attitude     with phi off, (q, r) is turned about the body's first axis; with theta off, the vertical
                 unit vector, about which the aircraft turns at psi'
    gravity      with phi off, its part g cos(theta) across the body's first axis is turned; with theta off,
                 all of it; both in a, and so in SPEED, ALPHA and BETA
    SPEED        V' = a . v / V
    ALPHA        alpha' = q - tan(beta) (p cos(alpha) + r sin(alpha))
                          + (a_z cos(alpha) - a_x sin(alpha)) / (V cos(beta))
    BETA         beta' = p sin(alpha) - r cos(alpha)
                         + (a_y cos(beta) - (a_x cos(alpha) + a_z sin(alpha)) sin(beta)) / V
    DENSITY      log(density) = log(2 qdyn) - 2 log V: log V changes by (1 + x) times what its reading shows,
                 if the error of the airspeed is a constant in m/s
    CLIMB        altitude' = V (cos(beta) (cos(alpha) sin(theta) - sin(alpha) cos(phi) cos(theta))
                                - sin(beta) sin(phi) cos(theta))

Gyros need no such hypothesis: all of a gyro's error is in the test of its own axis in every sample. Neither
does the dynamic pressure: only the density shows it.

Letters of the kernels:

    mon      record of the monitor (records.py)
    y        readings in the sample before, SI; y_now: in this one
    E        bound on |x|, of each hypothesis
    w_sum    |p| + |q| + |r|, rad/s
    A        bound on |a| in the step, times h2, m/s          A_V = A / V, rad
    G        gravity times h2, m/s
    h        time between two samples, s                      h2: the same and what is of second order in it
    rate     `in_plane` of (p, q, r), rad/s: the part of the rate along the flow, + i that against the axis
             across it
    sec      1 / cos(beta) by its reading
"""

import numpy as np

from beaver_ftc.compiled import kernel
from beaver_ftc.diagnosis.monitors.numbering import (
    ALPHA_TEST,
    ANGLE_TEST,
    BETA_TEST,
    CLIMB_TEST,
    DENSITY_TEST,
    I_ALPHA,
    I_BETA,
    SPEED_TEST,
    THETA,
    P,
    Q,
    R,
)
from beaver_ftc.diagnosis.monitors.residual_bounds import secant, speed
from beaver_ftc.diagnosis.monitors.rotation import down, length, unit, vector
from beaver_ftc.plant.instruments import ALTITUDE, PHI

MAX_SPEED_RATIO = 10.0  # largest reading / truth of an airspeed, and largest truth / reading

# The hypotheses: this sensor has been broken since the monitor began.
H_AIRSPEED, H_ALPHA, H_BETA, H_PHI, H_THETA = range(5)
N_INITIAL = 5
# Rows of C. Each of the first ten is named by an error and the tests in which the error shows. The last two
# are the parts of the force in ALPHA_IN_BETA and BETA_IN_ALPHA, which can have either sign.
PHI_IN_TURN, PHI_IN_FLOW, THETA_IN_TURN, THETA_IN_FLOW, ALPHA_IN_BETA, BETA_IN_ALPHA = range(6)
ALPHA_IN_CLIMB, V_IN_ALPHA, V_IN_BETA, V_IN_DENSITY, FORCE_ON_ALPHA, FORCE_ON_BETA = range(6, 12)
N_EFFECTS = 12


@kernel
def angle_of_chord(x):
    """The angle, rad, with 2 sin(angle / 2) = x; pi for x > 2."""
    return 2.0 * np.arcsin(min(0.5 * x, 1.0))


@kernel
def fill_effects(mon, y_now):
    """Fill H (N_INITIAL, RPM_TEST) and C (N_EFFECTS,) at y, the sample before, from which y_now is predicted.

    Here those of DENSITY: the true log V changes by (1 + x) times what the reading shows. The density
    contains -2 log V, so its residual has the error 2 x log(V_now / V).
    """
    y = mon.sample.y_past
    C = mon.initial.C
    w_sum = abs(y[P]) + abs(y[Q]) + abs(y[R])
    C[V_IN_DENSITY] = 2.0 * np.log(speed(y_now) / speed(y))
    mon.initial.H[H_AIRSPEED, DENSITY_TEST] = abs(C[V_IN_DENSITY])
    fill_attitude_effects(mon, y, w_sum)
    fill_flow_effects(mon, y, w_sum)
    fill_climb_effects(mon, y)


@kernel
def fill_attitude_effects(mon, y, w_sum):
    """Fill H and C of the tests of turning (TURN_TEST and the two after it) and of the angles (ANGLE_TEST
    and the two after it: phi, theta, psi).

    turn: q + i r about the level axes, as phi turns them, rad/s, so theta' = turn.real and
    psi' = turn.imag / cos(theta). second = (h w_sum)^2, rad2: the axes turn during the step.

                     phi off by x                             theta off by x
        turning      (q, r) is turned about the first axis,   the vertical, about which the aircraft turns at
                     which changes it by x |(q, r)|           psi', is turned, which changes it by x psi'
        angles       no Euler angle changes by more than      phi' = p + turn.imag tan(theta) and
                     the body turns, over cos(theta)          psi' = turn.imag / cos(theta): tangents, and
                                                              secants, of reading and truth differ by at most
                                                              x over both cosines; theta' has no theta
    """
    h = mon.config.h
    H = mon.initial.H
    C = mon.initial.C
    rates = vector(y)[1]
    turn = rates * unit(y[PHI])
    second = (h * w_sum) ** 2
    # 1 / cos(theta) by its reading, and the largest one if theta is off
    sec = secant(y[THETA])
    sec_max = secant(abs(y[THETA]) + angle_of_chord(mon.initial.E[H_THETA]))
    # Rotation in a step, rad: about the body's second and third axes; about the vertical, psi' h
    qr = h * abs(turn)
    heading = h * abs(turn.imag) * sec_max
    by_phi = sec * (qr + sec * second)
    by_theta = sec * sec_max * second
    H[H_PHI, :SPEED_TEST] = second, second + qr, second + qr, by_phi, by_phi, by_phi
    H[H_THETA, :ANGLE_TEST] = second + heading
    H[H_THETA, ANGLE_TEST:SPEED_TEST] = sec * heading + by_theta, by_theta, sec * heading + by_theta
    C[PHI_IN_TURN] = h * rates
    C[THETA_IN_TURN] = h * turn.imag


@kernel
def in_plane(y, v):
    """The part of a vector v in the plane of symmetry, turned by alpha: along the flow, and (imaginary)
    against the axis across it."""
    return unit(y[I_ALPHA]) * complex(v[0].imag, -v[1].imag)


@kernel
def share_across(y):
    """cos(theta) |(sin(beta), sin(alpha) cos(beta))|: the largest part along the flow of the vertical's part
    across the body's first axis, if phi is off."""
    return np.cos(y[THETA]) * np.hypot(np.sin(y[I_BETA]), np.sin(y[I_ALPHA]) * np.cos(y[I_BETA]))


@kernel
def fill_flow_effects(mon, y, w_sum):
    """Fill H and C of the tests of flow: SPEED, m/s; ALPHA and BETA, rad.

        h2 = h (1 + h (a_max / V + w_sum))      a_max: bound on |a| in the step
        A = h2 a_max        A_V = A / V         G = h2 g

                 SPEED            ALPHA                                   BETA
        V        0                sec A_V                                 sec A_V
        alpha    A                sec (A_V + h2 |rate| |sin(beta)|)       h2 |rate| + A_V |sin(beta)|
        beta     A                sec sec_max (h2 |rate.real| + A_V)      A_V
        phi      G share_across   sec G cos(theta) / V                    sec G cos(theta) / V
        theta    G                sec G / V                               G (|sin(phi)| + |sin(beta)|) / V

    sec_max: 1 / cos(beta_max), beta_max the largest |beta| if beta is off. In the code: acc: `in_plane` of a;
    side: exp(i beta), and sb its |sin|; secs: sec sec_max. Of SPEED:

    alpha    in V' = a . v / V the direction of v is turned, and changes by x at most; beta likewise
    phi      a has the error x g cos(theta) across the body's first axis; V' takes its part along v
    theta    a has the error x g, in the plane of the body's first axis and the vertical: V' takes at most all
             of it. Along the first axis it is g (sin(reading) - sin(truth)) = x g cos(mean of both), which C
             has. That mean is at most half the error away from the reading, and at most (reading + a right
             angle) / 2

    Of ALPHA and BETA:

    V        alpha' and beta' have the part a / V, and a / truth = (1 + x) a / reading
    alpha    alpha' contains (a_z, a_x) / (V cos(beta)) and tan(beta) (p, r), both turned by alpha. beta'
             contains (p, r) and sin(beta) (a_x, a_z) / V, both turned by alpha. The rate changes beta' by
             x (rate.real cos(error / 2) + rate.imag sin(error / 2)); the force has either sign
    beta     alpha' contains tan(beta) and 1 / cos(beta). Those of reading and truth differ by at most x over
             both cosines: the rate changes alpha' by x cos(error / 2) rate.real over both cosines, and the
             force has either sign. beta' contains a turned by beta
    phi      a has the error x g cos(theta), and each of alpha' and beta' at most all of it, over V
    theta    a has the error x g. alpha' has at most all of it, over V; beta' has the part sin(phi) along the
             second axis, and sin(beta) of the rest
    """
    h = mon.config.h
    H = mon.initial.H
    C = mon.initial.C
    a = mon.sample.a
    V = speed(y)
    a_max = max(mon.sample.a_size[0], length(a))
    h2 = h * (1.0 + h * (a_max / V + w_sum))
    A = h2 * a_max
    G = h2 * mon.config.g
    H[:, SPEED_TEST] = 0.0, A, A, G * share_across(y), G
    pitch = abs(y[THETA])
    mean = min(pitch + 0.5 * angle_of_chord(mon.initial.E[H_THETA]), 0.5 * pitch + 0.25 * np.pi)
    C[PHI_IN_FLOW] = h * mon.config.g * down(y)[1]
    C[THETA_IN_FLOW] = h * mon.config.g * np.cos(mean)
    A_V = A / V
    rate = in_plane(y, vector(y))
    acc = in_plane(y, a)
    side = unit(y[I_BETA])
    sb = abs(side.imag)
    sec = secant(y[I_BETA])
    beta_max = abs(y[I_BETA]) + angle_of_chord(mon.initial.E[H_BETA])
    secs = sec * secant(beta_max)
    turned = h2 * abs(rate)
    by_phi = sec * G * np.cos(y[THETA]) / V
    by_beta = secs * (h2 * abs(rate.real) + A_V)
    H[:, ALPHA_TEST] = sec * A_V, sec * (A_V + turned * sb), by_beta, by_phi, sec * G / V
    H[:, BETA_TEST] = sec * A_V, turned + A_V * sb, A_V, by_phi, G * (abs(np.sin(y[PHI])) + sb) / V
    C[ALPHA_IN_BETA] = h * rate
    C[BETA_IN_ALPHA] = h * rate.real
    C[V_IN_ALPHA] = -h * acc.imag * sec / V
    C[V_IN_BETA] = h * (a[1].real * side.real - acc.real * side.imag) / V
    C[FORCE_ON_ALPHA] = h * sb * a_max / V
    C[FORCE_ON_BETA] = h * (np.sin(min(beta_max, 0.5 * np.pi)) * abs(acc.imag)) * secs / V


@kernel
def fill_climb_effects(mon, y):
    """Fill H and C of CLIMB, m:

        hypothesis    V        alpha    beta                            phi                  theta
        H             climb    lift     h V |(vertical.real, down_y)|   h V share_across     h V

    down: the vertical unit vector downwards; vertical: `in_plane` of it; lift = h V cos(beta) |vertical|.

    V        climb is the true change of the altitude, which is the predicted one over 1 + x: they differ by
             x times the true one
    alpha    altitude' contains V cos(beta) (cos(alpha), sin(alpha)), which is turned, along
             (sin(theta), -cos(phi) cos(theta)): altitude' = V cos(beta) |vertical| sin(gamma - alpha) + ...,
             where tan(gamma) = tan(theta) / cos(phi). The sines of reading and truth differ by
             x cos(mean of gamma - alpha)
    beta     altitude' contains V (cos(beta), -sin(beta)), which is turned
    phi      altitude' contains the vertical's part cos(theta), which is turned; the flow is along it by
             `share_across`
    theta    altitude' contains the vertical, which is turned against v
    """
    initial = mon.initial
    to_ground = down(y)
    vertical = in_plane(y, to_ground)
    step = mon.config.h * speed(y)
    slower = 1.0 - min(initial.E[H_AIRSPEED], 1.0 - 1.0 / MAX_SPEED_RATIO)
    climb = abs(mon.sample.y_pred[ALTITUDE] - y[ALTITUDE]) / slower
    lift = step * np.cos(y[I_BETA]) * abs(vertical)
    by_beta = step * np.hypot(vertical.real, to_ground[1].real)
    initial.H[:, CLIMB_TEST] = climb, lift, by_beta, step * share_across(y), step
    mean = abs(np.angle(complex(-vertical.imag, vertical.real))) + 0.5 * angle_of_chord(initial.E[H_ALPHA])
    initial.C[ALPHA_IN_CLIMB] = lift * np.cos(min(mean, 0.5 * np.pi))
