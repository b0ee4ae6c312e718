"""The benchmark on recorded flights from the folder to the figure: whole, from small flights and by hand."""

import json
from types import SimpleNamespace

import numpy as np
import pytest

from beaver_ftc.documents.errors import BadInput
from beaver_ftc_logs import fitting
from beaver_ftc_logs.fitting import FitPart
from beaver_ftc_logs.recorded import benchmark
from beaver_ftc_logs.recording import Column, LoggedFailure, RecordedFlight
from beaver_ftc_logs.samples import Samples
from kept import picture
from products.logs import small, synthetic

MODEL = small.model()
TAIL = small.model(small.TAIL)
LOST = ((1, 300, 400, 0.5), (0, 600, 700, 0.4))


def event_flight(left_out, method, failure, delay_s=None, false_alarms=0, right=True, healthy_s=600.0):
    return {
        "left_out": left_out, "method": method, "failure": failure, "delay_s": delay_s,
        "detected": delay_s is not None, "false_alarms": false_alarms, "right_group": right,
        "healthy_s": healthy_s,
    }  # fmt: skip


FAILURES = {
    "one": "left_aileron", "two": "rudder+right_aileron", "three": "rudder", "four": "elevator",
    "five": "engine", "six": None,
}  # fmt: skip
DELAYS = {"ours": [1.0, 5.0, 7.5, None, 2.0, None], "theirs": [4.0, 31.0, 30.0, None, None, None]}
FLIGHTS = [
    event_flight(name, method, failure, delay, int(name == "three"), name != "two")
    for method, delays in DELAYS.items()
    for (name, failure), delay in zip(FAILURES.items(), delays, strict=True)
]
EVENTS = {
    "set": "gliders", "left_out": "each flight in turn", "scored_by": "events", "flights": FLIGHTS,
    "rows": [
        {
            "method": method,
            **benchmark.summarize_failures([of for of in FLIGHTS if of["method"] == method]),
        }
        for method in DELAYS
    ],
    "published": [
        {
            "method": "published", "precision": 0.5,
            "delay_s": {"aileron": {"mean": 3.0, "found": 1, "failures": 2}},
        },
    ],
}  # fmt: skip


def shares(method, classes, **changes):
    figures = {
        "healthy_or_faulty": classes + 0.01,
        "side": classes + 0.02,
        "mean_error": 0.05,
        "held_by_bounds": 0.9,
    }
    return {"method": method, "classes": classes} | figures | changes


LABELS = {
    "set": "wings", "left_out": "halves of the one flight in turn", "scored_by": "labels", "flights": [],
    "rows": [shares(f"method {i}", 0.9 - 0.03 * i) for i in range(17)],
    "published": [{"method": "published", "classes": 0.95, "side": 0.97}],
}  # fmt: skip
DOCUMENT = {"sets": [EVENTS, LABELS]}
DAYS = {
    "other_days": {
        "sets": [
            {
                "set": "wings",
                "rows": [
                    shares("", 0.9, kind="one change", day="as it was", beside=0.5),
                    shares("", 0.8, kind="one change", day="gain 0.85", beside=0.4),
                    shares("", 0.7, kind="drawn", day="drawn 0", beside=0.3),
                ],
                "summary": [
                    {"kind": kind, "mean": shares("", 0.8, beside=0.45), "worst": shares("", 0.7, beside=0.3)}
                    for kind in ("one change", "drawn")
                ],
            }
        ]
    }
}


@pytest.mark.parametrize("name", ["flights", "days"])
def test_tables_of_a_document(changed, name):
    document = {"flights": DOCUMENT, "days": DAYS}[name]
    assert not changed(
        {
            "text": benchmark.as_text(document).splitlines(),
            "page": benchmark.as_markdown(document).splitlines(),
        }
    )


