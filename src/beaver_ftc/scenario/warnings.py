"""What a scenario may do although it is unwise: said, never refused.

scenario: a `schema.Scenario`, not named as such because the schema imports this.
"""

from collections.abc import Iterator
from math import pi
from typing import Any

from beaver_ftc.scenario.faults import UNANTICIPATED, of_a_sensor
from beaver_ftc.scenario.measured import ALTITUDE, LATE, lies_outside, measured_spans, outside
from beaver_ftc.scenario.pairs import failing, of_several
from beaver_ftc.scenario.sensors import PRESETS, Sensors
from beaver_ftc.scenario.signals import Chirp

_SEVERITIES = ("none", "light", "moderate", "severe")
_MOMENTS, _FORCES = ("Cl", "Cm", "Cn"), ("CY", "CZ")
MASS_TOLERANCE = 0.05  # that accelerometers are judged with: fuel and load, which nobody declares
OF_DIAGNOSIS = ("detected_within_s", "isolated_as", "isolated_within_s", "isolated_type", "candidate_type")
_ROUNDING = 1e-9
FULL_SHARE = 0.02  # of the range of the power: within it a setting is full power


def warnings_of(scenario: Any) -> tuple[str, ...]:
    """One line a warning, `key.path: what`."""
    return (
        *_airspeed(scenario),
        *_power(scenario),
        *_too_fast_for_the_frame(scenario),
        *undeclared(scenario),
        *_inconclusive(scenario),
        *_in_sequence(scenario),
    )


def _in_sequence(scenario: Any) -> Iterator[str]:
    """Surfaces that fail one after the other, of which the diagnosis names the first and takes it back; not
    where that is what is expected."""
    expected = scenario.expect.isolated_as or ()
    in_turn = len(set(failing(scenario).values())) > 1
    told = UNANTICIPATED in ((expected,) if isinstance(expected, str) else expected)
    looks_for_one = scenario.fdi.is_ours and not scenario.fdi.pairs
    if looks_for_one and in_turn and not told and (says := of_several(scenario)):
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


def undeclared(scenario: Any) -> Iterator[str]:
    """Errors of the truth that `fdi.bounds` does not cover: an alarm may then have no fault behind it."""
    if scenario.fdi.scheme == "none":
        return
    bounds, truth = scenario.fdi.bounds, scenario.uncertainty
    yield from _unstructured(scenario)
    yield from _air(scenario)
    yield from _instruments(scenario)
    severity, declared = scenario.environment.severity, bounds.turbulence
    if _SEVERITIES.index(severity or "none") > _SEVERITIES.index(declared):
        yield f"environment.severity: {severity} is more than fdi.bounds.turbulence, {declared}"
    share = bounds.coefficients
    for name, ratio in truth.coefficients.items():
        if name[:2] in _MOMENTS:
            allowed = share.get(name, 0.0) if isinstance(share, dict) else share
            yield from _beyond(f"coefficients.{name}", f"{ratio:g}", ratio - 1.0, "coefficients", allowed)
    for axis, ratio in truth.inertia:
        yield from _beyond(f"inertia.{axis}", f"{ratio:g}", ratio - 1.0, "inertia", bounds.inertia)
    if any(truth.cg_m):
        yield "uncertainty.cg_m: a displaced centre of gravity is covered by fdi.bounds.constant_rad_s2 only"
    if _weighs_forces(scenario):
        yield from _forces(scenario)


def _beyond(key: str, value: str, error: float, bound: str, allowed: float) -> Iterator[str]:
    """An error of the truth larger than `fdi.bounds` allows; value: what the scenario says of it."""
    if abs(error) > allowed + _ROUNDING:
        yield f"uncertainty.{key}: {value} is beyond fdi.bounds.{bound}, {allowed:g}"


def _instruments(scenario: Any) -> Iterator[str]:
    """One line for all instruments, and what would declare them."""
    beyond = _not_within(scenario.sensors, scenario.fdi.bounds.sensors)
    if not beyond:
        return
    enough = (name for name in PRESETS if not _not_within(scenario.sensors, Sensors.model_validate(name)))
    preset = next(enough, None)
    cure = f"`fdi.bounds.sensors: {preset}` declares them" if preset else "the same keys there declare them"
    many = f": the errors of {', '.join(beyond)}"
    whose = f".{beyond[0]}: its errors" if len(beyond) == 1 else many
    yield f"sensors{whose} are not within fdi.bounds.sensors, so alarms without a fault may come; {cure}"


