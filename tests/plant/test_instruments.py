"""Instruments: every error against its definition, its statistics, and that it repeats."""

import numpy as np
import pytest

from beaver_ftc.documents.errors import BadInput
from beaver_ftc.loop.assembly import assemble
from beaver_ftc.plant.instruments import NOISE_LIMIT_SIGMA, SIGNALS, read_all
from beaver_ftc.scenario.schema import Scenario

TRAVEL_RAD = np.array([[-0.52, -0.49, -0.44, -0.1], [0.52, 0.49, 0.44, 1.03]])


def samples(truth, seed=1, rate_hz=100, **sensors):
    """Readings (n, 7) of truth (n, 7)."""
    scenario = Scenario.model_validate({"name": "x", "seed": seed, "rate_hz": rate_hz, "sensors": sensors})
    instruments = assemble(scenario, np.zeros(4), TRAVEL_RAD)["instruments"][0]
    readings = truth.copy()
    for row in readings:
        read_all(instruments, row)
    return readings


def still(n):
    return np.tile([0.1, -0.2, 0.05, 0.1, 0.02, 45.0, 1000.0], (n, 1))


def test_noise_has_the_declared_deviation_is_white_and_cut_off():
    n = 200_000
    noise = samples(still(n), q={"noise_std_deg_s": 2.0})[:, 1] + 0.2
    sigma = np.radians(2.0)
    assert noise.std() == pytest.approx(sigma, rel=5 / np.sqrt(2 * n))
    assert abs(noise.mean()) < 5 * sigma / np.sqrt(n)
    assert abs(np.mean(noise[1:] * noise[:-1])) < 5 * sigma**2 / np.sqrt(n)
    assert 0.9 * NOISE_LIMIT_SIGMA * sigma < np.abs(noise).max() <= NOISE_LIMIT_SIGMA * sigma
    normal = np.mean(np.abs(noise) < sigma)
    assert normal == pytest.approx(0.6827, abs=0.006)


def test_signals_have_noise_of_their_own():
    readings = samples(still(20_000), p={"noise_std_deg_s": 1.0}, alpha={"noise_std_deg": 1.0})
    assert abs(np.corrcoef(readings[:, 0], readings[:, 3])[0, 1]) < 0.05
    assert (readings[:, 1] == -0.2).all()


def test_seeds_repeat_and_differ():
    noisy = {"V": {"noise_std_mps": 1.0}}
    first, again, other = (samples(still(50), seed=s, **noisy) for s in (7, 7, 8))
    assert (first == again).all()
    assert (first[:, 5] != other[:, 5]).all()


def test_slope_bias_and_resolution():
    readings = samples(still(1), p={"scale_error": 0.1}, beta={"bias_deg": 3.0}, qdyn={"quantum_pa": 300.0})[
        0
    ]
    assert readings[SIGNALS.index("p")] == pytest.approx(0.11)
    assert readings[SIGNALS.index("beta")] == pytest.approx(0.02 + np.radians(3.0))
    assert readings[SIGNALS.index("qdyn")] == 900.0


def test_a_ramp_comes_out_late_by_delay_and_lag():
    """Of a ramp, a lag of bandwidth w is late by exp(-w dt) dt / (1 - exp(-w dt)) in discrete time."""
    dt, w, slope = 0.01, 20.0, 3.0
    ramp = still(400)
    ramp[:, 0] = slope * dt * np.arange(400)
    late = samples(ramp, p={"delay_s": 0.037})
    assert ramp[399, 0] - late[399, 0] == pytest.approx(slope * 0.037)
    lagged = samples(ramp, p={"bandwidth_rad_s": w})
    keep = np.exp(-w * dt)
    assert ramp[399, 0] - lagged[399, 0] == pytest.approx(slope * dt * keep / (1 - keep), rel=1e-6)


def test_lost_samples_are_as_many_as_declared_and_hold_the_last():
    n = 20_000
    ramp = still(n)
    ramp[:, 2] = np.arange(n)
    readings = samples(ramp, r={"dropout_share": 0.3})[:, 2]
    held = np.diff(readings) == 0
    assert held.mean() == pytest.approx(0.3, abs=5 * np.sqrt(0.21 / n))
    assert readings[0] == 0.0
    assert (readings <= ramp[:, 2]).all()


def test_the_first_sample_is_never_lost():
    """There is none before it to hold."""
    truth = still(3) + np.arange(3)[:, None]
    for seed in range(20):
        readings = samples(truth, seed=seed, p={"dropout_share": 0.9}, V={"dropout_share": 0.9})
        assert readings[0] == pytest.approx(truth[0])


def test_a_delay_longer_than_the_line_is_refused():
    given = {"name": "x", "rate_hz": 1000, "substeps": 2, "sensors": {"p": {"delay_s": 1.0}}}
    with pytest.raises(BadInput, match=r"sensors\.p\.delay_s"):
        assemble(Scenario.model_validate(given), np.zeros(4), TRAVEL_RAD)
