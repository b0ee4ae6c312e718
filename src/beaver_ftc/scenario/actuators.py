"""The actuators of the surfaces (`actuators`), and how the true ones differ from them.

They are ideal, a preset, one set of numbers for all, or one a surface.
"""

from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Self

from pydantic import Field, GetJsonSchemaHandler, model_validator
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema

from beaver_ftc.aircraft import load
from beaver_ftc.documents.document import Number, Section, deny, number, refuse_unknown
from beaver_ftc.scenario.airframe import checked_aircraft


class ActuatorDynamics(Section):
    """one surface.

    bandwidth_rad_s: bandwidth of the first-order lag. 0: no lag, rad/s
    rate_limit_deg_s: largest rate of the surface. 0: no limit, deg/s
    travel_deg: lower and upper stop; left out: the stops in the aircraft file, deg
    """

    bandwidth_rad_s: Number = number(0.0, "rad/s", ge=0, le=10_000, examples=[20])
    rate_limit_deg_s: Number = number(0.0, "deg/s", ge=0, le=100_000, examples=[60])
    travel_deg: tuple[Number, Number] | None = number(
        None, "deg", range="rising, -90 to 90", examples=[[-20, 20]]
    )

    @model_validator(mode="after")
    def _stops_are_in_order(self) -> Self:
        if self.travel_deg is not None and not -90 <= self.travel_deg[0] < self.travel_deg[1] <= 90:
            deny("stops out of order or range, allowed: [lower, upper] from -90 to 90 deg", "travel_deg")
        return self

    @property
    def is_ideal(self) -> bool:
        """No lag and no rate limit; the stops are always there."""
        return self.bandwidth_rad_s == 0 and self.rate_limit_deg_s == 0


PRESETS: dict[str, dict[str, float]] = {
    "ideal": {},
    "servo": {"bandwidth_rad_s": 20.0, "rate_limit_deg_s": 60.0},  # rates as in [SL03]
}


class OfSurfaces(Section, extra="allow"):
    """The same keys for every surface. A key directly in this section applies to all surfaces; one in the
    section of a surface applies only to this surface."""

    of_one: ClassVar[type[Section]]
    presets: ClassVar[Mapping[str, dict[str, float]]] = {}

    @model_validator(mode="before")
    @classmethod
    def _expand(cls, given: Any) -> Any:
        if isinstance(given, str):
            given = cls.presets.get(given, given)
        return _by_surface(given, tuple(cls.of_one.model_fields)) if isinstance(given, dict) else given

    @classmethod
    def __get_pydantic_json_schema__(cls, core: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchemaValue:
        mapping = handler.resolve_ref_schema(handler(core))
        reference = mapping["additionalProperties"]
        one = handler.resolve_ref_schema(reference)
        mapping["properties"] = {**one["properties"], **dict.fromkeys(load().surfaces, reference)}
        preset = {"enum": list(cls.presets), "type": "string", "description": "a preset"}
        return {"anyOf": [preset, mapping]} if cls.presets else mapping


class Actuators(OfSurfaces):
    """A preset, or a key directly in this section, applies to all surfaces. A key of one surface replaces
    it."""

    __pydantic_extra__: dict[str, ActuatorDynamics]
    of_one = ActuatorDynamics
    presets = PRESETS

    @property
    def is_ideal(self) -> bool:
        """Whether no surface has a lag or a rate limit."""
        return all(dynamics.is_ideal for _, dynamics in self)


DeadBand = Annotated[Number, Field(ge=0, le=10)]


class TrueActuator(Section):
    """one surface.

    bandwidth: bandwidth, divided by that in `actuators`, 1
    rate_limit: rate limit, divided by that in `actuators`, 1
    dead_band_deg: largest distance from the command at which the actuator does not move, deg
    """

    bandwidth: Number = number(1.0, "1", ge=0.1, le=10, examples=[0.8])
    rate_limit: Number = number(1.0, "1", ge=0.1, le=10, examples=[0.8])
    dead_band_deg: DeadBand = number(0.0, "deg", examples=[0.1])


class TrueActuators(OfSurfaces):
    """Actuators of the truth, compared with `actuators`. A key directly in this section applies to all
    surfaces, a key in the section of a surface only to this surface. An ideal actuator has no bandwidth and
    no rate limit that could differ."""

    __pydantic_extra__: dict[str, TrueActuator]
    of_one = TrueActuator


def _by_surface(given: dict[str, Any], keys: tuple[str, ...]) -> dict[str, Any]:
    """Numbers given for all surfaces become each surface's own, unless it has its own already."""
    surfaces = checked_aircraft().surfaces
    for_all = {key: value for key, value in given.items() if key in keys}
    rest = {key: value for key, value in given.items() if key not in for_all}
    known = (*keys, *surfaces)
    wrong = [key for key in rest if key not in surfaces]
    refuse_unknown(wrong, known)
    own = {surface: rest.get(surface, {}) for surface in surfaces}
    return {surface: {**for_all, **it} if isinstance(it, dict) else it for surface, it in own.items()}
