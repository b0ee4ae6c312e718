"""The flight that the page shows: it carries out requests, notices events, and makes the messages to the
pages."""

from collections import deque
from collections.abc import Sequence
from datetime import UTC, datetime
from math import cos, sin, tan
from pathlib import Path
from typing import Any

import numpy as np

import beaver_ftc as bf
from beaver_ftc.aircraft import GRAVITY_MPS2, Aircraft
from beaver_ftc.documents import BadInput, suggestion
from beaver_ftc.plugins import DETECTORS, LAWS, is_compiled, registered
from beaver_ftc.results import SpooledLog
from beaver_ftc.scenario import channels_of, checked_against, fault_of, sensors_there
from beaver_ftc.scenario.faults import HOLDING, TYPES, place_of
from beaver_ftc_live.page import messages
from beaver_ftc_live.page.game import BROKEN, NOTHING, Fault, Game, hidden_faults
from beaver_ftc_live.page.messages import WHEN, Message, in_words, short, verdict_in_words

LONGEST_S = 3600.0  # of one live flight: its log is 0.4 GB then
HELD = ("altitude_m", "airspeed_mps", "heading_deg")  # by the autopilot that the page asks for
EVENTS_KEPT = 400
STICK_FRAMES = 10  # between two updates of the rates of a coordinated turn
TURN_STEP = np.radians(0.1)  # rad/s, to which these rates are rounded
NO_STICK = messages.Stick(do="stick", rates_deg_s=(0.0, 0.0, 0.0))
GUST_S = {"rise_s": 0.5, "hold_s": 1.0, "fade_s": 0.5}
PATIENCE_S = 10.0  # a round of the game ends so long after the answer, if the diagnosis names no fault
INSTRUMENTS = "instruments"
OF_A_FLIGHT = ("break", "repair", "blow", "aim", "change")  # requests that a finished flight refuses
OF_A_ROUND = ("stick", "aim", "blow", "fresh", "game")  # requests whose replies cannot tell what is hidden
CHANGES_NOTHING = ("save", "stick")  # requests after which a saved folder still has all of the flight
HIDDEN = (
    "_effective_rad", "_pos_rad", "_effectiveness_estimate", "_effectiveness_used", "mode", "detected",
    "_residual_rad_s", "_threshold_rad_s", "_network_rad_s2", "_likelihood_share", "_design_rad_s2",
    "_eta_bar_rad_s2", "airspeed_limited_mps",
)  # fmt: skip
HIDDEN_WHOLE = ("fie_", "watch_")


MOST_LISTED = 4  # candidates: more are counted


def remaining_text(candidates: Sequence[str], before: Sequence[str]) -> str:
    """The candidates, or how many there are; and those excluded since the event before."""
    few = len(candidates) <= MOST_LISTED
    said = (", ".join(candidates) or "none left") if few else f"{len(candidates)} remain"
    gone = [name for name in before if name not in candidates]
    more = f" and {len(gone) - MOST_LISTED} more" if len(gone) > MOST_LISTED else ""
    return said if few or not gone else f"{said}; excluded: {', '.join(gone[:MOST_LISTED])}{more}"


