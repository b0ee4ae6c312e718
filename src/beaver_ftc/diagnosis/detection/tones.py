"""Oscillation tests: spectra of the whitened innovation g of a view at the frequencies of a grid.

An oscillating surface adds a tone of unknown amplitude and phase to a view (parity.py). The whitening filter
is linear, so the whitened innovation contains the same tone. For each frequency omega, rad/s, the test
computes

    N = sum exp((i omega - 1 / T) t) g / sqrt(S)          summed over past frames; t s is the age of a frame

with S the variance of g, (rad/s)2, and T = TONE_MEMORY_S. Without a fault the real and the imaginary part of
N are normal. With v the larger of their variances, |N| / sqrt(v) exceeds x with a probability of exp(-x^2 /
2) at most. Two errors can add to |N| without a fault:

* Errors of coefficients c_j, |c_j| <= tol_j, add at most sum_j tol_j |R_j|, where R_j is the same sum over
  the response g_Zj to regressor j.
* A bounded uncertainty |delta| <= eta_bar adds at most |W(omega)| sum eta_bar exp(-t / T) |cos|, where W is
  the gain of the whitening filter at omega. The limited rate of change of delta reduces this a little
  (`max_tone_mean`).

The sums are updated once per TONE_INTERVAL_S: no frequency of the grid changes its phase much in that
time.

Letters of the kernels:

    t, b, c           record of the tests of a view; its block (blocks.py); their configuration
    j, k              regressor, frequency
    N, R              sums as above, (N_TONES,) and (n_Z, N_TONES) complex
    g, g_Z            whitened innovation, and responses to the regressors, rad/s; 1 / S is S_inv of the block
    K_x, K_d, a       gains of the block's filter on rate, 1, and drift, 1/s, and decay of its drift; a of c:
                      decay in an update
    z, rho            exp(i omega dt); exp((i omega - 1 / T) dt) of an update; rho2: of 2 omega
    e_R, eta          the most that coefficients, and the bounded uncertainty, add to |N|
"""

from math import exp, pi, sqrt

import numpy as np

from beaver_ftc.compiled import fill, kernel, record, sized
from beaver_ftc.design.table import AIRSPEED, ALPHA, BETA
from beaver_ftc.diagnosis.detection.likelihood import evidence_ratio

N_TONES = 16
# With a memory of T s, a tone 1 / T rad/s off a frequency appears with 0.7 of its amplitude. The frequencies
# of the grid are 2 / T apart.
TONE_MEMORY_S = 2.5
TONES_RAD_S = np.linspace(1.0, 13.0, N_TONES)
TONE_INTERVAL_S = 0.04
# Share of the alarm level reserved for noise in addition to a bounded uncertainty. It is reserved without
# noise too, because `tone_gain` assumes constant gains, and the gains vary with a varying bound.
TONE_NOISE_SHARE = 0.5
SQRT2_LESS_1 = sqrt(2.0) - 1.0  # see `bound_coefficients`
# The tests run at airspeeds within this ratio of the trim airspeed, and at vane angles within this limit.
MAX_V_FACTOR, MAX_VANE_RAD = 2.0, 0.5

# Configuration that all views share.
TONE_RECORD = record(
    V_min=float, V_max=float,  # airspeeds, m/s, between which the tests run
    stride=int, alarm_level=float,  # frames per update; alarm level, standard deviations
    a=float, z=(complex, N_TONES), rho=(complex, N_TONES), rho2=(complex, N_TONES),  # a: decay in an update
    # mean_max: `max_tone_mean`; v_share: share of the variance of N that is the larger of the variances of
    # its two parts
    mean_max=N_TONES, v_share=N_TONES,
)  # fmt: skip


@sized
def tones_dtype(n_Z: int) -> np.dtype:
    """The oscillation tests of one view, for a number of regressors."""
    return record(
        # since the last update: frames, frames that count, and sums over these of g, eta and g_Z over sqrt(S)
        n_frames=int, n_new=int, sum_g=float, sum_eta=float, sum_Z=n_Z,
        N=(complex, N_TONES), R=(complex, n_Z, N_TONES),
        # largest parts of |N| by errors of coefficients, e_R, and by a bounded uncertainty, eta; for the
        # latter the sums of the filtered bound, b_0, and of its component at twice the frequency, b_2
        e_R=N_TONES, eta=N_TONES, b_0=N_TONES, b_2=(complex, N_TONES),
        D=float,  # variance of N without a fault
        score=float,  # largest over the frequencies; on the scale of scores in likelihood.py
    )  # fmt: skip


@kernel
def within_limits(c, y):
    """True if airspeed and vane angles of y (4 + signals,) are near those of normal flight.

    Outside, the tolerances of the tests, which are worked out for trim, do not hold.
    """
    return c.V_min < y[AIRSPEED] < c.V_max and abs(y[ALPHA]) < MAX_VANE_RAD and abs(y[BETA]) < MAX_VANE_RAD


@kernel
def update_tones(t, b, c, level, inside, dt):
    """Update the tests of a view with one frame, which its block b has whitened; dt s.

        N <- exp((i omega - 1 / T) dt_u) N + g / sqrt(S)      R_j: the same of g_Zj

    Once per update, of dt_u = stride dt s, with the sums over its frames; their ages differ by less than
    dt_u. level: alarm level of the detector, standard deviations. Unless `inside`, the frame counts as zero,
    so the sums decay.
    """
    weight = np.sqrt(b.S_inv[0, 0]) if inside else 0.0
    t.sum_g += weight * b.g[0]
    t.sum_eta += weight * b.eta[0]
    for j in range(b.n_Z):
        t.sum_Z[j] += weight * b.g_Z[j, 0]
    t.n_frames += 1
    t.n_new += inside
    if t.n_frames < c.stride:
        return
    resonate(t.N, c.rho, t.sum_g)
    for j in range(b.n_Z):
        resonate(t.R[j], c.rho, t.sum_Z[j])
        t.sum_Z[j] = 0.0
    t.D = c.a * c.a * t.D + t.n_new
    update_tone_eta(t, c, b, dt)
    bound_coefficients(t, b.tol, b.n_Z)
    score_tones(t, c, level)
    t.sum_g = t.sum_eta = 0.0
    t.n_frames = t.n_new = 0