def test_the_figure_of_a_document(changed):
    figure = benchmark.draw_comparison_figure(DOCUMENT)
    assert not changed(picture(figure))
    delays, shares = figure.axes
    marked = {line.get_label(): line.get_xydata() for line in delays.lines}
    assert marked["elevator"][:, 0].tolist() == [31.0, 31.0]  # neither method found it
    assert marked["left aileron"][:, 0].tolist() == [1.0, 4.0]
    assert [round(y) for y in marked["rudder"][:, 1]] == [0, 1]  # each in its method's line
    assert [len(line.get_xdata()) for line in shares.lines] == [18, 17, 18]  # one is not published


def test_files_of_a_document():
    files = benchmark.result_files(DOCUMENT)
    assert set(files) == {"flights.png", "flights.json", "flights.md"}
    assert json.loads(files["flights.json"])["sets"][0]["set"] == "gliders"
    assert files["flights.md"] == benchmark.as_markdown(DOCUMENT)


def changed(samples, **changes):
    return Samples(**(vars(samples) | changes))


def recording(samples):
    """A recording beside samples: all that the freeze rule reads of it."""
    still = Column(samples.t_s, np.where(samples.t_s < 20.0, samples.t_s, 20.0))
    return RecordedFlight(samples.name, {"elevator_output": still}, samples.logged_failures)


def data_set(model, flights):
    return benchmark.DataSet("set", model.vehicle, tuple(map(recording, flights)), tuple(flights))


@pytest.fixture
def two_methods(monkeypatch):
    names = ["bank-of-filters", "sliding-least-squares"]
    monkeypatch.setattr(benchmark, "detector_names", lambda: names)


def test_a_labelled_flight_is_left_out_by_halves(changed, monkeypatch, two_methods):
    monkeypatch.setattr(fitting, "_DELAYS_SAMPLES", (0.0,))  # quick
    flight = small.flight(MODEL, 1000, lost=LOST)
    data = data_set(MODEL, [flight])
    document = benchmark._compare_methods(data)
    assert not changed(document)
    assert [(one["left_out"], one["method"]) for one in document["flights"]] == [
        (half, method)
        for half in ("second half", "first half")
        for method in ("bank of filters (ours)", "sliding least squares, 20 s")
    ]
    assert document["rows"][0]["classes"] > document["rows"][1]["classes"] > 0.4
    usable_flights = fitting.fit_parts([flight])
    whole = fitting.fit_model(usable_flights, MODEL.vehicle)
    bounds = fitting.score_folds(usable_flights, whole)[1]
    expected = whole.settings.model_copy(update={"credible_mass": bounds})
    assert benchmark.whole_settings(usable_flights, data) == expected


def test_flights_with_a_failure_are_left_out_in_turn(changed, monkeypatch, two_methods):
    """The freeze rule is there as well where the log has outputs."""
    flights = [
        small.flight(TAIL, 400, seed=1, name="weak", logged_failures=(LoggedFailure(25.0, "elevator"),)),
        small.flight(TAIL, 400, seed=2, name="engine", logged_failures=(LoggedFailure(30.0, "engine"),)),
        small.flight(TAIL, 400, seed=3, name="sound"),
    ]
    document = benchmark._compare_methods(data_set(TAIL, flights))
    assert not changed(document)
    assert [row["method"] for row in document["rows"]] == [
        "bank of filters (ours)", "sliding least squares, 20 s", "freeze rule, 6 s, on the logged outputs",
    ]  # fmt: skip
    frozen = document["rows"][2]
    assert (frozen["surface_failures"], frozen["found"]) == (1, 1)
    assert frozen["delay_s"]["elevator"]["mean"] == pytest.approx(1.1)


def test_settings_of_several_flights_are_those_of_the_fit():
    flights = [
        small.flight(MODEL, 500, seed=seed, name=str(seed), lost=((1, 100, 200, 0.5),)) for seed in (1, 2)
    ]
    usable_flights = fitting.fit_parts(flights)
    settings = benchmark.whole_settings(usable_flights, data_set(MODEL, flights))
    assert settings == fitting.fit_model(usable_flights, MODEL.vehicle).settings


