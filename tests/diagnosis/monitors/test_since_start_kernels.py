"""Errors that were there from the first sample on, in flights by rotation matrices: none is ever ruled out.

The readings are sound but for one, which is off from the first sample on by a constant, by a scale, or by an
error that swings slowly.
"""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from true_flight import DOWN, UNITS, new_monitor, true_flight

from beaver_ftc.diagnosis.monitors import initial_errors, redundancy
from beaver_ftc.diagnosis.monitors.redundancy import (
    AIRSPEED,
    ALPHA,
    BETA,
    H_AIRSPEED,
    H_ALPHA,
    H_BETA,
    H_PHI,
    H_THETA,
    N_INITIAL,
    N_TESTS,
    QDYN,
)
from beaver_ftc.diagnosis.monitors.sensor_monitor import INITIAL_SENSOR
from beaver_ftc.plant.instruments import ALTITUDE, AX, N_SENSORS, PHI, SENSORS

SAMPLES = 100
SHOWN = {H_ALPHA: 0.1, H_BETA: 0.12, H_PHI: 0.1, H_THETA: 0.1}


def samples(signal, h):
    """Each sample's number, the hypotheses, and the tests that have been beyond their bound by then."""
    monitor, exceeded = new_monitor(h, 0.05 * UNITS, 0.01 * UNITS), np.zeros(N_TESTS, int)
    red, initial = monitor["redundancy"], monitor["initial_errors"]
    redundancy.start_tests(red, signal[0], signal[0, AX:])
    initial_errors.start_bounds(initial, signal[0])
    for k in range(1, len(signal)):
        redundancy.run_tests(red, signal[k], 0)
        initial_errors.update_bounds(red, initial, signal[k])
        exceeded |= red["test"]["ratio"] > 1.0
        initial_errors.latch_refuted(red, initial, exceeded)
        yield k, initial, exceeded
        redundancy.store_sample(red, signal[k], signal[k, AX:])


@pytest.mark.parametrize("kind", ["constant", "scale", "swinging"])
@pytest.mark.parametrize("i", range(N_INITIAL), ids=lambda i: SENSORS[INITIAL_SENSOR[i]])
@pytest.mark.parametrize(("seed", "h", "swiftly"), [(1, 0.01, True), (2, 0.05, False)])
def test_what_is_broken_from_the_start_is_never_refuted(seed, h, swiftly, i, kind):
    rng = np.random.default_rng([seed, i])
    signal, sensor = true_flight(np.random.default_rng(seed), SAMPLES, h, swiftly), INITIAL_SENSOR[i]
    true = signal[:, sensor].copy()
    for size in rng.uniform(0.8, 1.2) * np.array([-0.4, 0.03, 0.5]):
        x = size * true[0] if i == H_AIRSPEED else size
        swing = 1.0 + 0.1 * np.sin(0.7 * h * np.arange(SAMPLES))
        signal[:, sensor] = true + {"constant": x, "scale": 1.6 * size * true, "swinging": x * swing}[kind]
        reading, moved = signal[:, sensor], set()
        off = abs(reading / true - 1.0 if i == H_AIRSPEED else 2.0 * np.sin(0.5 * (reading - true)))
        for k, initial, _ in samples(signal, h):
            assert off[k] <= (initial["e"][i] + initial["d"][i]) * (1.0 + 1e-9), (size, k)
            moved |= set(np.flatnonzero(initial["refuted"][i]).tolist())
        assert all(initial_errors.REACTS[i, j] for j in moved), (size, moved)
        assert kind != "constant" or not moved


def test_a_sound_flight_shows_each_reading_to_be_sound():
    """None is beyond its bound, and none can be off by more than a little any more."""
    signal = true_flight(np.random.default_rng(5), SAMPLES, 0.01)
    *_, (_, initial, exceeded) = samples(signal, 0.01)
    assert not exceeded.any()
    for i, little in SHOWN.items():
        assert initial["e"][i] < little < initial["e_start"][i], i
    assert initial["e"][H_AIRSPEED] < 0.2


def test_in_steady_flight_nothing_shows_the_sideslip_or_the_airspeed():
    """They stay as unknown as at the first sample; the attitude is shown by gravity."""
    signal = np.repeat(true_flight(np.random.default_rng(6), 1, 0.01), SAMPLES, axis=0)
    turn = Rotation.from_euler("ZYX", signal[0, PHI : PHI + 3][::-1])
    signal[:, :3], signal[:, AX:] = 0.0, -turn.inv().apply(DOWN)
    V, alpha, beta = signal[0, [AIRSPEED, ALPHA, BETA]]
    body = V * np.array([np.cos(alpha) * np.cos(beta), np.sin(beta), np.sin(alpha) * np.cos(beta)])
    signal[:, ALTITUDE] -= 0.01 * turn.apply(body)[2] * np.arange(SAMPLES)
    *_, (_, initial, exceeded) = samples(signal, 0.01)
    assert not exceeded.any()
    e, first = initial["e"], initial["e_start"]
    assert (e[H_BETA], e[H_AIRSPEED]) == (first[H_BETA], first[H_AIRSPEED])
    assert max(e[H_PHI], e[H_THETA]) < 0.1


@pytest.mark.parametrize(("V", "true"), [(45.0, 45.0), (20.0, 45.0), (90.0, 45.0)])
def test_what_the_airspeed_may_be_off_by_follows_from_the_dynamic_pressure(V, true):
    """At 1000 m of the standard the density is 1.1116 kg/m3; a quarter more or less is the weather."""
    signal, initial = np.zeros(N_SENSORS), new_monitor(0.01)["initial_errors"]
    signal[[AIRSPEED, ALTITUDE, QDYN, ALPHA]] = V, 1000.0, 0.5 * 1.1116 * true**2, -0.2
    initial_errors.start_bounds(initial, signal)
    ends = V / true * np.sqrt(1.25) - 1.0, 1.0 - V / true * np.sqrt(0.75)
    assert initial["e"][[H_AIRSPEED, H_ALPHA]] == pytest.approx([max(ends), 2.0 * np.sin(0.45)], rel=1e-3)
