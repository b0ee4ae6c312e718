"""What moves the surfaces: ideal, a preset, one set of numbers for all, or one a surface."""

from typing import Any, Self

from pydantic import GetJsonSchemaHandler, model_validator
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema

from beaver_ftc.aircraft import load
from beaver_ftc.documents.document import Number, Section, deny, number, refuse_unknown
from beaver_ftc.scenario.airframe import checked_aircraft


class ActuatorDynamics(Section):
    """First-order lag, rate limit and stops of one surface.

    bandwidth_rad_s: bandwidth of the lag, 0 means none, rad/s
    rate_limit_deg_s: largest surface rate, 0 means no limit, deg/s
    travel_deg: lower and upper stop; left out: the aircraft's own, deg
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


class Actuators(Section, extra="allow"):
    """One set of dynamics a surface; a preset's name, or numbers beside the surfaces, stand for all."""

    __pydantic_extra__: dict[str, ActuatorDynamics]

    @model_validator(mode="before")
    @classmethod
    def _expand(cls, given: Any) -> Any:
        if isinstance(given, str):
            given = PRESETS.get(given, given)
        return _by_surface(given) if isinstance(given, dict) else given

    @property
    def is_ideal(self) -> bool:
        """Whether no surface has a lag or a rate limit."""
        return all(dynamics.is_ideal for _, dynamics in self)

    @classmethod
    def __get_pydantic_json_schema__(cls, core: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchemaValue:
        mapping = handler.resolve_ref_schema(handler(core))
        reference = mapping["additionalProperties"]
        one = handler.resolve_ref_schema(reference)
        mapping["properties"] = {**one["properties"], **dict.fromkeys(load().surfaces, reference)}
        preset = {"enum": list(PRESETS), "type": "string", "description": "a preset"}
        return {"anyOf": [preset, mapping]}


def _by_surface(given: dict[str, Any]) -> dict[str, Any]:
    """Numbers given for all surfaces become each surface's own, unless it has its own already."""
    surfaces = checked_aircraft().surfaces
    for_all = {key: value for key, value in given.items() if key in ActuatorDynamics.model_fields}
    rest = {key: value for key, value in given.items() if key not in for_all}
    known = (*ActuatorDynamics.model_fields, *surfaces)
    wrong = [key for key in rest if key not in surfaces]
    refuse_unknown(wrong, known)
    own = {surface: rest.get(surface, {}) for surface in surfaces}
    return {surface: {**for_all, **it} if isinstance(it, dict) else it for surface, it in own.items()}
