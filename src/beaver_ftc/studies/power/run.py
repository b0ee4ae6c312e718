"""Fly the survey and keep it in a result folder."""

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from beaver_ftc.studies.compare.crew import spread
from beaver_ftc.studies.power.contenders import Contender
from beaver_ftc.studies.power.document import document_of
from beaver_ftc.studies.power.flying import Watched, fly_faulted, fly_healthy
from beaver_ftc.studies.power.grid import WITHIN_S, Bout, Grid
from beaver_ftc.studies.power.tally import Row
from beaver_ftc.studies.power.text import as_text

Document = dict[str, Any]
NAME = "power"


def run_power(
    out: Path,
    grid: Grid,
    schemes: Sequence[Contender],
    workers: int = 1,
    progress: Callable[[float], None] | None = None,
) -> Document:
    """Write `out/power/` (document, one row a flight and scheme, text, figures); return the document."""
    from beaver_ftc.results.metrics import as_json
    from beaver_ftc.results.writer import result_folder
    from beaver_ftc.studies.power.figure import write_figures

    with result_folder(out, NAME) as folder:
        healthy, faulted = fly(grid, schemes, workers, progress)
        document, rows = document_of(grid, healthy, faulted)
        (folder / f"{NAME}.json").write_text(as_json(document), encoding="utf-8")
        (folder / f"{NAME}.txt").write_text(as_text(document) + "\n", encoding="utf-8")
        write_rows(rows, folder / f"{NAME}.parquet")
        (folder / "figures").mkdir()
        list(write_figures(document, rows, folder / "figures"))
    return document


def fly(
    grid: Grid,
    schemes: Sequence[Contender],
    workers: int = 1,
    progress: Callable[[float], None] | None = None,
) -> tuple[list[Watched], list[Watched]]:
    """The healthy bouts and those with faults, in order whatever the number of workers."""
    bouts = [*((bout, False) for bout in grid.healthy()), *((bout, True) for bout in grid.faulted())]
    watched = spread(partial(_fly_one, grid=grid, schemes=tuple(schemes)), bouts, workers, progress)
    count = len(grid.healthy())
    return watched[:count], watched[count:]


def _fly_one(task: tuple[Bout, bool], grid: Grid, schemes: Sequence[Contender]) -> Watched:
    bout, faulted = task
    return (fly_faulted if faulted else fly_healthy)(bout, grid, schemes)


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