def test_a_detector_of_the_loop_is_told_from_ours(monkeypatch):
    monkeypatch.setattr(benchmark, "detector_names", lambda: ["forgetting-least-squares", "other"])
    monkeypatch.setattr(benchmark, "diagnose_with_detector", lambda name, samples, model: name)
    usable_flight = FitPart(small.flight(MODEL, 10), np.ones(10, dtype=bool))
    found = list(benchmark._diagnose_each(recording(usable_flight.samples), usable_flight, MODEL))
    assert found == [
        ("forgetting least squares, 20 s", "forgetting-least-squares"), ("other, of the loop", "other"),
    ]  # fmt: skip


def test_labels_count_in_the_span_of_what_is_kept():
    samples = small.flight(MODEL, 10)
    use = np.zeros(10, dtype=bool)
    use[[2, 3, 7]] = True
    labels = benchmark.labels_in_span(FitPart(samples, use))
    assert np.flatnonzero(np.isfinite(labels).all(axis=1)).tolist() == [2, 3, 4, 5, 6, 7]
    np.testing.assert_array_equal(labels[2:8], samples.labels[2:8])
    assert np.isnan(benchmark.labels_in_span(FitPart(samples, np.zeros(10, dtype=bool)))).all()


def test_a_flight_is_scored_by_what_its_log_has():
    rows = small.rows([(10, "left", [1.0, 0.5])], step_s=0.1)
    use = np.ones(10, dtype=bool)
    assert "classes" in benchmark._score_against_log(FitPart(small.flight(MODEL, 10), use), rows, MODEL)
    bare = changed(
        small.flight(MODEL, 10),
        labels=np.full((10, 2), np.nan),
        logged_failures=(LoggedFailure(10.2, "left"),),
    )
    assert benchmark._score_against_log(FitPart(bare, use), rows, MODEL)["failure"] == "left"


def test_data_sets_below_a_folder(tmp_path):
    """Itself first, then those below it in their order: tables beside their vehicle, folders of ALFA."""
    table = synthetic.fly(8.0)
    for name in ("b", "a"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "vehicle.yaml").write_text(synthetic.VEHICLE)
        synthetic.write_parquet(tmp_path / name / "1.parquet", table)
        synthetic.write_csv(tmp_path / name / "2.csv", table)
    (tmp_path / "vehicle.yaml").write_text(synthetic.VEHICLE)
    synthetic.write_csv(tmp_path / "own.csv", table)
    (tmp_path / "c").mkdir()
    (tmp_path / "c" / "vehicle.yaml").write_text(synthetic.VEHICLE)  # without tables
    (tmp_path / "d").mkdir()
    (tmp_path / "d" / "nothing").mkdir()
    (tmp_path / "e").mkdir()
    synthetic.write_alfa(tmp_path / "e" / "carbonZ", duration_s=8.0)
    found = benchmark.load_data_sets(tmp_path)
    assert [one.name for one in found] == [tmp_path.name, "a", "b", "e"]
    assert [flight.name for flight in found[1].flights] == ["1", "2"]
    assert [one.name for one in found[1].recordings] == ["1", "2"]
    assert (found[1].vehicle.name, found[3].vehicle.name) == ("wing", "alfa")
    with pytest.raises(
        BadInput, match=r"compare: --flights .*: no such folder, allowed: a folder of recorded"
    ):
        benchmark.load_data_sets(tmp_path / "own.csv")


def test_the_delay_of_a_flight_in_words():
    assert [benchmark._mean_delay_text(of) for of in (
        {}, {"failures": 2, "mean": None, "found": 0}, {"mean": 1.25},
        {"mean": 1.27, "found": 2, "failures": 3},
    )] == ["", "not found", "1.2", "1.3 (2 of 3)"]  # fmt: skip


def test_a_benchmark_has_a_part_a_data_set(monkeypatch, tmp_path):
    monkeypatch.setattr(
        benchmark, "load_data_sets", lambda folder: [SimpleNamespace(n=1), SimpleNamespace(n=2)]
    )
    monkeypatch.setattr(benchmark, "_compare_methods", lambda one: one.n)
    assert benchmark.run_benchmark(tmp_path) == {"sets": [1, 2]}
