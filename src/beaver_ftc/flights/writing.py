"""The files of one diagnosed flight: diagnosis.parquet, verdict.json and report.html."""

from pathlib import Path
from typing import Any

from beaver_ftc.flights.diagnose import Rows
from beaver_ftc.flights.model import Model
from beaver_ftc.flights.report import render
from beaver_ftc.flights.samples import Samples


def write_diagnosis(out: Path, samples: Samples, model: Model, rows: Rows, verdict: dict[str, Any]) -> Path:
    """Write the folder `out/<flight>` whole or not at all; returns it."""
    from beaver_ftc.results.metrics import as_json
    from beaver_ftc.results.writer import result_folder

    with result_folder(out, samples.name) as folder:
        write_rows(folder / "diagnosis.parquet", rows, list(model.vehicle.surfaces))
        (folder / "verdict.json").write_text(as_json(verdict), encoding="utf-8")
        (folder / "report.html").write_text(render(samples, model, rows, verdict), encoding="utf-8")
    return out / samples.name


def write_rows(path: Path, rows: Rows, surfaces: list[str]) -> None:
    """A row a sample: t_s, faulty, named, and for each surface its effectiveness with bounds."""
    import pyarrow as pa
    from pyarrow import parquet

    columns: dict[str, Any] = {"t_s": rows.t_s, "faulty": rows.faulty, "named": rows.named.tolist()}
    for i, surface in enumerate(surfaces):
        columns[f"{surface}_effectiveness"] = rows.estimate[:, i]
        columns[f"{surface}_low"] = rows.low[:, i]
        columns[f"{surface}_high"] = rows.high[:, i]
    columns["fault_probability"] = rows.probability
    parquet.write_table(pa.table(columns), path)
