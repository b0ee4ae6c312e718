"""Oscillations: the whitened innovation g of a view, listened to at frequencies on a grid.

A surface that oscillates moves a view by a tone of unknown size and phase, and whitening, being linear,
leaves it one. So for each frequency w

    N = sum exp((i w - 1 / T) t) g / sqrt(S)          over the past, t s ago

and without a fault both parts of N are normal, together no wider than their larger variance: |N| over its
root is beyond x with a chance of exp(-x^2 / 2) at most. Errors of coefficients and a bounded uncertainty add
what they do in likelihood.py: the former, through the same sums, no more than sum tol_j |R_j|; the latter, of
|d| <= eta_bar, no more than |W(w)| sum eta_bar exp(-t / T) |cos|, W being what the filter makes of a tone; a
little less, since d changes no faster than declared.

Frames are summed a few at a time: no frequency listened to turns far within 0.04 s.
"""

from math import exp, pi, sqrt

import numpy as np

from beaver_ftc.compiled import kernel, record, sized
from beaver_ftc.design.terms import AIRSPEED, ALPHA, BETA
from beaver_ftc.diagnosis.detection.likelihood import share

N_TONES = 16
# A memory of T s tells frequencies 1 / T apart; halfway between two of the grid 0.7 of a tone is heard.
MEMORY_S = 2.5
FREQUENCIES_RAD_S = np.linspace(1.0, 13.0, N_TONES)
SUMMED_S = 0.04
# Share of the level that chance is given beside a bounded uncertainty, be there noise or not: `passes` is of
# gains that stay, and those of a bound that swings do not.
CHANCE = 0.5
FASTER, WILD_RAD = 2.0, 0.5  # than in trim; incidences

# What all views share, and what each keeps.
LISTENING = record(
    slowest=float, fastest=float,  # m/s: beyond, nothing is heard
    every=int, level=float, keep=float,  # frames; standard deviations; of a sum
    # by the angle of a frame; by that of a sum, and twice that, times `keep`
    turn=(2, N_TONES), turn_kept=(2, N_TONES), turn_twice=(2, N_TONES),
    heard=N_TONES,  # at most, of an uncertainty within one
    width=N_TONES,  # larger variance of the two parts of N, of both together one
)  # fmt: skip


@sized
def tones_dtype(regressors: int) -> np.dtype:
    """What a view of so many regressors keeps."""
    return record(
        count=int, sum=float, sums=regressors,  # of frames, and of regressors
        tone=(2, N_TONES), overlap=(regressors, 2, N_TONES),
        # of |N|: what coefficients and a bounded uncertainty explain; of the latter, its size and its beat
        slack=N_TONES, room=N_TONES, steady=N_TONES, beat=(2, N_TONES), information=float,
        score=float,  # of the loudest, as a score of likelihood.py of the same chance
    )  # fmt: skip


@kernel
def usual(listening, y):
    """Whether the flow is one in which an aircraft still flies; y as measured. What constants multiply is
    reckoned with as in trim, and an error of the pressure is much to one that has all but stopped."""
    within = listening.slowest < y[AIRSPEED] < listening.fastest
    return within and abs(y[ALPHA]) < WILD_RAD and abs(y[BETA]) < WILD_RAD


@kernel
def listen(view, listening, alarm_level, heard, tolerated, dt):
    """Take in one frame of a view whose block has whitened it; tolerated: whether there are regressors. What
    is not `heard` lets what was fade."""
    tones, block = view.tones, view.block
    n = block.n_regressors if tolerated else 0
    root = np.sqrt(block.S_inverse[0, 0]) if heard else 0.0
    tones.sum += root * block.innovation[0]
    for j in range(n):
        tones.sums[j] += root * block.regressor_response[j, 0]
    tones.count += 1
    if tones.count < listening.every:
        return
    ring(listening, tones.tone, tones.sum)
    for j in range(n):
        ring(listening, tones.overlap[j], tones.sums[j])
        tones.sums[j] = 0.0
    tones.information = listening.keep * listening.keep * tones.information + tones.count
    allow(tones, listening, block, root * view.bounded[0], dt)
    tolerate(tones, block.tolerance, n)
    judge(tones, listening, alarm_level)
    tones.sum, tones.count = 0.0, 0


@kernel
def ring(listening, tone, struck):
    """Let resonators (2, N_TONES), real and imaginary part, ring on, and strike them."""
    turn = listening.turn_kept
    for f in range(tone.shape[1]):
        real, imaginary = tone[0, f], tone[1, f]
        tone[0, f] = turn[0, f] * real - turn[1, f] * imaginary + struck
        tone[1, f] = turn[1, f] * real + turn[0, f] * imaginary


