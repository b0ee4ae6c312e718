"""The flight's process with a pipe and a clock of the test's: nothing waits, and each run is the same."""

import json
from types import SimpleNamespace

import pytest

import beaver_ftc as bf
from beaver_ftc.documents.errors import SimulationFailed
from beaver_ftc_live.page import flying
from beaver_ftc_live.page.flying import Flying
from beaver_ftc_live.page.session import Session


class Wire:
    """What is said when, s; and what is answered, (when, page, message). To wait takes no time."""

    def __init__(self, script):
        self.script, self.now_s, self.sent = sorted(script, key=lambda line: line[0]), 0.0, []

    def poll(self, wait_s):
        until_s = self.script[0][0] if wait_s is None else self.now_s + wait_s
        if self.script[0][0] <= until_s:
            self.now_s = max(self.now_s, self.script[0][0])
            return True
        self.now_s = until_s
        return False

    def recv(self):
        return self.script.pop(0)[1:]

    def send(self, told):
        self.sent.append((self.now_s, told[0], json.loads(told[1])))

    def of(self, kind, from_s=0.0, to_s=1e9, page=None):
        """Messages of a kind, sent between two times."""
        return [
            told
            for at_s, who, told in self.sent
            if told["k"] == kind and from_s <= at_s < to_s and page in (None, who)
        ]

    def times(self, from_s=0.0, to_s=1e9):
        """Flight times of the frames sent."""
        return [told["v"][0] for told in self.of("f", from_s, to_s)]


@pytest.fixture
def flown(tmp_path, monkeypatch):
    def fly(*script, break_at_s=None, rate_hz=100):
        session = Session(bf.load("fault-free").with_({"rate_hz": rate_hz}), tmp_path, seed=1)
        wire = Wire([(at_s, page, text if page == 0 else json.dumps(text)) for at_s, page, text in script])
        monkeypatch.setattr(flying, "time", SimpleNamespace(monotonic=lambda: wire.now_s))
        if break_at_s is not None:
            step = session.step

            def fails():
                if session.sim.t_s >= break_at_s:
                    raise SimulationFailed("not finite at 0.5 s")
                step()

            session.step = fails
        Flying(wire, session).run()
        return wire

    return fly


def test_a_second_has_a_seconds_frames_and_sixty_messages(flown):
    wire = flown((0.0, 0, "joined 1"), (2.0, 0, "end"))
    times = wire.times()
    assert times[-1] == pytest.approx(2.0, abs=0.04)
    assert len(times) == pytest.approx(120, abs=2)
    assert times == sorted(times)
    states = wire.of("s")
    assert len(states) == pytest.approx(8, abs=2)
    assert {state["pages"] for state in states} == {1}
    assert states[-1]["achieved"] == pytest.approx(1.0, abs=0.05)
    assert [hello["k"] for hello in wire.of("hello", page=1)] == ["hello"]


STICK = {"do": "stick", "rates_deg_s": [4, 0, 0]}


@pytest.mark.parametrize(("gone", "centred"), [(1, True), (2, False)])
def test_the_stick_of_a_page_that_leaves_is_centred(flown, gone, centred):
    joined = (0.0, 0, "joined 1"), (0.0, 0, "joined 2")
    wire = flown(*joined, (0.5, 1, STICK), (1.0, 0, f"left {gone}"), (1.5, 0, "end"))
    assert [told["stick"] for told in wire.of("f", 0.1, 0.45)][-1] is None
    assert wire.of("f", 0.6, 0.95)[-1]["stick"] is not None
    assert (wire.of("f", 1.1)[-1]["stick"] is None) == centred
    assert not wire.of("ack")  # a stick is not answered


def test_a_pause_holds_the_flight_and_nothing_is_caught_up_with(flown):
    pause, on = {"do": "pause", "on": True, "n": 5}, {"do": "pause", "on": False}
    wire = flown((0.0, 0, "joined 1"), (1.0, 1, pause), (3.0, 1, on), (4.0, 0, "end"))
    assert {told["paused"] for told in wire.of("s", 1.3, 2.9)} == {True}
    assert len(set(wire.times(1.1, 2.9))) == 1
    assert wire.times()[-1] == pytest.approx(2.0, abs=0.06)
    assert wire.of("ack")[0] == {"k": "ack", "n": 5, "ok": True, "says": "paused"}


def test_who_asks_is_answered_and_all_are_told_what_happens(flown):
    joined = (0.0, 0, "joined 1"), (0.0, 0, "joined 2")
    jam = {"do": "break", "fault": {"type": "stuck", "actuator": "rudder"}, "n": 7}
    wrong = {"do": "break", "fault": {"type": "stuck", "actuator": "nose"}, "n": 8}
    wire = flown(*joined, (0.3, 1, jam), (0.4, 2, wrong), (0.5, 2, {"do": "nonsense"}), (0.8, 0, "end"))
    assert wire.of("ack", page=1) == [{"k": "ack", "n": 7, "ok": True, "says": "rudder broken"}]
    refused, nonsense = wire.of("ack", page=2)
    assert (refused["n"], refused["ok"]) == (8, False)
    assert "'nose' is not known" in refused["says"]
    assert (nonsense["n"], nonsense["ok"]) == (0, False)
    told = [event["kind"] for each in wire.of("e", page=0) for event in each["events"]]
    assert told[:2] == ["flight", "broken"]
    after = [state["broken"] for state in wire.of("s", 0.3, 0.35)]
    assert after == [["rudder"]]  # with the next frame


def test_a_flight_that_cannot_go_on_is_held_and_says_why(flown):
    wire = flown((0.0, 0, "joined 1"), (1.5, 0, "end"), break_at_s=0.5)
    (said,) = wire.of("ack", page=0)
    assert said == {"k": "ack", "n": 0, "ok": False, "says": "not finite at 0.5 s"}
    assert wire.of("s")[-1]["paused"]
    assert wire.times()[-1] == pytest.approx(0.5, abs=0.02)
