"""MAV_CMD_INJECT_FAILURE: faults by a MAVLink command [MAVLink, common.xml, 420].

param1: FAILURE_UNIT. param2: FAILURE_TYPE. param3: for servos the number of the output, 0 for all.
"""

from collections.abc import Mapping
from typing import Any

from beaver_ftc.aircraft import ChannelsSection
from beaver_ftc.documents import BadInput
from beaver_ftc.scenario.faults import TYPES
from beaver_ftc_links.sitl.vehicle import Flown

COMMAND = 420
# MAV_RESULT.
ACCEPTED = 0
DENIED = 2
UNSUPPORTED = 3
SERVO = 102  # FAILURE_UNIT_SYSTEM_SERVO
# FAILURE_UNIT -> instruments.
SENSORS = {0: ("p", "q", "r"), 1: ("ax", "ay", "az"), 3: ("altitude",), 8: ("V", "qdyn")}
OK = 0  # FAILURE_TYPE: repaired
# FAILURE_TYPE -> fault.
OF_SERVOS: Mapping[int, dict[str, Any]] = {
    row.mavlink[0]: {"type": kind, **row.mavlink[1]} for kind, row in TYPES.items() if row.mavlink
}
OF_SENSORS: Mapping[int, dict[str, Any]] = {
    1: {"type": "lost"},
    2: {"type": "freeze"},
    4: {"type": "scale", "magnitude": 0.3},
}


def inject(sim: Flown, channels: ChannelsSection, params: tuple[float, float, float]) -> tuple[int, str]:
    """Inject the fault with these parameters, or repair it, from the next frame on. Returns the MAV_RESULT
    and a text on the fault."""
    unit, kind, which = (round(value) if abs(value) < 1e6 else -1 for value in params)
    places = _places(unit, which, sim, channels)
    faults = OF_SERVOS if unit == SERVO else OF_SENSORS
    if not places or (kind != OK and kind not in faults):
        return UNSUPPORTED, f"unit {unit}, type {kind}, number {which}: nothing of this aircraft"
    where = "actuator" if unit == SERVO else "sensor"
    try:
        for name in places:
            if kind == OK:
                sim.repair(name if unit == SERVO else f"sensor {name}")
            else:
                sim.inject({where: name, **faults[kind]})
    except BadInput as error:
        return DENIED, str(error)
    what = "repaired" if kind == OK else str(faults[kind]["type"]).replace("_", " ")
    return ACCEPTED, f"{', '.join(places)}: {what}"


def _places(unit: int, which: int, sim: Flown, channels: ChannelsSection) -> tuple[str, ...]:
    """The surfaces of an output, or the instruments of a unit."""
    if unit == SERVO:
        return tuple(
            name
            for name, mix in channels.surfaces.items()
            if which == 0 or any(output.channel == which for output in mix)
        )
    from beaver_ftc.scenario import checked_against, sensors_there

    with checked_against(sim.airframe):
        there = sensors_there()
    return tuple(name for name in SENSORS.get(unit, ()) if name in there)
