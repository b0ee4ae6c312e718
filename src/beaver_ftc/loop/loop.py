"""The closed loop: JSBSim flies, compiled frames measure, diagnose, decide and command, the log goes out."""

import threading
from collections.abc import Callable, Iterable, Sequence
from contextlib import ExitStack
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from beaver_ftc.compiled import direct
from beaver_ftc.compiled.ahead import expect
from beaver_ftc.documents.errors import BadInput, SimulationFailed
from beaver_ftc.loop import memory
from beaver_ftc.loop.assembly import Trim, configure_at_trim, configure_design, lay_out
from beaver_ftc.loop.cockpit import Cockpit, note_failures, set_origin
from beaver_ftc.loop.outcome import Landing, landing_of
from beaver_ftc.loop.stepping import fly_frame, fly_on, hold, sense_inside
from beaver_ftc.loop.windows import Windows
from beaver_ftc.plant import channels as ch
from beaver_ftc.plant.adapter import Plant, translated
from beaver_ftc.plant.conditions import give_back, known_trim, ready
from beaver_ftc.plant.faults import FaultSchedule, SensorFaultSchedule
from beaver_ftc.plant.sensing import FLYING, NOT_FINITE
from beaver_ftc.plant.true_aircraft import GustSchedule, take_off
from beaver_ftc.plugins import DETECTORS, LAWS, is_compiled
from beaver_ftc.scenario.declared import Declared
from beaver_ftc.scenario.schema import Scenario
from beaver_ftc.scenario.signals import sample_frames
from beaver_ftc.scenario.truth import Truth

if TYPE_CHECKING:
    from beaver_ftc.compiled.ahead import Wanted
    from beaver_ftc.control import Law
    from beaver_ftc.diagnosis import Detector, Verdict
    from beaver_ftc.loop.changing import Changing
    from beaver_ftc.loop.plugin_frame import PluginFrame


CHUNK_ROWS = 8192
TOLD_FRAMES = 16  # between two words of progress of a plug-in's flight
# The aircraft that are flown again and their compiled frames are the process's own: of several threads one
# flies at a time, the others wait. More at a time take more processes.
ONE_FLIES = threading.RLock()
AT_ONCE = 256  # frames, a millisecond or two: so long a signal and other threads wait


class LogSink(Protocol):
    """Takes the log as it is flown, in chunks: a ten-hour flight has 3.6 million rows."""

    def open(self, columns: Sequence[str]) -> None:
        """Called once, with the columns in order."""

    def write(self, rows: np.ndarray) -> None:
        """rows (n, columns), float64; the array is reused afterwards."""

    def close(self) -> None:
        """Called once, after the last row."""


