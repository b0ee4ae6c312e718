"""A user's own aircraft is checked as a scenario names it, before JSBSim loads its model in this process.

Its files must contain nothing that acts on the machine (model_file.py). A process of its own loads and flies
the model (trial.py). Every property that the aircraft file names must be one of the model. The user's cache
keeps the digest of a folder that has passed: the last two checks are not repeated until a file changes.
"""

import contextlib
from collections.abc import Iterator, Mapping
from functools import lru_cache
from importlib.metadata import version
from pathlib import Path

from beaver_ftc.aircraft import Aircraft
from beaver_ftc.aircraft.aircraft import FILE
from beaver_ftc.aircraft.schema import AircraftFile
from beaver_ftc.documents.document import Location, Problem
from beaver_ftc.documents.errors import SimulationFailed
from beaver_ftc.documents.files import cache_base, digest_of_aircraft, digest_of_files
from beaver_ftc.documents.report import ScenarioError
from beaver_ftc.documents.validation import parse_document
from beaver_ftc.plant.adapter import Plant
from beaver_ftc.plant.model_file import check_model_has_no_side_effects
from beaver_ftc.plant.trial import failure

# The checks: aircraft admitted by another version of them are checked again.
_CHECKS = tuple(Path(__file__).with_name(name) for name in ("admission.py", "model_file.py", "trial.py"))


@lru_cache(maxsize=32)
def admit(aircraft: Aircraft) -> None:
    """Check an aircraft, once a process.

    Raises BadInput as `check_model_has_no_side_effects`, and ScenarioError at the line of the aircraft file
    where JSBSim does not load or fly the model, or where the model lacks a property.
    """
    check_model_has_no_side_effects(aircraft.jsbsim)
    base = cache_base()
    passed = f"{digest_of_aircraft(aircraft.folder)}-{digest_of_files(*_CHECKS)}-{version('jsbsim')}"
    kept = None if base is None else base / "admitted" / passed
    if kept is not None and kept.is_file():
        return
    if why := failure(aircraft.jsbsim):
        raise _mistakes(aircraft, {("jsbsim",): f"{why}, allowed: a model that JSBSim loads and flies"})
    _check_properties(aircraft)
    if kept is not None:
        with contextlib.suppress(OSError):  # nowhere to keep it: checked again the next time
            kept.parent.mkdir(parents=True, exist_ok=True)
            kept.touch()


def _check_properties(aircraft: Aircraft) -> None:
    try:
        plant = Plant(100, aircraft=aircraft)
    except SimulationFailed as error:
        raise _mistakes(aircraft, {("jsbsim",): f"{error}, allowed: a model that JSBSim loads"}) from None
    says = f"is no property of {aircraft.file.jsbsim}, allowed: one that it has"
    wrong = {at: f"{name!r} {says}" for at, name in _properties(aircraft.file) if not plant.has(name)}
    if wrong:
        raise _mistakes(aircraft, wrong)


def _properties(file: AircraftFile) -> Iterator[tuple[Location, str]]:
    """Location in the aircraft's file and name of each JSBSim property that the file names."""
    for name, surface in file.surfaces.items():
        for key in ("command", "position", "effective"):
            yield ("surfaces", name, key), getattr(surface, key)
    for name, signal in file.signals.items():
        yield ("signals", name, "property"), signal.property
    yield ("trim", "throttle"), file.trim.throttle
    for kind in ("settings", "limits"):
        for name, of in getattr(file.engine, kind).items():
            yield ("engine", kind, name, "property"), of.property
    for name, engine in file.effectors.items():
        yield ("effectors", name, "throttle"), engine.throttle
    for name, case in file.damage.items():
        yield ("damage", name, "property"), case.property
    if file.ground is not None:
        yield ("ground", "present"), file.ground.present


def _mistakes(aircraft: Aircraft, says: Mapping[Location, str]) -> ScenarioError:
    """The error with these mistakes, by location in the aircraft's file, at their lines."""
    path = aircraft.folder / FILE
    lines = parse_document(path.read_text(encoding="utf-8"), str(path))
    return ScenarioError(str(path), [Problem(lines.line(at), at, what) for at, what in says.items()])
