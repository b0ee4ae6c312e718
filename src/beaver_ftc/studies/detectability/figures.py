"""The figures of `detectability`: losses that are certainly distinguished, and shares that schemes find."""

from collections.abc import Sequence
from itertools import product
from typing import Any

import numpy as np

from beaver_ftc.results.model import Document
from beaver_ftc.results.style import SERIES
from beaver_ftc.studies.detectability.grid import title_of
from beaver_ftc.studies.detectability.levels import Row
from beaver_ftc.studies.detectability.probabilities import JUDGED_S, informed_shares, summary
from beaver_ftc.studies.detectability.shown import span, times_reference
from beaver_ftc.studies.present.figures import (
    GRID,
    Axes,
    Figure,
    draw_estimates,
    heat_map,
    label_edges,
    marker,
    panels,
)
from beaver_ftc.studies.present.page import Summary
from beaver_ftc.studies.present.tables import grouped, values_of

INFORMED = "informed test"


def draw_pairs(document: Document) -> Figure:
    """A panel for each excitation. Rows: the surface that loses effectiveness; columns: the other surface."""
    pairs = grouped(document["pairs"], "excitation")
    faults = [*dict.fromkeys(values_of(document["pairs"], "fault"))]
    title = (
        f"{document['scenario']}: smallest loss distinguished from that of another surface, and places\n"
        "(upper numbers: at half of the instants; lower numbers: at every instant; hatched: no loss)"
    )
    size = len(pairs) * (1.55 * len(faults) + 0.3) + 1.2, 0.65 * len(faults) + 1.6
    figure, grid = panels(1, len(pairs), *size, title, sharey=True)
    for axes, ((scale,), rows) in zip(grid[0], pairs.items(), strict=True):
        values = np.full((len(faults), len(faults)), np.nan)
        texts = {}
        for (fault, other), places in grouped(rows, "fault", "other").items():
            at = (faults.index(fault), faults.index(other))
            at_half = values_of(places, "magnitude_median")
            values[at] = np.nan if None in at_half else max(at_half)
            texts[at] = f"{span(places, 'magnitude_median')}\n{span(places, 'magnitude')}", "black"
        look: dict[str, Any] = {"cmap": "viridis_r", "vmin": 0.0, "vmax": 1.0, "alpha": 0.6}
        image = heat_map(axes, values, texts, faults, faults, fontsize=7, **look)
        axes.set_title(times_reference(scale), fontsize=9)
    label_edges(grid, "taken for", ["loss of"])
    figure.colorbar(image, ax=grid, label="smallest loss (half), share", shrink=0.6)
    return figure


def draw_schemes(document: Summary) -> Figure:
    """A row of panels for each condition, a column for each surface. In a panel, each scheme has a line of
    dots: the share detected of each magnitude."""
    rows: Sequence[Row] = document.behind
    surfaces = document["grid"]["surfaces"]
    conditions = document["grid"]["conditions"]
    names = [*dict.fromkeys(values_of(rows, "scheme")), INFORMED]
    rate = f"at most {document['false_alarms_per_h']:g} false alarms per hour"
    figure, axes = panels(
        len(conditions), len(surfaces), 2.3 * len(surfaces) + 1.7,
        (0.3 * len(names) + 0.6) * len(conditions) + 1.2, f"Loss of effectiveness, {rate}, all references",
        dpi=120, sharex=True, sharey=True,
    )  # fmt: skip
    rows_of_panel = grouped(rows, "sensors", "turbulence", "surface")
    for panel, (condition, surface) in zip(axes.flat, product(conditions, surfaces), strict=True):
        _draw(panel, rows_of_panel.get((*condition, surface), []), names, document)
    label_edges(
        axes, f"detected within {JUDGED_S:g} s, %",
        [title_of(*condition).replace(", ", ",\n") for condition in conditions], surfaces,
    )  # fmt: skip
    n_excitations = len(document["grid"]["excitations_deg_s"])
    flights = [n_excitations * cell["flights"] for cell in document["cells"]]
    figure.legend(
        *axes[0][0].get_legend_handles_labels(), loc="outside lower center",
        ncols=len(document["grid"]["magnitudes"]), fontsize=8, frameon=False, title_fontsize=8,
        title=f"of {min(flights, default=0)} to {max(flights, default=0)} flights, exact 95 % interval",
    )  # fmt: skip
    return figure


def _draw(panel: Axes, rows: Sequence[Row], names: Sequence[str], document: Document) -> None:
    """The share that each scheme detects, with its exact 95 % interval, and that of the informed test.
    Magnitudes are drawn below one another, `apart` from line to line."""
    magnitudes = document["grid"]["magnitudes"]
    within = f"{JUDGED_S:g}"
    apart = 0.6 / len(magnitudes)
    by_magnitude = grouped(rows, "magnitude")
    for place, magnitude in enumerate(magnitudes):
        rows_of_magnitude = by_magnitude.get((magnitude,), [])
        cells = {scheme: summary(group) for (scheme,), group in grouped(rows_of_magnitude, "scheme").items()}
        shares = {scheme: cell["within"][within] for scheme, cell in cells.items() if cell["flights"]}
        if rows_of_magnitude:
            informed = informed_shares(rows_of_magnitude, document["false_alarms_per_h"])[within]
            shares[INFORMED] = {"value": informed, "low": informed, "high": informed}
        lines = [names.index(name) + apart * (place - 0.5 * (len(magnitudes) - 1)) for name in shares]
        draw_estimates(
            panel, lines, [*shares.values()], 100.0, across=True, linestyle="none", marker=marker(place),
            markersize=4.5, color=SERIES[place], elinewidth=1.0, clip_on=False,
            label=f"{100 * magnitude:g} % lost",
        )  # fmt: skip
    panel.set_yticks(range(len(names)), names)
    panel.set(xlim=(-2, 102), ylim=(len(names) - 0.5, -0.5))
    panel.grid(axis="x", alpha=0.3)
    panel.hlines(np.arange(len(names) - 1) + 0.5, -2, 102, color=GRID, linewidth=0.6)
    panel.tick_params(labelsize=8)
