"""The sets of flights on which schemes and laws are compared and tuned.

A set is a folder of sweep files, or one sweep file. The names of sets for tuning begin with CALIBRATION.
"""

from dataclasses import dataclass, replace
from pathlib import Path

from beaver_ftc.diagnosis.rivals import FLIGHT_GRADES
from beaver_ftc.documents.errors import BadInput
from beaver_ftc.documents.files import data_root
from beaver_ftc.scenario.schema import Scenario

CALIBRATION = "calibration-"  # begin of the names of the sets for tuning; the grade follows
DRAW = 1000  # added to the seed for each draw of a set; the seeds of all sets are smaller


@dataclass(frozen=True)
class SetFlight:
    """One flight of a set."""

    set: str
    scenario: Scenario


def of_sweep(
    path: str | Path, set_name: str | None = None, most: int | None = None, draw: int = 0
) -> list[SetFlight]:
    """The first `most` flights of a sweep file; None is all. Raises BadInput for a wrong file, or one whose
    base has `changes`.

    draw: 0 keeps the seed of the file; each other number adds DRAW times itself to it: other flights.
    """
    from beaver_ftc.scenario.sweeps import load_sweep
    from beaver_ftc.studies.sweep.one_flight import scenario_of
    from beaver_ftc.studies.sweep.sampling import Plan

    sweep = load_sweep(path)
    if draw:
        sweep = replace(sweep, file=sweep.file.model_copy(update={"seed": sweep.file.seed + DRAW * draw}))
    count = sweep.flights if most is None else min(most, sweep.flights)
    assignments = Plan(sweep).assignments(range(count))
    flights = [SetFlight(set_name or sweep.name, scenario_of(sweep, flight)) for flight in assignments]
    if any(case.scenario.changes for case in flights):
        raise BadInput(f"{path}: changes: each scheme and each law flies to the end, allowed: a base without")
    return flights


def benchmark_folder() -> Path:
    """The folder of the standard sets."""
    return data_root() / "scenarios" / "benchmark"


def set_names() -> list[str]:
    """The names of the standard sets, without those for tuning."""
    folders = sorted(path.name for path in benchmark_folder().iterdir() if path.is_dir())
    return [name for name in folders if not name.startswith(CALIBRATION)]


def of_set(name: str, most: int | None = None, draw: int = 0) -> list[SetFlight]:
    """The flights of a standard set: the first `most` of each of its sweeps. draw: as in `of_sweep`. Raises
    BadInput for an unknown set."""
    allowed = [*set_names(), *(CALIBRATION + grade for grade in FLIGHT_GRADES)]
    if name not in allowed:
        raise BadInput(f"no benchmark set {name!r}, allowed: {', '.join(allowed)}")
    sweeps = sorted((benchmark_folder() / name).glob("*.yaml"))
    return [case for path in sweeps for case in of_sweep(path, name, most, draw)]
