"""Fly the matrix and keep it in a result folder."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from beaver_ftc.studies.compare.crew import spread
from beaver_ftc.studies.matrix.cases import AIRSPEEDS_MPS, cases
from beaver_ftc.studies.matrix.flying import fly_case
from beaver_ftc.studies.matrix.summary import document_of
from beaver_ftc.studies.matrix.text import as_text

Document = dict[str, Any]
NAME, DECLARED = "fault-matrix", "fault-matrix-declared"


def run_matrix(
    out: Path,
    airspeeds_mps: tuple[float, ...] = AIRSPEEDS_MPS,
    workers: int = 1,
    progress: Callable[[float], None] | None = None,
    name: str = NAME,
) -> Document:
    """Write `out/fault-matrix/` (table, JSON, heat map), or that of `name`; return the document."""
    from beaver_ftc.results.metrics import as_json
    from beaver_ftc.results.writer import result_folder
    from beaver_ftc.studies.matrix.figure import write_heat_map

    with result_folder(out, name) as folder:
        flown = spread(fly_case, cases(airspeeds_mps, declared=name == DECLARED), workers, progress)
        document = document_of(flown)
        (folder / f"{NAME}.json").write_text(as_json(document), encoding="utf-8")
        (folder / f"{NAME}.txt").write_text(as_text(document) + "\n", encoding="utf-8")
        write_heat_map(document, folder / f"{NAME}.png")
    return document
