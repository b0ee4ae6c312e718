"""What a scenario declares in `fdi.bounds`, which parts of the diagnosis use it, and which errors of the
truth it does not cover.

Detectors, warnings, studies and products ask `Declared`, which is made once; none reads `fdi.bounds` for
itself. Errors that are not declared are facts, of which warnings are views.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum, StrEnum
from math import radians
from typing import Any, NamedTuple, Self

import numpy as np

from beaver_ftc.aircraft import Aircraft, Term
from beaver_ftc.aircraft.aircraft import AXES, MOMENTS
from beaver_ftc.design.air import Dryden
from beaver_ftc.design.context import SIGNALS
from beaver_ftc.scenario.diagnosis import FdiConfig
from beaver_ftc.scenario.faults import of_a_sensor
from beaver_ftc.scenario.sensors import NOISE_LIMIT_SIGMA, PRESETS, Sensors

# Of the mass, where accelerometers are compared with the designer's forces: fuel and load, which no key of
# `fdi.bounds` declares.
MASS_TOLERANCE = 0.05
PerAxis = tuple[float, float, float]


class Error(NamedTuple):
    """What is declared of one instrument, SI.

    noise: standard deviation of a sample's; steady: size of a constant error; slope: as a share. random:
    noise and rounding together, a standard deviation. worst: how far a reading of zero can be off.
    """

    noise: float
    steady: float
    resolution: float
    slope: float
    random: float
    worst: float

    def of_reading(self, largest: float) -> float:
        """How far a reading of at most `largest` can be off."""
        return (self.worst + self.slope * largest) / (1.0 - self.slope)


class SensorErrors(dict[str, Error]):
    """Those of all instruments, by their names in `sensors`."""

    def __init__(self, sensors: Sensors) -> None:
        super().__init__()
        self.declared = sensors
        for name, sensor in sensors:
            noise, bias, resolution = sensor.noise_bias_quantum
            worst, slope = NOISE_LIMIT_SIGMA * noise + abs(bias) + resolution / 2, abs(sensor.scale_error)
            self[name] = Error(noise, abs(bias), resolution, slope, sensor.random_error, worst)

    def each(self, of_it: str, names: Iterable[str] = SIGNALS) -> np.ndarray:
        """One number of several instruments, (n,)."""
        return np.array([getattr(self[name], of_it) for name in names])

    @property
    def is_ideal(self) -> bool:
        """Whether no error of any instrument is declared."""
        return self.declared.is_ideal

    def exceeded_by(self, sensors: Sensors) -> list[str]:
        """The instruments of a truth whose errors are not within the declared ones."""
        return [
            name
            for name, sensor in sensors
            if not (sensor.is_ideal or sensor.is_within(getattr(self.declared, name)))
        ]


@dataclass(frozen=True)
class CoefficientErrors:
    """Tolerance of the aerodynamic coefficients: one share for all moment coefficients, or one for each."""

    share: float | Mapping[str, float]

    def of(self, name: str) -> float:
        """Share of a moment coefficient."""
        return self.share.get(name, 0.0) if isinstance(self.share, Mapping) else self.share

    @property
    def largest(self) -> float:
        """The largest share, which those of the forces are taken to have."""
        return max(self.share.values(), default=0.0) if isinstance(self.share, Mapping) else self.share

    def absolute(self, terms: Sequence[Term], values: np.ndarray) -> np.ndarray:
        """Tolerance of each of so many terms, absolute; values: the designer's."""
        return np.array([self.of(term.name) for term in terms]) * np.abs(values[: len(terms)])


_known: dict[int, SensorErrors] = {}  # each holds the section whose number it is found by
_MOST = 64


def _errors_of(sensors: Sensors) -> SensorErrors:
    """Those of a section. A flight asks several times, and flights of a sweep share what does not vary."""
    known = _known.get(id(sensors))
    if known is None:
        if len(_known) >= _MOST:
            _known.clear()
        known = _known[id(sensors)] = SensorErrors(sensors)
    return known


@dataclass(frozen=True)
class ActuatorErrors:
    """How far a surface may be from its actuator's model, rad."""

    deflection_rad: float


