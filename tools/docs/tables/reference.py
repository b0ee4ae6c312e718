"""Tables of docs/reference: the defaults of a scenario in words, and the data sheet of the Beaver."""

import math
from collections.abc import Iterator
from typing import Any

import beaver_ftc as bf
from beaver_ftc.studies.present.tables import markdown_table

_AIRSPEEDS_MPS = (30, 35, 40, 45, 50, 55)
_ALTITUDES_M = (0.0, 1828.8, 3000.0)
_SENSE = {  # moment that a surface gives first, and the movement of a positive and of a negative moment
    "aileron": ("Cl", "rolls right", "rolls left"),
    "elevator": ("Cm", "pitches up", "pitches down"),
    "rudder": ("Cn", "yaws right", "yaws left"),
    "flap": ("Cm", "pitches up", "pitches down"),
}


def scenario_defaults() -> str:
    """What a scenario with nothing but a name flies."""
    scenario = bf.load({"name": "nothing-but-a-name"})
    rows = [(question, answer, f"`{keys}`") for question, answer, keys in _answers(scenario)]
    return markdown_table(("question", "answer", "key"), rows)


def _answers(scenario: Any) -> Iterator[tuple[str, str, str]]:
    initial, bounds, fdi = scenario.initial, scenario.fdi.bounds, scenario.fdi
    aircraft = bf.aircraft(scenario.aircraft)
    yield "which aircraft?", f"`{aircraft.name}`: {aircraft.file.description}", "aircraft"
    yield "for how long?", f"{scenario.duration_s:g} s", "duration_s"
    yield "how many frames a second?", f"{scenario.rate_hz:g}", "rate_hz"
    yield (
        "how fast?",
        f"{initial.airspeed_mps:g} m/s true airspeed, trimmed, wings level",
        "initial.airspeed_mps",
    )
    yield (
        "how high?",
        f"{initial.altitude_m:g} m ({initial.altitude_m / 0.3048:.0f} ft) above sea level",
        "initial.altitude_m",
    )
    power = (
        f"engine speed {initial.engine_rpm:g} rpm, manifold pressure "
        f"{initial.manifold_pressure_inhg:g} inHg, constant"
    )
    yield "with which power?", power, "initial.engine_rpm`, `initial.manifold_pressure_inhg"
    yield "with how much flap?", f"{initial.flap_deg:g} deg", "initial.flap_deg"
    yield "which manoeuvre?", _none(scenario.reference.p, "none: all commanded body rates are 0"), "reference"
    yield "which flight path?", _none(scenario.autopilot, "none: only body rates are controlled"), "autopilot"
    yield "which fault?", _none(scenario.faults, "none"), "faults"
    yield "which sensors?", "exact: no noise, bias, delay or quantisation", "sensors"
    yield "which servos?", "ideal: a surface follows its command at once, within its travel", "actuators"
    yield (
        "which air?",
        f"still: turbulence `{scenario.environment.turbulence}`, no wind, no gust",
        "environment",
    )
    yield "does the design model differ from the simulated aircraft?", "no", "uncertainty"
    yield "which law?", f"`{scenario.control.law}`", "control.law"
    yield "which diagnosis?", f"`{fdi.scheme}`", "fdi.scheme"
    if fdi.fault_class != "published":
        raise AssertionError(f"{fdi.fault_class}: the default is no longer loss of effectiveness")
    yield "which faults does it test for?", "`published`: loss of effectiveness", "fdi.fault_class"
    constant, share = bounds.constant_rad_s2.q, bounds.inertia_coupling.q
    declared = (
        f"on each axis, a model error of {constant:g} rad/s², and an error of {100 * share:.0f} % in the "
        "inertia coupling, the angular acceleration from products of two rates"
    )
    yield "which errors are declared?", declared, "fdi.bounds"
    yield "is the statistical detector on?", "no" if fdi.statistical is None else "yes", "fdi.statistical"
    yield "which seed?", f"{scenario.seed}", "seed"
    yield "which result is required?", "none: the verdict says *flown*, and the exit status is 0", "expect"


