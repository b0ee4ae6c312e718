"""The trial of a mutant: a copy of the packages with the mutant in it, and the tests nearest to it first."""

import contextlib
import os
import signal
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Set
from functools import cache
from pathlib import Path

import numba
import pytest

from tools.mutants.making import Mutant
from tools.mutants.scope import COMPILED, CORE, KEPT, PLAIN, ROOT, SOURCES, Round, rounds

TEST_S = 120.0  # of processor; a test that takes longer hangs
ROUND_S = 1500.0  # by the clock; what takes longer waits for what never comes

SURVIVED, KILLED, HANGS = "LIVES", "killed", "hangs"


def outcome(mutant: Mutant, kind: str, reached: Set[Path]) -> str:
    """KILLED if a test fails with the mutant, and passes, alone, with the true module."""
    for tests in rounds(mutant.file, kind, reached):
        ended = _outcome(mutant, tests)
        if ended != SURVIVED:
            return ended
    return SURVIVED


def _outcome(mutant: Mutant, tests: Round) -> str:
    """How the tests of a round end. One that also fails without the mutant is left out, and the rest run
    again."""
    while True:
        with tempfile.NamedTemporaryFile("r") as note:
            ended = _run(tests, mutant.file, mutant.source(), Path(note.name))
            failed = note.read().strip()
        again = (failed,) if failed else ("--collect-only", *tests.tests)  # none: it cannot be imported
        if ended != KILLED or _is_sound(tests.mode, again):
            return ended
        if not failed:
            raise RuntimeError(f"these tests cannot be collected: {' '.join(tests.tests)}")
        tests = tests.without(failed)


@cache
def _is_sound(mode: str, asked: tuple[str, ...]) -> bool:
    """Whether tests pass alone with the true package, put in place as one with a mutant is."""
    true = CORE / "__init__.py"
    return _run(Round(mode, asked), true, true.read_text(), Path(os.devnull)) == SURVIVED


def _run(tests: Round, file: Path, source: str, note: Path) -> str:
    def tried() -> int:
        turn_to(tests.mode)
        status = pytest_quietly(["-x", *tests.asked], [_Note(note)])
        return 0 if status == pytest.ExitCode.NO_TESTS_COLLECTED else status

    with in_place({file: source}):
        return in_a_child(tried)


@contextlib.contextmanager
def in_place(texts: Mapping[Path, str]) -> Iterator[Path]:
    """Put a copy of the packages, links but for the files with another text, first on sys.path and on
    PYTHONPATH: the processes that tests start then import it as well."""
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
        for file, text in texts.items():
            other = sources / file.relative_to(SOURCES)
            other.unlink()
            other.write_text(text)
        with _first(str(sources)):
            yield sources


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
    if mode != COMPILED:
        os.environ["XDG_CACHE_HOME"] = str(KEPT / "cache")  # the user's is for true code
    numba.config.reload_config()


def in_a_child(work: Callable[[], int]) -> str:
    """SURVIVED if `work` returns 0, KILLED if it returns another status, HANGS if a test or the whole takes
    too long.

    The child process has the libraries loaded already. Processes that a test has started end with it.
    """
    child = os.fork()
    if child == 0:
        os.setpgid(0, 0)  # a group of its own
        _work(work)  # does not return
    try:
        return _end(child)
    finally:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(child, signal.SIGKILL)


def _work(work: Callable[[], int]) -> None:
    status = 1
    try:
        signal.signal(signal.SIGVTALRM, signal.SIG_DFL)  # its signal ends the process
        status = work()
    finally:
        os._exit(status)


def _end(child: int) -> str:
    """Wait for a child process."""
    started = time.monotonic()
    while True:
        done, status = os.waitpid(child, os.WNOHANG)
        if done and os.WIFSIGNALED(status):
            return HANGS if os.WTERMSIG(status) == signal.SIGVTALRM else KILLED
        if done:
            return SURVIVED if os.waitstatus_to_exitcode(status) == 0 else KILLED
        if time.monotonic() - started > ROUND_S:
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
    """A plug-in that ends a test that hangs, and writes the name of one that fails to a file."""

    def __init__(self, file: Path) -> None:
        self._file = file

    def pytest_runtest_logstart(self, nodeid: str) -> None:
        signal.setitimer(signal.ITIMER_VIRTUAL, TEST_S)

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.failed:
            self._file.write_text(report.nodeid)
