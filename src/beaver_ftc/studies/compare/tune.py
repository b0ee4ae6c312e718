"""`beaver-ftc compare --tune`: one procedure that chooses the parameters of every detector and law.

The same search (search.py) with the same number of trials from the same seed, by the costs of criteria.py, on
flights of the sets `calibration-GRADE`, whose seeds are in no set that is compared. Each grade of flights is
tuned by itself: exact sensors and ideal actuators; actuators that lag; errors of sensors and air. What may be
tuned is `tunable` in plugins.yaml, or in the class of a plug-in. A method keeps the values that it starts
with unless the search finds some that cost `LEAST_GAIN` less. Each is tuned again on other draws (gain.py)
until that gains no more than `LEAST_GAIN`. Both rules are the same for ours and for rivals.

Two files are written: `tuned.json` has the values to fly with, and `tuning.json` how they were found.
"""

import json
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any

from beaver_ftc.diagnosis.rivals import (
    FLIGHT_GRADES,
    TUNED_FILE_KEY_BY_PLUGIN_GROUP,
    load_tuned_values,
    tuned_values,
)
from beaver_ftc.documents.errors import BadInput
from beaver_ftc.documents.files import read_json
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
from beaver_ftc.studies.compare.gain import gain_of
from beaver_ftc.studies.compare.search import Found, Values, search, value_at
from beaver_ftc.studies.compare.trial import STATISTICAL
from beaver_ftc.studies.engine.study import Progress, fly_all
from beaver_ftc.studies.present.tables import aligned

PROCEDURE = "beaver-ftc compare --tune; docs/results/benchmark.md"
LEAST_GAIN = 0.05
NAME, RECORD = "tuned.json", "tuning.json"
HEAD = ("grade", "method", "cost at the start", "cost found", "margins dB, deg")
GAIN_HEAD = ("cost, built in", "cost, retuned", "gain, %", "from, %", "to, %")
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
        shipped = tuned_values(load_tuned_values(), self.grade, self.group, self.name)
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


@dataclass(frozen=True)
class Search:
    """How to search. trials: of each search. restarts: searches after the first, at most. most: flights of
    each calibration sweep; None is all of them. draw: of the calibration sets; 0 chooses the values that
    ship, another number measures the gain over them. draws: so many from this one on, together."""

    trials: int
    seed: int
    restarts: int
    most: int | None = None
    draw: int = 0
    draws: int = 1


def tune(methods: Sequence[Method], how: Search, workers: int, progress: Progress | None) -> Document:
    """What both files say: the values of each grade, and a row a method."""
    if not methods:
        raise BadInput("compare --tune: nothing to tune, allowed: methods that declare `tunable`")
    rows = fly_all(partial(tune_method, how=how), methods, workers, progress)
    grades: Document = {}
    for method, row in zip(methods, rows, strict=True):
        of_kind = grades.setdefault(method.grade, {}).setdefault(
            TUNED_FILE_KEY_BY_PLUGIN_GROUP[method.group], {}
        )
        of_kind[method.name] = row["values"]
    said = {"procedure": PROCEDURE, **asdict(how)}
    del said["most"]  # which the numbers of flights in the rows say
    return said | {"grades": grades, "methods": rows}


def tune_method(method: Method, how: Search) -> Document:
    """A row: the values chosen, their cost, that of the values at the start, trials, ranges, flights of a
    trial, margins; on a draw that does not choose what ships, the gain of the values found, small or large.
    """
    on = method.grade, how.most, how.draw, how.draws
    cost = DetectorCost(method.name, flights(*on)) if method.group == DETECTORS else LawCost(method.name, *on)
    start = method.start()
    found = search(cost, method.ranges(), start, how.trials, how.seed, how.restarts)
    gains = found.cost < (1.0 - LEAST_GAIN) * found.start_cost
    values = found.values if gains else start
    row = {**_row(method, found), "values": values, "flights": len(flights(*on)), **_margins(cost, values)}
    if how.draw and min(found.cost, found.start_cost) < INADMISSIBLE:
        row |= gain_of(method.group, method.name, method.grade, (start, found.values), how.draw + how.draws)
    return row