@kernel
def passes(K_x, K_d, keep, cos, sin, dt):
    """What a whitening filter makes of a tone of one rad/s2, rad/s; cos, sin: of its angle in a frame."""
    apart = (cos - keep) * (cos - keep) + sin * sin
    real = 1.0 - (1.0 - K_x) * cos + dt * K_d * (cos - keep) / apart
    imaginary = (1.0 - K_x) * sin - dt * K_d * sin / apart
    return dt / np.sqrt(real * real + imaginary * imaginary)


@kernel
def allow(tones, listening, block, bounded, dt):
    """Bring `room` to this sum: what an uncertainty within `bounded`, in whitened units, can add to |N|.

    |cos x| = 2 / pi (1 + 2/3 cos 2x - 2/15 cos 4x + ...): a bound that beats at twice the frequency lets more
    be heard, and its harmonics, which beat less, no more than a third of that again.
    """
    turn, keep, most = listening.turn_twice, listening.keep, bounded * tones.count
    for f in range(tones.room.size):
        cos, sin = listening.turn[0, f], listening.turn[1, f]
        passed = most * passes(block.K_x[0, 0], block.K_d[0, 0], block.keep, cos, sin, dt)
        real, imaginary = tones.beat[0, f], tones.beat[1, f]
        tones.beat[0, f] = turn[0, f] * real - turn[1, f] * imaginary + passed
        tones.beat[1, f] = turn[1, f] * real + turn[0, f] * imaginary
        tones.steady[f] = keep * tones.steady[f] + passed
        tones.room[f] = listening.heard[f] * (tones.steady[f] + np.hypot(tones.beat[0, f], tones.beat[1, f]))


@kernel
def tolerate(tones, tolerance, n):
    """Fill `slack`: of |N|, what the declared errors of the first n coefficients explain at most.

    A magnitude is no more than the larger part and (sqrt 2 - 1) of the smaller.
    """
    tones.slack[:] = 0.0
    for j in range(n):
        overlap, tol = tones.overlap[j], tolerance[j]
        for f in range(tones.slack.size):
            one, other = abs(overlap[0, f]), abs(overlap[1, f])
            tones.slack[f] += tol * (max(one, other) + 0.41421356237309515 * min(one, other))


@kernel
def judge(tones, listening, alarm_level):
    """Fill `score`."""
    loudest = 0.0
    for f in range(tones.slack.size):
        evidence = np.hypot(tones.tone[0, f], tones.tone[1, f]) - tones.slack[f]
        variance = listening.width[f] * tones.information
        loudest = max(loudest, share(listening.level, CHANCE, evidence, tones.room[f], variance))
    tones.score = loudest * alarm_level / listening.level


def heard_of_bounded(frequency_rad_s: np.ndarray, pace_rad_s: float) -> np.ndarray:
    """Largest mean of cos(w t) d(t), |d| <= 1 and |d'| <= pace: of a square wave as steep as it may be, or of
    a triangular one that does not get that far. (n,) rad/s."""
    x = frequency_rad_s / pace_rad_s
    return 2.0 / pi * np.where(x < pi / 2.0, np.sin(x), 1.0) / x


def set_up_listening(
    listening: np.void, chance: float, airspeed_mps: float, pace_rad_s: float, dt_s: float
) -> None:
    """Fill what all views share; chance: that one test of one frame is given; airspeed in trim; pace: of a
    bounded uncertainty."""
    listening["heard"] = heard_of_bounded(FREQUENCIES_RAD_S, pace_rad_s)
    listening["slowest"], listening["fastest"] = airspeed_mps / FASTER, airspeed_mps * FASTER
    every = max(round(SUMMED_S / dt_s), 1)
    angle = FREQUENCIES_RAD_S * dt_s
    keep = exp(-every * dt_s / MEMORY_S)
    listening["every"], listening["keep"], listening["level"] = every, keep, sqrt(-2.0 * np.log(chance))
    listening["turn"] = np.cos(angle), np.sin(angle)
    listening["turn_kept"] = keep * np.cos(every * angle), keep * np.sin(every * angle)
    listening["turn_twice"] = keep * np.cos(2.0 * every * angle), keep * np.sin(2.0 * every * angle)
    # Variances of the two parts differ by the sum of exp(2 (i w - 1 / T) t), over that of exp(-2 t / T).
    apart = (1.0 - keep**2) / np.abs(1.0 - keep**2 * np.exp(2j * every * angle))
    listening["width"] = 0.5 * (1.0 + apart)
