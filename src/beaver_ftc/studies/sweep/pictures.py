"""The figures of a sweep as PNG, drawn with matplotlib without its global state.

Each function of FIGURES draws a figure from flights and summary. It returns None if these have no data for
the figure.
"""

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from beaver_ftc.results.model import Document
from beaver_ftc.results.style import BLACK, BLUE, GREY
from beaver_ftc.studies.engine.statistics import wilson
from beaver_ftc.studies.present.figures import (
    GRID,
    Axes,
    Figure,
    curve_look,
    draw_estimates,
    heat_map,
    label_edges,
    marker,
    panels,
)
from beaver_ftc.studies.present.page import write_files
from beaver_ftc.studies.present.tables import values_of
from beaver_ftc.studies.sweep.key_words import in_words
from beaver_ftc.studies.sweep.outcomes import Flights
from beaver_ftc.studies.sweep.summary import OUTCOMES

Drawer = Callable[[Flights, Document], Figure | None]
Place = tuple[int, ...]  # row and column of a cell

BINS = 16  # most bins of a curve
LEAST_A_BIN = 10  # flights in a bin, unless the curve has fewer
_SEARCHED = {  # label of the score, by objective of the search
    "delay": "detection delay (s)",
    "false_alarm": "residual / threshold without a fault",
    "tracking": "RMS tracking error after the fault (deg/s)",
}


def write_figures(flights: Flights, summary: Document, folder: Path) -> None:
    """Draw each figure with data as `<name>.png`, and remove older ones."""
    for name in FIGURES:
        (folder / f"{name}.png").unlink(missing_ok=True)
    write_files(folder, {f"{name}.png": draw(flights, summary) for name, (_, draw) in FIGURES.items()})


def _axes(
    title: str, x: str = "", y: str = "", size: tuple[float, float] = (8.0, 4.6)
) -> tuple[Figure, Axes]:
    """A figure with one panel: title, labels of its axes, size in inches."""
    figure, grid = panels(1, 1, *size)
    axes = grid[0, 0]
    axes.set_title(title, fontsize=10)
    label_edges(grid, x, [y])
    axes.tick_params(labelsize=8)
    axes.grid(color=GRID, linewidth=0.6)
    axes.set_axisbelow(True)
    return figure, axes


def _log_of_numbers(axes: Axes) -> None:
    """A logarithmic axis whose ticks are plain numbers."""
    axes.set_xscale("log")
    axes.xaxis.set_major_formatter("{x:g}")


def magnitude_key(flights: Flights, summary: Document) -> str | None:
    """The varied key that stands for the size of the fault: the number of a fault other than its times, else
    any number, that explains the detection delay best; the first one without a ranking. None if no number
    varies."""
    ranked = values_of(summary["sensitivity"]["detection_delay"], "key")
    numbers = [key for key in (ranked or flights.vary) if flights.is_number(key)]
    of_faults = [key for key in numbers if key.startswith("faults[") and not key.endswith(("at_s", "end_s"))]
    return next(iter(of_faults or numbers), None)


def detection_probability(flights: Flights, summary: Document) -> Figure | None:
    """Share detected over the size of the fault, a curve for each fault, with Wilson intervals."""
    key = magnitude_key(flights, summary)
    if key is None or not flights.faulted.any():
        return None
    figure, axes = _axes("Detection probability (bars: 95 % intervals)", in_words(key), "share detected")
    for place, (label, has_fault) in enumerate(flights.by_fault.items()):
        group = flights.faulted & has_fault
        values = flights[key][group]
        hits = flights.detected[group]
        bins = _levels(values) if flights.vary[key].count else _bins(values)
        estimates = [vars(wilson(int(hits[bin].sum()), bin.size)) for bin in bins]
        draw_estimates(
            axes, [values[bin].mean() for bin in bins], estimates, label=label, marker=marker(place),
            markersize=4.5, elinewidth=0.8, capsize=2, **curve_look(place),
        )  # fmt: skip
    if flights.vary[key].loguniform:
        _log_of_numbers(axes)
    axes.set_ylim(-0.03, 1.03)
    axes.legend(fontsize=8)
    return figure


