"""The mismatch as pictures: sources in time, sources against the bound, the linear models side by side.

Colours are told apart by the colour-blind; dashes and order tell the curves in grey.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from beaver_ftc.results.looks import BLACK, BLUE, GREEN, GREY, ORANGE, PURPLE, SKY, VERMILION, Mark, marks
from beaver_ftc.results.series import read_series
from beaver_ftc.studies.linear_systems import CHANNELS, pulse_response, response, zeros
from beaver_ftc.studies.mismatch.sources import SOURCES
from beaver_ftc.studies.mismatch.split import CAUSES, ETA_BAR, FAULT, TOTAL, UNEXPLAINED, column
from beaver_ftc.studies.mismatch.states import AXES
from beaver_ftc.studies.mismatch.tables import Document, label, percent

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from beaver_ftc.studies.mismatch.linear import LinearAnalysis

DPI = 110
AXIS_NAMES = {"p": "roll p", "q": "pitch q", "r": "yaw r"}
SHOWN_SOURCES = 4  # curves an eye can follow in one panel
LEAST_CURVE = 1e-3  # of the largest source: a smaller one is a line at zero
LEAST_SHARE = 1e-5  # of the bound: what is smaller is not drawn
# Of two sources with one colour no flight is known to show both.
SOURCE_LOOKS: dict[str, tuple[str, tuple[float, ...]]] = {
    "sensors": (SKY, (4, 1)), "actuators": (PURPLE, (6, 2, 1, 2)), "simplification": (VERMILION, ()),
    "engine": (VERMILION, (7, 2)), "coefficients": (GREEN, ()), "inertia": (PURPLE, (3, 1)),
    "inertia_coupling": (GREEN, (2, 2)), "sinusoids": (BLUE, ()), "wind_turbulence": (SKY, ()),
    "earth_rotation": (ORANGE, (1, 1)), "integration": (ORANGE, (6, 2)),
}  # fmt: skip
MODEL_LOOKS: dict[str, dict[str, Any]] = {
    "truth": {"color": BLACK, "linewidth": 2.6, "alpha": 0.45, "marker": "o", "label": "truth (JSBSim)"},
    "fdc": {"color": BLUE, "linewidth": 1.3, "dashes": (5, 2), "marker": "+", "label": "FDC equations"},
    "design": {
        "color": VERMILION,
        "linewidth": 1.3,
        "dashes": (1.5, 1.5),
        "marker": "x",
        "label": "design model",
    },
}


def write_figures(folder: Path, found: Document, flown: Document, analysis: "LinearAnalysis") -> list[Path]:
    """Draw the mismatch of a result folder that holds `mismatch.parquet`; return the files."""
    drawn = {
        "mismatch-sources": sources_figure(folder / "mismatch.parquet", found, marks(flown)),
        "mismatch-bound": bound_figure(found),
        "mismatch-linear": linear_figure(analysis, found["scenario"]),
        "mismatch-zeros": zeros_figure(analysis, found["scenario"]),
        "mismatch-response": response_figure(analysis, found["scenario"]),
    }
    return [save(figure, folder / "figures" / f"{name}.png") for name, figure in drawn.items()]


def save(figure: "Figure", path: Path) -> Path:
    """Write a figure; the same figure gives the same file."""
    path.parent.mkdir(exist_ok=True)
    figure.savefig(path, metadata={"Software": "beaver-ftc"})
    return path


def new_figure(width: float, height: float, title: str) -> "Figure":
    """An empty figure, inches, without matplotlib's global state."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), dpi=DPI, layout="constrained")
    figure.suptitle(title, fontsize=11)
    return figure


def sources_figure(frames: Path, found: Document, instants: Sequence[Mark]) -> "Figure":
    """The largest sources and what they add up to without the fault, over the bound, per axis."""
    chosen = {axis: largest_sources(found, axis) for axis in AXES}
    names = {axis: [TOTAL, FAULT, ETA_BAR, *chosen[axis]] for axis in AXES}
    series = read_series(frames, [column(axis, name) for axis in AXES for name in names[axis]])
    figure = new_figure(
        11.0, 8.0, f"Truth less design: what it is made of, faults aside\n{found['scenario']}"
    )
    grid = figure.subplots(3, 1, sharex=True)
    for axis, axes in zip(AXES, grid, strict=True):
        _draw_sources(axes, series, axis, chosen[axis], instants)
    grid[-1].set_xlabel("time (s)", fontsize=9)
    return figure


