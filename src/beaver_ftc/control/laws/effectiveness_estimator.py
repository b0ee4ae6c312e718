"""Effectiveness of every surface from the innovation of a disturbance observer, while an alarm names none.

An observer of a rate and a slow disturbance (rejecting.py) answers an acceleration a that is not in its model
with

    e' = a - dd,    innovation = e before correction
    e <- (1 - L_rate) innovation,    dd <- dd + L_disturbance innovation

    a              rad/s2    acceleration that is not in the model
    e, innovation  rad/s     error of the rate, after and before the correction
    dd             rad/s2    part of a that the observer has found

So the innovation does not contain slow changes: gusts, wrong coefficients. After damage that is in no list of
faults

    a_i = sum_s theta_s G_is u_s + sum_j A_ij y_j,       -1 <= theta_s <= 0,       y: alpha, beta, p, q, r

    theta_s        1             lost effectiveness of surface s
    G_is u_s       rad/s2        acceleration of axis i by the healthy surface s
    A              (3, 5), 1/s2 and 1/s     other changes of the airframe

An example of A is a yaw by sideslip that has changed its sign. Without A, the estimate would assign this yaw
to the rudders, which act against it. theta and A follow by recursive least squares from all three axes at
once [Ljung1999, ch. 11]. A theta beyond its limits is put back to the limit, and all other parameters move
with it along the covariance, to the most likely values.
"""

import numpy as np

from beaver_ftc.compiled import apart, copy, kernel, record, sized
from beaver_ftc.compiled.records import Room
from beaver_ftc.design.table import ALPHA, BETA

OBSERVER_ERROR = record(rate=3, disturbance=3)  # e and dd of one acceleration
_SIGNALS = 5  # in y: alpha, beta, p, q, r
_FEW = 4  # So few surfaces have no estimator: evidence.py estimates those that lead an axis, one at a time.
_THETA_STD = 0.5  # standard deviation of the theta of a surface at the start
_A_STD = np.array([30.0, 30.0, 3.0, 3.0, 3.0])  # standard deviations of A at the start, 1/s2 and 1/s, as y
_CORRELATED = 10.0  # This many frames of the innovation count as one, because it is no white noise.
_LEAST_NOISE_RAD_S2 = 0.05  # smallest standard deviation of the noise, as an acceleration over a frame
_FORGOTTEN_S = 30.0  # time in which the variance of a parameter that is not seen returns to its first value


@sized
def estimator_dtype(n: int) -> np.dtype:
    """Memory for n surfaces.

    active            whether the estimator runs
    noise (3,)        (rad/s)2, variance of the innovation in health
    parameters (N,)   w: theta of each surface, then A row by row; N = n + 15
    P (N, N)          covariance of w
    prior (N,)        variances of w at the start
    errors            answers of the observer to the moment of each surface, to each signal, and to the
                      assumed moments minus the healthy ones
    signal (5,)       y
    h, Ph (N,)        regressors of w, and P h

    An aircraft with few surfaces has no estimator: its arrays have one element (evidence.py estimates).
    """
    many = n > _FEW
    size, errors = (n + 3 * _SIGNALS, n + _SIGNALS + 1) if many else (Room(1), Room(1))
    return record(
        active=int, noise=3, parameters=size, P=(size, size), h=size, Ph=size, prior=size,
        errors=(OBSERVER_ERROR, errors), signal=_SIGNALS,
    )  # fmt: skip


@kernel
def observer_response(error, i, acceleration, L_rate, L_disturbance, dt):
    """Advance the observer's error, of dtype OBSERVER_ERROR, by a frame of dt s with an acceleration a,
    rad/s2, of axis i; returns the innovation, rad/s:

        innovation = e + dt (a - dd),    e <- (1 - L_rate) innovation,    dd <- dd + L_disturbance innovation
    """
    innovation = error.rate[i] + dt * (acceleration - error.disturbance[i])
    error.rate[i] = (1.0 - L_rate) * innovation
    error.disturbance[i] += L_disturbance * innovation
    return innovation


