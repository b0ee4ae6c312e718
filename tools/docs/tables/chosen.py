"""The table of docs/results/choices.md: the constants chosen by flights, those flights, and the claims."""

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
HEAD = ("constant", "file", "chosen by", "chosen on", "seeds of these", "results", "seeds of the results")


def chosen() -> str:
    """A row a choice."""
    return markdown_table(HEAD, [_row(choice) for choice in choices()])


def choices() -> list[Document]:
    """Every constant that was chosen by flights."""
    found: list[Document] = parse(FILE.read_text(encoding="utf-8")).data
    return found


def _row(choice: Document) -> tuple[str, ...]:
    flights, claims = choice["flights"], choice["claims"]
    command = f"`{choice['command']}`" if choice["command"] else "by hand"
    return (
        choice["what"], f"`{choice['where']}`", command, flights["says"], _said(flights),
        claims["says"], _said(claims),
    )  # fmt: skip


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
