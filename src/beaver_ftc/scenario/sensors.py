"""The instruments: a row each, what they do to the truth, and their names.

What is left out of `sensors` is measured perfectly.
"""

from collections.abc import Callable
from math import hypot, radians, sqrt
from pathlib import Path
from typing import Any, ClassVar, NamedTuple, Self, TypeVar

from pydantic import Field, GetJsonSchemaHandler, create_model, model_validator
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema

from beaver_ftc.documents.base import Number, Section, number
from beaver_ftc.documents.document import parse
from beaver_ftc.scenario.airframe import checked_aircraft

# Noise is normal and cut off at so many standard deviations: a bound on it can be declared, and holds.
NOISE_LIMIT_SIGMA = 4.0


class _Sensor(Section):
    """measured = quantised((1 + scale_error) lagged(t - delay) + bias + noise); lost: the last one.

    scale_error: relative error of the slope, share of 1
    delay_s: age of the measurement, s
    bandwidth_rad_s: bandwidth of the first-order lag, 0 means none, rad/s
    dropout_share: samples lost, the last one standing in, share of 1
    """

    # Keys of noise, bias and resolution, and their unit in SI.
    si: ClassVar[tuple[str, str, str, float]]

    scale_error: Number = number(0.0, "share of 1", ge=-0.9, le=1, examples=[0.01])
    delay_s: Number = number(0.0, "s", ge=0, le=1, examples=[0.02])
    bandwidth_rad_s: Number = number(0.0, "rad/s", ge=0, le=100_000, examples=[60])
    dropout_share: Number = number(0.0, "share of 1", ge=0, le=0.99, examples=[0.05])

    @property
    def is_ideal(self) -> bool:
        return all(value == 0 for _, value in self)

    @property
    def is_bounded(self) -> bool:
        """Whether the error is bounded by noise, bias, resolution and slope alone."""
        return self.delay_s == self.bandwidth_rad_s == self.dropout_share == 0

    def is_within(self, declared: Self) -> bool:
        """Whether `declared`, read as bounds, covers this sensor's errors."""
        sizes = [(abs(value), abs(getattr(declared, key))) for key, value in self]
        return all(size <= allowed for size, allowed in sizes)

    @property
    def noise_bias_quantum(self) -> tuple[float, float, float]:
        """Standard deviation, bias and resolution, SI."""
        noise, bias, quantum, unit = self.si
        return getattr(self, noise) * unit, getattr(self, bias) * unit, getattr(self, quantum) * unit

    @property
    def random_error(self) -> float:
        """Standard deviation of a sample, noise and resolution together, SI."""
        noise, _, quantum = self.noise_bias_quantum
        return hypot(noise, quantum / sqrt(12.0))


_S = TypeVar("_S", bound=_Sensor)


def _reads(suffix: str, unit: str, most: float, si: float = 1.0) -> Callable[[type[_S]], type[_S]]:
    """An instrument's row: the ending of its keys, their unit, the largest error, and the unit in SI."""
    keys = f"noise_std_{suffix}", f"bias_{suffix}", f"quantum_{suffix}"
    meaning = "standard deviation of a sample", "constant error", "resolution"
    fields: dict[str, Any] = {
        key: (Number, number(0.0, unit, says, ge=least, le=most, examples=[most / 1000]))
        for key, says, least in zip(keys, meaning, (0, -most, 0), strict=True)
    }

    def made(cls: type[_S]) -> type[_S]:
        cls.si = (*keys, si)
        return create_model(
            cls.__name__, __base__=cls, __module__=cls.__module__, __doc__=cls.__doc__, **fields
        )

    return made


@_reads("deg_s", "deg/s", 100, radians(1.0))
class RateGyro(_Sensor):
    """A body rate."""


@_reads("deg", "deg", 45, radians(1.0))
class FlowVane(_Sensor):
    """An incidence angle."""


@_reads("mps", "m/s", 50)
class Airspeed(_Sensor):
    """True airspeed."""


@_reads("pa", "Pa", 5000)
class DynamicPressure(_Sensor):
    """Dynamic pressure."""


class AttitudeAngle(FlowVane):
    """Roll, pitch or yaw: a vertical or directional gyro, or integrated rates that drift away."""

    drift_deg_h: Number = number(
        0.0, "deg/h", "growth of the error from the start on", ge=-3600, le=3600, examples=[10]
    )

    @property
    def drift_rad_s(self) -> float:
        """The drift, SI."""
        return radians(self.drift_deg_h) / 3600.0


