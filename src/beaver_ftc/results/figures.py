"""The figures of a flight as PNG: the views drawn with matplotlib, without its global state."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cache
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from beaver_ftc.results import log
from beaver_ftc.results.model import Metrics
from beaver_ftc.results.style import GREY, LOOKS, YELLOW, Mark, closeup_window, marks
from beaver_ftc.results.views import WHOLE, Panel, Series, Trace, View, read_series, views_of_flight

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

DPI = 110
LEFT, STEPS_LEFT, RIGHT, TOP, BOTTOM, GAP = 0.75, 1.2, 0.2, 0.9, 0.85, 0.42  # inches
LEGEND_LINE = 0.17  # inches, of one more line of the legend
COMPRESSION = 1  # of a PNG: a tenth larger than with zlib's 6, in two thirds of the time
LOWEST_RATIO = 1e-2  # of a logarithmic axis: what is smaller is nothing


@dataclass(frozen=True)
class Picture:
    """A view to be drawn into a file, with what it shows."""

    path: Path
    view: View
    series: Series
    instants: Sequence[Mark]
    subtitle: str


def write_figures(log_path: Path, metrics: Metrics, folder: Path) -> list[Path]:
    """Draw every view of the log as `<view>.png`, some also as `<view>-closeup.png`; return the files."""
    folder.mkdir(exist_ok=True)
    pictures = pictures_of(log_path, metrics, folder)
    for picture in pictures:
        save(picture)
    return [picture.path for picture in pictures]


def pictures_of(log_path: Path, metrics: Metrics, folder: Path) -> list[Picture]:
    """All pictures of a log: every view over the whole flight, some around the fault as well."""
    shown = views_of_flight(log.column_names(log_path), metrics)
    instants = marks(metrics)
    window = closeup_window(instants)
    closeups = [view for view in shown if view.closeup] if window else []
    found = []
    for drawn, span, ending in ((shown, WHOLE, ""), (closeups, window or WHOLE, "-closeup")):
        series = read_series(log_path, [name for view in drawn for name in view.columns], span)
        for view in drawn:
            own = {name: series[name] for name in ("t_s", *view.columns)}
            path = folder / f"{view.name}{ending}.png"
            found.append(Picture(path, view, own, instants, metrics.scenario))
    return found


def save(picture: Picture) -> None:
    """Draw a picture into its file."""
    figure = draw(picture.view, picture.series, picture.instants, picture.subtitle)
    figure.savefig(
        picture.path, metadata={"Software": "beaver-ftc"}, pil_kwargs={"compress_level": COMPRESSION}
    )


def draw(view: View, series: Series, instants: Sequence[Mark], subtitle: str) -> "Figure":
    """One view as a matplotlib figure, over the time that `series` covers."""
    figure, grid = _laid_out(view, figure_class())
    for axes, panel in zip(grid.flat, view.panels, strict=False):
        _draw_panel(axes, panel, series, instants)
    _say_absent(view, series, list(grid.flat))
    for axes in grid[-1]:
        axes.set_xlabel("time (s)", fontsize=9)
    top = 1 - 0.12 / figure.get_figheight()
    figure.suptitle(f"{view.title}\n{subtitle}", fontsize=11, y=top, va="top")
    _draw_legend(figure, list(grid.flat))
    return figure


@cache
def figure_class() -> "type[Figure]":
    """matplotlib's Figure, made to show itself in a notebook without pyplot and its global state."""
    from matplotlib.figure import Figure

    class Shown(Figure):
        """A figure that a notebook can draw."""

        def _repr_png_(self) -> bytes:
            picture = BytesIO()
            self.savefig(picture, format="png")
            return picture.getvalue()

    return Shown