def is_adopted(again: Document) -> bool:
    """Whether the values of a second tuning replace those that ship: its gain decides, not the interval."""
    return bool(again.get("gain", 0.0) > LEAST_GAIN)


def _row(method: Method, found: Found) -> Document:
    return {
        "grade": method.grade,
        "kind": TUNED_FILE_KEY_BY_PLUGIN_GROUP[method.group],
        "name": method.name,
        "start_cost": found.start_cost,
        "cost": found.cost,
        "found": found.values,
        "ranges": {key: asdict(of) for key, of in found.ranges.items()},
        "widened": list(found.widened),
        "trials": found.trials,
        "restarts": found.restarts,
        "settled": found.settled,
    }


def _margins(cost: DetectorCost | LawCost, values: Values) -> Document:
    if isinstance(cost, DetectorCost):
        return {}
    gain_db, phase_deg = least_margins(cost.margins(values))
    return {"gain_margin_db": gain_db, "phase_margin_deg": phase_deg}


def write_tuned(document: Document, folder: Path) -> Path:
    """Write the file that `compare --tuned` reads and, next to it, the record of the search."""
    folder.mkdir(parents=True, exist_ok=True)
    record = {key: value for key, value in document.items() if key != "grades"}
    for name, content in ((RECORD, record), (NAME, {"grades": document["grades"]})):
        (folder / name).write_text(json.dumps(content, indent=2) + "\n", encoding="utf-8")
    return folder / NAME


def read_tuned(path: Path) -> Document:
    """The values in a file that `compare --tune` wrote. Raises BadInput."""
    try:
        grades: Document = read_json(path)["grades"]
        assert set(grades) <= set(FLIGHT_GRADES)
        return grades
    except (OSError, ValueError, KeyError, TypeError, AssertionError) as error:
        raise BadInput(f"{path}: cannot be read, allowed: a file that compare --tune wrote") from error


def as_text(document: Document) -> str:
    """A line a method and grade; then where ranges were widened, and which searches the budget ended."""
    rows = [[*HEAD, *(GAIN_HEAD if document["draw"] else ()), "values"]]
    rows += [list(_cells(row, document["draw"])) for row in document["methods"]]
    said = [sentence for row in document["methods"] for sentence in _remarks(row)]
    head = f"up to {document['trials']} trials a search, seed {document['seed']}, "
    head += f"up to {document['restarts']} restarts for each method and grade"
    return "\n".join([head, "", aligned(rows), *said])


def _remarks(row: Document) -> Iterator[str]:
    who = f"{row['name']}, {row['grade']}"
    if row["widened"]:
        yield f"{who}: on the edge of its range, widened: {', '.join(row['widened'])}"
    if row["cost"] >= row["start_cost"]:
        yield f"{who}: no better values were found in {row['trials']} trials"
    if not row["settled"]:
        yield f"{who}: the budget ended the search; more --restarts may find a lower cost"


def _cells(row: Document, draw: int) -> Iterator[str]:
    yield row["grade"]
    yield row["name"]
    yield _cost(row["start_cost"])
    yield _cost(row["cost"])
    yield f"{row['gain_margin_db']:.1f}, {row['phase_margin_deg']:.0f}" if "gain_margin_db" in row else "-"
    yield from gain_cells(row) if draw else ()
    yield ", ".join(f"{key} {value:.4g}" for key, value in row["values"].items())


def gain_cells(row: Document) -> tuple[str, ...]:
    """Of a method that was tuned again: both costs on other flights, and the gain with its interval, %."""
    if "gain" not in row:
        return ("-",) * len(GAIN_HEAD)
    costs = (_cost(row[key]) for key in ("built_in", "retuned"))
    return *costs, *(f"{100.0 * row[key]:.1f}" for key in ("gain", "gain_low", "gain_high"))


def _cost(cost: float) -> str:
    return "cannot fly" if cost >= FAILED else "inadmissible" if cost >= INADMISSIBLE else f"{cost:.3f}"
