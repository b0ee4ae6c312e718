"""Tables of docs/results/choices.md: constants chosen by flights, those flights, and those of the results."""

from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

from beaver_ftc.documents.document import parse
from beaver_ftc.studies.compare.trial import CALIBRATION
from beaver_ftc.studies.present.tables import markdown_table

Document = dict[str, Any]
FILE = Path(__file__).parents[1] / "chosen.yaml"
BENCHMARK = Path(__file__).parents[3] / "scenarios" / "benchmark"
COMPARED = "compared"  # every set of the benchmark but those that rivals are tuned on
CONSTANT_HEAD = ("row", "constant", "sets", "file", "chosen by")
FLIGHT_HEAD = ("row", "flights that chose the constant", "their seeds")
RESULT_HEAD = ("row", "page", "flights of the results", "their seeds")


def chosen_constants() -> str:
    """The constants, in rows with a number."""
    return _table(CONSTANT_HEAD, lambda choice: (choice["constant"], choice["sets"], *_where(choice)))


def chosen_flights() -> str:
    """Of each row, the flights that chose the constant."""
    return _table(FLIGHT_HEAD, lambda choice: (choice["flights"]["says"], _said(choice["flights"])))


def chosen_results() -> str:
    """Of each row, the results that depend on the constant, and their flights."""
    return _table(RESULT_HEAD, lambda choice: _result(choice["results"]))


def _table(head: tuple[str, ...], cells: Callable[[Document], tuple[str, ...]]) -> str:
    return markdown_table(head, [(str(row), *cells(choice)) for row, choice in enumerate(choices(), 1)])


def _where(choice: Document) -> tuple[str, str]:
    return f"`{choice['where']}`", f"`{choice['command']}`" if choice["command"] else "by hand"


def _result(results: Document) -> tuple[str, str, str]:
    return results["page"], results["says"], _said(results)


def choices() -> list[Document]:
    """Every constant that was chosen by flights."""
    found: list[Document] = parse(FILE.read_text(encoding="utf-8")).data
    return found


def draws_of(flights: Document) -> set[tuple[str, int]]:
    """Every (generator, seed) of some flights."""
    if "sets" in flights:
        return {("benchmark", seed) for seed in _of_sets(flights["sets"])}
    seeds = flights.get("seeds", [])
    if isinstance(seeds, str):
        module, name = seeds.split(":")
        seeds = getattr(import_module(module), name)
    return {(flights["drawn_by"], seed) for seed in seeds}


def _of_sets(sets: list[str] | str) -> list[int]:
    known = sorted(path.name for path in BENCHMARK.iterdir() if path.is_dir())
    if sets == COMPARED:
        sets = [name for name in known if not name.startswith(CALIBRATION)]
    files = (path for name in sets for path in sorted((BENCHMARK / name).glob("*.yaml")))
    return [int(parse(path.read_text(encoding="utf-8")).data["seed"]) for path in files]


def _said(flights: Document) -> str:
    """Seeds in order, runs of them shortened."""
    seeds, runs = sorted(seed for _, seed in draws_of(flights)), []
    for seed in seeds:
        if runs and seed == runs[-1][1] + 1:
            runs[-1][1] = seed
        else:
            runs.append([seed, seed])
    return ", ".join(str(a) if a == b else f"{a} to {b}" for a, b in runs) or "-"
