"""Parts that all figures of studies share: panels, looks of curves, heat maps, values with intervals."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from beaver_ftc.results.style import SERIES

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
else:  # matplotlib is imported when a figure is drawn
    Axes = Figure = Any

DPI = 110
DASHES: tuple[Any, ...] = ("-", (0, (5, 2)), (0, (2, 2)), (0, (6, 2, 1, 2)), (0, (1, 1)))
MARKS = "os^DXPv<>*h"  # eleven, and eight colours: 88 curves with `marker` differ in at least one of the two
GRID = "#dddddd"  # colour of grid lines and of hatched cells


def panels(
    down: int, across: int, width: float, height: float, title: str = "", dpi: int = DPI, **subplots: Any
) -> tuple[Figure, Any]:
    """A figure of this width and height, inches, without the global state of matplotlib, and its panels
    (down, across)."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), dpi=dpi, layout="constrained")
    if title:
        figure.suptitle(title, fontsize=11)
    return figure, figure.subplots(down, across, squeeze=False, **subplots)


def label_edges(grid: Any, x: str | None = None, y: Sequence[str] = (), titles: Sequence[str] = ()) -> None:
    """Label the edges of panels (down, across): x below the last row, y to the left of each row, titles above
    each column."""
    for axes in grid[-1]:
        axes.set_xlabel(x or "", fontsize=9)
    for axes, text in zip(grid[:, 0], y, strict=False):
        axes.set_ylabel(text, fontsize=9)
    for axes, text in zip(grid[0], titles, strict=False):
        axes.set_title(text, fontsize=9)


def curve_look(place: int) -> dict[str, Any]:
    """Colour and dashes of the curve at a place among several: 40 curves differ in one or both."""
    return {"color": SERIES[place % len(SERIES)], "linestyle": DASHES[place % len(DASHES)]}


def marker(place: int) -> str:
    """The marker of the curve at a place among several."""
    return MARKS[place % len(MARKS)]


def heat_map(
    axes: Axes,
    values: np.ndarray,
    labels: dict[tuple[int, int], tuple[str, str]],
    columns: Sequence[str],
    rows: Sequence[str],
    fontsize: float = 8,
    **image: Any,
) -> Any:
    """Draw an image of values (rows, columns), and return it. labels: by (row, column), the text and its
    colour. A cell with a text and the value NaN is hatched."""
    from matplotlib.patches import Rectangle

    look: dict[str, Any] = {"facecolor": GRID, "edgecolor": "white", "hatch": "////", "linewidth": 0.0}
    for (row, column), (text, ink) in labels.items():
        if np.isnan(values[row][column]):
            axes.add_patch(Rectangle((column - 0.5, row - 0.5), 1.0, 1.0, **look))
        axes.text(column, row, text, ha="center", va="center", fontsize=fontsize, color=ink, zorder=3)
    axes.set_xticks(range(len(columns)), columns, fontsize=fontsize)
    axes.set_yticks(range(len(rows)), rows, fontsize=fontsize)
    return axes.imshow(values, aspect="auto", **image)


def draw_estimates(
    axes: Axes, places: Sequence[float], estimates: Sequence[Mapping[str, Any]], times: float = 1.0,
    across: bool = False, **look: Any,
) -> None:  # fmt: skip
    """Draw values with bars for their intervals. places: on the other axis. estimates: `value`, `low` and
    `high` of each, None or NaN for none. times: factor on the values. across: the values are on the
    horizontal axis."""
    rows = [[estimate[key] for key in ("value", "low", "high")] for estimate in estimates]
    value, low, high = times * np.array(rows, dtype=float).reshape(-1, 3).T
    bars = np.maximum([value - low, high - value], 0.0)
    if across:
        axes.errorbar(value, places, xerr=bars, **look)
    else:
        axes.errorbar(places, value, yerr=bars, **look)
