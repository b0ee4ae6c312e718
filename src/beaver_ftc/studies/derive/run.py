"""From the name of a JSBSim aircraft to a folder that flies: instrumented model and `aircraft.yaml`."""

import shutil
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from beaver_ftc.aircraft import Aircraft
from beaver_ftc.aircraft.loading import derived_folder
from beaver_ftc.aircraft.schema import AircraftFile, Interval
from beaver_ftc.design.context import DesignModel
from beaver_ftc.design.model import design_record
from beaver_ftc.errors import BadInput
from beaver_ftc.plant import instrumented
from beaver_ftc.plant.adapter import Plant, bare
from beaver_ftc.plant.trim import TrimPoint, trim
from beaver_ftc.scenario.base import Number, Section, number
from beaver_ftc.scenario.document import Problem
from beaver_ftc.scenario.files import UnreadableError, read_text
from beaver_ftc.scenario.problems import ScenarioError
from beaver_ftc.scenario.validation import parse_document, validate
from beaver_ftc.studies.derive.fit import fitted
from beaver_ftc.studies.derive.sample import Envelope, Samples, sample

KG_PER_SLUG = 0.45359237 * 9.80665 / 0.3048
KG_M2 = KG_PER_SLUG * 0.3048**2
ALTITUDE_M = 1500.0
SAMPLES, CHECKED = 2500, 5000
MARGIN = 1.1  # of the declared bound over the largest error found
LIFT_COEFFICIENT = 0.45  # at the speed the envelope is built about
SPAN_OF_SPEED = (0.9, 1.1)
SPAN_OF_ALPHA_RAD = 0.06
_COMMANDS = {
    "aileron": "fcs/left-aileron-pos-rad",
    "elevator": "fcs/elevator-pos-rad",
    "rudder": "fcs/rudder-pos-rad",
}
_FIRST_LINE = "# Written by beaver-ftc derive.\n"
_LIKELY_TRAVEL_RAD = 0.35
_LEAST_THROTTLE, _MOST_THROTTLE = 0.05, 1.0


@dataclass(frozen=True)
class Derived:
    """What came of it: the folder, the aircraft, its trim, and the largest errors (3,) rad/s2 over the
    samples of the fit and over those it did not see."""

    aircraft: Aircraft
    trim: TrimPoint
    fitted_rad_s2: np.ndarray
    checked_rad_s2: np.ndarray


class EnvelopeFile(Section):
    """Where to sample, if not about level flight at a lift coefficient of LIFT_COEFFICIENT."""

    airspeed_mps: Interval | None = None
    alpha_deg: Interval | None = None
    altitude_m: Number | None = number(None, unit="m", says="altitude", ge=0, le=15000)


def name_of(reference: str) -> str:
    """The name in `jsbsim:NAME`. Raises BadInput for anything else."""
    if not reference.startswith("jsbsim:"):
        raise BadInput(f"{reference[:80]!r} cannot be derived, allowed: jsbsim:NAME")
    return reference.removeprefix("jsbsim:")


def derive(
    name: str,
    out: Path | None = None,
    envelope: Path | None = None,
    tell: Callable[[str], None] = lambda line: None,
) -> Derived:
    """Derive the file of an aircraft of the jsbsim package; `out`: the folder to put its folder into, if not
    the cache; `envelope`: a YAML file that says where to sample.

    Raises BadInput, naming what is in the way, if its failures cannot be put in or it cannot be trimmed.
    """
    asked = _read_envelope(envelope)
    target = out / name if out else derived_folder(name)
    _check_target(target)
    with tempfile.TemporaryDirectory(prefix="beaver-ftc-") as scratch:
        folder = Path(scratch) / name
        tell("instrument")
        travel = travel_of(name, Path(scratch) / "own")
        if len(travel) < 3:
            raise BadInput(
                f"jsbsim:{name}: its aerodynamics see {', '.join(travel) or 'no surface'}, allowed: 3"
            )
        model = instrumented.instrument(name, folder, travel)
        data = _outline(name, model, travel, asked)
        tell("trim")
        aircraft = Aircraft(AircraftFile.model_validate(data), folder)
        plant = Plant(100, aircraft=aircraft)
        point = level_trim(plant, data)
        where = _envelope(data, point, asked)
        tell("sample")
        first = sample(plant, where, point, SAMPLES, seed=1)
        data["moments"] = fitted(first, aircraft)
        aircraft = Aircraft(AircraftFile.model_validate(data), folder)
        tell("check")
        other = sample(plant, where, point, CHECKED, seed=2)
        errors = [_largest(aircraft, samples) for samples in (first, other)]
        bound = MARGIN * np.maximum(*errors)
        data["model_error_rad_s2"] = dict(zip("pqr", (float(f"{b:.4g}") for b in bound), strict=True))
        _write(folder, data)
        _move(folder, target)
    return Derived(Aircraft(AircraftFile.model_validate(data), target), point, *errors)


def travel_of(name: str, scratch: Path) -> dict[str, tuple[float, float]]:
    """How far each surface goes when its own flight control is commanded from stop to stop, rad.

    scratch: a folder for a copy that writes no files.
    """
    fdm, travel = bare(instrumented.instrument(name, scratch, {})), {}
    for surface in instrumented.surfaces_of(name):
        ends = []
        for command in (-1.0, 1.0):
            fdm[f"fcs/{surface}-cmd-norm"] = command
            for _ in range(400):
                fdm.run()
            ends.append(fdm[_COMMANDS[surface]])
            fdm[f"fcs/{surface}-cmd-norm"] = 0.0
        low, high = min(ends), max(ends)
        known = np.isfinite([low, high]).all() and high > 0.02 and low < -0.02
        limits = (low, high) if known else (-_LIKELY_TRAVEL_RAD, _LIKELY_TRAVEL_RAD)
        travel[surface] = tuple(round(float(np.clip(end, -1.2, 1.2)), 5) for end in limits)
    return travel  # type: ignore[return-value]


