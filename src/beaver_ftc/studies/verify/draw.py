"""Random flights inside everything the diagnosis declares: the flight condition, the references, the
uncertainty, the fault.

Flight number i of a seed is the same whatever else is flown, by whom, and in which order.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from beaver_ftc.aircraft import load
from beaver_ftc.scenario.schema import Scenario

AXES = ("p", "q", "r")
HEALTHY_S = 100.0  # attitude is open loop: a longer flight wanders out of the validated envelope
AFTER_FAULT_S = 15.0  # more than a period of the slowest reference
_AIRSPEED_MPS, _ALTITUDE_M = (35.0, 52.0), (0.0, 3000.0)
_RATE_HZ = {"healthy": (20, 50), "faulty": (20, 100)}  # a slow hour flies sooner
_MAGNITUDE, _KAPPA_PER_S, _FAULT_AT_S = (0.05, 1.0), (0.2, 10.0), (3.0, 8.0)
_INERTIA, _AMPLITUDE_RAD_S2, _FREQUENCY_RAD_S = 0.25, 0.02, (0.1, 60.0)
_AT_THE_BOUND = 0.3  # share of flights with an uncertainty at its very bound

_COARSE = 0.05  # share of flights with several JSBSim frames in a frame of the loop

_HEALTHY, _FAULTY = 0, 1


@dataclass(frozen=True)
class Draw:
    """One flight's place in a campaign: kind is `healthy` or `faulty`, index counts from 0."""

    seed: int
    kind: str
    index: int

    @property
    def run(self) -> tuple[str, int]:
        """What it is known by in its campaign."""
        return self.kind, self.index

    def generator(self) -> np.random.Generator:
        """This flight's own random numbers."""
        key = (_FAULTY if self.kind == "faulty" else _HEALTHY, self.index)
        return np.random.default_rng(np.random.SeedSequence(self.seed, spawn_key=key))

    def scenario(self, fdi: dict[str, Any] | None = None) -> Scenario:
        """The flight, diagnosed as `fdi` says."""
        rng = self.generator()
        faulty = self.kind == "faulty"
        fault = _fault(rng) if faulty else None
        return Scenario.model_validate({
            "name": f"{self.kind}-{self.index}",
            "duration_s": fault["at_s"] + AFTER_FAULT_S if fault else HEALTHY_S,
            "rate_hz": round(_log_uniform(rng, *_RATE_HZ[self.kind])),
            "substeps": int(rng.integers(2, 5)) if rng.random() < _COARSE else 1,
            "initial": {"airspeed_mps": rng.uniform(*_AIRSPEED_MPS), "altitude_m": rng.uniform(*_ALTITUDE_M)},
            "reference": {axis: [_signal(rng) for _ in range(rng.integers(1, 3))] for axis in AXES},
            "faults": [fault] if fault else [],
            "uncertainty": _uncertainty(rng),
            "fdi": fdi or {},
        })  # fmt: skip


def _log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def _fault(rng: np.random.Generator) -> dict[str, Any]:
    fault = {
        "actuator": str(rng.choice(load().primary)),
        "type": "loss_of_effectiveness",
        "magnitude": rng.uniform(*_MAGNITUDE),
        "at_s": rng.uniform(*_FAULT_AT_S),
    }
    if rng.random() < 0.5:
        fault |= {"profile": "incipient", "kappa_per_s": _log_uniform(rng, *_KAPPA_PER_S)}
    return fault


def _signal(rng: np.random.Generator) -> dict[str, Any]:
    """Zero on average, or the attitude would run away under open outer loops."""
    amplitude = {"amplitude_deg_s": rng.uniform(0.5, 5.0)}
    wave = {**amplitude, "frequency_hz": _log_uniform(rng, 0.1, 0.7), "phase_deg": rng.uniform(0, 360)}
    kind = rng.choice(["sine", "square", "doublet", "chirp"], p=[0.5, 0.2, 0.15, 0.15])
    if kind == "doublet":
        return {"doublet": {**amplitude, "start_s": rng.uniform(0, 15), "width_s": rng.uniform(0.5, 3)}}
    if kind == "chirp":
        sweep = {"start_s": 0.0, "end_s": rng.uniform(20, HEALTHY_S), "start_frequency_hz": 0.1}
        return {"chirp": {**amplitude, **sweep, "end_frequency_hz": rng.uniform(0.2, 1.0)}}
    return {str(kind): wave}


def _within(rng: np.random.Generator, bound: float) -> float:
    """Anywhere within the bound, and often right at it."""
    return bound if rng.random() < _AT_THE_BOUND else rng.uniform(0.0, bound)


def _uncertainty(rng: np.random.Generator) -> dict[str, Any]:
    """All that the published bounds admit [Zhang2005, sec. VII]."""
    sign = {axis: rng.choice([-1.0, 1.0]) for axis in AXES}
    return {
        "inertia_coupling": {axis: sign[axis] * _within(rng, _INERTIA) for axis in AXES},
        "sinusoid": {
            axis: {
                "amplitude_rad_s2": _within(rng, _AMPLITUDE_RAD_S2),
                "frequency_rad_s": _log_uniform(rng, *_FREQUENCY_RAD_S),
            }
            for axis in AXES
        },
    }