def largest_sources(found: Document, axis: str) -> list[str]:
    """The sources of an axis with the largest peaks, faults aside, largest first."""
    by_peak = sorted(CAUSES, key=lambda name: -found["axes"][axis][name]["max"])
    least = LEAST_CURVE * found["axes"][axis][by_peak[0]]["max"]
    return [name for name in by_peak[:SHOWN_SOURCES] if found["axes"][axis][name]["max"] >= least]


def _draw_sources(axes: "Axes", series: dict, axis: str, chosen: list[str], instants: Sequence[Mark]) -> None:
    t, bound = series["t_s"], series[column(axis, ETA_BAR)]
    axes.fill_between(t, -bound, bound, color=SKY, alpha=0.25, linewidth=0, label="± bound eta_bar")
    uncertainty = series[column(axis, TOTAL)] - series[column(axis, FAULT)]
    axes.plot(t, uncertainty, color=BLACK, linewidth=2.4, alpha=0.35, label="all together")
    for name in chosen:
        colour, dashes = SOURCE_LOOKS[name]
        style = (0, dashes) if dashes else "-"
        axes.plot(
            t, series[column(axis, name)], color=colour, linestyle=style, linewidth=1.3, label=label(name)
        )
    for i, mark in enumerate(instants):
        axes.axvline(mark.time_s, color=mark.colour, linewidth=0.9, linestyle=(0, mark.dash or (1, 0)))
        axes.annotate(
            mark.letter,
            (mark.time_s, 1.0),
            xycoords=("data", "axes fraction"),
            xytext=(0, 2 + 9 * (i % 2)),  # neighbours do not collide
            textcoords="offset points",
            fontsize=8,
        )
    _dress(axes, f"{AXIS_NAMES[axis]} (rad/s²)")
    axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=8, frameon=False)


def _dress(axes: "Axes", ylabel: str) -> None:
    axes.set_ylabel(ylabel, fontsize=9)
    axes.tick_params(labelsize=8)
    axes.grid(color=GREY, alpha=0.3, linewidth=0.5)
    axes.margins(x=0.01)


def bound_figure(found: Document) -> "Figure":
    """How much of the bound each source has used at most, per axis, on a logarithmic scale."""
    names = [name for name in (*SOURCES, UNEXPLAINED) if _shares(found, name).max() > LEAST_SHARE]
    figure = new_figure(
        11.0, 1.6 + 0.34 * max(len(names), 2), f"Largest share of the bound eta_bar\n{found['scenario']}"
    )
    grid = figure.subplots(1, 3, sharey=True, sharex=True)
    top = max((_shares(found, name).max() for name in names), default=1.0)
    for i, (axis, axes) in enumerate(zip(AXES, grid, strict=True)):
        _draw_bound(axes, AXIS_NAMES[axis], names, [float(_shares(found, name)[i]) for name in names], top)
    grid[0].set_yticks(range(len(names)), [label(name) for name in names], fontsize=9)
    grid[0].invert_yaxis()
    return figure


def _shares(found: Document, name: str) -> np.ndarray:
    """Largest share of the bound per axis, (3,); a source over no bound counts as far beyond it."""
    shares = [found["axes"][axis][name]["bound_share"] for axis in AXES]
    return np.array([1e6 if share is None else share for share in shares])


def _draw_bound(axes: "Axes", title: str, names: list[str], shares: list[float], top: float) -> None:
    drawn = [max(share, LEAST_SHARE) for share in shares]
    colours = [GREY if name == FAULT else VERMILION if share > 1.0 else BLUE for name, share in
               zip(names, shares, strict=True)]  # fmt: skip
    axes.barh(range(len(names)), drawn, color=colours, height=0.7)
    for row, share in enumerate(shares):
        if share > LEAST_SHARE:
            axes.annotate(f" {percent(share)}", (share, row), va="center", fontsize=8)
    axes.axvline(1.0, color=BLACK, linewidth=1.0, dashes=(4, 2))
    axes.set_xscale("log")
    axes.set_xlim(LEAST_SHARE, 30.0 * max(top, 1.0))
    axes.set_title(title, fontsize=10)
    axes.set_xlabel("share of eta_bar (1: all of it)", fontsize=9)
    axes.tick_params(labelsize=8)


