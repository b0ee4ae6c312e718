"""The whitening filter against a textbook Kalman filter, the Riccati equation, and what it is for."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from innovations import PlainKalman, block_of, filter_all

from samples import samples

TOGETHER = np.array([[0.04, 0.006], [0.006, 0.003]])
CASES = {  # drift, noise, what a drift keeps of itself in a frame
    "one axis": (np.array([[0.02]]), [3e-4], 1.0),
    "two axes": (TOGETHER, [3e-4, 8e-4], 1.0),
    "a drift that returns": (TOGETHER, [3e-4, 8e-4], 0.98),
}


def _whitened(block, innovations, dt):
    out = np.zeros((len(innovations), 2))
    filter_all(block, innovations, dt, out)
    return out[:, : block["n"]]


def _parts(block):
    n = int(block["n"])
    return {name: np.array(block[name][:n, :n]) for name in ("P_xx", "P_xd", "P_dd", "S_inv", "K_x", "K_d")}


@settings(max_examples=samples(25))
@given(st.sampled_from(sorted(CASES)), st.sampled_from([20.0, 100.0, 1000.0]), st.integers(0, 2**31))
def test_it_is_the_textbook_filter_while_noise_and_drift_change(case, rate_hz, seed):
    rng, dt = np.random.default_rng(seed), 1 / rate_hz
    drift, noise, keep = CASES[case]
    block, n = block_of(drift, noise, jitter=0.05, keep=keep), len(drift)
    plain = PlainKalman(block, dt)
    rate = np.zeros(n)
    for _ in range(60):
        root = rng.normal(size=(n, n))
        block["Q_d"][:n, :n] = 0.1 * root @ root.T
        block["Q_x"][:n] = rng.uniform(0, 0.01, n)
        plain.Q[:n, :n] = np.diag(dt**2 * block["Q_x"][:n])
        plain.Q[n:, n:] = dt * block["Q_d"][:n, :n]
        acceleration = rng.normal(size=n)
        rate = rate + dt * acceleration
        expected = plain.step(rate)
        assert _whitened(block, acceleration[None], dt)[0] == pytest.approx(expected, rel=1e-7, abs=1e-13)
        parts = _parts(block)
        assert np.linalg.inv(parts["S_inv"]) == pytest.approx(plain.S, rel=1e-8)
        assert np.vstack([parts["K_x"], parts["K_d"]]) == pytest.approx(plain.K, rel=1e-7, abs=1e-9)
        assert parts["P_dd"] == pytest.approx(plain.P[n:, n:], rel=1e-7, abs=1e-12)
        assert parts["P_xd"] == pytest.approx(plain.P[:n, n:], rel=1e-7, abs=1e-14)
