"""The flight path to be flown (`autopilot:`): legs in time of altitude, airspeed, heading or bank."""

from collections.abc import Iterator
from itertools import pairwise
from math import inf
from typing import Annotated, Any, Self

from pydantic import Field, model_validator

from beaver_ftc.aircraft import Aircraft
from beaver_ftc.aircraft.aircraft import THRUST_TERM
from beaver_ftc.documents.document import Conflict, Flag, Number, Section, deny, entry, number, refuse
from beaver_ftc.scenario.airframe import airspeeds_of, checked_aircraft, highest_of
from beaver_ftc.scenario.instants import LATEST_S

MEAN_S = 10.0  # time constant of the mean by which airspeed and arrival are judged: a gust passes faster
MAX_LEGS = 100


class _Leg(Section):
    """From a time on: a value, or hold what is flown."""

    at_s: Number = number(0.0, "s", "start of the leg", ge=0, le=LATEST_S, examples=[10])
    hold: Flag = entry(
        False,
        "true: hold the commanded or, if there is none, the present value. Otherwise `value` is required",
    )
    value: Number | None = None

    @model_validator(mode="after")
    def _either_hold_or_value(self) -> Self:
        if self.hold and self.value is not None:
            deny("contradicts value, allowed: one of the two", "hold")
        if not self.hold and self.value is None:
            deny("required key is missing, allowed: value, or hold: true", "value")
        low, high = self._ends(checked_aircraft())
        if self.value is not None and not low <= self.value <= high:
            says = type(self).model_fields["value"].description
            allowed = f"allowed: a number from {low:g} to {high:g} ({says})"
            deny(f"{self.value:g} is out of range, {allowed}", "value")
        return self

    def _ends(self, aircraft: Aircraft) -> tuple[float, float]:
        """Between what values this aircraft can be asked for it, where that depends on it."""
        return -inf, inf


# Ranges as they are shown, for the usual aircraft; those of the scenario's own aircraft count (`_ends`).
_Altitude = Annotated[Number, Field(json_schema_extra={"maximum": 6000, "minimum": -300})]
_Airspeed = Annotated[Number, Field(json_schema_extra={"maximum": 70, "minimum": 20})]


class AltitudeLeg(_Leg):
    """A commanded altitude. The command changes to the new value at a constant rate of climb or descent."""

    value: _Altitude | None = number(None, "m", "altitude above sea level", examples=[1900])
    climb_mps: Number = number(2.5, "m/s", "rate of climb or descent", gt=0, le=10)

    def _ends(self, aircraft: Aircraft) -> tuple[float, float]:
        return -300.0, highest_of(aircraft)


class AirspeedLeg(_Leg):
    """A commanded airspeed. The command changes to the new value at a constant acceleration."""

    value: _Airspeed | None = number(None, "m/s", "true airspeed", examples=[45])
    change_mps2: Number = number(0.2, "m/s2", "acceleration of the command", gt=0, le=5)

    def _ends(self, aircraft: Aircraft) -> tuple[float, float]:
        return airspeeds_of(aircraft)


class HeadingLeg(_Leg):
    """A commanded true heading. The aircraft takes the shorter turn."""

    value: Number | None = number(None, "deg", "true heading", ge=-360, le=360, examples=[90])


class BankLeg(_Leg):
    """A commanded bank angle, positive with the right wing down."""

    value: Number | None = number(None, "deg", "bank angle", ge=-45, le=45, examples=[20])


def channels_of(aircraft: Aircraft) -> tuple[str, ...]:
    """What can be flown with an aircraft."""
    by = aircraft.airspeed_by
    refused = {"power": (), "pitch": ("altitude_m",), "": ("airspeed_mps",)}[by]
    return tuple(name for name in Autopilot.model_fields if name not in refused)


def _legs(says: str) -> Any:
    return entry((), says, max_length=MAX_LEGS)


class Autopilot(Section):
    """Each quantity has a list of legs. From its time `at_s`, a leg sets a new `value`, or with `hold:
    true` keeps the present value. A quantity that is left out is not controlled."""

    altitude_m: tuple[AltitudeLeg, ...] = _legs("altitude")
    airspeed_mps: tuple[AirspeedLeg, ...] = _legs(
        "true airspeed. Engine power holds it; without an engine, pitch"
    )
    heading_deg: tuple[HeadingLeg, ...] = _legs("true heading")
    bank_deg: tuple[BankLeg, ...] = _legs("bank angle")

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
