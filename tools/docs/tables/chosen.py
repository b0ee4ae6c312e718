"""Tables of docs/results/choices.md: constants chosen by flights, those flights, and those of the results."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from importlib import import_module
from math import exp
from pathlib import Path
from statistics import fmean
from typing import Any
from unittest.mock import patch

import numpy as np

from beaver_ftc.control.laws import loop_design
from beaver_ftc.diagnosis.rivals import FLIGHT_GRADES
from beaver_ftc.documents.document import parse
from beaver_ftc.plugins import LAWS
from beaver_ftc.studies.compare.criteria import LawCost, effort, flights, fly_entry, least_margins
from beaver_ftc.studies.compare.gain import geometric_mean, relative_gain
from beaver_ftc.studies.compare.sets import CALIBRATION, DRAW
from beaver_ftc.studies.compare.trial import LAW, SCHEME, Entry
from beaver_ftc.studies.present.page import Table
from beaver_ftc.studies.present.tables import markdown_table
from tools.docs.tables import aside, head_and_rows

Document = dict[str, Any]
FILE = Path(__file__).parents[1] / "chosen.yaml"
NOT_CHOSEN_FILE = FILE.with_name("not_chosen.yaml")
ORIGINS = ("derived", "stated", "search", "limit", "judged")
BENCHMARK = Path(__file__).parents[3] / "scenarios" / "benchmark"
TUNED_DRAWS = (*range(61), 80, 100, 200, 250)  # of the calibration sets, that tuned.json was chosen on
COMPARED = "compared"  # every set of the benchmark but those that rivals are tuned on
CONSTANTS = {
    "row": "row", "name": "name", "constant": "constant", "value": "value", "determines": "sets",
    "chosen by": lambda choice: f"`{choice['command']}`" if choice["command"] else "by hand",
    "file": lambda choice: f"`{choice['where']}`".replace(", ", "`, `"),
}  # fmt: skip
FLIGHTS = {
    "row": "row", "name": "name", "flights that chose the constant": "flights.says",
    "seeds of the choice": lambda choice: _said(choice["flights"]),
    "flights of the results": lambda choice: "{page}: {says}".format(**choice["results"]),
    "seeds of the results": lambda choice: _said(choice["results"]),
}  # fmt: skip


def chosen_asides() -> str:
    """How many groups of constants there are, and their tables as CSV."""
    rows = [{"row": number, **choice} for number, choice in enumerate(choices(), 1)]
    beside = "C2: flights that chose them, beside those of the results"
    links = [
        aside("chosen-constants", "C1: constants that flights chose, with the command of each",
              head_and_rows(rows, CONSTANTS)),
        aside("chosen-flights", beside, head_and_rows(rows, FLIGHTS)),
        aside("chosen-not", "C3: other constants of the diagnosis of logs, each with its origin", _others()),
    ]  # fmt: skip
    return f"{len(rows)} groups of constants were chosen by flights.\n\n" + "\n".join(links)


def _others() -> Table:
    """The other constants of the diagnosis of logs, each with its value in the code and its origin."""
    rows = [
        (f"`{name}`", _value_text(file, name), *origin.partition(": ")[::2], Path(file).name)
        for file, origins in not_chosen_constants().items()
        for name, origin in origins.items()
    ]
    return Table(("constant", "value", "origin", "reason", "file"), rows)


def _value_text(file: str, name: str) -> str:
    value = getattr(import_module(f"beaver_ftc_logs.{Path(file).stem}"), name)
    return ", ".join(f"{number:g}" for number in np.atleast_1d(value))


def not_chosen_constants() -> dict[str, dict[str, str]]:
    """By file: the name of each constant that no recorded choice has, and the origin of its value."""
    found: dict[str, dict[str, str]] = parse(NOT_CHOSEN_FILE.read_text(encoding="utf-8")).data
    return found


RATIOS, RATIO_DRAWS = (3.0, 4.5, 6.5, 9.0, 13.0, 20.0), (101, 102)


def chosen_ratio() -> str:
    """Error of the default law over the oracle's, by RATIO of its observer, on flights that chose nothing."""
    return _of_ratios(None)


def chosen_ratio_probe() -> str:
    """The same of one flight of each sweep."""
    return _of_ratios(1)


def _of_ratios(most: int | None) -> str:
    costs = {grade: [LawCost(LAW, grade, most, draw) for draw in RATIO_DRAWS] for grade in FLIGHT_GRADES}
    rows = [
        (f"{ratio:g}", *(f"{exp(fmean(_parts(of, ratio))):.2f}" for of in costs.values())) for ratio in RATIOS
    ]
    return markdown_table(("RATIO", *(f"`{grade}`" for grade in FLIGHT_GRADES)), rows)


