"""The flight's process with a pipe and a clock of the test's: nothing waits, and each run is the same."""

import json
from types import SimpleNamespace

import pytest

import beaver_ftc as bf
from beaver_ftc.documents.errors import SimulationFailed
from beaver_ftc_live.page import BAD_INPUT, flying
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


def test_the_flight_waits_while_nobody_looks_on(flown):
    wire = flown((0.0, 0, "joined 1"), (1.0, 0, "left 1"), (100.0, 0, "joined 2"), (101.0, 0, "end"))
    assert not wire.times(1.05, 100.0)
    before, after = wire.times(to_s=1.05), wire.times(100.0)
    assert before[-1] == pytest.approx(1.0, abs=0.04)
    assert before[-1] <= after[0] <= before[-1] + 0.04
    assert after[-1] == pytest.approx(2.0, abs=0.06)


STICK = {"do": "stick", "rates_deg_s": [4, 0, 0]}


@pytest.mark.parametrize(("gone", "centred"), [(1, True), (2, False)])
def test_the_stick_of_a_page_that_leaves_is_centred(flown, gone, centred):
    joined = (0.0, 0, "joined 1"), (0.0, 0, "joined 2")
    wire = flown(*joined, (0.5, 1, STICK), (1.0, 0, f"left {gone}"), (1.5, 0, "end"))
    assert [told["stick"] for told in wire.of("f", 0.1, 0.45)][-1] is None
    assert wire.of("f", 0.6, 0.95)[-1]["stick"] is not None
    assert (wire.of("f", 1.1)[-1]["stick"] is None) == centred
    assert not wire.of("ack")  # a stick is not answered


def test_the_last_page_to_move_the_stick_steers(flown):
    joined = (0.0, 0, "joined 1"), (0.0, 0, "joined 2")
    wire = flown(*joined, (0.3, 1, STICK), (0.5, 2, STICK), (0.7, 0, "left 1"), (1.5, 0, "end"))
    assert wire.of("f", 1.1)[-1]["stick"] is not None


def test_a_pause_holds_the_flight_and_nothing_is_caught_up_with(flown):
    pause, on = {"do": "pause", "on": True, "n": 5}, {"do": "pause", "on": False}
    wire = flown((0.0, 0, "joined 1"), (1.0, 1, pause), (3.0, 1, on), (4.0, 0, "end"))
    assert {told["paused"] for told in wire.of("s", 1.3, 2.9)} == {True}
    assert len(set(wire.times(1.1, 2.9))) == 1
    assert wire.times()[-1] == pytest.approx(2.0, abs=0.06)
    assert wire.of("ack")[0] == {"k": "ack", "n": 5, "ok": True, "says": "paused"}


def test_twenty_times_as_fast(flown):
    wire = flown((0.0, 0, "joined 1"), (0.5, 1, {"do": "speed", "times": 20}), (2.5, 0, "end"))
    assert wire.times()[-1] == pytest.approx(40.5, abs=0.7)
    assert wire.of("s")[-1]["speed"] == 20
    assert wire.of("s")[-1]["achieved"] == pytest.approx(20.0, rel=0.05)


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


def test_a_guest_is_named_in_what_it_does_until_it_leaves(flown):
    jam = {"do": "break", "fault": {"type": "stuck", "actuator": "rudder"}}
    loss = {"do": "break", "fault": {"type": "loss_of_effectiveness", "actuator": "flap", "magnitude": 0.5}}
    wire = flown(
        (0.0, 0, "joined 1"), (0.0, 0, "joined 2"), (0.1, 0, "called 2 guest 1"),
        (0.2, 0, "called 2 Ada Lovelace (guest 1)"), (0.3, 2, jam), (0.35, 1, loss),
        (0.4, 2, {"do": "repair"}), (0.5, 0, "left 2"), (0.6, 0, "joined 2"), (0.7, 2, jam), (0.8, 0, "end"),
    )  # fmt: skip
    told = [
        event for each in wire.of("e") for event in each["events"] if event["kind"] in ("broken", "repaired")
    ]
    name = "Ada Lovelace (guest 1)"
    assert [event.get("by") for event in told] == [name, None, name, None]


def test_a_new_flight_is_introduced_to_all_and_goes_on_after_a_pause(flown):
    pause, fresh = {"do": "pause", "on": True}, {"do": "fresh", "scenario": "rudder-stuck"}
    wire = flown((0.0, 0, "joined 1"), (0.5, 1, pause), (1.0, 1, fresh), (1.5, 0, "end"), rate_hz=50)
    (hello,) = wire.of("hello", page=0)
    assert (hello["scenario"], hello["rate_hz"]) == ("rudder-stuck", 100)
    assert wire.times(1.0)[-1] == pytest.approx(0.5, abs=0.06)
    assert not wire.of("s")[-1]["paused"]


def test_a_flight_that_cannot_go_on_is_held_and_says_why(flown):
    wire = flown((0.0, 0, "joined 1"), (1.5, 0, "end"), break_at_s=0.5)
    (said,) = wire.of("ack", page=0)
    assert said == {"k": "ack", "n": 0, "ok": False, "says": "not finite at 0.5 s"}
    assert wire.of("s")[-1]["paused"]
    assert wire.times()[-1] == pytest.approx(0.5, abs=0.02)


