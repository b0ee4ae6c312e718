"""Several flights side by side: variants of a design, or different scenarios."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from beaver_ftc.results.looks import BLACK, BLUE, GREY, VERMILION
from beaver_ftc.studies.mismatch.document import Document, write_csv
from beaver_ftc.studies.mismatch.figures import AXIS_NAMES, largest_sources, new_figure, save
from beaver_ftc.studies.mismatch.states import AXES
from beaver_ftc.studies.mismatch.words import label, percent

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COMPARISON = "mismatch-comparison"


def entry(found: Document) -> Document:
    """One flight's line of the comparison."""
    bounds = found["bound"]
    return {
        "scenario": found["scenario"],
        **{f"{axis}_worst_ratio": bounds[axis]["worst_ratio"] for axis in AXES},
        **{f"{axis}_smallest_constant_rad_s2": bounds[axis]["smallest_constant_rad_s2"] for axis in AXES},
        **{f"{axis}_exceeded_s": bounds[axis]["exceeded_s"] for axis in AXES},
        **{f"{axis}_dominant": largest_sources(found, axis)[0] for axis in AXES},
        "dominant": found["dominant"]["source"] if found["dominant"] else None,
        "false_alarm": found["false_alarm"],
        "guarantee_void": found["guarantee"]["recommended"]["false_alarm"],
        "guaranteed_delay_s": found["guarantee"]["recommended"]["guaranteed_delay_s"],
    }


def write_comparison(out: Path, entries: list[Document], recommended: Document, report: bool) -> Path:
    """Write `out/mismatch-comparison/`: the table as JSON and CSV, and a figure. Whole or not at all."""
    from beaver_ftc.results.metrics import as_json
    from beaver_ftc.results.writer import result_folder

    with result_folder(out, COMPARISON) as folder:
        (folder / "mismatch.json").write_text(as_json({"runs": entries} | recommended), encoding="utf-8")
        write_csv(folder / "mismatch.csv", entries)
        if report:
            (folder / "figures").mkdir()
            save(comparison_figure(entries), folder / "figures" / f"{COMPARISON}.png")
    return out / COMPARISON


def comparison_figure(entries: Sequence[Document]) -> "Figure":
    """How much of the bound each flight has needed, per axis, on a logarithmic scale."""
    figure = new_figure(
        12.0, 1.6 + 0.38 * max(len(entries), 2), "Mismatch at its worst, faults aside, over the bound"
    )
    grid = figure.subplots(1, 3, sharey=True, sharex=True)
    ratios = np.array([[_ratio(each, axis) for each in entries] for axis in AXES])
    for axis, axes, row in zip(AXES, grid, ratios, strict=True):
        _draw(axes, AXIS_NAMES[axis], row, [each[f"{axis}_dominant"] for each in entries])
        axes.set_xlim(min(0.1, 0.5 * ratios.min()), 60.0 * max(ratios.max(), 1.0))
    grid[0].set_yticks(range(len(entries)), [each["scenario"] for each in entries], fontsize=9)
    grid[0].invert_yaxis()
    return figure


def _ratio(of: Document, axis: str) -> float:
    ratio = of[f"{axis}_worst_ratio"]
    return 1e6 if ratio is None else max(ratio, 1e-6)


def _draw(axes: "Axes", title: str, ratios: np.ndarray, reasons: list[str]) -> None:
    colours = [VERMILION if ratio > 1.0 else BLUE for ratio in ratios]
    axes.barh(range(len(ratios)), ratios, color=colours, height=0.7)
    for row, (ratio, reason) in enumerate(zip(ratios, reasons, strict=True)):
        axes.annotate(f" {percent(float(ratio))} ({label(reason)})", (ratio, row), va="center", fontsize=7)
    axes.axvline(1.0, color=BLACK, linewidth=1.0, dashes=(4, 2))
    axes.set_xscale("log")
    axes.set_title(title, fontsize=10)
    axes.set_xlabel("largest mismatch / eta_bar", fontsize=9)
    axes.tick_params(labelsize=8)
    axes.grid(axis="x", color=GREY, alpha=0.3, linewidth=0.5)