BETTER_RATIO, BETTER_DRAWS = 9.0, (103, 104, 105, 106)
BETTER_HEAD = (
    "grade", "gain, %", "from, %", "to, %", "flights", "surface rate", "gain margin, dB", "phase margin, deg",
)  # fmt: skip


def chosen_ratio_gain() -> str:
    """What the default law gains by another RATIO, on draws that neither chose it nor are in the table above;
    how fast its surfaces then move, over how fast they do now; and its margins."""
    return markdown_table(BETTER_HEAD, [_of_better(grade, None) for grade in FLIGHT_GRADES])


def chosen_ratio_gain_probe() -> str:
    """The same of one flight of each sweep."""
    return markdown_table(BETTER_HEAD, [_of_better(grade, 1) for grade in FLIGHT_GRADES])


def _of_better(grade: str, most: int | None) -> tuple[str, ...]:
    """The row of a grade: by how much the other ratio tracks better, and what it costs."""
    ratios = loop_design.RATIO, BETTER_RATIO
    costs = [LawCost(LAW, grade, most, draw) for draw in BETTER_DRAWS]
    built_in, better = (np.array(_parts(costs, ratio)) for ratio in ratios)
    gain = relative_gain(built_in, better, geometric_mean)
    shares = (f"{100.0 * share:.1f}" for share in (gain.value, gain.low, gain.high))
    before, after = (_effort(grade, most, ratio) for ratio in ratios)
    with _observer_ratio(BETTER_RATIO):
        gain_db, phase_deg = least_margins(costs[0].margins({}))
    kept = f"{after / before:.2f}", f"{gain_db:.1f}", f"{phase_deg:.0f}"
    return f"`{grade}`", *shares, str(len(better)), *kept


def _parts(costs: list[LawCost], ratio: float) -> list[float]:
    """Logarithm of the law's error over the oracle's, which keeps its own RATIO, in each flight."""
    with _observer_ratio(ratio):
        return [part for cost in costs for part in cost.parts({})]


def _effort(grade: str, most: int | None, ratio: float) -> float:
    """RMS rate of all surfaces over the same flights, deg/s."""
    cases = [case for draw in BETTER_DRAWS for case in flights(grade, most, draw) if case.scenario.faults]
    with _observer_ratio(ratio):
        return effort([fly_entry(case, Entry(SCHEME, LAW), LAWS, {}) for case in cases])


@contextmanager
def _observer_ratio(ratio: float) -> Iterator[None]:
    """RATIO of the default law, for the flights inside."""
    try:
        with patch.object(loop_design, "RATIO", ratio):
            loop_design.candidates.cache_clear()
            yield
    finally:
        loop_design.candidates.cache_clear()


def choices() -> list[Document]:
    """Every constant that was chosen by flights."""
    found: list[Document] = parse(FILE.read_text(encoding="utf-8")).data
    return found


def draws_of(flights: Document) -> set[tuple[str, int]]:
    """Every (generator, seed) of some flights."""
    if "sets" in flights:
        seeds, draws = _of_sets(flights["sets"]), _given(flights.get("draws", [0]))
        return {("benchmark", seed + DRAW * draw) for seed in seeds for draw in draws}
    return {(flights["drawn_by"], seed) for seed in _given(flights.get("seeds", []))}


def _given(numbers: Sequence[int] | str) -> Sequence[int]:
    """Numbers of the file, or those that it names as MODULE:NAME."""
    if not isinstance(numbers, str):
        return numbers
    module, name = numbers.split(":")
    found: Sequence[int] = getattr(import_module(module), name)
    return found


def _of_sets(sets: list[str] | str) -> list[int]:
    """The seeds of the flights of these sets."""
    known = sorted(path.name for path in BENCHMARK.iterdir() if path.is_dir())
    if sets == COMPARED:
        sets = [name for name in known if not name.startswith(CALIBRATION)]
    files = (path for name in sets for path in sorted((BENCHMARK / name).glob("*.yaml")))
    return [int(parse(path.read_text(encoding="utf-8")).data["seed"]) for path in files]


def _said(flights: Document) -> str:
    """Seeds in order, runs of them shortened; of several draws of a set, those of its file."""
    seeds, runs = sorted(seed for _, seed in draws_of({**flights, "draws": [0]})), []
    for seed in seeds:
        if runs and seed == runs[-1][1] + 1:
            runs[-1][1] = seed
        else:
            runs.append([seed, seed])
    return ", ".join(str(a) if a == b else f"{a} to {b}" for a, b in runs) or "-"
