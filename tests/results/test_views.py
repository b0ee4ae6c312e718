"""Every view of a log with all that a log can hold: as a table, and as the figure drawn of it."""

from dataclasses import asdict

import numpy as np
import pytest
from synthetic import COLUMNS, Fault, Flight, Scenario

from beaver_ftc.results import figures
from beaver_ftc.results.figures import draw
from beaver_ftc.results.metrics import measure, metrics
from beaver_ftc.results.model import Metrics
from beaver_ftc.results.style import closeup_window, marks
from beaver_ftc.results.views import (
    Panel,
    Trace,
    View,
    _residual_over_threshold,
    estimators,
    series_of,
    source_columns,
    surfaces,
    surfaces_by_kind,
    views,
)
from kept import picture

MORE = (
    "watch_share", *(f"{s}_loss_likelihood_share" for s in ("elevator", "flap")),
    *(f"{a}_step_likelihood_share" for a in "pqr"),
    *(f"{channel}_command{unit}" for channel, unit in (
        ("altitude", "_m"), ("airspeed", "_mps"), ("heading", "_rad"), ("bank", "_rad"))),
    "airspeed_limited_mps", "manifold_pressure_inhg",
)  # fmt: skip
EVERY = COLUMNS + MORE
ALL = {view.name: view for view in views(EVERY, power=True)}


def _panels(view):
    """Of each panel what differs from the least, with its unit and its traces' factors."""
    for panel in view.panels:
        said = {key: value for key, value in asdict(panel).items() if value not in ("", (), None, False)}
        said["traces"] = [[t.column, t.label, t.role, round(t.factor, 6)] for t in panel.traces]
        yield said | {"unit": panel.unit}


@pytest.mark.parametrize("name", ALL)
def test_a_view(name, changed):
    view = ALL[name]
    said = {key: value for key, value in asdict(view).items() if key != "panels"}
    assert not changed(said | {"panels": list(_panels(view)), "columns": view.columns})


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


def test_the_mean_airspeed_that_is_judged_is_drawn_within_what_is_expected_of_it():
    """The largest deviation of the mean in the picture is the number of the verdict, in chunks as in one."""
    rng, n, dt = np.random.default_rng(3), 900, 0.02
    flown = 45.0 + np.cumsum(rng.normal(0.0, 0.3, n))
    command = np.where(np.arange(n) < 40, np.nan, 44.0)
    mean, means = 0.0, []
    for one, asked in zip(flown, command, strict=True):
        mean += 0.0 if np.isnan(asked) else dt / 10.0 * (one - asked - mean)
        means.append(asked + mean)
    whole = {"t_s": dt * np.arange(n), "airspeed_mps": flown, "airspeed_command_mps": command}

    class Chunks(dict):
        def row_count(self):
            return n

        def read_chunks(self, names):
            for start in (0, 250, 600):
                rows = slice(start, {0: 250, 250: 600, 600: n}[start])
                yield {name: self[name][rows] for name in {*names, "t_s"}}

    drawn = series_of(Chunks(whole), ["airspeed_mean_mps"], (-np.inf, np.inf))
    np.testing.assert_allclose(drawn["airspeed_mean_mps"], means, rtol=1e-12)
    (panel,) = [p for p in views(EVERY, within_mps=3.5)[1].panels if p.label == "airspeed"]
    assert [t.offset for t in panel.traces if t.role == "bound"] == [3.5, -3.5]


def test_what_a_shown_column_is_made_from():
    assert source_columns(["p_ratio", "fie_a_q_ratio", "mode", "p_ratio"]) == (
        "p_residual_rad_s", "p_threshold_rad_s",
        "fie_a_q_residual_rad_s", "fie_a_q_lower_rad_s", "fie_a_q_upper_rad_s", "mode",
    )  # fmt: skip


@pytest.mark.parametrize(("estimators", "across"), [(3, 1), (4, 3)])
def test_many_panels_are_set_side_by_side(estimators, across):
    names = [f"e{i}" for i in range(estimators)]
    bounds = ("residual", "lower", "upper")
    columns = [f"fie_{name}_{a}_{what}_rad_s" for name in names for a in "pqr" for what in bounds]
    others = [name for name in COLUMNS if not name.startswith("fie_")]
    known = views([*others, *columns, *(f"fie_{name}_excluded" for name in names)])
    (view,) = (view for view in known if view.name == "ratio")
    assert (len(view.panels), view.n_panel_columns) == (1 + estimators, across)


T_S = np.arange(0.0, 20.0, 0.5)
INSTANTS = marks(measure(Flight(departure=(18.0, "alpha"))))


