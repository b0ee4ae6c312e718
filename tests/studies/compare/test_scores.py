"""Counting: rates with their bounds, quantiles with what never came, levels at matched false alarms."""

from math import inf

import pytest

from beaver_ftc.studies.compare.replay import Trace
from beaver_ftc.studies.compare.rivals import better_than_ours, who_is_better
from beaver_ftc.studies.compare.scores import line_of
from beaver_ftc.studies.compare.trade_off import matched, trade_off
from beaver_ftc.studies.compare.trial import LAW, SCHEME, STATISTICAL, Entry, Result

ENTRY = Entry("a", "b")


def _result(**changes):
    values = {"entry": ENTRY, "false_alarm": False, "fault_free_s": 360.0, "faulted": True, "delay_s": 0.1,
              "correct": True, "isolation_delay_s": 0.2, "rms_deg_s": 1.0}  # fmt: skip
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
    assert line_of(ENTRY, [_result(error="no")], [_result()])["us"] == inf
    (point,) = trade_off([Trace(0.0, (), faulted=False, healthy_s=0.0)])
    assert (point["detection_rate"], point["false_alarms_per_h"], matched([point])) == (None, None, None)


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
    rates = [point["false_alarms_per_h"] for point in points]
    assert rates == sorted(rates)
    assert points[0]["detection_rate"] == 0.5
    assert points[1]["detection_rate"] == 1.0
    assert points[-1]["detection_rate"] == 1.0  # of the one flight without an earlier alarm
    assert matched(points)["level"] == 0.7


def test_flights_without_a_number_on_either_side_give_no_ratio():
    """Only 12 / 4 is a ratio: an oracle that departed, stood still or failed has none."""
    mine = [_result(rms_deg_s=rms) for rms in (12.0, 5.0, 7.0, 9.0)] + [_result(error="no")] * 2
    oracle = [_result(rms_deg_s=rms) for rms in (4.0, inf, 0.0)]
    line = line_of(ENTRY, mine, [*oracle, _result(error="lost", rms_deg_s=2.0), *oracle[:2]])
    assert (line["ratio_median"], line["ratio_90"]) == (3.0, 3.0)
    assert (line["flights"], line["failed"]) == (4, 2)
    duel = line_of(ENTRY, mine, oracle + oracle[:3], [_result(rms_deg_s=8.0)] * 6)["against_ours"]
    assert duel["worse"] == duel["better"] == 2


def test_yardsticks_and_parts_of_ours_are_no_rivals():
    entries = [Entry(scheme, LAW) for scheme in (SCHEME, STATISTICAL, "none", "x")]
    entries += [
        Entry(SCHEME, law) for law in ("fault-tolerant-published", "oracle-published", "fault-tolerant-y")
    ]
    soon = {"delay_s": 0.05, "rms_deg_s": 0.5}
    lines = [line_of(e, [_result(**soon if e != entries[0] else {})], [_result()]) for e in entries]
    sentences = better_than_ours(lines, {})
    assert {sentence.partition(" has ")[0] for sentence in sentences} == {"x", "fault-tolerant-y"}
    assert "fault-tolerant-y 0.50" in who_is_better(lines)["laws"]
