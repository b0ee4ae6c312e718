"""The line to a submission: which message is taken, what it may know, what its time costs, how it ends."""

import signal
import sys
from dataclasses import dataclass, field
from types import SimpleNamespace

import numpy as np
import pytest

from beaver_ftc_live.challenge import line, pilot

linux = pytest.mark.skipif(sys.platform != "linux", reason="accounts are Linux's")


@pytest.mark.parametrize(
    ("charged", "waited_s", "left_s"), [(True, 1.5, 8.5), (True, 9.0, 10.0), (False, 1.5, 10.0)]
)
def test_what_an_answer_takes_is_charged_less_the_wait_for_others(monkeypatch, charged, waited_s, left_s):
    """Of 10 s: the answer takes 3 s, some of them behind other processes."""
    clock, waits = [100.0], [1.0, 1.0 + waited_s]
    said = [pilot.HEAD.pack(pilot.COMMAND, 3, 8), b"8 bytes."]

    def read(size):
        clock[0] += 1.5
        assert len(said[0]) == size
        return said.pop(0)

    monkeypatch.setattr(line.time, "monotonic", lambda: clock[0])
    stranger = object.__new__(line.SubmittedLaw)
    stranger._frame, stranger._sizes, stranger._read = 3, (5, 4), read
    stranger._allowance = SimpleNamespace(left_s=10.0)
    stranger._accounts = SimpleNamespace(waited_s=lambda: waits.pop(0), computed_s=lambda: 0.0)
    assert stranger._answer(pilot.COMMAND, 8, 2.0, charged) == b"8 bytes."
    assert stranger._allowance.left_s == pytest.approx(left_s)
    assert stranger._deadline == float("inf")


@dataclass(frozen=True)
class Told:
    """As a context: what a plug-in may know, and what is kept from it."""

    model: object = "the truth's"
    options: dict[str, float] = field(default_factory=lambda: {"gain": 2.0})
    surfaces: tuple[str, ...] = ("aileron", "flap")
    trim_y: np.ndarray = field(default_factory=lambda: np.arange(5.0))


def test_a_flight_begins_without_model_and_options(monkeypatch):
    code, told, asked = line.SubmittedDetector("source", "name", line.Allowance(10.0)), Told(), []
    monkeypatch.setattr(code, "_start", asked.append)
    monkeypatch.setattr(code, "_answer", lambda *of: asked.append(of))
    code.reset(told)
    shown, begins = asked
    assert begins == (pilot.BEGUN, 0, line.LOAD_S)
    assert (shown.model, shown.options) == (None, {})
    assert (shown.surfaces, shown.trim_y is told.trim_y) == (told.surfaces, True)
    assert (code._model, code.surfaces, code._sizes) == (told.model, told.surfaces, (5, 2))


@linux
@pytest.mark.parametrize("status", [None, 0])
def test_all_that_a_submission_has_started_ends_with_it(monkeypatch, status):
    """By its group, while it lives: afterwards the number may be another's."""
    done, accounts = [], SimpleNamespace(close=lambda: done.append("accounts"))
    monkeypatch.setattr(line.os, "killpg", lambda *of: done.append(of))
    code = line.SubmittedCode("source", "name", line.Allowance(10.0))
    code._process = SimpleNamespace(
        pid=4711, poll=lambda: status, kill=lambda: done.append("kill"), wait=lambda: done.append("wait"),
        stdin=SimpleNamespace(close=lambda: done.append("in")),
        stdout=SimpleNamespace(close=lambda: done.append("out")),
    )  # fmt: skip
    code._accounts, code._folder = accounts, SimpleNamespace(cleanup=lambda: done.append("folder"))
    with code as same:
        assert same is code
    group = [(4711, signal.SIGKILL)] if status is None else []
    assert done == [*group, "kill", "wait", "accounts", "in", "out", "folder"]
    code.end()  # of one that has ended nothing is done
    assert len(done) == 6 + len(group)


def head(kind, frame, content, size=None):
    return pilot.HEAD.pack(kind, frame, len(content) if size is None else size) + content


WRITES, NUMBERS = "writes on the line to the grader", b"8 bytes."
MOST_QUESTIONS = 4 + 8 * (3 * 64 + 5)  # y has 5 numbers


@pytest.mark.parametrize(
    ("kind", "length", "said", "found"),
    [
        (pilot.COMMAND, 8, head(pilot.COMMAND, 3, NUMBERS), NUMBERS),
        (pilot.COMMAND, 8, head(pilot.VERDICT, 3, NUMBERS), WRITES),
        (pilot.COMMAND, 8, head(pilot.COMMAND, 2, NUMBERS), WRITES),
        (pilot.COMMAND, 8, head(pilot.COMMAND, 4, NUMBERS), WRITES),
        (pilot.COMMAND, 8, head(pilot.COMMAND, 3, NUMBERS[:7]), WRITES),
        (pilot.COMMAND, 8, head(pilot.COMMAND, 3, NUMBERS + b"."), WRITES),
        (pilot.COMMAND, 1001, head(pilot.COMMAND, 3, b"." * 1001), b"." * 1001),
        (pilot.BEGUN, 0, head(pilot.BEGUN, 3, b""), b""),
        (pilot.READY, None, head(pilot.READY, 3, b"x" * 1000), b"x" * 1000),
        (pilot.READY, None, head(pilot.READY, 3, b"x" * 1001), WRITES),
        (pilot.READY, None, head(pilot.ERROR, 9, b"KeyError: 3"), "KeyError: 3, at 2.5 s"),
        (pilot.READY, None, head(pilot.ERROR, 3, b"e" * 1000), "e" * 197 + "..., at 2.5 s"),
        (pilot.READY, None, head(pilot.ERROR, 3, b"e" * 1001), WRITES),
        (pilot.COMMAND, 8, head(pilot.REFUSED, 3, b"forks"), "tried what is not allowed: forks, at 2.5 s"),
        (pilot.COMMAND, 8, head(pilot.ASKS, 1, b"q", MOST_QUESTIONS + 1), WRITES),
        (
            pilot.COMMAND,
            8,
            head(pilot.ASKS, 1, b"q" * MOST_QUESTIONS) + head(pilot.ASKS, 3, b"r") + head(b"C", 3, NUMBERS),
            NUMBERS,
        ),
    ],
)
def test_the_message_that_must_come_is_the_only_one_that_is_taken(monkeypatch, kind, length, said, found):
    """Of the right kind, frame and length; but for questions, which are counted, and what ends a flight."""
    left, asked = bytearray(said), []

    def read(size):
        taken = bytes(left[:size])
        del left[:size]
        return taken

    code = line.SubmittedCode("source", "name", line.Allowance(10.0))
    code._frame, code._t_s, code._sizes = 3, 2.5, (5, 4)
    monkeypatch.setattr(code, "_read", read)
    monkeypatch.setattr(code, "_evaluate", lambda question, times: asked.append((question, times)))
    if isinstance(found, bytes):
        assert code._answer(kind, length, 2.0) == found
        assert asked == ([(b"q" * MOST_QUESTIONS, 1), (b"r", 2)] if said[:1] == pilot.ASKS else [])
    else:
        with pytest.raises(line.Mistake) as ended:
            code._answer(kind, length, 2.0)
        assert str(ended.value) == found
        assert isinstance(ended.value, line.Barred) == (said[:1] != b"E" or found == WRITES)
    assert code._allowance.left_s < 10.0
    assert code._deadline == float("inf")
