"""Tables of the data sheet of the Beaver."""

import math

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


def beaver_mass() -> str:
    """Mass, geometry and limits of the Beaver, from its file."""
    aircraft = bf.aircraft("beaver")
    mass, geometry, envelope = aircraft.mass, aircraft.geometry, aircraft.envelope
    low, high = (math.degrees(angle) for angle in aircraft.alpha_rad)
    slow, fast = envelope.airspeed_mps
    settings = aircraft.file.engine.settings
    engine = [
        (f"{setting.says}, {end}", limit, "g", setting.unit)
        for setting in settings.values()
        for end, limit in zip(("least", "largest"), setting.range, strict=True)
    ]
    rows = [
        ("mass", mass.mass_kg, ".0f", "kg"),
        ("moment of inertia about roll, $I_x$", mass.Ix_kg_m2, ".0f", "kg m²"),
        ("moment of inertia about pitch, $I_y$", mass.Iy_kg_m2, ".0f", "kg m²"),
        ("moment of inertia about yaw, $I_z$", mass.Iz_kg_m2, ".0f", "kg m²"),
        ("product of inertia, $J_{xz}$", mass.Jxz_kg_m2, ".0f", "kg m²"),
        ("wing area", geometry.wing_area_m2, ".2f", "m²"),
        ("span", geometry.span_m, ".2f", "m"),
        ("mean chord", geometry.chord_m, ".3f", "m"),
        *engine,
        ("validated airspeed, least", slow, "g", "m/s"),
        ("validated airspeed, largest", fast, "g", "m/s"),
        ("validated angle of attack, least", low, ".1f", "deg"),
        ("validated angle of attack, largest", high, ".1f", "deg"),
    ]
    shown = [(says, format(value, form), unit) for says, value, form, unit in rows]
    return markdown_table(("quantity", "value", "unit"), shown)


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
