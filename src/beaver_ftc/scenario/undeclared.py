"""Errors of the truth that a scenario does not declare: with them, an alarm may have no fault behind it.

scenario: a `schema.Scenario`, not named as such because the schema imports this.
"""

from collections.abc import Iterator
from math import degrees, inf
from typing import Any, NamedTuple

from beaver_ftc.aircraft import AXES
from beaver_ftc.aircraft.aircraft import MOMENTS
from beaver_ftc.design.turbulence import Dryden
from beaver_ftc.scenario.declared import MASS_TOLERANCE, Declared
from beaver_ftc.scenario.kept import KeptBySections
from beaver_ftc.scenario.sensors import PRESETS, Sensors

_FORCES = ("CY", "CZ")  # begin the names of the coefficients that accelerometers are compared with
_ROUNDING = 1e-9  # a value beyond its bound by less is within it
_BY_ACCELEROMETERS = ", by which accelerometers are judged"
_SHARP_GUST = (
    "JSBSim's does not rotate, but with fdi.bounds.turbulence the vanes take a sharp one for one that does: "
    "fdi.statistical may raise an alarm"
)
_SEEMS_BROKEN = "the sensor monitor may take a sound altimeter for broken"


class Undeclared(NamedTuple):
    """An error of the truth that exceeds its declared bound: the key of the scenario, and the warning."""

    key: str
    says: str

    def __str__(self) -> str:
        return f"{self.key}: {self.says}"


def undeclared(scenario: Any) -> Iterator[Undeclared]:
    """Every error of a scenario's truth that exceeds its `fdi.bounds`; none without a diagnosis."""
    if scenario.fdi.scheme == "none":
        return
    declared = Declared.of(scenario)
    yield from _unstructured(scenario, declared)
    yield from _air(scenario, declared)
    yield from _sensors(scenario, declared)
    yield from _severity(scenario, declared)
    yield from _moments(scenario, declared)
    yield from _servos(scenario, declared)
    if any(scenario.uncertainty.cg_m):
        says = "a displaced centre of gravity is covered by fdi.bounds.constant_rad_s2 only"
        yield Undeclared("uncertainty.cg_m", says)
    if declared.uses_accelerometers:
        yield from _forces(scenario, declared)


_SECTIONS_READ = "airframe", "fdi", "uncertainty", "actuators", "sensors", "environment", "design_model"
_declares_all: KeptBySections[bool] = KeptBySections(64)


def declares_all(scenario: Any) -> bool:
    """Whether a scenario declares all errors of its truth. The answer is kept: the flights of a sweep share
    most of their sections."""
    sections = tuple(getattr(scenario, name) for name in _SECTIONS_READ)
    return _declares_all.get(sections, lambda: next(undeclared(scenario), None) is None, scenario.substeps)


def _beyond(key: str, off: float, allowed: float, says: str) -> Iterator[Undeclared]:
    """The warning `says`, if an error exceeds its declared bound by more than rounding."""
    if off - allowed > _ROUNDING:
        yield Undeclared(key, says)


def _larger(key: str, bound: str, value: float, allowed: float, unit: str = "") -> Iterator[Undeclared]:
    """A warning, if the size of a value exceeds its bound."""
    return _beyond(key, abs(value), allowed, f"{value:g}{unit} is beyond {bound}, {allowed:g}")


def _ratio(key: str, bound: str, ratio: float, allowed: float, more: str = "") -> Iterator[Undeclared]:
    """A warning, if a ratio of the true to the designer's value differs from 1 by more than its bound."""
    return _beyond(key, abs(ratio - 1.0), allowed, f"{ratio:g} is beyond {bound}, {allowed:g}{more}")


def _moments(scenario: Any, declared: Declared) -> Iterator[Undeclared]:
    """Moment coefficients and inertia, as ratios to the designer's."""
    truth = scenario.uncertainty
    for name, ratio in truth.coefficients.items():
        if name[:2] in MOMENTS:
            key = f"uncertainty.coefficients.{name}"
            allowed = declared.coefficients.of(name)
            yield from _ratio(key, "fdi.bounds.coefficients", ratio, allowed)
    for axis, ratio in truth.inertia:
        yield from _ratio(f"uncertainty.inertia.{axis}", "fdi.bounds.inertia", ratio, declared.inertia)


