"""The map of isolability: which losses are told from which other surface, from what size on, and how soon.

Of a loss of one surface and another surface that could explain it: the smallest loss from which the other is
excluded in time, along a flight, and how long a total loss takes, whenever it strikes and at half of the
instants. And what `separate` would fly there in straight flight: the smallest doublet certain to tell losses
of both apart.
"""

from collections.abc import Sequence
from itertools import permutations, product
from math import inf
from typing import Any

import numpy as np

from beaver_ftc.extensions import offered
from beaver_ftc.results.model import Document
from beaver_ftc.scenario.schema import Scenario
from beaver_ftc.studies.engine.statistics import quantile
from beaver_ftc.studies.present.figures import heat_map, label_edges, panels

SHOWN = ("magnitude", "magnitude_median", "longest_s", "median_s")
DOUBLET = ("doublet_deg", "doublet_s", "why")
NO_DOUBLET = dict(zip(DOUBLET, (None, None, "no installed package offers 'doublets'"), strict=True))
HEAD = (
    "loss of", "other surface", "reference scale", "half of onsets: loss", "delay", "all onsets: places",
    "loss", "delay", "doublet",
)  # fmt: skip
TOLD = 0.5  # of the losses that a doublet tells apart
SAYS = (
    "Loss: the smallest loss for which the other surface is excluded within a second. Delay: the time\n"
    "until a total loss excludes it. Both for half of the possible start times, and for all of them at\n"
    "so many places. Doublet: the smallest one in straight flight that is certain to distinguish losses\n"
    f"of {100 * TOLD:.0f} %. All values are those of the worst place."
)
PER_CELL = 1.55, 0.65  # inches
ACROSS = 3  # panels


def shown(excluded: np.ndarray, frames: int, dt: float) -> Document:
    """What a flight shows of one pair.

    excluded (n,): the smallest magnitude for which each frame alone excludes the other, inf where none does.
    frames: in which it has to be. A time counts from the frame in which a total loss strikes, that included.
    """
    least = np.sort(np.lib.stride_tricks.sliding_window_view(excluded, frames).min(axis=1))
    n = len(excluded)
    ahead = np.where(excluded <= 1.0, np.arange(n), n)
    ahead = np.minimum.accumulate(ahead[::-1])[::-1]
    wait = np.sort(np.where(ahead < n, (ahead - np.arange(n) + 1) * dt, inf)[: len(least)])
    found = least[-1], quantile(least, 0.5), wait[-1], quantile(wait, 0.5)
    return {name: float(x) if x < inf else None for name, x in zip(SHOWN, found, strict=True)}


def doublets(scenario: Scenario, after_s: float) -> dict[tuple[str, str], Document]:
    """Of each two surfaces that lead an axis: the smallest doublet that distinguishes losses of TOLD, so long
    after the start of a healthy flight, or why there is none."""
    find = offered("doublets")
    pairs = permutations(scenario.airframe.class_of_losses, 2)
    return find(scenario, after_s, TOLD) if find else dict.fromkeys(pairs, NO_DOUBLET)


def nothing(faults: Sequence[str], why: str) -> list[Document]:
    """The rows of a place where nothing can be said."""
    none = dict.fromkeys((*SHOWN, *DOUBLET)) | {"why": why}
    return [{"fault": fault, "other": other, **none} for fault, other in permutations(faults, 2)]


def _largest(rows: Sequence[Document], key: str) -> float | None:
    """The largest over these places; None if one is without, or there are none."""
    values = [row[key] for row in rows]
    return None if None in values or not values else max(values)


def _over_places(rows: Sequence[Document]) -> Document:
    """A pair over all places of one excitation: the worst; `always` over those places where it is certain."""
    certain = [row for row in rows if row["magnitude"] is not None]
    return {
        "half": (_largest(rows, "magnitude_median"), _largest(rows, "median_s")),
        "always": (_largest(certain, "magnitude"), _largest(certain, "longest_s")),
        "at": f"{len(certain)}/{len(rows)}",
        "doublet": (_largest(rows, "doublet_deg"), _largest(rows, "doublet_s")),
    }


