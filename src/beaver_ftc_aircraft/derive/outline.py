"""The file of an instrumented aircraft but for its terms, and the level flight it is derived about.

Surfaces, mass, dimensions, engines: how these start, at which speed and power it trims. What of the aircraft
a design model affine in its surfaces cannot hold is found at once, said in a line. An aircraft that has a
file already keeps all that is in it but its moments: these are found again.
"""

import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from math import degrees
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import yaml
from pydantic import BeforeValidator, Field

from beaver_ftc.aircraft import AXES, KG_PER_SLUG, M_PER_FT, Aircraft, AircraftFile, Interval, Property
from beaver_ftc.aircraft import read_aircraft as read
from beaver_ftc.documents import (
    BadInput,
    BeaverFtcError,
    Number,
    Section,
    SimulationFailed,
    entry,
    number,
    read_file,
)
from beaver_ftc.plant import FlightState, Plant, TrimPoint, bare, copy_of, others_of
from beaver_ftc.plant import trim_plant as trim
from beaver_ftc.scenario import initial_of
from beaver_ftc_aircraft.derive.engines import (
    RATE_HZ,
    hold,
    steady_state,
    thrust_lbs,
    weight_lbs,
    why_no_power,
)
from beaver_ftc_aircraft.derive.engines import run as run_engines
from beaver_ftc_aircraft.derive.surfaces import Surfaces, Travel, moved_by, off_line, settled

SLUG_FT2 = KG_PER_SLUG * M_PER_FT**2
OUTLINE = Path(__file__).with_name("outline.yaml")
DENSITY_KG_M3 = 1.058  # at the altitude there
SPAN_OF_SPEED = (0.8, 1.25)
NOT_AFFINE = 0.02  # deviation from a straight line, as a share of what the whole travel does
_MOVED_RAD, _RATE_RAD_S = 0.003, 0.1
_POINTS, _OWN_FRAMES = 9, 300
_AT_REST = 0.05  # as a share of where it is
_SURFACE = re.compile(r"fcs/(?!.*(cmd|throttle|thrust|gear))")
Data = dict[str, Any]  # of an aircraft's file
Level = tuple[Data, Plant, TrimPoint]  # of an aircraft about to be sampled
LIFT_COEFFICIENTS = (0.45, 0.3, 0.2, 0.12, 0.7)  # of the speeds to be tried
_THROTTLES = (0.05, 1.0)
_HALVINGS = 9
LEVEL_RAD = 0.01
_POWER = 0.7  # at which engines are tried
_GUESS_RAD = 0.05
_SAME_THRUST = 0.05
_LEAST_THRUST = 0.01  # of the weight
_HELD_S = 3.0
# What a rudder at its stop leads to: a file's own terms hold wherever the air is attached.
WIDE_SIDESLIP_RAD = 0.45


Surface = Literal["aileron", "elevator", "rudder"]
Properties = Annotated[
    tuple[Property, ...], BeforeValidator(lambda given: [given] if isinstance(given, str) else given),
    Field(min_length=1, max_length=8),
]  # fmt: skip


class EnvelopeFile(Section):
    """Where to sample, if not about level flight; and what the model calls its surfaces."""

    airspeed_mps: Interval | None = None
    alpha_deg: Interval | None = None
    altitude_m: Number | None = number(None, unit="m", says="altitude", ge=0, le=15000)
    sideslip_deg: Number | None = number(None, unit="deg", says="sideslip to either side", gt=0, le=45)
    surfaces: dict[Surface, Properties] = entry(
        dict, "what the aerodynamics read of each surface, if not by JSBSim's usual names"
    )


def read_envelope(path: Path | None) -> EnvelopeFile:
    """The envelope file, or an empty one. Raises ScenarioError with one line a mistake."""
    if path is None:
        return EnvelopeFile()
    return read_file(EnvelopeFile, path, 100_000, f"the keys {', '.join(EnvelopeFile.model_fields)}")


def outline(name: str, model: Path, travel: Travel, lift: float) -> Data:
    """The file without its terms; lift: the lift coefficient at the speed the envelope is built about."""
    fdm = bare(model)
    area, mass_kg = fdm["metrics/Sw-sqft"] * M_PER_FT**2, fdm["inertia/mass-slugs"] * KG_PER_SLUG
    speed_mps = (2.0 * mass_kg * 9.81 / (DENSITY_KG_M3 * area * lift)) ** 0.5
    data: Data = yaml.safe_load(OUTLINE.read_text(encoding="utf-8"))
    data["name"] = name if name[0].isalpha() else f"a{name}"
    data["description"], data["jsbsim"] = f"{name}, derived from its JSBSim model", model.name
    for surface, ends in travel.items():
        data["surfaces"][surface]["travel_rad"] = list(ends)
    _leave_out(data, data["surfaces"].keys() - travel.keys())
    inertia = {f"I{a}_kgm2": fdm[f"inertia/i{a}{a}-slugs_ft2"] * SLUG_FT2 for a in "xyz"}
    data["mass"] = {"mass_kg": mass_kg, **inertia, "Jxz_kgm2": -fdm["inertia/ixz-slugs_ft2"] * SLUG_FT2}
    span_m, chord_m = fdm["metrics/bw-ft"] * M_PER_FT, fdm["metrics/cbarw-ft"] * M_PER_FT
    data["geometry"] = {"wing_area_m2": area, "span_m": span_m, "chord_m": chord_m}
    data["envelope"]["airspeed_mps"] = [speed_mps * share for share in SPAN_OF_SPEED]
    return data


