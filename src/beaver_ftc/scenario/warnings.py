"""What a scenario may do although it is unwise: said, never refused.

scenario: a `schema.Scenario`, not named as such because the schema imports this.
"""

from collections.abc import Iterator
from math import pi
from typing import Any

from beaver_ftc.aircraft import AXES
from beaver_ftc.scenario.faults import UNANTICIPATED
from beaver_ftc.scenario.measured import ALTITUDE, LATE, lies_outside, measured_spans, outside
from beaver_ftc.scenario.pairs import failing, of_several
from beaver_ftc.scenario.signals import Chirp
from beaver_ftc.scenario.undeclared import undeclared

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