class Loop:
    """One flight in progress. detector, law: plug-ins to fly with, in place of those the scenario names.

    from_ground: whether somebody flies it who takes off.
    """

    from_ground = False

    def __init__(
        self,
        scenario: Scenario,
        detector: "Detector | None" = None,
        law: "Law | None" = None,
        prepare: Callable[[Plant], None] | None = None,
    ) -> None:
        if scenario.initial.on_ground and not self.from_ground:
            says = "no law of ours takes off, allowed: false, or an autopilot that does (`beaver-ftc sitl`)"
            raise BadInput(f"{scenario.name}: initial.on_ground: {says}")
        self.scenario = scenario
        self.aircraft = scenario.airframe
        truth, declared = Truth.of(scenario), Declared.of(scenario)
        self.plant, self.trim = ready(truth)
        self._may_fly_again = prepare is None
        if prepare is not None:
            prepare(self.plant)
            self.plant.executive = 0  # whatever was done to its `run` is to be called
        take_off(self.plant, truth, self.trim)
        self.frames = configure_design(scenario, declared.travel_rad)
        self.cockpit = Cockpit(self.plant, self.frames)
        self.cockpit.read()
        known = known_trim(declared)
        held = known.u if self.from_ground and scenario.initial.on_ground else self.trim.surfaces_rad.values()
        self.trimmed = Trim(*known, np.array(list(held)))
        configure_at_trim(self.frames[0], scenario, self.trimmed)
        self.schedule = FaultSchedule(scenario.faults, self.plant, scenario.rate_hz)
        instruments = self.frames["instruments"][0]
        self.sensor_schedule = SensorFaultSchedule(scenario.faults, instruments, scenario.rate_hz)
        self._turbulent = scenario.environment.is_turbulent
        self.frames["running"]["turbulent"] = self._turbulent
        self.gust = GustSchedule(scenario.environment.gusts, self.plant, scenario.rate_hz)
        self.n_frames = round(scenario.duration_s * scenario.rate_hz)
        self.plugin_frame = self._with_plugins(detector, law)
        self.columns = lay_out(self.frames[0], scenario, self.plugin_verdict is None)
        self.log = memory.taken((min(CHUNK_ROWS, self.n_frames), len(self.columns)))
        self.references = np.empty((len(self.log), 3))
        self._order = np.zeros(2, np.int64)
        self._inside = 0  # JSBSim frames of the coming frame that have been flown already
        self.windows = Windows()
        self.after_frame: Callable[[], None] | None = None  # called once a frame has been flown
        expect(self._kernels)
        self.fly_with(self.plugin_frame)
        self.changing: Changing | None = None
        if scenario.changes:
            self.change(scenario, 0)
        set_origin(self.frames["truth"][0], self.plant, scenario.initial.altitude_m)

    def _kernels(self) -> "Iterable[Wanted]":
        """What this flight will call, if nothing is plugged in: asked for only if some of it is missing."""
        from beaver_ftc.loop.kernels_flown import kernels_flown

        arrays = self.references, self.log, self._order
        return () if self.plugin_frame else kernels_flown(self.frames, arrays)

    def change(self, scenario: Scenario, k: int) -> None:
        """Fly by a scenario that says what changes in flight, nothing of it before frame k, the next to fly.

        Nothing of what changes it is imported without need.
        """
        from beaver_ftc.loop.changing import Changing

        self.changing = self.changing or Changing(self)
        self.changing.plan(scenario, k)

    def _with_plugins(self, detector: "Detector | None", law: "Law | None") -> "PluginFrame | None":
        """The frame in which plug-ins take part; None, and nothing of it imported, if all is compiled in."""
        scheme, named = self.scenario.fdi.scheme, self.scenario.control.law
        if detector is law is None and is_compiled(DETECTORS, scheme) and is_compiled(LAWS, named):
            return None
        from beaver_ftc.loop.plugin_setup import named_detector, named_law, plugged

        if detector is None:
            detector = named_detector(self.scenario)
        if law is None:
            law = named_law(self.frames, self.scenario, self.trimmed)
        return plugged(self.frames, self.scenario, self.trimmed, detector, law)

    @property
    def plugin_verdict(self) -> "Verdict | None":
        """The last verdict of the plug-in that diagnoses; None if the built-in diagnosis does."""
        plugins = self.plugin_frame
        return None if plugins is None or plugins.detector is None else plugins.verdict

    def fly_with(self, plugins: "PluginFrame | None") -> None:
        """Fly on with these plug-ins, or with none. fly_frame: what Python is to call, None if nothing."""
        self.plugin_frame = plugins
        self.fly_frame: Callable[..., int] | None = plugins
        if plugins is None and not (self.cockpit.native and self.plant.executive):
            self.fly_frame = direct(fly_frame, self.frames, self.references, self.log)

    def direct(self, kernel: Callable[..., int]) -> Callable[..., int]:
        """Compiled frames as this flight calls them: `stepping.fly_on`, or another in its place."""
        return direct(kernel, self.frames, self.references, self.log, self._order)

    def land(self, scenario: Scenario | None = None) -> Landing:
        """What the flight has yielded so far; scenario: another that says what was flown."""
        replaced = tuple(self.changing.replaced if self.changing else ())
        windows = tuple(self.windows.until_now(self))
        flown = scenario or self.scenario
        return landing_of(flown, self.frames[0], self.columns, self.plugin_verdict, replaced, windows)

    def release(self) -> None:
        """Give aircraft and memory back for another flight. This flight cannot be used any more."""
        expect(None)
        if self._may_fly_again:
            self._may_fly_again, self.changing = False, None  # which refers back: a collector's work
            give_back(self.plant)
            memory.give_back(self.frames)
            memory.give_back(self.log)

    def hold(self, deflections: np.ndarray | None) -> None:
        """Command (n,) rad in the law's place, from the frame just flown on; None gives it back."""
        self.frames["held"] = deflections is not None
        if deflections is not None:
            self.frames["held_rad"] = deflections
            direct(hold, self.frames)(self.frames)
            if not self.cockpit.native:
                self.cockpit.write()

    def chunks(self) -> Iterable[np.ndarray]:
        """Fly; yield the log a chunk at a time, rows (n, columns). The array is reused."""
        for start in range(0, self.n_frames, CHUNK_ROWS):
            status = self.fly_chunk(start, min(CHUNK_ROWS, self.n_frames - start))
            yield self.log[: int(self.frames["row"][0])]
            if status != FLYING:
                return

    def sample_references(self, start: int, rows: int) -> None:
        """Find the references of frames start to start + rows, for the first rows of the log to come."""
        self.references[:rows] = sample_frames(self.scenario.reference, start, rows, self.scenario.rate_hz)
        self.frames["row"] = 0

    def fly_chunk(self, start: int, rows: int) -> int:
        """Frames start to start + rows, into the first rows of the log; returns why it ended."""
        self.sample_references(start, rows)
        k, end, status = start, start + rows, FLYING
        while k < end and status == FLYING:
            stop = min(self.turn_to(k), end)
            status, k = self.fly_segment(k, stop), stop
        return status

    def turn_to(self, k: int) -> int:
        """Bring faults, gusts and changes to frame k, the next to fly; returns when to call again."""
        self.windows.turn_to(self, k, (*self.schedule.in_force(k), *self.sensor_schedule.in_force(k)))
        parts: tuple[Any, ...] = (self.schedule, self.sensor_schedule, self.gust)
        for part in parts:
            part.apply(k)
        truth = self.frames["truth"][0]  # which keeps the faults for the oracle and the accounts
        if (self.schedule.begun(k) or self.sensor_schedule.begun(k)) and not truth["faulted"]:
            truth["faulted"], truth["fault_at_s"] = 1, k / self.scenario.rate_hz
        note_failures(truth, self.plant)
        if self.changing is not None:
            self.changing.apply(k)
            parts = (*parts, self.changing)
        return min(part.next_change(k) for part in parts)

    def declare(self, faults: Sequence[Any]) -> None:
        """Take these faults for the flight's, between two frames."""
        self.schedule.declare(faults)
        self.sensor_schedule.declare(faults)

    def fly_segment(self, k: int, stop: int) -> int:
        """Frames k to stop, in which no fault changes."""
        status = self.fly_frames(1, 0) if k == 0 else FLYING
        if status != FLYING:
            return status
        runs, self._inside = self.scenario.substeps - self._inside, 0
        with translated(self.aircraft.jsbsim):
            return self.fly_frames(stop - max(k, 1), runs)

    def fly_inside(self, runs: int) -> None:
        """So many of JSBSim's frames inside the coming frame, fewer than it has: the next segment, of this
        frame alone, flies the others. The truth is seen at each but not acted upon."""
        if not (self._inside or self.cockpit.native):
            self.cockpit.write()
        for _ in range(runs):
            self._run()
            self._look(self.frames)
        self._inside += runs

    def fly_frames(self, count: int, runs: int) -> int:
        """So many frames of the loop, each of so many JSBSim frames, in which no fault changes."""
        frames, references, log, fly_frame = self.frames, self.references, self.log, self.fly_frame
        if fly_frame is None:
            return self._fly_compiled(count, runs)
        as_it_is = runs == 1 and self.cockpit.native and not self._turbulent
        advance = self.plant.run if as_it_is else partial(self._advance, runs)
        for _ in range(count):
            advance()
            status = fly_frame(frames, references, log)
            if self.after_frame is not None:
                self.after_frame()
            if status:
                return self._landed(status)
        return FLYING

    def _fly_compiled(self, count: int, runs: int) -> int:
        """The same without leaving compiled code, but for an instant now and then: others wait for it."""
        order, fly_on, after_frame = self._order, self.fly_on, self.after_frame
        taken, order[1] = (self.frames, self.references, self.log, order), runs
        while count > 0:
            order[0] = now = min(count, AT_ONCE if after_frame is None else 1)
            count -= now
            status = fly_on(*taken)
            if after_frame is not None:
                after_frame()
            if status:
                return self._landed(status)
        return FLYING

    @cached_property
    def fly_on(self) -> Callable[..., int]:
        """Frames of the loop with JSBSim's between them, as `stepping.fly_on`."""
        return self.direct(fly_on)

    def _advance(self, runs: int) -> None:
        """Hand the command over, run, and read; between two runs the truth is seen but not acted upon."""
        if not self.cockpit.native:
            if runs:
                self.cockpit.write()
            else:
                self.cockpit.read()
        for left in reversed(range(runs)):
            self._run()
            if left:
                self._look(self.frames)

    def _run(self) -> None:
        """One of JSBSim's frames, and what it shows."""
        if self._turbulent:
            self.cockpit.turn_air()
        self.plant.run()
        if not self.cockpit.native:
            self.cockpit.read()

    @cached_property
    def _look(self) -> Callable[[np.ndarray], int]:
        return direct(sense_inside, self.frames)

    def _landed(self, status: int) -> int:
        if status == NOT_FINITE:
            names = [name for name, _, _ in ch.truth_channels(self.aircraft)]
            sound = np.isfinite(self.frames["truth"]["value"][0][: len(names)])
            bad = [name for name, finite in zip(names, sound, strict=True) if not finite]
            raise SimulationFailed(
                f"{self.scenario.name}: not finite at {self.frames['t'][0]:g} s: {', '.join(bad)}; "
                "the flight cannot go on"
            )
        self.frames["departed"] = status
        return status


