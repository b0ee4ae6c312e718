"""A view drawn with matplotlib, without its global state."""

from collections.abc import Iterable, Sequence
from functools import cache
from io import BytesIO
from typing import TYPE_CHECKING, Any

import numpy as np

from beaver_ftc.results.log import Values
from beaver_ftc.results.panels import AXIS_QUANTILES, Panel, Trace, View
from beaver_ftc.results.style import GREY, LOOKS, SHADES, Mark

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

DPI = 110
# Margins of a figure and the gap between its panels, inches. STEPS_LEFT: left margin beside names of steps.
LEFT, STEPS_LEFT, RIGHT, TOP, BOTTOM, GAP = 0.75, 1.2, 0.2, 0.9, 0.85, 0.42
LEGEND_LINE_INCHES = 0.17  # height of one more line of the legend, inches
MIN_SHOWN_RATIO = 0.1  # lower end of a logarithmic axis: smaller ratios are noise
STYLES = ("screen", "paper")
PAPER_WIDTH = 8.4 / 2.54  # inches: 8.4 cm, a column of a journal
PAPER_DPI = 300
PAPER_FONT = 8  # points


Options = dict[str, Any]  # keyword arguments of matplotlib


def draw(
    view: View, series: Values, event_marks: Sequence[Mark], subtitle: str, style: str = "screen"
) -> "Figure":
    """One view as a matplotlib figure, over the time that `series` covers. style: one of STYLES."""
    figure, grid = _empty_figure_and_axes(view)
    all_axes = list(grid.flat)
    for axes, panel in zip(all_axes, view.panels, strict=False):
        _draw_panel(axes, panel, series, event_marks)
    _write_absent_text(view, series, all_axes)
    for axes in grid[-1]:
        axes.set_xlabel("time (s)", fontsize=9)
    top = 1 - 0.12 / figure.get_figheight()
    figure.suptitle(f"{view.title}\n{subtitle}", fontsize=11, y=top, va="top")
    _draw_legend(figure, all_axes)
    return _restyle_for_paper(figure) if style == "paper" else figure


def _restyle_for_paper(figure: "Figure") -> "Figure":
    """Shrink a figure to the width of a column of a journal, with letters of at most PAPER_FONT. The title
    is removed, because the caption of the paper has it; lines and symbols become thinner and smaller; the
    legend is drawn again in two columns."""
    from matplotlib.text import Text

    shrink = PAPER_WIDTH / figure.get_figwidth()
    height = figure.get_figheight()
    figure.suptitle("")
    # letters shrink less than the width: a tenth more height, and 0.25 inches for the labels of each panel
    figure.set_size_inches(PAPER_WIDTH, min(height, 1.1 * height * shrink + 0.25 * len(figure.axes)))
    figure.set_dpi(PAPER_DPI)
    for text in figure.findobj(Text):
        text.set_fontsize(min(PAPER_FONT, float(text.get_fontsize()) - 1.0))
    for axes in figure.axes:
        for line in axes.lines:
            line.set_linewidth(0.7 * line.get_linewidth())
            line.set_markersize(0.6 * line.get_markersize())
    for legend in figure.legends:
        legend.remove()
    figure.set_layout_engine("constrained", h_pad=0.02, w_pad=0.02)
    entries = _legend_handle_of_label(figure.axes)
    place: Options = {"loc": "outside lower center", "ncols": 2, "fontsize": PAPER_FONT - 2}
    figure.legend(entries.values(), entries.keys(), frameon=False, **place)
    return figure


@cache
def figure_class() -> "type[Figure]":
    """A subclass of matplotlib's Figure that a notebook can show without pyplot and its global state."""
    from matplotlib.figure import Figure

    class NotebookFigure(Figure):
        """A figure that a notebook can draw."""

        def _repr_png_(self) -> bytes:
            picture = BytesIO()
            self.savefig(picture, format="png")
            return picture.getvalue()

    return NotebookFigure


def _empty_figure_and_axes(view: View) -> tuple["Figure", Any]:
    """An empty figure with its grid of axes (rows, columns). The layout is computed here, in inches: the
    layout engine of matplotlib would double the time.

    Row heights, inches: 0.25 + 0.25 for each step; 1.75 of a single column; 1.5 of several.
    """
    first_of_rows = view.panels[:: view.n_panel_columns]
    down = len(first_of_rows)
    is_single = view.n_panel_columns == 1
    heights = [
        0.25 + 0.25 * len(panel.steps) if panel.steps else 1.75 if is_single else 1.5
        for panel in first_of_rows
    ]
    width = 10.0 if is_single else 12.0
    height = TOP + BOTTOM + sum(heights) + GAP * (down - 1)
    figure = figure_class()(figsize=(width, height), dpi=DPI)
    left_margin = STEPS_LEFT if view.panels[0].steps else LEFT
    grid = figure.subplots(
        down, view.n_panel_columns, sharex=True, squeeze=False, height_ratios=heights,
        gridspec_kw={
            "left": left_margin / width, "right": 1 - RIGHT / width, "top": 1 - TOP / height,
            "bottom": BOTTOM / height, "hspace": GAP * down / sum(heights), "wspace": 0.19,
        },
    )  # fmt: skip
    return figure, grid