def _series(view):
    """Every column another wave; those that are flags, modes or shares of their own kind."""
    found = {"t_s": T_S}
    for i, column in enumerate(view.columns):
        wave = np.sin(0.3 * T_S + i)
        found[column] = 0.1 * wave
        if column.endswith(("saturated", "excluded", "detected", "envelope_valid")):
            found[column] = (wave > 0.4).astype(float)
        elif column == "mode":
            found[column] = np.minimum(T_S // 5, 3)
        elif column.endswith(("_ratio", "_share")):
            found[column] = 10 ** (2 * wave - 1)
    return found


@pytest.mark.parametrize("name", ALL)
def test_the_figure_of_a_view(name, changed):
    assert not changed(picture(draw(ALL[name], _series(ALL[name]), INSTANTS, "a case")))


SMALL = View(
    "small",
    "Side by side",
    (
        Panel("first (of two)", (Trace("x_rad", "one", "actual"), Trace("x_rad", "", "bound", -1.0))),
        Panel("second", (Trace("y", "two", "target"),), limits=(-0.5, 2.0), line_at=0.25),
        Panel(
            "third", (Trace("y", "third", "p"),), shade_column="flag", shade_label="shaded", log_scale=True
        ),
    ),
    n_panel_columns=2,
    text_without_data="nothing to see",
)


@pytest.mark.parametrize(
    "case", ["whole", "no-marks-in-it", "one-instant", "empty", "nothing-in-it", "never-shaded"]
)
def test_the_figure_of_a_small_view(case, changed):
    t_s = {"one-instant": T_S[:1], "empty": T_S[:0]}.get(case, T_S)
    many = np.nan if case == "nothing-in-it" else 1.0
    shown = {
        "t_s": t_s,
        "x_rad": many * np.sin(t_s),
        "y": many * (t_s + 0.5) / 10,
        "flag": many * (t_s > 12.0),
    }
    if case == "never-shaded":
        shown["flag"] = np.zeros_like(t_s)
    if case == "no-marks-in-it":
        shown["t_s"] = shown["t_s"] + 18.5
    figure = draw(SMALL, shown, INSTANTS, case)
    assert not changed(picture(figure))


@pytest.mark.parametrize("entries", [0, 9, 13])
def test_the_legend_is_as_wide_as_the_figure(entries):
    for across, most in ((1, 9), (2, 12)):
        traces = tuple(Trace(f"x{i}", f"x{i}", "actual") for i in range(entries))
        view = View("x", "x", (Panel("x", traces or (Trace("x", "", "actual"),)),) * 2, across)
        shown = {"t_s": T_S, "x": T_S} | {trace.column: T_S for trace in traces}
        (legend,) = draw(view, shown, (), "x").legends
        assert len(legend.get_texts()) == entries
        assert legend._ncols == max(1, min(entries, most))


def test_a_figure_is_laid_out_in_inches():
    """Panels of the supervisor are a quarter of an inch, and one more a step, high; the others the same."""
    figure, grid = figures._empty_figure_and_axes(ALL["supervisor"], figures.figure_class())
    heights = [1.25, 0.75, 0.75]
    height = 0.9 + 0.85 + sum(heights) + 2 * 0.42
    assert list(figure.get_size_inches()) == pytest.approx([10.0, height])
    boxes = [axes.get_position() for axes in grid.flat]
    assert [box.height * height for box in boxes] == pytest.approx(heights)
    assert boxes[0].x0 * 10 == pytest.approx(1.2)
    assert boxes[0].x1 * 10 == pytest.approx(9.8)
    assert boxes[0].y1 * height == pytest.approx(height - 0.9)
    assert boxes[2].y0 * height == pytest.approx(0.85)
    assert (boxes[0].y0 - boxes[1].y1) * height == pytest.approx(0.42)
    figure, grid = figures._empty_figure_and_axes(ALL["isolation"], figures.figure_class())
    assert list(figure.get_size_inches()) == pytest.approx([12.0, 0.9 + 0.85 + 3 * 1.5 + 2 * 0.42])
    assert grid[0, 0].get_position().x0 * 12 == pytest.approx(0.75)
    figure, _ = figures._empty_figure_and_axes(ALL["tracking"], figures.figure_class())
    assert figure.get_size_inches()[1] == pytest.approx(0.9 + 0.85 + 3 * 1.75 + 2 * 0.42)


class _Rows:
    """A log in chunks of so many rows: t_s at 100 Hz, x."""

    def __init__(self, x, chunk=100, from_s=0.0):
        self.x, self.t_s, self.chunk = x, from_s + np.arange(x.size) / 100, chunk

    def row_count(self):
        return self.x.size

    def read_chunks(self, columns):
        for at in range(0, self.x.size, self.chunk):
            part = slice(at, at + self.chunk)
            yield {name: {"t_s": self.t_s, "x": self.x}[name][part] for name in columns}


WHOLE = (-np.inf, np.inf)


def test_a_log_as_long_as_the_limit_is_shown_as_it_is_and_a_longer_one_by_stretches():
    x = np.array([3.0, 1.0, 2.0, 5.0, 4.0, 0.0, 7.0, 6.0, 8.0, 9.0, 12.0])
    assert list(series_of(_Rows(x), ["x"], WHOLE, 11)["x"]) == list(x)
    shown = series_of(_Rows(x), ["x"], WHOLE, 10)  # stretches of ceil(2 x 11 / 10) = 3 rows
    # 3 1 2 falls: highest first; 5 4 0 falls; 7 6 8 rises; 9 12 rises
    assert list(shown["x"]) == [3.0, 1.0, 5.0, 0.0, 6.0, 8.0, 9.0, 12.0]
    assert list(shown["t_s"]) == pytest.approx([0, 0.01, 0.03, 0.04, 0.06, 0.07, 0.09, 0.10])
    assert list(series_of(_Rows(x), ["x"], (0.02, 0.05), 10)["x"]) == [2.0, 5.0, 4.0]  # the end is not in it
    assert list(series_of(_Rows(x), ["x"], (0.0, 0.0999), 10)["x"]) == list(x[:10])
    assert series_of(_Rows(x), ["x"], (50.0, 60.0), 10)["x"].size == 0
    two = series_of(_Rows(x, chunk=6), ["x"], WHOLE, 10)
    assert list(two["x"]) == list(shown["x"])


def test_a_window_is_cut_into_stretches_by_its_own_length():
    """9.5 rows to 4 points: stretches of 5, at their first and third instants; the first ends as it began.
    Of 13 rows to 5 points, stretches of 6, the last is a single row.
    """
    x = np.array([9.0, 2.0, 5.0, 0.0, 1.0, 2.0, 7.0, 8.0, 3.0, 6.0, 4.0])
    shown = series_of(_Rows(x, from_s=5.0), ["x"], (5.0099, 5.1049), 4)
    assert list(shown["x"]) == [0.0, 5.0, 8.0, 3.0]
    assert list(shown["t_s"]) == pytest.approx([5.01, 5.03, 5.06, 5.08])
    shown = series_of(_Rows(np.arange(13.0)), ["x"], WHOLE, 5)
    assert list(shown["t_s"]) == pytest.approx([0.0, 0.03, 0.06, 0.09, 0.12, 0.12])


@pytest.mark.parametrize(("rows", "points"), [(4000, 4000), (4001, 2668)])
def test_up_to_4000_points_are_shown_as_they_are(rows, points):
    assert series_of(_Rows(np.arange(float(rows)), rows), ["x"], WHOLE)["x"].size == points


def test_of_a_residual_of_nothing_the_upper_bound_counts():
    chunk = {"a": np.array([0.0, -1.0]), "b": np.array([0.0, -4.0]), "c": np.array([2.0, 2.0])}
    assert list(_residual_over_threshold(chunk, "abc")) == [0.0, 0.25]


MANY = (
    *(f"{side}_{place}_{kind}" for kind in ("elevator", "flap") for side in ("left", "right")
      for place in ("inboard", "outboard")), "rudder_0", "rudder_1", "aileron_left", "stabiliser",
)  # fmt: skip


def test_of_more_than_eight_surfaces_those_of_a_kind_share_a_panel_and_none_is_left_out():
    what = (
        "effectiveness_estimate",
        "effectiveness_used",
        "cmd_rad",
        "effective_rad",
        "loss_likelihood_share",
    )
    columns = [f"{name}_{each}" for name in MANY for each in what]
    known = {view.name: view for view in views([*columns, *(f"{a}_step_likelihood_share" for a in "pqr")])}
    assert list(surfaces_by_kind(MANY)) == ["elevator", "flap", "rudder", "aileron", "stabiliser"]
    labels = [panel.label for panel in known["surfaces"].panels]
    assert labels[::2] == [f"{kind}: commanded" for kind in surfaces_by_kind(MANY)]
    where = [("surfaces", "cmd_rad"), ("surfaces", "effective_rad"), ("likelihood", "loss_likelihood_share")]
    for name, ending in (*where, *(("effectiveness", each) for each in what[:2])):
        shown = [t.column for panel in known[name].panels for t in panel.traces if t.column.endswith(ending)]
        assert sorted(shown) == sorted(f"{surface}_{ending}" for surface in MANY)
    for panel in known["surfaces"].panels:
        assert (
            len({trace.role for trace in panel.traces})
            == len({t.label for t in panel.traces})
            == len(panel.traces)
        )
    elevator = known["surfaces"].panels[0]
    assert elevator.traces[0].label == "left inboard"


@pytest.mark.parametrize("ratio", [0.0, -3.0])
def test_a_ratio_that_is_never_positive_is_drawn_without_a_warning(ratio, recwarn):
    """As of a flight whose sensor monitor alarms in the first frame."""
    low = View("low", "Low", (Panel("low", (Trace("y", "low", "p"),), log_scale=True, line_at=1.0),))
    figure = draw(low, {"t_s": T_S[:9], "y": np.full(9, ratio)}, [], "x")
    figure.canvas.draw()
    (axes,) = figure.axes
    assert [str(one.message) for one in recwarn] == []
    assert (axes.get_yscale(), *axes.get_ylim()) == ("log", 0.1, 10.0)


def test_what_a_figure_looks_like():
    """What only the eye would see otherwise: pixels, heights of titles, numbers without an offset."""
    low = View("low", "Low", (Panel("low", (Trace("y", "low", "p"),), log_scale=True),))
    t_s = T_S[24:37]  # from the fault's instant to the departure's
    figure = draw(low, {"t_s": t_s, "y": 10.0 ** -np.arange(t_s.size)}, INSTANTS, "x")
    figure.canvas.draw()
    (axes,) = figure.axes
    assert figure.bbox.width == 1100
    assert figure._suptitle.get_position()[1] == pytest.approx(1 - 0.12 / figure.get_figheight())
    assert axes.get_ylim()[0] == 0.1
    assert axes.yaxis.get_minorticklocs().size == 0
    assert axes.title.get_position()[1] == 1.0
    assert not axes.xaxis.get_major_formatter().get_useOffset()
    assert figure._repr_png_().startswith(b"\x89PNG")


def test_the_pictures_of_a_flight_whole_and_around_the_fault(tmp_path, monkeypatch):
    document, shown = metrics(Flight()), []
    monkeypatch.setattr(figures.log, "column_names", lambda path: COLUMNS)
    monkeypatch.setattr(figures, "draw", lambda *given, style: _Drawn(*given, shown))
    monkeypatch.setattr(
        figures, "read_series", lambda path, columns, span: dict.fromkeys(("t_s", *columns), span)
    )
    for given in (document, document | {"engine_power": {"from_s": 1.0}}, metrics(QUIET)):
        shown.clear()
        written = figures.write_figures(tmp_path / "log.parquet", Metrics.of(given), tmp_path / "figures")
        assert [path for path, *_ in shown] == written
        assert {folder for path in written for folder in path.parents[:1]} == {tmp_path / "figures"}
        spans = {path.name: span for path, span, *_ in shown}
        closeups = {name: span for name, span in spans.items() if "closeup" in name}
        around = dict.fromkeys(
            [f"{name}-closeup.png" for name in ("detection", "candidates", "isolation")], (11.5, 14.12)
        )
        assert closeups == ({} if given["fault"] is None else around)
        assert {span for name, span in spans.items() if name not in closeups} == {WHOLE}
        assert {more for *_, more in shown} == {("synthetic", "beaver-ftc")}


QUIET = Flight(scenario=Scenario(faults=()), detection_time_s=None, isolation_time_s=None, isolated=None)


class _Drawn:
    """A figure that notes where it would be saved."""

    def __init__(self, view, series, _, name, shown):
        self.view, self.series, self.name, self.shown = view, series, name, shown

    def savefig(self, path, metadata, pil_kwargs):
        assert path.name.startswith(self.view.name)
        self.shown.append((path, self.series["t_s"], (self.name, metadata["Software"])))


def test_a_window_without_a_fault():
    lost = marks(measure(Flight(
        scenario=Scenario(faults=(Fault(at_s=25.0),)), detection_time_s=None, isolation_time_s=None,
        departure=(14.5, "alpha_rad"),
    )))  # fmt: skip
    assert [mark.name for mark in lost] == ["departure"]
    assert closeup_window(lost) == (14.0, 16.5)
    late = marks(measure(Flight(detection_time_s=12.25, isolation_time_s=22.5, departure=(29.0, "beta"))))
    assert closeup_window(late) == (11.5, 24.0)  # ten seconds of events are enough to look at closely
    assert closeup_window([one for one in late if one.name != "isolation"]) == (11.5, 14.25)
