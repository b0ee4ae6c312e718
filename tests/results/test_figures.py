import matplotlib.image
import numpy as np
import pytest
from synthetic import Flight

from beaver_ftc.results.figures import draw, write_figures
from beaver_ftc.results.metrics import measure
from beaver_ftc.results.style import LOOKS, marks
from beaver_ftc.results.views import read_series, views

EVERY = {
    "candidates",
    "tracking",
    "surfaces",
    "detection",
    "isolation",
    "ratio",
    "effectiveness",
    "supervisor",
    "states",
}


def test_every_view_becomes_a_picture_with_something_on_it(log_path, flight, tmp_path):
    files = write_figures(log_path, measure(flight), tmp_path / "figures")
    assert {file.stem.removesuffix("-closeup") for file in files} == EVERY
    assert {file.stem for file in files if "closeup" in file.stem} == {
        "detection-closeup", "candidates-closeup", "isolation-closeup",
    }  # fmt: skip
    for file in files:
        picture = matplotlib.image.imread(file)[..., :3]
        assert (np.abs(picture - 1) > 0.1).any(axis=2).mean() > 0.01


def _panels(flight, series, name):
    view = next(view for view in views(flight.columns) if view.name == name)
    return draw(view, series, marks(measure(flight)), "x").axes


def test_instants_are_marked_in_every_panel(flight, log_path):
    for view in views(flight.columns)[:3]:
        series = read_series(log_path, view.columns)
        for axes in _panels(flight, series, view.name):
            at = {line.get_xdata()[0] for line in axes.lines if line.get_marker() in ("v", "D", "s")}
            assert at == {12.0, 12.07, 12.12}, view.name


def test_degrees_are_shown_and_said(flight, log_path):
    series = read_series(log_path, ["q_rad_s", "q_model_rad_s", "q_reference_rad_s"])
    axes = _panels(flight, series | dict.fromkeys(_others(flight), series["q_rad_s"]), "tracking")[1]
    assert "deg/s" in axes.get_title()
    drawn = next(line for line in axes.lines if line.get_label() == "aircraft")
    assert drawn.get_ydata()[500] == pytest.approx(np.degrees(series["q_rad_s"][500]))


def _others(flight):
    return [
        c for view in views(flight.columns) if view.name == "tracking" for c in view.columns if c[0] != "q"
    ]


def test_threshold_is_drawn_on_both_sides(flight, log_path):
    view = next(view for view in views(flight.columns) if view.name == "detection")
    axes = _panels(flight, read_series(log_path, view.columns), "detection")[1]
    bounds = [line.get_ydata()[-1] for line in axes.lines if line.get_label() in ("± threshold", "_")]
    assert sorted(bounds) == pytest.approx([-np.degrees(0.02), np.degrees(0.02)], rel=1e-3)


def test_no_two_curves_of_one_figure_look_the_same():
    for view in views(Flight().columns):
        if view.n_panel_columns > 1:
            continue
        looks = {}
        for trace in (trace for panel in view.panels for trace in panel.traces if trace.label):
            look = (LOOKS[trace.role].colour, LOOKS[trace.role].dash)
            looks.setdefault(look, set()).add(trace.label)
        if all(len(panel.traces) > 1 for panel in view.panels):
            assert [labels for labels in looks.values() if len(labels) > 1] == [], view.name
