"""A flight step by step: between steps the caller may read, break, repair, steer and command.

What is done to a flight is kept, frame by frame: `scenario_flown` says it all and flies it again to the bit.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from copy import copy
from difflib import get_close_matches
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from beaver_ftc.control.profile import set_up_profile
from beaver_ftc.documents.errors import BadInput, suggestion
from beaver_ftc.loop.findings import verdict_of
from beaver_ftc.loop.inconclusive import inconclusive_now
from beaver_ftc.loop.loop import CHUNK_ROWS, FLYING, ONE_FLIES, LogSink, Loop
from beaver_ftc.loop.outcome import Landing
from beaver_ftc.loop.plugin_context import measured_of
from beaver_ftc.loop.readout import FrameReadout
from beaver_ftc.plant.adapter import Plant, UnknownProperty
from beaver_ftc.plant.faults import is_there
from beaver_ftc.plant.true_aircraft import GustSchedule
from beaver_ftc.scenario import interventions
from beaver_ftc.scenario.airframe import checked_against
from beaver_ftc.scenario.declared import Declared
from beaver_ftc.scenario.diagnosis import MODES
from beaver_ftc.scenario.faults import (
    DAMAGE,
    MOST_FAULTS,
    UNANTICIPATED,
    fault_name,
    place_of,
    without_effect,
)
from beaver_ftc.scenario.interventions import StickTrack, fault_of, is_same_again
from beaver_ftc.scenario.schema import Scenario
from beaver_ftc.scenario.sensors import sensors_there
from beaver_ftc.scenario.signals import RAD_PER_DEG, sample_deg_s

if TYPE_CHECKING:
    from beaver_ftc.control import Law
    from beaver_ftc.diagnosis import Detector, Measured, Verdict

Vector = NDArray[np.float64]


class Asked(NamedTuple):
    """What a flight was asked for: the method's name, its arguments, and the frames of a step.

    Steps in a row with the same arguments are one. before: frames of all of them but the last, whose rows the
    flight still has (`rows`).
    """

    what: str
    given: Mapping[str, Any]
    frames: int = 0
    before: int = 0

    def is_same(self, what: str, given: Mapping[str, Any]) -> bool:
        """Whether it is a call of this method with these arguments."""
        if self.what != what:
            return False
        both = ((of, given[name]) for name, of in self.given.items())
        return all(a is b or (a is not None and b is not None and np.array_equal(a, b)) for a, b in both)


class Stepping:
    """A flight in progress. The first step flies frame 0 as well, in which the trimmed flight is measured.

    sink: where the log goes. prepare: called with the trimmed plant just before the flight.
    """

    _loop_type = Loop

    def __init__(
        self,
        scenario: Scenario,
        detector: "Detector | None" = None,
        law: "Law | None" = None,
        sink: LogSink | None = None,
        prepare: Callable[[Plant], None] | None = None,
    ) -> None:
        self._given, self._plug_ins, self._prepare, self._sink = scenario, (detector, law), prepare, sink
        self._make_ready()

    def reset(self, *, seed: int | None = None) -> None:
        """Start the same scenario again in trim, without injected faults and with an empty log.

        - `seed`: seed of the new flight; None keeps the seed.

        After a reset, the flight has exactly the same numbers as that of a new `Simulation`.
        """
        if seed is not None:
            self._given = self._given.with_({"seed": seed})
        self.release()
        self._make_ready()

    def release(self) -> None:
        """Release the aircraft and the memory, so that another flight can use them. Afterwards you cannot use
        this simulation.
        """
        with ONE_FLIES:
            self._loop.release()

    def _make_ready(self) -> None:
        self._scenario, self._faults = self._given, self._given.faults
        with ONE_FLIES:
            self._loop = self._loop_type(self._scenario, *self._plug_ins, self._prepare)
        self._frame: np.void = self._loop.frames[0]
        self._k_flown, self._rows_flown = (self._loop.frames[name].item for name in ("k", "row"))
        self._next = 0  # frame to be flown
        self._turn_at = 0  # frame before which the loop must be told what changes
        self._written = 0  # rows of this chunk of the log that the sink has
        self._status = FLYING
        self._by_hand = False  # whether a step had a command of the surfaces
        self._stick = StickTrack()
        self._asked: list[Asked] = []  # of this flight, so far
        self._unsteered: tuple[int, Vector] | None = None  # references of a chunk, and its first frame
        self._last: list[Vector] = []  # rows of the last step, a piece a segment
        if self._sink is not None:
            self._sink.open(self._loop.columns)

    @property
    def rate_hz(self) -> float:
        """Frames a second."""
        return self._scenario.rate_hz

    @property
    def t_s(self) -> float:
        """Time of the frame just flown, s since the start."""
        return float(self._frame["t"])

    @property
    def frames(self) -> int:
        """Frames flown so far."""
        return self._next

    @property
    def done(self) -> bool:
        """Whether the flight is over: its duration flown, or the aircraft lost."""
        return self.departed or self._next >= self._loop.n_frames

    @property
    def departed(self) -> bool:
        """Whether the aircraft has been lost."""
        return self._status != FLYING

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the log's columns."""
        return self._loop.columns

    @property
    def values(self) -> Vector:
        """The log's row of the frame just flown, (columns,)."""
        return np.asarray(self.rows[-1])

    @property
    def rows(self) -> Vector:
        """The log's rows of the last step, (frames, columns); of the first step, frame 0 as well."""
        self._begin()
        return np.concatenate(self._last) if len(self._last) > 1 else self._last[0]

    @property
    def measured(self) -> "Measured":
        """What the instruments and the design model say of the frame just flown."""
        self._begin()
        return measured_of(self._frame)

    @property
    def verdict(self) -> "Verdict":
        """What the diagnosis makes of the flight so far."""
        return self._loop.plugin_verdict or verdict_of(self._frame, self._surfaces)

    @property
    def inconclusive(self) -> str:
        """Why the built-in diagnosis can conclude nothing at this frame; empty if it can, or a plug-in
        diagnoses."""
        plugged = self._loop.plugin_verdict is not None
        return "" if plugged else inconclusive_now(self._frame, self._loop.aircraft)

    @property
    def mode(self) -> str:
        """Who is in charge, by the supervisor's word: nominal, adaptive, reallocated or unanticipated."""
        return MODES[int(self._frame["supervisor"]["mode"])]

    @property
    def readout(self) -> FrameReadout:
        """The flight at the frame just flown."""
        self._begin()
        return FrameReadout(self._frame)

    @property
    def records(self) -> np.ndarray:
        """The flight's record as an array (1,), of `frame_dtype`; the flight goes on in it."""
        self._begin()
        return self._loop.frames

    @property
    def trim_rad(self) -> Vector:
        """Surfaces in trim, (surfaces,) rad."""
        return np.array(self._frame["control"]["layout"]["trim"])

    @property
    def travel_rad(self) -> Vector:
        """Lower and upper stops, (2, surfaces) rad."""
        layout = self._frame["control"]["layout"]
        return np.array([layout["low"], layout["high"]])

    def step(
        self, command: ArrayLike | None = None, *, frames: int = 1, stick: ArrayLike | None = None
    ) -> None:
        """Fly one frame, or several.

        - `command` (surfaces,) rad: replaces the command of the law in these frames. The command is limited
          to the travel of the surfaces.
        - `frames`: number of frames.
        - `stick` (3,) rad/s: body rates that are added to the reference of the scenario in these frames.

        Raises BadInput if an array has a wrong shape, and if the flight has ended. Raises SimulationFailed if
        a value becomes infinite or NaN.
        """
        if self.done:
            raise BadInput(f"{self._scenario.name}: the flight is over at {self.t_s:g} s, allowed: reset()")
        if not isinstance(frames, int | np.integer) or frames < 1:
            raise BadInput(f"frames: {frames!r} is out of range, allowed: a whole number of at least 1")
        low, high = self.travel_rad
        deflections = None
        if command is not None:
            deflections = _vector(command, low.size, "command", "rad").clip(low, high)
        rate_deg_s = None if stick is None else _vector(stick, 3, "stick", "rad/s") / RAD_PER_DEG
        if self._next > 0:
            self._last.clear()
        self._begin()
        self._note_asked("step", int(frames), command=deflections, stick=stick)
        self._loop.hold(deflections)  # in the law's place, from the frame just flown on; None gives it back
        self._by_hand |= deflections is not None
        self._fly_to(min(self._next + int(frames), self._loop.n_frames), rate_deg_s)

    def inject(self, fault: Mapping[str, Any]) -> None:
        """Inject a fault that begins in the next frame.

        - `fault`: the keys of a fault in a scenario file, without `at_s`.

        If the same fault is already present, the call has no effect. Raises BadInput if a key or value is
        wrong, or if the fault would have no effect because of another fault of its surface. The message names
        the key.
        """
        with checked_against(self._loop.aircraft):
            new = fault_of(fault, self._now_s)
        if any(is_same_again(new, known) for known in self._faults):
            return
        if len(self._faults) >= MOST_FAULTS:
            raise BadInput(f"faults: this flight has had {MOST_FAULTS}, allowed: a new flight, or fewer")
        for _, says in without_effect((*self._faults, new)):
            raise BadInput(f"fault: {says}")
        self._note_asked("inject", fault=dict(fault))
        self._declare((*self._faults, new))

    def repair(self, actuator: str | None = None) -> None:
        """End faults that have begun.

        - `actuator`: name of the surface or sensor whose fault ends. `unanticipated` ends a fault of the
          aerodynamics. `damage` ends a structural damage, if the aircraft declares one. None ends all faults.

        A fault that has not begun yet stays in the scenario. Raises BadInput for any other name.
        """
        with checked_against(self._loop.aircraft):
            names = (
                *self._surfaces,
                *sensors_there(),
                UNANTICIPATED,
                *([DAMAGE] if self._loop.aircraft.damage else []),
            )
            actuator = fault_name(actuator, names)
        if actuator is not None and actuator not in names:
            raise BadInput(f"actuator: {actuator!r:.60} is not known{suggestion(str(actuator), names)}")
        self._note_asked("repair", actuator=actuator)
        self._declare(tuple(self._repaired(fault, actuator) for fault in self._faults))

    @property
    def in_force(self) -> tuple[Any, ...]:
        """The faults that are there in the next frame: begun, and neither repaired nor over."""
        return tuple(fault for fault in self._faults if is_there(fault, self._next, self.rate_hz))

    def blow(self, gust: Mapping[str, Any]) -> None:
        """Start a gust in the next frame.

        - `gust`: the keys of an entry of `environment.gust`, without `at_s`.

        Raises BadInput if a key or value is wrong, and if another gust is still active.
        """
        self._begin()
        self._scenario = interventions.with_gust(self._scenario, gust, self._now_s)
        self._note_asked("blow", gust=dict(gust))
        gusts = self._scenario.environment.gusts
        self._loop.gust, self._turn_at = GustSchedule(gusts, self._loop.plant, self.rate_hz), self._next

    def change(self, change: Mapping[str, Any]) -> None:
        """Change the law, the diagnosis or the sensors. The change acts from the next frame on.

        - `change`: the keys of an entry of `changes`, without `at_s`.

        A changed diagnosis restarts. The log keeps its columns. Raises BadInput if a key or value is wrong.
        The flight then continues unchanged.
        """
        self._begin()
        scenario = interventions.with_change(self._scenario, change, self._now_s)
        self._loop.change(scenario, self._next)
        self._note_asked("change", change=dict(change))
        self._scenario, self._turn_at = scenario, self._next

    def aim(self, targets: Mapping[str, float]) -> None:
        """Give the autopilot new targets.

        - `targets`: a mapping from target to value, e.g. `{"altitude_m": 1900}`.

        Raises BadInput if a key or value is wrong. The message names the key.
        """
        self._begin()
        self._scenario = interventions.with_targets(self._scenario, targets, self._now_s)
        set_up_profile(self._loop.frames["autopilot"][0], Declared.of(self._scenario))
        self._note_asked("aim", targets=dict(targets))

    def read(self, name: str) -> float:
        """The value of a JSBSim property, in the unit that its name states.

        - `name`: e.g. `velocities/q-rad_sec`.

        `sim[name]` is the same call. Raises BadInput for an unknown property.
        """
        try:
            return self._loop.plant.read(name)
        except UnknownProperty:
            listed: Any = self._loop.plant.fdm.query_property_catalog("")
            near = get_close_matches(str(name), [line.split(" ")[0] for line in listed.splitlines()], n=1)
            meant = f"{name!r:.80}, did you mean {near[0]}?" if near else f"{name!r:.80}"
            raise BadInput(f"the aircraft has no property {meant}, allowed: one that JSBSim lists") from None

    __getitem__ = read

    def _note_asked(self, what: str, frames: int = 0, **given: Any) -> None:
        """Keep what this flight was asked for; frames: of a step."""
        given = {name: copy(of) for name, of in given.items()}
        before = 0
        if frames and self._asked and self._asked[-1].is_same(what, given):
            last = self._asked.pop()
            before = last.before + last.frames
        self._asked.append(Asked(what, given, frames, before))

    def _do_again(self, asked: Iterable["Asked"], frames: int) -> None:
        """Fly what another flight of this scenario was asked for; frames: how many it has flown."""
        if frames:
            self._begin()
        for each in asked:
            do = getattr(self, each.what)
            if not each.frames:
                do(**each.given)
            for n in filter(None, (each.before, each.frames)):
                do(frames=n, **each.given)

    def scenario_flown(self) -> Scenario:
        """A scenario that repeats this flight with exactly the same numbers.

        The faults of the scenario begin and end at the frames in which you called `inject` and `repair`. Its
        reference contains the stick inputs as tables (`csv`). Its duration is the time that was flown.

        Raises BadInput for a flight with your own surface commands, because a scenario cannot contain them.
        """
        if self._by_hand:
            raise BadInput(
                f"{self._scenario.name}: the surfaces were commanded by hand, allowed in a scenario: "
                "the reference, sticks and faults"
            )
        self._begin()
        return interventions.scenario_flown(self._scenario, self._faults, self._stick, self._next)

    def _as_it_happened(self) -> Scenario:
        """The scenario of the verdict: as given if it was flown to its end and nobody interfered."""
        if self.done and self._faults is self._scenario.faults and not self._stick.moved:
            return self._scenario
        try:
            return self.scenario_flown()
        except BadInput:  # what no scenario can say is left out of it
            said = {"faults": interventions.in_force(self._faults, self._now_s)}
            return self._scenario.model_copy(update=said)

    def _outcome(self) -> Landing:
        """What the flight has yielded so far."""
        self._begin()
        return self._loop.land(self._as_it_happened())

    def _flush(self) -> None:
        """Hand the sink what has been flown since."""
        row = int(self._frame["row"])
        if self._sink is not None and row > self._written:
            self._sink.write(self._loop.log[self._written : row])
        self._written = row

    @property
    def _surfaces(self) -> tuple[str, ...]:
        return self._loop.aircraft.surfaces

    @property
    def _now_s(self) -> float:
        return self._next / self._scenario.rate_hz

    def _begin(self) -> None:
        if self._next == 0:
            self._fly_to(1)

    def _fly_to(self, end: int, stick_deg_s: Vector | None = None) -> None:
        """Frames up to `end`, chunk by chunk as `Loop.chunks` has them, stopping where something changes."""
        loop, k_flown, rows_flown = self._loop, self._k_flown, self._rows_flown
        with ONE_FLIES:
            while self._next < end and self._status == FLYING:
                k = self._next
                if k % CHUNK_ROWS == 0:
                    self._flush()
                    self._written = 0
                    loop.sample_references(k, min(CHUNK_ROWS, loop.n_frames - k))
                if k >= self._turn_at:
                    self._turn_at = loop.turn_to(k)
                stop = min(end, self._turn_at, (k // CHUNK_ROWS + 1) * CHUNK_ROWS)
                self._steer(k, stop, stick_deg_s)
                start = rows_flown()
                try:
                    self._status = loop.fly_segment(k, stop)
                finally:
                    self._next = k_flown()
                    self._note(loop.log[start : rows_flown()])

    def _note(self, rows: Vector) -> None:
        """Keep the rows just flown, (frames, columns), until the next step."""
        self._last.append(rows.copy())

    def _steer(self, k: int, stop: int, stick_deg_s: Vector | None) -> None:
        """Add the stick, (3,) deg/s, to the references of frames k to stop, all in one chunk of the log.

        The sum is formed in deg/s, as a scenario that says the same forms it: to the bit.
        """
        self._stick.move(k, stick_deg_s)
        if stick_deg_s is not None:
            row = slice(k % CHUNK_ROWS, k % CHUNK_ROWS + stop - k)
            self._loop.references[row] = (self._unsteered_deg_s(k)[row] + stick_deg_s) * RAD_PER_DEG

    def _unsteered_deg_s(self, k: int) -> Vector:
        """The scenario's own references of the chunk that frame k is in, (rows, 3) deg/s."""
        start = k - k % CHUNK_ROWS
        if self._unsteered is None or self._unsteered[0] != start:
            t = np.arange(start, min(start + CHUNK_ROWS, self._loop.n_frames)) / self.rate_hz
            self._unsteered = start, sample_deg_s(self._given.reference, t)
        return self._unsteered[1]

    def _declare(self, faults: Sequence[Any]) -> None:
        self._faults = tuple(faults)
        self._loop.declare(self._faults)
        self._turn_at = self._next

    def _repaired(self, fault: Any, actuator: str | None) -> Any:
        ends = actuator in (None, place_of(fault)) and is_there(fault, self._next, self.rate_hz)
        return fault.model_copy(update={"end_s": self._now_s}) if ends else fault


def _vector(given: ArrayLike, size: int, what: str, unit: str) -> Vector:
    """So many finite numbers, or BadInput."""
    try:
        array = np.asarray(given, dtype=float)
    except (TypeError, ValueError):
        array = np.empty(0)
    if array.shape != (size,) or not np.isfinite(array).all():
        shown = " ".join(repr(given).split())
        raise BadInput(f"{what}: {shown:.80} is not usable, allowed: {size} finite numbers, {unit}")
    return array
