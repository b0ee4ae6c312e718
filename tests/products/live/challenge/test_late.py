"""When an answer is late: what the system says of a process, and what follows of it, from given numbers."""

import os
import pickle
import signal
import subprocess
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from beaver_ftc.studies.engine import ONE_THREAD_EACH
from beaver_ftc_live.challenge import line, pilot

linux = pytest.mark.skipif(sys.platform != "linux", reason="accounts are Linux's")


def test_nothing_is_known_of_a_process_that_is_none():
    accounts = line._Accounts(None)
    assert (accounts.waited_s(), accounts.computed_s(), accounts.wants_a_processor()) == (0.0, 0.0, False)


@linux
def test_who_sleeps_wants_no_processor_and_who_has_gone_neither():
    with subprocess.Popen(["sleep", "60"]) as process:
        accounts, own = line._Accounts(process.pid), line._Accounts(os.getpid())
        assert own.wants_a_processor()
        until = time.monotonic() + 10.0
        while accounts.wants_a_processor() and time.monotonic() < until:  # it is being started
            time.sleep(0.01)
        assert not accounts.wants_a_processor()
        computed = accounts.computed_s()
        assert 0.0 < computed < 1.0
        assert accounts.computed_s() == computed
        process.kill()
    assert (accounts.computed_s(), accounts.wants_a_processor()) == (0.0, False)
    own.close()
    accounts.close()


@pytest.mark.parametrize(
    ("over_s", "wants", "computed_s", "waited_s", "late"),
    [
        (-0.5, True, 9.0, 3.0, False),  # it has time
        (0.5, True, 4.9, 3.0, False),  # 2.9 s computed of 3, it waits for others
        (0.5, True, 5.1, 9.0, True),
        (0.5, False, 5.1, 1.4, True),  # it sleeps, others kept it waiting for 0.4 s
        (0.5, False, 9.0, 1.7, False),
    ],
)
def test_who_has_had_its_time_is_late(monkeypatch, over_s, wants, computed_s, waited_s, late):
    """3 s are allowed; before, 2 s were computed and 1 s waited."""
    monkeypatch.setattr(line.time, "monotonic", lambda: 100.0 + over_s)
    monkeypatch.setattr(line.select, "select", lambda *_: ([], [], []))
    stranger = object.__new__(line.SubmittedDetector)
    stranger._deadline, stranger._before = 100.0, (3.0, 1.0, 2.0)
    stranger._accounts = SimpleNamespace(
        wants_a_processor=lambda: wants, computed_s=lambda: computed_s, waited_s=lambda: waited_s
    )
    process = SimpleNamespace(stdout=None)
    assert stranger._is_late(process) == late
    monkeypatch.setattr(line.select, "select", lambda *_: ([process.stdout], [], []))
    assert not stranger._is_late(process)  # what it has said is there


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


@pytest.mark.parametrize(
    ("said", "text", "kind", "says"),
    [
        (pilot.REFUSED, b"opens a file", line.Barred, "tried what is not allowed: opens a file at 2.5 s"),
        (pilot.ERROR, b"KeyError: 3", line.Mistake, "KeyError: 3 at 2.5 s"),
        (pilot.ERROR, b"MemoryError", line.Mistake, "MemoryError (the limit is 1024 MiB) at 2.5 s"),
    ],
)
def test_what_ends_a_submission_is_said_with_its_limit(said, text, kind, says, monkeypatch):
    stranger = object.__new__(line.SubmittedCode)
    monkeypatch.setattr(line.SubmittedCode, "_when", lambda self: " at 2.5 s")
    with pytest.raises(kind) as ended:
        stranger._refuse(said, text)
    assert str(ended.value) == says


