"""When an answer is late: what the system says of a process, and what follows of it, from given numbers."""

import os
import subprocess
import sys
import time
from types import SimpleNamespace

import pytest

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
    """Loading its code does."""
    asked = []

    def answer(self, kind, length, within_s, charged=True):
        asked.append((kind, length, within_s, charged))
        return b"files, calls" if kind == pilot.WALLS else b"fault-tolerant law:Mine"

    for name in ("end", "_send", "_watch"):
        monkeypatch.setattr(line.SubmittedCode, name, lambda *of: None)
    monkeypatch.setattr(line.SubmittedCode, "_answer", answer)
    monkeypatch.setattr(line.subprocess, "Popen", lambda *of, **how: SimpleNamespace(pid=None))
    monkeypatch.setattr(line, "_Accounts", lambda pid: None)
    code = line.SubmittedCode("source", "name", line.Allowance(10.0))
    code._start(None)
    assert asked == [(pilot.WALLS, None, line.START_S, False), (pilot.READY, None, line.LOAD_S, True)]
    assert (code.walls, code.kind, code.class_name) == ("files, calls", "fault-tolerant law", "Mine")
    assert code.fault_tolerant
