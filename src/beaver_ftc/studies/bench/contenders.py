"""The contenders that are timed: each flies the same seconds of the same flight, from the same state."""

import gc
import time
from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from beaver_ftc.control import Law, Reference
from beaver_ftc.design.context import Context
from beaver_ftc.design.fdc import SURFACES
from beaver_ftc.diagnosis import Detector, Measured, Verdict
from beaver_ftc.loop.loop import Loop
from beaver_ftc.plant import channels as ch
from beaver_ftc.plant.adapter import FlightState, Plant
from beaver_ftc.scenario.schema import Scenario

MAIN, FLAP = slice(3), 3  # places in SURFACES: aileron, elevator and rudder; the flap


class Contender(Protocol):
    """Something that flies a number of frames."""

    def prepare(self) -> None:
        """Go back to where every round starts; not timed."""

    def fly(self, frames: int) -> None:
        """Fly that many frames; timed."""


def interleave(contenders: Sequence[Contender], rounds: int, frames: int) -> np.ndarray:
    """Time all contenders in turn, A B C then C B A; microseconds a frame, (rounds, contenders).

    What is to be compared is formed within a round, which lasts some milliseconds, and condensed afterwards.
    """
    us = np.empty((rounds, len(contenders)))
    order = list(range(len(contenders)))
    collecting = gc.isenabled()
    gc.disable()
    try:
        for round_ in us:
            for i in order:
                contenders[i].prepare()
                start_ns = time.process_time_ns()
                contenders[i].fly(frames)
                round_[i] = (time.process_time_ns() - start_ns) / (1e3 * frames)
            order.reverse()
    finally:
        if collecting:
            gc.enable()
    return us


def state_of(plant: Plant) -> FlightState:
    """Where an aircraft with ideal actuators is now: its surfaces as they were in the run just flown."""
    truth = {name: plant.read(property_) * factor for name, property_, factor in ch.TRUTH}
    values: dict[str, Any] = {n: truth[n] for n in FlightState.__dataclass_fields__ if n in truth}
    surfaces_rad = {s: truth[f"{s}_pos_rad"] for s in SURFACES}
    settings = {name: plant.read(of.property) for name, of in plant.aircraft.engine.settings.items()}
    return FlightState(**values, surfaces_rad=surfaces_rad, settings=settings)


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
        self.moment = Moment.of(self.loop.plant)
        self._frames = self.loop.frames.copy()
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


@dataclass(frozen=True)
class Bare:
    """JSBSim alone: an aircraft from a moment on, surfaces held, nothing read, nothing written; `runs` JSBSim
    frames to each frame."""

    moment: Moment
    runs: int

    def prepare(self) -> None:
        """Back to that moment."""
        self.moment.come_back()

    def fly(self, frames: int) -> None:
        """Fly on."""
        run = self.moment.plant.run
        for _ in range(frames * self.runs):
            run()


def take_over(scenario: Scenario, at_s: float) -> Moment:
    """The aircraft of a flight, with its faults, at `at_s`: for someone else to fly."""
    loop = Loop(scenario)
    loop.fly_chunk(0, round(at_s * scenario.rate_hz))
    return Moment.of(loop.plant)


class InnovationDetector:
    """Alarms when the rates do what neither the design model nor its declared error explains."""

    def reset(self, context: Context) -> None:
        """Nothing seen yet."""
        self._dt_s = context.dt_s
        self._before: np.ndarray | None = None
        self._detected = False

    def step(self, measured: Measured, command: np.ndarray) -> Verdict:
        """Compare the frame that has elapsed with the model's."""
        if self._before is not None:
            innovation = (measured.x - self._before) / self._dt_s - measured.acceleration
            self._detected = self._detected or bool((np.abs(innovation) > measured.eta_bar).any())
        self._before = measured.x
        return Verdict(detected=self._detected)


class ProportionalInversion:
    """Inverts the design model on a proportional feedback, with the flap left in trim."""

    _FEEDBACK_PER_S = 3.0

    def reset(self, context: Context) -> None:
        """Keep the model and the trim."""
        self._model = context.model
        self._flap_rad = context.trim_rad[FLAP]

    def step(self, measured: Measured, reference: Reference, verdict: Verdict) -> np.ndarray:
        """Ask the three main surfaces for what the reference model does, and for what is missing."""
        G = self._model.G(measured.y)
        feedback = self._FEEDBACK_PER_S * (reference.rate - measured.x)
        wanted = reference.acceleration + feedback - self._model.f(measured.x, measured.y)
        return np.append(np.linalg.solve(G[:, MAIN], wanted - G[:, FLAP] * self._flap_rad), self._flap_rad)
