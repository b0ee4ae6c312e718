"""A new flight as the page flies it, and what a page asks of one, as keys of a scenario."""

from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from beaver_ftc.integrations.live.messages import Fresh
    from beaver_ftc.scenario.schema import Scenario

LONGEST_S = 3600.0  # of one live flight: its log is 0.4 GB then
HELD = ("altitude_m", "airspeed_mps", "heading_deg")  # by the autopilot that the page asks for


def as_live(scenario: "Scenario") -> "Scenario":
    """The flight of a page: it is long and expects nothing; its diagnosis knows every fault type that can be
    broken there, and watches the instruments, which can be broken too, unless the scenario says otherwise.

    A watch that began with the first instrument broken would make of the flight before it another than the
    saved scenario's, in which that fault is said from the start.
    """
    stamp = datetime.now(UTC).strftime("%Y%m%d-%H%M%S-%f")[:-3]
    changes: dict[str, Any] = {"name": f"live-{scenario.name[:60]}-{stamp}", "expect": {}}
    changes["duration_s"] = LONGEST_S
    if "sensor_monitor" not in scenario.fdi.model_fields_set:
        changes["fdi.sensor_monitor"] = "always"
    if "fault_class" not in scenario.fdi.model_fields_set:
        changes["fdi.fault_class"] = "all"
    return scenario.with_(changes)


def changes_of(asked: "Fresh") -> dict[str, Any]:
    """Dotted keys of the scenario for what a new flight asks. Errors of the air and the sensors are declared
    to the diagnosis as well: it is to live with them, not to be surprised."""
    changes: dict[str, Any] = {}
    for key, value in (("control.law", asked.law), ("fdi.scheme", asked.scheme)):
        if value is not None:
            changes[key] = value
    if asked.fault_class is not None:
        changes["fdi.fault_class"] = asked.fault_class
    if asked.sensors is not None:
        changes["sensors"] = changes["fdi.bounds.sensors"] = asked.sensors
    if asked.autopilot is not None:
        changes["autopilot"] = {channel: [{"hold": True}] for channel in HELD} if asked.autopilot else None
    if asked.turbulence is not None:
        still = asked.turbulence == "none"
        changes["environment.turbulence"] = "none" if still else "dryden"
        changes["environment.severity"] = None if still else asked.turbulence
        changes["fdi.bounds.turbulence"] = asked.turbulence
    return changes
