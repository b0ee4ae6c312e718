"""Counting: rates with their bounds, quantiles with what never came, levels at matched false alarms."""

from math import inf

import pytest

from beaver_ftc.studies.compare import scores, trial
from beaver_ftc.studies.compare.replay import Trace
from beaver_ftc.studies.compare.scores import (
    line_of,
    lines_of,
    matched,
    point_at,
    trade_off,
)
from beaver_ftc.studies.compare.trial import Entry, Result
from beaver_ftc.studies.engine.statistics import share_within

ENTRY = Entry("a", "b")


def _result(**changes):
    values = {"entry": ENTRY, "false_alarm": False, "fault_free_s": 360.0, "faulted": True, "delay_s": 0.1,
              "isolated": "rudder", "correct": True, "isolation_delay_s": 0.2, "rms_deg_s": 1.0}  # fmt: skip
    return Result(**{**values, **changes})


def test_a_line_counts():
    mine = [
        _result(),
        _result(delay_s=inf, correct=False, isolation_delay_s=inf, rms_deg_s=4.0),
        _result(false_alarm=True, fault_free_s=180.0, delay_s=inf, correct=False, isolation_delay_s=inf),
        _result(faulted=False, delay_s=inf, correct=False, rms_deg_s=inf, departed=True),
        _result(error="could not"),
    ]
    oracle = [_result(rms_deg_s=0.5)] * 5
    line = line_of(ENTRY, mine, oracle)
    assert (line["flights"], line["failed"], line["faults"], line["departures"]) == (4, 1, 3, 1)
    assert line["healthy_h"] == pytest.approx((3 * 360 + 180) / 3600)
    assert line["false_alarms_per_h"] == pytest.approx(1 / 0.35)
    assert line["detection_rate"] == pytest.approx(1 / 3)
    assert line["isolation_rate"] == pytest.approx(1 / 3)
    assert line["delay_median_s"] == inf
    assert line["ratio_median"] == 2.0  # of 2, 8, 2 and infinity, the least that half do not exceed
    assert line["ratio_90"] == inf


def test_nothing_to_count_is_not_zero():
    line = line_of(ENTRY, [_result(faulted=False, fault_free_s=0.0)], [_result()])
    assert line["detection_rate"] is None
    assert line["false_alarms_per_h"] is None


def test_quantiles_count_what_never_came_as_last():
    assert share_within([3.0, 1.0, inf, 2.0], 0.5) == 2.0
    assert share_within([3.0, 1.0, inf, 2.0], 0.9) == inf
    assert share_within([], 0.5) == inf


def _traces():
    healthy = [Trace(value, (), faulted=False, healthy_s=1800.0) for value in (0.2, 0.5, 0.7)]
    faulted = [
        Trace(0.1, ((0.0, 0.3), (1.0, 0.8)), faulted=True, healthy_s=900.0),
        Trace(0.6, ((0.5, 2.0),), faulted=True, healthy_s=900.0),
    ]
    return healthy + faulted


def test_a_lower_level_buys_delay_with_false_alarms():
    points = trade_off(_traces())
    assert [point["level"] for point in points] == [1.0, 0.7, 0.6, 0.5, 0.2, 0.1]
    assert [p["false_alarms_per_h"] for p in points] == pytest.approx([0, 0, 0.5, 1.0, 1.5, 2.0], abs=0.5)
    rates = [point["false_alarms_per_h"] for point in points]
    assert rates == sorted(rates)
    assert points[0]["detection_rate"] == 0.5
    assert points[1]["detection_rate"] == 1.0


def test_the_matched_level_is_the_most_sensitive_one_allowed():
    assert matched(trade_off(_traces()))["level"] == 0.7
    assert matched(trade_off(_traces()), 0.51)["level"] == 0.6
    assert point_at(_traces(), 0.1)["detection_rate"] == 1.0  # of the one flight without an earlier alarm


def test_shares_of_the_faulted_flights_and_of_all():
    mine = [_result(fault_free_s=1800.0, before_deg_s=b, after_deg_s=2 * b, us=b) for b in (1.0, 3.0)]
    mine.append(_result(correct=False, fault_free_s=1800.0, before_deg_s=5.0, after_deg_s=10.0, us=5.0))
    line = line_of(ENTRY, mine, mine)
    assert line["isolation_rate"] == pytest.approx(2 / 3)
    assert (line["detection_rate"], line["healthy_h"], line["us"]) == (1.0, 1.5, 3.0)
    assert (line["before_median"], line["before_90"]) == (3.0, 5.0)
    assert (line["after_median"], line["after_90"]) == (6.0, 10.0)
    assert 0.0 < line["detection_rate_lower"] < 1.0
    assert line["false_alarms_per_h_upper"] > 0.0


def test_each_entry_is_tallied_from_its_own_flights_against_the_yardsticks():
    other, yardstick = Entry("c", "d"), Entry(trial.SCHEME, trial.ORACLE)
    flown = ((ENTRY, 3.0), (yardstick, 1.0), (other, 5.0)), ((ENTRY, 4.0), (yardstick, 2.0), (other, 8.0))
    trials = [trial.Trial("set", [_result(entry=of, rms_deg_s=rms) for of, rms in one]) for one in flown]
    mine, theirs = lines_of(trials, [ENTRY, other])
    assert [(line["scheme"], line["law"], line["flights"]) for line in (mine, theirs)] == [
        (ENTRY.scheme, ENTRY.law, 2), (other.scheme, other.law, 2),
    ]  # fmt: skip
    assert (mine["ratio_median"], mine["ratio_90"]) == (2.0, 3.0)
    assert (theirs["ratio_median"], theirs["ratio_90"]) == (4.0, 5.0)


def test_without_flights_a_level_costs_nothing():
    assert point_at([], 1.0)["false_alarms_per_h"] == 0.0


def test_flights_without_a_number_on_either_side_give_no_ratio():
    """Only 12 / 4 is a ratio: an oracle that departed, stood still or failed has none."""
    mine = [_result(rms_deg_s=rms) for rms in (12.0, 5.0, 7.0, 9.0)] + [_result(error="no")] * 2
    oracle = [_result(rms_deg_s=rms) for rms in (4.0, inf, 0.0)]
    line = line_of(ENTRY, mine, [*oracle, _result(error="lost", rms_deg_s=2.0), *oracle[:2]])
    assert (line["ratio_median"], line["ratio_90"]) == (3.0, 3.0)
    assert (line["flights"], line["failed"]) == (4, 2)


def test_better_is_more_of_rates_and_less_of_all_else_by_more_than_rounding():
    """Nothing is worse than any number, and no number is no claim."""
    ours = {"detection_rate": 0.5, "median_delay_s": 0.25, "rms": None}
    words = {"detection_rate": "rate", "median_delay_s": "delay", "rms": "error"}
    for row, said in (
        ({"detection_rate": 0.5 + 5e-10, "median_delay_s": 0.25 - 5e-10, "rms": None}, []),
        ({"detection_rate": 0.25, "median_delay_s": 0.5}, []),
        ({"detection_rate": 0.75}, ["x has the better rate: 0.75 against 0.5"]),
        ({"median_delay_s": 0.125, "rms": 9.0}, [
            "x has the better delay: 0.125 against 0.25", "x has the better error: 9 against never",
        ]),
    ):  # fmt: skip
        assert list(scores._better(row, ours, words, "x")) == said
