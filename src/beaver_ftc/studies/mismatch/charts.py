"""The mismatch as pictures: sources in time, against the bound, of several flights, and over the envelope.

Colour-blind readers can distinguish the colours; dashes and order distinguish the curves in grey.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from beaver_ftc.aircraft import AXES
from beaver_ftc.documents.files import Document
from beaver_ftc.results.log import StoredLog
from beaver_ftc.results.series import series_of
from beaver_ftc.results.style import BLACK, BLUE, GREEN, GREY, ORANGE, PURPLE, SKY, VERMILION, Mark
from beaver_ftc.results.words import MOTION_OF_AXIS, without_underscores
from beaver_ftc.studies.mismatch.linear_charts import dress
from beaver_ftc.studies.mismatch.sources import SOURCES
from beaver_ftc.studies.mismatch.split import CAUSES, ETA_BAR, FAULT, TOTAL, UNEXPLAINED, column
from beaver_ftc.studies.mismatch.tables import share_text
from beaver_ftc.studies.present.figures import Axes, Figure, heat_map, label_edges, panels
from beaver_ftc.studies.present.tables import values_of

AXIS_NAMES = [f"{motion} {axis}" for axis, motion in MOTION_OF_AXIS.items()]
LONGEST_BAR = 1e6  # length of a share of a bound that is zero
SHOWN_SOURCES = 4  # curves in a panel
LEAST_CURVE = 1e-3  # share of the peak of the largest source: a source with less would be a line at zero
LEAST_RATIO = 1e-6  # length of the bar of a smaller ratio
LEAST_SHARE = 1e-5  # a source has no bar if its share of the bound is smaller on each axis
# Colour and dashes of each source. Sources of the same colour have different dashes.
SOURCE_LOOKS: dict[str, tuple[str, tuple[float, ...]]] = {
    "sensors": (SKY, (4, 1)), "actuators": (PURPLE, (6, 2, 1, 2)), "simplification": (VERMILION, ()),
    "engine": (VERMILION, (7, 2)), "coefficients": (GREEN, ()), "inertia": (PURPLE, (3, 1)),
    "inertia_coupling": (GREEN, (2, 2)), "sinusoids": (BLUE, ()), "wind_turbulence": (SKY, ()),
    "earth_rotation": (ORANGE, (1, 1)), "integration": (ORANGE, (6, 2)),
}  # fmt: skip


def sources_figure(frames: Path, document: Document, instants: Sequence[Mark]) -> Figure:
    """A panel for each axis: the largest sources, and the sum of all without the fault, in front of the
    bound."""
    chosen = {axis: largest_sources(document, axis) for axis in AXES}
    names = {axis: [TOTAL, FAULT, ETA_BAR, *chosen[axis]] for axis in AXES}
    series = series_of(StoredLog(frames), [column(axis, name) for axis in AXES for name in names[axis]])
    title = f"Truth less design: what it is made of, faults aside\n{document['scenario']}"
    figure, grid = panels(3, 1, 11.0, 8.0, title, sharex=True)
    for axis, axes in zip(AXES, grid.flat, strict=True):
        _draw_sources(axes, series, axis, chosen[axis], instants)
    label_edges(grid, "time (s)", [f"{name} (rad/s²)" for name in AXIS_NAMES])
    return figure


def largest_sources(document: Document, axis: str) -> list[str]:
    """At most SHOWN_SOURCES sources of an axis with the largest peaks, without faults, the largest first;
    none with a peak below LEAST_CURVE of the largest."""
    peaks = {name: document["axes"][axis][name]["max"] for name in CAUSES}
    by_peak = sorted(CAUSES, key=lambda name: -peaks[name])
    least = LEAST_CURVE * peaks[by_peak[0]]
    return [name for name in by_peak[:SHOWN_SOURCES] if peaks[name] >= least]


def _draw_sources(axes: Axes, series: dict, axis: str, chosen: list[str], instants: Sequence[Mark]) -> None:
    """The bound, the sum, the chosen sources and the event marks of one axis."""
    t = series["t_s"]
    bound = series[column(axis, ETA_BAR)]
    axes.fill_between(t, -bound, bound, color=SKY, alpha=0.25, linewidth=0, label="± bound eta_bar")
    uncertainty = series[column(axis, TOTAL)] - series[column(axis, FAULT)]
    axes.plot(t, uncertainty, color=BLACK, linewidth=2.4, alpha=0.35, label="all together")
    for name in chosen:
        colour, dashes = SOURCE_LOOKS[name]
        look: dict[str, Any] = {"color": colour, "linestyle": (0, dashes), "linewidth": 1.3}
        axes.plot(t, series[column(axis, name)], label=without_underscores(name), **look)
    for i, mark in enumerate(instants):
        axes.axvline(mark.time_s, color=mark.colour, linewidth=0.9, linestyle=(0, mark.dash or (1, 0)))
        axes.annotate(
            mark.letter, (mark.time_s, 1.0), xycoords=("data", "axes fraction"), textcoords="offset points",
            xytext=(0, 2 + 9 * (i % 2)), fontsize=8,  # neighbours at two heights
        )  # fmt: skip
    dress(axes)
    axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=8, frameon=False)


def bound_figure(document: Document) -> Figure:
    """Bars of the largest share of the bound that each source above LEAST_SHARE has used, a panel for each
    axis."""
    sources_of_axes = [document["axes"][axis] for axis in AXES]
    names = [
        name
        for name in (*SOURCES, UNEXPLAINED)
        if any(_bar_length(sources[name]["bound_share"]) > LEAST_SHARE for sources in sources_of_axes)
    ]
    shares = [[sources[name]["bound_share"] for name in names] for sources in sources_of_axes]
    values = np.array([[_bar_length(share) for share in row] for row in shares])
    notes = [
        [share_text(share) if _bar_length(share) > LEAST_SHARE else "" for share in row] for row in shares
    ]
    title = f"Largest share of the bound eta_bar\n{document['scenario']}", "share of eta_bar (1: all of it)"
    size = 11.0, 1.6 + 0.34 * max(len(names), 2)
    ends = LEAST_SHARE, 30.0 * max(values.max(initial=0.0), 1.0)
    bars = [without_underscores(name) for name in names], np.maximum(values, LEAST_SHARE), notes
    return _bars(size, title, *bars, ends, grey=FAULT)


def _bar_length(share: float | None) -> float:
    """A share of the bound as a length. None, a share of a bound that is zero, has the longest bar."""
    return LONGEST_BAR if share is None else share


def comparison_figure(entries: Sequence[Document]) -> Figure:
    """Bars of the largest mismatch over the bound in each flight, a panel for each axis."""
    needed = [values_of(entries, f"{axis}_worst_ratio") for axis in AXES]
    ratios = np.array([[max(_bar_length(ratio), LEAST_RATIO) for ratio in row] for row in needed])
    notes = [
        [
            f"{share_text(r)} ({without_underscores(entry[f'{axis}_dominant'])})"
            for r, entry in zip(row, entries, strict=True)
        ]
        for row, axis in zip(needed, AXES, strict=True)
    ]
    title = "Mismatch at its worst, faults aside, over the bound", "largest mismatch / eta_bar"
    size = 12.0, 1.6 + 0.38 * max(len(entries), 2)
    ends = min(0.1, 0.5 * ratios.min()), 60.0 * max(ratios.max(), 1.0)
    return _bars(size, title, values_of(entries, "scenario"), ratios, notes, ends)


def _bars(
    size: tuple[float, float], titles: tuple[str, str], names: Sequence[str], values: np.ndarray,
    notes: list[list[str]], ends: tuple[float, float], grey: str = "",
) -> Figure:  # fmt: skip
    """Horizontal bars on a logarithmic scale, a panel for each axis; a bar above 1 is red.

    titles: above and below the panels. values (axes, names): lengths. notes: text beside each bar. ends: of
    the scale. grey: name of a bar that is grey.
    """
    figure, grid = panels(1, 3, *size, titles[0], sharey=True, sharex=True)
    for axes, lengths, texts in zip(grid[0], values, notes, strict=True):
        red = [VERMILION if value > 1.0 else BLUE for value in lengths]
        colours = [GREY if name == grey else colour for name, colour in zip(names, red, strict=True)]
        axes.barh(range(len(names)), lengths, height=0.7, color=colours)
        for place, (value, text) in enumerate(zip(lengths, texts, strict=True)):
            axes.annotate(f" {text}", (value, place), va="center", fontsize=7.5)
        axes.axvline(1.0, color=BLACK, linewidth=1.0, dashes=(4, 2))
        axes.set(xscale="log", xlim=ends)
        axes.tick_params(labelsize=8)
        axes.grid(axis="x", color=GREY, alpha=0.3, linewidth=0.5)
    grid[0, 0].set_yticks(range(len(names)), names, fontsize=9)
    grid[0, 0].invert_yaxis()
    label_edges(grid, titles[1], titles=AXIS_NAMES)
    return figure


def map_figure(entries: Sequence[Document], name: str) -> Figure:
    """The largest mismatch over the bound against airspeed and altitude, a panel for each axis; hatched
    without a trim.

    entries: for each altitude in order, for each airspeed, for each axis. The reshape relies on this order.
    """
    from matplotlib.colors import LogNorm

    speeds, altitudes = (list(dict.fromkeys(values_of(entries, of))) for of in ("airspeed_mps", "altitude_m"))
    worst = [np.nan if entry["worst_ratio"] is None else entry["worst_ratio"] for entry in entries]
    grids = np.moveaxis(np.reshape(worst, (len(altitudes), len(speeds), len(AXES))), -1, 0)
    positive = grids[grids > 0.0] if (grids > 0.0).any() else np.ones(1)
    norm = LogNorm(vmin=min(positive.min(), 0.99), vmax=max(positive.max(), 1.01))
    title = f"Largest mismatch over the bound eta_bar, no fault\n{name}"
    figure, panel = panels(1, 3, 14.0, 4.6, title, sharey=True)
    names = [f"{V:g}" for V in speeds], [f"{h:g}" for h in altitudes]
    for axes, grid in zip(panel[0], grids, strict=True):
        image = heat_map(axes, grid, _ratios(grid, norm), *names, origin="lower", cmap="cividis", norm=norm)
    label_edges(panel, "airspeed (m/s)", ["altitude (m)"], AXIS_NAMES)
    figure.colorbar(image, ax=panel, label="mismatch / eta_bar (1: all of the bound)", pad=0.01)
    return figure


def _ratios(grid: np.ndarray, norm: Any) -> dict[Any, tuple[str, str]]:
    """The text of each cell of a map, and its colour."""
    labels = dict.fromkeys(np.ndindex(grid.shape), ("no trim", "black"))
    for at, ratio in np.ndenumerate(grid):
        if np.isfinite(ratio):
            labels[at] = f"{ratio:.2g}", "white" if norm(ratio) < 0.5 else "black"
    return labels
