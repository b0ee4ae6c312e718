"""The trial of a mutant: a copy of the package with the mutant in it, and the tests that reach it."""

import contextlib
import math
import os
import signal
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path

import numba
import pytest

from tools.mutants.making import Mutant
from tools.mutants.scope import COMPILED, CORE, FLOWN, KEPT, PLAIN, ROOT, SOURCES, folder_of_tests

# Of tests for one mutant, by what they take with the true module. Flown files are run whole, and all of them.
BUDGET_S = {PLAIN: 90.0, COMPILED: 120.0, FLOWN: math.inf}
MARKS = {FLOWN: ("-m", "not nightly and not acceptance")}  # of whole files, those by day
ENDLESS_S, ENDLESS = 30.0, 3.0  # of processor, and times what the tests take with the true module: it hangs

SURVIVED, KILLED, HANGS, UNREACHED = "LIVES", "killed", "hangs", "NO TEST"


def outcome(mutant: Mutant, tests: dict[str, dict[str, float]]) -> str:
    """KILLED if a test fails with the mutant, and passes, alone, with the true module.

    tests: of each mode the seconds that those take which reach it.
    """
    ends = [UNREACHED]
    for mode, seconds in tests.items():
        ends.append(_outcome(mutant, mode, seconds))
        if ends[-1] in (KILLED, HANGS):
            return ends[-1]
    return SURVIVED if SURVIVED in ends else UNREACHED


def _outcome(mutant: Mutant, mode: str, seconds: dict[str, float]) -> str:
    """How the tests of a mode end. A test that also fails without the mutant is left out, and the rest run
    again."""
    tests = _chosen(mutant.file, seconds, BUDGET_S[mode])
    while tests:
        limit_s = ENDLESS_S + ENDLESS * sum(seconds[test] for test in tests)
        with tempfile.NamedTemporaryFile("r") as note:
            ended = _run(mode, mutant.file, mutant.source(), tests, Path(note.name), limit_s)
            failed = note.read().strip()
        if ended != KILLED or _is_sound(mode, failed):
            return ended
        if failed not in tests:  # one of a file, which fails without the mutant too
            return SURVIVED
        tests.remove(failed)
    return UNREACHED


def _chosen(file: Path, seconds: dict[str, float], budget_s: float) -> list[str]:
    """The tests within a budget: those of the folder of the module first, quick ones before slow ones."""
    own = f"tests/{folder_of_tests(file)}/"
    taken, spent = [], 0.0
    for test in sorted(seconds, key=lambda test: (not test.startswith(own), seconds[test])):
        spent += seconds[test]
        if spent > budget_s and taken:
            break
        taken.append(test)
    return taken


@cache
def _is_sound(mode: str, test: str) -> bool:
    """Whether a test passes alone with the true package, put in place as one with a mutant is."""
    if not test:
        return True  # none was run: the mutant cannot be imported
    true = CORE / "__init__.py"
    return _run(mode, true, true.read_text(), [test], Path(os.devnull), 1000.0) == SURVIVED


def _run(mode: str, file: Path, source: str, tests: list[str], note: Path, limit_s: float) -> str:
    def tried() -> int:
        turn_to(mode)
        return pytest_quietly(["-x", *MARKS.get(mode, ()), *tests], [_Note(note)])

    with _instead(file, source):
        return in_a_child(tried, limit_s)


@contextlib.contextmanager
def _instead(file: Path, source: str) -> Iterator[None]:
    """Put a copy of the packages, links but for one file replaced, first on sys.path and PYTHONPATH: the
    processes that tests start then import it as well."""
    with tempfile.TemporaryDirectory() as folder:
        sources = Path(folder) / "src"
        sources.mkdir()
        for true in SOURCES.rglob("*"):
            place = sources / true.relative_to(SOURCES)
            if true.is_dir() and true.name != "__pycache__":
                place.mkdir()
            elif true.parent.name != "__pycache__":
                place.symlink_to(true)  # what Python keeps of its modules as well: it is read alone
        for data in ("aircraft", "scenarios"):
            (Path(folder) / data).symlink_to(ROOT / data)
        mutant = sources / file.relative_to(SOURCES)
        mutant.unlink()
        mutant.write_text(source)
        with _first(str(sources)):
            yield


@contextlib.contextmanager
def _first(folder: str) -> Iterator[None]:
    before = os.environ.get("PYTHONPATH")
    os.environ["PYTHONPATH"] = folder
    sys.path.insert(0, folder)
    try:
        yield
    finally:
        sys.path.remove(folder)
        os.environ.pop("PYTHONPATH") if before is None else os.environ.update(PYTHONPATH=before)


def turn_to(mode: str) -> None:
    """Let this process, and those that it starts, compile kernels, or run them as plain Python."""
    os.environ["NUMBA_DISABLE_JIT"] = "1" if mode == PLAIN else "0"
    if mode == FLOWN:
        os.environ["XDG_CACHE_HOME"] = str(KEPT / "cache")  # the user's is for true code
    numba.config.reload_config()


def processor_s() -> float:
    """Processor time of this process and of those that it has started, s."""
    return sum(os.times()[:4])


def in_a_child(work: Callable[[], int], limit_s: float) -> str:
    """SURVIVED if `work` returns 0, KILLED if it returns another status, HANGS if it exceeds the limit of
    processor time.

    The child process has the libraries loaded already. Processes that a test has started end with it.
    """
    child = os.fork()
    if child == 0:
        os.setpgid(0, 0)  # a group of its own
        _work(work, limit_s)  # does not return
    try:
        return _end(child, 5 * limit_s)
    finally:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(child, signal.SIGKILL)


def _work(work: Callable[[], int], limit_s: float) -> None:
    status = 1
    try:
        signal.signal(signal.SIGVTALRM, signal.SIG_DFL)
        signal.setitimer(signal.ITIMER_VIRTUAL, limit_s)  # its signal ends the process
        status = work()
    finally:
        os._exit(status)


def _end(child: int, wait_s: float) -> str:
    """Wait for a child process; it hangs if it takes longer than this."""
    started = time.monotonic()
    while True:
        done, status = os.waitpid(child, os.WNOHANG)
        if done and os.WIFSIGNALED(status):
            return HANGS if os.WTERMSIG(status) == signal.SIGVTALRM else KILLED
        if done:
            return SURVIVED if os.waitstatus_to_exitcode(status) == 0 else KILLED
        if time.monotonic() - started > wait_s:  # it waits for what never comes
            os.kill(child, signal.SIGKILL)
            os.waitpid(child, 0)
            return HANGS
        time.sleep(0.02)


def pytest_quietly(arguments: list[str], plugins: list) -> int:
    """Run tests without output, and without results of earlier runs."""
    with tempfile.TemporaryDirectory() as scratch, open(os.devnull, "w") as nowhere:
        os.environ["HYPOTHESIS_STORAGE_DIRECTORY"] = scratch
        os.environ["PYTHONDONTWRITEBYTECODE"] = "1"
        sys.dont_write_bytecode = True
        os.chdir(ROOT)
        os.dup2(nowhere.fileno(), 1)
        os.dup2(nowhere.fileno(), 2)
        with contextlib.redirect_stdout(nowhere), contextlib.redirect_stderr(nowhere):
            return int(pytest.main(["-q", "-p", "no:cacheprovider", "--tb=no", *arguments], plugins))


class _Note:
    """A plug-in that writes the name of a failed test to a file."""

    def __init__(self, file: Path) -> None:
        self._file = file

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.failed:
            self._file.write_text(report.nodeid)
