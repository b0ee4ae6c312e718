"""One figure for each published figure, with its panels, in the same looks as all other figures.

A further figure shows the sensitivity: the ratio of each number and its limit over all settings.
"""

from math import inf
from textwrap import fill
from typing import TYPE_CHECKING

import numpy as np

from beaver_ftc.results.figures import draw
from beaver_ftc.results.model import Document
from beaver_ftc.results.style import BLACK, BLUE, GREY, VERMILION, marks
from beaver_ftc.results.views import (
    AXES,
    AXIS_NAMES,
    Panel,
    Trace,
    View,
    detection_panel,
    isolation_panel,
)
from beaver_ftc.studies.engine.statistics import or_never
from beaver_ftc.studies.present.page import Files, Summary
from beaver_ftc.studies.reproduce.cases import Flown
from beaver_ftc.studies.reproduce.choices import FAULT_AT_S
from beaver_ftc.studies.reproduce.claims import BORNE_OUT, CANNOT_BE_JUDGED, NOT_BORNE_OUT, STRONGER

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SENSITIVITY = "sensitivity"
_LEAST, _MOST = 1e-3, 10.0  # ends of the axis; a published ratio beyond is drawn at the end as an arrow
# Verdicts in the order of the rows from above. Testable statements that cannot be judged hold in their
# ablation.
_GROUPS = (NOT_BORNE_OUT, CANNOT_BE_JUDGED, BORNE_OUT, STRONGER)
_LINE = 60  # characters of a line of a label
_CLIPPED = {_LEAST: "<", _MOST: ">"}  # marker of a ratio at an end of the axis
WHOLE = (0.0, np.inf)  # spans of time, s
CLOSE = (FAULT_AT_S - 0.5, FAULT_AT_S + 5.0)


def _pair(label: str, target: tuple[str, str, str], actual: str) -> Panel:
    """A panel of a signal and its target. target: column, label, role. actual: column of the signal."""
    return Panel(label, (Trace(*target), Trace(actual, "actual", "actual")))


def _tracking(surfaces: tuple[str, str], axis: str) -> tuple[Panel, ...]:
    """Four panels: two surfaces, the errors of all rates, and the rate of one axis."""
    surface_panels = (
        _pair(f"{name} deflection", (f"{name}_cmd_rad", "command", "command"), f"{name}_effective_rad")
        for name in surfaces
    )
    errors = tuple(Trace(f"{axis}_error_rad_s", f"error of {axis}", axis) for axis in AXES)
    rate = _pair(AXIS_NAMES[axis], (f"{axis}_model_rad_s", "reference", "target"), f"{axis}_rad_s")
    return (*surface_panels, Panel("tracking errors", errors), rate)


def _isolation(estimator: str) -> tuple[Panel, ...]:
    """The residuals of an isolation estimator within their thresholds, a panel for each axis."""
    return tuple(isolation_panel(estimator, axis, f"{AXIS_NAMES[axis]}: residual") for axis in AXES)


_PITCH = _tracking(("elevator", "flap"), "q")
_ROLL, _YAW = (_tracking(("aileron", "rudder"), axis) for axis in "pr")
_DETECTION = tuple(detection_panel(axis, f"{AXIS_NAMES[axis]}: residual", "actual") for axis in AXES)
_SHOWN = (  # name, title, panels, case, span of time
    ("fig-2a", "Fig. 2a: nominal law, no fault", _PITCH, "fault-free-nominal", WHOLE),
    ("fig-2b", "Fig. 2b: nominal law, 40 % loss of the elevator", _PITCH, "elevator-nominal", WHOLE),
    ("fig-3", "Fig. 3: detection of the elevator fault", _DETECTION, "elevator", WHOLE),
    ("fig-4a", "Fig. 4a: isolation estimator 1, aileron", _isolation("aileron"), "elevator", CLOSE),
    ("fig-4b", "Fig. 4b: isolation estimator 2, elevator", _isolation("elevator"), "elevator", CLOSE),
    ("fig-4c", "Fig. 4c: isolation estimator 3, rudder", _isolation("rudder"), "elevator", CLOSE),
    ("fig-5", "Fig. 5: fault-tolerant law, elevator to flap", _PITCH, "elevator", WHOLE),
    ("fig-6", "Fig. 6: nominal law, unanticipated fault", _PITCH, "unanticipated-nominal", WHOLE),
    ("fig-7", "Fig. 7: fault-tolerant law, unanticipated fault", _PITCH, "unanticipated", WHOLE),
    ("aileron", "Sec. VII.A: aileron fault", _ROLL, "aileron", WHOLE),
    ("rudder", "Sec. VII.A: rudder fault", _YAW, "rudder", WHOLE),
    (
        "unanticipated-detection", "Sec. VII.B: detection of the unanticipated fault", _DETECTION,
        "unanticipated", CLOSE,
    ),
    ("as-printed", "Eq. (2) as printed, no fault: detection", _DETECTION, "as-printed", (0.0, 5.0)),
)  # fmt: skip
FIGURES: tuple[tuple[View, str, tuple[float, float]], ...] = tuple(  # view, case, span of time
    (View(name, title, panels, n_panel_columns=2 if len(panels) > len(AXES) else 1), case, span)
    for name, title, panels, case, span in _SHOWN
)