def _leave_out(data: Data, surfaces: Collection[str]) -> None:
    """Take surfaces from a file."""
    for surface in surfaces:
        del data["surfaces"][surface]
    groups = {name: [s for s in of if s not in surfaces] for name, of in data["groups"].items()}
    data["groups"] = {name: of for name, of in groups.items() if of}
    moments = {name: [t for t in of if t["surface"] not in surfaces] for name, of in data["moments"].items()}
    data["moments"] = {name: of for name, of in moments.items() if of}


def not_affine(plant: Plant, trim: FlightState) -> list[str]:
    """Surfaces whose moment is not proportional to their deflection; the plant is left in trim."""
    notes = []
    plant.start(trim)
    for name, travel in plant.aircraft.travel.items():
        at = np.linspace(travel.min_rad, travel.max_rad, _POINTS)
        moved = np.empty((_POINTS, len(AXES)))
        for k, deflection_rad in enumerate(at.tolist()):
            plant.hold(replace(trim, surfaces_rad={**trim.surfaces_rad, name: deflection_rad}))
            moved[k] = [plant.read(f"accelerations/{axis}dot-rad_sec2") for axis in AXES]
        size = np.ptp(moved, axis=0)
        if size.max() == 0.0:
            notes.append(f"{name}: it turns nothing in trim: its faults cannot be seen")
            continue
        share = off_line(at, moved)
        if share > NOT_AFFINE:
            notes.append(
                f"{name}: its moment is not proportional to its deflection, {share:.0%} off a straight line: "
                "that is in the error"
            )
    plant.start(trim)
    return notes


def further_surfaces(source: Path, plant: Plant, ours: Collection[str]) -> dict[str, float]:
    """What else of its flight control its aerodynamics see, by property, and where it is in trim; ours: what
    they call the surfaces of its file."""
    names = [name for name in others_of(source, ours) if _SURFACE.match(name)]
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


def own_control(source: Path, model: Path, surfaces: Surfaces) -> tuple[list[str], set[str]]:
    """What its own flight control does that the copy leaves out, in notes, and which properties it moves with
    the command of a surface; model: a copy that writes no files.

    It moves surfaces with the rates, and with the command of a surface what else the aerodynamics see.
    """
    notes = []
    for surface, of in surfaces.read.items():
        names, per_unit = [name for name, _ in of], [size for _, size in of]
        turning = {f"ic/{axis}-rad_sec": _RATE_RAD_S for axis in AXES}
        still, moved = (settled(model, given, names) for given in ({}, turning))
        by_rad = float(np.dot(per_unit, np.subtract(moved, still))) / len(names)
        if abs(by_rad) > _MOVED_RAD:
            notes.append(
                f"{surface}: its own flight control moves it {degrees(by_rad):.1f} deg at "
                f"{degrees(_RATE_RAD_S):.1f} deg/s, command or not: the copy flies without"
            )
    others, along = others_of(source, surfaces.names), set[str]()
    for surface in surfaces.read:
        if moved_too := moved_by(model, surface, others):
            along |= set(moved_too)
            notes.append(f"{surface}: its command moves {', '.join(moved_too)} too: in the copy it does not")
    return notes, along


def aircraft_of(data: Mapping[str, Any], folder: Path) -> Aircraft:
    """The aircraft of a folder as its file's data are now."""
    return Aircraft(AircraftFile.model_validate(data), folder)


def plant_of(data: Mapping[str, Any], folder: Path, substeps: int = 1) -> Plant:
    """A plant of it."""
    return Plant(RATE_HZ, substeps, aircraft=aircraft_of(data, folder))


def choose_start(data: Data, folder: Path) -> list[str]:
    """How the engines come to run: at once, as a pilot starts them, or not at all, which is noted."""
    if not plant_of(data, folder).n_engines:
        return ["it has no engine: trim is a glide"]
    settled: dict[str, float] = {}
    for how in ("steady", "run_up", "off"):
        data["engine"]["start"] = how
        share = _steady_thrust(plant_of(data, folder))
        if share is not None and share > _LEAST_THRUST:
            return []
        settled |= {how: share} if share is not None else {}
    # one that does not settle even if it is off is an electric motor: it runs as a pilot has it
    data["engine"]["start"] = next(iter(settled), "run_up")
    return [f"its engines do not carry it, {_why(data, folder)}: it is flown gliding"]