class Session:
    """One flight at a time, restarted by `fresh`. out: where `save` writes.

    unreported: folders that were saved, and have no report so far.
    """

    sim: "bf.Simulation"

    def __init__(self, scenario: "bf.Scenario", out: Path, seed: int | None = None) -> None:
        self._given, self._base, self._out = scenario, scenario, out
        self._rng = np.random.default_rng(seed)
        self.game = Game()
        self.stick = NO_STICK
        self.unreported: list[Path] = []
        self._by = ""
        self._flown_stick: tuple[float, ...] | None = None
        self._begin(scenario)

    def _begin(self, scenario: "bf.Scenario", faults: bool = True) -> None:
        """Begin a new flight in trim. If it cannot be flown: raises BadInput, and the old flight
        continues."""
        flown = as_live(scenario if faults else scenario.with_({"faults": [], "expect": {}}))
        sim = bf.Simulation(flown, log=SpooledLog())
        sim.step()
        if hasattr(self, "sim"):
            self.sim.release()
        self._take_up(scenario, flown, sim)

    def _take_up(self, scenario: "bf.Scenario", flown: "bf.Scenario", sim: "bf.Simulation") -> None:
        """Show this flight, without any events yet. scenario: as given; flown: as prepared for the page."""
        self._base, self.scenario, self.sim = scenario, flown, sim
        self.columns = sim.columns
        self.surfaces = tuple(c.removesuffix("_cmd_rad") for c in self.columns if c.endswith("_cmd_rad"))
        told = (name.endswith(HIDDEN) or name.startswith(HIDDEN_WHOLE) for name in self.columns)
        self._hidden = [i for i, tells in enumerate(told) if tells]
        self.fresh_events: list[Message] = []
        self.told: deque[Message] = deque(maxlen=EVENTS_KEPT)
        self.flying = {"law": flown.control.law, "scheme": flown.fdi.scheme}
        self._gust_until_s = 0.0
        self._said: tuple[Any, ...] = (None, None, None, (), False)
        self._mode = sim.mode
        turns = {at_s for fault in flown.faults for at_s in (fault.at_s, fault.end_s) if at_s is not None}
        self._turns_s = deque(sorted(turns))
        self._known: tuple[Any, ...] = ()
        self._saved = ""  # what was said of the folder that has all of this flight, if there is one
        self._broken_by: dict[str, str] = {}
        self._tell("flight", f"{scenario.name}: trimmed, {flown.control.law} law, {flown.fdi.scheme}")

    @property
    def over(self) -> bool:
        """Whether the flight has ended, by loss of the aircraft or by its length."""
        return self.sim.done

    def step(self) -> None:
        """Fly one frame, and note its events."""
        self._saved = ""
        if self.game.is_due(self.sim.t_s):
            self._inject(self.game.fault)
        if self.sim.frames % STICK_FRAMES == 0 or not self.stick.coordinated:
            self._flown_stick = self._rates_rad_s()
        self.sim.step(stick=self._flown_stick)
        self._notice_faults()
        self._notice()
        if self.game.settle(PATIENCE_S, self.sim.t_s):
            self._tell("game", "the round is over")

    def _notice_faults(self) -> None:
        """Note faults of the scenario that begin or end."""
        if not self._turns_s or self.sim.t_s < self._turns_s[0]:
            return
        self._turns_s.popleft()
        before, self._known = self._known, self.sim.in_force
        for fault in self._known:
            if fault not in before:
                self._tell("broken", in_words(fault.model_dump(include=fault.model_fields_set)), secret=True)
        for fault in before:
            if fault not in self._known:
                self._tell("repaired", f"{place_of(fault)}: {fault.type.replace('_', ' ')}", secret=True)

    def _notice(self) -> None:
        """Note an alarm, a name, new candidates, a new mode of the supervisor, the loss of the aircraft."""
        sim, verdict, t_s = self.sim, self.sim.verdict, self.sim.t_s
        alarm = (verdict.axis or INSTRUMENTS) if verdict.detected else None
        said = (alarm, verdict.isolated, verdict.type, verdict.candidates, sim.departed)
        if said == self._said and sim.mode == self._mode:
            return
        before, self._said = self._said, said
        if alarm and before[0] != alarm:
            beyond = f"residual of {alarm} beyond its threshold"
            against = f"{alarm} disagree beyond their bound"
            self._tell("alarm", beyond if verdict.axis else against, secret=True)
        if verdict.isolated and before[1:3] != said[1:3]:
            self.game.named(verdict.isolated, t_s)
            self._tell("named", verdict_in_words(verdict), secret=True)
        elif verdict.detected and verdict.candidates != before[3] and not verdict.isolated:
            self._tell("candidates", remaining_text(verdict.candidates, before[3]), secret=True)
        if sim.mode != self._mode:
            self._tell("supervisor", f"{self._mode} to {sim.mode}", secret=True)
            self._mode = sim.mode
        if sim.departed:
            self._tell("lost", "the aircraft is lost; start a new flight")

    def _tell(self, kind: str, says: str, secret: bool = False) -> None:
        event = {"t": round(self.sim.t_s, 2), "kind": kind, "says": says, "secret": secret}
        event |= {"by": self._by} if self._by else {}
        self.fresh_events.append(event)

    def take_events(self) -> list[Message]:
        """The events since the last call that a page may see; the others wait for the end of the round."""
        if self.game.hidden:
            told = [event for event in self.fresh_events if not event["secret"]]
            self.fresh_events = [event for event in self.fresh_events if event["secret"]]
        else:
            told, self.fresh_events = self.fresh_events, []
        self.told.extend(told)
        return told

    def handle(self, request: messages.Request, by: str = "") -> str:
        """Carry out a request, by the method of its name; returns the reply. Raises BadInput.

        by: name of the guest who sent it, for the events.
        """
        if self.over and request.do in OF_A_FLIGHT:
            raise BadInput("the flight is over, allowed: a new flight")
        allowed = (*OF_A_ROUND, "break") if self.game.mode == "second" else OF_A_ROUND
        if self.game.hidden and request.do not in allowed:
            raise BadInput(f"{request.do}: a round is on, allowed: after it")
        self._by = by
        self._saved = self._saved if request.do in CHANGES_NOTHING else ""
        try:
            says: str = getattr(self, f"_{request.do}")(request)
        finally:
            self._by = ""
        return says

    def _aim(self, asked: messages.Aim) -> str:
        given = ((channel, getattr(asked, channel)) for channel in HELD)
        targets = {channel: value for channel, value in given if value is not None}
        self.sim.aim(targets)
        says = ", ".join(f"{channel} {value:g}" for channel, value in targets.items())
        self._tell("autopilot", says)
        return says

    def _stick(self, asked: messages.Stick) -> str:
        self.stick = asked
        return ""

    def _rates_rad_s(self) -> tuple[float, ...] | None:
        """Rates, rad/s, that the stick commands; if coordinated, with those of a level turn at the bank that
        the instruments show.

        The latter are rounded, because each change is a row of the saved scenario.
        """
        rates = np.radians(self.stick.rates_deg_s)
        if self.stick.coordinated:
            read = self.sim.measured
            roll_rad, pitch_rad, _ = read.attitude
            turn = level_turn(roll_rad, pitch_rad, airspeed_mps=read.y[2])
            rates = rates + np.round(turn / TURN_STEP) * TURN_STEP
        return tuple(map(float, rates)) if rates.any() else None

    def _blow(self, asked: messages.Blow) -> str:
        self.sim.blow({"velocity_mps": list(asked.velocity_mps), **GUST_S})
        self._gust_until_s = self.sim.t_s + sum(GUST_S.values()) + 1.0 / self.sim.rate_hz
        self._tell("gust", ", ".join(f"{v:g}" for v in asked.velocity_mps) + " m/s (north, east, down)")
        return "gust"

    def _change(self, asked: messages.Change) -> str:
        """Exchange law, diagnosis, sensors; errors of sensors are declared to the diagnosis as well."""
        change = asked.model_dump(include={"law", "scheme", "sensors"}, exclude_none=True)
        declared = {"declared_sensors": asked.sensors} if asked.sensors is not None else {}
        self.sim.change({**change, **declared})
        self.flying |= change
        says = ", ".join(f"{key} {value}" for key, value in change.items())
        self._tell("changed", says)
        return says

    def _break(self, asked: messages.Break) -> str:
        if self.game.phase == BROKEN:  # the first counts, and the reply does not tell that there was one
            with checked_against(self.scenario.airframe):
                fault_of(asked.fault, self.sim.t_s)
            return ""
        return self._inject(dict(asked.fault))

    def _inject(self, fault: Fault) -> str:
        before = self.sim.in_force
        self.sim.inject(fault)
        self._known = self.sim.in_force
        self._broken_by |= {_mark(new): self._by for new in self._known if new not in before and self._by}
        if self.game.hidden:
            self.game.broke(fault, self.sim.t_s)
        says = in_words(fault)
        self._tell("broken", says, secret=True)
        return "" if self.game.hidden else f"{says.partition(':')[0]} broken"

    def _repair(self, asked: messages.Repair) -> str:
        self.sim.repair(asked.actuator)
        self._known = self.sim.in_force
        what = asked.actuator or "everything"
        self._tell("repaired", what, secret=True)
        return f"{what} repaired"

    def _fresh(self, asked: messages.Fresh) -> str:
        base = self._scenario(asked.scenario)
        changes = changes_of(asked, base.airframe)
        self._begin(base.with_(changes) if changes else base)
        self.game.stop()
        return "new flight"

    def _scenario(self, name: str | None) -> "bf.Scenario":
        """The scenario last flown, the one of the command line, or a built-in one; a page cannot name
        files."""
        if name is None:
            return self._base
        if name == self._given.name:
            return self._given
        if name not in bf.scenarios():
            raise BadInput(f"scenario: {name!r} is not known{suggestion(name, bf.scenarios())}")
        return bf.load(name)

    def _game(self, asked: messages.Game) -> str:
        if asked.move == "stop":
            self.game.stop()
        elif asked.move == "answer":
            self.game.answer(asked.answer, (*self.surfaces, NOTHING), self.sim.t_s)
            self._tell("game", f"you say: {asked.answer}")
        else:
            self._begin(self._base, faults=False)
            kinds = hidden_faults(self.surfaces, self.scenario.airframe.primary)
            self.game = self.game.next_round(asked.move, self.sim.t_s, kinds, self._rng)
            self._tell("game", "a round begins: something will break")
        return ""

    def _save(self, asked: messages.Save) -> str:
        """Write the result folder, once for one instant: writing stops the flight for a moment."""
        self._saved = self._saved or self._written()
        return self._saved

    def _written(self) -> str:
        flight = self.sim.land()
        declared = sorted(flight.scenario.faults, key=lambda fault: fault.at_s)
        for fault, document in zip(declared, flight.metrics["faults"], strict=True):
            document.update(self._by_whom(fault))
        folder = flight.save(self._out, report=False)
        self.unreported.append(folder)
        self._tell("saved", folder.name)
        return f"saved: {folder}; fly it again: beaver-ftc run {folder / 'scenario.yaml'}"

    def reported(self, says: str) -> None:
        """Tell what has become of the report of a saved flight."""
        self._tell("saved", says)

    def frame(self) -> Message:
        """What the page draws, of the frame just flown."""
        sim, hidden = self.sim, self.game.hidden
        values = [short(value) for value in sim.values]
        for i in self._hidden if hidden else ():
            values[i] = None
        seen = {"k": "f", "v": values, "stick": self._flown_stick}
        if hidden:
            return seen
        verdict = sim.verdict
        said = ("detected", "axis", "isolated", "type", "candidates", "estimate")
        seen |= {name: getattr(verdict, name) for name in said}
        effectiveness = [short(self._effectiveness(surface)) for surface in self.surfaces]
        said_of_all = {"mode": sim.mode, "effectiveness": effectiveness, "inconclusive": sim.inconclusive}
        return seen | said_of_all

    def _effectiveness(self, surface: str) -> float:
        """Share of its moment that a surface gives for its command; 0 while it does not follow the
        command."""
        stands = any(self.sim.read(f"failures/{surface}/{how}") for how in HOLDING)
        return 0.0 if stands else self.sim.read(f"failures/{surface}/effectiveness")

    def state(self) -> Message:
        """The message about all that changes rarely."""
        there = () if self.game.hidden else self.sim.in_force
        return {
            "k": "s", "over": self.over, "game": self.game.shown(),
            "gust": self.sim.t_s < self._gust_until_s, "flying": self.flying, "knows": self._knows,
            "broken": sorted({place_of(fault) for fault in there}),
            "faults": [
                fault.model_dump(exclude=WHEN, exclude_none=True) | self._by_whom(fault) for fault in there
            ],
        }  # fmt: skip

    def _by_whom(self, fault: Any) -> Message:
        """The guest who broke it, if one did."""
        by = self._broken_by.get(_mark(fault))
        return {"by": by} if by else {}

    @property
    def _knows(self) -> str:
        """Which faults the active diagnosis can name; empty for a plug-in and without a diagnosis."""
        if self.flying["scheme"] == "none" or not is_compiled(DETECTORS, self.flying["scheme"]):
            return ""
        every = self.scenario.fdi.fault_class == "all"
        return "knows every fault type" if every else "knows partial loss alone"

    def hello(self) -> Message:
        """The message that a page receives before the first frame of a flight."""
        scenario = self.scenario
        with checked_against(scenario.airframe):
            sensors = sensors_there()
        return {
            "k": "hello", "columns": self.columns, "surfaces": self.surfaces,
            "scenario": self._base.name, "description": self._base.description, "rate_hz": scenario.rate_hz,
            "law": self.flying["law"], "scheme": self.flying["scheme"],
            "fault_class": scenario.fdi.fault_class, "aircraft": str(scenario.aircraft),
            "damage": {case: list(of.takes) for case, of in scenario.airframe.damage.items()},
            "sensors": sensors, "travel_rad": [list(map(float, limits)) for limits in self.sim.travel_rad],
            "autopilot": list(scenario.autopilot.channels if scenario.autopilot else ()),
            "trim_rad": list(map(float, self.sim.trim_rad)),
            "scenarios": sorted({*bf.scenarios(), self._given.name}),
            "laws": list(registered(LAWS)), "schemes": list(registered(DETECTORS)),
            "stick_deg_s": messages.STICK_DEG_S, "fastest": messages.FASTEST,
            "events": list(self.told), **fault_types(),
        }  # fmt: skip