def test_putting_up_the_walls_costs_a_submission_nothing(monkeypatch):
    """Loading its code does. Of the environment it has nothing but what the grader sets."""
    asked, begun, sent = [], [], []

    def answer(self, kind, length, within_s, charged=True):
        asked.append((kind, length, within_s, charged))
        return b"files, calls" if kind == pilot.WALLS else b"fault-tolerant law:Mine"

    def begin(arguments, **how):
        assert os.path.isdir(how["cwd"])
        assert os.listdir(how["cwd"]) == []
        begun.append((arguments, how))
        return SimpleNamespace(pid=None)

    monkeypatch.setenv("SYSTEMROOT", "windows")
    monkeypatch.setenv("SECRET", "seed")
    for name in ("end", "_watch"):
        monkeypatch.setattr(line.SubmittedCode, name, lambda *of: None)
    monkeypatch.setattr(line.SubmittedCode, "_send", lambda self, content: sent.append(pickle.loads(content)))
    monkeypatch.setattr(line.SubmittedCode, "_answer", answer)
    monkeypatch.setattr(line.subprocess, "Popen", begin)
    monkeypatch.setattr(line, "_Accounts", lambda pid: None)
    code = line.SubmittedCode("source", "name", line.Allowance(10.0))
    code._frame, code._late = 7, True  # of the flight before
    assert code.look() is code
    assert asked == [(pilot.WALLS, None, line.START_S, False), (pilot.READY, None, line.LOAD_S, True)]
    assert (code.walls, code.kind, code.class_name) == ("files, calls", "fault-tolerant law", "Mine")
    assert code.fault_tolerant
    assert (code._frame, code._late) == (0, False)
    assert sent == [{"source": "source", "name": "name", "context": None}]
    ((arguments, how),) = begun
    root = Path(line.__file__).parents[2]
    assert arguments == [sys.executable, "-s", "-P", "-B", pilot.__file__, str(root)]
    of_it = ONE_THREAD_EACH | {"PYTHONHASHSEED": "0", "SYSTEMROOT": "windows"}
    assert (how["env"], how["close_fds"], how["start_new_session"]) == (of_it, True, True)
    assert how["bufsize"] == 0


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


@pytest.mark.parametrize("late_at", [1, 3, None])
def test_a_process_is_watched_until_it_is_late_or_has_gone(monkeypatch, late_at):
    slept, killed, looks = [], [], iter(range(1, 9))
    process = SimpleNamespace(
        poll=lambda: 0 if len(slept) == 5 else None, kill=lambda: killed.append(len(slept))
    )
    code = line.SubmittedCode("source", "name", line.Allowance(10.0))
    monkeypatch.setattr(code, "_is_late", lambda of: next(looks) == late_at)
    monkeypatch.setattr(line.time, "sleep", slept.append)
    code._watch(process)
    assert slept == [line.POLL_S] * (5 if late_at is None else late_at - 1)
    assert (killed, code._late) == (([], False) if late_at is None else ([late_at - 1], True))


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


@pytest.mark.parametrize(
    ("left_s", "charged", "limit_s", "last"),
    [(1.5, True, 1.5, True), (2.0, True, 2.0, False), (9.0, True, 2.0, False), (1.5, False, 2.0, False)],
)
def test_an_answer_has_the_time_of_a_frame_or_what_is_left_of_all(
    monkeypatch, left_s, charged, limit_s, last
):
    code = line.SubmittedCode("source", "name", line.Allowance(left_s))
    code._accounts = SimpleNamespace(waited_s=lambda: 0.25, computed_s=lambda: 0.5)
    seen, parts = [], [pilot.HEAD.pack(pilot.BEGUN, 0, 0), b""]

    def read(size):
        seen.append((code._deadline, code._before, code._last_chance))
        return parts.pop(0)

    monkeypatch.setattr(code, "_read", read)
    monkeypatch.setattr(line.time, "monotonic", lambda: 100.0)
    code._answer(pilot.BEGUN, 0, 2.0, charged)
    assert seen[0] == (100.0 + limit_s, (limit_s, 0.25, 0.5), last)


def test_what_linux_counts_is_read_of_both_and_in_seconds(monkeypatch):
    """Of the thread that asks and of the process: time computed, then time waited, ns."""
    texts = {3: b"7000000000 250000000 9\n", 4: b"1500000000 2000000000 9\n", 5: b"4711 (a) b) D 1 2"}
    accounts = line._Accounts(None)
    accounts._files = list(texts)
    monkeypatch.setattr(line.os, "pread", lambda file, size, at: texts[file][at:size])
    assert accounts.waited_s() == pytest.approx(2.25)
    assert accounts.computed_s() == pytest.approx(1.5)
    for state, wants in ((b"D", True), (b"R", True), (b"S", False), (b"Z", False), (b"T", False)):
        texts[5] = b"4711 (a) R) " + state + b" 1 2"
        assert accounts.wants_a_processor() == wants
    accounts._files = []


@pytest.mark.parametrize(
    ("said", "kind", "name"),
    [
        (b"law:A1_" + b"x" * 58, "law", "A1_" + "x" * 58),
        (b"law:A" + b"x" * 61, None, None),
        (b"law:1A", None, None),
        (b"laws:A", None, None),
        (b"detector:A b", None, None),
    ],
)
def test_a_class_is_called_by_a_name_of_so_many_letters(said, kind, name):
    found = line._READY.fullmatch(said.decode())
    assert (found.groups() if found else (None, None)) == (kind, name)


def test_text_as_long_as_allowed_stays_whole():
    assert line.plain("x" * 200) == "x" * 200
    assert line.plain("x" * 201) == "x" * 197 + "..."
    assert line.plain(" ~<>&|`[]\t\x7f") == " ~?????????"
