"""Instruments: every error against its definition, its statistics, and that it repeats."""

import numpy as np
import pytest

from beaver_ftc.loop.assembly import configure_design
from beaver_ftc.plant.instruments import (
    AX,
    N_SENSORS,
    NOISE_LIMIT_SIGMA,
    PSI,
    SIGNALS,
    read_all,
    read_forces,
)
from beaver_ftc.scenario.schema import Scenario

TRAVEL_RAD = np.array([[-0.52, -0.49, -0.44, -0.1], [0.52, 0.49, 0.44, 1.03]])


def samples(truth, seed=1, rate_hz=100, **sensors):
    """Readings (n, 7) of truth (n, 7)."""
    scenario = Scenario.model_validate({"name": "x", "seed": seed, "rate_hz": rate_hz, "sensors": sensors})
    instruments = configure_design(scenario, TRAVEL_RAD)["instruments"][0]
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


@pytest.mark.parametrize("rate_hz", [100, 900])
def test_each_signal_has_a_delay_of_its_own(rate_hz):
    """At 900 Hz they keep more samples than most flights have room for."""
    delays_s = np.array([0.05, 0.0, 1.0, 0.017, 0.0, 0.6, 0.2])
    names = [name for name, delay_s in zip(SIGNALS, delays_s, strict=True) if delay_s]
    ramps = still(1200) + np.arange(1200)[:, None] / rate_hz
    late = samples(ramps, rate_hz=rate_hz, **{n: {"delay_s": delays_s[SIGNALS.index(n)]} for n in names})
    assert ramps[1100:] - late[1100:] == pytest.approx(np.tile(delays_s, (100, 1)), abs=1e-9)
    assert late[0] == pytest.approx(ramps[0])


def test_lost_samples_are_as_many_as_declared_and_hold_the_last():
    n = 20_000
    ramp = still(n)
    ramp[:, 2] = np.arange(n)
    readings = samples(ramp, r={"dropout_share": 0.3})[:, 2]
    held = np.diff(readings) == 0
    assert held.mean() == pytest.approx(0.3, abs=5 * np.sqrt(0.21 / n))
    assert readings[0] == 0.0
    assert (readings <= ramp[:, 2]).all()


def forces_read(truth, seed=1, **sensors):
    """Readings of accelerometers (n, 3), and of the others beside them (n, 13), of truth (n, 16)."""
    scenario = Scenario.model_validate({"name": "x", "seed": seed, "rate_hz": 100, "sensors": sensors})
    instruments = configure_design(scenario, TRAVEL_RAD)["instruments"][0]
    readings = truth.copy()
    for row in readings:
        read_all(instruments, row)
        read_forces(instruments, row)
    return readings[:, AX:], readings[:, :AX]


def in_flight(n):
    return np.hstack([still(n), np.tile([0.1, 0.05, 1.0, 1800.0, 1800.0, 20.0, 0.5, 0.2, -9.8], (n, 1))])


def test_accelerometers_have_the_errors_of_the_others():
    n = 20_000
    noise = forces_read(in_flight(n), ay={"noise_std_mps2": 0.3})[0][:, 1] - 0.2
    assert noise.std() == pytest.approx(0.3, rel=5 / np.sqrt(2 * n))
    assert np.abs(noise).max() <= NOISE_LIMIT_SIGMA * 0.3
    errors = {"ax": {"scale_error": 0.1}, "ay": {"bias_mps2": -0.7}, "az": {"quantum_mps2": 4.0}}
    assert forces_read(in_flight(1), **errors)[0][0] == pytest.approx([0.55, -0.5, -8.0])
    ramp = in_flight(400)
    ramp[:, AX] = 0.03 * np.arange(400)
    assert ramp[399, AX] - forces_read(ramp, ax={"delay_s": 0.037})[0][399, 0] == pytest.approx(3.0 * 0.037)
    exact, others = forces_read(in_flight(3), p={"noise_std_deg_s": 1.0})
    assert (exact == in_flight(3)[:, AX:]).all()
    assert (others[:, 0] != 0.1).all()


def headings(truth_deg, **psi):
    """What a heading reads, deg, along these."""
    row = np.concatenate([still(1)[0], np.zeros(N_SENSORS - len(SIGNALS))])
    truth = np.tile(row, (len(truth_deg), 1))
    truth[:, PSI] = np.radians(np.mod(truth_deg, 360.0))
    return np.degrees(samples(truth, psi=psi)[:, PSI])


def apart_deg(one, other):
    """The short way round."""
    return (np.asarray(one) - other + 180.0) % 360.0 - 180.0


@pytest.mark.parametrize("psi", [{"bandwidth_rad_s": 20.0}, {"delay_s": 0.037}])
def test_a_heading_lags_the_short_way_past_north(psi):
    """Turning on either side of north it is late by the same angle as anywhere."""
    turn_deg = 0.3 * np.arange(400.0)
    anywhere = turn_deg - headings(turn_deg + 30.0, **psi) + 30.0
    past_north = -apart_deg(headings(turn_deg - 60.0, **psi), turn_deg - 60.0)
    assert past_north == pytest.approx(anywhere, abs=1e-9)
    assert anywhere[-1] > 1.0