def linear_figure(analysis: "LinearAnalysis", name: str) -> "Figure":
    """Poles, and the frequency responses from each surface to its rate."""
    figure = new_figure(
        14.0, 6.4, f"Linear models at trim, {analysis.point.airspeed_mps:g} m/s and "
        f"{analysis.point.altitude_m:g} m\n{name}"
    )  # fmt: skip
    grid = figure.subplot_mosaic(
        [["poles", "m0", "m1", "m2"], ["near", "p0", "p1", "p2"]], width_ratios=[1.4, 1, 1, 1]
    )
    _draw_poles(grid["poles"], analysis, "all poles")
    _draw_poles(grid["near"], analysis, "near the origin")
    grid["near"].set_xlim(-0.12, 0.06)
    grid["near"].set_ylim(-0.5, 0.5)
    for i, (surface, rate) in enumerate(CHANNELS):
        _draw_bode(grid[f"m{i}"], grid[f"p{i}"], analysis, surface, rate)
    grid["m0"].set_ylabel("magnitude (dB, rad/s per rad)", fontsize=9)
    grid["p0"].set_ylabel("phase (deg)", fontsize=9)
    handles, labels = grid["m0"].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3, fontsize=9, frameon=False)
    return figure


def _draw_poles(axes: "Axes", analysis: "LinearAnalysis", title: str) -> None:
    for model, look in MODEL_LOOKS.items():
        poles = np.linalg.eigvals(analysis.models[model].A)
        axes.scatter(
            poles.real, poles.imag, marker=look["marker"], color=look["color"], s=70, label=look["label"],
            alpha=look.get("alpha", 1.0),
        )  # fmt: skip
    axes.axvline(0.0, color=GREY, linewidth=0.8)
    axes.set_title(title, fontsize=10)
    axes.set_xlabel("real part (1/s)", fontsize=9)
    _dress(axes, "imaginary part (rad/s)")


def _draw_bode(magnitude: "Axes", phase: "Axes", analysis: "LinearAnalysis", surface: str, rate: str) -> None:
    frequency = np.geomspace(0.01, 50.0, 300)
    for model, look in MODEL_LOOKS.items():
        of = analysis.models[model]
        found = response(of.A, of.B[:, of.inputs.index(surface)], of.states.index(rate), frequency)
        magnitude.semilogx(frequency, 20.0 * np.log10(np.abs(found)), **_line(look))
        phase.semilogx(frequency, np.degrees(np.unwrap(np.angle(found))), **_line(look))
    magnitude.set_title(f"{surface} to {rate}", fontsize=10)
    phase.set_xlabel("frequency (rad/s)", fontsize=9)
    for axes in (magnitude, phase):
        _dress(axes, "")


