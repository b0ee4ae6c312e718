"""Level flight to derive an aircraft about: how its engines start, at which speed and power it trims.

An aircraft that has a file already keeps all that is in it but its moments: these are found anew.
"""

from dataclasses import dataclass
from math import degrees, isfinite
from pathlib import Path
from typing import Any

from beaver_ftc.aircraft import Aircraft
from beaver_ftc.aircraft.loading import read
from beaver_ftc.aircraft.schema import AircraftFile
from beaver_ftc.documents.errors import BadInput, BeaverFtcError, SimulationFailed
from beaver_ftc.plant.adapter import Plant
from beaver_ftc.plant.model_file import copy_of
from beaver_ftc.plant.state import FlightState
from beaver_ftc.plant.trim import TrimPoint, trim
from beaver_ftc.scenario.initial import initial_of
from beaver_ftc.studies.derive.outline import EnvelopeFile

LIFT_COEFFICIENTS = (0.45, 0.3, 0.2, 0.12, 0.7)  # of the speeds to be tried
_LEAST_THROTTLE, _MOST_THROTTLE = 0.05, 1.0
_HALVINGS = 9
_LEVEL_RAD = 0.01
_POWER = 0.7  # at which engines are tried
_GUESS_RAD = 0.05
_SAME_THRUST = 0.05
_LEAST_THRUST = 0.01  # of the weight
_HELD_S = 3.0
LB_PER_SLUG = 32.17405
# What a rudder at its stop leads to: a file's own terms hold wherever the air is attached.
WIDE_SIDESLIP_RAD = 0.45


@dataclass(frozen=True)
class Level:
    """An aircraft about to be sampled: its file's data, plant and trim, and how far its sideslip goes."""

    data: dict[str, Any]
    aircraft: Aircraft
    plant: Plant
    trim: TrimPoint
    sideslip_rad: float


def plant_of(data: dict[str, Any], folder: Path) -> Plant:
    """A plant of the aircraft as its data are now."""
    return Plant(100, aircraft=Aircraft(AircraftFile.model_validate(data), folder))


def choose_start(data: dict[str, Any], folder: Path, notes: list[str]) -> None:
    """How the engines come to run: at once, as a pilot starts them, or not at all, which is noted."""
    if not plant_of(data, folder).n_engines:
        notes.append("it has no engine: trim is a glide")
        return
    settled: dict[str, float] = {}
    for how in ("steady", "run_up", "off"):
        data["engine"]["start"] = how
        share = _steady_thrust(plant_of(data, folder))
        if share is not None and share > _LEAST_THRUST:
            return
        settled |= {how: share} if share is not None else {}
    data["engine"]["start"] = next(iter(settled), "off")
    notes.append("its engines give no thrust when JSBSim starts them: it is flown gliding")


def _steady_thrust(plant: Plant) -> float | None:
    """Thrust as a share of the weight if it stays when time passes, else None."""
    low, high = plant.aircraft.envelope.airspeed_mps
    state = FlightState(
        0.5 * (low + high), plant.aircraft.file.start.altitude_m or 0.0, aircraft=plant.aircraft,
        alpha_rad=_GUESS_RAD, theta_rad=_GUESS_RAD, throttle=_POWER,
    )  # fmt: skip
    try:
        plant.start(state)
        before = _thrust_lbs(plant)
        for _ in range(round(10 * _HELD_S)):
            plant.hold(state)
            for _ in range(10):
                plant.run()
        after = _thrust_lbs(plant)
    except BeaverFtcError:
        return None
    weight = plant.read("inertia/mass-slugs") * LB_PER_SLUG
    steady = abs(after - before) <= _SAME_THRUST * abs(before) + 0.1 * _LEAST_THRUST * weight
    return before / weight if isfinite(before) and isfinite(after) and steady else None


def _thrust_lbs(plant: Plant) -> float:
    return sum(plant.read(f"propulsion/engine[{i}]/thrust-lbs") for i in range(plant.n_engines))


def level_flight(
    outlines: list[dict[str, Any]], folder: Path, notes: list[str], sideslip_rad: float
) -> Level:
    """The first of several outlines, each about another speed, that trims, in flight as level as power makes
    it. Raises BadInput, saying why the first does not, if none does."""
    failed: BeaverFtcError | None = None
    for data in outlines:
        choices: list[str] = []
        choose_start(data, folder, choices)
        try:
            point = level_trim(plant_of(data, folder), data)
        except (BadInput, SimulationFailed) as error:
            failed = failed or error
            continue
        plant = plant_of(data, folder)
        notes += [*choices, *(_slope(point) if plant.n_engines else [])]
        return Level(data, plant.aircraft, plant, point, sideslip_rad)
    raise BadInput(f"{outlines[0]['name']}: {failed}")


def _slope(point: TrimPoint) -> list[str]:
    if abs(point.gamma_rad) < _LEVEL_RAD:
        return []
    way = "climbs at" if point.gamma_rad > 0.0 else "sinks at"
    return [f"in trim it {way} {abs(degrees(point.gamma_rad)):.1f} deg: its power goes no further"]


def level_trim(plant: Plant, data: dict[str, Any]) -> TrimPoint:
    """Level flight in the middle of the envelope, by the throttle; its setting becomes the default."""
    low, high = data["envelope"]["airspeed_mps"]
    speed_mps, altitude_m = 0.5 * (low + high), data["start"]["altitude_m"]
    ends = [_LEAST_THROTTLE, _MOST_THROTTLE]
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
    data["envelope"] |= envelope.model_dump(
        mode="json", exclude_none=True, exclude={"altitude_m", "sideslip_deg"}
    )
    start = usual_start(aircraft)
    if envelope.airspeed_mps is not None:
        start["airspeed_mps"] = 0.5 * sum(envelope.airspeed_mps)
    if envelope.altitude_m is not None:
        start["altitude_m"] = envelope.altitude_m
    data["start"] = start
    plant = Plant(100, aircraft=aircraft)
    return Level(data, aircraft, plant, trim_at(plant, **start), envelope.sideslip_rad or WIDE_SIDESLIP_RAD)


def usual_start(aircraft: Aircraft) -> dict[str, float]:
    """Where a scenario of an aircraft starts that says nothing else."""
    usual = initial_of(aircraft)()
    return {"airspeed_mps": usual.airspeed_mps, "altitude_m": usual.altitude_m}


def trim_at(plant: Plant, airspeed_mps: float, altitude_m: float) -> TrimPoint:
    """Trim with the engine as the file has it. Raises BadInput as `trim`."""
    settings = {name: setting.default for name, setting in plant.aircraft.engine.settings.items()}
    return trim(airspeed_mps, altitude_m, plant=plant, **settings)


def named_as(aircraft: Aircraft, moments: dict[str, list[dict[str, Any]]]) -> dict[str, list[dict[str, Any]]]:
    """Terms under the names an aircraft's own file has for the same products."""
    names = {(t.coefficient, t.surface, frozenset(t.of)): t.name for t in aircraft.terms.values()}

    def name_of(coefficient: str, term: dict[str, Any]) -> str:
        product = coefficient, term.get("surface"), frozenset(term["of"].items())
        return names.get(product, term["name"])

    return {
        coefficient: [{**term, "name": name_of(coefficient, term)} for term in terms]
        for coefficient, terms in moments.items()
    }
