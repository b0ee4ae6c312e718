import numpy as np
import pytest

from beaver_ftc.results.figures import draw
from beaver_ftc.results.log import StoredLog
from beaver_ftc.results.pictures import pictures_of, save
from beaver_ftc.results.series import series_of
from beaver_ftc.results.style import LOOKS, marks
from beaver_ftc.results.views import views


@pytest.mark.parametrize("kind", ["png", "pdf", "svg"])
def test_the_same_flight_gives_the_same_bytes(log_path, found, tmp_path, kind):
    file = tmp_path / f"tracking.{kind}"
    (picture,) = [one for one in pictures_of(log_path, found, tmp_path, [kind]) if one.path == file]
    save(picture)
    first = file.read_bytes()
    save(picture)
    assert file.read_bytes() == first


@pytest.fixture
def panels(log_path, found):
    """The axes of a view, drawn."""
    known = {view.name: view for view in views(StoredLog(log_path).columns)}
    return lambda name: (
        draw(known[name], series_of(StoredLog(log_path), known[name].columns), marks(found), "x").axes
    )


def test_degrees_are_shown_and_said_and_a_threshold_on_both_sides(panels, log_path):
    log = {
        name: np.degrees(of)
        for name, of in StoredLog(log_path).read(["q_rad_s", "q_threshold_rad_s"]).items()
    }
    pitch, detection = panels("tracking")[1], panels("detection")[1]
    assert "deg/s" in pitch.get_title()
    drawn = next(line for line in pitch.lines if line.get_label() == "aircraft")
    assert drawn.get_ydata() == pytest.approx(log["q_rad_s"])
    bounds = [line.get_ydata()[-1] for line in detection.lines if line.get_label() in ("± threshold", "_")]
    last = log["q_threshold_rad_s"][-1]
    assert sorted(bounds) == pytest.approx([-last, last], rel=1e-3)


def test_no_two_curves_of_one_figure_look_the_same(log_path):
    for view in views(StoredLog(log_path).columns):
        if view.n_panel_columns > 1:
            continue
        looks = {}
        for trace in (trace for panel in view.panels for trace in panel.traces if trace.label):
            look = (LOOKS[trace.role].colour, LOOKS[trace.role].dash)
            looks.setdefault(look, set()).add(trace.label)
        if all(len(panel.traces) > 1 for panel in view.panels):
            assert [labels for labels in looks.values() if len(labels) > 1] == [], view.name
