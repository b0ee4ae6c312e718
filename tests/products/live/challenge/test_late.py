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
