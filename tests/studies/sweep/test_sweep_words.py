"""What a sweep says, line by line, of a summary in which no two numbers are alike."""

import pytest

from beaver_ftc.studies.sweep import summary_page as words
from beaver_ftc.studies.sweep.summary import summarise

from .counted import SWEEP as SWEEP_TEXT
from .counted import detected, flights_of, load_sweep_text, row


def rate(count, of):
    return {"count": count, "of": of, "rate": count / max(of, 1), "low": 0.25, "high": 0.875}


SWEEP = "a-sweep"
QUANTILES = {"of": 9, "median": 0.25, "p90": 0.5, "p95": 1.5, "p99": None, "max": 2.5}
RMS = {key: {"median": value} for key, value in (("pre_fault_rms_deg_s", 0.5), ("post_fault_rms_deg_s", 1.5))}
SUMMARY = {
    "sweep": SWEEP, "passed": False, "folder": "runs/a-sweep", "flights": 12, "flown_h": 0.1234,
    "statuses": {"bad_input": 1, "departed": 2, "flown": 9},
    "search": {"score": 0.123456, "objective": "false_alarm", "run": 7},
    "detection": {**rate(6, 9), "delay_s": QUANTILES}, "isolation": {**rate(4, 9), "wrong": rate(1, 5)},
    "false_alarms": {"count": 3, "hours": 2.5, "per_hour": 1.2, "low": 0.25, "high": 3.5,
                     "closest_residual_ratio": 0.98765},
    "guarantee": {"promised": 5, "broken": 2}, "departures": rate(2, 11),
    "sensitivity": {
        "detection_delay": [
            {"key": "a", "p_value": 0.05, "explained": 0.5}, {"key": "b", "p_value": 0.051, "explained": 0.4},
            {"key": "c", "p_value": 0.01, "explained": 0.01},
            {"key": "d", "p_value": 0.01, "explained": 0.0099},
            {"key": "e", "p_value": 0.02, "explained": 0.3}, {"key": "f", "p_value": 0.02, "explained": 0.2},
        ],
        "missed_detection": [],
    },
    "on_the_bound": rate(4, 9), "inconclusive": rate(3, 11),
    "tracking": {axis: {**RMS, "ratio": {"median": None}} for axis in "pqr"},
    "expectations": [
        {"name": "detection_delay_s", "expected": {"quantile": 0.95, "at_most": 0.5, "confidence": 0.9},
         "actual": 0.75, "passed": False},
        {"name": "detection_rate", "expected": {"at_least": 0.5}, "actual": None, "passed": True},
    ],
    "worst": [{"why": [f"why {k}", "and why"], "replay": f"beaver-ftc sweep --replay {k}"} for k in range(5)],
}  # fmt: skip


SATURATED = (
    "the residual of the healthy flight already reaches 90 % of "
    "its threshold or more; the detection of small faults then measures the scenario's own uncertainty, "
    "not the diagnosis"
)
WHY = (
    "for part or all of the time (detection.inconclusive.share); "
    + "the verdict of a kept flight states the reason"
)
RESIDUALS = "largest residual/threshold ratio 0.9877"
RANKS = (("a", 50), ("c", 1), ("e", 30))


def test_each_thing_worth_knowing_is_said():
    assert words.facts(SUMMARY) == [
        ("flights", "12, 0.123 h in the air (1 bad input, 2 departed)"),
        ("searched for", "the worst false alarm: 0.1235 of the threshold in flight 7"),
        ("detection", "66.7 % (25 % to 87.5 %): 6 of 9 faults detected"),
        ("warning", f"in 4 of 9 flights {SATURATED}"),
        ("inconclusive", f"in 3 of 11 flights the diagnosis could conclude nothing {WHY}"),
        ("detection delay", "median 0.25 s, 95 % 1.5 s, 99 % never, max 2.5 s"),
        ("isolation", "44.4 % (25 % to 87.5 %): 4 of 9 faults named rightly"),
        ("wrongly named", "1 of 5 named"),
        ("false alarms", f"3 in 2.5 h without a fault: 1.2/h (0.25 to 3.5); {RESIDUALS}"),
        ("guarantee", "2 of 5 faults detected later than guaranteed"),
        ("departures", "18.2 % (25 % to 87.5 %): 2 of 11 flights lost"),
        ("delay follows", ", ".join(f"{key} (explains {n} % of the ranks)" for key, n in RANKS)),
    ]  # fmt: skip


def test_what_there_is_nothing_of_is_not_said():
    nothing = {
        "statuses": {"flown": 12}, "search": None, "departures": rate(0, 11), "guarantee": {"promised": 0},
        "detection": {**rate(0, 0), "delay_s": {"of": 0}}, "isolation": {**rate(0, 0), "wrong": rate(0, 0)},
        "on_the_bound": rate(0, 0), "inconclusive": rate(0, 11), "false_alarms": {"hours": 0.0},
        "sensitivity": {"detection_delay": [], "missed_detection": []},
    }  # fmt: skip
    assert words.facts(SUMMARY | nothing) == [("flights", "12, 0.123 h in the air")]
    few = words.facts(SUMMARY | {"on_the_bound": rate(1, 11)})
    assert "warning" not in dict(few)
    assert "warning" in dict(words.facts(SUMMARY | {"on_the_bound": rate(1, 10)}))  # a tenth is many
    search = {"score": None, "objective": "delay", "run": 3}
    assert ("searched for", "the worst delay: none in flight 3") in words.facts(SUMMARY | {"search": search})


@pytest.mark.parametrize(
    ("share", "said"),
    [
        (None, "none"), (0, "0 %"), (1, "100 %"), (0.01, "1 %"), (0.0099, "0.99 %"), (0.99, "99 %"),
        (0.9901, "99.01 %"), (0.0123, "1.2 %"), (0.00012, "0.01 %"), (0.99999, "100 %"), (0.5, "50 %"),
        (0.015, "1.5 %"), (0.98765, "98.8 %"),
    ],
)  # fmt: skip
def test_a_share_has_the_digits_that_matter(share, said):
    assert words.percent(share) == said


def test_a_promise_counts_from_the_faults_first_frame(tmp_path):
    """Up to a frame of 0.01 s after the certain instant an alarm is in time; later it breaks the promise."""
    sweep, promised = load_sweep_text(SWEEP_TEXT), {"detection.guaranteed_delay_s": 0.25}
    delays = (0.2, 0.26, 0.2601, 0.3)
    rows = [detected(run, delay, **promised) for run, delay in enumerate(delays)]
    found = summarise(flights_of([*rows, row(4, **promised), row(5)], tmp_path), sweep)
    assert found["guarantee"] == {"promised": 5, "broken": 3}