def _draw_panel(axes: "Axes", panel: Panel, series: Values, event_marks: Sequence[Mark]) -> None:
    """A panel with its traces (in steps for a discrete quantity) or bars, shade, marks and axes."""
    if panel.bars:
        _draw_bars(axes, panel, series)
    else:
        for trace in panel.traces:
            _draw_trace(axes, trace, series, bool(panel.value_names))
    _draw_shade(axes, panel, series)
    _draw_event_marks(axes, event_marks, series["t_s"])
    title = panel.label if panel.steps or not panel.unit else f"{panel.label} ({panel.unit})"
    axes.set_title(title, fontsize=9, y=1.0)  # without y, matplotlib searches a height: a third of the time
    axes.tick_params(labelsize=8)
    axes.grid(visible=True, color="#dddddd", linewidth=0.6)
    axes.ticklabel_format(axis="x", useOffset=False)
    if series["t_s"].size > 1:
        axes.set_xlim(series["t_s"][0], series["t_s"][-1])
    if n := len(panel.steps):
        axes.set_yticks(range(n), panel.steps)
        axes.set_ylim(*((n - 0.4, -0.6) if panel.bars else (-0.4, n - 0.6)))
    elif panel.limits:
        axes.set_ylim(*panel.limits)
    elif panel.clips_spikes:
        _limit_axis_to_quantiles(axes, panel, series)
    if panel.log_scale:
        _set_log_scale(axes)
    if panel.line_at is not None:
        axes.axhline(panel.line_at, color=GREY, linewidth=1.0, zorder=1)


def _set_log_scale(axes: "Axes") -> None:
    """A logarithmic scale from MIN_SHOWN_RATIO on. Matplotlib warns of data without a positive number unless
    the limits are set first: the residual is 0 throughout in a flight with the alarm in its first frame."""
    extent = axes.dataLim
    if np.isfinite(extent.y1) and not np.isfinite(extent.minposy):
        axes.set_ylim(MIN_SHOWN_RATIO, 10.0)
    axes.set_yscale("log")
    axes.set_ylim(bottom=max(axes.get_ylim()[0], MIN_SHOWN_RATIO))
    axes.minorticks_off()


def _draw_trace(axes: "Axes", trace: Trace, series: Values, stepped: bool) -> None:
    """A curve in the look of its role. stepped: whether values are held until the next point."""
    look = LOOKS[trace.role]
    axes.plot(
        series["t_s"],
        trace.factor * series[trace.column] + trace.offset,
        color=look.colour,
        linestyle=_linestyle(look.dash),
        linewidth=look.width,
        zorder=look.z_order,
        drawstyle="steps-post" if stepped else "default",
        label=trace.label or "_",
    )


def _draw_bars(axes: "Axes", panel: Panel, series: Values) -> None:
    """A row for each label: a bar while one of its traces is 0 (a candidate), a thin line while all traces
    that have a value are 1 (excluded). Both are drawn only while `bars_during_column` is 1."""
    for height, row in enumerate(panel.steps):
        traces = [trace for trace in panel.traces if trace.label == row]
        values = np.array([series[trace.column] for trace in traces])
        active = series[panel.bars_during_column] == 1
        candidate = (values == 0).any(axis=0)
        excluded = active & (values == 1).any(axis=0) & ~candidate
        for where, half_height, colour in (
            (active & candidate, 0.36, LOOKS[traces[0].role].colour), (excluded, 0.04, GREY)
        ):  # fmt: skip
            rows = series["t_s"], height - half_height, height + half_height
            axes.fill_between(*rows, where=where, step="post", color=colour, linewidth=0)


def _limit_axis_to_quantiles(axes: "Axes", panel: Panel, series: Values) -> None:
    """Set the limits of the axis by the AXIS_QUANTILES of the values of all curves, which have no
    offset in such a panel. An arrow with its value marks the largest spike beyond each limit."""
    values = np.concatenate([trace.factor * series[trace.column] for trace in panel.traces])
    values = values[np.isfinite(values)]
    if not values.size:
        return
    low, high = np.quantile(values, AXIS_QUANTILES)
    pad = 0.1 * (high - low) or 0.1 * abs(high) or 1.0
    low, high = max(low - pad, values.min() - 0.3 * pad), min(high + pad, values.max() + 0.3 * pad)
    axes.set_ylim(low, high)
    for value, edge, arrow, align in (
        (values.max(), high, "\u25b2", "top"), (values.min(), low, "\u25bc", "bottom")
    ):  # fmt: skip
        if not low <= value <= high:
            axes.text(
                0.995, edge, f"{arrow} {value:.1f}", transform=axes.get_yaxis_transform(), ha="right",
                va=align, fontsize=7, color="#555555",
            )  # fmt: skip


