"""Errors of the air data: what they do where the aircraft flies, by moving each reading a little."""

import numpy as np
import pytest
from innovations import Detector, misread
from statistics_of import Statistical

from beaver_ftc.design.model import KW_TO_DPT, response
from beaver_ftc.diagnosis.detection.likelihood import N_INPUT_READINGS

BIASES = {
    "alpha": {"bias_deg": 0.5},
    "beta": {"bias_deg": 0.5},
    "V": {"bias_mps": 0.4},
    "qdyn": {"bias_pa": 17.0},
}
STEADY = (np.radians(0.5), np.radians(0.5), 0.4, 17.0)
STEPS = (1e-5, 1e-5, 1e-4, 1e-2, 1e-3)
POWER = 4
STATES = [
    ((0.0, 0.0, 0.0), (0.1, 0.02, 45.0, 1036.0, 0.3), (0.0, 0.0, 0.0, 0.0)),
    ((-0.05, -0.8, -0.5), (-0.13, 0.15, 23.4, 251.0, 3.5), (0.1, 0.47, -0.44, 0.2)),  # slow and slipping
    ((0.3, 0.2, 0.1), (0.25, -0.1, 30.0, 500.0, 1.2), (-0.2, -0.1, 0.3, 0.0)),
]


def rates(design, x, y, u):
    f, G = np.zeros(3), np.zeros((3, 4))
    response(design, x, y, f, G)
    return f + G @ u


def moved(design, x, y, u, which, power_error_kw_per_density_ratio):
    """What the accelerations change by per unit of a reading, by central differences."""
    there = []
    for error in (STEPS[which], -STEPS[which]):
        told = misread(y, which, error, power_error_kw_per_density_ratio) if which < POWER else y.copy()
        told[4] += KW_TO_DPT * error / (y[3] * y[2]) if which == POWER else 0.0
        there.append(rates(design, x, told, u))
    return (there[0] - there[1]) / (2 * STEPS[which])


def at(state, **bounds):
    """A detector that has looked at a state, its design model, and the state as arrays."""
    alone = Detector(100.0, bounds=bounds)
    design, flown_there = alone.frames[0]["prediction"]["design"], tuple(map(np.array, state))
    Statistical.prepare(alone.detector, alone.fdi, design, *flown_there)
    return alone, design, flown_there


@pytest.mark.parametrize("state", STATES)
def test_a_steady_error_is_a_constant_times_what_it_moves_now(state):
    alone, design, flown_there = at(state, sensors=BIASES)
    declared_errors = alone.fdi["bound"]["declared_errors"]
    for which in range(N_INPUT_READINGS):
        found = moved(design, *flown_there, which, float(declared_errors["kw1"]))
        error = STEADY[which] if which < POWER else float(declared_errors["kw0"])
        for block in alone.blocks:
            n, axes = int(block["n_Z"]) - N_INPUT_READINGS + which, block["axes"][: block["n"]]
            assert block["tol"][n] == pytest.approx(error)
            assert block["regressor"][n, : len(axes)] == pytest.approx(found[axes], rel=1e-5, abs=1e-9)


@pytest.mark.parametrize("state", STATES)
def test_noise_is_jitter_as_large_as_it_is_now(state):
    alone, design, flown_there = at(state, sensors="tactical-grade")
    thin, detector = (
        float(alone.fdi["bound"]["declared_errors"]["kw1"]),
        alone.detector,
    )
    expected = detector["noise"]["Q0"].copy()
    for which in range(N_INPUT_READINGS):
        expected += (moved(design, *flown_there, which, thin) * detector["noise"]["sigma"][which]) ** 2
    assert detector["noise"]["Q"] == pytest.approx(expected, rel=1e-5)
    for block in alone.blocks:
        axes = block["axes"][: block["n"]]
        assert block["Q_x"][: len(axes)] == pytest.approx(expected[axes], rel=1e-5)


def test_what_the_vanes_show_of_the_gust_is_taken_off_the_innovation():
    """Both moved by the same: whatever is kept of the frames stays as it is."""
    gust, rng = np.array([0.05, -0.03, 0.02]), np.random.default_rng(1)
    innovations, Gu = rng.normal(0.0, 0.1, (2, 3)), rng.normal(size=(2, 3, 4))
    kept = []
    for mean in (np.zeros(3), gust):
        alone = Detector(100.0, bounds={"turbulence": "light"})
        alone.detector["gust"]["output"]["acc_mean"] = mean
        alone.watch(innovations + mean, Gu, np.ones(2))
        kept.append([block["tests"] for block in alone.blocks])
    still, moving = kept
    assert any(np.abs(lane["s"]).max() > 0.01 for lane in still)
    for one, other in zip(still, moving, strict=True):
        for name in one.dtype.names:
            assert other[name] == pytest.approx(one[name], abs=1e-9), name
