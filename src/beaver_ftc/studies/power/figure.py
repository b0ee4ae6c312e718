"""Detection probability as maps, one a scheme, and of all schemes as curves, one figure a set of sensors."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from beaver_ftc.studies.power.document import JUDGED_S
from beaver_ftc.studies.power.tally import Row, grouped, limit, summary
from beaver_ftc.studies.power.text import TOLD, title_of
from beaver_ftc.studies.present.figures import curve_look, marker

Document = dict[str, Any]
FORMATS = ("png", "svg")


def write_figures(document: Document, rows: Sequence[Row], folder: Path) -> Iterator[Path]:
    """Draw everything into a folder, as PNG and as SVG; yield the files."""
    for (scheme,), of in grouped(rows, "scheme").items():
        yield from _save(_maps(document, scheme, of), folder, f"map-{scheme.replace(':', '-')}")
    for (sensors,), of in grouped(rows, "sensors").items():
        yield from _save(_curves(document, sensors, of), folder, f"schemes-{sensors}")


def _save(figure: Any, folder: Path, name: str) -> Iterator[Path]:
    from matplotlib import rc_context

    for kind in FORMATS:
        path = folder / f"{name}.{kind}"
        metadata = {"Software": "beaver-ftc"} if kind == "png" else {"Date": None, "Creator": "beaver-ftc"}
        with rc_context({"svg.hashsalt": name}):  # the same bytes every time
            figure.savefig(path, dpi=120, metadata=metadata)
        yield path


def _maps(document: Document, scheme: str, rows: Sequence[Row]) -> Any:
    """Rows surfaces, columns conditions; in each, magnitude over excitation."""
    from matplotlib.figure import Figure

    grid = document["grid"]
    surfaces, conditions = grid["surfaces"], grid["conditions"]
    figure = Figure(figsize=(2.35 * len(conditions) + 1.9, 2.3 * len(surfaces) + 1.0), layout="constrained")
    axes = figure.subplots(len(surfaces), len(conditions), squeeze=False, sharex=True, sharey=True)
    by_place = grouped(rows, "surface", "sensors", "turbulence")
    for line, surface in zip(axes, surfaces, strict=True):
        for panel, (sensors, turbulence) in zip(line, conditions, strict=True):
            image = _map(panel, grid, by_place.get((surface, sensors, turbulence), []))
    for panel, condition in zip(axes[0], conditions, strict=True):
        panel.set_title(title_of(*condition).replace(", ", ",\n"), fontsize=9)
    for line, surface in zip(axes, surfaces, strict=True):
        line[0].set_ylabel(f"{surface}\neffectiveness lost, %", fontsize=9)
    for panel in axes[-1]:
        panel.set_xlabel("reference amplitude, deg/s", fontsize=8)
    figure.colorbar(
        image, ax=axes, label=f"detected within {JUDGED_S:g} s, % (below: median delay, s)", shrink=0.7
    )
    figure.suptitle(
        f"{scheme}: at most {document['false_alarms_per_h']:g} false alarms per hour", fontsize=11
    )
    return figure


def _map(panel: Any, grid: Document, rows: Sequence[Row]) -> Any:
    magnitudes, excitations = grid["magnitudes"], grid["excitations_deg_s"]
    cells = {key: summary(of) for key, of in grouped(rows, "magnitude", "excitation_deg_s").items()}
    percent = np.full((len(magnitudes), len(excitations)), np.nan)
    for i, magnitude in enumerate(magnitudes):
        for j, excitation in enumerate(excitations):
            cell = cells.get((magnitude, excitation))
            if cell is not None and cell["flights"]:
                percent[i, j] = 100.0 * cell["within"][f"{JUDGED_S:g}"]["value"]
                _label(panel, i, j, percent[i, j], cell["median_delay_s"])
    panel.set_xticks(range(len(excitations)), [f"{e:g}" for e in excitations], fontsize=8)
    panel.set_yticks(range(len(magnitudes)), [f"{100 * m:g}" for m in magnitudes], fontsize=8)
    return panel.imshow(percent, origin="lower", aspect="auto", cmap="cividis", vmin=0.0, vmax=100.0)


def _label(panel: Any, i: int, j: int, percent: float, median_s: float | None) -> None:
    delay = "-" if median_s is None else f"{median_s:.2f}"
    ink = "black" if percent > 55.0 else "white"
    panel.text(j, i, f"{percent:.0f}\n{delay}", ha="center", va="center", fontsize=8, color=ink)


def _curves(document: Document, sensors: str, rows: Sequence[Row]) -> Any:
    """Rows surfaces, columns air; in each, the share detected over magnitude, a line a scheme."""
    from matplotlib.figure import Figure

    surfaces = document["grid"]["surfaces"]
    air = [turbulence for given, turbulence in document["grid"]["conditions"] if given == sensors]
    schemes = list(dict.fromkeys(row["scheme"] for row in rows))
    figure = Figure(figsize=(3.4 * len(air) + 2.6, 2.5 * len(surfaces) + 0.6), layout="constrained")
    axes = figure.subplots(len(surfaces), len(air), squeeze=False, sharex=True, sharey=True)
    by_place = grouped(rows, "surface", "turbulence")
    for line, surface in zip(axes, surfaces, strict=True):
        for panel, turbulence in zip(line, air, strict=True):
            here = by_place.get((surface, turbulence), [])
            _draw(panel, here, schemes)
            _draw_limit(panel, here, document["false_alarms_per_h"])
        line[0].set_ylabel(f"{surface}\ndetected within {JUDGED_S:g} s, %", fontsize=9)
    for panel, turbulence in zip(axes[0], air, strict=True):
        panel.set_title(title_of(sensors, turbulence), fontsize=9)
    for panel in axes[-1]:
        panel.set_xlabel("effectiveness lost, %", fontsize=9)
    handles, labels = axes[0][0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside right center", fontsize=8)
    rate = f"at most {document['false_alarms_per_h']:g} false alarms per hour"
    figure.suptitle(f"Loss of effectiveness, {rate}, all references", fontsize=11)
    return figure


def _draw_limit(panel: Any, rows: Sequence[Row], per_h: float) -> None:
    found = {m: limit(here, per_h) for (m,), here in sorted(grouped(rows, "magnitude").items())}
    share = [100 * within[f"{JUDGED_S:g}"] for within in found.values()]
    panel.plot(
        [100 * m for m in found], share, color="#000000", linewidth=3.5, alpha=0.25, label=TOLD, zorder=0
    )


def _draw(panel: Any, rows: Sequence[Row], schemes: Sequence[str]) -> None:
    for (scheme,), of in grouped(rows, "scheme").items():
        place = schemes.index(scheme)
        found = {m: summary(here) for (m,), here in sorted(grouped(of, "magnitude").items())}
        points = [
            (100 * m, 100 * cell["within"][f"{JUDGED_S:g}"]["value"])
            for m, cell in found.items()
            if cell["flights"]
        ]
        panel.plot(
            *zip(*points, strict=True) if points else ([], []),
            label=scheme,
            marker=marker(place),
            **curve_look(place),
            markersize=5,
            linewidth=1.6,
        )
    panel.set_ylim(-4, 104)
    panel.set_xlim(left=0)
    panel.grid(alpha=0.3)
    panel.tick_params(labelsize=8)