def _servos(scenario: Any, declared: Declared) -> Iterator[Undeclared]:
    """Actuators, as ratios to the designer's, and their dead bands."""
    for name in declared.aircraft.surfaces:
        key = f"uncertainty.actuators.{name}"
        cover = f"fdi.bounds.actuators.{name}"
        of = (scenario.actuators, declared.servos, scenario.uncertainty.actuators, declared.servo_errors)
        nominal, known, off, bound = (getattr(section, name) for section in of)
        for word, unit in (("bandwidth", "_rad_s"), ("rate_limit", "_deg_s")):
            true = getattr(nominal, word + unit)
            expected = getattr(known, word + unit)
            ratio = getattr(off, word) * true / expected if expected else 1.0 if not true else inf
            yield from _ratio(f"{key}.{word}", f"{cover}.{word}", ratio, getattr(bound, word))
        word = "dead_band_deg"
        allowed = bound.dead_band_deg + degrees(declared.deflection_rad)
        yield from _larger(f"{key}.{word}", f"{cover}.{word}", off.dead_band_deg, allowed, " deg")


def _forces(scenario: Any, declared: Declared) -> Iterator[Undeclared]:
    """Errors of the forces that accelerometers are compared with."""
    truth = scenario.uncertainty
    allowed = declared.coefficients.largest
    by = _BY_ACCELEROMETERS
    for name, ratio in truth.coefficients.items():
        if name[:2] in _FORCES:
            key = f"uncertainty.coefficients.{name}"
            yield from _ratio(key, "fdi.bounds.coefficients", ratio, allowed, by)
    heavier = truth.mass / scenario.design_model.mass
    says = f"{heavier:g} is off the designer's by more than {MASS_TOLERANCE:g}{by}"
    yield from _beyond("uncertainty.mass", abs(heavier - 1.0), MASS_TOLERANCE, says)


def _sensors(scenario: Any, declared: Declared) -> Iterator[Undeclared]:
    """One warning for all instruments, with the first preset that declares their errors."""
    beyond = declared.sensors.exceeded_by(scenario.sensors)
    if beyond:
        preset = next((name for name in PRESETS if _covers(name, scenario.sensors)), None)
        cure = f"`fdi.bounds.sensors: {preset}` declares" if preset else "the same keys there declare"
        key = "sensors"
        whose = f"the errors of {', '.join(beyond)}"
        if len(beyond) == 1:
            key = f"sensors.{beyond[0]}"
            whose = "its errors"
        says = f"{whose} are not within fdi.bounds.sensors, so alarms without a fault may come; {cure} them"
        yield Undeclared(key, says)


def _covers(preset: str, truth: Sensors) -> bool:
    declared = Sensors.model_validate(preset)
    return all(sensor.is_within(getattr(declared, name)) for name, sensor in truth)


def _severity(scenario: Any, declared: Declared) -> Iterator[Undeclared]:
    """Turbulence stronger than the declared one."""
    flown = Dryden(scenario.environment.severity or "none")
    known = declared.air
    if flown.rank > known.rank:
        says = f"{flown.severity} is more than fdi.bounds.turbulence, {known.severity}"
        yield Undeclared("environment.severity", says)


def _unstructured(scenario: Any, declared: Declared) -> Iterator[Undeclared]:
    """Inertia coupling and sinusoidal accelerations."""
    truth = scenario.uncertainty
    statistical = scenario.fdi.statistical
    for axis, coupling, constant in zip(AXES, declared.coupling, declared.constant_rad_s2, strict=True):
        theta = getattr(truth.inertia_coupling, axis)
        sinusoid = getattr(truth.sinusoid, axis)
        key = f"uncertainty.sinusoid.{axis}"
        swing = sinusoid.amplitude_rad_s2
        word = f"inertia_coupling.{axis}"
        yield from _larger(f"uncertainty.{word}", f"fdi.bounds.{word}", theta, coupling)
        yield from _larger(key, f"fdi.bounds.constant_rad_s2.{axis}", swing, constant, " rad/s2")
        if swing > 0 and statistical:
            rad_s = sinusoid.frequency_rad_s
            slowest = statistical.uncertainty_rad_s
            says = f"{rad_s:g} rad/s is faster than fdi.statistical.uncertainty_rad_s, {slowest:g}"
            yield from _beyond(key, rad_s, slowest, says)


def _air(scenario: Any, declared: Declared) -> Iterator[Undeclared]:
    """Gusts, whose moments only a constant bound covers, and vertical wind, which the altimeter's test
    limits."""
    environment = scenario.environment
    key = "environment.gust"
    if any(any(gust.velocity_mps) for gust in environment.gusts):
        yield Undeclared(key, "what a gust does is covered by fdi.bounds.constant_rad_s2 only")
        if declared.follows_gusts_by_forces:
            yield Undeclared(key, _SHARP_GUST)
    if declared.monitors_sensors:
        steady = environment.wind_mps[2]
        largest = max(abs(steady + of) for of in (0.0, *(gust.velocity_mps[2] for gust in environment.gusts)))
        allowed = declared.vertical_wind_mps
        says = f"vertical wind of {largest:g} m/s is more than fdi.bounds.vertical_wind_mps, {allowed:g}"
        yield from _beyond("environment", largest, allowed, f"{says}: {_SEEMS_BROKEN}")
