"""Tables of docs/results/choices.md: constants chosen by flights, those flights, and those of the results."""

from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from beaver_ftc.studies.compare.sets import CALIBRATION, DRAW
from beaver_ftc.studies.present.page import Table
from tools.data import yaml_of
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
    return yaml_of(NOT_CHOSEN_FILE)


def choices() -> list[Document]:
    """Every constant that was chosen by flights."""
    return yaml_of(FILE)


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
    return getattr(import_module(module), name)


def _of_sets(sets: list[str] | str) -> list[int]:
    """The seeds of the flights of these sets."""
    known = sorted(path.name for path in BENCHMARK.iterdir() if path.is_dir())
    if sets == COMPARED:
        sets = [name for name in known if not name.startswith(CALIBRATION)]
    files = (path for name in sets for path in sorted((BENCHMARK / name).glob("*.yaml")))
    return [int(yaml_of(path)["seed"]) for path in files]


def _said(flights: Document) -> str:
    """Seeds in order, runs of them shortened; of several draws of a set, those of its file."""
    seeds, runs = sorted(seed for _, seed in draws_of({**flights, "draws": [0]})), []
    for seed in seeds:
        if runs and seed == runs[-1][1] + 1:
            runs[-1][1] = seed
        else:
            runs.append([seed, seed])
    return ", ".join(str(a) if a == b else f"{a} to {b}" for a, b in runs) or "-"
