"""How an instrument can break: the reading goes wrong, the aircraft does not.

Magnitudes are in the unit in which `sensors` has the instrument.
"""

from typing import Annotated, Any, Literal, Self

from pydantic import BeforeValidator, Field, model_validator

from beaver_ftc.documents.document import (
    Conflict,
    Number,
    Section,
    deny,
    entry,
    number,
    order_conflicts,
    refuse,
)
from beaver_ftc.scenario.airframe import among
from beaver_ftc.scenario.sensors import ALIASES, QUANTITIES, sensor_words, sensors_there

MOST_SCALE = 2.0


def fault_name(said: Any, names: tuple[str, ...]) -> Any:
    """What breaks: `sensor p` as a verdict has it, or an instrument's name in words, is the instrument's."""
    if not isinstance(said, str) or said in names:
        return said
    return _in_short(said.removeprefix(sensor_words("")))


def _in_short(name: Any) -> Any:
    return ALIASES.get(name, name) if isinstance(name, str) else name


def _examples(schema: dict[str, Any]) -> None:
    schema["examples"] = [*QUANTITIES, *ALIASES]


SensorName = Annotated[
    str,
    BeforeValidator(_in_short),
    among(sensors_there, "{!r} is no sensor"),
    entry(..., "the instrument that fails, as in `sensors`", json_schema_extra=_examples),
]


class SensorFault(Section):
    """When an instrument is broken."""

    sensor: SensorName
    at_s: Number = number(..., "s", "when the fault starts", ge=0, le=360_000, examples=[12])
    end_s: Number | None = number(None, "s", "when it is gone; left out: it stays", gt=0, examples=[20])
    profile: Literal["abrupt"] = entry("abrupt", "this type of fault is always abrupt", examples=["abrupt"])

    @model_validator(mode="before")
    @classmethod
    def _until(cls, given: Any) -> Any:
        """`until_s` says the same as `end_s`."""
        if isinstance(given, dict) and "until_s" in given:
            if "end_s" in given:
                deny("says the same as end_s, allowed: one of the two", "until_s")
            return {"end_s" if key == "until_s" else key: value for key, value in given.items()}
        return given

    @model_validator(mode="after")
    def _fits_together(self) -> Self:
        refuse([*order_conflicts(self.at_s, self.end_s, "at_s"), *_out_of_range(self)])
        return self


class SensorBias(SensorFault):
    """The reading is off by a constant."""

    type: Literal["bias"]
    magnitude: Number = number(
        ..., "the sensor's unit", "added to the reading", ge=-5000, le=5000, examples=[2]
    )


class SensorNoise(SensorFault):
    """The reading scatters.

    magnitude: standard deviation added to the reading, the sensor's unit
    """

    type: Literal["noise"]
    magnitude: Number = number(..., "the sensor's unit", gt=0, le=5000, examples=[0.5])


class SensorScale(SensorFault):
    """The reading is (1 + magnitude) times what it should be.

    magnitude: relative error of the reading, share of 1
    """

    type: Literal["scale"]
    magnitude: Number = number(..., "share of 1", ge=-MOST_SCALE, le=MOST_SCALE, examples=[0.2])


class SensorFreeze(SensorFault):
    """The reading stays as it was."""

    type: Literal["freeze"]


class SensorLost(SensorFault):
    """The reading is missing, and is flagged as missing."""

    type: Literal["lost"]


def _out_of_range(fault: SensorFault) -> list[Conflict]:
    """The conflict of an offset or a noise larger than its instrument can have."""
    of = QUANTITIES[fault.sensor]
    if not isinstance(fault, SensorBias | SensorNoise) or abs(fault.magnitude) <= of.most:
        return []
    says = f"out of range, allowed: at most {of.most:g} {of.unit} for {fault.sensor}"
    return [(("magnitude",), f"{fault.magnitude:g} is {says}")]


AnySensorFault = Annotated[
    SensorBias | SensorNoise | SensorScale | SensorFreeze | SensorLost, Field(discriminator="type")
]
