"""The linear models as a picture: poles and frequency responses side by side."""

from typing import Any

import numpy as np

from beaver_ftc.results.style import BLACK, BLUE, GREY, VERMILION
from beaver_ftc.studies.linear_systems import CHANNELS, response
from beaver_ftc.studies.mismatch.linear import LinearAnalysis
from beaver_ftc.studies.present.figures import Axes, Figure, label_edges, panels

MODEL_LOOKS: dict[str, tuple[str, dict[str, Any]]] = {  # marker of a pole, and curve
    "truth": ("o", {"color": BLACK, "linewidth": 2.6, "alpha": 0.45, "label": "truth (JSBSim)"}),
    "fdc": ("+", {"color": BLUE, "linewidth": 1.3, "dashes": (5, 2), "label": "FDC equations"}),
    "design": ("x", {"color": VERMILION, "linewidth": 1.3, "dashes": (1.5, 1.5), "label": "design model"}),
}


def dress(axes: Axes) -> None:
    """The look that all panels with curves share."""
    axes.tick_params(labelsize=8)
    axes.grid(color=GREY, alpha=0.3, linewidth=0.5)
    axes.margins(x=0.01)


def linear_figure(analysis: LinearAnalysis, name: str) -> Figure:
    """The poles of all models, and the frequency responses from each surface to its rate."""
    at = f"{analysis.point.airspeed_mps:g} m/s and {analysis.point.altitude_m:g} m"
    title = f"Linear models at trim, {at}\n{name}"
    figure, grid = panels(2, 4, 14.0, 6.4, title, width_ratios=[1.4, 1, 1, 1])
    for axes in grid[:, 0]:
        _draw_poles(axes, analysis)
    grid[1, 0].set(xlim=(-0.12, 0.06), ylim=(-0.5, 0.5))
    for (surface, rate), magnitude, phase in zip(CHANNELS, *grid[:, 1:], strict=True):
        _draw_bode(magnitude, phase, analysis, surface, rate)
    titles = "all poles; below, near the origin", *(f"{surface} to {rate}" for surface, rate in CHANNELS)
    label_edges(grid, "frequency (rad/s)", ["imaginary part (rad/s)"] * 2, titles)
    grid[1, 0].set_xlabel("real part (1/s)", fontsize=9)
    grid[0, 1].set_ylabel("magnitude (dB, rad/s per rad)", fontsize=9)
    grid[1, 1].set_ylabel("phase (deg)", fontsize=9)
    entries = grid[0, 1].get_legend_handles_labels()
    figure.legend(*entries, loc="outside lower center", ncols=len(MODEL_LOOKS), fontsize=9, frameon=False)
    return figure


def _draw_poles(axes: Axes, analysis: LinearAnalysis) -> None:
    """The poles of each model in the complex plane."""
    for model, (mark, look) in MODEL_LOOKS.items():
        poles = np.linalg.eigvals(analysis.models[model].A)
        style = {"color": look["color"], "label": look["label"], "alpha": look.get("alpha", 1.0)}
        axes.scatter(poles.real, poles.imag, s=70, marker=mark, **style)
    axes.axvline(0.0, color=GREY, linewidth=0.8)
    dress(axes)


def _draw_bode(magnitude: Axes, phase: Axes, analysis: LinearAnalysis, surface: str, rate: str) -> None:
    """Magnitude (dB) and phase (deg) from a surface to a rate, over the frequency w in rad/s."""
    w = np.geomspace(0.01, 50.0, 300)
    for model, (_, look) in MODEL_LOOKS.items():
        H = response(*analysis.channel(model, surface, rate), w)
        magnitude.semilogx(w, 20.0 * np.log10(np.abs(H)), **look)
        phase.semilogx(w, np.degrees(np.unwrap(np.angle(H))), **look)
    for axes in (magnitude, phase):
        dress(axes)
