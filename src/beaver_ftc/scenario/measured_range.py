"""Where the error of the design model was measured (`model_error_map` of the aircraft's file), in words.

Elsewhere the diagnosis concludes nothing. The file gives the density of the air; here it is the altitude, m,
at which the standard atmosphere has this density.
"""

from collections.abc import Mapping
from math import degrees, inf
from typing import Any

from beaver_ftc.aircraft import Aircraft
from beaver_ftc.design.atmosphere import altitude_of

Span = tuple[float, float]
ALTITUDE = "altitude_m"
# Two more reasons to be outside: flown longer than measured; every quantity in its range, but in no one box.
LATE = "flown_s"
BETWEEN = "between"
_FLOW = ("p_rad_s", "q_rad_s", "r_rad_s", "alpha_rad", "beta_rad", "airspeed_mps", ALTITUDE)
_PLURAL = {
    "p_rad_s": "roll rates", "q_rad_s": "pitch rates", "r_rad_s": "yaw rates",
    "alpha_rad": "angles of attack", "beta_rad": "sideslip angles", "airspeed_mps": "airspeeds",
    ALTITUDE: "altitudes", LATE: "ages of the flight",
}  # fmt: skip
_UNITS = {"rad_s": "deg/s", "rad": "deg", "mps": "m/s", "m": "m"}


def quantities(aircraft: Aircraft) -> tuple[str, ...]:
    """The quantities of which a box of the map has a lowest and a highest value, in the order of the map."""
    return (*_FLOW, *aircraft.signals)


def measured_spans(aircraft: Aircraft) -> dict[str, Span]:
    """The span of each quantity over all boxes, and of the time since the start; empty without a map."""
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
    """Lowest and highest altitude, m, at which the standard atmosphere has densities in a span."""
    thin, thick = density_kg_m3
    return altitude_of(thick), altitude_of(thin)


def outside(quantity: str, measured: Span | None) -> str:
    """The reason why nothing can be concluded while a quantity is outside its measured span."""
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
    """The ends of a span and their unit, for people: angles in deg."""
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
    """The quantities, of these values by name, that lie outside their spans."""
    ends = {name: spans.get(name, (-inf, inf)) for name in place}
    return [name for name, value in place.items() if not ends[name][0] <= value <= ends[name][1]]


def in_words(inconclusive: Mapping[str, Any]) -> str:
    """In which share of the frames, from when on and why the diagnosis could conclude nothing: a sentence
    without a full stop. inconclusive: the section `detection.inconclusive` of metrics.json."""
    said = []
    for reason in inconclusive["reasons"]:
        flown = reason["flown"] and span_in_words(reason["quantity"], reason["flown"])
        of = "" if reason["share"] == inconclusive["share"] else f" ({percent(reason['share'])})"
        said.append(reason["says"] + (f", flown {flown}" if flown else "") + of)
    since = f" from {inconclusive['from_s']:.2f} s on" if inconclusive["from_s"] > 0.0 else ""
    share = percent(inconclusive["share"])
    return f"nothing can be concluded in {share} of the frames{since}: {'; '.join(said)}"


def percent(share: float) -> str:
    """A share in per cent; only a share of all, or of none, is printed as 100 %, or 0 %."""
    if 0.0 < share < 0.01 or 0.99 < share < 1.0:
        return f"{100.0 * share:.2g} %" if share < 0.5 else "more than 99 %"
    return f"{100.0 * share:.0f} %"
