"""The contenders that are timed: each flies as many frames from the same state of the aircraft."""

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

MAIN, FLAP = slice(3), 3  # places in SURFACES: aileron, elevator and rudder, and the flap


class Contender(Protocol):
    """A way to fly a number of frames that is timed."""

    def prepare(self) -> None:
        """Return to the state in which every round starts; not timed."""

    def fly(self, frames: int) -> None:
        """Fly that many frames; timed."""


def interleave(contenders: Sequence[Contender], rounds: int, frames: int) -> np.ndarray:
    """Time all contenders in turn, A B C in one round, C B A in the next; processor time of a frame,
    microseconds, (rounds, contenders).

    The caller forms differences and ratios within a round, so that slow changes of the speed of the machine
    cancel, and then medians over the rounds.
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
    """The present state of an aircraft with ideal actuators. Surfaces: their positions in the last JSBSim
    frame."""
    truth = {name: plant.read(property_) * factor for name, property_, factor in ch.TRUTH}
    values: dict[str, Any] = {n: truth[n] for n in FlightState.__dataclass_fields__ if n in truth}
    surfaces_rad = {s: truth[f"{s}_pos_rad"] for s in SURFACES}
    settings = {
        name: plant.read(setting.property) for name, setting in plant.aircraft.engine.settings.items()
    }
    return FlightState(**values, surfaces_rad=surfaces_rad, settings=settings)


@dataclass(frozen=True)
class Moment:
    """An instant between two frames of a flight, to which the aircraft can return.

    state: state of the aircraft after the last frame. commands: commands for the next frame, by property.
    """

    plant: Plant
    state: FlightState
    commands: dict[str, float]

    @classmethod
    def of(cls, plant: Plant) -> "Moment":
        """The present instant of a plant."""
        return cls(plant, state_of(plant), {name: plant.read(name) for name in ch.COMMANDS})

    def come_back(self) -> None:
        """Put the aircraft into the state of this instant."""
        self.plant.start(self.state)
        for name, deflection_rad in self.commands.items():
            self.plant.write(name, deflection_rad)


class ClosedLoop:
    """The closed loop of the package, from `at_s` on. detector, law: plug-ins in Python."""

    def __init__(
        self, scenario: Scenario, at_s: float, detector: Detector | None = None, law: Law | None = None
    ) -> None:
        self.loop = Loop(scenario, detector, law)
        first = round(at_s * scenario.rate_hz)
        self.loop.fly_chunk(0, first)
        self.loop.sample_references(first, self.loop.n_frames - first)
        self.moment = Moment.of(self.loop.plant)
        self._frames = self.loop.frames.copy()
        # None: a loop with a plug-in is stepped from Python
        self._fly_on = self.loop.fly_on if self.loop.fly_frame is None else None

    def with_frame(self, compiled_frame: Callable[..., int]) -> "ClosedLoop":
        """The same loop and aircraft with another compiled frame, from which parts are taken out."""
        variant = copy(self)
        variant._fly_on = self.loop.direct(compiled_frame)
        return variant

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
    """JSBSim alone, from a moment on: surfaces are held, and no property is read or written. runs: JSBSim
    frames in a frame of the loop."""

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
    """The aircraft of a flight, with its faults, at `at_s`, to be flown by another loop."""
    loop = Loop(scenario)
    loop.fly_chunk(0, round(at_s * scenario.rate_hz))
    return Moment.of(loop.plant)


class InnovationDetector:
    """Alarm from the first frame on in which |xdot - model| > eta_bar on an axis, rad/s2; xdot: change of the
    rates over a frame / dt."""

    def reset(self, context: Context) -> None:
        """Forget the rates and the alarm."""
        self._dt_s = context.dt_s
        self._before: np.ndarray | None = None
        self._detected = False

    def step(self, measured: Measured, command: np.ndarray) -> Verdict:
        """Compare the acceleration over the elapsed frame with that of the design model."""
        if self._before is not None:
            innovation = (measured.x - self._before) / self._dt_s - measured.acceleration
            self._detected = self._detected or bool((np.abs(innovation) > measured.eta_bar).any())
        self._before = measured.x
        return Verdict(detected=self._detected)


class ProportionalInversion:
    """G u = reference acceleration + K (reference rate - x) - f, with the flap in trim; K:
    _FEEDBACK_PER_S."""

    _FEEDBACK_PER_S = 3.0

    def reset(self, context: Context) -> None:
        """Keep the model and the trim."""
        self._model = context.model
        self._flap_rad = context.trim_rad[FLAP]

    def step(self, measured: Measured, reference: Reference, verdict: Verdict) -> np.ndarray:
        """Solve for the three main surfaces; return the deflections (4,) rad."""
        G = self._model.G(measured.y)
        feedback = self._FEEDBACK_PER_S * (reference.rate - measured.x)
        demand = reference.acceleration + feedback - self._model.f(measured.x, measured.y)
        return np.append(np.linalg.solve(G[:, MAIN], demand - G[:, FLAP] * self._flap_rad), self._flap_rad)
