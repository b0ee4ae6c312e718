"""Fly the survey and keep it in a result folder."""

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

from beaver_ftc.studies.engine.study import Progress, flown
from beaver_ftc.studies.power.contenders import Contender
from beaver_ftc.studies.power.document import document_of
from beaver_ftc.studies.power.flying import Watched, fly_faulted, fly_healthy
from beaver_ftc.studies.power.grid import WITHIN_S, Bout, Grid
from beaver_ftc.studies.power.tally import Row
from beaver_ftc.studies.power.text import as_text

Document = dict[str, Any]
NAME = "power"


def run_power(
    out: Path, grid: Grid, schemes: Sequence[Contender], workers: int = 1, progress: Progress | None = None
) -> Document:
    """Write `out/power/` (document, one row a flight and scheme, text, figures); return the document."""
    from beaver_ftc.results.metrics import as_json
    from beaver_ftc.results.writer import result_folder
    from beaver_ftc.studies.power.figure import write_figures

    schemes = tuple(schemes)
    bouts = [*((bout, False) for bout in grid.healthy()), *((bout, True) for bout in grid.faulted())]
    work, count = partial(_fly_one, grid=grid, schemes=schemes), len(grid.healthy())
    asked = grid, schemes
    study = flown(
        out / NAME, bouts, work, Watched, follows_from=asked, workers=workers, progress=progress, lost=_lost
    )
    with study as watched, result_folder(out, NAME) as folder:
        document, rows = document_of(grid, watched[:count], watched[count:])
        (folder / f"{NAME}.json").write_text(as_json(document), encoding="utf-8")
        (folder / f"{NAME}.txt").write_text(as_text(document) + "\n", encoding="utf-8")
        write_rows(rows, folder / f"{NAME}.parquet")
        (folder / "figures").mkdir()
        list(write_figures(document, rows, folder / "figures"))
    return document


def _fly_one(task: tuple[Bout, bool], grid: Grid, schemes: Sequence[Contender]) -> Watched:
    bout, faulted = task
    return (fly_faulted if faulted else fly_healthy)(bout, grid, schemes)


def _lost(case: Any, why: str) -> Watched:
    """A bout that ends its process: nothing was watched, and why."""
    bout = case.what[0]
    return Watched(bout, failures=[f"{' '.join(bout.condition)}, seed {bout.seed}: {why}"])


def write_rows(rows: Sequence[Row], path: Path) -> None:
    """One row a flight and scheme."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    text, number, flag = pa.string(), pa.float64(), pa.bool_()
    columns = {
        "sensors": text, "turbulence": text, "excitation_deg_s": number, "seed": pa.int64(),
        "surface": text, "magnitude": number, "scheme": text,
        "false_alarm": flag, "delay_s": number, "own_false_alarm": flag, "own_delay_s": number,
        **{f"deflection_{within_s:g}": number for within_s in WITHIN_S},
    }  # fmt: skip
    pq.write_table(pa.Table.from_pylist(list(rows), schema=pa.schema(columns)), path)
