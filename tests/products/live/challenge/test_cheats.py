"""Ways of cheating: each fails, is named, and the grader goes on."""

import re
import subprocess
import sys
from pathlib import Path

import pytest
from cheats import CHEATS, source_of

from beaver_ftc_live.challenge import grading, line, pilot

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="walls of the system are Linux's")


@pytest.mark.parametrize("name", CHEATS)
def test_it_fails_and_is_named(name, graded, challenge, monkeypatch):
    cheat = CHEATS[name]
    if "no answer" in cheat.said:
        monkeypatch.setattr(line, "FRAME_S", 0.5)
    found = graded(source_of(cheat, str(challenge / "teacher" / "loss.yaml")), flights=1 + ("module" in name))
    row = grading.detectors_row(found)
    assert re.search(cheat.said, row["reason"]), row["reason"]
    assert row["score"] == 0.0
    assert not Path("/tmp/owned").exists()


def test_what_it_prints_is_nowhere(graded, capfd):
    prints = CHEATS["always alarms"]._replace(load="print('score 100'); os.write(1, b'score 100')")
    assert len(graded(source_of(prints, "")).results) == 1
    assert capfd.readouterr() == ("", "")


def test_all_that_it_is_told_beside_the_frames_is_where_the_package_lies(graded):
    reason = graded(source_of(CHEATS["reads the seed"], "")).reason
    assert set(re.findall(r"/[\w/.]+", reason)) == {pilot.__file__}


BARE = """
import os, resource, socket, sys, time
from beaver_ftc_live.challenge import confine

hidden, parent = sys.argv[1], os.getppid()
own = os.open(os.devnull, os.O_WRONLY)
assert confine._limit() and confine._restrict_files(confine.readable()) and confine._restrict_calls()
tried = {
    "open": lambda: open(hidden), "list": lambda: os.listdir(os.path.dirname(hidden)), "fork": os.fork,
    "socket": socket.socket, "kill": lambda: os.kill(parent, 0), "run": lambda: os.execv("/bin/true", ["a"]),
    "memory": lambda: open(f"/proc/{parent}/mem"), "write": lambda: open("/tmp/state", "w"),
    "date": lambda: os.utime(os.__file__), "mode": lambda: os.chmod(os.__file__, 0o777),
    "remove": lambda: os.remove(os.__file__), "folder": lambda: os.mkdir("/tmp/state"),
    "priority": lambda: os.setpriority(os.PRIO_PROCESS, parent, 19), "truth": lambda: open(sys.argv[2]),
    "limits": lambda: resource.prlimit(parent, 7), "clock": lambda: time.clock_gettime(~parent << 3 | 2),
}
time.process_time(), time.clock_getres(3)
for name, act in tried.items():
    try:
        act()
    except OSError as error:
        print(name, type(error).__name__)
    else:
        print(name, "done")
    sys.stdout.flush()
"""


def test_the_system_itself_refuses_without_python_being_asked(tmp_path):
    """As if the hook of names were not there."""
    import jsbsim

    hidden = tmp_path / "loss.yaml"
    hidden.write_text("seed: 1")
    given = [sys.executable, "-P", "-c", BARE, str(hidden), jsbsim.__file__]
    done = subprocess.run(given, capture_output=True, text=True, check=False)
    if "AssertionError" in done.stderr:
        pytest.skip("this system has not all walls")
    said = dict(line.split() for line in done.stdout.splitlines())
    assert len(said) == 16, done.stderr
    assert {*said.values()} <= {"PermissionError", "BlockingIOError"}, said
