"""`beaver-ftc compare --tune`: one procedure that chooses the parameters of every detector and law.

All methods, ours and rivals, have the same search (search.py) with the same number of trials and the same
seed, and the costs of criteria.py. They are tuned on the sets `calibration-GRADE`, whose seeds are in no set
that is compared. Each grade of flights is tuned separately: exact sensors and ideal actuators; actuators that
lag; errors of sensors and air. The key `tunable` in plugins.yaml, or in the class of a plug-in, names the
parameters; those of our statistical detector are OF_STATISTICAL. A method keeps the values with which it
starts unless the search finds values that cost `LEAST_GAIN` less.

With `Search.draw`, a method is tuned on other draws, and its row has the gain (gain.py). The record of the
values that ship, benchmarks/tuning.json, lists the gains of these later searches as `again`.

Two files are written: `tuned.json` has the values to fly with, `tuning.json` the record of the searches.
"""

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import partial
from operator import attrgetter
from pathlib import Path

from pydantic import TypeAdapter

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
from beaver_ftc.studies.compare.criteria import INADMISSIBLE, DetectorCost, LawCost, flights, least_margins
from beaver_ftc.studies.compare.gain import gain_of
from beaver_ftc.studies.compare.search import Values, search, value_at
from beaver_ftc.studies.compare.trial import STATISTICAL
from beaver_ftc.studies.engine.study import Progress, fly_all

PROCEDURE = "beaver-ftc compare --tune; docs/results/benchmark.md"
LEAST_GAIN = 0.05  # share of the cost at the start
NAME = "tuned.json"
RECORD = "tuning.json"
_GRADES = TypeAdapter(dict[str, dict[str, dict[str, dict[str, float]]]])  # by grade, kind and method
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
        """The range of each parameter that may be tuned."""
        return OF_STATISTICAL if self.name == STATISTICAL else tunable(self.group, self.name)

    def start(self) -> Values:
        """The values with which the search starts: the shipped ones, or else the defaults, or else the middle
        of the ranges."""
        shipped = tuned_values(load_tuned_values(), self.grade, self.group, self.name)
        return {key: shipped.get(key, self._default(key, range_)) for key, range_ in self.ranges().items()}

    def _default(self, key: str, range_: Range) -> float:
        """The default of a parameter; of a plug-in without defaults the middle of the range."""
        if "." in key:  # a key of the scenario, whose `fdi.statistical` must exist to have defaults
            return float(attrgetter(key)(Scenario(name="defaults", fdi={"statistical": {}})))
        if is_compiled(self.group, self.name):
            return float(options_of(self.group, self.name)[key]["default"])
        defaults = getattr(plugin_class(self.group, self.name), "defaults", {})
        return float(defaults.get(key, value_at(range_, 0.5)))


def methods_of(schemes: Sequence[str], laws: Sequence[str], grades: Sequence[str]) -> list[Method]:
    """The methods with tunable parameters, on each grade."""
    group_and_name = [(DETECTORS, name) for name in schemes] + [(LAWS, name) for name in laws]
    methods = [Method(group, name, grade) for grade in grades for group, name in group_and_name]
    return [method for method in methods if method.ranges()]


@dataclass(frozen=True)
class Search:
    """How to search.

    - trials: of each search. restarts: largest number of searches after the first.
    - most: flights of each calibration sweep; None is all.
    - draw: first draw of the calibration sets. 0 chooses the values that ship; another number measures the
      gain over them. draws: number of draws, which are flown together.
    """

    trials: int
    seed: int
    restarts: int
    most: int | None = None
    draw: int = 0
    draws: int = 1


def tune(methods: Sequence[Method], how: Search, workers: int, progress: Progress | None) -> Document:
    """The content of both files: the values of each grade, and a row for each method."""
    if not methods:
        raise BadInput("compare --tune: nothing to tune, allowed: methods that declare `tunable`")
    rows = fly_all(partial(tune_method, how=how), methods, workers, progress)
    grades: Document = {}
    for row in rows:
        grades.setdefault(row["grade"], {}).setdefault(row["kind"], {})[row["name"]] = row["values"]
    return {
        "procedure": PROCEDURE,
        "trials": how.trials,
        "seed": how.seed,
        "restarts": how.restarts,
        "draw": how.draw,
        "draws": how.draws,
        "grades": grades,
        "methods": rows,
    }


def tune_method(method: Method, how: Search) -> Document:
    """The row of a method: the chosen values, the fields of `Found` (search.py), the number of flights of the
    set, of which a law flies those with a fault, and the margins of a law.

    On another draw than 0, the row also has the gain of the values found, with the fields of `gain_of`,
    unless neither these nor the start are admissible. `flights` is then the number of flights on which both
    settings are compared.
    """
    flown_on = method.grade, how.most, how.draw, how.draws
    cases = flights(*flown_on)
    is_law = method.group == LAWS
    cost = LawCost(method.name, *flown_on) if is_law else DetectorCost(method.name, cases)
    start = method.start()
    result = search(cost, method.ranges(), start, how.trials, how.seed, how.restarts)
    gains = result.cost < (1.0 - LEAST_GAIN) * result.start_cost
    values = result.found if gains else start
    row: Document = {
        "grade": method.grade,
        "kind": TUNED_FILE_KEY_BY_PLUGIN_GROUP[method.group],
        "name": method.name,
        **asdict(result),
        "values": values,
        "flights": len(cases),
    }
    if isinstance(cost, LawCost):
        row["gain_margin_db"], row["phase_margin_deg"] = least_margins(cost.margins(values))
    if how.draw and min(result.cost, result.start_cost) < INADMISSIBLE:
        row |= gain_of(method.group, method.name, method.grade, (start, result.found), how.draw + how.draws)
    return row


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
        grades = _GRADES.validate_python(read_json(path)["grades"], strict=True)
        kinds = set().union(*grades.values())
        if set(grades) - set(FLIGHT_GRADES) or kinds - set(TUNED_FILE_KEY_BY_PLUGIN_GROUP.values()):
            raise ValueError("a grade or a kind that is not known")
        return dict(grades)
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise BadInput(f"{path}: cannot be read, allowed: a file that compare --tune wrote") from error
