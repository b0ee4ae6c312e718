"""The figures of a sweep as PNG, drawn with matplotlib without its global state.

Each function takes the flights and returns a figure, or None where the flights hold nothing of that kind.
"""

import re
from collections.abc import Callable, Iterator
from itertools import cycle
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from beaver_ftc.results.model import Document
from beaver_ftc.results.style import BLACK, BLUE, GREEN, GREY, ORANGE, PURPLE, SKY
from beaver_ftc.studies.engine.statistics import wilson
from beaver_ftc.studies.present.figures import GRID, heat_map, new_figure
from beaver_ftc.studies.present.page import save
from beaver_ftc.studies.sweep.outcomes import Flights
from beaver_ftc.studies.sweep.summary import OUTCOMES

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


Drawer = Callable[[Flights, Document], "Figure | None"]

BINS = 16
LEAST_A_BIN = 10
_SEARCHED = {
    "delay": "detection delay (s)",
    "false_alarm": "residual / threshold without a fault",
    "tracking": "RMS tracking error after the fault (deg/s)",
}
_UNITS = {  # the longest ending first
    "_rad_s": "rad/s", "_deg_s": "deg/s", "_deg": "deg", "_rad": "rad", "_mps": "m/s", "_hz": "Hz",
    "_m": "m", "_s": "s",
}  # fmt: skip
_FAULT_LOOKS = (
    (BLUE, "o", "-"),
    (ORANGE, "s", "--"),
    (GREEN, "^", "-."),
    (PURPLE, "D", ":"),
    (SKY, "v", "-"),
)


def write_figures(flights: Flights, summary: Document, folder: Path) -> list[Path]:
    """Draw what there is to draw as `<figure>.png`; return the files."""
    folder.mkdir(exist_ok=True)
    for name in FIGURES:
        (folder / f"{name}.png").unlink(missing_ok=True)
    drawn = [(name, draw(flights, summary)) for name, (_, draw) in FIGURES.items()]
    return [save(figure, folder / f"{name}.png") for name, figure in drawn if figure is not None]


def _axes(
    title: str, x: str = "", y: str = "", size: tuple[float, float] = (8.0, 4.6)
) -> tuple["Figure", "Axes"]:
    figure = new_figure(*size)
    axes = figure.subplots()
    axes.set_title(title, fontsize=10)
    axes.set_xlabel(x, fontsize=9)
    axes.set_ylabel(y, fontsize=9)
    axes.tick_params(labelsize=8)
    axes.grid(color=GRID, linewidth=0.6)
    axes.set_axisbelow(True)
    return figure, axes


def in_words(key: str) -> str:
    """A varied key for people: `faults[0].at_s` is `fault 1: at (s)`."""
    said = re.sub(r"faults\[(\d+)\]", lambda found: f"fault {int(found[1]) + 1}", key)
    ending = next((ending for ending in _UNITS if said.endswith(ending)), "")
    name = said.removesuffix(ending).replace(".", ": ").replace("_", " ")
    return f"{name} ({_UNITS[ending]})" if ending else name


def _log_of_numbers(axes: "Axes") -> None:
    """A logarithmic axis whose ticks are plain numbers."""
    axes.set_xscale("log")
    axes.xaxis.set_major_formatter("{x:g}")


def magnitude_key(flights: Flights, summary: Document) -> str | None:
    """How large the fault is: of the varied numbers of a fault, the one that delays hang on most."""
    ranked = [entry["key"] for entry in summary["sensitivity"]["detection_delay"]]
    numbers = [key for key in (ranked or flights.vary) if flights.is_number(key)]
    of_faults = [key for key in numbers if key.startswith("faults[") and not key.endswith(("at_s", "end_s"))]
    return next(iter(of_faults or numbers), None)


def detection_probability(flights: Flights, summary: Document) -> "Figure | None":
    """Share detected against the fault's magnitude, a curve a fault, with Wilson intervals."""
    key = magnitude_key(flights, summary)
    if key is None or not flights.faulted.any():
        return None
    figure, axes = _axes("Detection probability (bars: 95 % intervals)", in_words(key), "share detected")
    for (colour, marker, dash), label, group in _faults(flights):
        values, hits = flights[key][group], flights.detected[group]
        bins = _levels(values) if flights.vary[key].count else _bins(values)
        found = [wilson(int(hits[bin].sum()), bin.size) for bin in bins]
        shares = np.array([estimate.value for estimate in found])
        reach = np.array([[e.value - e.low, e.high - e.value] for e in found]).T
        axes.errorbar(
            [values[bin].mean() for bin in bins], shares, np.maximum(reach, 0), label=label, color=colour,
            marker=marker, linestyle=dash, markersize=4.5, linewidth=1.3, elinewidth=0.8, capsize=2,
        )  # fmt: skip
    if flights.vary[key].loguniform:
        _log_of_numbers(axes)
    axes.set_ylim(-0.03, 1.03)
    axes.legend(fontsize=8)
    return figure


def _faults(flights: Flights) -> Iterator[tuple[tuple[str, str, str], str, np.ndarray]]:
    """(look, label, which flights) of each fault."""
    labels = flights.fault_labels
    for look, label in zip(cycle(_FAULT_LOOKS), sorted(set(labels[flights.faulted])), strict=False):
        yield look, label, flights.faulted & (labels == label)


