"""The sensors: a row each, with its errors, its place in the diagnosis, its name in words, and how it can
break.

A sensor that is left out of a scenario's `sensors` measures perfectly. To add a sensor, add a row to ROWS,
and what its presets are to `presets.yaml`: it is then read at its own rate, logged, broken by scenarios,
and compared with the reading that it should equal. Only an equation of its own has to be written besides.

If an instrument breaks, the reading goes wrong, the aircraft does not. Magnitudes of its faults are in the
unit in which `sensors` has the instrument.
"""

from collections.abc import Callable
from math import hypot, radians, sqrt
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, NamedTuple, Self, TypeVar

from pydantic import BeforeValidator, Field, GetJsonSchemaHandler, create_model, model_validator
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema

from beaver_ftc.documents.document import (
    Conflict,
    Number,
    Section,
    deny,
    entry,
    number,
    order_conflicts,
    parse,
    refuse,
)
from beaver_ftc.scenario.airframe import among, checked_aircraft

# Noise is normal and cut off at so many standard deviations: a bound on it can be declared, and holds.
NOISE_LIMIT_SIGMA = 4.0
_FINEST_RESOLUTION = 1e-18  # SI; a reading divided by the smallest number that a file can have is infinite


class _Sensor(Section):
    """measured = quantised((1 + scale_error) lagged(t - delay) + bias + noise); lost: the last one.

    scale_error: relative error of the slope: a reading is multiplied by 1 + scale_error. If declared: below
    1, share of 1
    delay_s: delay of the measurement, s
    bandwidth_rad_s: bandwidth of the first-order lag; 0: no lag, rad/s
    dropout_share: share of lost samples, each replaced by the one before, share of 1
    """

    # Keys of noise, bias and resolution, their unit, and that unit in SI.
    si: ClassVar[tuple[str, str, str, float]]
    unit: ClassVar[str]

    scale_error: Number = number(0.0, "share of 1", ge=-0.9, le=1, examples=[0.01])
    delay_s: Number = number(0.0, "s", ge=0, le=1, examples=[0.02])
    bandwidth_rad_s: Number = number(0.0, "rad/s", ge=0, le=100_000, examples=[60])
    dropout_share: Number = number(0.0, "share of 1", ge=0, le=0.99, examples=[0.05])

    @property
    def is_ideal(self) -> bool:
        return not any(vars(self).values())

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
        """Standard deviation, bias and resolution, SI. One finer than any reading is rounded is none."""
        noise, bias, quantum, unit = self.si
        resolution = getattr(self, quantum) * unit
        sizes = getattr(self, noise) * unit, getattr(self, bias) * unit
        return *sizes, resolution if resolution >= _FINEST_RESOLUTION else 0.0

    @property
    def random_error(self) -> float:
        """Standard deviation of a sample, noise and resolution together, SI."""
        noise, _, quantum = self.noise_bias_quantum
        return hypot(noise, quantum / sqrt(12.0))


_S = TypeVar("_S", bound=_Sensor)


def _reads(suffix: str, unit: str, most: float, si: float = 1.0) -> Callable[[type[_S]], type[_S]]:
    """An instrument's row: the ending of its keys, their unit, the largest error, and the unit in SI."""
    keys = f"noise_std_{suffix}", f"bias_{suffix}", f"quantum_{suffix}"
    meaning = "standard deviation of the noise of a sample", "constant error", "resolution"
    fields: dict[str, Any] = {
        key: (Number, number(0.0, unit, says, ge=least, le=most, examples=[most / 1000]))
        for key, says, least in zip(keys, meaning, (0, -most, 0), strict=True)
    }

    def made(cls: type[_S]) -> type[_S]:
        cls.si = (*keys, si)
        cls.unit = unit
        return create_model(
            cls.__name__, __base__=cls, __module__=cls.__module__, __doc__=cls.__doc__, **fields
        )

    return made


@_reads("deg_s", "deg/s", 100, radians(1.0))
class RateGyro(_Sensor):
    """Body rate."""


@_reads("deg", "deg", 45, radians(1.0))
class FlowVane(_Sensor):
    """Angle of attack or of sideslip."""


@_reads("mps", "m/s", 50)
class Airspeed(_Sensor):
    """True airspeed."""


@_reads("pa", "Pa", 5000)
class DynamicPressure(_Sensor):
    """Dynamic pressure."""