ADDED = {"scenarios", "laws", "schemes", "description", "columns", "sensors"}  # what others may add to


def _in_short(told):
    if told["k"] == "f":
        return ["f", told["v"][0], told.get("stick"), told.get("mode")]
    return {key: value for key, value in told.items() if key not in ADDED}


def test_all_that_pages_are_told(flown, changed):
    """Two pages; one asks, breaks, hurries, pauses and leaves, and a new flight follows."""
    jam = {"do": "break", "fault": {"type": "stuck", "actuator": "rudder"}, "n": 7}
    wire = flown(
        (0.0, 0, "joined 1"), (0.1, 0, "joined 2"), (0.2, 1, STICK), (0.25, 1, jam),
        (0.3, 2, {"do": "speed", "times": 2.5, "n": 2}), (0.5, 2, {"do": "pause", "on": True, "n": 3}),
        (0.6, 1, {"do": "fresh", "scenario": "rudder-stuck", "n": 8}), (0.65, 0, "left 1"),
        (0.7, 2, {"do": "pause", "on": False, "n": 4}), (0.9, 0, "end"),
    )  # fmt: skip
    assert not changed([[round(at_s, 3), page, _in_short(told)] for at_s, page, told in wire.sent])


class Died:
    """A pipe whose other end is gone, or that says to end before there is a scenario."""

    def __init__(self, *words):
        self.words, self.sent = list(words), []

    def recv(self):
        if not self.words:
            raise EOFError
        return self.words.pop(0)

    def send(self, told):
        self.sent.append(told)


def test_a_process_without_a_flight_ends(tmp_path):
    for words in ((), ((0, "end"),)):
        pipe = Died(*words)
        flying.main(pipe, str(tmp_path))
        assert pipe.sent == []


def test_a_flight_that_cannot_begin_says_why(tmp_path):
    pipe = Died(bf.load({"name": "high", "initial": {"airspeed_mps": 21, "altitude_m": 6000}}))
    flying.main(pipe, str(tmp_path))
    ((kind, says),) = pipe.sent
    assert kind == BAD_INPUT
    assert says.startswith("high: ")


@pytest.mark.parametrize(("now_s", "waiting", "taken", "polls"), [
    (10.5, 2, 2, [0, 0.0, 0, 0.0, 0]), (10.5, 0, 0, [0]), (9.0, 1, 1, [1.0, 1.0]), (9.0, 0, 0, [1.0]),
])  # fmt: skip
def test_a_flight_that_is_late_takes_what_was_asked_before_it_flies_on(
    monkeypatch, now_s, waiting, taken, polls
):
    """The next tick is at 10 s: before it the flight waits so long for a request, after it not."""
    requests, asked, handled = [(1, f"request {i}") for i in range(waiting)], [], []
    pipe = SimpleNamespace(
        poll=lambda wait_s: asked.append(wait_s) or bool(requests), recv=lambda: requests.pop(0)
    )
    late = object.__new__(Flying)
    late._ended, late._pages, late._pace, late._pipe = False, {1: None}, SimpleNamespace(next_s=10.0), pipe
    late._take = lambda *of: handled.append(of)
    monkeypatch.setattr(flying, "time", SimpleNamespace(monotonic=lambda: now_s))
    late._listen()
    assert handled == [(1, f"request {i}") for i in range(taken)]
    assert asked == polls


@pytest.mark.parametrize(
    ("request_", "holds"),
    [
        ({"do": "save"}, True), ({"do": "fresh"}, True), ({"do": "game", "move": "stop"}, True),
        ({"do": "repair"}, False), ({"do": "change"}, False),
    ],
)  # fmt: skip
def test_what_takes_a_while_is_not_caught_up_with_and_its_reports_are_drawn_in_turn(
    tmp_path, monkeypatch, request_, holds
):
    """The clock stands at 5 s when a page asks, and at 8 s when that is done."""
    now_s, held, drawn = [5.0], [], []
    monkeypatch.setattr(flying, "time", SimpleNamespace(monotonic=lambda: now_s[0]))

    def handle(request, by):
        now_s[0] = 8.0
        session.unreported += [tmp_path / "a", tmp_path / "b"]
        return f"done by {by}"

    session = SimpleNamespace(
        sim="flight", scenario=SimpleNamespace(rate_hz=100.0), unreported=[], handle=handle
    )
    at = Flying(None, session)
    at._names[3] = "Ada"
    monkeypatch.setattr(at._pace, "hold", held.append)
    monkeypatch.setattr(at._reports, "add", drawn.append)
    request = flying.messages.parse(json.dumps(request_))
    assert at._handle(3, request) == "done by Ada"
    assert at._handle(4, request) == "done by "
    assert held == ([8.0, 8.0] if holds else [])
    assert drawn == [tmp_path / "a", tmp_path / "b"] * 2
    assert session.unreported == []
