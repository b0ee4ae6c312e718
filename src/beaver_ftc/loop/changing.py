"""Law, diagnosis and sensors changed in flight.

For each change the record of the flight is assembled once more, as the scenario says it from then on and from
the same trim. At its frame the part that changes is taken from it: the law's, with what the surfaces and the
reference stand at; the diagnosis', which restarts; or the instruments', which nobody is told. Truth,
prediction, supervisor, accounts and log go on, and so do plug-ins that are not changed.
"""

from typing import Any, NamedTuple

import numpy as np

from beaver_ftc.control.autopilot import forget_losses
from beaver_ftc.control.state import loses_truth, take_over
from beaver_ftc.diagnosis.schemes import prepare_takeover
from beaver_ftc.documents.errors import BadInput
from beaver_ftc.loop.assembly import assemble
from beaver_ftc.loop.plugin_frame import PluginFrame
from beaver_ftc.loop.plugin_setup import named_detector, named_law, plugged
from beaver_ftc.plant.faults import NEVER
from beaver_ftc.plant.instruments import take_configuration
from beaver_ftc.scenario.instants import frame_of
from beaver_ftc.scenario.schema import Change, Scenario, stages


class Stage(NamedTuple):
    """A change ready to be made: its frame, the scenario from then on, whether the diagnosis restarts, the
    record to take it from, the plug-ins from then on."""

    frame: int
    change: Change
    scenario: Scenario
    renews: bool
    frames: np.ndarray
    plugins: PluginFrame | None


class Changing:
    """The changes of a flight, of a `loop.Loop`. replaced: those made, and what the diagnosis that each ended
    had found."""

    def __init__(self, loop: Any) -> None:
        self._loop = loop
        self.replaced: list[dict[str, Any]] = []
        self._coming: list[Stage] = []

    def plan(self, scenario: Scenario, k: int) -> None:
        """Make ready what a scenario changes from frame k on. Raises BadInput for what cannot be flown."""
        coming: list[Stage] = []
        for change, then in stages(scenario):
            frame = frame_of(change.at_s, scenario.rate_hz)
            if frame >= k:
                before = coming[-1].plugins if coming else self._loop.plugin_frame
                coming.append(self._stage(frame, change, then, before))
        self._coming = coming

    def _stage(self, frame: int, change: Change, then: Scenario, before: PluginFrame | None) -> Stage:
        loop = self._loop
        layout = loop.frames["control"]["layout"][0]
        frames = assemble(then, loop.trimmed, np.array([layout["low"], layout["high"]]))
        _check_delays(frames, loop.frames)
        renews = change.scheme is not None or change.declared_sensors is not None
        detector, law = (before.detector, before.law) if before else (None, None)
        if renews:
            named = named_detector(then)
            if change.scheme is None and named is None and detector is not None:
                allowed = "one named in fdi.scheme"
                raise BadInput(f"changes.declared_sensors: with a detector object, allowed: {allowed}")
            detector = named
        if change.law is not None:
            law = named_law(frames, then, loop.trimmed)
        plugins = plugged(frames, then, loop.trimmed, detector, law, before)
        return Stage(frame, change, then, renews, frames, plugins)

    def next_change(self, k: int) -> int:
        """The first frame after k at which `apply` has something to do."""
        return min((stage.frame for stage in self._coming if stage.frame > k), default=NEVER)

    def apply(self, k: int) -> None:
        """Make the changes of frame k, the next to fly."""
        for stage in [stage for stage in self._coming if stage.frame == k]:
            self._make(stage)
            self._coming.remove(stage)

    def _make(self, stage: Stage) -> None:
        loop, change = self._loop, stage.change
        frame, new = loop.frames[0], stage.frames[0]
        self._note(stage)
        if change.law is not None:
            take_law(frame, new["control"])
        if stage.renews:
            take_diagnosis(frame, new, stage.frame)
        if change.sensors is not None:
            take_configuration(frame["instruments"], new["instruments"])
            loop.sensor_schedule.apply(stage.frame)  # what is broken stays so
        frame["control"]["power"]["config"]["enabled"] = new["control"]["power"]["config"]["enabled"]
        before = loop.plugin_frame
        if stage.plugins is not None and before is not None and stage.plugins.detector is before.detector:
            stage.plugins.verdict = before.verdict  # which still stands
        loop.fly_with(stage.plugins)

    def _note(self, stage: Stage) -> None:
        """Say what is changed, and what becomes of a verdict that ends with it."""
        change = stage.change
        noted = {"time_s": stage.frame / self._loop.scenario.rate_hz, "law": change.law}
        noted |= {"scheme": change.scheme, "sensors": change.sensors is not None}
        if stage.renews:
            found = self._loop.land()
            noted |= {"detection_time_s": found.detection_time_s, "isolated": found.isolated}
        self.replaced.append(noted)


def _check_delays(then: np.ndarray, now: np.ndarray) -> None:
    """A flight keeps as many samples as it was to need when it began."""
    needed, room = int(then["instruments"]["length"].sum()), now["instruments"]["line"].size
    if needed > room:
        raise BadInput(
            f"changes.sensors: delays of {needed} samples in all, allowed: {room} in this flight, "
            "or any that the scenario says before it begins"
        )


def take_law(frame: np.void, new: np.void) -> None:
    """Put a law, configured in `new`, in the place of another, without a bump."""
    fdi = frame["fdi"]
    learnt = fdi["fdae"]["network"]["output"].copy() if fdi["verdict"]["detected"] else np.zeros(3)
    if loses_truth(new, frame["control"]):
        forget_losses(frame["autopilot"])
    take_over(new, frame["control"], learnt)
    frame["control"] = new
    frame["faults"] = np.zeros_like(frame["faults"])  # of the truth: an informed law is told again


def take_diagnosis(frame: np.void, new: np.void, k: int) -> None:
    """Begin the diagnosis again with frame k, as configured in `new`."""
    prepare_takeover(new["fdi"], in_flight=k > 0)
    if new["fdi"]["bank"]["config"]["n_filters"] != frame["fdi"]["bank"]["config"]["n_filters"]:
        frame["accounts"]["closest"]["filter"] = 0.0  # of other filters nothing is known
    # thrust lags the levers: what they did before still counts
    new["fdi"]["engine_monitor"]["memory"] = frame["fdi"]["engine_monitor"]["memory"]
    frame["fdi"], frame["since"] = new["fdi"], k
