"""Gyro or attitude? The dynamics of the rates say whose error the tests of turning and of the angles show.

An error of a gyro and an error of the attitude move the same tests. The dynamics of the rates separate them:
a jump of a gyro is an acceleration that no model explains, while a jump of the attitude is no acceleration.
With D_x (3, 3) 1/s the damping of the rates, and nu (3,) rad/s2 the innovation, the filter

    W' = nu - D_x W        `advance_gyro_estimate`

follows an error of a gyro, as exactly as D_x is known (DAMPING_TOLERANCE). If the attitude has the error, W
stays within its bound. `judge_gyros` compares W and the innovation with the error of the gyro that the
attitude shows.

    W, W_max     (3,) rad/s: the error of the gyros by the dynamics, and the bound on it without such an error
    shown        -residual / h of a test of turning: the error of its gyro if the attitude is right, rad/s
    h, dt        duration of a sample and of a frame, s
    c            turn about a body axis per change of an angle, rad/rad (`turn_share`)
    residual, B  residual of a test (redundancy.py), rad, and the bound on it through each filter
    decay        factor per sample of each filter
    mon          record of the monitor (records.py)
"""

import numpy as np

from beaver_ftc.compiled import kernel, record
from beaver_ftc.diagnosis.detection import attitude
from beaver_ftc.diagnosis.detection.filters import bank_axis, leak
from beaver_ftc.diagnosis.monitors.initial_errors import exceeds
from beaver_ftc.diagnosis.monitors.numbering import ANGLE_TEST, N_POLES
from beaver_ftc.diagnosis.monitors.rotation import components, down, vector
from beaver_ftc.plant.instruments import PHI

GYRO_OPEN, GYRO_CONFIRMED, GYRO_REFUTED = 0, 1, 2  # verdicts of a gyro
MAX_DYNAMICS_PER_S = 10.0  # largest innovation, rad/s2, by 1 rad/s of a gyro's error itself
JUMP_TOLERANCE = 0.1  # share of a gyro's jump by which the innovation may differ from it
MIN_ESTIMATED_SHARE = 0.7  # W shows at least this share of a gyro's error
SAMPLES_IN_JUMP = 4.0  # a jump is the difference of two residuals, each with the noise of two samples
MIN_TRANSIENT = 2.0  # least size of a transient over the bound on noise: noise may be all of a smaller one
TRANSIENT_LEFT = 0.003  # largest share of a transient that is left in the next frame
RATE_ROUNDING = 1e-6  # rad/s, and rad/s2: the part of the bounds that covers rounding
# stage: 0 before the first sample, 1 after it and while the pitch is too steep, 2 with the first whole frame,
# 3 from the next frame on: only then the innovation contains the change of a gyro's error between two frames
FULL_STAGE = 3

# The error of one gyro. Its sizes are kept by frame, because the innovation covers a frame, and a frame may
# have several samples:
#     shown, shown_past              error that the first sample of this frame shows, and of the frame
#                                    before, rad/s
#     most, most_past, most_older    largest |error| in the other samples of this frame and of the two before
#     least, least_past              smallest |error| in the other samples of this frame and of the one before
#     gap, B_gap (poles,)            filtered difference of the turns that attitude and W show, and its bound,
#                                    rad; beyond the bound no gyro can be broken
#     verdict                        GYRO_OPEN, GYRO_CONFIRMED or GYRO_REFUTED
#     replaced                       whether the reading of the gyro is replaced
GYRO_RECORD = record(
    shown=float, shown_past=float, most=float, most_past=float, most_older=float,
    least=float, least_past=float, gap=N_POLES, B_gap=N_POLES, verdict=int, replaced=int,
)  # fmt: skip

# The comparison as a whole; gyros_excluded: whether no gyro can be broken.
DYNAMICS_RECORD = record(stage=int, W=3, W_max=3, gyros_excluded=int)
# One angle since the alarm (`filter_beyond`).
#     beyond    (axes, poles) rad: filtered residual of turning beyond the part of the angle's own residual
#     swing     (poles,) rad: filtered size of the angle's residual
#     c_max     (axes,): largest size of turn_share
ANGLE_RECORD = record(beyond=(3, N_POLES), swing=N_POLES, c_max=3)


