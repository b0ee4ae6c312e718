"""Parts that random flights of several studies share: numbers, references, a loss, errors of the model."""

from collections.abc import Sequence

import numpy as np
from numpy.random import Generator

from beaver_ftc.aircraft import AXES
from beaver_ftc.documents.files import Document

FREQUENCY_HZ = {"p": 0.25, "q": 0.2, "r": 0.15}


def generator_of(seed: int, *spawn_key: int) -> Generator:
    """Random numbers that a spawn key distinguishes from the others of a seed."""
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=spawn_key))


def sines(rng: Generator, amplitude_deg_s: float) -> Document:
    """A reference on every axis, with a random phase."""
    phases_deg = rng.uniform(-180.0, 180.0, len(AXES)).tolist()
    return {
        axis: [{"sine": {"amplitude_deg_s": amplitude_deg_s, "frequency_hz": hz, "phase_deg": phase_deg}}]
        for (axis, hz), phase_deg in zip(FREQUENCY_HZ.items(), phases_deg, strict=True)
    }


def loss(surface: str, magnitude: float, at_s: float) -> Document:
    """A loss of effectiveness of a surface."""
    return {"type": "loss_of_effectiveness", "actuator": surface, "magnitude": magnitude, "at_s": at_s}


def swings(rng: Generator, sizes_rad_s2: Sequence[float], limits_rad_s: tuple[float, float]) -> Document:
    """An unstructured acceleration on every axis, of these sizes, with frequencies within the limits."""
    slowest, fastest = np.log(limits_rad_s)
    frequencies = np.exp(rng.uniform(slowest, fastest, len(AXES))).tolist()
    return {
        axis: {"amplitude_rad_s2": size, "frequency_rad_s": rad_s}
        for axis, size, rad_s in zip(AXES, sizes_rad_s2, frequencies, strict=True)
    }
