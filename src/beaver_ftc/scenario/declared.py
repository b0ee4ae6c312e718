"""The declared half of a scenario, which parts of the diagnosis use it, and which errors of the truth it does
not cover.

Diagnosis, laws, warnings, studies and products ask `Declared`; none reads `fdi.bounds` for itself. Errors
that are not declared are facts, of which warnings are views: these judge, and see both halves.

Warnings say what a scenario may do although it is unwise, and where the design model's error was measured:
they never refuse it. Elsewhere the diagnosis concludes nothing. Quantities are those of the map in the
aircraft's file (`model_error_map`). The density of the air is given as the altitude at which the standard
atmosphere has it. `validate`, the verdict, the metrics and the page on a derived aircraft all print these
warnings.

scenario: a `schema.Scenario`, not named as such because the schema imports this.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import degrees, inf, pi, radians
from typing import Any, NamedTuple, Self

import numpy as np

from beaver_ftc.aircraft import AXES, Aircraft, Term
from beaver_ftc.aircraft.aircraft import MOMENTS
from beaver_ftc.design import Dryden, altitude_of
from beaver_ftc.scenario.airframe import Actuators, Initial
from beaver_ftc.scenario.builtin import KeptBySections
from beaver_ftc.scenario.diagnosis import ActuatorBounds, ControlConfig, FdiConfig, failing, of_several
from beaver_ftc.scenario.faults import LOSS_OF_EFFECTIVENESS, UNANTICIPATED, of_a_sensor, place_of
from beaver_ftc.scenario.sensors import NOISE_LIMIT_SIGMA, PRESETS, SIGNALS, Sensors, sensor_words
from beaver_ftc.scenario.signals import Autopilot, Chirp

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


_MOST = 64
_sensor_errors: KeptBySections[SensorErrors] = KeptBySections(_MOST)


def _errors_of(sensors: Sensors) -> SensorErrors:
    """Those of a section. A flight asks several times, and flights of a sweep share what does not vary."""
    return _sensor_errors.get((sensors,), lambda: SensorErrors(sensors))


@dataclass(frozen=True)
class Declared:
    """The declared half of a scenario: all that diagnosis, laws, supervisor and autopilots are configured
    from. The other half is the truth, of which they receive readings.

    initial: what a pilot reads at the start. servos, instruments: the actuators and sensors as the designer
    knows them. name: of the scenario, for messages.
    """

    name: str
    aircraft: Aircraft
    rate_hz: float
    substeps: int
    initial: Initial
    autopilot: Autopilot | None
    fdi: FdiConfig
    control: ControlConfig
    design_model: Any  # a `schema.DesignModel`
    servos: Actuators
    instruments: Sensors

    @classmethod
    def of(cls, scenario: Any) -> Self:
        """That of a `schema.Scenario`."""
        return cls(
            scenario.name,
            scenario.airframe,
            scenario.rate_hz,
            scenario.substeps,
            scenario.initial,
            scenario.autopilot,
            scenario.fdi,
            scenario.control,
            scenario.design_model,
            scenario.known_actuators,
            scenario.known_sensors,
        )

    @property
    def travel_rad(self) -> np.ndarray:
        """Lower and upper stop of each surface, (2, surfaces) rad, as the designer knows them."""
        of_file = self.aircraft.file.surfaces
        stops = (
            of_file[surface].travel_rad if servo.travel_deg is None else map(radians, servo.travel_deg)
            for surface, servo in ((name, getattr(self.servos, name)) for name in self.aircraft.surfaces)
        )
        return np.array([tuple(each) for each in stops]).T.copy()

    @property
    def air(self) -> Dryden:
        """The strongest turbulence."""
        return Dryden(self.fdi.bounds.turbulence)

    @property
    def sensors(self) -> SensorErrors:
        """The largest errors of the instruments."""
        return _errors_of(self.fdi.bounds.sensors)

    @property
    def coefficients(self) -> CoefficientErrors:
        """Tolerance of the moment coefficients."""
        return CoefficientErrors(self.fdi.bounds.coefficients)

    @property
    def servo_errors(self) -> ActuatorBounds:
        """The largest errors of the actuators."""
        return self.fdi.bounds.actuators

    @property
    def deflection_rad(self) -> float:
        """How far a surface may be from its actuator, whatever that is declared to do."""
        return radians(self.fdi.bounds.deflection_deg)

    @property
    def deflections_rad(self) -> np.ndarray:
        """How far each surface may be from its actuator's model at rest, (surfaces,) rad."""
        bands = [getattr(self.servo_errors, name).dead_band_deg for name in self.aircraft.surfaces]
        return self.deflection_rad + np.radians(bands)

    @property
    def inertia(self) -> float:
        """Tolerance of each moment of inertia, as a share."""
        return self.fdi.bounds.inertia

    @property
    def coupling(self) -> PerAxis:
        """Largest relative errors of Pqr, Qpr, Rpq, as published."""
        return self.fdi.bounds.inertia_coupling.as_tuple()

    @property
    def constant_rad_s2(self) -> PerAxis:
        """Largest unstructured angular acceleration by axis, as published."""
        return self.fdi.bounds.constant_rad_s2.as_tuple()

    @property
    def vertical_wind_mps(self) -> float:
        """The strongest steady vertical wind."""
        return self.fdi.bounds.vertical_wind_mps

    @property
    def uses_statistics(self) -> bool:
        """Whether the statistical detector runs."""
        return self.fdi.weighs_chance

    @property
    def compares_across(self) -> bool:
        """Whether motion across a surface's column excludes it."""
        return self.fdi.compares_across(self.substeps)

    @property
    def monitors_sensors(self) -> bool:
        """Whether the sensor monitor runs."""
        return self.fdi.monitors_sensors

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
_BY_ACCELEROMETERS = ", by which accelerometers are judged"
_SHARP_GUST = (
    "JSBSim's does not rotate, but with fdi.bounds.turbulence the vanes take a sharp one for one that does: "
    "fdi.statistical may raise an alarm"
)
_SEEMS_BROKEN = "the sensor monitor may take a sound altimeter for broken"


