"""A Kalman filter that turns innovations into white noise of known covariance.

    x[k+1] = x[k] + dt (F[k] + d[k] + phi[k])      d[k+1] = a d[k] + drift      measured: x + gyro noise

F is the design model, d what moves slowly beside it: the air's rotation, uncertainty that is merely bounded,
unknown constants. phi is a fault. With a = 1 the drift is a random walk: whatever is constant has no
part in the whitened innovation, and whatever drifts less than declared has less. The filter is linear: a
fault, or the error of a coefficient, passes through it by itself, and that is what the innovation is
compared with (likelihood.py).

    g = e + dt (nu - d)      e <- g - K_x g      d <- a d + K_d g

with nu the innovation of the frame as acceleration and e what is left of the rate.
"""

from beaver_ftc.compiled import kernel


@kernel
def invert(n, S):
    """Replace the leading n x n part of a symmetric S (2, 2), n at most 2, by its inverse."""
    if n == 1:
        S[0, 0] = 1.0 / S[0, 0]
        return
    across = 0.5 * (S[0, 1] + S[1, 0])
    determinant = S[0, 0] * S[1, 1] - across * across
    S[0, 0], S[1, 1] = S[1, 1] / determinant, S[0, 0] / determinant
    S[0, 1] = S[1, 0] = -across / determinant


@kernel
def spread_uncertainty(block, dt):
    """Advance the covariances over a frame in which the drift acts; `S_inverse` holds S for now."""
    P_xx, P_xd, P_dd, S = block.P_xx, block.P_xd, block.P_dd, block.S_inverse
    for i in range(block.n):
        for j in range(block.n):
            P_xx[i, j] += dt * (P_xd[i, j] + P_xd[j, i]) + dt * dt * P_dd[i, j]
        P_xx[i, i] += dt * dt * block.jitter[i]
    for i in range(block.n):
        for j in range(block.n):
            P_xd[i, j] = block.keep * (P_xd[i, j] + dt * P_dd[i, j])
            P_dd[i, j] = block.keep * block.keep * P_dd[i, j] + dt * block.drift[i, j]
            S[i, j] = P_xx[i, j]
        S[i, i] += block.noise[i]


@kernel
def gains(block):
    """Fill K_x and K_d (n, n) from the covariances and `S_inverse`."""
    for i in range(block.n):
        for j in range(block.n):
            of_rate, of_drift = 0.0, 0.0
            for k in range(block.n):
                of_rate += block.P_xx[i, k] * block.S_inverse[k, j]
                of_drift += block.P_xd[k, i] * block.S_inverse[k, j]
            block.K_x[i, j], block.K_d[i, j] = of_rate, of_drift


@kernel
def learn(block):
    """Take off the covariances what is learnt from the measurement."""
    n = block.n
    p00, p01 = block.P_xx[0, 0], block.P_xx[0, 1]
    p10, p11 = block.P_xx[1, 0], block.P_xx[1, 1]
    c00, c01 = block.P_xd[0, 0], block.P_xd[0, 1]
    c10, c11 = block.P_xd[1, 0], block.P_xd[1, 1]
    for i in range(n):
        k0, k1 = block.K_d[i, 0], block.K_d[i, 1]
        block.P_dd[i, 0] -= k0 * c00 + k1 * c10
        block.P_dd[i, 1] -= k0 * c01 + k1 * c11
        k0, k1 = block.K_x[i, 0], block.K_x[i, 1]
        block.P_xx[i, 0] -= k0 * p00 + k1 * p10
        block.P_xx[i, 1] -= k0 * p01 + k1 * p11
        block.P_xd[i, 0] -= k0 * c00 + k1 * c10
        block.P_xd[i, 1] -= k0 * c01 + k1 * c11


@kernel
def advance(block, dt):
    """Bring gains and covariances to the frame just measured; dt s."""
    spread_uncertainty(block, dt)
    invert(block.n, block.S_inverse)
    gains(block)
    learn(block)


@kernel
def whiten(block, state, acceleration, dt, out):
    """Pass one frame of an acceleration through the filter.

    state (4,): what is left of the rates, rad/s, and the drifts, rad/s2, advanced in place. acceleration (2,)
    rad/s2; out (2,) rad/s: the whitened response, of covariance S were it the innovation's.
    """
    for i in range(block.n):
        out[i] = state[i] + dt * (acceleration[i] - state[2 + i])
    for i in range(block.n):
        kept, drift = out[i], 0.0
        for j in range(block.n):
            kept -= block.K_x[i, j] * out[j]
            drift += block.K_d[i, j] * out[j]
        state[i] = kept
        state[2 + i] = block.keep * state[2 + i] + drift
