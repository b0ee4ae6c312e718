"""The trimmed flight condition a flight starts from; its keys depend on the aircraft."""

from functools import lru_cache
from math import degrees
from typing import Any, ClassVar, Self

from pydantic import create_model, model_validator

from beaver_ftc.aircraft import Aircraft, load
from beaver_ftc.documents.document import Flag, Number, Section, deny, entry, number
from beaver_ftc.scenario.airframe import checked_aircraft


class Initial(Section):
    """The trimmed flight condition the run starts from."""

    airspeed_mps: Number = number(45.0, "m/s", "true airspeed, validated from 30 to 55", ge=20, le=70)
    altitude_m: Number = number(1828.8, "m", "altitude above sea level", ge=-300, le=6000)
    on_ground: Flag | None = entry(
        None, "true: standing on the ground, which is at altitude_m; under an autopilot alone (`sitl`)"
    )

    _airframe: ClassVar[Aircraft | None] = None

    @model_validator(mode="after")
    def _can_stand(self) -> Self:
        if self.on_ground and self._airframe is not None and self._airframe.file.ground is None:
            deny(f"{self._airframe.name}'s file has no `ground` to stand on, allowed: false", "on_ground")
        return self

    def __reduce__(self) -> tuple[Any, ...]:
        """Classes of a single aircraft are made again where they are read."""
        return _initial_again, (self._airframe, self.model_dump(exclude_unset=True))


@lru_cache(maxsize=32)
def initial_of(aircraft: Aircraft) -> type[Initial]:
    """The flight condition of an aircraft: with its engine's settings, and the surfaces trim leaves alone."""
    keys = _flow_keys(aircraft)
    for name, setting in aircraft.engine.settings.items():
        low, high = setting.range
        says = setting.says or name
        keys[name] = Number, number(setting.default, setting.unit, says, ge=low, le=high)
    for surface in aircraft.left_by_trim:
        travel, says = aircraft.travel[surface], f"{surface} deflection"
        low, high = degrees(travel.min_rad), degrees(travel.max_rad)
        of = number(0.0, "deg", says, ge=low, le=high, examples=[round(0.25 * high, 1)])
        keys[f"{surface}_deg"] = Number, of
    made = create_model("Initial", __base__=Initial, __doc__=Initial.__doc__, **keys)
    made._airframe = aircraft
    return made


def airspeeds_of(aircraft: Aircraft) -> tuple[float, float]:
    """The lowest and the highest airspeed that a scenario of an aircraft may name, m/s."""
    low, high = aircraft.envelope.airspeed_mps
    return min(20.0, 2.0 / 3.0 * low), max(70.0, 14.0 / 11.0 * high)


def highest_of(aircraft: Aircraft) -> float:
    """The highest altitude that a scenario of an aircraft may name, m."""
    return max(6000.0, aircraft.file.start.altitude_m or 0.0)


def _flow_keys(aircraft: Aircraft) -> dict[str, Any]:
    """Airspeed and altitude, whose range and default make room for the aircraft's own."""
    (low, high), start = aircraft.envelope.airspeed_mps, aircraft.file.start
    slowest, fastest = airspeeds_of(aircraft)
    default = start.airspeed_mps or (45.0 if low <= 45.0 <= high else 0.5 * (low + high))
    says = f"true airspeed, validated from {low:g} to {high:g}"
    speed = number(default, "m/s", says, ge=slowest, le=fastest)
    keys: dict[str, Any] = {"airspeed_mps": (Number, speed)}
    if start.altitude_m is not None:
        most = highest_of(aircraft)
        altitude = number(start.altitude_m, "m", "altitude above sea level", ge=-300, le=most)
        keys["altitude_m"] = Number, altitude
    return keys


def _initial_again(aircraft: Aircraft | None, values: dict[str, Any]) -> Initial:
    return (initial_of(aircraft) if aircraft else Initial).model_validate(values)


def given_initial(given: Any) -> Any:
    """The flight condition given, as one of the aircraft in question."""
    if isinstance(given, Initial):
        given = given.model_dump(exclude_unset=True)
    return initial_of(checked_aircraft()).model_validate(given)


def default_initial() -> Initial:
    """The default flight condition of the aircraft in question."""
    return initial_of(checked_aircraft())()


def initial_schema(schema: dict[str, Any]) -> None:
    """Show an editor the keys of the built-in aircraft."""
    schema.clear()
    schema.update(initial_of(load()).model_json_schema())
