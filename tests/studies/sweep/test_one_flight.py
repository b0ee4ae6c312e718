import pytest

from beaver_ftc.documents.errors import SimulationFailed
from beaver_ftc.results.metrics import metrics
from beaver_ftc.studies.sweep.one_flight import (
    Keep,
    fly_one,
    scenario_of,
)
from beaver_ftc.studies.sweep.sampling import Assignment, Plan, flight_seed


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
