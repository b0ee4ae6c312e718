"""The worst mismatch over the envelope: the scenario, without faults, flown at each speed and altitude."""

from collections.abc import Iterable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from beaver_ftc.documents.errors import BadInput
from beaver_ftc.studies.engine.study import Progress, flown
from beaver_ftc.studies.mismatch.document import Document, document, write_csv
from beaver_ftc.studies.mismatch.figures import AXIS_NAMES, largest_sources, new_figure, save
from beaver_ftc.studies.mismatch.run import refuse_other_aircraft
from beaver_ftc.studies.mismatch.states import AXES

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from beaver_ftc.scenario.schema import Scenario

MAP = "mismatch-map"
AIRSPEEDS_MPS = (30.0, 35.0, 40.0, 45.0, 50.0, 55.0)  # the validated envelope
ALTITUDES_M = (0.0, 1000.0, 2000.0, 3000.0, 4000.0)


def run_map(
    out: Path, scenario: "Scenario", report: bool = True, progress: Progress | None = None
) -> list[Document]:
    """Write `out/<scenario>-mismatch-map/`: the map as JSON and CSV, and a figure. Return its entries.

    One entry per axis, speed and altitude: worst share of the bound, smallest constant, and why.
    """
    from beaver_ftc.results.metrics import as_json
    from beaver_ftc.results.writer import result_folder

    refuse_other_aircraft(scenario)
    name = map_name(scenario)
    conditions = [(V, h) for h in ALTITUDES_M for V in AIRSPEEDS_MPS]
    cells = flown(
        out / name,
        conditions,
        partial(_cell, scenario),
        list[Document],
        follows_from=scenario,
        progress=progress,
    )
    with cells as rows, result_folder(out, name) as folder:
        entries = [entry for row in rows for entry in row]
        document = {"scenario": scenario.name, "map": entries}
        (folder / "mismatch.json").write_text(as_json(document), encoding="utf-8")
        write_csv(folder / "mismatch.csv", entries)
        if report:
            (folder / "figures").mkdir()
            save(map_figure(entries, scenario.name), folder / "figures" / f"{MAP}.png")
    return entries


def map_name(scenario: "Scenario") -> str:
    """The name of the map's result folder."""
    return f"{scenario.name}-{MAP}"


def at(scenario: "Scenario", airspeed_mps: float, altitude_m: float) -> "Scenario":
    """The scenario without its faults, starting from this speed and altitude."""
    initial = scenario.initial.model_copy(update={"airspeed_mps": airspeed_mps, "altitude_m": altitude_m})
    return scenario.model_copy(update={"initial": initial, "faults": ()})


def _cell(scenario: "Scenario", condition: tuple[float, float]) -> list[Document]:
    from beaver_ftc.studies.mismatch.run import tally_of_flight

    V, h = condition
    place = {"airspeed_mps": V, "altitude_m": h}
    try:
        kept, metrics = tally_of_flight(at(scenario, V, h))
    except BadInput:
        return [{**place, "axis": axis, **dict.fromkeys(_FOUND)} for axis in AXES]
    found = document(scenario, kept, metrics)
    return [{**place, "axis": axis, **_found(found, axis)} for axis in AXES]


_FOUND = ("worst_ratio", "smallest_constant_rad_s2", "dominant", "false_alarm")


def _found(found: Document, axis: str) -> Document:
    bound = found["bound"][axis]
    dominant = largest_sources(found, axis)[0]
    values = bound["worst_ratio"], bound["smallest_constant_rad_s2"], dominant, found["false_alarm"]
    return dict(zip(_FOUND, values, strict=True))


def map_figure(entries: Sequence[Document], name: str) -> "Figure":
    """The worst share of the bound against speed and altitude, per axis; grey where there is no trim."""
    from matplotlib.colors import LogNorm

    grids = {axis: _grid(each for each in entries if each["axis"] == axis) for axis in AXES}
    known = np.concatenate([grid[np.isfinite(grid)] for grid in grids.values()] or [np.ones(1)])
    known = known[known > 0.0] if (known > 0.0).any() else np.ones(1)
    norm = LogNorm(vmin=min(known.min(), 0.99), vmax=max(known.max(), 1.01))
    figure = new_figure(14.0, 4.6, f"Largest mismatch over the bound eta_bar, no fault\n{name}")
    row = figure.subplots(1, 3, sharey=True)
    for axis, axes in zip(AXES, row, strict=True):
        image = _draw(axes, grids[axis], norm)
        axes.set_title(AXIS_NAMES[axis], fontsize=10)
    row[0].set_ylabel("altitude (m)", fontsize=9)
    figure.colorbar(image, ax=row, label="mismatch / eta_bar (1: all of the bound)", pad=0.01)
    return figure


def _grid(entries: Iterable[Document]) -> np.ndarray:
    """Worst ratios (altitudes, speeds); NaN where there is none."""
    grid = np.full((len(ALTITUDES_M), len(AIRSPEEDS_MPS)), np.nan)
    for each in entries:
        at_ = ALTITUDES_M.index(each["altitude_m"]), AIRSPEEDS_MPS.index(each["airspeed_mps"])
        grid[at_] = np.nan if each["worst_ratio"] is None else each["worst_ratio"]
    return grid


def _draw(axes: "Axes", grid: np.ndarray, norm):
    from matplotlib import colormaps

    shades = colormaps["cividis"].with_extremes(bad="0.8")
    image = axes.imshow(grid, origin="lower", aspect="auto", cmap=shades, norm=norm)
    for (i, j), ratio in np.ndenumerate(grid):
        bright = np.isfinite(ratio) and norm(ratio) > 0.5
        text = f"{ratio:.2g}" if np.isfinite(ratio) else "no trim"
        colour = "black" if bright or text == "no trim" else "white"
        weight = "bold" if ratio > 1.0 else "normal"
        axes.annotate(text, (j, i), ha="center", va="center", fontsize=8, color=colour, weight=weight)
    axes.set_xticks(range(len(AIRSPEEDS_MPS)), [f"{V:g}" for V in AIRSPEEDS_MPS], fontsize=8)
    axes.set_yticks(range(len(ALTITUDES_M)), [f"{h:g}" for h in ALTITUDES_M], fontsize=8)
    axes.set_xlabel("airspeed (m/s)", fontsize=9)
    return image
