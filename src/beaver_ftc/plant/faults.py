"""Fault injection: when which failure property of the aircraft changes.

A fault at `at_s` is in force in the first frame whose time t >= at_s - 1e-9 s, and in every JSBSim run of
that frame; one with `end_s` is repaired in the first frame whose time t >= end_s - 1e-9 s. Faults may
overlap: effectiveness and rate scale multiply, biases and alpha^3 moments add; of two jams the earlier
holds, of two runaways or two oscillations the later. On one surface a jam hides a trailing surface, which
hides a runaway (that is the aircraft's own order).

A fault of an instrument changes what it says and leaves the aircraft alone. Several of one instrument add up:
offsets add, relative errors multiply, noise adds by its squares; one that is frozen or lost says nothing
else.
"""

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import zip_longest
from math import ceil, exp, hypot, inf
from typing import TYPE_CHECKING, Any

import numpy as np

from beaver_ftc.scenario.faults import SensorFault, place_of
from beaver_ftc.scenario.sensors import ENGINE, QUANTITIES, Sensors

if TYPE_CHECKING:
    from beaver_ftc.plant.adapter import Plant

_SENSORS = tuple(Sensors.model_fields)
OF_THE_SLIPSTREAM = ("V", "qdyn", *ENGINE)  # what dpt is worked out from
TIME_TOLERANCE_S = 1e-9
NEVER = sys.maxsize

# 1 - exp(-kappa t) is 1 to the last bit from here on: an incipient fault is then as good as an abrupt one.
_FULLY_GROWN = 37.0

HEALTHY = {
    "effectiveness": 1.0,
    "stuck": 0.0,
    "stuck-at-rad": 0.0,
    "hardover": 0.0,
    "float": 0.0,
    "bias-rad": 0.0,
    "rate-scale": 1.0,
    "oscillation-amplitude-rad": 0.0,
    "oscillation-frequency-rad_sec": 0.0,
    "Cm-alpha3": 0.0,
}


def frame_of(time_s: float, rate_hz: float) -> int:
    """The first frame k whose time k / rate_hz is not before time_s."""
    return ceil((time_s - TIME_TOLERANCE_S) * rate_hz)


def is_there(fault: Any, k: int, rate_hz: float) -> bool:
    """Whether a fault is in force in frame k: begun, and neither repaired nor over."""
    begun = frame_of(fault.at_s, rate_hz) <= k
    return begun and (fault.end_s is None or frame_of(fault.end_s, rate_hz) > k)


@dataclass
class _Event:
    """One fault as frames: in force from `first` to before `last`, still growing before `grown`."""

    fault: Any
    rate_hz: float
    kappa_per_s: float
    first: int
    last: int
    grown: int
    was_rad: float = 0.0
    struck: bool = False

    @classmethod
    def of(cls, fault: Any, rate_hz: float) -> "_Event":
        kappa_per_s = fault.kappa_per_s if fault.profile == "incipient" else inf
        first = frame_of(fault.at_s, rate_hz)
        last = NEVER if fault.end_s is None else frame_of(fault.end_s, rate_hz)
        grown = frame_of(fault.at_s + _FULLY_GROWN / kappa_per_s, rate_hz)
        return cls(fault, rate_hz, kappa_per_s, first, last, grown)

    @property
    def place(self) -> str:
        """The folder of the failure properties it changes."""
        return f"failures/{place_of(self.fault)}"

    def in_force(self, k: int) -> bool:
        return self.first <= k < self.last

    def share(self, k: int) -> float:
        """B(t - at_s): how far the fault has grown by frame k, 0 to 1."""
        age_s = max(0.0, k / self.rate_hz - self.fault.at_s)
        return 1.0 if k >= self.grown else 1.0 - exp(-self.kappa_per_s * age_s)

    def next_change(self, k: int) -> int:
        """The first frame after k in which this fault changes something."""
        if k < self.first:
            return self.first
        if k >= self.last:
            return NEVER
        return min(k + 1 if k < self.grown else NEVER, self.last)