def _mark(fault: Any) -> str:
    """A key of a fault that a repair does not change."""
    return str(fault.model_dump_json(exclude={"end_s"}))


def fault_types() -> Message:
    """The buttons that break a surface, and the words for the estimate of each fault type."""
    buttons = sorted((row.button, kind) for kind, row in TYPES.items() if row.button)
    return {
        "breaks": [[button.says, {"type": kind, **button.keys}] for button, kind in buttons],
        "sizes": {kind: row.size for kind, row in TYPES.items() if row.size},
    }


def level_turn(phi_rad: float, theta_rad: float, airspeed_mps: float) -> np.ndarray:
    """Body rates (3,), rad/s, of a coordinated level turn with psi' = g tan(phi) / V:

    (p, q, r) = psi' (-sin(theta), sin(phi) cos(theta), cos(phi) cos(theta))
    """
    turn = GRAVITY_MPS2 * tan(phi_rad) / airspeed_mps
    return turn * np.array([-sin(theta_rad), sin(phi_rad) * cos(theta_rad), cos(phi_rad) * cos(theta_rad)])


def as_live(scenario: "bf.Scenario") -> "bf.Scenario":
    """The flight of a page: it is long and expects nothing, and ready for what can be broken there."""
    stamp = datetime.now(UTC).strftime("%Y%m%d-%H%M%S-%f")[:-3]
    changes = {"name": f"live-{scenario.name[:60]}-{stamp}", "expect": {}, "duration_s": LONGEST_S}
    return ready_for_hands(scenario).with_(changes)


