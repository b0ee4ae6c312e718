"""Who is timed: each flies the same seconds of the same flight, from the same state."""

from collections.abc import Callable
from copy import copy
from dataclasses import dataclass
from typing import Any

from beaver_ftc.control.base import Law
from beaver_ftc.design.coefficients import SURFACES
from beaver_ftc.diagnosis.base import Detector
from beaver_ftc.loop.loop import Loop
from beaver_ftc.plant import channels as ch
from beaver_ftc.plant.adapter import Plant
from beaver_ftc.plant.state import FlightState
from beaver_ftc.scenario.schema import Scenario


def state_of(plant: Plant) -> FlightState:
    """Where an aircraft with ideal actuators is now: its surfaces as they were in the run just flown."""
    truth = {name: plant.read(property_) * factor for name, property_, factor in ch.TRUTH}
    names = set(FlightState.__dataclass_fields__) & set(truth)
    values: dict[str, Any] = {name: truth[name] for name in names}
    values |= {f"{s}_rad": truth[f"{s}_pos_rad"] for s in SURFACES}
    return FlightState(
        **values,
        engine_rpm=plant.read("engine/speed-rpm"),
        manifold_pressure_inhg=plant.read("engine/manifold-pressure-inhg"),
    )


@dataclass(frozen=True)
class Moment:
    """An instant between two frames of a flight, to come back to.

    state: the aircraft's, of the frame just flown. commands: by property, for the frame to come.
    """

    plant: Plant
    state: FlightState
    commands: dict[str, float]

    @classmethod
    def of(cls, plant: Plant) -> "Moment":
        """The present."""
        return cls(plant, state_of(plant), {name: plant.read(name) for name in ch.COMMANDS})

    def come_back(self) -> None:
        """Put the aircraft there again."""
        self.plant.start(self.state)
        for name, deflection_rad in self.commands.items():
            self.plant.write(name, deflection_rad)


class ClosedLoop:
    """The loop itself, from `at_s` on. detector, law: plug-ins in Python."""

    def __init__(
        self, scenario: Scenario, at_s: float, detector: Detector | None = None, law: Law | None = None
    ) -> None:
        self.loop = Loop(scenario, detector, law)
        first = round(at_s * scenario.rate_hz)
        self.loop.fly_chunk(0, first)
        self.loop.sample_references(first, self.loop.n_frames - first)
        self.moment, self._frames = Moment.of(self.loop.plant), self.loop.frames.copy()
        self._fly_on = self.loop.fly_on if self.loop.fly_frame is None else None

    def with_frame(self, compiled_frame: Callable[..., int]) -> "ClosedLoop":
        """The same loop and aircraft, with another compiled frame: one with parts taken out."""
        other = copy(self)
        other._fly_on = self.loop.direct(compiled_frame)
        return other

    def prepare(self) -> None:
        """Back to `at_s`."""
        self.moment.come_back()
        self.loop.frames[:] = self._frames
        if self._fly_on is not None:
            self.loop.fly_on = self._fly_on

    def fly(self, frames: int) -> None:
        """Fly on."""
        self.loop.fly_frames(frames, self.loop.scenario.substeps)


class Bare:
    """JSBSim alone: an aircraft from a moment on, surfaces held, nothing read, nothing written."""

    def __init__(self, moment: Moment, runs: int = 1) -> None:
        self.plant, self._moment, self._runs = moment.plant, moment, runs

    def prepare(self) -> None:
        """Back to that moment."""
        self._moment.come_back()

    def fly(self, frames: int) -> None:
        """Fly on; `runs` JSBSim frames to each."""
        run = self.plant.run
        for _ in range(frames * self._runs):
            run()


def take_over(scenario: Scenario, at_s: float) -> Moment:
    """The aircraft of a flight, with its faults, at `at_s`: for someone else to fly."""
    loop = Loop(scenario)
    loop.fly_chunk(0, round(at_s * scenario.rate_hz))
    return Moment.of(loop.plant)
