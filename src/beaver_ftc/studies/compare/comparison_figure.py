"""The figure of the comparison: a row of panels for each set of flights."""

from beaver_ftc.results.model import Document
from beaver_ftc.results.style import BLUE, GREY
from beaver_ftc.studies.compare.trial import LAW, ORACLE, SCHEME
from beaver_ftc.studies.present.figures import Axes, Figure, curve_look, marker, panels
from beaver_ftc.studies.present.tables import values_of


def figure_of(document: Document) -> Figure:
    """A row for each set: detection rate and delay against false alarms, and tracking ratios."""
    sets = document["sets"]
    figure, axes = panels(len(sets), 3, 13.0, 3.4 * len(sets), dpi=120)
    for row, (name, part) in zip(axes, sets.items(), strict=True):
        _draw_curves(row[0], row[1], part)
        _draw_ratios(row[2], part)
        row[0].set_title(f"{name}: {part['flights']} flights", loc="left", fontsize=10)
    axes[0][0].legend(fontsize=7)
    return figure


def _draw_curves(rate: Axes, delay: Axes, part: Document) -> None:
    """The curves of each scheme over its levels; a marker at level 1, with which it ships."""
    for index, (scheme, points) in enumerate(part["trade_off"].items()):
        look = curve_look(index)
        alarms = values_of(points, "false_alarms_per_h")
        shipped = next(point for point in points if point["level"] == 1.0)
        for axis, key in ((rate, "detection_rate"), (delay, "delay_median_s")):
            values = [float("nan") if point[key] is None else point[key] for point in points]
            axis.plot(alarms, values, label=scheme, drawstyle="steps-post", **look)
            point = shipped["false_alarms_per_h"], shipped[key]
            if None not in point:
                axis.plot(*point, marker(index), color=look["color"])
    for axis, label in ((rate, "detection rate"), (delay, "median detection delay, s")):
        axis.set(xlabel="false alarms per hour", ylabel=label)
        axis.set_xscale("symlog", linthresh=10.0)
        axis.set_xlim(left=-1.0)
        axis.grid(alpha=0.3)
    rate.set_ylim(-0.05, 1.05)
    delay.set_yscale("symlog", linthresh=0.01)
    delay.set_ylim(bottom=0.0)


def _draw_ratios(axis: Axes, part: Document) -> None:
    """A line for each law but the oracle, from the median to the 90 % quantile of its tracking ratio. Without
    a quantile: the aircraft is lost in more than 10 % of the flights."""
    rows = [row for row in part["lines"] if row["scheme"] == SCHEME and row["law"] != ORACLE]
    for place, row in enumerate(rows):
        median, upper = row["ratio_median"], row["ratio_90"]
        colour = BLUE if row["law"] == LAW else GREY
        if median is not None:
            axis.plot([median, median if upper is None else upper], [place, place], color=colour, linewidth=3)
            axis.plot(median, place, "o", color=colour)
        if upper is None:
            axis.annotate(
                "aircraft lost", (1.0, place), fontsize=7, xytext=(4, 5), textcoords="offset points"
            )
    axis.plot([1.0, 1.0], [-0.5, len(rows) - 0.5], color="#000000", linewidth=0.8)
    axis.set_yticks(range(len(rows)), values_of(rows, "law"), fontsize=7)
    axis.set(xscale="log", xlabel="tracking error over the oracle's: median to 90 %")
    axis.xaxis.set_major_formatter("{x:g}")
    axis.xaxis.set_minor_formatter("")
    axis.grid(alpha=0.3)