def _laid_out(view: View, new_figure: Any) -> tuple["Figure", Any]:
    """An empty figure with its grid of axes, laid out in inches: a solver would double the time."""
    down = -(-len(view.panels) // view.across)
    heights = [_height(panel, view.across) for panel in view.panels[:: view.across]]
    width = 10.0 if view.across == 1 else 12.0
    height = TOP + BOTTOM + sum(heights) + GAP * (down - 1)
    figure = new_figure(figsize=(width, height), dpi=DPI)
    left = STEPS_LEFT if view.panels[0].steps else LEFT
    grid = figure.subplots(
        down, view.across, sharex=True, squeeze=False, height_ratios=heights,
        gridspec_kw={
            "left": left / width, "right": 1 - RIGHT / width, "top": 1 - TOP / height,
            "bottom": BOTTOM / height, "hspace": GAP * down / sum(heights), "wspace": 0.19,
        },
    )  # fmt: skip
    return figure, grid


def _height(panel: Panel, across: int) -> float:
    """Height of a panel's axes in inches."""
    if panel.steps:
        return 0.25 + 0.25 * len(panel.steps)
    return 1.75 if across == 1 else 1.5


def _draw_panel(axes: "Axes", panel: Panel, series: Series, instants: Sequence[Mark]) -> None:
    for trace in panel.traces:
        _draw_trace(axes, trace, series, bool(panel.steps))
    _draw_shade(axes, panel, series)
    _draw_marks(axes, instants, series["t_s"])
    title = panel.label if panel.steps or not panel.unit else f"{panel.label} ({panel.unit})"
    axes.set_title(title, fontsize=9, y=1.0)  # at this height: looking for one takes a third of the time
    axes.tick_params(labelsize=8)
    axes.grid(visible=True, color="#dddddd", linewidth=0.6)
    axes.ticklabel_format(axis="x", useOffset=False)
    if series["t_s"].size > 1:
        axes.set_xlim(series["t_s"][0], series["t_s"][-1])
    if panel.steps:
        axes.set_yticks(range(len(panel.steps)), panel.steps)
        axes.set_ylim(-0.4, len(panel.steps) - 0.6)
    elif panel.limits:
        axes.set_ylim(*panel.limits)
    if panel.log_scale:
        axes.set_yscale("log")
        axes.set_ylim(bottom=max(axes.get_ylim()[0], LOWEST_RATIO))
        axes.minorticks_off()
    if panel.level is not None:
        axes.axhline(panel.level, color=GREY, linewidth=1.0, zorder=1)


def _draw_trace(axes: "Axes", trace: Trace, series: Series, stepped: bool) -> None:
    look = LOOKS[trace.role]
    axes.plot(
        series["t_s"],
        trace.factor * series[trace.column] + trace.offset,
        color=look.colour,
        linestyle=_linestyle(look.dash),
        linewidth=look.width,
        zorder=look.above,
        drawstyle="steps-post" if stepped else "default",
        label=trace.label or "_",
    )


def _linestyle(dash: tuple[float, ...]) -> Any:
    """Dashes in points as matplotlib takes them (which counts in line widths: about 1.5 points)."""
    return (0, tuple(length / 1.5 for length in dash)) if dash else "-"


def _draw_shade(axes: "Axes", panel: Panel, series: Series) -> None:
    if not panel.shade or not (series[panel.shade] == 1).any():
        return
    axes.fill_between(
        series["t_s"], 0, 1, where=series[panel.shade] == 1, transform=axes.get_xaxis_transform(),
        color=YELLOW, alpha=0.3, linewidth=0, step="post", label=panel.shade_label, zorder=0,
    )  # fmt: skip


def _draw_marks(axes: "Axes", instants: Sequence[Mark], t_s: np.ndarray) -> None:
    """A line each, and symbols at staggered heights so that instants close together are told apart."""
    for rank, mark in enumerate(instants):
        if not t_s.size or not t_s[0] <= mark.time_s <= t_s[-1]:
            continue
        line: Any = {"color": mark.colour, "linestyle": _linestyle(mark.dash), "linewidth": 0.9}
        axes.axvline(mark.time_s, alpha=0.8, zorder=2.5, **line)
        axes.plot(
            [mark.time_s], [1.0 - 0.09 * rank], transform=axes.get_xaxis_transform(), marker=mark.symbol,
            markersize=4.5, label=mark.label, zorder=6, clip_on=False, **line,
        )  # fmt: skip


def _say_absent(view: View, series: Series, grid: Iterable["Axes"]) -> None:
    """Say so where a view has nothing to show, rather than leaving empty axes to be wondered at."""
    if view.absent and all(np.isnan(series[column]).all() for column in view.columns):
        for axes in grid:
            axes.text(0.5, 0.5, view.absent, transform=axes.transAxes, ha="center", va="center", fontsize=9)


def _columns(labels: Sequence[str], width: float) -> int:
    """The most columns of these labels that a figure, so many inches wide, has room for."""
    for n in range(min(len(labels), 12 if width > 11 else 9), 1, -1):
        longest = (max(map(len, part)) for part in np.array_split(labels, n))
        if sum(0.45 + 0.06 * letters for letters in longest) < width:
            return n
    return 1


def _draw_legend(figure: "Figure", grid: Iterable["Axes"]) -> None:
    """One legend for the figure: each label once, but for the single curves that panel titles name."""
    entries: dict[str, Any] = {}
    for axes in grid:
        handles, labels = axes.get_legend_handles_labels()
        entries = entries | dict(zip(labels, handles, strict=True)) | entries
    titles = {axes.get_title().rpartition(" (")[0] or axes.get_title() for axes in grid}
    shown = {label: handle for label, handle in entries.items() if label not in titles}
    columns, tall = _columns(list(shown), figure.get_figwidth()), figure.get_figheight()
    more = LEGEND_LINE * (-(-len(shown) // columns) - 1) / tall
    top, share = 1 - TOP / tall, 1 - more * tall / (tall - TOP - BOTTOM)
    for axes in grid if more else ():  # lower, to make room
        old = axes.get_position()
        axes.set_position((old.x0, top - share * (top - old.y0), old.width, share * old.height))
    figure.legend(
        shown.values(),
        shown.keys(),
        loc="lower center",
        bbox_to_anchor=(0.5, 0.04 / figure.get_figheight()),
        ncols=columns,
        columnspacing=1.2,
        fontsize=8,
        frameon=False,
    )
