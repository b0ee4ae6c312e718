from collections import Counter

import pytest

from beaver_ftc import cli as shown
from beaver_ftc.cli import live_progress


class Clock:
    now = 100.0

    def monotonic(self):
        return self.now


@pytest.fixture
def clock(monkeypatch):
    clock = Clock()
    monkeypatch.setattr(shown, "time", clock)
    return clock


def test_it_says_done_rate_time_left_and_detections(clock, capsys):
    with live_progress("many") as progress:
        progress(Counter(total=10_000, done=500))  # resumed: these cost no time now
        clock.now += 50
        progress(Counter(total=10_000, done=1500, failed=3, faulted=1400, detected=1190))
    line = capsys.readouterr().err.strip()
    assert line == "many: 1500 of 10000 flights, 20/s, 7 min left, detected 85.0%, 3 not flown"


def test_a_log_is_not_flooded(clock, capsys):
    with live_progress("many") as progress:
        for done in range(600):
            clock.now += 0.1
            progress(Counter(total=600, done=done))
    assert len(capsys.readouterr().err.splitlines()) <= 2


@pytest.mark.parametrize(("seconds", "said"), [(5, "5 s"), (150, "2 min"), (20_000, "5 h 33 min")])
def test_time_left_is_said_as_people_say_it(seconds, said):
    assert shown._span(seconds) == said
