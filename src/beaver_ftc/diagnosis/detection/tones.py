"""Oscillation tests: the spectrum of a view's whitened innovation g at the frequencies of a grid.

An oscillating surface adds a tone of unknown amplitude and phase to a view (parity.py). The whitening filter
is linear, so the whitened innovation contains the same tone. For each frequency w, rad/s, the test computes

    N = sum exp((i w - 1 / T) t) g / sqrt(S)          summed over past frames; t s is the age of a frame

with S the variance of g, (rad/s)2, and T = MEMORY_S. Without a fault the real and the imaginary part of N are
normal. With v the larger of their variances, |N| / sqrt(v) exceeds x with a probability of exp(-x^2 / 2) at
most. Two errors can add to |N| without a fault (symbols as in likelihood.py):

* Errors of coefficients add at most sum_j tol_j |R_j|, where R_j is the same sum over regressor j.
* A bounded uncertainty |d| <= eta_bar adds at most |W(w)| sum eta_bar exp(-t / T) |cos|, where W is the gain
  of the whitening filter at w. The limited rate of change of d reduces this a little (`bounded_gain_at`).

The sums are updated once per SUMMED_S: no frequency of the grid changes its phase much in that time.
"""

from math import exp, pi, sqrt

import numpy as np

from beaver_ftc.compiled import kernel, record, sized
from beaver_ftc.design.terms import AIRSPEED, ALPHA, BETA
from beaver_ftc.diagnosis.detection.likelihood import normalised_evidence

N_TONES = 16
# A memory of T s resolves frequencies 1 / T apart. A tone halfway between two frequencies of the grid appears
# with 0.7 of its amplitude.
MEMORY_S = 2.5
FREQUENCIES_RAD_S = np.linspace(1.0, 13.0, N_TONES)
SUMMED_S = 0.04
# Share of the alarm level reserved for noise in addition to a bounded uncertainty. It is reserved without
# noise too, because `whitening_gain` assumes constant gains, and the gains vary with a varying bound.
NOISE_SHARE = 0.5
# The tests run at airspeeds within this ratio of the trim airspeed, and at vane angles within this limit.
MAX_AIRSPEED_RATIO, MAX_INCIDENCE_RAD = 2.0, 0.5

# Configuration that all views share.
TONE_CONFIG = record(
    slowest=float, fastest=float,  # airspeeds, m/s, between which the tests run
    frames_per_sum=int, level=float,  # alarm level, standard deviations
    keep=float,  # factor by which a sum decays from one update to the next
    # (cos, sin) of the phase change per frame; per update, and twice that, both times `keep`
    rotation=(2, N_TONES), rotation_kept=(2, N_TONES), rotation_twice=(2, N_TONES),
    bounded_gain=N_TONES,  # largest mean of cos(w t) d(t) for a bounded uncertainty |d| <= 1
    noise_variance=N_TONES,  # larger variance of real and imaginary part of N; the sum of both is 1
)  # fmt: skip


@sized
def tones_dtype(regressors: int) -> np.dtype:
    """The oscillation tests of one view, for a number of regressors."""
    return record(
        count=int, sum=float, sums=regressors,  # frames since the last update; sums of g and of regressors
        tone=(2, N_TONES), overlap=(regressors, 2, N_TONES),  # N and R_j: real and imaginary parts
        # shares of |N| that errors of coefficients and a bounded uncertainty explain; for the latter, the
        # filtered bound: its mean, and its component at twice the frequency
        coefficient_part=N_TONES, uncertainty_part=N_TONES, bound_mean=N_TONES, bound_harmonic=(2, N_TONES),
        information=float,  # variance of N without a fault
        score=float,  # largest over the frequencies; on the scale of scores in likelihood.py
    )  # fmt: skip


@kernel
def is_within_envelope(tone_config, y):
    """True if airspeed and vane angles y (5,) are near those of normal flight.

    Outside, the tolerances of the tests, which are worked out for trim, do not hold.
    """
    within = tone_config.slowest < y[AIRSPEED] < tone_config.fastest
    return within and abs(y[ALPHA]) < MAX_INCIDENCE_RAD and abs(y[BETA]) < MAX_INCIDENCE_RAD


@kernel
def update_tones(view, tone_config, alarm_level, within_envelope, has_tolerances, dt):
    """Update the tests of a view with one frame, which the view's block has whitened; dt s.

    tolerated: true if the block has regressors. Without `within_envelope` the frame counts as zero, so the
    sums decay.
    """
    tones, block = view.tones, view.block
    n = block.n_regressors if has_tolerances else 0
    root = np.sqrt(block.S_inverse[0, 0]) if within_envelope else 0.0
    tones.sum += root * block.innovation[0]
    for j in range(n):
        tones.sums[j] += root * block.regressor_response[j, 0]
    tones.count += 1
    if tones.count < tone_config.frames_per_sum:
        return
    advance_resonators(tone_config, tones.tone, tones.sum)
    for j in range(n):
        advance_resonators(tone_config, tones.overlap[j], tones.sums[j])
        tones.sums[j] = 0.0
    tones.information = tone_config.keep * tone_config.keep * tones.information + tones.count
    update_uncertainty_part(tones, tone_config, block, root * view.bounded[0], dt)
    fill_coefficient_part(tones, block.tolerance, n)
    fill_score(tones, tone_config, alarm_level)
    tones.sum, tones.count = 0.0, 0


@kernel
def advance_resonators(tone_config, tone, drive):
    """Advance N at every frequency, tone (2, N_TONES), by one update: rotate, decay, add the drive."""
    rotation = tone_config.rotation_kept
    for f in range(tone.shape[1]):
        real, imaginary = tone[0, f], tone[1, f]
        tone[0, f] = rotation[0, f] * real - rotation[1, f] * imaginary + drive
        tone[1, f] = rotation[1, f] * real + rotation[0, f] * imaginary


