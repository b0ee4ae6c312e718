"""Fly a comparison and keep it in a result folder."""

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

from beaver_ftc.results.metrics import as_json
from beaver_ftc.studies.compare.document import document_of
from beaver_ftc.studies.compare.figure import figure_of
from beaver_ftc.studies.compare.flights import Case
from beaver_ftc.studies.compare.page import page_of
from beaver_ftc.studies.compare.trial import Entry, Trial, fly_case
from beaver_ftc.studies.engine.study import Progress, Study, run_study
from beaver_ftc.studies.present.files import Files

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
    study = Study(
        name, cases, partial(fly_case, entries=tuple(entries)), partial(document_of, entries=entries),
        partial(files_of, name=name), row=Trial, follows_from=entries, lost=lost,
    )  # fmt: skip
    return run_study(study, out, workers, progress)


def files_of(document: Document, name: str) -> Files:
    """Document, figure and page."""
    return {
        "comparison.json": as_json(document),
        "comparison.png": figure_of(document),
        "comparison.html": partial(page_of, document, f"Comparison: {name}"),
    }


def lost(case: Any, why: str) -> Trial:
    """What becomes of a case that ends its process: no results, and why."""
    return Trial(case.what.set, failures=[f"{case.what.scenario.name}: {why}"])
