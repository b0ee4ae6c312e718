"""False alarms, delays and names: one answer for all who judge, held by hand and by whoever asks."""

from types import SimpleNamespace

import numpy as np
import pytest
from synthetic import Flight

from beaver_ftc.results.metrics import DeclaredFault, Onset, Truth, measure
from beaver_ftc.scenario.schema import load
from beaver_ftc.studies.compare.replay import Recording, trace
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


def test_a_replayed_alarm_is_as_late_as_a_flown_one():
    """The statistic passes 1 at 5.1 s: 0.1 s after the first frame with the fault, not after 4.995 s."""
    seen = [(SimpleNamespace(t_s=k / RATE_HZ), None) for k in range(300)]
    played = Recording(SimpleNamespace(dt_s=0.02), seen, np.zeros(300), Onset(4.995, RATE_HZ))
    replayed = trace(played, np.where(np.arange(300) >= 255, 2.0, 0.0))
    assert replayed.delay_s() == measure(flight(5.1)).detection.delay_s == 0.1
    assert not replayed.false_alarm(1.0)


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
