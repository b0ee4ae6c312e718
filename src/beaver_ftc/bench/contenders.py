"""Who is timed: each flies the same seconds of the same flight from the same state, in its own aircraft."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from beaver_ftc import channels as ch
from beaver_ftc.control.base import Law
from beaver_ftc.design.coefficients import SURFACES
from beaver_ftc.diagnosis.base import Detector
from beaver_ftc.loop import Loop
from beaver_ftc.plant.adapter import Plant
from beaver_ftc.plant.state import FlightState
from beaver_ftc.scenario.schema import Scenario


def state_of(plant: Plant) -> FlightState:
    """Where an aircraft is now, to `start` it from again."""
    truth = {name: plant.read(property_) * factor for name, property_, factor in ch.TRUTH}
    names = set(FlightState.__dataclass_fields__) & set(truth)
    return FlightState(
        **{name: truth[name] for name in names},
        **{f"{s}_rad": plant.read(f"fcs/{s}-cmd-rad") for s in SURFACES},
        engine_rpm=plant.read("engine/speed-rpm"),
        manifold_pressure_inhg=plant.read("engine/manifold-pressure-inhg"),
    )


@dataclass(frozen=True)
class Moment:
    """An instant of a flight to come back to: the frame's number, the aircraft's state, the loop's memory."""

    k: int
    state: FlightState
    frames: np.ndarray

    @classmethod
    def of(cls, loop: Loop) -> "Moment":
        """This instant of a flight."""
        return cls(int(loop.frames["k"][0]), state_of(loop.plant), loop.frames.copy())


class ClosedLoop:
    """The loop itself, from `at_s` on.

    compiled_frame: in place of the whole frame, one with parts taken out. detector, law: plug-ins in Python.
    """

    def __init__(
        self,
        scenario: Scenario,
        at_s: float,
        compiled_frame: Callable[..., int] | None = None,
        detector: Detector | None = None,
        law: Law | None = None,
    ) -> None:
        self.loop = Loop(scenario, detector, law)
        self.loop.fly_chunk(0, round(at_s * scenario.rate_hz))
        self._moment = Moment.of(self.loop)
        self.loop.fly_chunk(self._moment.k, self._frames_left())  # its references stay
        if compiled_frame is not None:
            self.loop.fly_frame = self.loop.direct(compiled_frame)

    def _frames_left(self) -> int:
        return self.loop.n_frames - self._moment.k

    def prepare(self) -> None:
        """Back to `at_s`."""
        self.loop.plant.start(self._moment.state)
        self.loop.frames[:] = self._moment.frames
        self.loop.frames["row"] = 0

    def fly(self, frames: int) -> None:
        """Fly on."""
        self.loop.fly_frames(frames, self.loop.scenario.substeps)


class Bare:
    """JSBSim alone: the same aircraft from the same state, surfaces held, nothing read, nothing written."""

    def __init__(self, scenario: Scenario, at_s: float) -> None:
        self.plant, self._state = take_over(scenario, at_s)
        self._runs = scenario.substeps

    def prepare(self) -> None:
        """Back to where the loop starts."""
        self.plant.start(self._state)

    def fly(self, frames: int) -> None:
        """Fly on."""
        run = self.plant.run
        for _ in range(frames * self._runs):
            run()


def take_over(scenario: Scenario, at_s: float) -> tuple[Plant, FlightState]:
    """The aircraft of a flight at `at_s`, for someone else to fly, with its faults, and its state there."""
    loop = Loop(scenario)
    loop.fly_chunk(0, round(at_s * scenario.rate_hz))
    return loop.plant, state_of(loop.plant)
