"""What is declared is kept: rates of false alarms, bounded uncertainty, steady errors of coefficients."""

import numpy as np
import pytest
from innovations import LEVEL_FLIGHT, Detector, misread, surfaces_at_work

from beaver_ftc.aircraft import load
from beaver_ftc.aircraft.schema import MAX_TERMS
from beaver_ftc.design.fdc import MASS
from beaver_ftc.design.model import AXES, KW_TO_DPT, design_record, evaluate, regressors, response
from beaver_ftc.diagnosis import bounds as bound_kernels
from beaver_ftc.diagnosis.detection import statistical
from beaver_ftc.diagnosis.detection.likelihood import PITCH_BLOCK
from beaver_ftc.scenario.diagnosis import Bounds
from beaver_ftc.scenario.sensors import SIGNALS
from beaver_ftc.studies.engine.statistics import poisson
from flying import declared_in

NO_COUPLING = {"p": 0.0, "q": 0.0, "r": 0.0}
TACTICAL = {"sensors": "tactical-grade"}
SETTINGS = {
    "ideal gyros": {},
    "tactical-grade": TACTICAL,
    "tolerances": {**TACTICAL, "coefficients": 0.05},
    "light turbulence": {**TACTICAL, "turbulence": "light"},
    "severe turbulence, poor gyros": {"sensors": "consumer-grade", "turbulence": "severe"},
}


@pytest.mark.parametrize("per_h", [3600.0, 36000.0])
@pytest.mark.parametrize("rate_hz", [20.0, 100.0])
@pytest.mark.parametrize("setting", SETTINGS)
def test_false_alarms_are_no_more_than_declared_and_not_absurdly_fewer(setting, rate_hz, per_h):
    """On innovations as declared, a new flight after every alarm. The union bound costs a factor of six or
    so: tests of neighbouring onsets and frames go together."""
    alone = Detector(rate_hz, bounds=SETTINGS[setting])
    tests = statistical.count_tests(load())
    alone.detector["test"]["alarm_level"] = statistical.derive_alarm_level(per_h, rate_hz, tests)
    hours, rng = 240.0 / 3600.0, np.random.default_rng(8)
    frames = round(hours * 3600.0 * rate_hz)
    scores = alone.watch(alone.innovations(frames, rng), *surfaces_at_work(frames, rate_hz, rng), renew=True)
    seen = poisson(int(np.sum(scores > 1.0)), hours, 0.999)
    assert seen.high <= per_h
    assert seen.low > 0.02 * per_h


def _share(rate_hz, omega, eta_bar, declared=None, seconds=20, **bounds):
    """Largest share of the level that eta_bar sin(omega t) reaches, in roll and pitch, or yaw."""
    constant = dict.fromkeys(AXES, eta_bar)
    largest = 0.0
    for axes in ((0, 1), (2,)):
        for phase in (0.0, 0.8, 1.6, 2.4):
            alone = Detector(
                rate_hz,
                statistical={"uncertainty_rad_s": declared or omega},
                bounds={"constant_rad_s2": constant, "inertia_coupling": NO_COUPLING, **bounds},
            )
            frames = round(seconds * rate_hz)
            nu = np.zeros((frames, 3))
            nu[:, axes] = eta_bar * np.sin(omega * np.arange(frames)[:, None] / rate_hz + phase)
            scores = alone.watch(nu, *surfaces_at_work(frames, rate_hz, np.random.default_rng(1)))
            largest = max(largest, scores[round(2 * rate_hz) :].max())
    return largest


@pytest.mark.parametrize("omega", [15.0, 60.0])
@pytest.mark.parametrize("rate_hz", [20.0, 100.0, 500.0])
@pytest.mark.parametrize(
    ("sensors", "eta_bar"), [("ideal", 0.02), ("tactical-grade", 0.02), ("tactical-grade", 0.3)]
)
def test_bounded_uncertainty_takes_about_half_the_level_at_most(sensors, eta_bar, rate_hz, omega):
    assert 0.1 < _share(rate_hz, omega, eta_bar, sensors=sensors) < 0.6