@dataclass(frozen=True)
class Declared:
    """What `fdi.bounds` declares of an aircraft, and who takes part in the diagnosis that relies on it.

    inertia: tolerance of each moment of inertia as a share. coupling: relative errors of Pqr, Qpr, Rpq;
    constant_rad_s2: unstructured angular acceleration by axis; both as published. vertical_wind_mps: the
    strongest steady one. uses_statistics: whether the statistical detector runs. compares_across: whether
    motion across a surface's column excludes it. monitors_sensors: whether the sensor monitor runs.
    """

    aircraft: Aircraft
    air: Dryden
    sensors: SensorErrors
    coefficients: CoefficientErrors
    actuators: ActuatorErrors
    inertia: float
    coupling: PerAxis
    constant_rad_s2: PerAxis
    vertical_wind_mps: float
    uses_statistics: bool = False
    compares_across: bool = False
    monitors_sensors: bool = False

    @classmethod
    def of(cls, scenario: Any) -> Self:
        """As a scenario (a `schema.Scenario`, which imports what imports this) declares it."""
        fdi, broken = scenario.fdi, any(of_a_sensor(fault) for fault in scenario.faults)
        return cls.by(fdi, scenario.airframe, scenario.substeps, broken)

    @classmethod
    def by(cls, fdi: FdiConfig, aircraft: Aircraft, substeps: int = 1, sensor_fails: bool = False) -> Self:
        """As a diagnosis declares it; sensor_fails: whether the scenario breaks an instrument."""
        bounds = fdi.bounds
        return cls(
            aircraft,
            Dryden(bounds.turbulence),
            _errors_of(bounds.sensors),
            CoefficientErrors(bounds.coefficients),
            ActuatorErrors(radians(bounds.deflection_deg)),
            bounds.inertia,
            bounds.inertia_coupling.as_tuple(),
            bounds.constant_rad_s2.as_tuple(),
            bounds.vertical_wind_mps,
            uses_statistics=fdi.weighs_chance,
            compares_across=fdi.compares_across(substeps),
            monitors_sensors=fdi.monitors_sensors(sensor_fails),
        )

    @property
    def is_noise_free(self) -> bool:
        """Whether neither errors of instruments nor turbulence are declared."""
        return self.sensors.is_ideal and not self.air.moves

    @property
    def uses_accelerometers(self) -> bool:
        """Whether accelerometers are compared with the designer's forces, which separate surfaces that the
        rates alone do not."""
        return self.uses_statistics and self.compares_across and self.aircraft.forces_separate_surfaces

    @property
    def follows_gusts_by_forces(self) -> bool:
        """Whether the vanes show a gust beside the forces of the design model."""
        return self.uses_statistics and self.air.moves and bool(self.aircraft.measurable_forces)

    @property
    def follows_gusts_by_accelerometers(self) -> bool:
        """Whether accelerometers stand in for forces that the design model lacks.

        Not where the sensor monitor may find them broken, and only of aircraft whose damage takes surfaces:
        light ones, whose law answers the rest of a gust, alarmed in 3 of 34 and 4 of 30 healthy flights.
        """
        unknown = self.aircraft.loses_surfaces and not self.aircraft.measurable_forces
        return self.uses_statistics and self.air.moves and unknown and not self.monitors_sensors


_FORCES = ("CY", "CZ")  # those that accelerometers are compared with
_ROUNDING = 1e-9


class Reader(StrEnum):
    """The part of the diagnosis that relies on what is not true."""

    THRESHOLDS = "worst-case thresholds"
    STATISTICS = "statistical detector"
    ACCELEROMETERS = "accelerometers"
    SENSOR_MONITOR = "sensor monitor"


