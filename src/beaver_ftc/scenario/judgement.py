"""Whether an alarm is false, how late it is and whether a name is right: of an event and the truth, once.

A fault is in force in the first frame whose time is not before `at_s`. An alarm in that very frame, or later,
is no false alarm; its delay counts from that frame. A name given before its fault began is premature, and is
not correct, whatever it says.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from math import inf
from typing import Any, Self

from beaver_ftc.scenario.diagnosis import failing
from beaver_ftc.scenario.faults import DAMAGE, UNANTICIPATED, Damage, of_a_sensor
from beaver_ftc.scenario.sensors import sensor_words
from beaver_ftc.scenario.signals import TIME_TOLERANCE_S, first_frame_s, is_before

LOSS_OF_EFFECTIVENESS = "loss_of_effectiveness"
_NOT_SIZE = {"actuator", "sensor", "type", "at_s", "end_s", "profile"}
_DIGITS = 9  # of a second: without the rounding of frame times


@dataclass(frozen=True)
class Onset:
    """The instant from which events are judged. at_s: as declared, None where nothing breaks. rate_hz: of the
    frames, None where the truth has none (a recorded log)."""

    at_s: float | None
    rate_hz: float | None = None

    @property
    def begins_s(self) -> float:
        """Time of the first frame with the fault; infinite where nothing breaks."""
        if self.at_s is None:
            return inf
        return self.at_s if self.rate_hz is None else first_frame_s(self.at_s, self.rate_hz)

    def is_false(self, time_s: Any) -> Any:
        """Whether an alarm at a time, or at each of several, is a false one: there is no fault yet."""
        return is_before(time_s, inf if self.at_s is None else self.at_s)

    def delay_s(self, time_s: float | None) -> float | None:
        """From the fault's first frame to an event; None without one, or if it came before the fault."""
        if time_s is None or self.is_false(time_s):
            return None
        return round(max(time_s - self.begins_s, 0.0), _DIGITS)


def is_late(delay_s: Any, guaranteed_delay_s: Any, frame_s: Any) -> Any:
    """Whether a detection, or each of several, came more than a frame after the instant from which it was
    certain."""
    return delay_s > guaranteed_delay_s + frame_s + TIME_TOLERANCE_S


@dataclass(frozen=True)
class DeclaredFault:
    """A fault as a verdict is held against it. size: what else its type has."""

    actuator: str | None
    type: str
    at_s: float
    sensor: str | None = None
    end_s: float | None = None
    profile: str | None = None
    size: Mapping[str, Any] | None = None

    @classmethod
    def of(cls, fault: Any) -> Self:
        """A scenario's."""
        return cls(
            getattr(fault, "actuator", None),
            fault.type,
            fault.at_s,
            fault.sensor if of_a_sensor(fault) else None,
            fault.end_s,
            fault.profile,
            fault.model_dump(exclude=_NOT_SIZE, exclude_none=True),
        )

    def is_named_by(self, name: str | None, taken: frozenset[str] = frozenset()) -> bool:
        """Whether a name is right. taken: surfaces that damage takes away."""
        if self.sensor is not None:  # outside the class of surface faults is right as well
            return name in (sensor_words(self.sensor), UNANTICIPATED)
        if self.type == DAMAGE:  # outside of every class, unless a surface that it takes
            return name == UNANTICIPATED or name in taken
        return name is not None and name == (UNANTICIPATED if self.type == UNANTICIPATED else self.actuator)

    def is_of_type(self, kind: str | None) -> bool | None:
        """Whether a type is right; None while none is named, as an instrument's never is."""
        if self.sensor is not None:
            return None
        if self.type == DAMAGE:  # a surface that is gone has lost all its effect
            return None if kind in (None, UNANTICIPATED) else kind == LOSS_OF_EFFECTIVENESS
        return None if kind is None else kind == self.type


@dataclass(frozen=True)
class Truth:
    """What breaks in a flight. faults: in the order in which they strike; taken: surfaces that damage takes.

    beyond_one: both together, from the instant on at which a second surface fails, where the diagnosis looks
    for a single fault: no single one explains the flight, so it is outside the class.
    """

    faults: tuple[DeclaredFault, ...]
    rate_hz: float
    taken: frozenset[str] = frozenset()
    beyond_one: DeclaredFault | None = None

    @classmethod
    def of(cls, scenario: Any) -> Self:
        """That of a `schema.Scenario`."""
        faults = sorted(map(DeclaredFault.of, scenario.faults), key=lambda fault: fault.at_s)
        damage = scenario.airframe.damage
        cases = [fault.case for fault in scenario.faults if isinstance(fault, Damage)]
        taken = frozenset(surface for case in cases for surface in damage[case].takes)
        began_s, beyond = sorted(failing(scenario).values()), None
        if not scenario.fdi.pairs and len(began_s) > 1:
            beyond = DeclaredFault(None, UNANTICIPATED, began_s[1])
        return cls(tuple(faults), scenario.rate_hz, taken, beyond)

    @property
    def first(self) -> DeclaredFault | None:
        """The fault that strikes first."""
        return self.faults[0] if self.faults else None

    @property
    def onset(self) -> Onset:
        """When the flight ceases to be healthy."""
        return self.onset_of(self.first)

    def onset_of(self, fault: DeclaredFault | None) -> Onset:
        """When a fault begins."""
        return Onset(None if fault is None else fault.at_s, self.rate_hz)

    def meant_by(self, name: str | None, time_s: float | None) -> tuple[DeclaredFault, ...]:
        """The declared faults of which a name given then is right, as they strike."""
        candidates = [*self.faults]
        if self.beyond_one is not None and time_s is not None:
            candidates += [] if self.onset_of(self.beyond_one).is_false(time_s) else [self.beyond_one]
        return tuple(fault for fault in candidates if fault.is_named_by(name, self.taken))

    def is_premature(
        self, name: str | None, time_s: float | None, fault: DeclaredFault | None
    ) -> bool | None:
        """Whether a name was given before the fault it is held against began; None without a name."""
        if name is None or time_s is None:
            return None
        return fault is not None and self.onset_of(fault).is_false(time_s)
