"""Helpers for tests that fly: scenarios from a few words, logs kept in memory."""

from dataclasses import replace

import numpy as np

from beaver_ftc.aircraft import load
from beaver_ftc.loop.loop import fly
from beaver_ftc.results.log import MemoryLog
from beaver_ftc.scenario.declared import Declared
from beaver_ftc.scenario.diagnosis import FdiConfig
from beaver_ftc.scenario.schema import Scenario

PUBLISHED_UNCERTAINTY = {
    "inertia_coupling": {"p": 0.25, "q": -0.25, "r": 0.25},
    "sinusoid": {
        "p": {"amplitude_rad_s2": 0.02, "frequency_rad_s": 10},
        "q": {"amplitude_rad_s2": 0.02, "frequency_rad_s": 15},
        "r": {"amplitude_rad_s2": 0.02, "frequency_rad_s": 10},
    },
}
SINES = {
    "p": [{"sine": {"amplitude_deg_s": 3, "frequency_hz": 0.25}}],
    "q": [{"sine": {"amplitude_deg_s": 3, "frequency_hz": 0.2}}],
    "r": [{"sine": {"amplitude_deg_s": 3, "frequency_hz": 0.3}}],
}


def declared_in(bounds, aircraft=None):
    """What these `fdi.bounds` declare of an aircraft."""
    declared = Declared.of(Scenario(name="x"))
    return replace(declared, fdi=FdiConfig(bounds=bounds), aircraft=aircraft or load())


class Memory(MemoryLog):
    """A log in memory; `memory["q_rad_s"]` is a column."""

    def __getitem__(self, column):
        return self.rows[:, self.columns.index(column)]

    def error_deg_s(self, axis):
        """Tracking error of an axis, deg/s."""
        return np.rad2deg(self[f"{axis}_model_rad_s"] - self[f"{axis}_rad_s"])

    def rms_deg_s(self, axis, from_s, to_s=np.inf):
        """RMS tracking error of an axis over a time span, deg/s."""
        span = (self["t_s"] >= from_s) & (self["t_s"] < to_s)
        return float(np.sqrt(np.mean(self.error_deg_s(axis)[span] ** 2)))


def scenario(**keys):
    """A scenario with sine references, the published uncertainty and law, unless said otherwise."""
    control = {"law": "fault-tolerant-published", **keys.pop("control", {})}
    return Scenario.model_validate(
        {"name": "test", "reference": SINES, "uncertainty": PUBLISHED_UNCERTAINTY, "control": control, **keys}
    )


def loss(actuator="elevator", magnitude=0.4, at_s=12.0, **more):
    """A loss of effectiveness."""
    return {
        "type": "loss_of_effectiveness",
        "actuator": actuator,
        "magnitude": magnitude,
        "at_s": at_s,
        **more,
    }


def flown(**keys):
    """(flight, log) of `scenario(**keys)`."""
    memory = Memory()
    return fly(scenario(**keys), memory), memory


def same_log(one, other):
    """Whether two logs are the same to the bit."""
    return list(one.columns) == list(other.columns) and np.array_equal(one, other, equal_nan=True)