@kernel
def turn_share(y, i, j):
    """c: rotation about body axis i per change of phi, theta or psi (j = 0, 1, 2), rad/rad, at attitude y.

    A change of phi turns the aircraft about the first body axis, one of theta about the level second axis,
    one of psi about the vertical.
    """
    across = 0.0, np.cos(y[PHI]), -np.sin(y[PHI])
    return ((1.0, 0.0, 0.0), across, components(down(y)))[j][i]


@kernel
def advance_gyro_estimate(mon, nu, eta, dt):
    """Advance W and its bound by a frame of dt s:

        W <- A W + dt nu,    W_max <- |A| W_max + dt eta,    A = I - dt D_x

    W (3,) rad/s is the error of the gyros, if all of the innovation is due to it. nu, eta (3,) rad/s2:
    innovation of the frame, and the bound on it that the declared uncertainty gives.
    """
    W = mon.dynamics.W
    W_max = mon.dynamics.W_max
    W_past = components(vector(W))
    W_max_past = components(vector(W_max))
    for i in range(3):
        W[i] = dt * nu[i]
        W_max[i] = dt * eta[i]
        for j in range(3):
            A = (i == j) - dt * mon.config.D[i, j]
            W[i] += A * W_past[j]
            W_max[i] += abs(A) * W_max_past[j]


@kernel
def follow_gyro_errors(mon):
    """Update the sizes in GYRO_RECORD by what this sample shows. The first sample of a frame moves all sizes
    on by one frame.
    """
    for i, gyro in enumerate(mon.gyro):
        shown = -mon.tests.residual[i] / mon.config.h
        if mon.substep == 0:
            gyro.shown_past = gyro.shown
            gyro.shown = shown
            gyro.most_older = gyro.most_past
            gyro.most_past = gyro.most
            gyro.most = 0.0
            gyro.least_past = gyro.least
            gyro.least = np.inf
        else:
            gyro.most = max(gyro.most, abs(shown))
            gyro.least = min(gyro.least, abs(shown))


@kernel
def restart_comparison(mon):
    """Restart the comparison of W with the attitude, because the tests of turning restart in this sample:
    without a residual they show neither an error of a gyro nor its absence.
    """
    mon.dynamics.stage = 1
    for angle in mon.angle:
        angle.beyond[:] = angle.swing[:] = angle.c_max[:] = 0.0
    for gyro in mon.gyro:
        gyro.gap[:] = gyro.B_gap[:] = 0.0


@kernel
def advance_stage(mon):
    """Advance `stage` at the start of a frame, up to FULL_STAGE. While it is then still smaller, widen the
    bound on W by the error that the attitude shows, because an error that a gyro has had from the first
    sample on has caused no innovation.
    """
    dynamics = mon.dynamics
    if dynamics.stage < FULL_STAGE and mon.substep == 0:
        dynamics.stage += 1
        if dynamics.stage < FULL_STAGE:
            for i, gyro in enumerate(mon.gyro):
                dynamics.W_max[i] += abs(gyro.shown)


@kernel
def exclude_gyros(mon):
    """Record that no gyro can be broken, once W and the attitude disagree by more than both bounds:

        gap <- decay gap + residual + h W,    B_gap <- decay B_gap + h (W_max + DAMPING_TOLERANCE |W|)
        |gap| > B_gap + B        for some axis and pole

    residual, B: of the test of turning about the axis. If the attitude is noisy, a surface is isolated only
    after this record.
    """
    h = mon.config.h
    decay = mon.config.decay
    for i, gyro in enumerate(mon.gyro):
        W = mon.dynamics.W[i]
        leak(gyro.gap, decay, mon.tests.residual[i] + h * W)
        leak(gyro.B_gap, decay, h * (mon.dynamics.W_max[i] + attitude.DAMPING_TOLERANCE * abs(W)))
        if exceeds(gyro.gap, 1.0, gyro.B_gap, 1.0, mon.tests.B[i]):
            rule_out_gyros(mon)


@kernel
def rule_out_gyros(mon):
    """No gyro can be broken: a surface may be isolated."""
    mon.dynamics.gyros_excluded = 1