def ready_for_hands(scenario: "bf.Scenario") -> "bf.Scenario":
    """Its diagnosis knows every fault type that can be broken by hand, and watches the instruments, which can
    be broken too, unless the scenario says otherwise.

    A watch that began with the first instrument broken would make of the flight before it another than the
    saved scenario's, in which that fault is said from the start.
    """
    changes: dict[str, Any] = {}
    if "sensor_monitor" not in scenario.fdi.model_fields_set:
        changes["fdi.sensor_monitor"] = "always"
    if "fault_class" not in scenario.fdi.model_fields_set:
        changes["fdi.fault_class"] = "all"
    return scenario.with_(changes) if changes else scenario


def changes_of(request: messages.Fresh, aircraft: Aircraft) -> dict[str, Any]:
    """Dotted keys of the scenario for what a new flight asks. Errors of the air and the sensors are declared
    to the diagnosis as well: its bounds then include them."""
    keys = (
        ("control.law", request.law),
        ("fdi.scheme", request.scheme),
        ("fdi.fault_class", request.fault_class),
        ("sensors", request.sensors),
        ("fdi.bounds.sensors", request.sensors),
        ("fdi.bounds.turbulence", request.turbulence),
    )
    changes: dict[str, Any] = {key: value for key, value in keys if value is not None}
    if request.autopilot is not None:
        held = [channel for channel in HELD if channel in channels_of(aircraft)]
        changes["autopilot"] = {channel: [{"hold": True}] for channel in held} if request.autopilot else None
    if request.turbulence is not None:
        still = request.turbulence == "none"
        changes["environment.turbulence"] = "none" if still else "dryden"
        changes["environment.severity"] = None if still else request.turbulence
    return changes
