import matplotlib.image
import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from synthetic import Flight, Scenario, rows

from beaver_ftc.results.figures import draw, write_figures
from beaver_ftc.results.log import ParquetLog
from beaver_ftc.results.metrics import measure
from beaver_ftc.results.style import LOOKS, closeup_window, marks
from beaver_ftc.results.views import Panel, Trace, View, read_series, views

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


def test_flight_without_alarm_says_that_the_isolation_never_ran(tmp_path):
    quiet = Flight(scenario=Scenario(faults=()), detection_time_s=None, isolation_time_s=None, isolated=None)
    data = rows(quiet)
    data[:, [i for i, name in enumerate(quiet.columns) if name.startswith("fie_")]] = np.nan
    with ParquetLog(tmp_path / "log.parquet") as log:
        log.open(quiet.columns)
        log.write(data)
    view = next(view for view in views(quiet.columns) if view.name == "isolation")
    series = read_series(tmp_path / "log.parquet", view.columns)
    assert all(
        axes.texts[0].get_text() == view.text_without_data for axes in _panels(quiet, series, "isolation")
    )
    assert closeup_window(marks(measure(quiet))) is None


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


def test_a_long_legend_takes_more_lines_and_stays_below_the_panels_and_inside():
    traces = tuple(Trace(f"x{i}", f"the loss of a surface of the kind {i:02}", "actual") for i in range(14))
    view = View("likelihood", "Of many", (Panel("all of them", traces),))
    series = {"t_s": np.arange(5.0), **{f"x{i}": np.arange(5.0) + i for i in range(14)}}
    figure = draw(view, series, [], "x")
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    (legend,), renderer = figure.legends, canvas.get_renderer()
    taken, label = legend.get_window_extent(renderer), figure.axes[0].xaxis.label.get_window_extent(renderer)
    assert 0.0 <= taken.x0 < taken.x1 <= figure.bbox.width
    assert 0.0 <= taken.y0 < taken.y1 <= label.y0 + 1.0
