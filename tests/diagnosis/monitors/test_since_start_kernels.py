"""Errors that were there from the first sample on, in flights by rotation matrices: none is ever ruled out.

The readings are sound but for one, which is off from the first sample on by a constant, by a scale, or by an
error that swings slowly.
"""

import numpy as np
import pytest
from true_flight import UNITS, compared, new_monitor, true_flight

from beaver_ftc.diagnosis.monitors import initial_errors
from beaver_ftc.diagnosis.monitors.initial_errors import (
    EVIDENCE,
    H_AIRSPEED,
    H_ALPHA,
    H_BETA,
    H_PHI,
    H_THETA,
    INITIAL_SENSOR,
    N_INITIAL,
    PHI_IN_FLOW,
    THETA_IN_FLOW,
)
from beaver_ftc.diagnosis.monitors.numbering import I_AIRSPEED, RPM_TEST
from beaver_ftc.plant.instruments import SENSORS

SAMPLES = 100
SHOWN = {H_ALPHA: 0.1, H_BETA: 0.12, H_PHI: 0.1, H_THETA: 0.1}


def judged(readings, h):
    """The hypotheses after each sample but the first; whether tests have exceeded their bounds by then."""
    monitor = new_monitor(h, 0.05 * UNITS, 0.01 * UNITS)
    for _ in compared(monitor, readings):
        yield monitor["initial"], monitor["tests"]["exceeded"]


@pytest.mark.parametrize("kind", ["constant", "scale", "swinging"])
@pytest.mark.parametrize("i", range(N_INITIAL), ids=lambda i: SENSORS[INITIAL_SENSOR[i]])
@pytest.mark.parametrize(
    ("seed", "h", "theta"), [(1, 0.01, (-0.2, 0.3)), (2, 0.05, (-0.2, 0.3)), (1, 0.01, (1.25, 1.35))]
)
def test_what_is_broken_from_the_start_is_never_refuted(seed, h, theta, i, kind):
    """Of the third flight, a part is steep."""
    rng, sensor = np.random.default_rng([seed, i]), INITIAL_SENSOR[i]
    signal = true_flight(np.random.default_rng(seed), SAMPLES, h, h < 0.05, theta)
    true = signal[:, sensor].copy()
    for size in rng.uniform(0.8, 1.2) * np.array([-0.4, 0.03, 0.5]):
        x = size * true[0] if i == H_AIRSPEED else size
        swing = 1.0 + 0.1 * np.sin(0.7 * h * np.arange(SAMPLES))
        signal[:, sensor] = true + {"constant": x, "scale": 1.6 * size * true, "swinging": x * swing}[kind]
        reading, moved = signal[:, sensor], set()
        off = abs(reading / true - 1.0 if i == H_AIRSPEED else 2.0 * np.sin(0.5 * (reading - true)))
        for k, (initial, _) in enumerate(judged(signal, h), 1):
            assert off[k] <= (initial["E"][i] + initial["dx"][i]) * (1.0 + 1e-9), (size, k)
            moved |= set(np.flatnonzero(initial["refuted"][i]).tolist())
        assert all(initial_errors.REACTS[i, j] for j in moved), (size, moved)
        assert kind != "constant" or not moved


def test_a_sound_flight_shows_each_reading_to_be_sound():
    """None is beyond its bound, and none can be off by more than a little any more."""
    signal = true_flight(np.random.default_rng(5), SAMPLES, 0.01)
    *_, (initial, exceeded) = judged(signal, 0.01)
    assert not exceeded.any()
    for i, little in SHOWN.items():
        assert initial["E"][i] < little < initial["E_start"][i], i
    assert initial["E"][H_AIRSPEED] < 0.2


# Largest effect of a small error on each test, over its bound H: at least this; 0 where H is of second order.
OF_H = np.array(
    [
        [0, 0, 0, 0, 0, 0, 0, 0.9, 0.7, 0, 0.9], [0, 0, 0, 0, 0, 0, 0.9, 0.8, 0.9, 0, 0.9],
        [0, 0, 0, 0, 0, 0, 0.7, 0.9, 0.8, 0, 0.9], [0.4, 0.9, 0.9, 0.09, 0.9, 0.9, 0.8, 0.4, 0.9, 0, 0.9],
        [0.9, 0.04, 0.1, 0.9, 0.3, 0.1, 0.9, 0.1, 0.4, 0, 0.9],
    ]
)  # fmt: skip
# Its effect on the tests of a row of EVIDENCE together, over C: in the middle of the samples at least this.
OF_C = [0.99, 0.99, 0.98, 0.98, 0.6, 0.98, 0.98, 0.9, 0.9, 0.9]


def test_a_small_error_has_the_effect_that_is_computed():
    """By the difference between a flight with the error and one without, in both senses of the error."""
    of_H, of_C = np.zeros((N_INITIAL, RPM_TEST)), [[] for _ in OF_C]
    for seed, x in ((3, 0.02), (4, -0.02)):
        sound = true_flight(np.random.default_rng(seed), SAMPLES, 0.01)
        without = [residual for _, residual in compared(new_monitor(0.01, 1e-3 * UNITS), sound)]
        for i, sensor in enumerate(INITIAL_SENSOR):
            readings, monitor = sound.copy(), new_monitor(0.01, 1e-3 * UNITS)
            readings[:, sensor] += x * (sound[0, sensor] if i == H_AIRSPEED else 1.0)
            initial = monitor["initial"]
            for k, (_, residual) in enumerate(compared(monitor, readings)):
                effect, V = abs((residual - without[k]) / x)[:RPM_TEST], readings[k, I_AIRSPEED]
                of_H[i] = np.maximum(of_H[i], (OF_H[i] > 0.0) * effect / (initial["H"][i] + 1e-12))
                for n, (h, first, last) in enumerate(EVIDENCE):
                    if h == i:
                        in_m_s = [1.0, V, V] if n in (PHI_IN_FLOW, THETA_IN_FLOW) else 1.0
                        shown = np.linalg.norm(effect[first : last + 1] * in_m_s)
                        of_C[n].append(shown / (abs(initial["C"][n]) + 1e-12))
    assert ((of_H >= OF_H) & (of_H <= 1.02)).all(), of_H
    middle = np.median(of_C, axis=1)
    assert ((middle >= OF_C) & (middle <= 1.05)).all(), middle
