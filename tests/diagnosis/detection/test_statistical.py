"""What is declared is kept: rates of false alarms, bounded uncertainty."""

import numpy as np
import pytest
from innovations import drawn

from beaver_ftc.aircraft import AXES, load
from beaver_ftc.compiled import copy, kernel
from beaver_ftc.diagnosis.detection import likelihood, statistical, statistical_design
from beaver_ftc.diagnosis.detection.blocks import DRIFT_PRIOR_RAD_S2, N_SLOTS
from beaver_ftc.diagnosis.detection.rows import RATES
from beaver_ftc.loop.assembly import configure_design
from beaver_ftc.plant.instruments import MEASURED
from beaver_ftc.scenario.declared import Declared
from beaver_ftc.scenario.schema import Scenario
from beaver_ftc.studies.engine.statistics import poisson_bound

TRAVEL_RAD = np.array([[-0.52, -0.49, -0.44, -0.1], [0.52, 0.49, 0.44, 1.03]])
LEVEL_FLIGHT = np.zeros(3), np.array([0.1, 0.02, 45.0, 1036.0, 0.3]), np.zeros(4)  # x, y, u
NO_COUPLING = {"p": 0.0, "q": 0.0, "r": 0.0}
TACTICAL = {"sensors": "tactical-grade"}
SETTINGS = {
    "ideal gyros": {},
    "tactical-grade": TACTICAL,
    "tolerances": {**TACTICAL, "coefficients": 0.05},
    "light turbulence": {**TACTICAL, "turbulence": "light"},
    "severe turbulence, poor gyros": {"sensors": "consumer-grade", "turbulence": "severe"},
}


class Detector:
    """The compiled detector alone, made ready as before a flight, at one flight condition."""

    def __init__(self, rate_hz=100.0, **fdi):
        keys = {"rate_hz": rate_hz, "fdi": {"statistical": {}, **fdi}}
        scenario = Scenario.model_validate({"name": "detector-alone", **keys})
        self.frames = configure_design(scenario, TRAVEL_RAD).view(np.recarray)
        frame = self.frames[0]
        self.fdi, self.dt = frame["fdi"], 1.0 / rate_hz
        design, declared = frame["prediction"]["design"], Declared.of(scenario)
        statistical_design.configure_statistics(self.fdi, declared, design, LEVEL_FLIGHT)
        self.detector = self.fdi["statistical"]
        measured = np.zeros(1, MEASURED)[0]
        measured["x"], measured["y"][:5] = LEVEL_FLIGHT[:2]
        bound, u = self.fdi["bound"], LEVEL_FLIGHT[2]
        statistical.prepare_tests(self.detector, bound, design, measured, u, self.dt)
        self.frame = 0

    @property
    def blocks(self):
        return self.detector["block"]

    def innovations(self, frames, rng):
        """Healthy ones (frames, 3), as declared."""
        out = np.empty((frames, 3))
        for block in self.blocks:  # of the two views of roll and yaw the latter, if it is there
            out[:, block["axes"][: block["n"]]] = drawn(block, frames, self.dt, rng, DRIFT_PRIOR_RAD_S2)
        return out

    def watch(self, innovations, Gu, cubic, renew=False):
        """Scores (k,), shares of the alarm level; `renew`: begin anew after an alarm, as a new flight."""
        scores = np.empty(len(innovations))
        watch_all(self.detector, innovations, Gu, cubic, self.frame, renew, self.dt, scores)
        self.frame += len(innovations)
        return scores


@kernel
def watch_all(detector, innovations, Gu, cubic, first, renew, dt, scores):
    """The frames of a flight without one: innovations (k, 3), Gu (k, 3, 4) rad/s2, cubic (k,)."""
    for k in range(len(innovations)):
        blocks, alarm, rows = detector.block, detector.alarm, detector.rows
        rows.per_cubed = cubic[k]
        for i in range(3):
            rows.nu[RATES, i] = innovations[k, i]
            copy(Gu[k, i], rows.Gu[:4, i])
        statistical.update_blocks(detector, dt, first + k, 0)
        statistical.update_alarm(detector, (first + k) * dt)
        scores[k] = alarm.ratio
        if renew and alarm.ratio > 1.0:
            for slot in range(N_SLOTS):
                for b in range(detector.block.size):
                    likelihood.reset_slot(blocks[b], slot)


def surfaces_at_work(frames, rate_hz, rng, size=0.3):
    """Gu (frames, 3, 4) rad/s2 of surfaces that follow sines, and a pitching moment on alpha^3 (frames,)."""
    t = np.arange(frames)[:, None] / rate_hz
    wave = np.sin(2 * np.pi * np.array([0.25, 0.2, 0.3]) * t + rng.uniform(0, 6, 3))
    Gu = np.zeros((frames, 3, 4))
    Gu[:, 0, 0], Gu[:, 2, 0] = -size * wave[:, 0], -0.05 * size * wave[:, 0]
    Gu[:, 1, 1] = -size * wave[:, 1]
    Gu[:, 0, 2], Gu[:, 2, 2] = 0.2 * size * wave[:, 2], -size * wave[:, 2]
    return Gu, 0.05 + 0.01 * wave[:, 1]


@pytest.mark.parametrize("per_h", [3600.0, 36000.0])
@pytest.mark.parametrize("rate_hz", [20.0, 100.0])
@pytest.mark.parametrize("setting", SETTINGS)
def test_false_alarms_are_no_more_than_declared_and_not_absurdly_fewer(setting, rate_hz, per_h):
    """On innovations as declared, a new flight after every alarm. The union bound costs a factor of six or
    so: tests of neighbouring onsets and frames go together."""
    alone = Detector(rate_hz, bounds=SETTINGS[setting])
    tests = statistical_design.count_tests(load())
    alone.detector["test"]["alarm_level"] = statistical_design.derive_alarm_level(per_h, rate_hz, tests)
    hours, rng = 240.0 / 3600.0, np.random.default_rng(8)
    frames = round(hours * 3600.0 * rate_hz)
    scores = alone.watch(alone.innovations(frames, rng), *surfaces_at_work(frames, rate_hz, rng), renew=True)
    seen = int(np.sum(scores > 1.0))
    assert poisson_bound(seen, hours, 0.9995, upper=True) <= per_h
    assert poisson_bound(seen, hours, 0.9995, upper=False) > 0.02 * per_h


def _share(rate_hz, omega, eta_bar, sensors):
    """Largest share of the level that eta_bar sin(omega t) reaches in 20 s, in roll and pitch, or yaw."""
    constant = dict.fromkeys(AXES, eta_bar)
    largest = 0.0
    for axes in ((0, 1), (2,)):
        for phase in (0.0, 0.8, 1.6, 2.4):
            alone = Detector(
                rate_hz,
                statistical={"uncertainty_rad_s": omega},
                bounds={"constant_rad_s2": constant, "inertia_coupling": NO_COUPLING, "sensors": sensors},
            )
            frames = round(20 * rate_hz)
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
    assert 0.1 < _share(rate_hz, omega, eta_bar, sensors) < 0.6
