"""One mutant on trial: a process in which it stands in for the true module, and the tests that reach it."""

import ast
import contextlib
import importlib.abc
import importlib.util
import os
import signal
import sys
import tempfile
import time
from collections.abc import Callable
from functools import cache
from pathlib import Path

import pytest

from tools.mutants.making import Mutant
from tools.mutants.scope import ROOT

BUDGET_S = 6.0  # of tests for one mutant, by what they take with the true module
ENDLESS_S, ENDLESS = 20.0, 10.0  # of processor, and times what the tests take with the true module: it hangs

SURVIVED, KILLED, HANGS, UNREACHED = "LIVES", "killed", "hangs", "NO TEST"


def outcome(mutant: Mutant, tests: list[str], seconds: dict[str, float]) -> str:
    """KILLED if one of the tests fails with the mutant, and passes, alone, with the true module."""
    tests = _chosen(tests, seconds)
    while tests:
        limit_s = ENDLESS_S + ENDLESS * sum(seconds[test] for test in tests)
        with tempfile.NamedTemporaryFile("r") as note:
            ended = _run(mutant.file, mutant.source(), tests, Path(note.name), limit_s)
            failed = note.read().strip()
        if ended != KILLED or _is_sound(mutant.file, failed):
            return ended
        tests.remove(failed)
    return UNREACHED


def _chosen(tests: list[str], seconds: dict[str, float]) -> list[str]:
    """The quickest tests first, as many as the budget allows."""
    taken, spent = [], 0.0
    for test in sorted(tests, key=seconds.__getitem__):
        spent += seconds[test]
        if spent > BUDGET_S and taken:
            break
        taken.append(test)
    return taken


@cache
def _is_sound(file: Path, test: str) -> bool:
    """Whether a test passes alone with the true module, put in place as a mutant is."""
    if not test:
        return True  # none was run: the mutant cannot be imported
    true = ast.unparse(ast.parse(file.read_text()))
    return _run(file, true, [test], Path(os.devnull), 1000.0) == SURVIVED


def _run(file: Path, source: str, tests: list[str], note: Path, limit_s: float) -> str:
    def tried() -> int:
        return pytest_quietly(["-x", *tests], [_Instead(file, source), _Note(note)])

    return in_a_child(tried, limit_s)


def in_a_child(work: Callable[[], int], limit_s: float) -> str:
    """SURVIVED if `work` returns 0, KILLED if it does not, HANGS if it takes so much of the processor.

    A child has the libraries loaded already, and leaves nothing behind: no process that a test has started.
    """
    child = os.fork()
    if child == 0:
        os.setpgid(0, 0)  # a group of its own
        _work(work, limit_s)  # does not return
    try:
        return _end(child, 20 * limit_s)
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
    """Run tests as a child of this does: without a word, and without what earlier ones have found."""
    with tempfile.TemporaryDirectory() as scratch, open(os.devnull, "w") as nowhere:
        os.environ["HYPOTHESIS_STORAGE_DIRECTORY"] = scratch
        os.chdir(ROOT)
        os.dup2(nowhere.fileno(), 1)
        os.dup2(nowhere.fileno(), 2)
        with contextlib.redirect_stdout(nowhere), contextlib.redirect_stderr(nowhere):
            return int(pytest.main(["-q", "-p", "no:cacheprovider", "--tb=no", *arguments], plugins))


class _Note:
    """Writes down which test failed."""

    def __init__(self, file: Path) -> None:
        self._file = file

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.failed:
            self._file.write_text(report.nodeid)


class _Instead(importlib.abc.MetaPathFinder, importlib.abc.SourceLoader):
    """Finds one module, and gives the mutant's source for it."""

    def __init__(self, file: Path, source: str) -> None:
        self._file, self._source = file, source
        self._name = ".".join(file.relative_to(ROOT / "src").with_suffix("").parts).removesuffix(".__init__")

    def pytest_configure(self) -> None:
        """Only now: pytest has just put its own finder, which knows this package as a plug-in, before all."""
        sys.meta_path.insert(0, self)

    def find_spec(self, name, path=None, target=None):
        if name != self._name:
            return None
        package = [str(self._file.parent)] if self._file.name == "__init__.py" else None
        spec = importlib.util.spec_from_file_location(
            name, self._file, loader=self, submodule_search_locations=package
        )
        spec.cached = None
        return spec

    def get_filename(self, name):
        return str(self._file)

    def get_data(self, path):
        return self._source.encode()

    def path_stats(self, path):
        raise OSError("never from a cache")
