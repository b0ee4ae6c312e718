"""Random parts of flights that several studies share: generators, references, a loss, errors of the model."""

from collections.abc import Sequence

import numpy as np
from numpy.random import Generator

from beaver_ftc.aircraft import AXES
from beaver_ftc.documents.files import Document

FREQUENCY_HZ = {"p": 0.25, "q": 0.2, "r": 0.15}  # of the reference on each axis


def generator_of(seed: int, *spawn_key: int) -> Generator:
    """A generator of a seed. Different spawn keys give independent numbers."""
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=spawn_key))


def sines(rng: Generator, amplitude_deg_s: float) -> Document:
    """A sine as reference of every axis, with a random phase."""
    phases_deg = rng.uniform(-180.0, 180.0, len(AXES)).tolist()
    return {
        axis: [{"sine": {"amplitude_deg_s": amplitude_deg_s, "frequency_hz": hz, "phase_deg": phase_deg}}]
        for (axis, hz), phase_deg in zip(FREQUENCY_HZ.items(), phases_deg, strict=True)
    }


def loss(surface: str, magnitude: float, at_s: float) -> Document:
    """A loss of effectiveness of a surface by a share `magnitude`, from at_s on."""
    return {"type": "loss_of_effectiveness", "actuator": surface, "magnitude": magnitude, "at_s": at_s}


def swings(rng: Generator, sizes_rad_s2: Sequence[float], limits_rad_s: tuple[float, float]) -> Document:
    """A sinusoidal acceleration of every axis, of these amplitudes. The logarithm of its frequency is
    uniformly random within the limits."""
    slowest, fastest = np.log(limits_rad_s)
    frequencies = np.exp(rng.uniform(slowest, fastest, len(AXES))).tolist()
    return {
        axis: {"amplitude_rad_s2": size, "frequency_rad_s": rad_s}
        for axis, size, rad_s in zip(AXES, sizes_rad_s2, frequencies, strict=True)
    }
