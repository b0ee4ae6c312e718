"""What the benchmark on recorded flights counts and prints, of scores that differ in everything."""

import pytest

from beaver_ftc_logs.energy import ENGINE
from beaver_ftc_logs.recorded import benchmark


def score(failure=None, detected=False, delay_s=None, false_alarms=0, healthy_s=900.0, right_group=None):
    return {
        "failure": failure, "detected": detected, "delay_s": delay_s, "false_alarms": false_alarms,
        "healthy_s": healthy_s, "right_group": right_group,
    }  # fmt: skip


SCORES = [
    score("left_aileron", True, 4.0, right_group=True),
    score("rudder+right_aileron", True, 5.0, right_group=False),
    score("right_aileron", True, 9.0),
    score("rudder", True, 2.0, false_alarms=1),
    score("rudder"),
    score("elevator"),
    score(ENGINE, True, 1.0),
    score(ENGINE),
    score(false_alarms=2),
    score(),
    score(),
]


def test_flights_are_found_missed_or_falsely_alarmed():
    found = benchmark.summarize_failures(SCORES)
    assert (found["surface_failures"], found["found"]) == (6, 4)
    assert found["precision"] == pytest.approx(4 / 6)  # two flights with a false alarm
    assert found["recall"] == pytest.approx(4 / 6)
    assert found["accuracy"] == pytest.approx((4 + 2) / (6 + 3))
    assert (found["healthy_flights"], found["healthy_flights_with_an_alarm"]) == (3, 1)
    assert found["healthy_hours"] == pytest.approx(11 * 0.25)
    alarms = found["false_alarms_per_hour"]
    assert alarms["value"] == pytest.approx(3 / 2.75)
    assert alarms["low"] < 3 / 2.75 < alarms["high"]
    assert found["wrong_group"] == 1
    assert found["engine_failures_with_an_alarm"] == 1


def test_figures_by_labels_are_weighted_by_rows():
    names = ("classes", "healthy_or_faulty", "side", "mean_error", "held_by_bounds")
    one = {"rows": 1} | {name: 0.1 * k for k, name in enumerate(names)}
    other = {"rows": 3} | {name: 0.5 + 0.1 * k for k, name in enumerate(names)}
    found = benchmark.summarize_labels([one, other])
    assert found == {"rows": 4} | {name: pytest.approx(0.375 + 0.1 * k) for k, name in enumerate(names)}
