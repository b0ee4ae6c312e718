"""The survey as CSV, JSON, map and text."""

import csv
import io
import json
from collections.abc import Sequence
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any

from beaver_ftc.studies.detectability.grid import DETECT_WITHIN_S, ISOLATE_WITHIN_S, Row

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def document(name: str, rows: Sequence[Row]) -> dict[str, Any]:
    """What the command answers and `detectability.json` holds."""
    return {
        "scenario": name,
        "detect_within_s": DETECT_WITHIN_S,
        "isolate_within_s": ISOLATE_WITHIN_S,
        "points": list(rows),
    }


def write(folder: Path, name: str, rows: Sequence[Row]) -> None:
    """Fill `folder` with detectability.json, .csv and .png."""
    (folder / "detectability.json").write_text(
        json.dumps(document(name, rows), indent=1) + "\n", encoding="utf-8"
    )
    (folder / "detectability.csv").write_text(as_csv(rows), encoding="utf-8")
    draw(name, rows).savefig(folder / "detectability.png", dpi=110)


def as_csv(rows: Sequence[Row]) -> str:
    """One line a fault and grid point; empty where nothing is certain."""
    text = io.StringIO()
    writer = csv.DictWriter(text, fieldnames=list(rows[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue()


def draw(name: str, rows: Sequence[Row]) -> Any:
    """A map a fault and excitation: over speed and altitude, the magnitude certain to be found."""
    from matplotlib.figure import Figure

    faults, scales = _faults(rows), sorted({row["excitation"] for row in rows})
    figure = Figure(figsize=(3.4 * len(scales) + 1.2, 9.0), layout="constrained")
    grid = figure.subplots(len(faults), len(scales), squeeze=False, sharex=True, sharey=True)
    for line, fault in zip(grid, faults, strict=True):
        for axes, scale in zip(line, scales, strict=True):
            image = _map(axes, [row for row in rows if (row["fault"], row["excitation"]) == (fault, scale)])
            axes.set_title(f"{fault}, {scale:g} x reference", fontsize=9)
    for axes in grid[-1]:
        axes.set_xlabel("airspeed (m/s)", fontsize=9)
    for line in grid:
        line[0].set_ylabel("altitude (m)", fontsize=9)
    figure.colorbar(image, ax=grid, label="magnitude certain to be detected, whenever it strikes", shrink=0.6)
    figure.suptitle(
        f"{name}: loss of effectiveness certain to be detected within {DETECT_WITHIN_S:g} s / "
        f"isolated within {ISOLATE_WITHIN_S:g} s (-: not even a total loss)",
        fontsize=11,
    )
    return figure


def _faults(rows: Sequence[Row]) -> list[str]:
    """The faults in the order of the rows."""
    return list(dict.fromkeys(row["fault"] for row in rows))


def _map(axes: "Axes", rows: Sequence[Row]) -> Any:
    import numpy as np

    speeds, altitudes = (sorted({row[key] for row in rows}) for key in ("airspeed_mps", "altitude_m"))
    values = np.full((len(altitudes), len(speeds)), np.nan)
    for row in rows:
        at = altitudes.index(row["altitude_m"]), speeds.index(row["airspeed_mps"])
        values[at] = np.nan if row["detected"] is None else row["detected"]
        label = f"{_short(row['detected'])}\n{_short(row['isolated'])}"
        axes.text(at[1], at[0], label, ha="center", va="center", fontsize=7)
    axes.set_xticks(range(len(speeds)), [f"{speed:g}" for speed in speeds], fontsize=8)
    axes.set_yticks(range(len(altitudes)), [f"{altitude:g}" for altitude in altitudes], fontsize=8)
    return axes.imshow(values, origin="lower", aspect="auto", cmap="viridis_r", vmin=0.0, vmax=1.0, alpha=0.6)


def _short(magnitude: float | None) -> str:
    return "-" if magnitude is None else f"{magnitude:.2f}"


def text(rows: Sequence[Row]) -> str:
    """A line a fault and grid point, then one a fault and excitation."""
    place = f"{'fault':<10}{'m/s':>6}{'m':>7}{'excit.':>8}"
    head = f"{place}{'detected':>10}{'median':>8}{'isolated':>10}{'median':>8}   why"
    return "\n".join([head, *map(_line, rows), "", *_summary(rows)])


def _summary(rows: Sequence[Row]) -> list[str]:
    """How many grid points each fault is certain at, and from which magnitudes on."""
    lines = [f"{'fault':<10}{'excit.':>8}{'certain at':>12}{'from':>13}{'half the time at':>18}{'from':>13}"]
    for fault, scale in product(_faults(rows), sorted({row["excitation"] for row in rows})):
        chosen = [row for row in rows if (row["fault"], row["excitation"]) == (fault, scale)]
        always, half = (_range([row[key] for row in chosen]) for key in ("isolated", "isolated_median"))
        lines.append(f"{fault:<10}{scale:>8g}{always[0]:>12}{always[1]:>13}{half[0]:>18}{half[1]:>13}")
    return [*lines, "certain: detected and isolated in time, from some magnitude on; of so many grid points"]


def _range(magnitudes: Sequence[float | None]) -> tuple[str, str]:
    certain = [magnitude for magnitude in magnitudes if magnitude is not None]
    span = f"{min(certain):.2f} - {max(certain):.2f}" if certain else "-"
    return f"{len(certain)} of {len(magnitudes)}", span


def _line(row: Row) -> str:
    place = f"{row['fault']:<10}{row['airspeed_mps']:>6g}{row['altitude_m']:>7g}{row['excitation']:>8g}"
    found = f"{_short(row['detected']):>10}{_short(row['detected_median']):>8}"
    return place + found + f"{_short(row['isolated']):>10}{_short(row['isolated_median']):>8}   {row['why']}"