class Undeclared(NamedTuple):
    """An error of the truth beyond what is declared: a key of the scenario, and what is to be said of it."""

    key: str
    says: str

    def __str__(self) -> str:
        return f"{self.key}: {self.says}"


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
    yield from _moments(scenario, declared)
    yield from _servos(scenario, declared)
    if any(scenario.uncertainty.cg_m):
        says = "a displaced centre of gravity is covered by fdi.bounds.constant_rad_s2 only"
        yield Undeclared("uncertainty.cg_m", says)
    if declared.uses_accelerometers:
        yield from _forces(scenario, declared)


_UNDECLARED_DEPENDS_ON = (
    *("airframe", "fdi", "uncertainty", "actuators", "sensors", "environment", "design_model"),
)
_declares_all: KeptBySections[bool] = KeptBySections(_MOST)


def declares_all(scenario: Any) -> bool:
    """Whether nothing of a scenario is undeclared. It is asked of each flight, and found once for the flights
    of a sweep that share what it depends on."""
    sections = tuple(getattr(scenario, name) for name in _UNDECLARED_DEPENDS_ON)
    return _declares_all.get(sections, lambda: next(undeclared(scenario), None) is None, scenario.substeps)


def _beyond(key: str, off: float, allowed: float, says: str) -> Iterator[Undeclared]:
    """An error that is off by more than is declared, and more than rounding."""
    if off - allowed > _ROUNDING:
        yield Undeclared(key, says)


def _larger(key: str, bound: str, value: float, allowed: float, unit: str = "") -> Iterator[Undeclared]:
    """A value that is larger than a bound allows."""
    return _beyond(key, abs(value), allowed, f"{value:g}{unit} is beyond {bound}, {allowed:g}")


def _ratio(key: str, bound: str, ratio: float, allowed: float, more: str = "") -> Iterator[Undeclared]:
    """A ratio to the designer's that is further from 1 than a bound allows."""
    return _beyond(key, abs(ratio - 1.0), allowed, f"{ratio:g} is beyond {bound}, {allowed:g}{more}")