def _none(value: Any, words: str) -> str:
    if value:
        raise AssertionError(f"{value}: the default is no longer empty")
    return words


def beaver_mass() -> str:
    """Mass, geometry and limits of the Beaver, from its file."""
    aircraft = bf.aircraft("beaver")
    mass, geometry, envelope = aircraft.mass, aircraft.geometry, aircraft.envelope
    low, high = (math.degrees(angle) for angle in aircraft.alpha_rad)
    slow, fast = envelope.airspeed_mps
    settings = aircraft.file.engine.settings
    engine = [
        (f"{setting.says}, {end}", f"{limit:g}", setting.unit)
        for setting in settings.values()
        for end, limit in zip(("least", "largest"), setting.range, strict=True)
    ]
    rows = [
        ("mass", f"{mass.mass_kg:.0f}", "kg"),
        ("moment of inertia about roll, $I_x$", f"{mass.Ix_kg_m2:.0f}", "kg m²"),
        ("moment of inertia about pitch, $I_y$", f"{mass.Iy_kg_m2:.0f}", "kg m²"),
        ("moment of inertia about yaw, $I_z$", f"{mass.Iz_kg_m2:.0f}", "kg m²"),
        ("product of inertia, $J_{xz}$", f"{mass.Jxz_kg_m2:.0f}", "kg m²"),
        ("wing area", f"{geometry.wing_area_m2:.2f}", "m²"),
        ("span", f"{geometry.span_m:.2f}", "m"),
        ("mean chord", f"{geometry.chord_m:.3f}", "m"),
        *engine,
        ("validated airspeed, least", f"{slow:g}", "m/s"),
        ("validated airspeed, largest", f"{fast:g}", "m/s"),
        ("validated angle of attack, least", f"{low:.1f}", "deg"),
        ("validated angle of attack, largest", f"{high:.1f}", "deg"),
    ]
    return markdown_table(("quantity", "value", "unit"), rows)


def beaver_surfaces() -> str:
    """Travel of each surface, with the sense of a positive deflection."""
    return _of_records([_surface(name) for name in bf.aircraft("beaver").surfaces])


def _surface(name: str) -> dict[str, str]:
    aircraft = bf.aircraft("beaver")
    coefficient, up, down = _SENSE[name]
    (term,) = (t for t in getattr(aircraft.file.moments, coefficient) if t.surface == name and not t.of)
    low, high = (math.degrees(stop) for stop in aircraft.file.surfaces[name].travel_rad)
    return {
        "surface": name,
        "lower stop, deg": f"{low:.1f}",
        "upper stop, deg": f"{high:.1f}",
        "a positive deflection": up if term.value > 0 else down,
        "main coefficient": f"`{term.name}`",
        "value, 1/rad": f"{term.value:g}",
    }


def beaver_trim() -> str:
    """Trim of the Beaver, wings level, at airspeeds and altitudes."""
    return _of_records([_trim(altitude, speed) for altitude in _ALTITUDES_M for speed in _AIRSPEEDS_MPS])


def _trim(altitude_m: float, airspeed_mps: float) -> dict[str, str]:
    trim = bf.trim("fault-free", airspeed_mps=airspeed_mps, altitude_m=altitude_m)
    low, high = bf.aircraft("beaver").alpha_rad
    surfaces = {
        f"{name}, deg": f"{math.degrees(trim.surfaces_rad[name]):.1f}"
        for name in ("aileron", "elevator", "rudder")
    }
    return {
        "altitude, m": f"{altitude_m:.0f}",
        "airspeed, m/s": f"{airspeed_mps:g}",
        "angle of attack, deg": f"{math.degrees(trim.alpha_rad):.1f}",
        "validated": "yes" if low <= trim.alpha_rad <= high else "no",
        "flight path, deg": f"{math.degrees(trim.gamma_rad):.1f}",
        **surfaces,
    }


def _of_records(records: list[dict[str, str]]) -> str:
    return markdown_table(tuple(records[0]), [tuple(record.values()) for record in records])