@apart
def begin_estimator(estimator, squares, frames, dt):
    """Begin to estimate without knowledge: w = 0, P = diag(prior).

    noise_i = _CORRELATED squares_i / frames_i, (rad/s)2, from sums of squares of the innovation over `frames`
    (3,) in health; its root is at least _LEAST_NOISE_RAD_S2 dt before the factor; dt s.
    """
    estimator.active = 1
    N = estimator.parameters.size
    n = estimator.parameters.size - 3 * _SIGNALS
    estimator.P[:] = 0.0
    estimator.parameters[:] = 0.0
    for j in range(N):
        spread = _THETA_STD if j < n else _A_STD[(j - n) % _SIGNALS]
        estimator.P[j, j] = estimator.prior[j] = spread * spread
    least = _LEAST_NOISE_RAD_S2 * dt
    for i in range(3):
        estimator.noise[i] = _CORRELATED * max(squares[i] / max(frames[i], 1.0), least * least)
    for error in estimator.errors:
        error.rate[:] = 0.0
        error.disturbance[:] = 0.0


@apart
def estimate(estimator, innovation, L_rate, L_disturbance, dt, x, y, effectiveness, moments):
    """Update w and P with the innovation of all axes (3,) rad/s, axis by axis:

        P_jj <- min(P_jj + prior_j dt / FORGOTTEN_S, max(P_jj, prior_j))        old knowledge fades
        for each axis i
            z = innovation_i + observed((effectiveness - 1)' moments_i),    h = observed(moments_i, y)
            `update` with z = h' w + noise
        w <- w - P_s (w_s - limited(w_s)) / P_ss        for each surface s with w_s beyond [-1, 0]

    observed: `observer_response`, with L_rate 1 and L_disturbance 1/s (3,), the observer's gains.
    x (3,) rad/s, y: measured; effectiveness (n,): that the law assumes; moments (3, n) rad/s2: of healthy
    surfaces.
    """
    n = effectiveness.size
    h = estimator.h
    signal = estimator.signal
    prior = estimator.prior
    P = estimator.P
    w = estimator.parameters
    errors = estimator.errors
    for j in range(h.size):
        P[j, j] = min(P[j, j] + prior[j] * dt / _FORGOTTEN_S, max(P[j, j], prior[j]))
    signal[0] = y[ALPHA]
    signal[1] = y[BETA]
    copy(x, signal[2:])
    for i in range(3):
        L = L_rate[i]
        M = L_disturbance[i]
        assumed = 0.0
        h[:] = 0.0
        for s in range(n):
            assumed += (effectiveness[s] - 1.0) * moments[i, s]
            h[s] = observer_response(errors[s], i, moments[i, s], L, M, dt)
        for j in range(_SIGNALS):
            h[n + i * _SIGNALS + j] = observer_response(errors[n + j], i, signal[j], L, M, dt)
        z = innovation[i] + observer_response(errors[n + _SIGNALS], i, assumed, L, M, dt)
        update(estimator, z, estimator.noise[i])
    for s in range(n):
        beyond = w[s] - min(max(w[s], -1.0), 0.0)
        if beyond != 0.0:
            for j in range(h.size):
                w[j] -= P[j, s] * (beyond / P[s, s])


@kernel
def update(estimator, z, noise):
    """One step of recursive least squares, for z = h' w + noise, rad/s; noise: its variance, (rad/s)2.

        w <- w + P h r / v,    P <- P - P h h' P / v,    r = z - h' w,    v = noise + h' P h

    w, h (N,), P (N, N); Ph: P h.
    """
    w = estimator.parameters
    h = estimator.h
    P = estimator.P
    Ph = estimator.Ph
    v = noise
    r = z
    for j in range(h.size):
        Ph[j] = 0.0
        for k in range(h.size):
            Ph[j] += P[j, k] * h[k]
        v += h[j] * Ph[j]
        r -= h[j] * w[j]
    for j in range(h.size):
        w[j] += Ph[j] / v * r
        for k in range(h.size):
            P[j, k] -= Ph[j] * Ph[k] / v


@kernel
def effectiveness_of(estimator, s):
    """Effectiveness of surface s, 1 + theta_s, 0 to 1."""
    return min(max(1.0 + estimator.parameters[s], 0.0), 1.0)
