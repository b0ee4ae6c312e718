"""Fault injection: when which failure property of the aircraft changes.

A fault at `at_s` is in force in the first frame whose time t >= at_s - 1e-9 s, and in every JSBSim run of
that frame; one with `end_s` is repaired in the first frame whose time t >= end_s - 1e-9 s. Faults may
overlap: effectiveness and rate scale multiply, biases and alpha^3 moments add. Which masks which on one
surface (that is the aircraft's own order) stands in the rows of the types: a scenario with a fault that is
masked as it begins is refused.

A fault of an instrument changes what it says and leaves the aircraft alone. Several of one instrument add up:
offsets add, relative errors multiply, noise adds by its squares; one that is frozen or lost says nothing
else.
"""

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from itertools import zip_longest
from math import hypot, inf
from typing import TYPE_CHECKING, Any

import numpy as np

from beaver_ftc.scenario.faults import DAMAGE, HEALTHY, Past, SensorFault, SurfaceFault, place_of
from beaver_ftc.scenario.instants import frame_of, grown_share
from beaver_ftc.scenario.sensors import QUANTITIES, Sensors

if TYPE_CHECKING:
    from beaver_ftc.plant.adapter import Plant

_SENSORS = tuple(Sensors.model_fields)
NEVER = sys.maxsize
OF_DAMAGE = f"failures/{DAMAGE}"

# 1 - exp(-kappa t) is 1 to the last bit from here on: an incipient fault is then as good as an abrupt one.
_FULLY_GROWN = 37.0


def is_there(fault: Any, k: int, rate_hz: float) -> bool:
    """Whether a fault is in force in frame k: begun, and neither repaired nor over."""
    return _Event(fault, rate_hz).in_force(k)


@dataclass
class _Event:
    """One fault as frames: in force from `first` to before `last`, still growing before `grown`."""

    fault: Any
    rate_hz: float
    past: Past = field(default_factory=Past)
    struck: bool = False
    followed: int = -1  # the last frame that its memory has taken in

    def __post_init__(self) -> None:
        fault, rate_hz = self.fault, self.rate_hz
        self.kappa_per_s = fault.kappa_per_s if fault.profile == "incipient" else inf
        self.first = frame_of(fault.at_s, rate_hz)
        self.last = NEVER if fault.end_s is None else frame_of(fault.end_s, rate_hz)
        self.grown = frame_of(fault.at_s + _FULLY_GROWN / self.kappa_per_s, rate_hz)

    @property
    def place(self) -> str:
        """The folder of the failure properties it changes."""
        return f"failures/{place_of(self.fault)}"

    def in_force(self, k: int) -> bool:
        return self.first <= k < self.last

    def share(self, k: int) -> float:
        """B(t - at_s): how far the fault has grown by frame k, 0 to 1."""
        return 1.0 if k >= self.grown else grown_share(self.fault, k / self.rate_hz)

    def next_change(self, k: int) -> int:
        """The first frame after k in which this fault changes something."""
        if k < self.first:
            return self.first
        if k >= self.last:
            return NEVER
        changes = k < self.grown or getattr(self.fault, "follows_surface", False)
        return min(k + 1 if changes else NEVER, self.last)

    def note(self, k: int, position_rad: Callable[[str], float]) -> None:
        """Bring the fault's memory to frame k; position_rad: where a surface is now."""
        if not self.in_force(k) or not isinstance(self.fault, SurfaceFault):
            return
        if self.fault.stays_where_it_is and not self.struck:
            self.past.at_rad = position_rad(place_of(self.fault))
        if self.fault.follows_surface and k > self.followed:
            self.fault.follow(self.past, position_rad(place_of(self.fault)))
        self.struck, self.followed = True, k


