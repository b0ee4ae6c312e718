"""What an acceleration that the law does not reckon with shows in its observer; and which surfaces still
answer once no known fault fits.

An acceleration a shows in what the observer misses, through the observer's own error dynamics

    e' = a - dd,   missed = e before correction,   e <- (1 - pull) missed,   dd <- dd + learn missed

which take out what changes slowly: gusts, wrong coefficients.

What damage takes stands in no list. After such a fault

    a_i = sum_s theta_s G_is u_s + sum_j A_ij y_j,       -1 <= theta_s <= 0,       y: alpha, beta, p, q, r

G u is what healthy surfaces would give; A what the airframe does otherwise, a yaw by sideslip that has
changed its sign for instance: without it the rudders would be blamed for what they answer. theta and A follow
by recursive least squares from all three axes at once [Ljung1999, ch. 11]. A theta beyond its limits is put
back, the others with it along the covariance: to the likeliest place within, never further from the truth.
"""

import numpy as np

from beaver_ftc.compiled import apart, kernel, record, sized
from beaver_ftc.design.model import ALPHA, BETA
from beaver_ftc.documents.sized import Room

ANSWER = record(rate=3, disturbance=3)
_SIGNALS = 5
_FEW = 4  # surfaces: of so few each leads an axis or stands in, and one at a time is looked at (rejecting.py)
_UNSURE = 0.5  # standard deviation of a surface's theta before anything is seen
_AIRFRAME = np.array([30.0, 30.0, 3.0, 3.0, 3.0])  # of A, in the order of y: 1/s2 and 1/s
_CORRELATED = 10.0  # what is missed is no white noise: so many frames count as one
_LEAST_NOISE_RAD_S2 = 0.05
_FORGOTTEN_S = 30.0  # what is not seen again in that time may have changed


@sized
def answering_dtype(n: int) -> np.dtype:
    """n surfaces. found (N,): theta of each, then A row by row; P (N, N): their covariance; memory: what each
    surface's moment, each signal and what is believed of all surfaces has become in the observer; noise (3,)
    (rad/s)2: of what is missed in health; unsure (N,): variances begun with; h, Ph (N,): for the update."""
    many = n > _FEW
    size, answers = (n + 3 * _SIGNALS, n + _SIGNALS + 1) if many else (Room(1), Room(1))
    return record(
        listening=int, noise=3, found=size, P=(size, size), h=size, Ph=size, unsure=size,
        memory=(ANSWER, answers), signal=_SIGNALS,
    )  # fmt: skip


@kernel
def answer(memory, i, acceleration, pull, learn, dt):
    """What the observer misses in a frame for an acceleration (rad/s2) of axis i; memory: dtype ANSWER."""
    missed = memory.rate[i] + dt * (acceleration - memory.disturbance[i])
    memory.rate[i] = (1.0 - pull) * missed
    memory.disturbance[i] += learn * missed
    return missed


@apart
def begin(answering, missed, frames, dt):
    """Begin to listen, with nothing known; missed (3,) (rad/s)2: sums of squares over `frames` (3,)."""
    answering.listening = 1
    N, n = answering.found.size, answering.found.size - 3 * _SIGNALS
    answering.P[:], answering.found[:] = 0.0, 0.0
    for j in range(N):
        spread = _UNSURE if j < n else _AIRFRAME[(j - n) % _SIGNALS]
        answering.P[j, j] = answering.unsure[j] = spread * spread
    least = _LEAST_NOISE_RAD_S2 * dt
    for i in range(3):
        answering.noise[i] = _CORRELATED * max(missed[i] / max(frames[i], 1.0), least * least)
    for one in answering.memory:
        one.rate[:], one.disturbance[:] = 0.0, 0.0


@apart
def listen(answering, missed, pull, into, dt, x, y, effectiveness, given):
    """Take in what was missed of all axes (3,) rad/s; pull 1, into 1/s (3,): the observer's corrections; x
    (3,) rad/s, y: measured; effectiveness (n,): believed; given (3, n) rad/s2: moments of healthy surfaces.
    """
    n, h, signal, unsure = effectiveness.size, answering.h, answering.signal, answering.unsure
    for j in range(h.size):
        answering.P[j, j] = min(
            answering.P[j, j] + unsure[j] * dt / _FORGOTTEN_S, max(answering.P[j, j], unsure[j])
        )
    signal[0], signal[1] = y[ALPHA], y[BETA]
    signal[2:] = x
    for i in range(3):
        believed = 0.0
        h[:] = 0.0
        for s in range(n):
            believed += (effectiveness[s] - 1.0) * given[i, s]
            h[s] = answer(answering.memory[s], i, given[i, s], pull[i], into[i], dt)
        for j in range(_SIGNALS):
            h[n + i * _SIGNALS + j] = answer(answering.memory[n + j], i, signal[j], pull[i], into[i], dt)
        seen = missed[i] + answer(answering.memory[n + _SIGNALS], i, believed, pull[i], into[i], dt)
        update(answering, seen, answering.noise[i])
    for s in range(n):
        beyond = answering.found[s] - min(max(answering.found[s], -1.0), 0.0)
        if beyond != 0.0:
            for j in range(h.size):
                answering.found[j] -= answering.P[j, s] * (beyond / answering.P[s, s])


@kernel
def update(answering, seen, noise):
    """One step of recursive least squares: seen = h found, give or take a variance of `noise`."""
    N, h, P, Ph = answering.found.size, answering.h, answering.P, answering.Ph
    variance, surprise = noise, seen
    for j in range(N):
        Ph[j] = 0.0
        for k in range(N):
            Ph[j] += P[j, k] * h[k]
        variance += h[j] * Ph[j]
        surprise -= h[j] * answering.found[j]
    for j in range(N):
        answering.found[j] += Ph[j] / variance * surprise
        for k in range(N):
            P[j, k] -= Ph[j] * Ph[k] / variance


@kernel
def effectiveness_of(answering, s):
    """What surface s is taken for, 0 to 1."""
    return min(max(1.0 + answering.found[s], 0.0), 1.0)