def _moments(scenario: Any, declared: Declared) -> Iterator[Undeclared]:
    """Moment coefficients and inertia, as ratios to the designer's."""
    truth = scenario.uncertainty
    for name, ratio in truth.coefficients.items():
        if name[:2] in MOMENTS:
            key, allowed = f"uncertainty.coefficients.{name}", declared.coefficients.of(name)
            yield from _ratio(key, "fdi.bounds.coefficients", ratio, allowed)
    for axis, ratio in truth.inertia:
        yield from _ratio(f"uncertainty.inertia.{axis}", "fdi.bounds.inertia", ratio, declared.inertia)


def _servos(scenario: Any, declared: Declared) -> Iterator[Undeclared]:
    """Actuators, as ratios to the designer's, and their dead bands."""
    for name in declared.aircraft.surfaces:
        key, cover = f"uncertainty.actuators.{name}", f"fdi.bounds.actuators.{name}"
        of = (scenario.actuators, declared.servos, scenario.uncertainty.actuators, declared.servo_errors)
        nominal, known, off, bound = (getattr(section, name) for section in of)
        for word, unit in (("bandwidth", "_rad_s"), ("rate_limit", "_deg_s")):
            true, expected = getattr(nominal, word + unit), getattr(known, word + unit)
            ratio = getattr(off, word) * true / expected if expected else 1.0 if not true else inf
            yield from _ratio(f"{key}.{word}", f"{cover}.{word}", ratio, getattr(bound, word))
        word, allowed = "dead_band_deg", bound.dead_band_deg + degrees(declared.deflection_rad)
        yield from _larger(f"{key}.{word}", f"{cover}.{word}", off.dead_band_deg, allowed, " deg")


def _forces(scenario: Any, declared: Declared) -> Iterator[Undeclared]:
    """Errors of the forces that accelerometers are compared with."""
    truth, allowed, by = scenario.uncertainty, declared.coefficients.largest, _BY_ACCELEROMETERS
    for name, ratio in truth.coefficients.items():
        if name[:2] in _FORCES:
            key = f"uncertainty.coefficients.{name}"
            yield from _ratio(key, "fdi.bounds.coefficients", ratio, allowed, by)
    heavier = truth.mass / scenario.design_model.mass
    says = f"{heavier:g} is off the designer's by more than {MASS_TOLERANCE:g}{by}"
    yield from _beyond("uncertainty.mass", abs(heavier - 1.0), MASS_TOLERANCE, says)


def _sensors(scenario: Any, declared: Declared) -> Iterator[Undeclared]:
    """One fact for all instruments, and what would declare them."""
    beyond = declared.sensors.exceeded_by(scenario.sensors)
    if beyond:
        enough = (name for name in PRESETS if _covers(name, scenario.sensors))
        preset = next(enough, None)
        cure = (
            f"`fdi.bounds.sensors: {preset}` declares them" if preset else "the same keys there declare them"
        )
        alone = len(beyond) == 1
        key, whose = (
            (f"sensors.{beyond[0]}", "its errors")
            if alone
            else ("sensors", f"the errors of {', '.join(beyond)}")
        )
        says = f"{whose} are not within fdi.bounds.sensors, so alarms without a fault may come; {cure}"
        yield Undeclared(key, says)


def _covers(preset: str, truth: Sensors) -> bool:
    declared = Sensors.model_validate(preset)
    return all(sensor.is_within(getattr(declared, name)) for name, sensor in truth)


def _severity(scenario: Any, declared: Declared) -> Iterator[Undeclared]:
    """Turbulence stronger than the declared one."""
    flown, known = Dryden(scenario.environment.severity or "none"), declared.air
    if flown.rank > known.rank:
        says = f"{flown.severity} is more than fdi.bounds.turbulence, {known.severity}"
        yield Undeclared("environment.severity", says)


def _unstructured(scenario: Any, declared: Declared) -> Iterator[Undeclared]:
    """Inertia coupling and sinusoids beyond what is admitted of them."""
    truth, statistical = scenario.uncertainty, scenario.fdi.statistical
    for axis, coupling, constant in zip(AXES, declared.coupling, declared.constant_rad_s2, strict=True):
        theta, sinusoid = getattr(truth.inertia_coupling, axis), getattr(truth.sinusoid, axis)
        key, swing = f"uncertainty.sinusoid.{axis}", sinusoid.amplitude_rad_s2
        word = f"inertia_coupling.{axis}"
        yield from _larger(f"uncertainty.{word}", f"fdi.bounds.{word}", theta, coupling)
        yield from _larger(key, f"fdi.bounds.constant_rad_s2.{axis}", swing, constant, " rad/s2")
        if swing > 0 and statistical:
            rad_s, slowest = sinusoid.frequency_rad_s, statistical.uncertainty_rad_s
            says = f"{rad_s:g} rad/s is faster than fdi.statistical.uncertainty_rad_s, {slowest:g}"
            yield from _beyond(key, rad_s, slowest, says)


