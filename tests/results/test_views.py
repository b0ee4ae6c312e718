"""Every view of a log with all that a log can hold: as a table, and as the figure drawn of it."""

import numpy as np
import pytest
from synthetic import LOSS, landed, scenario

from beaver_ftc.results.figures import draw
from beaver_ftc.results.metrics import measure
from beaver_ftc.results.panels import Panel, Trace, View
from beaver_ftc.results.simulation import Simulation
from beaver_ftc.results.style import closeup_window, marks
from beaver_ftc.results.views import estimators, power_column, surfaces, views

MORE = (
    "watch_share", *(f"{s}_loss_likelihood_share" for s in ("elevator", "flap")),
    *(f"{a}_step_likelihood_share" for a in "pqr"),
    *(f"{channel}_command{unit}" for channel, unit in (
        ("altitude", "_m"), ("airspeed", "_mps"), ("heading", "_rad"), ("bank", "_rad"))),
    "airspeed_limited_mps", "manifold_pressure_inhg",
)  # fmt: skip
EVERY = Simulation({"name": "x", "duration_s": 1}).columns + MORE
ALL = {view.name: view for view in views(EVERY, power=True)}


def test_which_views_a_log_allows():
    assert list(ALL) == [
        "tracking", "profile", "surfaces", "detection", "watch", "likelihood", "candidates", "isolation",
        "ratio", "effectiveness", "supervisor", "engine", "states",
    ]  # fmt: skip
    assert "engine" not in {view.name for view in views(EVERY)}
    assert "profile" not in {view.name for view in views(set(EVERY) - {"bank_command_rad"})}
    unlimited = {view.name: view for view in views([c for c in EVERY if c != "airspeed_limited_mps"])}
    assert [len(panel.traces) for panel in unlimited["profile"].panels] == [2, 3, 2, 2, 1]
    assert estimators(EVERY) == ("aileron", "elevator", "rudder")
    assert surfaces(EVERY) == ("aileron", "elevator", "rudder", "flap")
    assert views(["t_s"]) == ()


def test_the_column_of_the_engine_power_is_neither_of_the_monitor_nor_a_difference():
    before, first = ("detected", "watch_share", "watch_test", "watch_missing"), "altitude_command_m"
    assert power_column((*before, first)) == ""
    assert power_column((*before, "throttle", "left_difference", first)) == "throttle"


T_S = np.arange(0.0, 20.0, 0.5)


@pytest.mark.parametrize("ratio", [0.0, -3.0])
def test_a_ratio_that_is_never_positive_is_drawn_without_a_warning(ratio, recwarn):
    """As of a flight whose sensor monitor alarms in the first frame."""
    low = View("low", "Low", (Panel("low", (Trace("y", "low", "p"),), log_scale=True, line_at=1.0),))
    figure = draw(low, {"t_s": T_S[:9], "y": np.full(9, ratio)}, [], "x")
    figure.canvas.draw()
    (axes,) = figure.axes
    drawn = (one for one in recwarn if one.category is not ResourceWarning)  # which other tests may leave
    assert [str(one.message) for one in drawn] == []
    assert (axes.get_yscale(), *axes.get_ylim()) == ("log", 0.1, 10.0)


def test_a_window_without_a_fault():
    late_fault = scenario(LOSS | {"at_s": 25.0})
    unseen = {"detection_time_s": None, "isolation_time_s": None}
    lost = marks(measure(landed(late_fault, **unseen, departure=(14.5, "alpha_rad"))))
    assert [mark.name for mark in lost] == ["departure"]
    assert closeup_window(lost) == (14.0, 16.5)
    late = marks(measure(landed(detection_time_s=12.25, isolation_time_s=22.5, departure=(29.0, "beta"))))
    assert closeup_window(late) == (11.5, 24.0)  # ten seconds of events are enough to look at closely
    assert closeup_window([one for one in late if one.name != "isolation"]) == (11.5, 14.25)
