"""The matrix as a heat map: colour says how the flight compares with the oracle's, letters the verdict."""

from math import log2
from pathlib import Path
from typing import Any

import numpy as np

from beaver_ftc.studies.matrix.cases import FAULTS
from beaver_ftc.studies.matrix.summary import surfaces_of

Document = dict[str, Any]
MOST_DOUBLINGS = 3.0


def write_heat_map(document: Document, path: Path) -> None:
    """Draw the matrix into a PNG."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    names = [fault for fault, _ in FAULTS]
    surfaces = surfaces_of(document)
    by_place = {(cell["fault"], cell["surface"]): cell for cell in document["cells"]}
    grid = np.array([[_doublings(by_place[fault, surface]) for surface in surfaces] for fault in names])
    figure = Figure(figsize=(11, 0.5 * len(names) + 1.8), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots()
    image = axes.imshow(grid, cmap="YlOrBr", vmin=0, vmax=MOST_DOUBLINGS, aspect="auto")
    axes.set_title("Each fault on each surface: verdict, and how well the flight goes on")
    axes.set_xticks(range(len(surfaces)), surfaces)
    axes.set_xticks(np.arange(0.5, len(surfaces) - 1), minor=True)
    axes.set_yticks(np.arange(0.5, len(names) - 1), minor=True)
    axes.grid(which="minor", color="white", linewidth=1.5)
    axes.tick_params(which="minor", length=0)
    axes.set_yticks(range(len(names)), names)
    for i, fault in enumerate(names):
        for j, surface in enumerate(surfaces):
            axes.text(j, i, _label(by_place[fault, surface]), ha="center", va="center", **_ink(grid[i, j]))
    bar = figure.colorbar(image, ticks=range(int(MOST_DOUBLINGS) + 1))
    most = int(MOST_DOUBLINGS)
    bar.ax.set_yticklabels([f"{2**n}" for n in range(most)] + [f"{2**most} or more"])
    bar.set_label("tracking RMS over the oracle's, worst airspeed")
    figure.savefig(path, dpi=120, metadata={"Software": None})


def _doublings(cell: Document) -> float:
    return 0.0 if cell["ratio"] is None else min(max(log2(cell["ratio"]), 0.0), MOST_DOUBLINGS)


def _label(cell: Document) -> str:
    delay = "" if cell["delay_s"] is None else f", {cell['delay_s']:.2f} s"
    return f"{cell['verdict']}{delay}{', lost' if cell['lost'] else ''}"


def _ink(doublings: float) -> dict[str, Any]:
    return {"color": "white" if doublings > 0.7 * MOST_DOUBLINGS else "black", "fontsize": 9}
