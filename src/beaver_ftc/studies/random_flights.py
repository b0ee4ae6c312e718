"""A random flight within all that the diagnosis declares: flight condition, references, uncertainty and
fault.

Flight number i of a seed is the same in any study and in any order. The order of the draws in this module
must not change: it determines the flights of a seed.
"""

from dataclasses import dataclass

import numpy as np
from numpy.random import Generator

from beaver_ftc.aircraft import AXES, load
from beaver_ftc.documents.files import Document
from beaver_ftc.scenario.schema import Scenario
from beaver_ftc.studies.engine.draws import generator_of, loss

HEALTHY_S = 100.0  # no law holds the attitude: a longer flight leaves the validated envelope
AFTER_FAULT_S = 15.0  # longer than a period of the slowest reference
_AIRSPEED_MPS = (35.0, 52.0)
_ALTITUDE_M = (0.0, 3000.0)
_RATE_HZ = {"healthy": (20, 50), "faulty": (20, 100)}  # lower for the long healthy flights, to save time
_MAGNITUDE = (0.05, 1.0)
_KAPPA_PER_S = (0.2, 10.0)
_FAULT_AT_S = (3.0, 8.0)
_INERTIA = 0.25  # bounds of coupling and amplitude as published
_AMPLITUDE_RAD_S2 = 0.02
_FREQUENCY_RAD_S = (0.1, 60.0)
_AT_THE_BOUND = 0.3  # probability that an error is exactly at its bound
_COARSE = 0.05  # probability of several JSBSim frames in a frame of the loop
KINDS = ("healthy", "faulty")


@dataclass(frozen=True)
class Draw:
    """One flight of a seed: kind is `healthy` or `faulty`, index counts from 0."""

    seed: int
    kind: str
    index: int

    def scenario(self, fdi: Document | None = None) -> Scenario:
        """The scenario of the flight, with the section `fdi`."""
        rng = generator_of(self.seed, KINDS.index(self.kind), self.index)
        fault = _fault(rng) if self.kind == "faulty" else None
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


def _log_uniform(rng: Generator, low: float, high: float) -> float:
    """A number whose logarithm is uniformly random."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def _fault(rng: Generator) -> Document:
    """A loss of effectiveness of a primary surface, abrupt or incipient with the same probability."""
    fault = loss(str(rng.choice(load().primary)), rng.uniform(*_MAGNITUDE), rng.uniform(*_FAULT_AT_S))
    if rng.random() < 0.5:
        fault |= {"profile": "incipient", "kappa_per_s": _log_uniform(rng, *_KAPPA_PER_S)}
    return fault


def _signal(rng: Generator) -> Document:
    """A reference signal whose mean is zero, since no outer loop holds the attitude.

    Frequency and phase are drawn for all kinds, also if the kind does not use them.
    """
    amplitude = {"amplitude_deg_s": rng.uniform(0.5, 5.0)}
    wave = {**amplitude, "frequency_hz": _log_uniform(rng, 0.1, 0.7), "phase_deg": rng.uniform(0, 360)}
    kind = rng.choice(["sine", "square", "doublet", "chirp"], p=[0.5, 0.2, 0.15, 0.15])
    if kind == "doublet":
        return {"doublet": {**amplitude, "start_s": rng.uniform(0, 15), "width_s": rng.uniform(0.5, 3)}}
    if kind == "chirp":
        sweep = {"start_s": 0.0, "end_s": rng.uniform(20, HEALTHY_S), "start_frequency_hz": 0.1}
        return {"chirp": {**amplitude, **sweep, "end_frequency_hz": rng.uniform(0.2, 1.0)}}
    return {str(kind): wave}


def _within(rng: Generator, bound: float) -> float:
    """With the probability _AT_THE_BOUND exactly the bound, otherwise a uniformly random size from 0 to
    it."""
    return bound if rng.random() < _AT_THE_BOUND else rng.uniform(0.0, bound)


def _uncertainty(rng: Generator) -> Document:
    """Random errors within the published bounds [Zhang2005, sec. VII]."""
    sign = {axis: rng.choice([-1.0, 1.0]) for axis in AXES}
    coupling = {axis: sign[axis] * _within(rng, _INERTIA) for axis in AXES}
    sinusoid = {
        axis: {
            "amplitude_rad_s2": _within(rng, _AMPLITUDE_RAD_S2),
            "frequency_rad_s": _log_uniform(rng, *_FREQUENCY_RAD_S),
        }
        for axis in AXES
    }
    return {"inertia_coupling": coupling, "sinusoid": sinusoid}