def _moment_scale(design):
    """Angular accelerations of Cl, Cm and Cn at the flight condition, (3, 3)."""
    S, b, c, qdyn = design["S"], design["b"], design["c"], LEVEL_FLIGHT[1][3]
    Cl = np.array([design["Pl"], 0.0, design["Rl"]]) * qdyn * S * b
    Cm = np.array([0.0, design["Qm"], 0.0]) * qdyn * S * c
    Cn = np.array([design["Pn"], 0.0, design["Rn"]]) * qdyn * S * b
    return np.abs(np.column_stack([Cl, Cm, Cn]))


def _rates(design, x, y, u):
    f, G = np.zeros(3), np.zeros((3, 4))
    response(design, x, y, f, G)
    return f + G @ u


@pytest.mark.parametrize("sign", [-1.0, 1.0])
@pytest.mark.parametrize("signal", SIGNALS)
def test_a_scale_error_of_a_sensor_is_within_the_tolerances_it_is_turned_into(signal, sign):
    """Small rates about trim; what a gyro's bias does is constant, and the drift's part."""
    size = 0.02
    bounds = Bounds.model_validate({"sensors": {signal: {"scale_error": size}}})
    design = design_record()[0]
    i = SIGNALS.index(signal)
    _, y, _ = LEVEL_FLIGHT
    rng = np.random.default_rng(2)
    aircraft, table = load(), design["moments"]
    tolerance = bound_kernels.coefficient_bounds(declared_in(bounds, aircraft), design, MASS, y, np.zeros(4))
    axis = np.array([["Cl", "Cm", "Cn"].index(term.coefficient) for term in aircraft.moments])
    for _ in range(50):
        x, u = rng.uniform(-0.02, 0.02, 3), np.append(rng.uniform(-0.005, 0.005, 3), 0.0)
        seen = np.concatenate([x, y[:4]])
        truth = _rates(design, x, y, u)
        seen[i] *= 1 + sign * size
        if signal in AXES:
            truth[i] *= 1 + sign * size
        told = np.append(seen[3:], y[4])
        terms = np.zeros(MAX_TERMS)
        evaluate(table, seen[:3], told)
        regressors(table, table["power"], u, terms)
        parts = tolerance * np.abs(terms[: tolerance.size])
        explained = _moment_scale(design) @ np.bincount(axis, parts, 3)
        wrong = np.abs(truth - _rates(design, seen[:3], told, u))
        assert (wrong <= 1.05 * explained + 3e-4).all(), (wrong, explained)


def test_noise_of_other_sensors_and_of_deflections_is_part_of_the_noise():
    """By moving each signal by its standard deviation: what that does to f + G u is the jitter."""
    alone = Detector(100.0, bounds={**TACTICAL, "deflection_deg": 0.5})
    design = alone.frames[0]["prediction"]["design"]
    x, y, u = LEVEL_FLIGHT
    sensors = Bounds.model_validate(TACTICAL).sensors
    square, around = np.zeros(3), np.concatenate([x, y[:4]])
    thin_kw = float(alone.fdi["bound"]["declared_errors"]["kw1"])
    for i, name in enumerate(SIGNALS):
        moved, error = around.copy(), getattr(sensors, name).noise_bias_quantum[0]
        moved[i] += error if i < 3 else 0.0
        told = misread(y, i - 3, error, thin_kw) if i >= 3 else y
        square += (_rates(design, moved[:3], told, u) - _rates(design, x, y, u)) ** 2
    by_power = np.append(y[:4], y[4] + KW_TO_DPT * float(alone.detector["noise"]["sigma"][4]) / (y[3] * y[2]))
    square += (_rates(design, x, by_power, u) - _rates(design, x, y, u)) ** 2
    assert alone.detector["noise"]["Q"] == pytest.approx(square, rel=0.02)
    for block in alone.blocks:
        n = block["n"]
        assert block["Q_x"][:n] == pytest.approx(square[block["axes"][:n]], rel=0.02)
    half_a_degree = np.abs(_rates(design, x, y, u) - _rates(design, x, y, u + np.deg2rad([0, 0.5, 0, 0])))[1]
    assert alone.detector["noise"]["G_trim"][1, 1] * np.deg2rad(0.5) == pytest.approx(half_a_degree)
    calm = Detector(100.0, bounds=TACTICAL)
    assert alone.blocks[0]["Q_d"][0, 0] > calm.blocks[0]["Q_d"][0, 0]
    assert PITCH_BLOCK == 0