@kernel
def resonate(N, rho, v):
    """N <- rho N + v at each frequency; N, rho (N_TONES,) complex."""
    for k in range(N.size):
        N[k] = rho[k] * N[k] + v


@kernel
def tone_gain(K_x, K_d, a, z, dt):
    """|W(omega)|: amplitude of g, rad/s, by a tone of amplitude 1 rad/s2 at constant gains; dt s a frame.

    g = e + dt (nu - d),  e <- g - K_x g,  d <- a d + K_d g:
    |W| = dt / |1 - (1 - K_x) / z + dt K_d / (z - a)|,  z = exp(i omega dt)
    """
    return dt / abs(1.0 - (1.0 - K_x) * z.conjugate() + dt * K_d / (z - a))


@kernel
def update_tone_eta(t, c, b, dt):
    """Update `eta` of each frequency: nearly the most that a bounded uncertainty adds to |N|.

        b_0 <- a b_0 + added,    b_2 <- rho2 b_2 + added,    added = |W| sum_eta
        eta_k = mean_max (b_0 + |b_2|)

    sum_eta: sum over the frames of the update of the bound over sqrt(S); |W|: `tone_gain`; a: of c.

    |cos x| = 2 / pi (1 + 2/3 cos 2x - 2/15 cos 4x + ...). A bound that varies at twice the tone's frequency
    adds most; the last third of |b_2| is for the harmonics above. One that varies at four times the frequency
    or more can add a tenth more than that.
    """
    for k in range(t.eta.size):
        added = t.sum_eta * tone_gain(b.K_x[0, 0], b.K_d[0, 0], b.a, c.z[k], dt)
        t.b_0[k] = c.a * t.b_0[k] + added
        t.b_2[k] = c.rho2[k] * t.b_2[k] + added
        t.eta[k] = c.mean_max[k] * (t.b_0[k] + abs(t.b_2[k]))


@kernel
def bound_coefficients(t, tol, n_Z):
    """Fill e_R = sum_j tol_j |R_j|: the most that the errors of the first n_Z coefficients add to |N|.

    |R_j| is at most its larger part plus (sqrt 2 - 1) times its smaller part, which needs no square root.
    """
    t.e_R[:] = 0.0
    for j in range(n_Z):
        for k in range(t.e_R.size):
            real = abs(t.R[j, k].real)
            imag = abs(t.R[j, k].imag)
            t.e_R[k] += tol[j] * (max(real, imag) + SQRT2_LESS_1 * min(real, imag))


@kernel
def score_tones(t, c, level):
    """Fill `score`, the largest over the frequencies, scaled from the level z of a tone to the detector's
    level:

        (|N| - e_R) / max(sqrt(v D), eta / z + TONE_NOISE_SHARE sqrt(v D)) level / z,      v = v_share
    """
    score = 0.0
    for k in range(t.e_R.size):
        N = abs(t.N[k]) - t.e_R[k]
        ratio = evidence_ratio(c.alarm_level, TONE_NOISE_SHARE, N, t.eta[k], c.v_share[k] * t.D)
        score = max(score, ratio)
    t.score = score * level / c.alarm_level


def max_tone_mean(omega: np.ndarray, rate: float) -> np.ndarray:
    """Largest mean of cos(omega t) delta(t) over all delta with |delta| <= 1 and |delta'| <= rate;
    frequencies omega (n,) rad/s.

    The largest is reached by a square wave with edges of the slope `rate`, or, at frequencies where these
    edges do not reach 1, by a triangular wave.
    """
    ratio = omega / rate
    return 2.0 / pi * np.where(ratio < pi / 2.0, np.sin(ratio), 1.0) / ratio


def configure_tones(c: np.void, false_alarm: float, V: float, rate: float, dt: float) -> None:
    """Fill the configuration that all views share (TONE_RECORD).

        alarm_level = sqrt(-2 ln false_alarm)      rho = exp((i omega - 1 / T) stride dt)

    false_alarm: probability of a false alarm granted to one test in one frame. V: airspeed in trim, m/s.
    rate: largest rate of change of a bounded uncertainty, bounds per second. dt s a frame.
    """
    stride = max(round(TONE_INTERVAL_S / dt), 1)
    z = np.exp(1j * TONES_RAD_S * dt)
    a = exp(-stride * dt / TONE_MEMORY_S)
    rho = a * z**stride
    # The variances of the two parts differ by |sum exp(2 (i omega - 1 / T) t)| / sum exp(-2 t / T).
    v_share = 0.5 + 0.5 * (1.0 - a**2) / np.abs(1.0 - rho**2)
    fill(
        c, V_min=V / MAX_V_FACTOR, V_max=V * MAX_V_FACTOR, stride=stride, a=a, z=z, rho=rho,
        rho2=a * z ** (2 * stride), alarm_level=sqrt(-2.0 * np.log(false_alarm)),
        mean_max=max_tone_mean(TONES_RAD_S, rate), v_share=v_share,
    )  # fmt: skip
