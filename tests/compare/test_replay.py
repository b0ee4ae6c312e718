"""One recorded flight serves every detector: its traces are what a flight of its own would have given."""

from math import inf

import numpy as np
import pytest

from beaver_ftc.compare.replay import Trace, record, replay, trace
from beaver_ftc.loop import fly
from flying import scenario

FAULT = {"actuator": "elevator", "type": "loss_of_effectiveness", "magnitude": 0.5, "at_s": 6}


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


def test_the_recording_changes_nothing(recorded):
    silent = fly(scenario(duration_s=9, faults=[FAULT], fdi={"scheme": "none"}, control={"law": "nominal"}))
    assert len(recorded.seen) == silent.frames
    last, _ = recorded.seen[-1]
    assert np.isfinite(last.x).all()
    assert recorded.fault_at_s == 6.0


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


def test_a_level_beyond_everything_is_never_reached():
    quiet = Trace(0.5, ((0.0, 0.6), (1.0, 0.9)), faulted=True, healthy_s=10.0)
    assert quiet.delay_s(0.9) == inf
    assert quiet.delay_s(0.89) == 1.0
    assert quiet.delay_s(0.4) == inf  # there was an alarm before
    assert quiet.false_alarm(0.4)
