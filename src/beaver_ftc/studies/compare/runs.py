"""Finished runs side by side: what `beaver-ftc compare RUN...` shows."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from beaver_ftc.errors import BadInput
from beaver_ftc.results.log import row_count
from beaver_ftc.results.verdict import facts
from beaver_ftc.scenario.problems import one_line
from beaver_ftc.studies.compare.table import aligned

Document = dict[str, Any]

_AXES = ("p", "q", "r")


def read_runs(folders: Sequence[Path]) -> list[Document]:
    """The metrics of result folders, each with its `folder`. Raises BadInput with a line a folder that is
    none."""
    runs, mistakes = [], []
    for folder in folders:
        try:
            runs.append(_read(folder))
        except BadInput as error:
            mistakes.append(str(error))
        except (OSError, ValueError, KeyError, TypeError) as error:
            mistakes.append(f"{folder}: {_why(error)}, allowed: a result folder of beaver-ftc run")
    if mistakes:
        raise BadInput("\n".join(mistakes))
    return runs


def _why(error: Exception) -> str:
    if isinstance(error, OSError):
        return f"holds no {Path(error.filename).name}"
    return "holds a metrics.json that cannot be read"


def _read(folder: Path) -> Document:
    document = json.loads((folder / "metrics.json").read_text(encoding="utf-8"))
    (folder / "scenario.yaml").stat()
    row_count(folder / "log.parquet")
    rows_of(document)  # a document that lacks a key is refused here
    facts(document)
    return document | {"folder": str(folder)}


def rows_of(run: Document) -> dict[str, str]:
    """What is compared of a run, name -> text."""
    detection, isolation, tracking = run["detection"], run["isolation"], run["tracking"]
    fault, departure = run["fault"], run["departure"]
    return {
        "scenario": run["scenario"],
        "fault": _fault(fault),
        "detection delay, s": _number(detection["delay_s"]),
        "guaranteed delay, s": _number(detection["guaranteed_delay_s"]),
        "isolated": isolation["fault"] or "-",
        "isolation delay, s": _number(isolation["delay_s"]),
        "estimate": _number(isolation["estimate"]),
        "false alarm": "yes" if run["false_alarm"] else "no",
        **{
            f"{when} RMS {axis}, deg/s": _number((tracking[f"{when}_fault_rms_deg_s"] or {}).get(axis))
            for when in ("pre", "post")
            for axis in _AXES
        },
        "departure": f"{departure['signal']} at {departure['time_s']:.2f} s" if departure else "-",
        "passed": "yes" if run["passed"] else "no",
    }


def _fault(fault: Document | None) -> str:
    return " ".join(filter(None, (fault["actuator"], fault["type"]))) if fault else "-"


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.4g}"


def as_text(runs: Sequence[Document]) -> str:
    """A column a run; what differs between them is marked with a star."""
    columns = [rows_of(run) for run in runs]
    names = list(columns[0])
    table = [["", *labels(runs)]]
    for name in names:
        values = [column[name] for column in columns]
        table.append([name + (" *" if len(set(values)) > 1 else ""), *values])
    return aligned(table)


def labels(runs: Sequence[Document]) -> list[str]:
    """What to call each run: its folder's name, or the whole path where names repeat."""
    names = [Path(run["folder"]).resolve().name for run in runs]
    distinct = len(set(names)) == len(names)
    return [one_line(name, 200) for name in (names if distinct else [run["folder"] for run in runs])]


def write_figure(runs: Sequence[Document], path: Path) -> None:
    """Rates and tracking errors of all runs over time, one above the other, into a PNG."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11.0, 9.0), layout="constrained")
    axes = figure.subplots(3, 1, sharex=True)
    for run, label in zip(runs, labels(runs), strict=True):
        _draw(axes, Path(run["folder"]), label)
    for axis, letter in zip(axes, _AXES, strict=True):
        axis.set_ylabel(f"{letter} tracking error, deg/s")
        axis.grid(alpha=0.3)
    axes[0].legend(fontsize=8)
    axes[-1].set_xlabel("time, s")
    figure.savefig(path, dpi=120)


def _draw(axes: Any, folder: Path, label: str) -> None:
    import numpy as np

    from beaver_ftc.results.log import read

    names = ["t_s", *(f"{a}_{what}_rad_s" for a in _AXES for what in ("model", "measured"))]
    log = read(folder / "log.parquet", names)
    every = max(1, len(log["t_s"]) // 20_000)
    for axis, letter in zip(axes, _AXES, strict=True):
        error = np.degrees(log[f"{letter}_model_rad_s"] - log[f"{letter}_measured_rad_s"])
        axis.plot(log["t_s"][::every], error[::every], linewidth=1.0, label=label)