def _line(look: dict[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in look.items() if key != "marker"}


def zeros_figure(analysis: "LinearAnalysis", name: str) -> "Figure":
    """Zeros from each surface to its rate, over the truth's poles: what cancels, what is misplaced."""
    figure = new_figure(14.0, 4.8, f"Zeros from surface to rate, over the truth's poles (grey dots)\n{name}")
    row = figure.subplots(1, 3)
    poles = np.linalg.eigvals(analysis.models["truth"].A)
    for (surface, rate), axes in zip(CHANNELS, row, strict=True):
        axes.scatter(poles.real, poles.imag, color=GREY, s=14)
        for look, model in ((look, analysis.models[name]) for name, look in MODEL_LOOKS.items()):
            found = zeros(model.A, model.B[:, model.inputs.index(surface)], model.states.index(rate))
            hollow = (
                {"facecolors": "none", "edgecolors": look["color"]}
                if look["marker"] == "o"
                else {"color": look["color"]}
            )
            axes.scatter(found.real, found.imag, marker=look["marker"], s=80, label=look["label"], **hollow)
        axes.axvline(0.0, color=GREY, linewidth=0.8)
        axes.set_title(f"{surface} to {rate}", fontsize=10)
        axes.set_xlabel("real part (1/s)", fontsize=9)
        _dress(axes, "")
    row[0].set_ylabel("imaginary part (rad/s)", fontsize=9)
    figure.legend(
        *row[0].get_legend_handles_labels(), loc="outside lower center", ncols=3, fontsize=9, frameon=False
    )
    return figure


def response_figure(analysis: "LinearAnalysis", name: str) -> "Figure":
    """Each rate after a pulse of its surface: 1 deg for 1 s."""
    t, pulse = np.arange(0.0, 15.0, 0.02), np.radians(1.0)
    figure = new_figure(11.0, 6.4, f"Rates after 1 deg of the surface for 1 s, linear models\n{name}")
    grid = figure.subplots(3, 1, sharex=True)
    for (surface, rate), axes in zip(CHANNELS, grid, strict=True):
        for model, look in MODEL_LOOKS.items():
            of = analysis.models[model]
            found = pulse_response(of.A, of.B[:, of.inputs.index(surface)], of.states.index(rate), t, 1.0)
            axes.plot(t, np.degrees(pulse * found), **_line(look))
        _dress(axes, f"{rate} after {surface} (deg/s)")
    grid[-1].set_xlabel("time (s)", fontsize=9)
    handles, labels = grid[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3, fontsize=9, frameon=False)
    return figure


def comparison_figure(entries: Sequence[Document]) -> "Figure":
    """How much of the bound each flight has needed, per axis, on a logarithmic scale."""
    figure = new_figure(
        12.0, 1.6 + 0.38 * max(len(entries), 2), "Mismatch at its worst, faults aside, over the bound"
    )
    grid = figure.subplots(1, 3, sharey=True, sharex=True)
    ratios = np.array([[_ratio(each, axis) for each in entries] for axis in AXES])
    for axis, axes, row in zip(AXES, grid, ratios, strict=True):
        _draw_ratios(axes, AXIS_NAMES[axis], row, [each[f"{axis}_dominant"] for each in entries])
        axes.set_xlim(min(0.1, 0.5 * ratios.min()), 60.0 * max(ratios.max(), 1.0))
    grid[0].set_yticks(range(len(entries)), [each["scenario"] for each in entries], fontsize=9)
    grid[0].invert_yaxis()
    return figure


def _ratio(of: Document, axis: str) -> float:
    ratio = of[f"{axis}_worst_ratio"]
    return 1e6 if ratio is None else max(ratio, 1e-6)


def _draw_ratios(axes: "Axes", title: str, ratios: np.ndarray, reasons: list[str]) -> None:
    colours = [VERMILION if ratio > 1.0 else BLUE for ratio in ratios]
    axes.barh(range(len(ratios)), ratios, color=colours, height=0.7)
    for row, (ratio, reason) in enumerate(zip(ratios, reasons, strict=True)):
        axes.annotate(f" {percent(float(ratio))} ({label(reason)})", (ratio, row), va="center", fontsize=7)
    axes.axvline(1.0, color=BLACK, linewidth=1.0, dashes=(4, 2))
    axes.set_xscale("log")
    axes.set_title(title, fontsize=10)
    axes.set_xlabel("largest mismatch / eta_bar", fontsize=9)
    axes.tick_params(labelsize=8)
    axes.grid(axis="x", color=GREY, alpha=0.3, linewidth=0.5)


def map_figure(entries: Sequence[Document], name: str) -> "Figure":
    """The worst share of the bound against speed and altitude, per axis; grey where there is no trim."""
    from matplotlib.colors import LogNorm

    speeds, altitudes = (list(dict.fromkeys(e[of] for e in entries)) for of in ("airspeed_mps", "altitude_m"))
    shape = len(altitudes), len(speeds), len(AXES)  # the order of the entries
    worst = [np.nan if each["worst_ratio"] is None else each["worst_ratio"] for each in entries]
    grids = dict(zip(AXES, np.moveaxis(np.reshape(worst, shape), -1, 0), strict=True))
    known = np.concatenate([grid[np.isfinite(grid)] for grid in grids.values()] or [np.ones(1)])
    known = known[known > 0.0] if (known > 0.0).any() else np.ones(1)
    norm = LogNorm(vmin=min(known.min(), 0.99), vmax=max(known.max(), 1.01))
    figure = new_figure(14.0, 4.6, f"Largest mismatch over the bound eta_bar, no fault\n{name}")
    row = figure.subplots(1, 3, sharey=True)
    for axis, axes in zip(AXES, row, strict=True):
        image = _draw_map(axes, grids[axis], norm)
        axes.set_title(AXIS_NAMES[axis], fontsize=10)
        axes.set_xticks(range(len(speeds)), [f"{V:g}" for V in speeds], fontsize=8)
        axes.set_yticks(range(len(altitudes)), [f"{h:g}" for h in altitudes], fontsize=8)
        axes.set_xlabel("airspeed (m/s)", fontsize=9)
    row[0].set_ylabel("altitude (m)", fontsize=9)
    figure.colorbar(image, ax=row, label="mismatch / eta_bar (1: all of the bound)", pad=0.01)
    return figure


def _draw_map(axes: "Axes", grid: np.ndarray, norm):
    from matplotlib import colormaps

    shades = colormaps["cividis"].with_extremes(bad="0.8")
    image = axes.imshow(grid, origin="lower", aspect="auto", cmap=shades, norm=norm)
    for (i, j), ratio in np.ndenumerate(grid):
        bright = np.isfinite(ratio) and norm(ratio) > 0.5
        text = f"{ratio:.2g}" if np.isfinite(ratio) else "no trim"
        colour = "black" if bright or text == "no trim" else "white"
        weight = "bold" if ratio > 1.0 else "normal"
        axes.annotate(text, (j, i), ha="center", va="center", fontsize=8, color=colour, weight=weight)
    return image
