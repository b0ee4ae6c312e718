"""`beaver-ftc compare --tune`: one procedure that chooses the parameters of every detector and law.

The same search (search.py) with the same number of trials from the same seed, by the costs of criteria.py, on
flights of the sets `calibration-GRADE`, whose seeds are in no set that is compared. Each grade of flights is
tuned by itself: exact sensors and ideal actuators; actuators that lag; errors of sensors and air. What may be
tuned is `tunable` in plugins.yaml, or in the class of a plug-in. A method keeps the values that it starts
with unless the search finds some that cost `LEAST_GAIN` less: the rule is the same for ours and for rivals.
"""

import json
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any

from beaver_ftc.diagnosis.rivals import GRADES, KINDS, tuned, values_of
from beaver_ftc.documents.errors import BadInput
from beaver_ftc.plugins import DETECTORS, LAWS, Range, is_compiled, options_of, plugin_class, tunable
from beaver_ftc.results.model import Document
from beaver_ftc.scenario.schema import Scenario
from beaver_ftc.studies.compare.criteria import (
    FAILED,
    INADMISSIBLE,
    DetectorCost,
    LawCost,
    flights,
    least_margins,
)
from beaver_ftc.studies.compare.search import Found, Values, search, value_at
from beaver_ftc.studies.compare.trial import STATISTICAL
from beaver_ftc.studies.engine.study import Progress, fly_all
from beaver_ftc.studies.present.tables import aligned

PROCEDURE = "beaver-ftc compare --tune; docs/results/benchmark.md"
LEAST_GAIN = 0.05
NAME = "tuned.json"
OF_STATISTICAL = {
    "fdi.statistical.false_alarms_per_h": Range(1e-9, 3600.0),
    "fdi.statistical.misnaming": Range(1e-9, 0.49),
}


@dataclass(frozen=True)
class Method:
    """A detector or law to be tuned on a grade of flights."""

    group: str
    name: str
    grade: str

    def ranges(self) -> dict[str, Range]:
        """What may be tuned of it."""
        return OF_STATISTICAL if self.name == STATISTICAL else tunable(self.group, self.name)

    def start(self) -> Values:
        """The values it starts with: those it ships with, its defaults, or the middle of their ranges."""
        shipped = values_of(tuned(), self.grade, self.group, self.name)
        return {key: shipped.get(key, self._default(key, of)) for key, of in self.ranges().items()}

    def _default(self, key: str, of: Range) -> float:
        if "." in key:
            return _in_scenario(key)
        if is_compiled(self.group, self.name):
            return float(options_of(self.group, self.name)[key]["default"])
        defaults = getattr(plugin_class(self.group, self.name), "defaults", {})
        return float(defaults.get(key, value_at(of, 0.5)))


def _in_scenario(key: str) -> float:
    """The default of a scenario's key; the statistical detector is there if asked for."""
    found: Any = Scenario(name="defaults", fdi={"statistical": {}})
    for part in key.split("."):
        found = getattr(found, part)
    return float(found)


def methods_of(schemes: Sequence[str], laws: Sequence[str], grades: Sequence[str]) -> list[Method]:
    """Those of the methods that have something to tune, on each grade."""
    named = [(DETECTORS, name) for name in schemes] + [(LAWS, name) for name in laws]
    methods = [Method(group, name, grade) for grade in grades for group, name in named]
    return [method for method in methods if method.ranges()]


def tune(
    methods: Sequence[Method], trials: int, seed: int, most: int | None, workers: int,
    progress: Progress | None,
) -> Document:  # fmt: skip
    """The document of tuned.json. most: flights of each calibration sweep; None is all of them."""
    if not methods:
        raise BadInput("compare --tune: nothing to tune, allowed: methods that declare `tunable`")
    rows = fly_all(partial(tune_method, trials=trials, seed=seed, most=most), methods, workers, progress)
    grades: Document = {}
    for method, row in zip(methods, rows, strict=True):
        of_kind = grades.setdefault(method.grade, {}).setdefault(KINDS[method.group], {})
        of_kind[method.name] = row["values"]
    counts = {grade: len(flights(grade, most)) for grade in grades}
    how = {"procedure": PROCEDURE, "trials": trials, "seed": seed}
    return how | {"flights": counts, "grades": grades, "methods": rows}


def tune_method(method: Method, trials: int, seed: int, most: int | None) -> Document:
    """A row: the values chosen, their cost, that of the values at the start, trials, ranges, margins."""
    cost = (
        DetectorCost(method.name, flights(method.grade, most))
        if method.group == DETECTORS
        else LawCost(method.name, method.grade, most)
    )
    start = method.start()
    found = search(cost, method.ranges(), start, trials, seed)
    gains = found.cost < (1.0 - LEAST_GAIN) * found.start_cost
    values = found.values if gains else start
    return {**_row(method, found), "values": values, **_margins(cost, values)}


def _row(method: Method, found: Found) -> Document:
    return {
        "grade": method.grade,
        "kind": KINDS[method.group],
        "name": method.name,
        "start_cost": found.start_cost,
        "cost": found.cost,
        "found": found.values,
        "ranges": {key: asdict(of) for key, of in found.ranges.items()},
        "widened": list(found.widened),
        "trials": found.trials,
    }


def _margins(cost: DetectorCost | LawCost, values: Values) -> Document:
    if isinstance(cost, DetectorCost):
        return {}
    gain_db, phase_deg = least_margins(cost.margins(values))
    return {"gain_margin_db": gain_db, "phase_margin_deg": phase_deg}


def write_tuned(document: Document, folder: Path) -> Path:
    """Write the file that `compare --tuned` reads."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / NAME
    path.write_text(json.dumps(document, indent=2) + "\n", encoding="utf-8")
    return path


def read_tuned(path: Path) -> Document:
    """The values in a file that `compare --tune` wrote. Raises BadInput."""
    try:
        grades: Document = json.loads(path.read_text(encoding="utf-8"))["grades"]
        assert set(grades) <= set(GRADES)
        return grades
    except (OSError, ValueError, KeyError, TypeError, AssertionError) as error:
        raise BadInput(f"{path}: cannot be read, allowed: a file that compare --tune wrote") from error


def as_text(document: Document) -> str:
    """A line a method and grade; then where ranges were widened."""
    rows = [["grade", "method", "cost at the start", "cost found", "margins dB, deg", "values"]]
    rows += [list(_cells(row)) for row in document["methods"]]
    edges = [(row["name"], row["grade"], row["widened"]) for row in document["methods"] if row["widened"]]
    widened = [f"{name}, {of}: on the edge of its range, widened: {', '.join(at)}" for name, of, at in edges]
    head = f"{document['trials']} trials a method and grade, seed {document['seed']}"
    return "\n".join([head, "", aligned(rows), *widened])


def _cells(row: Document) -> Iterator[str]:
    yield row["grade"]
    yield row["name"]
    yield _cost(row["start_cost"])
    yield _cost(row["cost"])
    yield f"{row['gain_margin_db']:.1f}, {row['phase_margin_deg']:.0f}" if "gain_margin_db" in row else "-"
    yield ", ".join(f"{key} {value:.4g}" for key, value in row["values"].items())


def _cost(cost: float) -> str:
    return "cannot fly" if cost >= FAILED else "inadmissible" if cost >= INADMISSIBLE else f"{cost:.3f}"