def _air(scenario: Any, declared: Declared) -> Iterator[Undeclared]:
    """Gusts, which rotate nothing, and vertical wind by which a sound altimeter seems broken."""
    environment, key = scenario.environment, "environment.gust"
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


Span = tuple[float, float]
ALTITUDE = "altitude_m"
LATE, BETWEEN = "flown_s", "between"
_FLOW = ("p_rad_s", "q_rad_s", "r_rad_s", "alpha_rad", "beta_rad", "airspeed_mps", ALTITUDE)
_PLURAL = {
    "p_rad_s": "roll rates", "q_rad_s": "pitch rates", "r_rad_s": "yaw rates",
    "alpha_rad": "angles of attack", "beta_rad": "sideslip angles", "airspeed_mps": "airspeeds",
    ALTITUDE: "altitudes", LATE: "ages of the flight",
}  # fmt: skip
_UNITS = {"rad_s": "deg/s", "rad": "deg", "mps": "m/s", "m": "m"}


def quantities(aircraft: Aircraft) -> tuple[str, ...]:
    """The quantities that a box of the map has ends of, in its order; density as altitude."""
    return (*_FLOW, *aircraft.signals)


def measured_spans(aircraft: Aircraft) -> dict[str, Span]:
    """Of each quantity, and of the age of a flight, what the boxes together span; nothing without a map."""
    error_map = aircraft.file.model_error_map
    if error_map is None:
        return {}
    ends = [box.ends(aircraft.signals) for box in error_map.boxes]
    spans = {
        name: (min(low for low, _ in of), max(high for _, high in of))
        for name, of in zip(quantities(aircraft), zip(*ends, strict=True), strict=True)
    }
    return spans | {ALTITUDE: as_altitudes(spans[ALTITUDE]), LATE: (0.0, max(error_map.until_s))}


def as_altitudes(density_kg_m3: Span) -> Span:
    """The altitudes between which the standard air has densities in a span, m."""
    thin, thick = density_kg_m3
    return altitude_of(thick), altitude_of(thin)


def outside(quantity: str, measured: Span | None) -> str:
    """Why nothing can be concluded, where one quantity is outside of what was measured."""
    if quantity == BETWEEN or measured is None:
        return "in a combination of speeds, angles and rates at which this model was not measured"
    low, high = measured
    if quantity == LATE:
        return f"later than this model was measured: after {high:,.0f} s of flight"
    span = span_in_words(quantity, (low, high))
    return f"outside the {plural(quantity)} at which this model was measured: {span}"


def plural(quantity: str) -> str:
    """A quantity of the map, in the plural."""
    return _PLURAL.get(quantity, f"values of {quantity}")


def span_in_words(quantity: str, span: Span) -> str:
    """Two ends and their unit."""
    if quantity == LATE:
        return f"{span[0]:,.0f} to {span[1]:,.0f} s"
    stem = quantity.partition("_")[2] if quantity in _PLURAL else ""
    low, high = (_short(quantity, value) for value in span)
    values = low if low == high else f"{low} to {high}"
    return f"{values} {_UNITS.get(stem, '')}".rstrip()


def _short(quantity: str, value: float) -> str:
    if quantity == ALTITUDE:
        return f"{round(value, -1) + 0.0:,.0f}"
    return f"{degrees(value):.3g}" if "rad" in quantity and quantity in _PLURAL else f"{value:.4g}"


def lies_outside(place: Mapping[str, float], spans: Mapping[str, Span]) -> list[str]:
    """Which quantities of a place are outside of what was measured."""
    ends = {name: spans.get(name, (-inf, inf)) for name in place}
    return [name for name, value in place.items() if not ends[name][0] <= value <= ends[name][1]]


