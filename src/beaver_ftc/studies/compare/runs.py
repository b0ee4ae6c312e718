"""Finished runs side by side, as `beaver-ftc compare RUN...` shows them."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from beaver_ftc.aircraft import AXES
from beaver_ftc.documents.errors import BadInput
from beaver_ftc.documents.report import one_line
from beaver_ftc.results.model import Document, Metrics, read_metrics
from beaver_ftc.results.style import BLACK
from beaver_ftc.studies.present.figures import Figure, panels
from beaver_ftc.studies.present.page import write_files
from beaver_ftc.studies.present.tables import aligned, number, values_of

NOTHING = "-"
STAR = "* differs between the runs"
_ALLOWED = "allowed: a result folder of beaver-ftc run"


@dataclass(frozen=True)
class Run:
    """A finished run. document, scenario: the contents of its metrics.json and scenario.yaml."""

    folder: Path
    document: Document
    scenario: Document

    @cached_property
    def metrics(self) -> Metrics:
        """The metrics, typed."""
        return Metrics.of(self.document)

    @property
    def entry(self) -> Document:
        """The run as `runs.json` has it."""
        return self.document | {"folder": str(self.folder), "flown": self.scenario}


def read_runs(folders: Sequence[Path]) -> list[Run]:
    """The runs in result folders. Raises BadInput with a line for each folder that is not the result of a
    run."""
    runs = []
    mistakes = []
    for folder in folders:
        try:
            runs.append(_read(folder))
        except OSError as error:
            mistakes.append(f"{folder}: holds no {Path(error.filename).name}, {_ALLOWED}")
        except (ValueError, KeyError, TypeError, AttributeError):
            mistakes.append(f"{folder}: metrics.json or scenario.yaml cannot be read, {_ALLOWED}")
    if mistakes:
        raise BadInput("\n".join(mistakes))
    return runs


def _read(folder: Path) -> Run:
    """The run in a result folder. Raises OSError if a file is missing, and ValueError, KeyError, TypeError or
    AttributeError if one has not the form that `rows_of` needs."""
    import yaml

    document = read_metrics(folder / "metrics.json")
    (folder / "log.parquet").stat()  # raises FileNotFoundError: the figure needs the log
    try:
        scenario = yaml.safe_load((folder / "scenario.yaml").read_text(encoding="utf-8"))
    except (yaml.YAMLError, RecursionError) as error:
        raise ValueError("no YAML") from error
    run = Run(folder, document, scenario)
    rows_of(run)  # a document that lacks a section is refused here
    return run


DIAGNOSED = {  # label of a row -> path in the metrics
    "detection delay, s": "detection.delay_s",
    "guaranteed delay, s": "detection.guaranteed_delay_s",
    "isolated": "isolation.fault",
    "isolation delay, s": "isolation.delay_s",
    "estimate": "isolation.estimate",
}


def rows_of(run: Run) -> dict[str, str]:
    """The rows of a run, label -> text: first the scenario, then the results."""
    metrics = run.metrics
    scenario = run.scenario
    departure = metrics.departure
    return {
        "scenario": metrics.scenario,
        "law": scenario["control"]["law"],
        "scheme": scenario["fdi"]["scheme"],
        "flight condition": "{airspeed_mps:g} m/s, {altitude_m:g} m".format(**scenario["initial"]),
        "seed": str(metrics.seed),
        "faults": "; ".join(map(fault_words, scenario.get("faults", []))) or NOTHING,
        **{label: number(metrics.at(path)) for label, path in DIAGNOSED.items()},
        "false alarm": "yes" if metrics.false_alarm else "no",
        **{
            f"{when} RMS {axis}, deg/s": number(metrics.at(f"tracking.{when}_fault_rms_deg_s.{axis}"))
            for when in ("pre", "post")
            for axis in AXES
        },
        "outside the envelope, s": number(metrics.envelope.outside_s),
        "departure": f"{departure.signal} at {departure.time_s:.2f} s" if departure else NOTHING,
        "passed": "yes" if metrics.passed else "no",
    }


def fault_words(fault: Document) -> str:
    """A fault as declared: surface, sensor or case of damage, type, sizes, begin and end."""
    sizes = [
        f"{key} {value:g}"
        for key, value in fault.items()
        if key not in ("at_s", "end_s") and isinstance(value, int | float) and not isinstance(value, bool)
    ]
    place = fault.get("actuator") or fault.get("sensor") or fault.get("case")
    end = "" if fault.get("end_s") is None else f"to {fault['end_s']:g} s"
    words = place, fault["type"].replace("_", " "), *sizes, f"at {fault['at_s']:g} s", end
    return " ".join(filter(None, words))


def as_text(runs: Sequence[Run]) -> str:
    """A table with a column for each run; a star marks the rows that differ."""
    columns = [rows_of(run) for run in runs]
    table = [["", *labels(runs)]]
    for name in columns[0]:
        values = values_of(columns, name)
        table.append([name + (" *" if len(set(values)) > 1 else ""), *values])
    return f"{aligned(table)}\n\n{STAR}"


def labels(runs: Sequence[Run]) -> list[str]:
    """The label of each run: the name of its folder, or of all runs the path if two names are the same."""
    names = [run.folder.resolve().name for run in runs]
    distinct = len(set(names)) == len(names)
    return [one_line(name, 200) for name in (names if distinct else [str(run.folder) for run in runs])]


def figure_of(runs: Sequence[Run]) -> Figure:
    """Tracking errors of all runs over time, a panel for each axis. A dotted line: the first fault of a run
    begins."""
    figure, grid = panels(3, 1, 11.0, 9.0, dpi=120, sharex=True)
    figure.suptitle(f"Tracking errors of {', '.join(labels(runs))}", fontsize=11, wrap=True)
    axes = grid[:, 0]
    for run, label in zip(runs, labels(runs), strict=True):
        _draw(axes, run.folder, label)
    begins_s = sorted({run.metrics.fault.at_s for run in runs if run.metrics.fault})
    for axis, letter in zip(axes, AXES, strict=True):
        for at_s in begins_s:
            axis.axvline(at_s, color=BLACK, linewidth=0.9, linestyle=":")
        axis.set_ylabel(f"{letter} tracking error, deg/s")
        axis.grid(alpha=0.3)
    for at_s in begins_s:
        axes[0].annotate(
            f"fault {at_s:g} s", (at_s, 1.0), xycoords=("data", "axes fraction"), xytext=(3, -10),
            textcoords="offset points", fontsize=8,
        )  # fmt: skip
    axes[0].legend(fontsize=8)
    axes[-1].set_xlabel("time, s")
    return figure


def write_runs(out: Path, folders: Sequence[Path]) -> list[Run]:
    """Write figure, JSON and report of finished runs into `out/runs/`; return the runs."""
    from beaver_ftc.results.folder import result_folder
    from beaver_ftc.results.metrics import as_json
    from beaver_ftc.results.report import write_report
    from beaver_ftc.studies.mismatch.tables import mismatch_section

    runs = read_runs(folders)
    with result_folder(out, "runs") as folder:
        documents = [run.entry for run in runs]
        write_files(folder, {"runs.png": figure_of(runs), "runs.json": as_json(documents)})
        write_report(folder / "runs.html", folders, labels(runs), [mismatch_section])
    return runs


def _draw(axes: Any, folder: Path, label: str) -> None:
    """The tracking errors of a run, fewer than 40 000 points of each curve."""
    import numpy as np

    from beaver_ftc.results.log import StoredLog

    names = ["t_s", *(f"{a}_{signal}_rad_s" for a in AXES for signal in ("model", "measured"))]
    log = StoredLog(folder / "log.parquet").read(names)
    step = max(1, len(log["t_s"]) // 20_000)
    for axis, letter in zip(axes, AXES, strict=True):
        error = np.degrees(log[f"{letter}_model_rad_s"] - log[f"{letter}_measured_rad_s"])
        axis.plot(log["t_s"][::step], error[::step], linewidth=1.0, label=label)
