"""Figures of docs/explanation/detection.md and isolation.md, from one built-in flight."""

from functools import cache
from itertools import pairwise

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from scipy.signal import lfilter

import beaver_ftc as bf
from beaver_ftc.design.model import design_of, response
from beaver_ftc.results.style import BLACK, BLUE, GREEN, GREY, ORANGE, VERMILION
from beaver_ftc.scenario.declared import Declared
from beaver_ftc.scenario.diagnosis import DEADBEAT_PER_S
from tools.docs.tables import picture

SCENARIO, SURFACE = "elevator-partial-loss", "elevator"
LOSS, AT_S = 0.08, 12.8  # small, so that alarm and certainty come at different frames
BEFORE_S, AFTER_S, SHOWN_S = 0.1, 0.3, 1.0  # shown of residuals before and after the fault; of the sets
PITCH, DT_S = 1, 0.01
_LOOK = {"font.size": 9, "svg.hashsalt": "beaver-ftc", "svg.fonttype": "none", "font.family": "sans-serif"}


@cache
def _frames() -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Of each frame of the flight: time since the fault, s; innovation nu, its bound and the regressor Z of
    pitch, rad/s2."""
    changes = {"faults[0].magnitude": LOSS, "faults[0].at_s": AT_S, "expect": {}}
    scenario = bf.load(SCENARIO).with_(changes)
    log = bf.fly(scenario).log
    rates = log[[f"{axis}_measured_rad_s" for axis in "pqr"]].to_numpy()
    innovation = np.append(0.0, np.diff(rates[:, PITCH])) / DT_S - log["q_design_rad_s2"].to_numpy()
    bound = log["q_eta_bar_rad_s2"].to_numpy().copy()
    innovation[0] = bound[0] = 0.0
    return log["t_s"].to_numpy() - AT_S, innovation, bound, _regressor(scenario, log, rates)


def _regressor(scenario: bf.Scenario, log: pd.DataFrame, rates: np.ndarray) -> np.ndarray:
    """Z of pitch, rad/s2: the moment that the healthy surface gives, from the frame before."""
    design = design_of(Declared.of(scenario))[0].view(np.recarray)
    signals = ("alpha_rad", "beta_rad", "airspeed_mps", "qdyn_pa", "dpt")
    y, s = log[list(signals)].to_numpy(copy=True), scenario.airframe.surfaces.index(SURFACE)
    u, Z = log[f"{SURFACE}_cmd_rad"].to_numpy(), np.full(len(rates), np.nan)
    f, G = np.zeros(3), np.zeros_like(design.G0)
    for k in range(1, len(rates)):
        response(design, rates[k - 1], y[k - 1], f, G)
        Z[k] = G[PITCH, s] * u[k - 1]
    return Z


def residual_and_threshold() -> str:
    """Residual of pitch rate, its threshold and the effect of the fault, of both filters of the bank."""
    with plt.rc_context(_LOOK):
        figure, axes = plt.subplots(2, 1, figsize=(7.2, 5.2), sharex=True)
        for axis, pole in zip(axes, (10.0, DEADBEAT_PER_S), strict=True):
            _draw_filter(axis, pole)
        axes[1].set_xlabel("time since the fault, s")
        figure.subplots_adjust(left=0.1, right=0.84, top=0.95, bottom=0.1, hspace=0.25)
        return picture("residual-and-threshold.svg", "Residual and threshold about the fault", figure)


def _draw_filter(axis: Axes, pole_per_s: float) -> None:
    """Magnitudes of residual E, threshold T and filtered effect of the fault alone, 1e-3 rad/s, with lines
    labelled at their ends, and the instants of alarm and of certainty."""
    t, innovation, bound, Z = _frames()
    shown = (t > -BEFORE_S) & (t < AFTER_S)
    inputs = (innovation, bound, np.where(t > 1e-6, -LOSS * np.nan_to_num(Z), 0.0))
    a = np.exp(-pole_per_s * DT_S)
    E, T, effect = (1e3 * np.abs(lfilter([DT_S], [1.0, -a], of)) for of in inputs)
    lines = (
        (E, "|E| residual", BLACK, ()),
        (T, "T threshold", VERMILION, (5, 3)),
        (2.0 * T, "2 T", ORANGE, (1.5, 2)),
        (effect, "effect of fault", GREEN, (7, 2, 1.5, 2)),
    )
    for values, _, colour, dashes in lines:
        axis.plot(t[shown], values[shown], color=colour, dashes=dashes or (None, None), lw=1.5)
    ends = np.array([values[shown][-1] for values, *_ in lines])
    for (_, says, colour, _), height in zip(lines, _apart(ends, 0.09 * 1.05 * E[shown].max()), strict=True):
        axis.text(AFTER_S + 0.005, height, says, color=colour, va="center")
    for says, when, height in (("alarm", E > T, 0.08), ("certain", effect > 2.0 * T, 0.2)):
        at = t[np.flatnonzero(when & (t > 1e-6))[0]]
        axis.axvline(at, color=BLUE, lw=0.9)
        axis.text(at + 0.003, height, f"{says}: {at:.2f} s", color=BLUE, transform=axis.get_xaxis_transform())
    axis.axvline(0.0, color=GREY, lw=0.9)
    axis.text(-0.003, 0.92, "fault", color=GREY, ha="right", transform=axis.get_xaxis_transform())
    deadbeat = pole_per_s == DEADBEAT_PER_S
    axis.set_title(
        "one frame alone" if deadbeat else f"filter with the pole {pole_per_s:g} 1/s", loc="left", fontsize=9
    )
    axis.set_ylabel("pitch, 10⁻³ rad/s")
    axis.set_ylim(0.0, 1.05 * E[shown].max())
    axis.set_xlim(-BEFORE_S, AFTER_S)


def _apart(heights: np.ndarray, least: float) -> np.ndarray:
    """The same heights, moved up as far as labels must be apart."""
    order, moved = np.argsort(heights), heights.copy()
    for below, above in pairwise(order):
        moved[above] = max(moved[above], moved[below] + least)
    return moved


def feasible_set() -> str:
    """The losses of the elevator that are consistent with each frame, and with all frames since the fault."""
    t, *of_frames = _frames()
    struck = (t > 1e-6) & (t < SHOWN_S)
    t, innovation, bound, Z = (of[struck] for of in (t, *of_frames))
    with np.errstate(divide="ignore", invalid="ignore"):
        ends = np.clip(-(innovation + np.array([[-1.0], [1.0]]) * bound) / Z, 0.0, 1.0)
    low, high = ends.min(axis=0), ends.max(axis=0)
    least, largest = np.maximum.accumulate(low), np.minimum.accumulate(high)
    with plt.rc_context(_LOOK):
        figure, axis = plt.subplots(figsize=(7.2, 3.2))
        axis.vlines(t, 100 * low, 100 * high, color=GREY, lw=1.2)
        axis.fill_between(t, 100 * least, 100 * largest, color=ORANGE, alpha=0.55, step="mid", lw=0)
        axis.axhline(100 * LOSS, color=GREEN, dashes=(6, 3), lw=1.4)
        axis.text(0.02, 23, "grey: one frame alone", color="#5a5a5a")
        axis.text(0.02, 26, "orange: all frames since the alarm", color="#8a5f00")
        axis.text(0.02, 29, f"dashed: true loss, {100 * LOSS:g} %", color=GREEN)
        axis.set_xlabel("time since the fault, s")
        axis.set_ylabel("loss of effectiveness, %")
        axis.set_ylim(0.0, 32.0)
        axis.set_xlim(0.0, SHOWN_S)
        figure.subplots_adjust(left=0.09, right=0.98, top=0.96, bottom=0.16)
        return picture("feasible-set.svg", "The feasible set of the loss shrinks", figure)
