"""What a campaign draws and keeps to the number, and what becomes of a flight's promises at their bounds."""

from types import SimpleNamespace

import numpy as np
import pytest

from beaver_ftc.documents.errors import BadInput
from beaver_ftc.scenario.schema import Scenario
from beaver_ftc.studies import guarantees
from beaver_ftc.studies.guarantees import fly_draw, judge
from beaver_ftc.studies.random_flights import Draw


def landing(at_s=4.995, rate_hz=50.0, **changes):
    loss = {"actuator": "elevator", "type": "loss_of_effectiveness", "magnitude": 0.5, "at_s": at_s}
    document = {"name": "x", "duration_s": 20, "rate_hz": rate_hz, "substeps": changes.pop("substeps", 1)}
    scenario = Scenario.model_validate({**document, "faults": [loss | changes.pop("fault", {})]})
    nothing = {
        "detection_time_s": None, "isolation_time_s": None, "guaranteed_delay_s": None, "isolated": None,
        "candidates": (), "estimate": None, "frames": 1000,
    }  # fmt: skip
    return SimpleNamespace(scenario=scenario, **nothing | changes)


def test_delays_count_from_the_first_frame_with_the_fault():
    found = judge(landing(detection_time_s=5.5, isolation_time_s=5.75, isolated="elevator", estimate=-0.45))
    assert found == pytest.approx({
        "delay_s": 0.5, "false_alarm": False, "guaranteed_s": None, "late": False, "isolation_delay_s": 0.75,
        "excluded": False, "wrong": False, "estimate_error": 0.05,
    })  # fmt: skip
    assert judge(landing(at_s=5.0, detection_time_s=5.5))["delay_s"] == pytest.approx(0.5)
    assert judge(landing(at_s=5.0 + 5e-10, detection_time_s=5.5))["delay_s"] == pytest.approx(0.5)
    assert judge(landing(at_s=5.0 + 5e-9, detection_time_s=5.5))["delay_s"] == pytest.approx(0.48)
    nothing = judge(landing())
    assert (nothing["delay_s"], nothing["isolation_delay_s"], nothing["estimate_error"]) == (None, None, None)
    assert not any(nothing[broken] for broken in ("false_alarm", "late", "excluded", "wrong"))


@pytest.mark.parametrize(
    ("substeps", "alarm_s", "false"),
    [(1, 5.0, False), (1, 5.02, False), (1, 4.98, True), (2, 5.0, False), (2, 4.98, True), (1, None, False)],
)
def test_an_alarm_before_the_fault_is_false_as_in_the_metrics(substeps, alarm_s, false):
    assert judge(landing(substeps=substeps, detection_time_s=alarm_s))["false_alarm"] is false


@pytest.mark.parametrize(
    ("guaranteed_s", "alarm_s", "late"),
    [(0.5, 5.52, False), (0.5, 5.53, True), (0.5, None, True), (None, None, False), (0.5, 5.5, False)],
)
def test_a_promise_is_kept_up_to_a_frame_after(guaranteed_s, alarm_s, late):
    assert judge(landing(guaranteed_delay_s=guaranteed_s, detection_time_s=alarm_s))["late"] is late


@pytest.mark.parametrize(
    ("candidates", "isolated", "excluded", "wrong"),
    [
        (("elevator", "rudder"), None, False, False), (("rudder", "elevator"), None, False, False),
        ((), "elevator", False, False),
        (("rudder",), None, True, False), ((), "rudder", True, True),
    ],
)  # fmt: skip
def test_the_true_fault_is_named_or_left(candidates, isolated, excluded, wrong):
    found = judge(landing(detection_time_s=5.5, candidates=candidates, isolated=isolated))
    assert (found["excluded"], found["wrong"]) == (excluded, wrong)


def test_the_error_of_an_estimate_is_of_what_has_grown_by_the_end():
    growing = {"profile": "incipient", "kappa_per_s": 0.1}
    found = judge(landing(at_s=5.0, fault=growing, isolated="elevator", estimate=-0.3))
    assert found["estimate_error"] == pytest.approx(0.5 * (1 - np.exp(-0.1 * 15.0)) - 0.3)
    assert judge(landing(isolated="elevator"))["estimate_error"] is None
    assert judge(landing(isolated="rudder", estimate=-0.3))["estimate_error"] is None


def test_a_draw_without_a_trim_is_said(monkeypatch):
    def untrimmed(scenario):
        raise BadInput("no trim")

    monkeypatch.setattr(guarantees, "fly", untrimmed)
    assert fly_draw(Draw(1, "healthy", 3), {}) == {"index": 3, "skipped": "no trim"}
