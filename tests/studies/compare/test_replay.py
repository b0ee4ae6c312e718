"""One recorded flight serves every detector: its traces are what a flight of its own would have given."""

from math import inf
from types import SimpleNamespace

import numpy as np
import pytest

from beaver_ftc.diagnosis import Verdict
from beaver_ftc.loop.loop import fly
from beaver_ftc.studies.compare.replay import record, replay, trace
from flying import loss, scenario

FAULT = loss("elevator", 0.5, 6.0)


@pytest.fixture(scope="module")
def recorded():
    return record(scenario(duration_s=9, faults=[FAULT]))


@pytest.mark.parametrize("scheme", ["adaptive-estimators", "observer-constant", "multiple-models"])
def test_the_alarm_of_a_replay_is_that_of_a_flight(recorded, scheme):
    flown = fly(scenario(duration_s=9, faults=[FAULT], fdi={"scheme": scheme}, control={"law": "nominal"}))
    seen = replay(recorded, scheme)
    assert seen.delay_s() == pytest.approx(flown.detection_time_s - 6.0)
    assert seen.faulted
    assert seen.healthy_s == pytest.approx(6.0)
    assert recorded.known.all()  # the error of the Beaver's model, wherever it flies
    assert recorded.error.shape == (900, 3)


def test_a_detector_is_shown_a_copy_of_one_frame(recorded, monkeypatch):
    """Not a view of a whole flight, with frames to come; nor what the next detector is shown."""
    views = []
    peeking = SimpleNamespace(reset=id, step=lambda of, _: views.append(of.x.base) or Verdict())
    monkeypatch.setattr("beaver_ftc.studies.compare.replay.made", lambda *_: peeking)
    replay(recorded, "peeking")
    assert views == [None] * 900


def test_the_statistical_detector_alarms_on_the_recording_as_in_flight():
    fdi = {"statistical": {}, "authority": "statistical", "bounds": {"sensors": "tactical-grade"}}
    keys = {"duration_s": 9, "faults": [FAULT], "sensors": "tactical-grade", "fdi": fdi}
    flown = fly(scenario(**keys, control={"law": "nominal"}))
    seen = replay(record(scenario(**keys)), "adaptive-estimators")
    assert seen.delay_s() == pytest.approx(flown.detection_time_s - 6.0)
    assert not seen.false_alarm(1.0)


def test_a_trace_answers_as_the_whole_series_would(recorded):
    rng = np.random.default_rng(0)
    statistic = np.abs(rng.normal(size=len(recorded.seen))).cumsum() ** 0.5 * rng.random(len(recorded.seen))
    seen = trace(recorded, statistic)
    t = np.array([measured.t_s for measured, _ in recorded.seen])
    before, after = statistic[t < 6 - 1e-9], statistic[t >= 6 - 1e-9]
    for level in np.quantile(statistic, [0.1, 0.5, 0.9, 0.999, 1.0]):
        assert seen.false_alarm(level) == (before > level).any()
        over = np.flatnonzero(after > level)
        expected = t[t >= 6 - 1e-9][over[0]] - 6 if over.size and not (before > level).any() else inf
        assert seen.delay_s(level) == pytest.approx(expected)