def figures_of(document: Summary) -> Files:
    """The figures by name of their files. document.behind: the flights by name of their case."""
    drawn = {f"{view.name}.png": _drawn(view, document.behind[case], span) for view, case, span in FIGURES}
    return {**drawn, f"{SENSITIVITY}.png": margins_figure(document)}


def _drawn(view: View, flight: Flown, span: tuple[float, float]) -> "Figure":
    """A view of the log within a span of time, s. Tracking errors are added to the columns of the log."""
    is_shown = flight.between(*span)
    errors = {f"{axis}_error_rad_s": np.radians(flight.error_deg_s(axis)) for axis in AXES}
    series = {name: values[is_shown] for name, values in {**flight.log, **errors}.items()}
    return draw(view, series, marks(flight.metrics), "flown again in JSBSim")


def shares(claim: Document) -> tuple[float, float, float]:
    """The lowest ratio, the ratio in the published setting, and the highest ratio of number and limit; at
    most 1 where the statement holds. If the number must be at least the limit, its lowest value has the
    highest ratio."""
    low, published, high = (_share(claim, claim[key]) for key in ("lowest", "number", "highest"))
    return min(low, published, high), published, max(low, published, high)


def _share(claim: Document, number: float | None) -> float:
    """number / limit, or limit / number if the number is to be at least the limit: 1 or less keeps the limit.
    0 / 0 is 0, a larger number / 0 infinite. A number that is None never comes, and counts as infinite."""
    size = or_never(number)
    limit = claim["limit"]
    numerator, denominator = (limit, size) if claim["at_least"] else (size, limit)
    if denominator:
        return numerator / denominator
    return inf if numerator > 0.0 else 0.0


def margins_figure(document: Document) -> "Figure":
    """A row for each testable statement, ordered by verdict: the range of its ratio over all settings in
    which it is flown, and the ratio in the published setting."""
    from matplotlib.figure import Figure

    claims = [claim for claim in document["claims"] if not claim["reason"] and not claim["construction"]]
    claims.sort(key=lambda claim: (_GROUPS.index(claim["verdict"]), -shares(claim)[1]))
    figure = Figure(figsize=(9.0, 1.2 + 0.31 * len(claims)), dpi=110)
    axes = figure.subplots(gridspec_kw={"left": 0.5, "right": 0.97, "top": 0.97, "bottom": 0.075})
    for row, claim in enumerate(claims):
        low, published, high = (min(max(share, _LEAST), _MOST) for share in shares(claim))
        colour, width = (BLUE, 2.5) if high <= 1 else (VERMILION, 6.0)
        axes.plot([low, high], [row, row], color=colour, linewidth=width, alpha=0.55)
        axes.plot(published, row, _CLIPPED.get(published, "o"), color=BLACK, markersize=5)
        if row and claim["verdict"] != claims[row - 1]["verdict"]:
            axes.axhline(row - 0.5, color=GREY, linewidth=1.0)
    axes.axvline(1.0, color=BLACK, linewidth=1.0)
    axes.set_xscale("log")
    axes.set_xlim(0.8 * _LEAST, 1.25 * _MOST)
    axes.set_ylim(len(claims) - 0.5, -0.5)
    axes.set_yticks(range(len(claims)), [_label(claim) for claim in claims], fontsize=8)
    axes.tick_params(axis="x", labelsize=8)
    axes.grid(axis="x", color="#dddddd", linewidth=0.6)
    axes.set_xlabel("ratio of number and limit (arrow: beyond the axis)", fontsize=9)
    axes.set_title("left of 1 the number keeps its limit", fontsize=9)
    axes.plot([], [], "o", color=BLACK, markersize=5, label="as published")
    axes.plot([], [], color=BLUE, linewidth=2.5, alpha=0.55, label="all settings: always kept")
    axes.plot([], [], color=VERMILION, linewidth=6.0, alpha=0.55, label="all settings: not always kept")
    axes.legend(
        loc="upper right", bbox_to_anchor=(1.0, -0.045), ncols=3, fontsize=8
    )  # below: no corner is free
    return figure


def _label(claim: Document) -> str:
    """The place of a statement in the paper, and its words, in at most two lines."""
    return fill(f"{claim['where']}: {claim['statement']}", _LINE, max_lines=2, placeholder=" ...")
