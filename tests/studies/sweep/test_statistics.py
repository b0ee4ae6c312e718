"""Statistics against a table small enough to count by hand."""

import pytest

from beaver_ftc.scenario.sweeps import SweepExpect, load_sweep_text
from beaver_ftc.studies.sweep.expectations import evaluate
from beaver_ftc.studies.sweep.summary import summarise
from beaver_ftc.studies.sweep.summary_words import exact_percent, summary_text

from .counted import ROWS, SWEEP, detected, flights_of, row


@pytest.fixture
def sweep():
    return load_sweep_text(SWEEP)


@pytest.fixture
def flights(tmp_path):
    return flights_of(ROWS, tmp_path)


@pytest.fixture
def summary(flights, sweep):
    return summarise(flights, sweep)


def test_delay_quantiles_count_missed_faults_as_never(summary):
    found = summary["detection"]["delay_s"]
    assert (found["of"], found["median"], found["p90"], found["max"]) == (9, 0.5, None, None)
    seen = summary["detection"]["delay_of_detected_s"]
    assert (seen["of"], seen["median"], seen["max"]) == (6, 0.3, 0.6)


def test_isolation_counts_right_and_wrong_names(summary):
    found = summary["isolation"]
    assert (found["count"], found["of"]) == (4, 9)
    assert (found["wrong"]["count"], found["wrong"]["of"]) == (1, 5)


def test_false_alarms_are_per_hour_without_a_fault(summary):
    found = summary["false_alarms"]
    hours = (9 * 12.0 + 3.0 + 30.0) / 3600
    assert found["count"] == 1
    assert found["hours"] == pytest.approx(hours)
    assert found["per_hour"] == pytest.approx(1 / hours)
    assert found["high"] == pytest.approx(5.572 / hours, rel=1e-3)


def test_a_broken_guarantee_is_seen(summary):
    assert summary["guarantee"] == {"promised": 2, "broken": 1}  # flight 2: 0.3 s where 0.25 s were promised


def test_the_confusion_matrix_has_every_flight_once(summary):
    confusion = summary["confusion"]
    counts = {
        (fault, said): count
        for fault, line in zip(confusion["faults"], confusion["counts"], strict=True)
        for said, count in zip(confusion["diagnoses"], line, strict=True)
        if count
    }
    assert counts == {
        ("elevator", "elevator"): 4, ("elevator", "aileron"): 1, ("elevator", "not isolated"): 1,
        ("elevator", "no alarm"): 3, ("elevator", "false alarm"): 1, ("no fault", "no alarm"): 1,
    }  # fmt: skip


def test_a_false_alarm_without_a_fault_is_counted_by_the_name_it_has(tmp_path, sweep):
    healthy = {"fault.actuator": None, "fault.type": None, "fault.at_s": None, "false_alarm": True}
    confusion = summarise(flights_of([detected(0, 0.5, "rudder", **healthy)], tmp_path), sweep)["confusion"]
    assert confusion == {"faults": ["no fault"], "diagnoses": ["rudder"], "counts": [[1]]}


def test_departures_and_failures(summary):
    assert summary["statuses"] == {"bad_input": 1, "departed": 1, "flown": 10}
    assert summary["reasons"] == [{"reason": "no trim", "count": 1, "first_run": 10}]


@pytest.mark.parametrize(
    ("expect", "actual", "passed"),
    [
        ({"detection_rate": {"at_least": 0.6}}, 6 / 9, True),
        ({"detection_rate": {"at_least": 0.6, "confidence": 0.95}}, 0.3985, False),
        ({"departure_rate": {"at_most": 0.1}}, 1 / 11, True),
        ({"failure_rate": {"at_most": 0.0}}, 1 / 12, False),
        ({"pass_rate": {"at_least": 0.9}}, 10 / 11, True),
        ({"detection_delay_s": {"quantile": 0.9, "at_most": 5.0}}, None, False),
        ({"detection_delay_s": {"quantile": 0.2, "at_most": 0.4, "confidence": 0.9}}, 0.4, True),
        ({"post_fault_rms_deg_s": {"q": {"quantile": 0.5, "at_most": 0.2}}}, 0.2, True),
        ({"tracking_ratio": {"q": {"quantile": 0.5, "at_most": 1.5}}}, 2.0, False),
        ({"tracking_ratio": {"q": {"at_most": 1.5}}}, None, False),  # of a lost aircraft
        ({"tracking_ratio": {"p": {"at_most": 1.5}}}, None, False),
    ],
)
def test_expectations_hold_the_flights_to_their_bounds(flights, expect, actual, passed):
    (found,) = evaluate(SweepExpect(**expect), flights)
    assert found["passed"] is passed
    assert found["actual"] == (None if actual is None else pytest.approx(actual, abs=1e-3))


def test_tracking_errors_have_a_label_without_a_time_before_the_fault(tmp_path, sweep):
    flights = flights_of([row(0, **{"tracking.pre_fault_rms_deg_s.q": None})], tmp_path)
    nothing = {"expectations": [], "passed": True, "worst": [], "folder": ""}
    said = summary_text(summarise(flights, sweep) | nothing)
    assert "tracking RMS, median  p none  q 0.2  r none deg/s after" in said


def test_a_share_near_its_end_is_not_rounded_to_it():
    said = ["0 %", "0.001 %", "0.5 %", "50 %", "99.999 %", "100 %"]
    assert [*map(exact_percent, (0.0, 1e-5, 0.005, 0.5, 0.99999, 1.0))] == said
