"""Errors of the truth that `fdi.bounds` does not cover: facts, of which warnings are views."""

from collections.abc import Iterator
from dataclasses import dataclass
from enum import Enum, StrEnum
from typing import Any

from beaver_ftc.aircraft.aircraft import AXES, MOMENTS
from beaver_ftc.design.dryden import Dryden
from beaver_ftc.scenario.declared import MASS_TOLERANCE, Declared
from beaver_ftc.scenario.sensors import PRESETS, Sensors

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