class FaultSchedule:
    """Sets the aircraft's failure properties, frame by frame; between changes there is nothing to do.

    faults: the scenario's. plant: the aircraft they happen to. rate_hz: frame rate of the loop.
    """

    def __init__(self, faults: Sequence[Any], plant: "Plant", rate_hz: float) -> None:
        self._plant = plant
        self._rate_hz = rate_hz
        self._declared: list[_Event] = []
        self._written: dict[str, float] = {}
        self.declare(faults)

    def declare(self, faults: Sequence[Any]) -> None:
        """Take these faults for those declared so far: some more at the end, some that end otherwise."""
        before, self._declared = self._declared, []
        faults = [fault for fault in faults if not isinstance(fault, SensorFault)]
        for known, fault in zip_longest(before, faults):
            self._declared.append(known if known and known.fault is fault else self._event(fault, known))
        self._events = sorted(self._declared, key=lambda event: event.first)

    def _event(self, fault: Any, known: _Event | None) -> _Event:
        event = _Event.of(fault, self._rate_hz)
        if known is not None:
            event.was_rad, event.struck = known.was_rad, known.struck
        return event

    def begun(self, k: int) -> bool:
        """Whether some fault has struck by frame k, repaired or not."""
        return any(event.first <= k for event in self._events)

    def next_change(self, k: int) -> int:
        """The first frame after k in which something changes; NEVER if none."""
        return min((event.next_change(k) for event in self._events), default=NEVER)

    def apply(self, k: int) -> None:
        """Bring the aircraft's failures to frame k. Call it before that frame's runs; again is harmless."""
        self._note_where_surfaces_were(k)
        if self._write(self._wanted(k)) and k == 0:
            self._plant.settle()  # nothing runs before frame 0 is read: its accelerations must show the fault

    def _note_where_surfaces_were(self, k: int) -> None:
        for event in self._events:
            if event.in_force(k) and not event.struck:
                event.struck = True
                if event.fault.stays_where_it_is:
                    surface = self._plant.aircraft.surface[event.fault.actuator]
                    event.was_rad = self._plant.read(surface.position)

    def _wanted(self, k: int) -> dict[str, float]:
        """Failure properties at frame k, of every place a fault of this flight touches."""
        places = {event.place: dict(HEALTHY) for event in self._events}
        for event in self._events:
            if event.in_force(k):
                event.fault.strike(places[event.place], event.share(k), event.was_rad)
        return {
            f"{place}/{name}": value
            for place, properties in places.items()
            for name, value in properties.items()
            if value != HEALTHY[name] or f"{place}/{name}" in self._written
        }

    def _write(self, wanted: dict[str, float]) -> bool:
        """Write what differs from what was written last; whether anything did."""
        changed = {name: value for name, value in wanted.items() if self._written.get(name) != value}
        for name, value in changed.items():
            self._plant.write(name, value)
        self._written.update(changed)
        return bool(changed)


class SensorFaultSchedule:
    """Breaks and mends the instruments (`instruments.instruments_dtype`), frame by frame.

    faults: the scenario's; those of surfaces are passed over. rate_hz: frame rate of the loop. has_engine:
    the aircraft has instruments from which dpt follows.
    """

    def __init__(
        self, faults: Sequence[Any], instruments: np.void, rate_hz: float, has_engine: bool = False
    ) -> None:
        self._instruments, self._rate_hz, self._has_engine = instruments, rate_hz, has_engine
        self.declare(faults)

    def declare(self, faults: Sequence[Any]) -> None:
        """Take these faults for those declared so far."""
        self._faults = [fault for fault in faults if isinstance(fault, SensorFault)]
        self._spans = [(frame_of(f.at_s, self._rate_hz), self._last(f)) for f in self._faults]

    def _last(self, fault: SensorFault) -> int:
        return NEVER if fault.end_s is None else frame_of(fault.end_s, self._rate_hz)

    @property
    def any(self) -> bool:
        """Whether an instrument breaks in this flight."""
        return bool(self._faults)

    def begun(self, k: int) -> bool:
        """Whether some instrument has broken by frame k, mended or not."""
        return any(first <= k for first, _ in self._spans)

    def next_change(self, k: int) -> int:
        """The first frame after k in which an instrument breaks or is mended; NEVER if none."""
        return min((at for span in self._spans for at in span if at > k), default=NEVER)

    def apply(self, k: int) -> None:
        """Bring the instruments to frame k; again is harmless. From the first fault of theirs on, dpt is what
        engine and air data say."""
        if not self._faults:
            return
        record = self._instruments["fault"]
        record["bias"] = record["scale"] = record["noise"] = 0.0
        record["frozen"] = record["lost"] = 0
        for fault, (first, last) in zip(self._faults, self._spans, strict=True):
            if first <= k and self._has_engine and fault.sensor in OF_THE_SLIPSTREAM:
                self._instruments["engine"] = 1
            if first <= k < last:
                _take(record[_SENSORS.index(fault.sensor)], fault)
        self._instruments["broken"] = 1  # from now on: a mended one must let go of what it holds


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
