"""Warnings: what a scenario may do although it is unwise. A warning never refuses a scenario.

`validate`, the verdict, the metrics and the page on a derived aircraft print them.

scenario: a `schema.Scenario`, not named as such because the schema imports this.
"""

from collections.abc import Iterator
from math import pi
from typing import Any

from beaver_ftc.aircraft import AXES, Aircraft
from beaver_ftc.scenario.diagnosis import FdiConfig
from beaver_ftc.scenario.expect import OF_DIAGNOSIS
from beaver_ftc.scenario.faults import LOSS_OF_EFFECTIVENESS, UNANTICIPATED, of_a_sensor, place_of
from beaver_ftc.scenario.measured_range import ALTITUDE, LATE, lies_outside, measured_spans, outside
from beaver_ftc.scenario.pairs import failing, of_several
from beaver_ftc.scenario.sensors import sensor_words
from beaver_ftc.scenario.signals import Chirp
from beaver_ftc.scenario.undeclared import undeclared

FULL_SHARE = 0.02  # of the range of a power setting: so close to its upper end it is full power


def warnings_of(scenario: Any) -> tuple[str, ...]:
    """All warnings, one line each: `key.path: warning`."""
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
    """The faults of surfaces and sensors outside the declared class, such as `elevator stuck at 12 s`."""
    return tuple(
        f"{_place_in_words(fault)} {fault.type.replace('_', ' ')} at {fault.at_s:g} s"
        for fault in scenario.faults
        if scenario.fdi.diagnoses and not _is_in_class(fault, scenario.fdi, scenario.airframe)
    )


def _place_in_words(fault: Any) -> str:
    return sensor_words(fault.sensor) if of_a_sensor(fault) else place_of(fault)


def _is_in_class(fault: Any, fdi: FdiConfig, aircraft: Aircraft) -> bool:
    """Whether the class contains a fault. Damage and an unanticipated fault, which are on no surface, count
    as contained: they are outside of every class on purpose."""
    if of_a_sensor(fault):
        return fdi.monitors_sensors
    surface = getattr(fault, "actuator", None)
    if surface is None or fdi.fault_class == "all":
        return True
    return fault.type == LOSS_OF_EFFECTIVENESS and surface in aircraft.class_of_losses


def _outside_class(scenario: Any) -> Iterator[str]:
    """Faults that the diagnosis cannot name, unless the scenario expects `unanticipated`."""
    outside = outside_class(scenario)
    if outside and not _expects_unanticipated(scenario):
        cure = wider(scenario.fdi.fault_class)
        yield f"faults: {' and '.join(outside)}: outside the declared class; {cure}"


def wider(fault_class: str) -> str:
    """The key to set so that the declared class contains more faults."""
    return f"set fdi.{'sensor_monitor: always' if fault_class == 'all' else 'fault_class: all'}"


def _former(scenario: Any) -> Iterator[str]:
    if scenario.fdi.sensor_monitor == "auto":
        yield "fdi.sensor_monitor: auto is a former value and means the same as no value, by fdi.fault_class"


def _expects_unanticipated(scenario: Any) -> bool:
    expected = scenario.expect.isolated_as or ()
    return UNANTICIPATED in ((expected,) if isinstance(expected, str) else expected)


def _in_sequence(scenario: Any) -> Iterator[str]:
    """Surfaces that fail one after another: the diagnosis names the first and withdraws the name. No warning,
    if the scenario expects `unanticipated`."""
    in_turn = len(set(failing(scenario).values())) > 1
    looks_for_one = scenario.fdi.is_ours and not scenario.fdi.pairs
    unforeseen = looks_for_one and in_turn and not _expects_unanticipated(scenario)
    if unforeseen and (says := of_several(scenario)):
        yield f"faults: {says.removeprefix('faults ')}"


def _inconclusive(scenario: Any) -> Iterator[str]:
    """Expectations that no diagnosis can meet, and planned states outside the measured spans."""
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
    """Key, quantity of the map and value of each altitude, airspeed and duration that a scenario plans."""
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
    """An altitude is commanded, but the aircraft needs all its power for level flight where flights start."""
    aircraft = scenario.airframe
    profile = scenario.autopilot
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
