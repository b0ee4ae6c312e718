"""False alarms, delays and names: one answer for all who judge, held by hand and by whoever asks."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from synthetic import Flight

from beaver_ftc.results.metrics import DeclaredFault, Onset, Truth, is_late, measure, strikes_within
from beaver_ftc.scenario.schema import load
from beaver_ftc.studies.compare.replay import Recording, trace
from beaver_ftc.studies.compare.trial import Entry, result_of
from beaver_ftc.studies.mismatch import bound
from beaver_ftc.studies.verify import judge

LOSS = {"actuator": "elevator", "type": "loss_of_effectiveness", "magnitude": 0.5, "at_s": 4.995}
RATE_HZ = 50.0


def flight(alarm_s, named_s=None, name=None, guaranteed_s=None, **keys):
    """As the loop yields it, with no more than a verdict; the fault is there from 5.0 s on."""
    scenario = load({"name": "x", "rate_hz": RATE_HZ, "faults": [LOSS], "duration_s": 20, **keys})
    return Flight(
        scenario=scenario, detection_time_s=alarm_s, isolation_time_s=named_s, isolated=name,
        guaranteed_delay_s=guaranteed_s, isolation_type=None, candidates=(), estimate=None, frames=1000,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("alarm_s", "false", "delay_s"),
    [
        (4.98, True, None),
        (4.995 - 2e-9, True, None),
        (4.995, False, 0.0),
        (5.0, False, 0.0),
        (5.5, False, 0.5),
    ],
)
@pytest.mark.parametrize("substeps", [1, 2])
def test_all_who_judge_an_alarm_say_the_same(monkeypatch, alarm_s, false, delay_s, substeps):
    """Also in the very frame of the fault, and where the fault is declared between two frames."""
    landed = flight(alarm_s, substeps=substeps)
    amounts, row = measure(landed), judge(landed)
    monkeypatch.setattr(bound, "fly", lambda scenario: landed)
    monkeypatch.setattr(bound, "published_case", lambda *of: None)
    guarantee = bound.guarantee_with({}, None)
    assert (amounts.false_alarm, row["false_alarm"], guarantee["false_alarm"]) == (false, false, false)
    assert (amounts.detection.delay_s, row["delay_s"], guarantee["detection_delay_s"]) == (delay_s,) * 3


@pytest.mark.parametrize(
    ("alarm_s", "named_s", "name", "found_s", "named"),
    [
        (5.1, 5.3, "elevator", 0.1, True),
        (5.1, 5.3, "rudder", 0.1, False),
        (5.1, None, None, 0.1, False),
        (4.9, 5.3, "elevator", None, False),
        (None, None, None, None, False),
    ],
)
def test_a_fault_is_found_where_no_false_alarm_came_before(alarm_s, named_s, name, found_s, named):
    found = measure(flight(alarm_s, named_s, name))
    assert (found.fault_found_s, found.fault_named) == (found_s, named)
    result = result_of(flight(alarm_s, named_s, name), Entry("x", "y"), 0.0)
    assert (result.correct, result.isolation_delay_s) == (named, 0.3 if named else np.inf)


def test_the_alarm_of_a_diagnosis_that_a_change_ended_counts_too():
    """The second diagnosis finds the fault and names it; the first one had alarmed before it."""
    renewed = {"time_s": 3.0, "law": None, "scheme": "zhang2005", "sensors": False}
    of_it = {"detection_time_s": 2.0, "isolated": None}
    found = measure(replace(flight(5.1, 5.3, "elevator"), changes=(renewed | of_it,)))
    assert (found.detection.delay_s, found.isolation.correct) == (0.1, True)
    assert (found.fault_found_s, found.fault_named) == (None, False)


def test_a_replayed_alarm_is_as_late_as_a_flown_one():
    """The statistic passes 1 at 5.1 s: 0.1 s after the first frame with the fault, not after 4.995 s."""
    seen = [(SimpleNamespace(t_s=k / RATE_HZ), None) for k in range(300)]
    played = Recording(SimpleNamespace(dt_s=0.02), seen, np.zeros(300), Onset(4.995, RATE_HZ))
    replayed = trace(played, np.where(np.arange(300) >= 255, 2.0, 0.0))
    assert replayed.delay_s() == measure(flight(5.1)).detection.delay_s == 0.1
    assert not replayed.false_alarm(1.0)


def test_a_truth_without_frames_begins_when_it_is_said_to():
    onset = Onset(4.995)
    assert onset.first_frame_with_fault_s == 4.995
    assert onset.delay_s(5.0) == pytest.approx(0.005)
    assert onset.is_false(np.array([4.9, 4.995, 5.0])).tolist() == [True, False, False]
    healthy = Onset(None)
    assert healthy.is_false(1e9)
    assert healthy.delay_s(1.0) is None


def test_a_frame_after_the_certain_instant_is_not_late():
    delays = np.array([0.5, 0.52, 0.54])
    assert is_late(delays, 0.5, 0.02).tolist() == [False, False, True]


@pytest.mark.parametrize(
    ("fault", "right", "wrong"),
    [
        (DeclaredFault("elevator", "stuck", 1.0), ["elevator"], ["flap", "unanticipated", None]),
        (DeclaredFault(None, "unanticipated", 1.0), ["unanticipated"], ["elevator", None]),
        (DeclaredFault(None, "bias", 1.0, sensor="q"), ["sensor q", "unanticipated"], ["q", "sensor p"]),
        (DeclaredFault(None, "damage", 1.0), ["unanticipated", "rudder"], ["elevator", None]),
    ],
)
def test_which_name_is_right(fault, right, wrong):
    taken = frozenset({"rudder"})
    assert all(fault.is_named_by(name, taken) for name in right)
    assert not any(fault.is_named_by(name, taken) for name in wrong)


def test_a_name_before_its_fault_is_premature_and_not_correct():
    early, late = (measure(flight(1.0, named_s, "elevator")).isolation for named_s in (2.0, 6.0))
    assert (early.premature, early.correct, early.delay_s) == (True, False, None)
    assert (late.premature, late.correct, late.delay_s) == (False, True, 1.0)


def test_two_surfaces_are_beyond_one_fault_once_the_second_fails():
    second = {**LOSS, "actuator": "rudder", "at_s": 7.0}
    one, several = (
        Truth.of(load({"name": "x", "faults": [LOSS, second], "fdi": {"fault_class": "all", "pairs": pairs}}))
        for pairs in (False, True)
    )
    assert not one.faults_named_rightly_by("unanticipated", 6.9)
    assert [fault.at_s for fault in one.faults_named_rightly_by("unanticipated", 7.0)] == [7.0]
    assert not several.faults_named_rightly_by("unanticipated", 7.0)
    assert [fault.actuator for fault in several.faults_named_rightly_by("rudder", 7.0)] == ["rudder"]


def test_a_fault_at_the_end_of_a_flight_never_struck():
    at_s, flown_s = np.array([1.0, 5.0, np.nan]), np.array([5.0, 5.0, 5.0])
    assert strikes_within(at_s, flown_s).tolist() == [True, False, False]
    short = replace(flight(None), frames=round(4.98 * RATE_HZ))
    assert [result_of(one, Entry("x", "y"), 0.0).faulted for one in (flight(None), short)] == [True, False]