def in_words(inconclusive: Mapping[str, Any]) -> str:
    """Where, why and in what share of the frames the diagnosis could conclude nothing: a sentence without a
    full stop. inconclusive: as `metrics.json` has it."""
    said = []
    for reason in inconclusive["reasons"]:
        flown = reason["flown"] and span_in_words(reason["quantity"], reason["flown"])
        of = "" if reason["share"] == inconclusive["share"] else f" ({percent(reason['share'])})"
        said.append(reason["says"] + (f", flown {flown}" if flown else "") + of)
    since = f" from {inconclusive['from_s']:.2f} s on" if inconclusive["from_s"] > 0.0 else ""
    share = percent(inconclusive["share"])
    return f"nothing can be concluded in {share} of the frames{since}: {'; '.join(said)}"


def percent(share: float) -> str:
    """A share of frames: 100 % is all of them, 0 % none."""
    if 0.0 < share < 0.01 or 0.99 < share < 1.0:
        return f"{100.0 * share:.2g} %" if share < 0.5 else "more than 99 %"
    return f"{100.0 * share:.0f} %"


OF_DIAGNOSIS = ("detected_within_s", "isolated_as", "isolated_within_s", "isolated_type", "candidate_type")
FULL_SHARE = 0.02  # of the range of the power: within it a setting is full power


def warnings_of(scenario: Any) -> tuple[str, ...]:
    """One line a warning, `key.path: what`."""
    return (
        *_airspeed(scenario),
        *_power(scenario),
        *_too_fast_for_the_frame(scenario),
        *map(str, undeclared(scenario)),
        *_inconclusive(scenario),
        *_in_sequence(scenario),
        *_outside_class(scenario),
        *_former(scenario),
    )


def outside_class(scenario: Any) -> tuple[str, ...]:
    """The faults of surfaces and sensors that the declared class does not have, `elevator stuck at 12 s`."""
    return tuple(
        f"{_place_in_words(fault)} {fault.type.replace('_', ' ')} at {fault.at_s:g} s"
        for fault in scenario.faults
        if scenario.fdi.diagnoses and not _is_in_class(fault, scenario.fdi, scenario.airframe)
    )


def _place_in_words(fault: Any) -> str:
    return sensor_words(fault.sensor) if of_a_sensor(fault) else place_of(fault)


def _is_in_class(fault: Any, fdi: FdiConfig, aircraft: Aircraft) -> bool:
    """Whether the class has a fault; what is on no surface is meant to be outside of every class."""
    if of_a_sensor(fault):
        return fdi.monitors_sensors
    surface = getattr(fault, "actuator", None)
    if surface is None or fdi.fault_class == "all":
        return True
    return fault.type == LOSS_OF_EFFECTIVENESS and surface in aircraft.class_of_losses


def _outside_class(scenario: Any) -> Iterator[str]:
    """Faults that cannot be named, but where that is what is expected."""
    outside = outside_class(scenario)
    if outside and not _expects_unanticipated(scenario):
        cure = wider(scenario.fdi.fault_class)
        yield f"faults: {' and '.join(outside)}: outside the declared class; {cure}"


def wider(fault_class: str) -> str:
    """What to set, so that a fault outside a class belongs to the declared one."""
    return f"set fdi.{'sensor_monitor: always' if fault_class == 'all' else 'fault_class: all'}"


def _former(scenario: Any) -> Iterator[str]:
    if scenario.fdi.sensor_monitor == "auto":
        yield "fdi.sensor_monitor: auto is a former value and means the same as no value, by fdi.fault_class"


def _expects_unanticipated(scenario: Any) -> bool:
    expected = scenario.expect.isolated_as or ()
    return UNANTICIPATED in ((expected,) if isinstance(expected, str) else expected)


def _in_sequence(scenario: Any) -> Iterator[str]:
    """Surfaces that fail one after the other, of which the diagnosis names the first and takes it back; not
    where that is what is expected."""
    in_turn = len(set(failing(scenario).values())) > 1
    looks_for_one = scenario.fdi.is_ours and not scenario.fdi.pairs
    unforeseen = looks_for_one and in_turn and not _expects_unanticipated(scenario)
    if unforeseen and (says := of_several(scenario)):
        yield f"faults: {says.removeprefix('faults ')}"


