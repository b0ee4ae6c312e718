"""The judgement of events. This module alone decides whether an alarm is false, how late it is, and whether a
name is correct:

    term         meaning
    in force     a fault is in force from the first frame whose time is not before `at_s`, until it ends
    false        an alarm before the first fault is in force
    delay, s     time from the first frame with the fault to an event
    premature    a name that is given before its fault began; such a name is never correct

Times are in s from the start of the flight.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import inf
from typing import Any, Self

from beaver_ftc.results.model import DeclaredFault, Quantity
from beaver_ftc.scenario.faults import UNANTICIPATED, Damage, acting_at
from beaver_ftc.scenario.instants import TIME_TOLERANCE_S, first_frame_s, is_before, is_in_force
from beaver_ftc.scenario.pairs import failing

TIME_DECIMALS = 9  # decimals of a second: removes the rounding of frame times


@dataclass(frozen=True)
class Onset:
    """The instant from which events are judged.

    at_s: begin of the fault as declared; None without a fault. rate_hz: rate of the frames; None for a
    recorded log, whose fault begins between frames.
    """

    at_s: Quantity
    rate_hz: Quantity = None

    @property
    def first_frame_with_fault_s(self) -> float:
        """Time of the first frame with the fault, s; infinite without a fault."""
        if self.at_s is None:
            return inf
        return self.at_s if self.rate_hz is None else first_frame_s(self.at_s, self.rate_hz)

    def is_false(self, time_s: Any) -> Any:
        """Whether an alarm at a time, or at each time of an array, is false: the fault has not begun."""
        return is_before(time_s, inf if self.at_s is None else self.at_s)

    def delay_s(self, time_s: Quantity) -> Quantity:
        """Time from the first frame with the fault to an event, s; None without an event, or for one before
        the fault."""
        if time_s is None or self.is_false(time_s):
            return None
        return round(max(time_s - self.first_frame_with_fault_s, 0.0), TIME_DECIMALS)


def strikes_within(at_s: Any, flown_s: Any) -> Any:
    """Whether a fault, or each fault of an array, begins before its flight ends. NaN, no fault, gives
    False."""
    return at_s < flown_s


def is_late(delay_s: Any, guaranteed_delay_s: Any, frame_s: Any) -> Any:
    """Whether a detection, or each one of an array, came more than a frame after the instant from which it
    was certain: delay > guaranteed delay + frame, s."""
    return delay_s > guaranteed_delay_s + frame_s + TIME_TOLERANCE_S


@dataclass(frozen=True)
class Truth:
    """The faults that are injected in a flight, in the order in which they strike.

    removed_surfaces: surfaces that damage takes away. outside_class_from_second_fault: an unanticipated fault
    that stands for all faults together. It begins when a second surface fails, since no single fault explains
    the flight from then on. None if one surface fails at most, or if the diagnosis tests pairs of faults.

    A name is compared with one fault. Its delay counts from the first frame with this fault, and is None if
    the name is premature, that is, given before the fault began:

        the name is right for       compared with                   correct
        a fault in force then       the first of these              yes
        other faults only           the first of these              no if premature; yes if it has ended
        no fault                    the first fault that strikes    no
        (no name)                   the first fault that strikes    None

    `DeclaredFault.is_named_by` says which names are right. `unanticipated` is also right for the fault
    outside of the class, once this one has begun. A wrong name in a window, or of several, is compared with
    no fault.
    """

    faults: tuple[DeclaredFault, ...]
    rate_hz: float
    removed_surfaces: frozenset[str] = frozenset()
    outside_class_from_second_fault: DeclaredFault | None = None

    @classmethod
    def of(cls, scenario: Any) -> Self:
        """The truth of a `schema.Scenario`."""
        faults = sorted(map(DeclaredFault.of_scenario, scenario.faults), key=lambda fault: fault.at_s)
        damages = (fault for fault in scenario.faults if isinstance(fault, Damage))
        removed_surfaces = frozenset().union(*(scenario.airframe.damage[d.case].takes for d in damages))
        began_s = sorted(failing(scenario).values())
        outside = None
        if not scenario.fdi.pairs and len(began_s) > 1:
            outside = DeclaredFault(None, UNANTICIPATED, began_s[1])
        return cls(tuple(faults), scenario.rate_hz, removed_surfaces, outside)

    @property
    def first(self) -> DeclaredFault | None:
        """The fault that strikes first."""
        return self.faults[0] if self.faults else None

    @property
    def onset(self) -> Onset:
        """The begin of the first fault."""
        return self.onset_of(self.first)

    def onset_of(self, fault: DeclaredFault | None) -> Onset:
        """The begin of a fault; without a fault, an onset that never comes."""
        return Onset(None if fault is None else fault.at_s, self.rate_hz)

    def within(self, acting: Sequence[DeclaredFault]) -> Self:
        """The truth of a window in which these faults act."""
        surfaces = {fault.actuator for fault in acting if fault.actuator is not None}
        outside = self.outside_class_from_second_fault if len(surfaces) > 1 else None
        return replace(self, faults=tuple(acting), outside_class_from_second_fault=outside)

    def against(self, name: str | None, time_s: Quantity) -> DeclaredFault | None:
        """The fault with which a name given at `time_s` is compared. Among the faults for which the name is
        right: the first one in force then, or else the first one that strikes. None if there is no such
        fault."""
        faults = self.faults_named_rightly_by(name, time_s)
        in_force = (fault for fault in faults if time_s is not None and is_in_force(fault, time_s))
        return next(in_force, faults[0] if faults else None)

    def is_type_right(self, fault: DeclaredFault | None, kind: str | None, time_s: Quantity) -> bool | None:
        """Whether a type named at `time_s` is the type of `fault`, or of another fault that acts on the same
        surface then. None if no type is named, or if `fault` has no type that can be named; without `fault`,
        a named type is wrong."""
        if fault is None:
            return None if kind is None else False
        others = [
            other for other in acting_at(self.faults, time_s or 0.0) if other.actuator == fault.actuator
        ]
        verdicts = [other.is_of_type(kind) for other in (fault, *(others if fault.actuator else ()))]
        return None if verdicts[0] is None else any(verdicts)

    def faults_named_rightly_by(self, name: str | None, time_s: Quantity) -> tuple[DeclaredFault, ...]:
        """The faults for which a name given at `time_s` is right, in the order in which they strike."""
        candidates = self.faults
        outside = self.outside_class_from_second_fault
        if outside is not None and time_s is not None and not self.onset_of(outside).is_false(time_s):
            candidates += (outside,)
        return tuple(fault for fault in candidates if fault.is_named_by(name, self.removed_surfaces))

    def is_premature(self, name: str | None, time_s: Quantity, fault: DeclaredFault | None) -> bool | None:
        """Whether a name was given before `fault` began. fault: the one with which the name is compared. None
        without a name."""
        if name is None or time_s is None:
            return None
        return fault is not None and self.onset_of(fault).is_false(time_s)