def _linestyle(dash: tuple[float, ...]) -> Any:
    """Dashes (points) as matplotlib takes them: as multiples of the line width, here taken as 1.5 points."""
    return (0, tuple(length / 1.5 for length in dash)) if dash else "-"


def _draw_shade(axes: "Axes", panel: Panel, series: Values) -> None:
    """Shade the background while the column of the shade is 1."""
    if not panel.shade_column or not (series[panel.shade_column] == 1).any():
        return
    axes.fill_between(
        series["t_s"], 0, 1, where=series[panel.shade_column] == 1, transform=axes.get_xaxis_transform(),
        color=SHADES.get(panel.shade_label, SHADES["saturated"]), linewidth=0, step="post",
        label=panel.shade_label, zorder=0,
    )  # fmt: skip


def _draw_event_marks(axes: "Axes", event_marks: Sequence[Mark], t_s: np.ndarray) -> None:
    """A line for each mark, and symbols at staggered heights, so that marks close together can be
    distinguished."""
    for rank, mark in enumerate(event_marks):
        if not t_s.size or not t_s[0] <= mark.time_s <= t_s[-1]:
            continue
        line: Any = {"color": mark.colour, "linestyle": _linestyle(mark.dash), "linewidth": 0.9}
        axes.axvline(mark.time_s, alpha=0.8, zorder=2.5, **line)
        axes.plot(
            [mark.time_s], [1.0 - 0.09 * rank], transform=axes.get_xaxis_transform(), marker=mark.symbol,
            markersize=4.5, label=mark.label, zorder=6, clip_on=False, **line,
        )  # fmt: skip


def _write_absent_text(view: View, series: Values, grid: Iterable["Axes"]) -> None:
    """Write the text of a view, if it has one and none of its columns has data, into its empty axes."""
    if view.text_without_data and all(np.isnan(series[column]).all() for column in view.columns):
        for axes in grid:
            place: Any = {"transform": axes.transAxes, "ha": "center", "va": "center"}
            axes.text(0.5, 0.5, view.text_without_data, fontsize=9, **place)


def _max_legend_columns(labels: Sequence[str], width: float) -> int:
    """The largest number of legend columns, up to 12 in a figure of several columns and 9 in one of a single
    column, for which these labels fit into a width, inches. A column takes 0.45 inches, and 0.06 for each
    letter of its longest label; at least one is used."""
    for n in range(min(len(labels), 12 if width > 11 else 9), 1, -1):
        longest = (max(map(len, part)) for part in np.array_split(labels, n))
        if sum(0.45 + 0.06 * letters for letters in longest) < width:
            return n
    return 1


def _legend_handle_of_label(grid: Sequence["Axes"]) -> dict[str, Any]:
    """By label, the handle of each legend entry; the first axes with a label decide. A label that is the
    title of any panel, unit aside, has no entry."""
    entries: dict[str, Any] = {}
    for axes in grid:
        handles, labels = axes.get_legend_handles_labels()
        entries = entries | dict(zip(labels, handles, strict=True)) | entries
    titles = {axes.get_title().rpartition(" (")[0] or axes.get_title() for axes in grid}
    return {label: handle for label, handle in entries.items() if label not in titles}


def _draw_legend(figure: "Figure", grid: Sequence["Axes"]) -> None:
    """One legend below the figure. Each line of the legend beyond the first raises the lower edge of the
    panels by LEGEND_LINE_INCHES: a height y of the figure becomes top - scale (top - y)."""
    entries = _legend_handle_of_label(grid)
    columns = _max_legend_columns(list(entries), figure.get_figwidth())
    height = figure.get_figheight()
    added = LEGEND_LINE_INCHES * (-(-len(entries) // columns) - 1)
    top = 1 - TOP / height
    scale = 1 - added / (height - TOP - BOTTOM)
    for axes in grid if added else ():
        box = axes.get_position()
        axes.set_position((box.x0, top - scale * (top - box.y0), box.width, scale * box.height))
    figure.legend(
        entries.values(),
        entries.keys(),
        loc="lower center",
        bbox_to_anchor=(0.5, 0.04 / figure.get_figheight()),
        ncols=columns,
        columnspacing=1.2,
        fontsize=8,
        frameon=False,
    )