@kernel
def whitening_gain(K_x, K_d, keep, cos, sin, dt):
    """Amplitude, rad/s, of the whitened response to a tone of amplitude 1 rad/s2, at constant filter gains.

    cos, sin: of the phase change of the tone per frame, of dt s.
    """
    apart = (cos - keep) * (cos - keep) + sin * sin
    real = 1.0 - (1.0 - K_x) * cos + dt * K_d * (cos - keep) / apart
    imaginary = (1.0 - K_x) * sin - dt * K_d * sin / apart
    return dt / np.sqrt(real * real + imaginary * imaginary)


@kernel
def update_uncertainty_part(tones, tone_config, block, bounded, dt):
    """Update `uncertainty_part`: the most that an uncertainty |d| <= bounded, in whitened units, adds to |N|.

    |cos x| = 2 / pi (1 + 2/3 cos 2x - 2/15 cos 4x + ...). A bound that varies at twice the tone's frequency
    adds most. Its higher harmonics add less: together no more than a third of that again.
    """
    rotation, keep, per_sum = tone_config.rotation_twice, tone_config.keep, bounded * tones.count
    for f in range(tones.uncertainty_part.size):
        cos, sin = tone_config.rotation[0, f], tone_config.rotation[1, f]
        bounded_input = per_sum * whitening_gain(block.K_x[0, 0], block.K_d[0, 0], block.keep, cos, sin, dt)
        real, imaginary = tones.bound_harmonic[0, f], tones.bound_harmonic[1, f]
        tones.bound_harmonic[0, f] = rotation[0, f] * real - rotation[1, f] * imaginary + bounded_input
        tones.bound_harmonic[1, f] = rotation[1, f] * real + rotation[0, f] * imaginary
        tones.bound_mean[f] = keep * tones.bound_mean[f] + bounded_input
        tones.uncertainty_part[f] = tone_config.bounded_gain[f] * (
            tones.bound_mean[f] + np.hypot(tones.bound_harmonic[0, f], tones.bound_harmonic[1, f])
        )


@kernel
def fill_coefficient_part(tones, tolerance, n):
    """Fill `coefficient_part`: the most that the declared errors of the first n coefficients add to |N|.

    The magnitude of R_j is at most its larger part plus (sqrt 2 - 1) times its smaller part.
    """
    tones.coefficient_part[:] = 0.0
    for j in range(n):
        overlap, tol = tones.overlap[j], tolerance[j]
        for f in range(tones.coefficient_part.size):
            one, other = abs(overlap[0, f]), abs(overlap[1, f])
            tones.coefficient_part[f] += tol * (max(one, other) + 0.41421356237309515 * min(one, other))


@kernel
def fill_score(tones, tone_config, alarm_level):
    """Fill `score` with the largest score over the frequencies, scaled to the detector's alarm level."""
    loudest = 0.0
    for f in range(tones.coefficient_part.size):
        evidence = np.hypot(tones.tone[0, f], tones.tone[1, f]) - tones.coefficient_part[f]
        variance = tone_config.noise_variance[f] * tones.information
        loudest = max(
            loudest,
            normalised_evidence(
                tone_config.level, NOISE_SHARE, evidence, tones.uncertainty_part[f], variance
            ),
        )
    tones.score = loudest * alarm_level / tone_config.level


def bounded_gain_at(frequency_rad_s: np.ndarray, pace_rad_s: float) -> np.ndarray:
    """Largest mean of cos(w t) d(t) over all d with |d| <= 1 and |d'| <= pace; frequencies w (n,) rad/s.

    The largest is reached by a square wave with edges of the slope `pace`, or, at frequencies where these
    edges do not reach 1, by a triangular wave.
    """
    x = frequency_rad_s / pace_rad_s
    return 2.0 / pi * np.where(x < pi / 2.0, np.sin(x), 1.0) / x


def configure_tones(
    tone_config: np.void, chance: float, airspeed_mps: float, pace_rad_s: float, dt_s: float
) -> None:
    """Fill the configuration that all views share.

    chance: probability of a false alarm granted to one test in one frame. airspeed_mps: in trim. pace_rad_s:
    largest rate of change of a bounded uncertainty, in bounds per second.
    """
    tone_config["bounded_gain"] = bounded_gain_at(FREQUENCIES_RAD_S, pace_rad_s)
    tone_config["slowest"], tone_config["fastest"] = (
        airspeed_mps / MAX_AIRSPEED_RATIO,
        airspeed_mps * MAX_AIRSPEED_RATIO,
    )
    frames_per_sum = max(round(SUMMED_S / dt_s), 1)
    angle = FREQUENCIES_RAD_S * dt_s
    keep = exp(-frames_per_sum * dt_s / MEMORY_S)
    tone_config["frames_per_sum"], tone_config["keep"], tone_config["level"] = (
        frames_per_sum,
        keep,
        sqrt(-2.0 * np.log(chance)),
    )
    tone_config["rotation"] = np.cos(angle), np.sin(angle)
    tone_config["rotation_kept"] = (
        keep * np.cos(frames_per_sum * angle),
        keep * np.sin(frames_per_sum * angle),
    )
    tone_config["rotation_twice"] = (
        keep * np.cos(2.0 * frames_per_sum * angle),
        keep * np.sin(2.0 * frames_per_sum * angle),
    )
    # The variances of the two parts differ by |sum exp(2 (i w - 1 / T) t)| / sum exp(-2 t / T).
    difference = (1.0 - keep**2) / np.abs(1.0 - keep**2 * np.exp(2j * frames_per_sum * angle))
    tone_config["noise_variance"] = 0.5 * (1.0 + difference)
