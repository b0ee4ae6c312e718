"""Fly the matrix and keep it in a result folder."""

from pathlib import Path
from typing import Any

from beaver_ftc.aircraft import DEFAULT
from beaver_ftc.studies.engine.flown import Progress, flown
from beaver_ftc.studies.matrix.cases import airspeeds_of, cases
from beaver_ftc.studies.matrix.flying import fly_case
from beaver_ftc.studies.matrix.summary import document_of
from beaver_ftc.studies.matrix.text import as_text

Document = dict[str, Any]
NAME, DECLARED = "fault-matrix", "fault-matrix-declared"


def name_of(declared: bool, turbulence: str) -> str:
    """The result folder's name of the matrix, with errors or without, in such air."""
    name = DECLARED if declared else NAME
    return name if turbulence == "none" else f"{name}-{turbulence}"


def run_matrix(
    out: Path,
    airspeeds_mps: tuple[float, ...] | None = None,
    workers: int = 1,
    progress: Progress | None = None,
    declared: bool = False,
    aircraft: str = DEFAULT,
    turbulence: str = "none",
) -> Document:
    """Write table, JSON and heat map into the folder that `name_of` says, in `out`; return the document."""
    from beaver_ftc.results.metrics import as_json
    from beaver_ftc.results.writer import result_folder
    from beaver_ftc.studies.matrix.figure import write_heat_map

    airspeeds_mps = airspeeds_mps or airspeeds_of(aircraft)
    name = name_of(declared, turbulence)
    all_cases = cases(airspeeds_mps, declared, aircraft, turbulence)
    fly = flown(out / name, all_cases, fly_case, workers=workers, progress=progress)
    with fly as rows, result_folder(out, name) as folder:
        document = document_of(rows)
        (folder / f"{NAME}.json").write_text(as_json(document), encoding="utf-8")
        (folder / f"{NAME}.txt").write_text(as_text(document) + "\n", encoding="utf-8")
        write_heat_map(document, folder / f"{NAME}.png")
    return document
