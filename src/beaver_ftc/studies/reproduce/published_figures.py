"""One figure for each published figure, with its panels, in the same looks as all other figures."""

from typing import TYPE_CHECKING

import numpy as np

from beaver_ftc.results.figures import draw
from beaver_ftc.results.panels import Panel, Trace, View
from beaver_ftc.results.style import marks
from beaver_ftc.results.views import AXES, AXIS_NAMES, detection_panel, isolation_panel
from beaver_ftc.studies.present.page import Files, Summary
from beaver_ftc.studies.reproduce.choices import FAULT_AT_S
from beaver_ftc.studies.reproduce.flown import Flown
from beaver_ftc.studies.reproduce.margins_figure import margins_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SENSITIVITY = "sensitivity"
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
