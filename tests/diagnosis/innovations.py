"""Innovations as the statistical detector is told they are, and the same statistics by plain linear algebra.

    nu[k] = d[k] + jitter w[k] + (n[k+1] - n[k]) / dt,  d[k+1] = keep d[k] + sqrt(drift dt) v[k]

with w, v, and n over its own standard deviation, independent and standard normal.
"""

import numpy as np
from scipy.signal import lfilter

from beaver_ftc.compiled import copy, kernel
from beaver_ftc.diagnosis.detection import likelihood, whitening
from beaver_ftc.diagnosis.detection.blocks import (
    N_GROUP_TESTS,
    N_SLOTS,
    SIGN_OF_KIND,
    USUAL_HYPOTHESES,
    BlockCapacity,
    block_dtype,
)


def block_of(drift, noise, jitter=0.0, prior=1.0, keep=1.0):
    """A block as a record, with as many axes as `drift` (n, n) has. Standard deviations noise and jitter."""
    n = len(drift)
    block = np.zeros(1, block_dtype(BlockCapacity(105, USUAL_HYPOTHESES))).view(np.recarray)[0]
    block["n"], block["axes"][:n], block["a"] = n, range(n), keep
    block["Q_d"][:n, :n] = drift
    block["R_y"][:n], block["Q_x"][:n] = np.square(noise), np.square(jitter)
    block["P_xx"][:n, :n] = np.diag(block["R_y"][:n])
    block["P_dd"][:n, :n] = prior**2 * np.eye(n)
    return block


def with_hypotheses(block, *kinds, tolerance=()):
    """The same with hypotheses of these kinds, and regressors of these tolerances."""
    block["n_h"], block["n_Z"] = len(kinds), len(tolerance)
    block["tol"][: len(tolerance)] = tolerance
    for h, kind in enumerate(kinds):
        block["hypothesis"][h]["kind"] = kind
        group, lane = divmod(h * N_SLOTS, N_GROUP_TESTS)
        block["tests"]["sign"][group, lane : lane + N_SLOTS] = SIGN_OF_KIND[kind]
    return block


def by_onset(block, name):
    """What the onset tests keep under a name, a copy, (..., slots, hypotheses)."""
    kept = np.concatenate(list(block["R"] if name == "R" else block["tests"][name]), axis=-1)
    return kept.reshape(*kept.shape[:-1], -1, N_SLOTS).swapaxes(-1, -2)


def drawn(block, frames, dt, rng, start=0.0):
    """Innovations (frames, n) rad/s2; start: standard deviation of the drift as they begin."""
    n = int(block["n"])
    root = np.linalg.cholesky(block["Q_d"][:n, :n] + 1e-300 * np.eye(n))
    steps = np.sqrt(dt) * rng.standard_normal((frames, n)) @ root.T
    steps[0] = start * rng.standard_normal(n)
    gyros = np.sqrt(block["R_y"][:n]) * rng.standard_normal((frames + 1, n))
    white = np.sqrt(block["Q_x"][:n]) * rng.standard_normal((frames, n))
    drifts = lfilter([1.0], [1.0, -float(block["a"])], steps, axis=0)
    return drifts + white + np.diff(gyros, axis=0) / dt


@kernel
def bounded_all(block, d, signatures, onset, dt):
    """Show a block an uncertainty d (k, n) up to 0.02 rad/s2, and from `onset` on signatures (k, h, n)."""
    block.eta[:] = 0.02
    for k in range(len(d)):
        whitening.advance_covariance(block, dt)
        copy(d[k], block.nu[: block.n])
        whitening.whiten_step(block, block.state, block.nu, dt, block.g)
        for h in range(block.n_h):
            copy(signatures[k, h], block.hypothesis[h].signature[: block.n])
        likelihood.bound_responses(block, dt)
        if k >= onset:
            likelihood.accumulate_evidence(block, dt, 1.0)
