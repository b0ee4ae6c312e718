import pytest

from beaver_ftc.aircraft import load
from beaver_ftc.documents.errors import SimulationFailed
from beaver_ftc.results.metrics import metrics
from beaver_ftc.results.writer import NotAllWritten
from beaver_ftc.studies.sweep.one_flight import (
    Keep,
    columns_of,
    counts_of_rows,
    fly_one,
    keep_flight,
    scenario_of,
)
from beaver_ftc.studies.sweep.sampling import Assignment, Plan, flight_seed

from .conftest import SHORT, sweep_of


def test_a_row_says_what_the_flights_metrics_say(short):
    from beaver_ftc.loop.loop import fly

    (flight,) = Plan(short).assignments([7])
    row = fly_one(short, flight)
    document = metrics(fly(scenario_of(short, flight)))
    assert row["run"] == 7
    assert row["seed"] == document["seed"] == flight_seed(3, 7)
    assert row["status"] == "flown"
    assert row["faults[0].magnitude"] == flight.values["faults[0].magnitude"]
    assert row["fault.actuator"] == flight.values["faults[0].actuator"] == document["fault"]["actuator"]
    assert row["detection.delay_s"] == document["detection"]["delay_s"] is not None
    assert row["tracking.post_fault_rms_deg_s.q"] == document["tracking"]["post_fault_rms_deg_s"]["q"]
    assert row["saturation_s.elevator"] == document["saturation_s"]["elevator"]
    assert row["fault_free_s"] == 0.5


def test_every_metric_has_a_column(short):
    """All that metrics.json lists, but for what all flights share; lists have columns of their own."""
    from beaver_ftc.loop.loop import fly

    document = metrics(fly(scenario_of(short, Plan(short).assignments([0])[0])))
    paths = {
        f"{section}.{key}" if isinstance(below, dict) else section
        for section, below in document.items()
        for key in (below if isinstance(below, dict) else [""])
    } - {"scenario", "seed", "versions"}
    names = set(columns_of(load().surfaces))
    lists = {
        "supervisor",
        "isolation.names",
        "envelope_exits",
        "expectations",
        "departure",
        "faults",
        "hints",
        "changes",
        "limits",
        "assumes",
        "outside_class",
    }
    shared = {"flight", "envelope", "profile", "mode_changes_left_out"}  # the flight's own document has them
    missing = {
        path
        for path in paths
        if not path.startswith("versions.")
        and not any(name == path or name.startswith(f"{path}.") for name in names)
    }
    assert {path for path in missing if path.partition(".")[0] not in shared} <= lists


def test_a_flight_that_cannot_be_trimmed_is_a_row_with_its_reason():
    sweep = sweep_of(SHORT.replace("{normal: [45, 3], within: [36, 54]}", "{choice: [20, 45]}"))
    row = fly_one(sweep, Assignment(0, {"initial.airspeed_mps": 20.0}))
    assert row["status"] == "bad_input"
    assert "20 m/s" in row["reason"]
    assert row["detection.detected"] is None


def test_values_that_contradict_each_other_are_a_row_too(short):
    row = fly_one(short, Assignment(0, {"faults[0].at_s": 2.0}))
    assert row["status"] == "bad_input"
    assert row["reason"].startswith("faults[0].at_s: 2 is after the end")


def test_a_drawn_value_out_of_range_is_named_by_its_key_though_the_base_lacks_it(short):
    for key in ("fdi.detection_pole_per_s", "environment.gust.at_s", "control.noise_share"):
        row = fly_one(short, Assignment(0, {key: 1e9}))
        assert row["status"] == "bad_input"
        assert row["reason"].startswith(f"{key}: 1e+09 is out of range, allowed: a number")


@pytest.mark.parametrize(
    ("error", "reason"),
    [
        (SimulationFailed("q_rad_s not finite"), "q_rad_s not finite"),
        (ZeroDivisionError("of a plug-in"), "ZeroDivisionError: of a plug-in"),
    ],
)
def test_a_flight_that_fails_is_a_row_with_its_reason(short, monkeypatch, error, reason):
    def fail(*_, **__):
        raise error

    monkeypatch.setattr("beaver_ftc.loop.loop.fly", fail)
    row = fly_one(short, Plan(short).assignments([1])[0])
    assert (row["status"], row["reason"]) == ("failed", reason)


@pytest.mark.parametrize(
    ("policy", "row", "wanted"),
    [
        ("none", {"status": "failed"}, False),
        ("all", {"status": "flown"}, True),
        ("failed", {"status": "failed"}, True),
        ("failed", {"status": "flown", "passed": False}, True),
        ("failed", {"status": "flown", "passed": True, "detection.detected": False}, False),
        ("missed", {"status": "flown", "passed": True, "detection.detected": False}, True),
        (
            "missed",
            {"status": "flown", "passed": True, "detection.detected": True, "isolation.correct": False},
            True,
        ),
        (
            "missed",
            {"status": "flown", "passed": True, "detection.detected": True, "isolation.correct": True},
            False,
        ),
    ],
)
def test_keeping_follows_the_policy(policy, row, wanted):
    full = {
        "run": 1,
        "passed": None,
        "fault.type": "float",
        "detection.detected": None,
        "isolation.correct": None,
    }
    assert Keep(policy).wants(full | row) is wanted


def test_selected_flights_are_kept_whatever_became_of_them():
    assert Keep("selected", frozenset({5})).wants({"run": 5})


def test_an_alarm_without_a_fault_is_no_detection_among_the_counts():
    flights = [("flown", "stuck", True)] * 3 + [("departed", "stuck", False), ("flown", None, True)] * 2
    flights += [("failed", None, None)] * 6
    rows = [dict(zip(("status", "fault.type", "detection.detected"), one, strict=True)) for one in flights]
    assert counts_of_rows(rows) == {"done": 13, "failed": 6, "faulted": 5, "detected": 3}


@pytest.mark.parametrize("scheme", ["adaptive-estimators", "zhang2005"])
def test_a_kept_flight_has_its_certificate_where_the_scheme_has_one(monkeypatch, tmp_path, scheme):
    """Of one whose files cannot all be written log and scenario are kept as they are."""
    given = []

    def run(scenario, folder, report, certified):
        given.append((scenario.name, folder, report, certified))
        raise NotAllWritten("a picture")

    monkeypatch.setattr("beaver_ftc.results.writer.run", run)
    sweep = sweep_of(SHORT.replace("set: {", f"set: {{fdi: {{scheme: {scheme}}}, "))
    (flight,) = Plan(sweep).assignments([7])
    keep_flight(sweep, flight, Keep(folder=tmp_path, certified=True), report=True)
    keep_flight(sweep, flight, Keep(folder=tmp_path))
    certified = scheme == "adaptive-estimators"
    assert given == [("short-0007", tmp_path, True, certified), ("short-0007", tmp_path, False, False)]
    assert list(tmp_path.iterdir()) == []