def _levels(values: np.ndarray) -> list[np.ndarray]:
    """Indices of the flights with each value, in the order of the values; bins if there are many values."""
    levels, group = np.unique(values, return_inverse=True)
    if levels.size > 2 * BINS:
        return _bins(values)
    return [np.flatnonzero(group == level) for level in range(levels.size)]


def _bins(values: np.ndarray) -> list[np.ndarray]:
    """Indices of the values in at most BINS bins with equal numbers of values, in their order, at least
    LEAST_A_BIN in each."""
    count = min(BINS, max(1, values.size // LEAST_A_BIN))
    return np.array_split(np.argsort(values, kind="stable"), count)


def delay_distribution(flights: Flights, summary: Document) -> Figure | None:
    """Share of faults detected within a time, a curve for each fault that is ever detected. The distance of
    its end from 1 is the share of missed faults."""
    if not flights.detected.any():
        return None
    figure, axes = _axes("", "detection delay (s)", "share of faults detected within the delay")
    axes.set_title("Detection delay", fontsize=10, loc="left")
    for place, (label, has_fault) in enumerate(flights.by_fault.items()):
        group = flights.faulted & has_fault
        delays = np.sort(flights.detection_delay_s[group & flights.detected])
        if delays.size:
            shares = np.arange(1, delays.size + 1) / group.sum()
            axes.step(delays, shares, where="post", label=label, **curve_look(place))
    for q, text in ((0.5, "half"), (0.95, "95 %")):
        axes.axhline(q, color=GREY, linewidth=0.8, linestyle=":")
        axes.annotate(text, (1.0, q), xycoords=("axes fraction", "data"), ha="right", va="bottom", fontsize=7)
    never = (flights.faulted & ~flights.detected).sum()
    axes.set_title(f"never: {never} of {flights.faulted.sum()} →", fontsize=8, loc="right")
    positive = flights.detection_delay_s[flights.detected & (flights.detection_delay_s > 0)]
    if positive.size and positive.max() > 20 * np.median(positive):
        _log_of_numbers(axes)
    axes.set_ylim(0, 1.02)
    axes.legend(fontsize=8, loc="lower right")
    return figure


def confusion_matrix(flights: Flights, summary: Document) -> Figure | None:
    """The numbers of flights by true fault and diagnosis."""
    confusion = summary["confusion"]
    counts, rows, columns = np.array(confusion["counts"]), confusion["faults"], confusion["diagnoses"]
    if not counts.size:
        return None
    shares = counts / np.maximum(counts.sum(axis=1, keepdims=True), 1)

    def text(at: Place) -> str:
        return f"{counts[at]}\n{shares[at]:.0%}" if counts[at] else "0"

    title = "What broke (rows) against what the diagnosis said (columns)"
    return _shaded(title, shares, text, columns, rows)


def _shaded(
    title: str, shares: np.ndarray, text: Callable[[Place], str], columns: Sequence[str], rows: Sequence[str]
) -> Figure:
    """A heat map of shares (rows, columns) with a text on each cell."""
    figure, axes = _axes(title, size=(max(7.0, 2.6 + 1.15 * len(columns)), 1.7 + 0.55 * len(rows)))
    axes.grid(visible=False)
    labels = {at: (text(at), "white" if shares[at] > 0.6 else BLACK) for at in np.ndindex(*shares.shape)}
    heat_map(axes, shares, labels, columns, rows, cmap="Blues", vmin=0, vmax=1.15)
    return figure


def sensitivity(flights: Flights, summary: Document) -> Figure | None:
    """The share of each outcome that the keys explain: the first 12 of the ranking of the first outcome."""
    rankings = {name: ranking for name, ranking in summary["sensitivity"].items() if ranking}
    if not rankings:
        return None
    keys = values_of(next(iter(rankings.values())), "key")[:12]
    explained = [{entry["key"]: entry["explained"] for entry in ranking} for ranking in rankings.values()]
    shares = np.array([values_of(explained, key) for key in keys])
    title = "Sensitivity: share of the ranks of an outcome that a key explains"
    outcomes = [OUTCOMES[name] for name in rankings]
    return _shaded(title, shares, lambda at: f"{shares[at]:.2f}", outcomes, list(map(in_words, keys)))


def search_history(flights: Flights, summary: Document) -> Figure | None:
    """The worst score so far after each generation of a search."""
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
    "sensitivity": ("Sensitivity", sensitivity),
}
