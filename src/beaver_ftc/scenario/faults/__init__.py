"""What can break, and when: a class a fault type, a union on `type`.

Every file of this folder is read: a fault type that can be injected is one class more (base.py).
"""

import pkgutil
from functools import reduce
from importlib import import_module
from operator import or_
from typing import TYPE_CHECKING, Annotated, Any, Literal, get_args

from pydantic import Discriminator, Field, Tag

from beaver_ftc.scenario.airframe import among, checked_aircraft
from beaver_ftc.scenario.faults.base import Bias, Damage, LossOfEffectiveness, SurfaceFault, Unanticipated
from beaver_ftc.scenario.sensors import AnySensorFault, SensorFault, fault_name, sensor_words, sensors_there

__all__ = [
    "DAMAGE", "HEALTHY", "HOLDING", "MOST_FAULTS", "SENSOR_TYPES", "TYPES", "UNANTICIPATED", "Bias", "Damage",
    "Fault", "FaultType", "LossOfEffectiveness", "Nameable", "SensorFault", "Unanticipated", "fault_name",
    "is_share", "of_a_sensor", "place_of",
]  # fmt: skip

UNANTICIPATED, DAMAGE = "unanticipated", "damage"
MOST_FAULTS = 1000  # of one flight: an hour of breaking and repairing by hand has room


def _rows() -> dict[str, type[SurfaceFault]]:
    """Every class of this folder that has a `type`, by that; `unanticipated` last."""
    modules = [import_module(f"{__name__}.{info.name}") for info in pkgutil.iter_modules(__path__)]
    found = [row for module in modules for row in vars(module).values() if isinstance(row, type)]
    rows = {
        get_args(row.model_fields["type"].annotation)[0]: row
        for row in found
        if issubclass(row, SurfaceFault) and "type" in row.model_fields
    }
    rows[UNANTICIPATED] = rows.pop(UNANTICIPATED)
    return rows


TYPES = _rows()
SENSOR_TYPES = {
    get_args(row.model_fields["type"].annotation)[0]: row for row in get_args(get_args(AnySensorFault)[0])
}
# Failure properties of a surface, and those by which it does not follow its command.
HEALTHY = {name: value for row in TYPES.values() for name, value in row.properties}
HOLDING = tuple(row.holds for row in TYPES.values() if row.holds)


def place_of(fault: Any) -> str:
    """What a fault is of: a surface, a sensor, else its type: `unanticipated`, `damage`."""
    return str(getattr(fault, "sensor", getattr(fault, "actuator", fault.type)))


def is_share(kind: str | None) -> bool:
    """Whether the estimate of a type is a share of 1, and not an angle."""
    row = TYPES.get(kind or "")
    return row is not None and row.size is not None and row.size[1] == "%"


def of_a_sensor(fault: Any) -> bool:
    """Whether a fault, or what a file says of one, is an instrument's."""
    return "sensor" in fault if isinstance(fault, dict) else isinstance(fault, SensorFault)


def _nameable() -> tuple[str, ...]:
    """What a diagnosis can name."""
    return (*checked_aircraft().surfaces, UNANTICIPATED, *map(sensor_words, sensors_there()))


Nameable = Annotated[str, among(_nameable)]


def _tag(given: Any) -> str:
    return "(sensor)" if of_a_sensor(given) else "(surface)"  # no keys of the file


if TYPE_CHECKING:
    Fault = SurfaceFault | AnySensorFault
    FaultType = str
else:
    FaultType = Literal[tuple(TYPES)]
    Fault = Annotated[
        Annotated[Annotated[reduce(or_, TYPES.values()), Field(discriminator="type")], Tag("(surface)")]
        | Annotated[AnySensorFault, Tag("(sensor)")],
        Discriminator(_tag),
    ]