def _outline(
    name: str, model: Path, travel: Mapping[str, tuple[float, float]], asked: EnvelopeFile
) -> dict[str, Any]:
    """The file without its terms."""
    fdm = bare(model)
    prefix = instrumented.PREFIX
    names = {
        s: {
            "command": f"fcs/{prefix}{s}-cmd-rad", "position": f"fcs/{prefix}{s}-pos-rad",
            "effective": f"fcs/{prefix}{s}-effective-rad", "travel_rad": list(ends),
        }
        for s, ends in travel.items()
    }  # fmt: skip
    area, mass_kg = fdm["metrics/Sw-sqft"] * 0.3048**2, fdm["inertia/mass-slugs"] * KG_PER_SLUG
    altitude_m = ALTITUDE_M if asked.altitude_m is None else asked.altitude_m
    speed_mps = (2.0 * mass_kg * 9.81 / (1.058 * area * LIFT_COEFFICIENT)) ** 0.5
    return {
        "name": name if name[0].isalpha() else f"a{name}",
        "description": f"{name} of the jsbsim package, derived",
        "jsbsim": model.name,
        "surfaces": names,
        "groups": {"pitch": ["elevator"], "lateral": ["aileron", "rudder"]},
        "signals": {"tc": {"property": instrumented.THRUST}} if instrumented.engines_of(name) else {},
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
        "envelope": {
            "airspeed_mps": list(asked.airspeed_mps or (speed_mps * share for share in SPAN_OF_SPEED)),
            "alpha_deg": [-5, 15],
        },
        "trim": {"throttle": "fcs/actuated-throttle-norm"},
        "engine": {"settings": {"throttle": {
            "property": "fcs/actuated-throttle-norm", "says": "throttle", "unit": "share of 1",
            "default": 0.6, "range": [0.0, 1.0]}}},
        "start": {"altitude_m": altitude_m},
    }  # fmt: skip


def _placeholder(coefficient: str, surface: str) -> dict[str, Any]:
    return {"name": f"{coefficient}_{surface}", "value": -0.1, "surface": surface}


def level_trim(plant: Plant, data: dict[str, Any]) -> TrimPoint:
    """Level flight in the middle of the envelope, by the throttle; its setting becomes the default."""
    low, high = data["envelope"]["airspeed_mps"]
    speed_mps, altitude_m = 0.5 * (low + high), data["start"]["altitude_m"]
    ends = [_LEAST_THROTTLE, _MOST_THROTTLE]
    point = trim(speed_mps, altitude_m, plant=plant, throttle=0.5 * sum(ends))
    for _ in range(9):
        throttle = 0.5 * sum(ends)
        point = trim(speed_mps, altitude_m, plant=plant, throttle=throttle)
        ends[0 if point.gamma_rad < 0.0 else 1] = throttle
    data["engine"]["settings"]["throttle"]["default"] = round(throttle, 4)
    return trim(speed_mps, altitude_m, plant=plant, throttle=round(throttle, 4))


def _envelope(data: dict[str, Any], point: TrimPoint, asked: EnvelopeFile) -> Envelope:
    low, high = point.alpha_rad - SPAN_OF_ALPHA_RAD, point.alpha_rad + SPAN_OF_ALPHA_RAD
    if asked.alpha_deg is not None:
        low, high = (float(np.radians(end)) for end in asked.alpha_deg)
    data["envelope"]["alpha_deg"] = [float(f"{np.degrees(end):.4g}") for end in (low, high)]
    data["envelope"]["airspeed_mps"] = [float(f"{end:.4g}") for end in data["envelope"]["airspeed_mps"]]
    data["start"]["airspeed_mps"] = float(f"{point.airspeed_mps:.4g}")
    return Envelope(tuple(data["envelope"]["airspeed_mps"]), (low, high), point.altitude_m)


def _largest(aircraft: Aircraft, samples: Samples) -> np.ndarray:
    """The largest error of f + G u on each axis, (3,) rad/s2."""
    model = DesignModel(design_record(aircraft))
    believed = [
        model.f(x, y) + model.G(y) @ u for x, y, u in zip(samples.x, samples.y, samples.u, strict=True)
    ]
    worst: np.ndarray = np.abs(np.array(believed) - samples.rate).max(axis=0)
    return worst


def _write(folder: Path, data: Mapping[str, Any]) -> None:
    text = yaml.safe_dump(dict(data), sort_keys=False, default_flow_style=None, width=120)
    (folder / "aircraft.yaml").write_text(_FIRST_LINE + text, encoding="utf-8")


def _read_envelope(path: Path | None) -> EnvelopeFile:
    if path is None:
        return EnvelopeFile()
    try:
        text = read_text(path, 100_000)
    except UnreadableError as error:
        raise ScenarioError(str(path), [Problem(error.line, (), str(error))]) from None
    keys = "the keys airspeed_mps, alpha_deg, altitude_m"
    return validate(EnvelopeFile, parse_document(text, str(path), keys), str(path))


def _check_target(target: Path) -> None:
    """Refuse to replace a folder that was not derived."""
    file = target / "aircraft.yaml"
    if target.exists() and not (file.is_file() and file.read_text(encoding="utf-8").startswith(_FIRST_LINE)):
        raise BadInput(f"{target} is there already and was not derived, allowed: another folder")


def _move(folder: Path, target: Path) -> None:
    """Put a finished folder where it belongs, in place of an older one."""
    target.parent.mkdir(parents=True, exist_ok=True)
    if target.exists():
        shutil.rmtree(target)
    shutil.move(str(folder), target)