def _not_within(sensors: Sensors, declared: Sensors) -> list[str]:
    return [name for name, sensor in sensors if not sensor.is_within(getattr(declared, name))]


def _weighs_forces(scenario: Any) -> bool:
    """Whether accelerometers take part in the diagnosis."""
    counts = scenario.fdi.weighs_chance and scenario.fdi.looks_across
    return bool(counts and scenario.substeps == 1 and scenario.airframe.forces)


def _forces(scenario: Any) -> Iterator[str]:
    """Errors of the forces that the accelerometers are held against."""
    share, truth = scenario.fdi.bounds.coefficients, scenario.uncertainty
    allowed = max(share.values(), default=0.0) if isinstance(share, dict) else share
    why = "by which accelerometers are judged"
    for name, ratio in truth.coefficients.items():
        if name[:2] in _FORCES:
            beyond = _beyond(f"coefficients.{name}", f"{ratio:g}", ratio - 1.0, "coefficients", allowed)
            yield from (f"{says}, {why}" for says in beyond)
    heavier = truth.mass / scenario.design_model.mass
    if abs(heavier - 1.0) > MASS_TOLERANCE + _ROUNDING:
        yield f"uncertainty.mass: {heavier:g} is off the designer's by more than {MASS_TOLERANCE:g}, {why}"


def _unstructured(scenario: Any) -> Iterator[str]:
    """Inertia coupling and sinusoids beyond what is admitted of them."""
    bounds, truth, statistical = scenario.fdi.bounds, scenario.uncertainty, scenario.fdi.statistical
    for axis in ("p", "q", "r"):
        theta, admitted = getattr(truth.inertia_coupling, axis), getattr(bounds.inertia_coupling, axis)
        key = f"inertia_coupling.{axis}"
        yield from _beyond(key, f"{theta:g}", theta, key, admitted)
        sinusoid, constant = getattr(truth.sinusoid, axis), getattr(bounds.constant_rad_s2, axis)
        key, swing, rad_s = f"sinusoid.{axis}", sinusoid.amplitude_rad_s2, sinusoid.frequency_rad_s
        yield from _beyond(key, f"{swing:g} rad/s2", swing, f"constant_rad_s2.{axis}", constant)
        if swing > 0 and statistical and rad_s > statistical.uncertainty_rad_s + _ROUNDING:
            slower = f"fdi.statistical.uncertainty_rad_s, {statistical.uncertainty_rad_s:g}"
            yield f"uncertainty.{key}: {rad_s:g} rad/s is faster than {slower}"


def _air(scenario: Any) -> Iterator[str]:
    """Air whose rotation no bound covers."""
    environment = scenario.environment
    if any(any(gust.velocity_mps) for gust in environment.gusts):
        yield "environment.gust: what a gust does is covered by fdi.bounds.constant_rad_s2 only"
        fdi = scenario.fdi
        if fdi.weighs_chance and fdi.bounds.turbulence != "none" and scenario.airframe.measurable_forces:
            yield (
                "environment.gust: JSBSim's does not rotate, but with fdi.bounds.turbulence the vanes take a "
                "sharp one for one that does: fdi.statistical may raise an alarm"
            )
    yield from _vertical_wind(scenario)


def _vertical_wind(scenario: Any) -> Iterator[str]:
    """Vertical wind by which a sound altimeter seems broken, where the instruments are watched."""
    environment, fdi = scenario.environment, scenario.fdi
    broken = any(of_a_sensor(fault) for fault in scenario.faults)
    watched = fdi.sensor_monitor == "always" or (fdi.sensor_monitor == "auto" and broken)
    if not (watched and fdi.is_ours):
        return
    steady, declared = environment.wind_mps[2], fdi.bounds.vertical_wind_mps
    largest = max((steady, *(steady + gust.velocity_mps[2] for gust in environment.gusts)), key=abs)
    if abs(largest) > declared + _ROUNDING:
        yield (
            f"environment: vertical wind of {abs(largest):g} m/s is more than fdi.bounds.vertical_wind_mps, "
            f"{declared:g}: the sensor monitor may take a sound altimeter for broken"
        )


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
    for axis in ("p", "q", "r"):
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
