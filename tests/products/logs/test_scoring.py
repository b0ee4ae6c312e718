"""A diagnosis against the log's own word, by hand."""

import numpy as np
import pytest

from beaver_ftc_logs import scoring
from beaver_ftc_logs.log_rows import LogRows
from beaver_ftc_logs.recording import LoggedFailure
from products.logs import small

GROUPS = [["left_aileron", "right_aileron"], ["elevator"], ["rudder"]]


def rows(estimate, low, high, faulty=None):
    estimate = np.array(estimate, dtype=float)
    faulty = np.zeros(len(estimate), dtype=int) if faulty is None else np.array(faulty)
    n = len(estimate)
    named = np.full(n, "", dtype=object)
    t_s = np.arange(n) * 1.0
    return LogRows(t_s, faulty, named, estimate, np.array(low), np.array(high), np.zeros(n), t_s)


def test_figures_by_labels():
    """Five rows known of six: classes, health, side, error and bounds each differ."""
    labels = np.array([[1, 1], [1, 0.5], [1, 0.5], [0.2, 1], [np.nan, 1], [1, 1]], dtype=float)
    estimate = [[1, 1], [1, 0.6], [1, 0.9], [0.3, 1], [0, 0], [0.9, 1]]
    low = np.array([[1, 1], [1, 0.5], [1, 0.6], [0.2, 0.9], [0, 0], [0.8, 1]])
    high = np.array([[1, 1], [1, 0.7], [1, 1.0], [0.4, 0.95], [0, 0], [0.9, 1]])
    assert scoring.score_against_labels(rows(estimate, low, high, [0, 1, 0, 1, 1, 1]), labels) == {
        "rows": 5,
        "settings": [[0.2, 1.0], [1.0, 0.5], [1.0, 1.0]],
        "classes": pytest.approx(4 / 5),
        "healthy_or_faulty": pytest.approx(3 / 5),
        "side": pytest.approx(4 / 5),
        "mean_error": pytest.approx((0.1 + 0.4 + 0.1 + 0.1) / 10),
        "held_by_bounds": pytest.approx(7 / 10),
    }


def test_labels_of_which_none_is_frequent_have_a_setting():
    ramp = np.linspace(0.0, 1.0, 300)[:, None]
    assert scoring.score_against_labels(rows(ramp, ramp, ramp), ramp)["classes"] == 1.0


FAILURE = (
    LoggedFailure(12.0, "right_aileron"),
    LoggedFailure(13.99, "rudder"),
    LoggedFailure(14.0, "elevator"),
)


def told(parts):
    """Rows a half second apart from 10 s: (count, name); faulty where there is a name."""
    return small.rows([(count, name, [1.0]) for count, name in parts], 1)


def test_an_alarm_before_and_after_the_failure():
    """False before 12 s, one more begun there; late by the first row with an alarm."""
    found = scoring.score_against_failures(
        told([(1, "rudder"), (1, ""), (2, "elevator"), (2, ""), (3, "left_aileron"), (1, "unknown")]),
        FAILURE,
        GROUPS,
    )
    assert found == {
        "failure": "right_aileron+rudder",
        "failure_s": 12.0,
        "healthy_s": 1.5,
        "false_alarms": 2,
        "detected": True,
        "delay_s": 1.0,
        "named": {"left_aileron": 0.75, "unknown": 0.25},
        "right_group": True,
    }


def test_a_failure_that_is_not_found_and_a_flight_without_any():
    missed = scoring.score_against_failures(told([(9, "")]), FAILURE, GROUPS)
    assert missed | {"detected": False, "delay_s": None, "named": {}, "right_group": None} == missed
    quiet = scoring.score_against_failures(told([(4, ""), (2, "rudder"), (3, "")]), (), GROUPS)
    assert quiet == {
        "failure": None, "failure_s": None, "healthy_s": 4.0, "false_alarms": 1, "detected": False,
        "delay_s": None, "named": {}, "right_group": None,
    }  # fmt: skip
    at_once = scoring.score_against_failures(told([(3, "rudder")]), (LoggedFailure(10.0, "rudder"),), GROUPS)
    assert at_once | {"healthy_s": 0.0, "false_alarms": 0, "delay_s": 0.0} == at_once
