"""Fly a comparison and keep it in a result folder."""

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

from beaver_ftc.studies.compare.document import document_of
from beaver_ftc.studies.compare.flights import Case
from beaver_ftc.studies.compare.trial import Entry, Trial, fly_case
from beaver_ftc.studies.engine.flown import Progress, flown

Document = dict[str, Any]


def run_comparison(
    out: Path,
    name: str,
    cases: Sequence[Case],
    entries: Sequence[Entry],
    workers: int = 1,
    progress: Progress | None = None,
) -> Document:
    """Write `out/<name>/` (document, figure, page) of every case with every entry; return the document."""
    from beaver_ftc.results.metrics import as_json
    from beaver_ftc.results.writer import result_folder
    from beaver_ftc.studies.compare.figure import write_figure
    from beaver_ftc.studies.compare.page import write_page

    work = partial(fly_case, entries=tuple(entries))
    fly = flown(out / name, cases, work, Trial, asked=entries, workers=workers, progress=progress, lost=lost)
    with fly as trials, result_folder(out, name) as folder:
        document = document_of(trials, entries)
        (folder / "comparison.json").write_text(as_json(document), encoding="utf-8")
        write_figure(document, folder / "comparison.png")
        write_page(document, folder / "comparison.png", folder / "comparison.html", f"Comparison: {name}")
    return document


def lost(case: Any, why: str) -> Trial:
    """What becomes of a case that ends its process: no results, and why."""
    return Trial(case.what.set, failures=[f"{case.what.scenario.name}: {why}"])
