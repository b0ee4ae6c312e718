"""The benchmark as a picture: what each method found and how late, and how near it came to the labels."""

from pathlib import Path
from typing import Any

from beaver_ftc.results.looks import SERIES

Document = dict[str, Any]

_MARKS = "os^DXPv<>*ph"
_HATCHES = ("", "//", "..")  # where the colours begin again
_GROUP = 0.85  # the width that all methods share at one tick
_LATEST_S = 30.0


def write_figure(document: Document, path: Path) -> None:
    """Write a panel a data set, PNG."""
    from matplotlib.figure import Figure

    parts = document["sets"]
    figure = Figure(figsize=(10, 3.6 * len(parts)), layout="constrained", dpi=110)
    axes = figure.subplots(len(parts), 1, squeeze=False)[:, 0]
    for axis, part in zip(axes, parts, strict=True):
        draw = _labels if part["scored_by"] == "labels" else _events
        draw(axis, part)
        axis.set_title(f"{part['set']}: left out, {part['left_out']}", fontsize=10, loc="left")
        axis.tick_params(labelsize=8)
        axis.legend(fontsize=7, loc="upper left", bbox_to_anchor=(1.0, 1.0), frameon=False)
    figure.savefig(path)


def _events(axis: Any, part: Document) -> None:
    """Delay of each method on each surface failure; what is not found stands at the top."""
    methods = [row["method"] for row in part["rows"]]
    failures = [one for one in part["flights"] if one["method"] == methods[0] and one["failure"]]
    failures = [one["left_out"] for one in failures if "engine" not in one["failure"]]
    for i, method in enumerate(methods):
        mine = {one["left_out"]: one for one in part["flights"] if one["method"] == method}
        delays = [mine[name]["delay_s"] for name in failures]
        heights = [_LATEST_S if delay is None else min(delay, _LATEST_S) for delay in delays]
        places = [k + _offset(i, len(methods)) for k in range(len(failures))]
        axis.plot(places, heights, _mark(i), color=_colour(i), markersize=6, label=method)
    named = {one["left_out"]: one["failure"] for one in part["flights"]}
    axis.set_xticks(range(len(failures)), [named[name].replace("+", "\n+ ") for name in failures])
    axis.set_ylabel("delay, s", fontsize=8)
    axis.set_ylim(0, _LATEST_S + 1.5)
    axis.axhline(_LATEST_S, color="#999999", linewidth=0.8, linestyle=":", label="not found, or later")
    axis.axhline(5.0, color="#999999", linewidth=0.8, linestyle="--", label="5 s")
    axis.grid(axis="y", color="#dddddd", linewidth=0.5)


def _labels(axis: Any, part: Document) -> None:
    """Shares of the rows that are right, by method; published figures where there are."""
    keys = {"classes": "class", "healthy_or_faulty": "healthy or faulty", "side": "side"}
    rows = [*part["rows"], *part["published"]]
    for i, row in enumerate(rows):
        places = [k + _offset(i, len(rows)) for k, key in enumerate(keys) if key in row]
        shares = [row[key] for key in keys if key in row]
        look = {
            "color": _colour(i),
            "hatch": _HATCHES[i // len(SERIES) % len(_HATCHES)],
            "edgecolor": "white",
        }
        axis.bar(places, shares, width=0.9 * _GROUP / len(rows), label=row["method"], **look)
    axis.set_xticks(range(len(keys)), list(keys.values()))
    axis.set_ylabel("share of rows right", fontsize=8)
    axis.set_ylim(0, 1)
    axis.set_axisbelow(True)
    axis.grid(axis="y", color="#dddddd", linewidth=0.5)


def _offset(i: int, methods: int) -> float:
    """Where the i-th of so many methods stands beside its tick."""
    return _GROUP / methods * (i - (methods - 1) / 2)


def _colour(i: int) -> str:
    return SERIES[i % len(SERIES)]


def _mark(i: int) -> str:
    return _MARKS[i % len(_MARKS)]