class Kind(Enum):
    """What is undeclared, and the sentence that says so of its fields."""

    LARGER = "{key}: {value:g}{unit} is beyond {bound}, {allowed:g}"
    FORCE = "{key}: {value:g} is beyond {bound}, {allowed:g}, by which accelerometers are judged"
    MASS = (
        "{key}: {value:g} is off the designer's by more than {allowed:g}, by which accelerometers are judged"
    )
    FASTER = "{key}: {value:g}{unit} is faster than {bound}, {allowed:g}"
    SEVERITY = "{key}: {names[0]} is more than {bound}, {names[1]}"
    GUST = "{key}: what a gust does is covered by {bound} only"
    SHARP_GUST = (
        "{key}: JSBSim's does not rotate, but with {bound} the vanes take a "
        "sharp one for one that does: fdi.statistical may raise an alarm"
    )
    CG = "{key}: a displaced centre of gravity is covered by {bound} only"
    WIND = (
        "{key}: vertical wind of {value:g}{unit} is more than {bound}, {allowed:g}: "
        "the sensor monitor may take a sound altimeter for broken"
    )
    SENSOR = "{key}.{names[0]}: its errors are not within {bound}, so alarms without a fault may come; {cure}"
    SENSORS = (
        "{key}: the errors of {listed} are not within {bound}, so alarms without a fault may come; {cure}"
    )


@dataclass(frozen=True)
class Undeclared:
    """An error of the truth beyond what is declared.

    key: of the scenario. bound: the key that covers it, or would. read_by: who relies on it. value: what the
    scenario says, in `unit`; nominal: what would be no error; allowed: the largest declared distance between
    them. names: severities, or instruments. cure: how to declare it.
    """

    kind: Kind
    key: str
    bound: str
    read_by: Reader = Reader.THRESHOLDS
    value: float = 0.0
    nominal: float = 0.0
    allowed: float = 0.0
    unit: str = ""
    names: tuple[str, ...] = ()
    cure: str = ""

    @property
    def excess(self) -> float:
        """How far the error is beyond what is declared."""
        return abs(self.value - self.nominal) - self.allowed

    @property
    def is_beyond(self) -> bool:
        """Whether it is, by more than rounding."""
        return self.excess > _ROUNDING

    def __str__(self) -> str:
        return self.kind.value.format(**vars(self), listed=", ".join(self.names))


def undeclared(scenario: Any) -> Iterator[Undeclared]:
    """What the truth of a `schema.Scenario` does beyond its `fdi.bounds`: an alarm may then have no fault
    behind it."""
    if scenario.fdi.scheme == "none":
        return
    declared = Declared.of(scenario)
    yield from _unstructured(scenario, declared)
    yield from _air(scenario, declared)
    yield from _sensors(scenario, declared)
    yield from _severity(scenario, declared)
    yield from filter(_is_beyond, _moments(scenario, declared))
    if any(scenario.uncertainty.cg_m):
        yield Undeclared(Kind.CG, "uncertainty.cg_m", "fdi.bounds.constant_rad_s2")
    if declared.uses_accelerometers:
        yield from filter(_is_beyond, _forces(scenario, declared))


def _is_beyond(fact: Undeclared) -> bool:
    return fact.is_beyond


def _moments(scenario: Any, declared: Declared) -> Iterator[Undeclared]:
    """Moment coefficients and inertia, as ratios to the designer's."""
    truth, bound = scenario.uncertainty, "fdi.bounds.coefficients"
    for name, ratio in truth.coefficients.items():
        if name[:2] in MOMENTS:
            key, allowed = f"uncertainty.coefficients.{name}", declared.coefficients.of(name)
            yield Undeclared(Kind.LARGER, key, bound, value=ratio, nominal=1.0, allowed=allowed)
    for axis, ratio in truth.inertia:
        key = f"uncertainty.inertia.{axis}"
        yield Undeclared(
            Kind.LARGER, key, "fdi.bounds.inertia", value=ratio, nominal=1.0, allowed=declared.inertia
        )


def _forces(scenario: Any, declared: Declared) -> Iterator[Undeclared]:
    """Errors of the forces that accelerometers are compared with."""
    truth, allowed, reader = scenario.uncertainty, declared.coefficients.largest, Reader.ACCELEROMETERS
    for name, ratio in truth.coefficients.items():
        if name[:2] in _FORCES:
            key = f"uncertainty.coefficients.{name}"
            yield Undeclared(Kind.FORCE, key, "fdi.bounds.coefficients", reader, ratio, 1.0, allowed)
    heavier = truth.mass / scenario.design_model.mass
    yield Undeclared(Kind.MASS, "uncertainty.mass", "design_model.mass", reader, heavier, 1.0, MASS_TOLERANCE)