class AttitudeAngle(FlowVane):
    """Bank angle, pitch attitude or heading. The instrument is a vertical gyro or a directional gyro, or it
    integrates rates. Integrated rates drift."""

    drift_deg_h: Number = number(
        0.0,
        "deg/h",
        "growth of the error",
        ge=-3600,
        le=3600,
        examples=[10],
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
    """Specific force along a body axis at the centre of mass: the sum of all forces except gravity, divided
    by the mass."""


class Equal(NamedTuple):
    """The reading that a sensor should equal, and by how much the two quantities may differ, SI."""

    reading: str
    within: float


class Row(NamedTuple):
    """One sensor.

    name: its key in `sensors`. errors: the model of them. most: the largest offset or noise of a fault, in
    the unit of its errors. test: the test of the sensor monitor (`diagnosis/monitors/redundancy.py`) in
    which a jump of its reading appears at once. words: another name of it in a scenario's faults. says: what
    it measures.

    Only of a sensor that the sensor monitor alone uses: truth is the JSBSim property that it measures, and
    that property's unit in SI; column is its log column; rate_hz is how often it is read, 0 for every JSBSim
    frame; equal is its redundancy, or test is the name of an equation of its own.
    """

    name: str
    errors: type[_Sensor]
    most: float
    test: str = ""
    words: str = ""
    truth: tuple[str, float] = ("", 1.0)
    column: str = ""
    rate_hz: float = 0.0
    equal: Equal | None = None
    says: str = ""


# Equations of the diagnosis use the first sixteen by their places: rates and flow, attitude and altitude,
# engine, accelerometers. Sensors that only the monitor compares stand below them, with the property they
# measure.
ROWS = (
    Row("p", RateGyro, 200.0, "roll", says="roll rate"),
    Row("q", RateGyro, 200.0, "pitch", says="pitch rate"),
    Row("r", RateGyro, 200.0, "yaw", says="yaw rate"),
    Row("alpha", FlowVane, 90.0, "incidence", says="angle of attack"),
    Row("beta", FlowVane, 90.0, "sideslip", says="angle of sideslip"),
    Row("V", Airspeed, 100.0, "speed", "airspeed", says="true airspeed"),
    Row("qdyn", DynamicPressure, 5000.0, "density", "dynamic_pressure", says="dynamic pressure"),
    Row("phi", AttitudeAngle, 90.0, "bank angle", says="bank angle"),
    Row("theta", AttitudeAngle, 90.0, "pitch angle", says="pitch attitude"),
    Row("psi", AttitudeAngle, 90.0, "heading", says="heading"),
    Row("altitude", Altimeter, 5000.0, "climb", says="altitude above sea level"),
    Row("engine_rpm", Tachometer, 3000.0, "engine speed", says="engine speed"),
    Row("manifold_pressure", ManifoldGauge, 50.0, "manifold pressure", says="manifold pressure"),
    Row("ax", Accelerometer, 100.0, says="specific force forward, along the x axis"),
    Row("ay", Accelerometer, 100.0, says="specific force to the right, along the y axis"),
    Row("az", Accelerometer, 100.0, says="specific force down, along the z axis"),
)
# The first rows: the inputs of the design model.
SIGNALS = ("p", "q", "r", "alpha", "beta", "V", "qdyn")
N_IN_EQUATIONS = sum(not row.truth[0] for row in ROWS)  # of these rows, from the first on


def frames_apart(i: int, dt: float) -> int:
    """JSBSim frames, of dt s each, from one sample of sensor i to the next."""
    return max(round(1.0 / ROWS[i].rate_hz / dt), 1) if ROWS[i].rate_hz else 1


class Quantity(NamedTuple):
    """The unit of a sensor's errors, that unit in SI, the largest offset or noise of a fault, its words."""

    unit: str
    si: float
    most: float
    words: str = ""


QUANTITIES = {row.name: Quantity(row.errors.unit, row.errors.si[-1], row.most, row.words) for row in ROWS}
ALIASES = {row.words: row.name for row in ROWS if row.words}
ENGINE = ("engine_rpm", "manifold_pressure")  # sensors of an engine like the Beaver's
OF_THE_SLIPSTREAM = ("V", "qdyn", *ENGINE)  # what dpt is worked out from
ACCELEROMETERS = ("ax", "ay", "az")


_FILE = Path(__file__).with_name("presets.yaml")
PRESETS: dict[str, dict[str, dict[str, float]]] = parse(_FILE.read_text(encoding="utf-8")).data


class _Sensors(Section):
    """Errors of the measurements that the diagnosis and the law receive."""

    if TYPE_CHECKING:  # its fields are the rows

        def __getattr__(self, name: str) -> Any: ...

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


_FIELDS: dict[str, Any] = {
    row.name: (row.errors, Field(default_factory=row.errors, description=row.says or None)) for row in ROWS
}
Sensors = create_model(
    "Sensors",
    __base__=_Sensors,
    __module__=__name__,
    __doc__=_Sensors.__doc__,
    **_FIELDS,
)


def sensors_there() -> tuple[str, ...]:
    """The instruments of the aircraft in question."""
    engine = checked_aircraft().has_engine_instruments
    return tuple(name for name in Sensors.model_fields if engine or name not in ENGINE)


def sensor_words(name: str) -> str:
    """What a verdict calls a sensor: surfaces may have the same name."""
    return f"sensor {name}"


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
    entry(
        ...,
        "instrument that fails, a name in `sensors`",
        json_schema_extra=_examples,
    ),
]


class SensorFault(Section):
    """When an instrument is broken."""

    sensor: SensorName
    at_s: Number = number(..., "s", "start of the fault", ge=0, le=360_000, examples=[12])
    end_s: Number | None = number(
        None, "s", "end of the fault; left out: the fault stays to the end of the flight", gt=0, examples=[20]
    )
    profile: Literal["abrupt"] = entry("abrupt", "time course: always abrupt", examples=["abrupt"])

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
    """The reading has a constant error."""

    type: Literal["bias"]
    magnitude: Number = number(
        ...,
        "the sensor's unit",
        "constant error",
        ge=-5000,
        le=5000,
        examples=[2],
    )


class SensorNoise(SensorFault):
    """The reading has additional noise.

    magnitude: its standard deviation, the sensor's unit
    """

    type: Literal["noise"]
    magnitude: Number = number(..., "the sensor's unit", gt=0, le=5000, examples=[0.5])


class SensorScale(SensorFault):
    """The reading is multiplied by 1 + magnitude.

    magnitude: relative error of the reading, share of 1
    """

    type: Literal["scale"]
    magnitude: Number = number(..., "share of 1", ge=-MOST_SCALE, le=MOST_SCALE, examples=[0.2])


class SensorFreeze(SensorFault):
    """The reading stays at its first value of the fault."""

    type: Literal["freeze"]


class SensorLost(SensorFault):
    """The instrument gives no reading. The reading is marked as missing."""

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
