"""What a scenario may say of the flight path (`autopilot:`): altitude, airspeed, heading or bank in time."""

from collections.abc import Iterator
from functools import lru_cache, partial
from itertools import pairwise
from typing import Annotated, Any, Self

from pydantic import BeforeValidator, create_model, model_validator

from beaver_ftc.aircraft import Aircraft
from beaver_ftc.aircraft.aircraft import THRUST_TERM
from beaver_ftc.documents.document import Conflict, Flag, Number, Section, deny, entry, number, refuse
from beaver_ftc.scenario.airframe import checked_aircraft
from beaver_ftc.scenario.initial import airspeeds_of, highest_of

MAX_LEGS = 100
_LATEST_S = 360_000.0


class _Leg(Section):
    """From a time on: a value, or hold what is flown."""

    at_s: Number = number(0.0, "s", "from when on", ge=0, le=_LATEST_S, examples=[10])
    hold: Flag = entry(False, "true: hold what is flown or commanded at that time")
    value: Number | None = None

    @model_validator(mode="after")
    def _either_hold_or_value(self) -> Self:
        if self.hold and self.value is not None:
            deny("contradicts value, allowed: one of the two", "hold")
        if not self.hold and self.value is None:
            deny("required key is missing, allowed: value, or hold: true", "value")
        return self


class AltitudeLeg(_Leg):
    """An altitude, reached at a steady climb or descent."""

    value: Number | None = number(None, "m", "altitude above sea level", ge=-300, le=6000, examples=[1900])
    climb_mps: Number = number(2.5, "m/s", "how fast the command goes there", gt=0, le=10)


class AirspeedLeg(_Leg):
    """An airspeed."""

    value: Number | None = number(None, "m/s", "true airspeed", ge=20, le=70, examples=[45])
    change_mps2: Number = number(0.2, "m/s2", "how fast the command goes there", gt=0, le=5)


class HeadingLeg(_Leg):
    """A true heading, by the shorter turn."""

    value: Number | None = number(None, "deg", "true heading", ge=-360, le=360, examples=[90])


class BankLeg(_Leg):
    """A bank angle, right wing down positive."""

    value: Number | None = number(None, "deg", "bank angle", ge=-45, le=45, examples=[20])


@lru_cache
def _wide(kind: type[_Leg]) -> type[_Leg]:
    """A leg of any value."""
    keys: dict[str, Any] = {"value": (Number | None, number(None, "as said"))}
    return create_model(kind.__name__, __base__=kind, __doc__=kind.__doc__, **keys)


def _checked(kind: type[_Leg], given: Any) -> Any:
    """A leg whose value the aircraft in question can be asked for."""
    if isinstance(given, kind):
        return given
    leg, aircraft = _wide(kind).model_validate(given), checked_aircraft()
    low, high = (-300.0, highest_of(aircraft)) if kind is AltitudeLeg else airspeeds_of(aircraft)
    if leg.value is not None and not low <= leg.value <= high:
        says = str(kind.model_fields["value"].description)
        deny(f"{leg.value:g} is out of range, allowed: a number from {low:g} to {high:g} ({says})", "value")
    return kind.model_construct(leg.model_fields_set, **dict(leg))


def channels_of(aircraft: Aircraft) -> tuple[str, ...]:
    """What can be flown with an aircraft."""
    by = aircraft.airspeed_by
    refused = {"power": (), "pitch": ("altitude_m",), "": ("airspeed_mps",)}[by]
    return tuple(name for name in Autopilot.model_fields if name not in refused)


def _legs(says: str) -> Any:
    return entry((), says, max_length=MAX_LEGS)


class Autopilot(Section):
    """The profile to fly; a channel left out is left to the reference and the trim."""

    altitude_m: tuple[Annotated[AltitudeLeg, BeforeValidator(partial(_checked, AltitudeLeg))], ...] = _legs(
        "altitude in time"
    )
    airspeed_mps: tuple[Annotated[AirspeedLeg, BeforeValidator(partial(_checked, AirspeedLeg))], ...] = _legs(
        "true airspeed in time, by engine power; by pitch where there is none"
    )
    heading_deg: tuple[HeadingLeg, ...] = _legs("true heading in time")
    bank_deg: tuple[BankLeg, ...] = _legs("bank angle in time")

    @model_validator(mode="after")
    def _fits_together(self) -> Self:
        refuse(self._conflicts())
        return self

    def _conflicts(self) -> Iterator[Conflict]:
        for name, legs in self:
            for i, (before, leg) in enumerate(pairwise(legs), start=1):
                if leg.at_s <= before.at_s:
                    says = f"{leg.at_s:g} is not after {before.at_s:g}, allowed: legs in order"
                    yield (name, i, "at_s"), says
        if self.heading_deg and self.bank_deg:
            yield ("bank_deg",), "contradicts heading_deg, allowed: one of the two"
        aircraft = checked_aircraft()
        known = channels_of(aircraft)
        why = {
            "airspeed_mps": f"the file of {aircraft.name} does not say what thrust does (no engine.thrust, "
            f"and no term {THRUST_TERM} among its forces), so no airspeed can be held",
            "altitude_m": f"{aircraft.name} has no steady thrust, so it glides: no altitude can be held",
        }
        for name in self.channels:
            if name not in known:
                yield (name,), f"{why[name]}, allowed: {', '.join(known)}"

    @property
    def channels(self) -> tuple[str, ...]:
        """The channels with something to fly."""
        return tuple(name for name, legs in self if legs)