def _inconclusive(scenario: Any) -> Iterator[str]:
    """Where the diagnosis can conclude nothing, as far as it is known before the flight."""
    if scenario.fdi.scheme == "none":
        for key in OF_DIAGNOSIS:
            if getattr(scenario.expect, key) is not None:
                yield f"expect.{key}: cannot be met, fdi.scheme is none: no diagnosis runs"
        return
    spans = measured_spans(scenario.airframe) if scenario.fdi.diagnoses else {}
    for key, quantity, value in _planned(scenario):
        if lies_outside({quantity: value}, spans):
            why = outside(quantity, spans[quantity])
            yield f"{key}: {value:g}: nothing can be detected or named {why}"


def _planned(scenario: Any) -> Iterator[tuple[str, str, float]]:
    """Key, quantity of the map and value of what a scenario says of where, and how long, it is flown."""
    yield "initial.altitude_m", ALTITUDE, scenario.initial.altitude_m
    yield "initial.airspeed_mps", "airspeed_mps", scenario.initial.airspeed_mps
    for i, leg in enumerate(scenario.autopilot.altitude_m if scenario.autopilot else ()):
        if leg.value is not None:
            yield f"autopilot.altitude_m[{i}].value", ALTITUDE, leg.value
    for i, leg in enumerate(scenario.autopilot.airspeed_mps if scenario.autopilot else ()):
        if leg.value is not None:
            yield f"autopilot.airspeed_mps[{i}].value", "airspeed_mps", leg.value
    yield "duration_s", LATE, scenario.duration_s


def _airspeed(scenario: Any) -> Iterator[str]:
    lowest, highest = scenario.airframe.envelope.airspeed_mps
    airspeed_mps = scenario.initial.airspeed_mps
    if not lowest <= airspeed_mps <= highest:
        yield (
            f"initial.airspeed_mps: {airspeed_mps:g} is outside the range the aerodynamic model "
            f"was identified in, {lowest:g} to {highest:g} m/s"
        )


def _power(scenario: Any) -> Iterator[str]:
    """An altitude is wanted of an aircraft that takes all its power to fly level where its flights start."""
    aircraft, profile = scenario.airframe, scenario.autopilot
    if not profile or not profile.altitude_m or aircraft.engine.thrust is None:
        return
    setting = aircraft.engine.settings[aircraft.power_setting]
    if setting.default > setting.range[1] - FULL_SHARE * (setting.range[1] - setting.range[0]):
        yield (
            f"autopilot.altitude_m: {aircraft.name} takes all the power it has at "
            f"{aircraft.usual_airspeed_mps:g} m/s and {aircraft.file.start.altitude_m or 0.0:g} m: it sinks "
            "where that is not enough, and keeps its airspeed"
        )


def _too_fast_for_the_frame(scenario: Any) -> Iterator[str]:
    nyquist_hz = scenario.rate_hz / 2
    for path, frequency_hz in _frequencies_hz(scenario):
        if frequency_hz > nyquist_hz:
            yield f"{path}: {frequency_hz:g} Hz is over the Nyquist frequency of rate_hz, {nyquist_hz:g} Hz"


def _frequencies_hz(scenario: Any) -> Iterator[tuple[str, float]]:
    for axis in AXES:
        for i, signal in enumerate(getattr(scenario.reference, axis)):
            shape = signal.shape
            if isinstance(shape, Chirp):
                yield f"reference.{axis}[{i}]", max(shape.start_frequency_hz, shape.end_frequency_hz)
            elif hasattr(shape, "frequency_hz"):
                yield f"reference.{axis}[{i}]", shape.frequency_hz
        sinusoid = getattr(scenario.uncertainty.sinusoid, axis)
        if sinusoid.amplitude_rad_s2 > 0:
            yield f"uncertainty.sinusoid.{axis}", sinusoid.frequency_rad_s / (2 * pi)
    for i, fault in enumerate(scenario.faults):
        if hasattr(fault, "frequency_rad_s"):
            yield f"faults[{i}].frequency_rad_s", fault.frequency_rad_s / (2 * pi)
