"""What the instruments do to the truth: one section a signal; what is left out is measured perfectly."""

from typing import Any

from pydantic import Field, GetJsonSchemaHandler, model_validator
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema

from beaver_ftc.scenario.base import Number, Section, number


class _Sensor(Section):
    """measured = (1 + scale_error) true(t - delay) + bias + white noise."""

    scale_error: Number = number(0.0, unit="share of 1", says="relative error of the slope", ge=-1, le=1)
    delay_s: Number = number(0.0, unit="s", says="age of the measurement", ge=0, le=1)

    @property
    def is_ideal(self) -> bool:
        return all(value == 0 for _, value in self)


class RateGyro(_Sensor):
    """A body rate."""

    noise_std_deg_s: Number = number(0.0, unit="deg/s", says="standard deviation of a sample", ge=0, le=100)
    bias_deg_s: Number = number(0.0, unit="deg/s", says="constant error", ge=-100, le=100)


class FlowVane(_Sensor):
    """An incidence angle."""

    noise_std_deg: Number = number(0.0, unit="deg", says="standard deviation of a sample", ge=0, le=45)
    bias_deg: Number = number(0.0, unit="deg", says="constant error", ge=-45, le=45)


class Airspeed(_Sensor):
    """True airspeed."""

    noise_std_mps: Number = number(0.0, unit="m/s", says="standard deviation of a sample", ge=0, le=50)
    bias_mps: Number = number(0.0, unit="m/s", says="constant error", ge=-50, le=50)


class DynamicPressure(_Sensor):
    """Dynamic pressure."""

    noise_std_pa: Number = number(0.0, unit="Pa", says="standard deviation of a sample", ge=0, le=5000)
    bias_pa: Number = number(0.0, unit="Pa", says="constant error", ge=-5000, le=5000)


PRESETS: dict[str, dict[str, dict[str, float]]] = {"ideal": {}}


class Sensors(Section):
    """The measurements the diagnosis and the law live on."""

    p: RateGyro = Field(default_factory=RateGyro)
    q: RateGyro = Field(default_factory=RateGyro)
    r: RateGyro = Field(default_factory=RateGyro)
    alpha: FlowVane = Field(default_factory=FlowVane)
    beta: FlowVane = Field(default_factory=FlowVane)
    V: Airspeed = Field(default_factory=Airspeed)
    qdyn: DynamicPressure = Field(default_factory=DynamicPressure)

    @model_validator(mode="before")
    @classmethod
    def _expand(cls, given: Any) -> Any:
        return PRESETS.get(given, given) if isinstance(given, str) else given

    @property
    def is_ideal(self) -> bool:
        return all(sensor.is_ideal for _, sensor in self)

    @classmethod
    def __get_pydantic_json_schema__(cls, core: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchemaValue:
        signals = handler.resolve_ref_schema(handler(core))
        preset = {"enum": list(PRESETS), "type": "string", "description": "a preset"}
        return {"anyOf": [preset, signals]}
