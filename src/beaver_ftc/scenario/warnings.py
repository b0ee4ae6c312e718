"""What a scenario may do although it is unwise, and where the design model's error was measured: said, never
refused.

Elsewhere the diagnosis concludes nothing. Quantities are those of the map in the aircraft's file
(`model_error_map`). The density of the air is given as the altitude at which the standard atmosphere has
it. What is said here, `validate`, the verdict, the metrics and the page on a derived aircraft all say.

scenario: a `schema.Scenario`, not named as such because the schema imports this.
"""

from collections.abc import Iterator, Mapping
from math import degrees, inf, pi
from typing import Any

from beaver_ftc.aircraft import AXES, Aircraft
from beaver_ftc.design.air import altitude_of
from beaver_ftc.scenario.declared import undeclared
from beaver_ftc.scenario.diagnosis import failing, of_several
from beaver_ftc.scenario.faults import UNANTICIPATED
from beaver_ftc.scenario.signals import Chirp

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