@kernel
def filter_beyond(mon, y):
    """Filter what the tests of turning show beyond an error of one angle i, for each of phi, theta and psi:

        beyond_ij <- decay beyond_ij + r_j - c_ij r_i    swing_i <- decay swing_i + |r_i|    c_max = max |c|

    r_j, r_i rad: residuals about body axis j and of angle i, of this sample; c: `turn_share`. An error of
    angle i that changes by x in a sample moves r_i by x and r_j by c_ij x. If this angle alone is wrong,
    r_j - c_ij r_i is noise.
    """
    decay = mon.config.decay
    residual = mon.tests.residual
    for i, angle in enumerate(mon.angle):
        r = residual[ANGLE_TEST + i]
        leak(angle.swing, decay, abs(r))
        for j in range(3):
            c = turn_share(y, j, i)
            angle.c_max[j] = max(angle.c_max[j], abs(c))
            leak(angle.beyond[j], decay, residual[j] - c * r)


@kernel
def judge_gyros(mon, bank, bound, dt):
    """Decide, by axis, whether the error that the attitude shows is a gyro's, once that is certain.

        innovation changes as   the dynamics     verdict
        by this jump of a gyro  show an error
        (fits)                  (shows)
        no                      yes or no        refuted, unless the error varies (see below)
        yes                     yes              confirmed
        yes                     no               refuted if the error is a transient (brief), or so large that
                                                 W would show it (not allowed)
        yes                     no               undecided otherwise

        shows      |nu| > nu_max, or a residual of the bank exceeds its threshold, or |W| > W_max
        fits       |nu - jump| <= nu_max + tol + noise / dt,    jump = (shown - shown_past) / dt
        tol        MAX_DYNAMICS_PER_S max(|shown|, |shown_past|) + JUMP_TOLERANCE |jump|
        varies     noise < least_past < most_past / (1 + JUMP_TOLERANCE)
        brief      most_older > MIN_TRANSIENT noise, and since then every size < TRANSIENT_LEFT most_older
        allowed    MIN_ESTIMATED_SHARE |shown| <= W_max + |W| + noise

    noise rad/s: bound on the part of shown - shown_past by noise of the attitude; nu, nu_max, jump, tol
    rad/s2, nu_max with RATE_ROUNDING, as W_max in `shows`; bank: the detection filters; bound: with nu_max of
    the elapsed frame, of dt s.

    A transient appears inside a frame, and is absent in all samples of the next frame. It is not an error of
    a gyro: that stays, and if it varies, it is not so small in every sample. If an error is present in every
    sample and varies between samples (varies), the innovation cannot be compared with its jump: the
    innovation contains the errors at the start of each frame, and the attitude shows those of the samples
    before. The verdict then stays open, unless brief or not allowed, with no error shown, refutes it.
    """
    nu = bank.output.innovation
    for i, gyro in enumerate(mon.gyro):
        if gyro.verdict != GYRO_OPEN:
            continue
        W_size = abs(mon.dynamics.W[i])
        W_max = mon.dynamics.W_max[i]
        largest = max(abs(gyro.shown), abs(gyro.shown_past))
        jump = (gyro.shown - gyro.shown_past) / dt
        noise = SAMPLES_IN_JUMP * mon.tests.per_sample[i] / mon.config.h
        nu_max = bound.nu_max[i] + RATE_ROUNDING
        shows = abs(nu[i]) > nu_max or bank_axis(bank) >= 0 or W_size > W_max + RATE_ROUNDING
        tol = MAX_DYNAMICS_PER_S * largest + JUMP_TOLERANCE * abs(jump)
        fits = abs(nu[i] - jump) <= nu_max + tol + noise / dt
        varies = noise < gyro.least_past < gyro.most_past / (1.0 + JUMP_TOLERANCE)
        gone = max(largest, gyro.most_past) < TRANSIENT_LEFT * gyro.most_older
        brief = gone and gyro.most_older > MIN_TRANSIENT * noise
        allowed = MIN_ESTIMATED_SHARE * abs(gyro.shown) <= W_max + W_size + noise
        if fits and shows:
            gyro.verdict = GYRO_CONFIRMED
        elif not (fits or varies) or (not shows and (brief or not allowed)):
            gyro.verdict = GYRO_REFUTED
