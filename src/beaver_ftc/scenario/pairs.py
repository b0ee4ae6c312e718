"""Faults on several surfaces at once, and `fdi.pairs`, which looks for faults on two.

Two surfaces in pitch share one equation, and those in roll and yaw two. They are solved frame by frame, which
takes gyros whose error is no more than a constant.

scenario: a `schema.Scenario`, not named as such because the schema imports this.
"""

from collections.abc import Iterator
from typing import Any

from beaver_ftc.aircraft import Aircraft
from beaver_ftc.documents.document import Conflict
from beaver_ftc.scenario.sensors import Sensors

PITCH = 1  # of the axes p, q, r
UNTIL = "names the first until the second contradicts it, and then says unanticipated"


def pairs_refused(declared: Sensors, aircraft: Aircraft) -> str:
    """Why two faults at once cannot be looked for; empty if they can. declared: `fdi.bounds.sensors`."""
    if declared.gyros_vary:
        return "not available with errors of the gyros that vary declared in fdi.bounds.sensors"
    in_pitch = sum(axis == PITCH for axis in aircraft.dominant_axis)
    if (in_pitch, len(aircraft.surfaces)) != (2, 4):
        return f"not available: {aircraft.name} has not two surfaces in pitch, two in roll and yaw"
    return ""


def changes_refused(scenario: Any, aircraft: Aircraft) -> Iterator[Conflict]:
    """Changes in flight that declare what `fdi.pairs` is not available with."""
    for i, sensors in _declared_later(scenario) if scenario.fdi.pairs else ():
        if why := pairs_refused(sensors, aircraft):
            where = ("changes", i, "declared_sensors")
            yield where, f"fdi.pairs is {why}, allowed: errors that do not vary, or fdi.pairs: false"


def _declared_later(scenario: Any) -> Iterator[tuple[int, Sensors]]:
    for i, change in enumerate(scenario.changes):
        if change.declared_sensors is not None:
            yield i, change.declared_sensors


def failing(scenario: Any) -> dict[str, float]:
    """The surfaces that fail, and when each does first, s."""
    began: dict[str, float] = {}
    for fault in _on_surfaces(scenario):
        began[fault.actuator] = min(fault.at_s, began.get(fault.actuator, fault.at_s))
    return began


def of_several(scenario: Any) -> str:
    """What a diagnosis that looks for one fault makes of several surfaces that are at fault at once, and what
    looks for two; empty if there are no two at once."""
    spans = [
        (fault.at_s, fault.end_s or scenario.duration_s, fault.actuator) for fault in _on_surfaces(scenario)
    ]
    if not any(a[2] != b[2] and a[0] < b[1] and b[0] < a[1] for a in spans for b in spans):
        return ""
    fdi = scenario.fdi
    says = "faults on several surfaces at once: the diagnosis looks for one"
    if not fdi.is_ours:
        return f"{says}; fdi.pairs, which looks for two, is of scheme adaptive-estimators alone"
    declared = (fdi.bounds.sensors, *(sensors for _, sensors in _declared_later(scenario)))
    if why := next(filter(None, (pairs_refused(one, scenario.airframe) for one in declared)), ""):
        return f"{says}, {UNTIL}; fdi.pairs, which looks for two, is {why}"
    both = "fdi: {fault_class: all, pairs: true}"
    return f"{says}; set {'fdi.pairs: true' if fdi.fault_class == 'all' else both}"


def _on_surfaces(scenario: Any) -> list[Any]:
    return [fault for fault in scenario.faults if getattr(fault, "actuator", None)]