def _sensors(scenario: Any, declared: Declared) -> Iterator[Undeclared]:
    """One fact for all instruments, and what would declare them."""
    beyond = tuple(declared.sensors.exceeded_by(scenario.sensors))
    if beyond:
        enough = (name for name in PRESETS if _covers(name, scenario.sensors))
        preset = next(enough, None)
        cure = (
            f"`fdi.bounds.sensors: {preset}` declares them" if preset else "the same keys there declare them"
        )
        kind = Kind.SENSOR if len(beyond) == 1 else Kind.SENSORS
        yield Undeclared(kind, "sensors", "fdi.bounds.sensors", names=beyond, cure=cure)


def _covers(preset: str, truth: Sensors) -> bool:
    declared = Sensors.model_validate(preset)
    return all(sensor.is_within(getattr(declared, name)) for name, sensor in truth)


def _severity(scenario: Any, declared: Declared) -> Iterator[Undeclared]:
    """Turbulence stronger than the declared one, by the standard deviation of its gusts."""
    flown, bound = Dryden(scenario.environment.severity or "none"), "fdi.bounds.turbulence"
    if flown.rank > declared.air.rank:
        yield Undeclared(
            Kind.SEVERITY, "environment.severity", bound, value=flown.sigma_mps,
            allowed=declared.air.sigma_mps, unit=" m/s", names=(flown.severity, declared.air.severity),
        )  # fmt: skip


def _unstructured(scenario: Any, declared: Declared) -> Iterator[Undeclared]:
    """Inertia coupling and sinusoids beyond what is admitted of them."""
    truth, statistical = scenario.uncertainty, scenario.fdi.statistical
    for axis, coupling, constant in zip(AXES, declared.coupling, declared.constant_rad_s2, strict=True):
        theta, sinusoid = getattr(truth.inertia_coupling, axis), getattr(truth.sinusoid, axis)
        key, swing = f"uncertainty.sinusoid.{axis}", sinusoid.amplitude_rad_s2
        facts = [
            Undeclared(
                Kind.LARGER, f"uncertainty.inertia_coupling.{axis}", f"fdi.bounds.inertia_coupling.{axis}",
                value=theta, allowed=coupling,
            ),
            Undeclared(
                Kind.LARGER, key, f"fdi.bounds.constant_rad_s2.{axis}", value=swing, allowed=constant,
                unit=" rad/s2",
            ),
        ]  # fmt: skip
        if swing > 0 and statistical:
            rad_s, slowest = sinusoid.frequency_rad_s, statistical.uncertainty_rad_s
            bound, reader = "fdi.statistical.uncertainty_rad_s", Reader.STATISTICS
            facts.append(Undeclared(Kind.FASTER, key, bound, reader, rad_s, 0.0, slowest, " rad/s"))
        yield from filter(_is_beyond, facts)


def _air(scenario: Any, declared: Declared) -> Iterator[Undeclared]:
    """Gusts, which rotate nothing, and vertical wind by which a sound altimeter seems broken."""
    environment, key = scenario.environment, "environment.gust"
    if any(any(gust.velocity_mps) for gust in environment.gusts):
        yield Undeclared(Kind.GUST, key, "fdi.bounds.constant_rad_s2")
        if declared.follows_gusts_by_forces:
            yield Undeclared(Kind.SHARP_GUST, key, "fdi.bounds.turbulence", Reader.STATISTICS)
    if declared.monitors_sensors:
        steady = environment.wind_mps[2]
        largest = max((steady, *(steady + gust.velocity_mps[2] for gust in environment.gusts)), key=abs)
        bound, allowed = "fdi.bounds.vertical_wind_mps", declared.vertical_wind_mps
        reader, speed = Reader.SENSOR_MONITOR, abs(largest)
        wind = Undeclared(Kind.WIND, "environment", bound, reader, speed, 0.0, allowed, " m/s")
        yield from filter(_is_beyond, (wind,))
