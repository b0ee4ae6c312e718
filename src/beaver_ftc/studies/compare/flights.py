"""Which flights are compared: those of a sweep, or of the standard sets in scenarios/benchmark/."""

from dataclasses import dataclass
from pathlib import Path

from beaver_ftc.documents.errors import BadInput
from beaver_ftc.documents.paths import data_root
from beaver_ftc.scenario.schema import Scenario

CALIBRATION = "calibration"
CALIBRATION_ERRORS = "calibration-errors"


@dataclass(frozen=True)
class Case:
    """One flight of a set."""

    set: str
    scenario: Scenario


def of_sweep(path: str | Path, set_name: str | None = None, most: int | None = None) -> list[Case]:
    """The flights of a sweep file, the first `most` of them. Raises BadInput for what is wrong with it."""
    from beaver_ftc.scenario.sweep_loader import load_sweep
    from beaver_ftc.studies.sweep.flying import scenario_of
    from beaver_ftc.studies.sweep.sampling import Plan

    sweep = load_sweep(path)
    count = sweep.flights if most is None else min(most, sweep.flights)
    assignments = Plan(sweep).assignments(range(count))
    return [Case(set_name or sweep.name, scenario_of(sweep, flight)) for flight in assignments]


def benchmark_folder() -> Path:
    """Where the standard sets are: a folder a set, sweep files in it."""
    return data_root() / "scenarios" / "benchmark"


def set_names() -> list[str]:
    """The standard sets but those that are for tuning."""
    folders = sorted(path.name for path in benchmark_folder().iterdir() if path.is_dir())
    return [name for name in folders if not name.startswith(CALIBRATION)]


def of_set(name: str, most: int | None = None) -> list[Case]:
    """The flights of a standard set; of each of its sweeps, the first `most`."""
    folder = benchmark_folder() / name
    if not folder.is_dir():
        allowed = ", ".join([*set_names(), CALIBRATION, CALIBRATION_ERRORS])
        raise BadInput(f"no benchmark set {name!r}, allowed: {allowed}")
    return [case for path in sorted(folder.glob("*.yaml")) for case in of_sweep(path, name, most)]
