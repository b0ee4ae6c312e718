"""The comparison as one figure: a row a set; what a false alarm buys, how soon, and how well the laws
track."""

from typing import Any

from beaver_ftc.results.looks import BLUE, GREY
from beaver_ftc.studies.compare.trial import LAW, ORACLE, SCHEME
from beaver_ftc.studies.present.figures import curve_look, marker, panels

Document = dict[str, Any]


def figure_of(document: Document) -> Any:
    """A row a set."""
    sets = document["sets"]
    figure, axes = panels(len(sets), 3, 13.0, 3.4 * len(sets), dpi=120)
    for row, (name, part) in zip(axes, sets.items(), strict=True):
        _draw_curves(row[0], row[1], part)
        _draw_ratios(row[2], part)
        row[0].set_title(f"{name}: {part['flights']} flights", loc="left", fontsize=10)
    axes[0][0].legend(fontsize=7)
    return figure


def _draw_curves(rate: Any, delay: Any, part: Document) -> None:
    for index, (scheme, points) in enumerate(part["trade_off"].items()):
        look = curve_look(index)
        alarms = [point["false_alarms_per_h"] for point in points]
        own = next(point for point in points if point["level"] == 1.0)
        for axis, key in ((rate, "detection_rate"), (delay, "delay_median_s")):
            values = [float("nan") if point[key] is None else point[key] for point in points]
            axis.plot(alarms, values, label=scheme, drawstyle="steps-post", **look)
            if own[key] is not None:
                axis.plot(own["false_alarms_per_h"], own[key], marker(index), color=look["color"])
    for axis, label in ((rate, "detection rate"), (delay, "median detection delay, s")):
        axis.set_xlabel("false alarms per hour")
        axis.set_ylabel(label)
        axis.set_xscale("symlog", linthresh=10.0)
        axis.set_xlim(left=-1.0)
        axis.grid(alpha=0.3)
    rate.set_ylim(-0.05, 1.05)
    delay.set_yscale("symlog", linthresh=0.01)
    delay.set_ylim(bottom=0.0)


def _draw_ratios(axis: Any, part: Document) -> None:
    rows = [row for row in part["lines"] if row["scheme"] == SCHEME and row["law"] != ORACLE]
    for place, row in enumerate(rows):
        median, most = row["ratio_median"], row["ratio_90"]
        colour = BLUE if row["law"] == LAW else GREY
        if median is not None:
            axis.plot([median, median if most is None else most], [place, place], color=colour, linewidth=3)
            axis.plot(median, place, "o", color=colour)
        if most is None:
            axis.annotate(
                "aircraft lost", (1.0, place), fontsize=7, xytext=(4, 5), textcoords="offset points"
            )
    axis.plot([1.0, 1.0], [-0.5, len(rows) - 0.5], color="#000000", linewidth=0.8)
    axis.set_yticks(range(len(rows)), [row["law"] for row in rows], fontsize=7)
    axis.set_xscale("log")
    axis.xaxis.set_major_formatter("{x:g}")
    axis.xaxis.set_minor_formatter("")
    axis.set_xlabel("tracking error over the oracle's: median to 90 %")
    axis.grid(alpha=0.3)
