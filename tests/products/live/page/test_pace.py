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


def test_frames_are_due_by_the_clock_to_the_frame():
    """At 100 Hz from 10 s on: 1.67 frames a tick; what a late tick lacks the next has."""
    pace = Pace(100.0, 10.0)
    assert (pace.achieved, pace.jitter_ms) == (0.0, 0.0)
    due = [pace.frames_due(10.0 + tick * TICK_S + 1e-6) for tick in (1, 2, 3, 4.5, 5, 6)]
    assert due == [1, 2, 2, 2, 1, 2]
    assert pace.achieved == pytest.approx(10 / 100 / (6 * TICK_S), rel=1e-4)
    assert pace.jitter_ms == pytest.approx(1e3 * 0.5 * TICK_S / 7**0.5, rel=1e-3)


def test_of_a_quarter_of_a_second_all_is_flown_and_of_more_nothing():
    for late_s, due in ((0.249, 26), (0.251, 0)):
        pace = Pace(100.0, 0.0)
        assert pace.frames_due(2 * TICK_S + late_s) == due
        pace = Pace(100.0, 0.0)
        pace.times = 2.0
        assert pace.frames_due(2 * TICK_S + late_s) == (51 if due else 0)


def test_of_a_second_sixty_ticks_are_remembered():
    pace = Pace(100.0, 0.0)
    late_s = 0.2
    pace.frames_due(TICK_S + late_s)
    for tick in range(2, 61):
        pace.frames_due(tick * TICK_S)
    assert pace.jitter_ms == pytest.approx(1e3 * late_s / 60**0.5)
    pace.frames_due(61 * TICK_S)
    assert pace.jitter_ms == pytest.approx(0.0, abs=1e-9)
    assert pace.achieved == pytest.approx(0.98 / (59 * TICK_S), rel=2e-3)
    assert len(pace._flown) == 60


def test_a_pace_that_another_keeps_is_what_it_has_flown():
    """Two hundred frames a second at 100 Hz is twice real time; a flight begun anew counts from there."""
    pace = Pace(100.0, 0.0)
    for tick in range(61):
        pace.follow(tick / 60, round(200 * tick / 60))
    assert pace.achieved == pytest.approx(2.0, rel=0.02)
    pace.follow(2.0, 5)
    assert pace.achieved == 0.0
    pace.follow(3.0, 105)
    assert pace.achieved == pytest.approx(1.0)
