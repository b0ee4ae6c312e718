"""The clock of a live flight, with a clock of the test's."""

import pytest

from beaver_ftc_live.page.flying import TICK_S, Pace


def flown(pace, ticks, from_s=0.0, late_s=0.0):
    """Frames of so many ticks, each late by so much."""
    return sum(pace.frames_due(from_s + (i + 1) * TICK_S + late_s) for i in range(ticks))


@pytest.mark.parametrize("times", [1.0, 2.0, 20.0])
def test_a_second_has_a_seconds_frames(times):
    pace = Pace(100.0, 0.0)
    pace.times = times
    assert flown(pace, 60) == pytest.approx(100.0 * times, abs=1)
    assert pace.achieved == pytest.approx(times, rel=0.05)


def test_jitter_is_the_lateness_of_ticks():
    pace = Pace(100.0, 0.0)
    flown(pace, 60, late_s=0.003)
    assert pace.jitter_ms == pytest.approx(3.0, rel=1e-6)


def test_what_cannot_be_caught_up_with_is_let_go():
    pace = Pace(100.0, 0.0)
    assert pace.frames_due(5.0) == 0
    assert flown(pace, 60, from_s=5.0) <= 101


def test_a_pause_adds_nothing():
    pace = Pace(100.0, 0.0)
    flown(pace, 60)
    pace.hold(10.0)
    assert flown(pace, 6, from_s=10.0) == pytest.approx(10, abs=1)
