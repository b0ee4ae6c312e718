"""The file of an instrumented aircraft but for its terms: surfaces, mass, dimensions, engines.

And what of the aircraft a design model affine in its surfaces cannot hold: found at once, said in a line.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import degrees, radians
from pathlib import Path
from typing import Any

import numpy as np

from beaver_ftc.aircraft import AXES, Aircraft
from beaver_ftc.aircraft.schema import Interval
from beaver_ftc.documents.base import Number, Section, number
from beaver_ftc.documents.document import Problem
from beaver_ftc.documents.files import UnreadableError, read_text
from beaver_ftc.documents.problems import ScenarioError
from beaver_ftc.documents.validation import parse_document, validate
from beaver_ftc.plant import instrumented
from beaver_ftc.plant.adapter import Plant, bare, translated
from beaver_ftc.plant.state import FlightState

KG_PER_SLUG = 0.45359237 * 9.80665 / 0.3048
KG_M2 = KG_PER_SLUG * 0.3048**2
ALTITUDE_M = 1500.0
DENSITY_KG_M3 = 1.058  # there
SPAN_OF_SPEED = (0.8, 1.25)
THROTTLE = "fcs/actuated-throttle-norm"
LIKELY_TRAVEL_RAD = 0.35
MOST_TRAVEL_RAD = 1.2
POSITIONS = {
    "aileron": "fcs/left-aileron-pos-rad",
    "elevator": "fcs/elevator-pos-rad",
    "rudder": "fcs/rudder-pos-rad",
}
_LEAST_TRAVEL_RAD = 0.02
_FRAMES = 400  # in which its own flight control has moved a surface
NOT_AFFINE = 0.02  # deviation from a straight line, as a share of what the whole travel does
_MOVED_RAD, _RATE_RAD_S = 0.003, 0.1
_POINTS, _OWN_FRAMES = 9, 300
_AT_REST = 0.05  # as a share of where it is
_SURFACE = re.compile(r"fcs/(?!.*(cmd|throttle|thrust|gear))")
Travel = dict[str, tuple[float, float]]


class EnvelopeFile(Section):
    """Where to sample, if not about level flight."""

    airspeed_mps: Interval | None = None
    alpha_deg: Interval | None = None
    altitude_m: Number | None = number(None, unit="m", says="altitude", ge=0, le=15000)
    sideslip_deg: Number | None = number(None, unit="deg", says="sideslip to either side", gt=0, le=45)

    @property
    def sideslip_rad(self) -> float | None:
        """How far to either side, if it is said."""
        return None if self.sideslip_deg is None else radians(self.sideslip_deg)


def read_envelope(path: Path | None) -> EnvelopeFile:
    """The envelope file, or an empty one. Raises ScenarioError with one line a mistake."""
    if path is None:
        return EnvelopeFile()
    try:
        text = read_text(path, 100_000)
    except UnreadableError as error:
        raise ScenarioError(str(path), [Problem(error.line, (), str(error))]) from None
    keys = "the keys airspeed_mps, alpha_deg, altitude_m, sideslip_deg"
    return validate(EnvelopeFile, parse_document(text, str(path), keys), str(path))


def travel_of(source: Path, model: Path, notes: list[str]) -> Travel:
    """How far each surface goes when its own flight control is commanded from stop to stop, rad.

    model: a copy that writes no files. What had to be supposed is added to the notes.
    """
    travel = {}
    for surface in instrumented.surfaces_of(source):
        ends = [own_deflection(model, surface, command) for command in (-1.0, 1.0)]
        low, high = min(ends), max(ends)
        if not (np.isfinite([low, high]).all() and high > _LEAST_TRAVEL_RAD and low < -_LEAST_TRAVEL_RAD):
            low, high = -LIKELY_TRAVEL_RAD, LIKELY_TRAVEL_RAD
            notes.append(
                f"{surface}: its own flight control does not move it to both sides; {high:g} rad is supposed"
            )
        travel[surface] = tuple(
            round(float(np.clip(end, -MOST_TRAVEL_RAD, MOST_TRAVEL_RAD)), 5) for end in (low, high)
        )
    return travel  # type: ignore[return-value]


def own_deflection(model: Path, surface: str, command: float, rate_rad_s: float = 0.0) -> float:
    """Where its own flight control puts a surface, rad, at a command (-1 to 1) and a rate about all axes."""
    fdm = bare(model)
    with translated(model):
        for axis in "pqr":
            fdm[f"ic/{axis}-rad_sec"] = rate_rad_s
        fdm[f"fcs/{surface}-cmd-norm"] = command
        fdm.run_ic()
        for k in range(_FRAMES):
            if k % 10 == 0:
                fdm.run_ic()
            fdm.run()
    return float(fdm[POSITIONS[surface]])


def outline(name: str, model: Path, travel: Mapping[str, tuple[float, float]], lift: float) -> dict[str, Any]:
    """The file without its terms; lift: the lift coefficient at the speed the envelope is built about."""
    fdm = bare(model)
    area, mass_kg = fdm["metrics/Sw-sqft"] * 0.3048**2, fdm["inertia/mass-slugs"] * KG_PER_SLUG
    speed_mps = (2.0 * mass_kg * 9.81 / (DENSITY_KG_M3 * area * lift)) ** 0.5
    return {
        "name": name if name[0].isalpha() else f"a{name}",
        "description": f"{name}, derived from its JSBSim model",
        "jsbsim": model.name,
        "surfaces": {surface: _surface(surface, ends) for surface, ends in travel.items()},
        "groups": {"pitch": ["elevator"], "lateral": ["aileron", "rudder"]},
        "signals": {},
        "mass": {
            "mass_kg": mass_kg,
            **{f"I{a}_kgm2": fdm[f"inertia/i{a}{a}-slugs_ft2"] * KG_M2 for a in "xyz"},
            "Jxz_kgm2": -fdm["inertia/ixz-slugs_ft2"] * KG_M2,
        },
        "geometry": {
            "wing_area_m2": area, "span_m": fdm["metrics/bw-ft"] * 0.3048,
            "chord_m": fdm["metrics/cbarw-ft"] * 0.3048,
        },
        "moments": {"Cl": [_placeholder("Cl", "aileron")], "Cm": [_placeholder("Cm", "elevator")],
                    "Cn": [_placeholder("Cn", "rudder")]},
        "envelope": {"airspeed_mps": [speed_mps * share for share in SPAN_OF_SPEED], "alpha_deg": [-5, 15]},
        "trim": {"throttle": THROTTLE},
        "engine": {"start": "steady", "settings": {"throttle": {
            "property": THROTTLE, "says": "throttle", "unit": "share of 1",
            "default": 0.6, "range": [0.0, 1.0]}}},
        "start": {"altitude_m": ALTITUDE_M},
    }  # fmt: skip


def _surface(surface: str, ends: tuple[float, float]) -> dict[str, Any]:
    prefix = f"fcs/{instrumented.PREFIX}{surface}"
    return {
        "command": f"{prefix}-cmd-rad", "position": f"{prefix}-pos-rad",
        "effective": f"{prefix}-effective-rad", "travel_rad": list(ends),
    }  # fmt: skip


def _placeholder(coefficient: str, surface: str) -> dict[str, Any]:
    return {"name": f"{coefficient}_{surface}", "value": -0.1, "surface": surface}


def not_affine(plant: Plant, trim: FlightState) -> list[str]:
    """Surfaces whose moment is not proportional to their deflection; the plant is left in trim."""
    notes = []
    plant.start(trim)
    for name, travel in plant.aircraft.travel.items():
        at = np.linspace(travel.min_rad, travel.max_rad, _POINTS)
        moved = [_accelerations(plant, trim, name, float(u)) for u in at]
        size = np.ptp(moved, axis=0)
        axis = int(size.argmax())
        if size[axis] == 0.0:
            notes.append(f"{name}: it turns nothing in trim: its faults cannot be seen")
            continue
        share = float(np.ptp(_off_line(at, np.array(moved)[:, axis])) / size[axis])
        if share > NOT_AFFINE:
            notes.append(
                f"{name}: its moment is not proportional to its deflection, {share:.0%} off a straight line: "
                "that is in the error"
            )
    plant.start(trim)
    return notes


def _accelerations(plant: Plant, trim: FlightState, surface: str, deflection_rad: float) -> list[float]:
    plant.hold(replace(trim, surfaces_rad={**trim.surfaces_rad, surface: deflection_rad}))
    return [plant.read(f"accelerations/{axis}dot-rad_sec2") for axis in AXES]


def _off_line(at: np.ndarray, values: np.ndarray) -> np.ndarray:
    off: np.ndarray = values - np.polyval(np.polyfit(at, values, 1), at)
    return off


def further_surfaces(source: Path, plant: Plant) -> dict[str, float]:
    """What else of its flight control its aerodynamics see, by property, and where it is in trim."""
    names = [name for name in instrumented.others_of(source) if _SURFACE.match(name)]
    return {name: round(plant.read(name), 4) for name in names if plant.has(name)}


def moved_by_itself(aircraft: Aircraft, trim: FlightState, names: Sequence[str]) -> list[str]:
    """Which of these properties do not come to rest in steady flight, no surface commanded to move."""
    if not names:
        return []
    plant, seen = Plant(100, aircraft=aircraft), []  # of its own, since fuel burns
    plant.start(trim)
    for k in range(_OWN_FRAMES):
        if k % 10 == 0:
            plant.hold(trim)  # it flies nowhere meanwhile
        plant.run()
        seen.append([plant.read(name) for name in names])
    late = np.array(seen)[_OWN_FRAMES // 2 :]
    moving = np.ptp(late, axis=0) > _AT_REST * (np.abs(late).mean(axis=0) + _AT_REST)
    return [name for name, moves in zip(names, moving, strict=True) if moves]


def own_control(source: Path, model: Path) -> list[str]:
    """What its own flight control does that the copy leaves out; model: a copy that writes no files."""
    surfaces = instrumented.surfaces_of(source)
    return [*_augmented(model, surfaces), *_moved_along(source, model, surfaces)]


def _augmented(model: Path, surfaces: tuple[str, ...]) -> list[str]:
    notes = []
    for surface in surfaces:
        moved = own_deflection(model, surface, 0.0, _RATE_RAD_S) - own_deflection(model, surface, 0.0)
        if abs(moved) > _MOVED_RAD:
            notes.append(
                f"{surface}: its own flight control moves it {degrees(moved):.1f} deg at "
                f"{degrees(_RATE_RAD_S):.1f} deg/s, command or not: the copy flies without"
            )
    return notes


def _moved_along(source: Path, model: Path, surfaces: tuple[str, ...]) -> list[str]:
    """What else of the flight control the aerodynamics see, and moves with the command of a surface."""
    others = instrumented.others_of(source)
    still = _seen(model, others, None)
    notes = []
    for surface in surfaces:
        moved = [name for name, value in _seen(model, others, surface).items() if value != still[name]]
        if moved:
            notes.append(f"{surface}: its command moves {', '.join(moved)} too: in the copy it does not")
    return notes


def _seen(model: Path, names: tuple[str, ...], surface: str | None) -> dict[str, float]:
    fdm = bare(model)
    with translated(model):
        if surface:
            fdm[f"fcs/{surface}-cmd-norm"] = 1.0
        for k in range(_OWN_FRAMES):
            if k % 10 == 0:
                fdm.run_ic()  # it flies nowhere meanwhile
            fdm.run()
    return {name: round(float(fdm[name]), 6) for name in names}