def _pairs(rows: Sequence[Document]) -> dict[tuple[str, str, float], Document]:
    """(fault, other, excitation) -> what it amounts to, in the order of the rows."""
    pairs = dict.fromkeys((row["fault"], row["other"]) for row in rows)
    found = {}
    for pair, scale in product(pairs, sorted({row["excitation"] for row in rows})):
        of = [row for row in rows if (row["fault"], row["other"], row["excitation"]) == (*pair, scale)]
        found[*pair, scale] = _over_places(of)
    return found


def table(rows: Sequence[Document]) -> list[tuple[str, ...]]:
    """A row a pair and excitation, below HEAD."""
    cells: list[tuple[str, ...]] = []
    for (fault, other, scale), of in _pairs(rows).items():
        half, always = (_cells(*of[how]) for how in ("half", "always"))
        cells.append((fault, other, f"{scale:g}", *half, of["at"], *always, _doublet(*of["doublet"])))
    return cells


def _cells(magnitude: float | None, seconds: float | None) -> tuple[str, str]:
    return "-" if magnitude is None else f"{magnitude:.2f}", "-" if seconds is None else f"{seconds:.2f} s"


def _doublet(amplitude_deg: float | None, seconds: float | None) -> str:
    return "-" if amplitude_deg is None else f"{amplitude_deg:.1f} deg, {seconds:.2f} s"


def draw(name: str, rows: Sequence[Document]) -> Any:
    """A panel an excitation, the fault down and what it could be taken for across; then one of doublets."""
    of_pairs = _pairs(rows)
    faults = [*dict.fromkeys(fault for fault, _, _ in of_pairs)]
    scales = [*dict.fromkeys(scale for _, _, scale in of_pairs)]
    n, across = len(faults), min(ACROSS, len(scales) + 1)
    down = -(-(len(scales) + 1) // across)
    title = (
        f"{name}: smallest loss distinguished from that of another surface, and the time of a total one"
        "\n(half: at half of the instants; always: at every instant; hatched: not even a total loss)"
    )
    size = across * (PER_CELL[0] * n + 0.3) + 1.2, down * (PER_CELL[1] * n + 0.8) + 0.5
    figure, grid = panels(down, across, *size, title, sharey=True)
    look: dict[str, Any] = {"cmap": "viridis_r", "vmin": 0.0, "vmax": 1.0, "alpha": 0.6}
    image: Any = None
    for axes, scale in zip(grid.flat, [*scales, None], strict=False):
        values, labels = np.full((n, n), np.nan), {}
        for (fault, other, of_scale), of in of_pairs.items():
            at, half = (faults.index(fault), faults.index(other)), of["half"][0]
            if scale is None:
                labels[at] = _doublet(*of["doublet"]).replace(", ", "\n"), "black"
            elif scale == of_scale:
                values[at] = np.nan if half is None else half
                labels[at] = "\n".join(_said(how, of) for how in ("half", "always")), "black"
        image = heat_map(axes, values, labels, faults, faults, 7, hatched=scale is not None, **look)
        axes.set_title(f"{scale:g} x reference" if scale else f"doublet, losses of {TOLD:.0%}", fontsize=9)
    for axes in grid.flat[len(scales) + 1 :]:
        axes.set_visible(False)
    label_edges(grid, "taken for", ["loss of"] * down)
    figure.colorbar(
        image,
        ax=grid,
        label="smallest loss distinguished (half), share",
        shrink=0.7,
    )
    return figure


def _said(how: str, of: Document) -> str:
    """One of `half` and `always` in a cell."""
    found = "none" if of[how][0] is None else ", ".join(_cells(*of[how]))
    return f"{how}: {found}" + (f" ({of['at']})" if how == "always" else "")
