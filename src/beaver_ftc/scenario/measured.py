"""Where the error of an aircraft's design model was measured, in words; elsewhere the diagnosis concludes
nothing.

Quantities are those of the map in the aircraft's file (`model_error_map`). The density of the air is given as
the altitude at which the standard atmosphere has it. What is said here, `validate`, the verdict, the metrics
and the page on a derived aircraft all say.
"""

from collections.abc import Mapping
from math import degrees, inf
from typing import Any

from beaver_ftc.aircraft import Aircraft
from beaver_ftc.design.atmosphere import altitude_of

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