def fly(
    scenario: Scenario,
    sink: LogSink | None = None,
    progress: Callable[[float], None] | None = None,
    detector: "Detector | None" = None,
    law: "Law | None" = None,
    prepare: Callable[[Plant], None] | None = None,
    watch: Callable[[Loop], Callable[[], None]] | None = None,
) -> Landing:
    """Fly a scenario. The log goes to `sink`; `progress` is called with the share flown, chunk by chunk, and
    oftener where a plug-in flies: nobody knows how long it takes.

    detector, law: plug-ins to fly with, in place of those the scenario names. prepare: called with the
    trimmed plant just before the flight. watch: called with the flight; what it returns, as that ends.

    Raises BadInput when the flight cannot be trimmed or asks for what there is not, SimulationFailed when a
    value is not finite. In several threads, one flight is flown after the other.
    """
    with ONE_FLIES, ExitStack() as at_the_end:
        loop = Loop(scenario, detector, law, prepare)
        at_the_end.callback(loop.release)
        over = None if watch is None else watch(loop)
        if sink is not None:
            sink.open(loop.columns)
        if progress is not None and loop.plugin_frame is not None:
            loop.after_frame = _told(loop, progress)
        for rows in loop.chunks():
            if sink is not None:
                sink.write(rows)
            if progress is not None:
                progress(loop.frames["k"][0] / loop.n_frames)
        if over is not None:
            over()
        if sink is not None:
            sink.close()
        return loop.land()


def _told(loop: Loop, progress: Callable[[float], None]) -> Callable[[], None]:
    """What to call after each frame, so that progress is told every so many."""
    before, frames, n_frames = loop.after_frame, loop.frames["k"], loop.n_frames

    def after_frame() -> None:
        if before is not None:
            before()
        if frames[0] % TOLD_FRAMES == 0:
            progress(frames[0] / n_frames)

    return after_frame