def _levels(values: np.ndarray) -> list[np.ndarray]:
    """Positions of the flights at each value, in order of the values."""
    levels, group = np.unique(values, return_inverse=True)
    if levels.size > 2 * BINS:
        return _bins(values)
    return [np.flatnonzero(group == level) for level in range(levels.size)]


def _bins(values: np.ndarray) -> list[np.ndarray]:
    """Positions of the values in equally full bins, in order, none with too few flights to say anything."""
    count = min(BINS, max(1, values.size // LEAST_A_BIN))
    return np.array_split(np.argsort(values, kind="stable"), count)


def delay_distribution(flights: Flights, summary: Document) -> "Figure | None":
    """Share of faults detected within a time, a curve a fault; what is missing at the top was missed."""
    if not flights.detected.any():
        return None
    figure, axes = _axes("", "detection delay (s)", "share of faults detected within the delay")
    axes.set_title("Detection delay", fontsize=10, loc="left")
    for (colour, _, dash), label, group in _faults(flights):
        delays = np.sort(flights.detection_delay_s[group & flights.detected])
        if delays.size:
            shares = np.arange(1, delays.size + 1) / group.sum()
            axes.step(delays, shares, where="post", label=label, color=colour, linestyle=dash, linewidth=1.4)
    for q, says in ((0.5, "half"), (0.95, "95 %")):
        axes.axhline(q, color=GREY, linewidth=0.8, linestyle=":")
        axes.annotate(says, (1.0, q), xycoords=("axes fraction", "data"), ha="right", va="bottom", fontsize=7)
    never = (flights.faulted & ~flights.detected).sum()
    axes.set_title(f"never: {never} of {flights.faulted.sum()} →", fontsize=8, loc="right")
    positive = flights.detection_delay_s[flights.detected & (flights.detection_delay_s > 0)]
    if positive.size and positive.max() > 20 * np.median(positive):
        _log_of_numbers(axes)
    axes.set_ylim(0, 1.02)
    axes.legend(fontsize=8, loc="lower right")
    return figure


def confusion_matrix(flights: Flights, summary: Document) -> "Figure | None":
    """Declared fault against diagnosis."""
    confusion = summary["confusion"]
    counts, rows, columns = np.array(confusion["counts"]), confusion["faults"], confusion["diagnoses"]
    if not counts.size:
        return None
    size = (2.6 + 1.15 * len(columns), 1.7 + 0.55 * len(rows))
    figure, axes = _axes("What broke (rows) against what the diagnosis said (columns)", size=size)
    axes.grid(visible=False)
    shares = counts / np.maximum(counts.sum(axis=1, keepdims=True), 1)
    labels = dict.fromkeys(np.ndindex(*counts.shape), ("0", GREY))
    for row, column in np.argwhere(counts).tolist():
        share = shares[row, column]
        ink = "white" if share > 0.6 else BLACK
        labels[row, column] = (f"{counts[row, column]}\n{share:.0%}", ink)
    heat_map(axes, shares, labels, columns, rows, cmap="Blues", vmin=0, vmax=1.15)
    return figure


def sensitivity_bars(flights: Flights, summary: Document) -> "Figure | None":
    """How much of each outcome each varied key explains."""
    rankings = {OUTCOMES[name]: ranking for name, ranking in summary["sensitivity"].items() if ranking}
    if not rankings:
        return None
    keys = [entry["key"] for entry in next(iter(rankings.values()))][:12]
    title = "Sensitivity: share of an outcome that a key explains by rank correlation"
    figure, axes = _axes(title, size=(8.0, 1.8 + 0.5 * len(keys)))
    height = 0.8 / len(rankings)
    colours = (BLUE, ORANGE, GREEN, PURPLE)
    for position, (name, ranking) in enumerate(rankings.items()):
        explained = {entry["key"]: entry["explained"] for entry in ranking}
        places = np.arange(len(keys)) + (position + 0.5) * height - 0.4
        axes.barh(places, [explained[key] for key in keys], height, label=name, color=colours[position])
    axes.set_yticks(range(len(keys)), [in_words(key) for key in keys])
    axes.invert_yaxis()
    axes.set_xlim(0, 1)
    figure.legend(loc="outside lower center", ncols=4, fontsize=8, frameon=False)
    return figure


def search_history(flights: Flights, summary: Document) -> "Figure | None":
    """The worst flight found so far, generation by generation."""
    if "search" not in summary:
        return None
    search = summary["search"]
    worst = _SEARCHED[search["objective"]]
    figure, axes = _axes("Worst-case search: the worst flight so far", "generation", worst)
    history = [np.nan if score is None else score for score in search["history"]]
    axes.plot(range(1, len(history) + 1), history, color=BLUE, marker="o", markersize=3.5)
    axes.ticklabel_format(useOffset=False)
    return figure


FIGURES: dict[str, tuple[str, Drawer]] = {
    "search": ("Worst-case search", search_history),
    "detection-probability": ("Detection probability against magnitude", detection_probability),
    "delay-distribution": ("Detection delay", delay_distribution),
    "confusion-matrix": ("Faults and diagnoses", confusion_matrix),
    "sensitivity": ("Sensitivity", sensitivity_bars),
}