def _why(data: Data, folder: Path) -> str:
    """Why its engines give no more."""
    return why_no_power(lambda substeps: plant_of(data, folder, substeps))


def _steady_thrust(plant: Plant) -> float | None:
    """Thrust as a share of the weight if it and the rolling moment stay when time passes, else None."""
    state = steady_state(plant, _POWER, _GUESS_RAD)
    try:
        plant.start(state)
        before = _push(plant)
        hold(plant, state, _HELD_S)
        after = _push(plant)
    except BeaverFtcError:
        return None
    stays = np.abs(after - before) <= _SAME_THRUST * np.abs(before) + 0.1 * _LEAST_THRUST
    return float(before[0]) if np.isfinite((before, after)).all() and stays.all() else None


def _push(plant: Plant) -> np.ndarray:
    """Thrust as a share of the weight, and the engines' rolling moment as a share of weight times span."""
    roll_lbs = plant.read("moments/l-prop-lbsft") / plant.read("metrics/bw-ft")
    return np.array([thrust_lbs(plant), roll_lbs]) / weight_lbs(plant)


def level_flight(outlines: list[Data], folder: Path, notes: list[str]) -> Level:
    """The first of several outlines, each about another speed, that trims, in flight as level as power makes
    it. Raises BadInput, saying why the first does not, if none does."""
    failed: BeaverFtcError | None = None
    for data in outlines:
        choices = choose_start(data, folder)
        try:
            point = level_trim(plant_of(data, folder), data)
        except (BadInput, SimulationFailed) as error:
            failed = failed or error
            continue
        plant = plant_of(data, folder)
        notes += choices
        if plant.n_engines and abs(point.gamma_rad) >= LEVEL_RAD:
            way, slope_deg = "climbs" if point.gamma_rad > 0.0 else "sinks", abs(degrees(point.gamma_rad))
            why = "" if choices else f": {_why(data, folder)}"
            notes.append(f"in trim it {way} at {slope_deg:.1f} deg: its power goes no further{why}")
        return data, plant, point
    plant = plant_of(outlines[0], folder)
    if plant.n_engines and not run_engines(plant, 1.0).finite:
        raise BadInput(
            f"{outlines[0]['name']}: {_why(outlines[0], folder)}, allowed: engines that JSBSim can run"
        )
    raise BadInput(f"{outlines[0]['name']}: {failed}")


def level_trim(plant: Plant, data: Data) -> TrimPoint:
    """Level flight in the middle of the envelope, by the throttle; its setting becomes the default."""
    low, high = data["envelope"]["airspeed_mps"]
    speed_mps, altitude_m = 0.5 * (low + high), data["start"]["altitude_m"]
    ends = [*_THROTTLES]
    throttle = 0.5 * sum(ends)
    if plant.n_engines and plant.aircraft.engine.start != "off":
        for _ in range(_HALVINGS):
            throttle = 0.5 * sum(ends)
            point = trim(speed_mps, altitude_m, plant=plant, throttle=throttle)
            ends[0 if point.gamma_rad < 0.0 else 1] = throttle
    throttle = round(throttle, 4)
    data["engine"]["settings"]["throttle"]["default"] = throttle
    return trim(speed_mps, altitude_m, plant=plant, throttle=throttle)


def level_as_filed(source: Path, folder: Path, envelope: EnvelopeFile) -> Level:
    """The aircraft in trim where its flights start, over the envelope of its file or this one; its
    model is copied."""
    aircraft = read(source)
    copy_of(aircraft.jsbsim, folder)
    data = aircraft.file.model_dump(mode="json", exclude_none=True, exclude={"moments"})
    data["trim"] = {key: of for key, of in data["trim"].items() if of}
    data["envelope"] |= envelope.model_dump(
        mode="json", exclude_none=True, include={"airspeed_mps", "alpha_deg"}
    )
    data["start"] = start = usual_start(aircraft)
    if envelope.airspeed_mps is not None:
        start["airspeed_mps"] = 0.5 * sum(envelope.airspeed_mps)
    if envelope.altitude_m is not None:
        start["altitude_m"] = envelope.altitude_m
    plant = Plant(100, aircraft=aircraft)
    return data, plant, trim(plant=plant, **start)


def usual_start(aircraft: Aircraft) -> dict[str, float]:
    """Where a scenario of an aircraft starts that says nothing else."""
    usual = initial_of(aircraft)()
    return {"airspeed_mps": usual.airspeed_mps, "altitude_m": usual.altitude_m}


def named_as(aircraft: Aircraft, moments: dict[str, list[dict[str, Any]]]) -> dict[str, list[dict[str, Any]]]:
    """Terms under the names an aircraft's own file has for the same products."""
    names = {(t.coefficient, t.surface, frozenset(t.of)): t.name for t in aircraft.terms.values()}
    for coefficient, terms in moments.items():
        for term in terms:
            product = coefficient, term.get("surface"), frozenset(term["of"].items())
            term["name"] = names.get(product, term["name"])
    return moments