class _Schedule:
    """The faults of a scenario that are of instruments, or those that are not, frame by frame.

    faults: the scenario's. rate_hz: frame rate of the loop.
    """

    of_instruments: bool

    def __init__(self, faults: Sequence[Any], rate_hz: float) -> None:
        self._rate_hz = rate_hz
        self._events: list[_Event] = []
        self.declare(faults)

    def declare(self, faults: Sequence[Any]) -> None:
        """Take these faults for those declared so far: some more at the end, some that end otherwise."""
        before, self._events = self._events, []
        faults = [fault for fault in faults if isinstance(fault, SensorFault) is self.of_instruments]
        for known, fault in zip_longest(before, faults):
            event = known or _Event(fault, self._rate_hz)
            self._events.append(event if event.fault is fault else replace(event, fault=fault))

    @property
    def any(self) -> bool:
        """Whether one of them happens in this flight."""
        return bool(self._events)

    def begun(self, k: int) -> bool:
        """Whether some fault has struck by frame k, repaired or not."""
        return any(event.first <= k for event in self._events)

    def in_force(self, k: int) -> tuple[bool, ...]:
        """Of each fault whether it is in force in frame k."""
        return tuple(event.in_force(k) for event in self._events)

    def next_change(self, k: int) -> int:
        """The first frame after k in which something changes; NEVER if none."""
        return min((event.next_change(k) for event in self._events), default=NEVER)


class FaultSchedule(_Schedule):
    """Sets the aircraft's failure properties; between changes there is nothing to do.

    plant: the aircraft they happen to.
    """

    of_instruments = False

    def __init__(self, faults: Sequence[Any], plant: "Plant", rate_hz: float) -> None:
        super().__init__(faults, rate_hz)
        self._plant = plant
        self._written: dict[str, float] = {}

    def apply(self, k: int) -> None:
        """Bring the aircraft's failures to frame k. Call it before that frame's runs; again is harmless."""
        for event in self._events:
            event.note(k, self._position_rad)
        wanted = self._wanted(k)
        changed = {name: value for name, value in wanted.items() if self._written.get(name) != value}
        for name, value in changed.items():
            self._plant.write(name, value)
        self._written |= changed
        if changed and k == 0:
            self._plant.settle()  # nothing runs before frame 0 is read: its accelerations must show the fault

    def _position_rad(self, surface: str) -> float:
        return self._plant.read(self._plant.aircraft.surface[surface].position)

    def _wanted(self, k: int) -> dict[str, float]:
        """Failure properties at frame k, of every place a fault of this flight touches."""
        places = {event.place: dict(HEALTHY) for event in self._events}
        if OF_DAMAGE in places:
            places[OF_DAMAGE] = dict.fromkeys(self._plant.aircraft.damage, 0.0)
        for event in sorted(self._events, key=lambda event: event.first):
            if event.in_force(k):
                event.fault.strike(places[event.place], event.share(k), event.past)
        found = {
            self._property(place, name): (value, HEALTHY.get(name, 0.0))
            for place, properties in places.items()
            for name, value in properties.items()
        }
        return {
            name: value for name, (value, sound) in found.items() if value != sound or name in self._written
        }

    def _property(self, place: str, name: str) -> str:
        """A failure property by its name; that of a case of damage as the aircraft's file has it."""
        damage = self._plant.aircraft.damage
        return damage[name].property if place == OF_DAMAGE and name in damage else f"{place}/{name}"


class SensorFaultSchedule(_Schedule):
    """Breaks and mends the instruments (`instruments.instruments_dtype`)."""

    of_instruments = True

    def __init__(self, faults: Sequence[Any], instruments: np.void, rate_hz: float) -> None:
        super().__init__(faults, rate_hz)
        self._instruments = instruments

    def apply(self, k: int) -> None:
        """Bring the instruments to frame k; again is harmless."""
        if not self._events:
            return
        record = self._instruments["fault"]
        record["bias"] = record["scale"] = record["noise"] = 0.0
        record["frozen"] = record["lost"] = 0
        for event in self._events:
            if event.in_force(k):
                _take(record[_SENSORS.index(event.fault.sensor)], event.fault)
        self._instruments["broken"] = self.begun(k)  # or mended: it must let go of what it holds


def _take(record: np.void, fault: Any) -> None:
    """Add one fault to what an instrument's record says."""
    unit = QUANTITIES[fault.sensor].si
    if fault.type == "bias":
        record["bias"] += unit * fault.magnitude
    elif fault.type == "noise":
        record["noise"] = hypot(record["noise"], unit * fault.magnitude)
    elif fault.type == "scale":
        record["scale"] = (1.0 + record["scale"]) * (1.0 + fault.magnitude) - 1.0
    elif fault.type == "freeze":
        record["frozen"] = 1
    else:
        record["lost"] = 1