@_reads("m", "m", 500)
class Altimeter(_Sensor):
    """Altitude above sea level."""


@_reads("rpm", "rpm", 500)
class Tachometer(_Sensor):
    """Engine speed."""


@_reads("inhg", "inHg", 10)
class ManifoldGauge(_Sensor):
    """Manifold pressure."""


@_reads("mps2", "m/s2", 100)
class Accelerometer(_Sensor):
    """Specific force along a body axis at the centre of mass: all forces but gravity, over the mass."""


class Quantity(NamedTuple):
    """What an instrument measures: unit, in SI, the largest offset or noise of a fault, in words."""

    unit: str
    si: float
    most: float
    words: str = ""


_DEG = radians(1.0)
QUANTITIES = {
    **dict.fromkeys("pqr", Quantity("deg/s", _DEG, 200.0)),
    **dict.fromkeys(("alpha", "beta", "phi", "theta", "psi"), Quantity("deg", _DEG, 90.0)),
    "V": Quantity("m/s", 1.0, 100.0, "airspeed"),
    "qdyn": Quantity("Pa", 1.0, 5000.0, "dynamic_pressure"),
    "altitude": Quantity("m", 1.0, 5000.0),
    "engine_rpm": Quantity("rpm", 1.0, 3000.0),
    "manifold_pressure": Quantity("inHg", 1.0, 50.0),
    **dict.fromkeys(("ax", "ay", "az"), Quantity("m/s2", 1.0, 100.0)),
}
ALIASES = {of.words: name for name, of in QUANTITIES.items() if of.words}
ENGINE = ("engine_rpm", "manifold_pressure")  # instruments of an engine like the Beaver's
ACCELEROMETERS = ("ax", "ay", "az")


_FILE = Path(__file__).with_name("presets.yaml")
PRESETS: dict[str, dict[str, dict[str, float]]] = parse(_FILE.read_text(encoding="utf-8")).data


class Sensors(Section):
    """The measurements the diagnosis and the law live on."""

    p: RateGyro = Field(default_factory=RateGyro)
    q: RateGyro = Field(default_factory=RateGyro)
    r: RateGyro = Field(default_factory=RateGyro)
    alpha: FlowVane = Field(default_factory=FlowVane)
    beta: FlowVane = Field(default_factory=FlowVane)
    V: Airspeed = Field(default_factory=Airspeed)
    qdyn: DynamicPressure = Field(default_factory=DynamicPressure)
    phi: AttitudeAngle = Field(default_factory=AttitudeAngle)
    theta: AttitudeAngle = Field(default_factory=AttitudeAngle)
    psi: AttitudeAngle = Field(default_factory=AttitudeAngle)
    altitude: Altimeter = Field(default_factory=Altimeter)
    engine_rpm: Tachometer = Field(default_factory=Tachometer)
    manifold_pressure: ManifoldGauge = Field(default_factory=ManifoldGauge)
    ax: Accelerometer = Field(default_factory=Accelerometer)
    ay: Accelerometer = Field(default_factory=Accelerometer)
    az: Accelerometer = Field(default_factory=Accelerometer)

    @model_validator(mode="before")
    @classmethod
    def _expand(cls, given: Any) -> Any:
        return PRESETS.get(given, given) if isinstance(given, str) else given

    @property
    def is_ideal(self) -> bool:
        return all(sensor.is_ideal for _, sensor in self)

    @property
    def gyros_vary(self) -> bool:
        """Whether the error of some gyro is more than a constant."""
        gyros = (self.p, self.q, self.r)
        return any(gyro.random_error > 0.0 or gyro.scale_error != 0.0 for gyro in gyros)

    @classmethod
    def __get_pydantic_json_schema__(cls, core: CoreSchema, handler: GetJsonSchemaHandler) -> JsonSchemaValue:
        signals = handler.resolve_ref_schema(handler(core))
        preset = {"enum": list(PRESETS), "type": "string", "description": "a preset"}
        return {"anyOf": [preset, signals]}


def sensors_there() -> tuple[str, ...]:
    """The instruments of the aircraft in question."""
    engine = checked_aircraft().has_engine_instruments
    return tuple(name for name in Sensors.model_fields if engine or name not in ENGINE)


def sensor_words(name: str) -> str:
    """What a verdict calls a sensor: surfaces may have the same name."""
    return f"sensor {name}"
