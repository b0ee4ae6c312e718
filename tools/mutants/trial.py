"""One mutant on trial: a process in which it stands in for the true module, and the tests that reach it."""

import contextlib
import importlib.abc
import importlib.util
import os
import signal
import sys
import tempfile
import time
from pathlib import Path

import pytest

from tools.mutants.making import Mutant
from tools.mutants.reach import ROOT, few_examples

BUDGET_S = 20.0  # of tests for one mutant, by what they take with the true module
ENDLESS_S = 90.0  # of processor: longer than all of them take

SURVIVED, KILLED, ENDLESS = 0, 1, 2


def chosen(tests: list[str], seconds: dict[str, float]) -> list[str]:
    """The quickest tests first, as many as the budget allows."""
    taken, spent = [], 0.0
    for test in sorted(tests, key=seconds.__getitem__):
        spent += seconds[test]
        if spent > BUDGET_S and taken:
            break
        taken.append(test)
    return taken


def outcome(mutant: Mutant, tests: list[str]) -> int:
    """SURVIVED, KILLED or ENDLESS; the tests run in a child, for which the libraries are loaded already."""
    child = os.fork()
    if child == 0:
        _run(mutant, tests)  # does not return
    return _verdict(child)


def _verdict(child: int) -> int:
    started = time.monotonic()
    while True:
        done, status = os.waitpid(child, os.WNOHANG)
        if done:
            return SURVIVED if os.waitstatus_to_exitcode(status) == 0 else KILLED
        if time.monotonic() - started > 10 * ENDLESS_S:
            os.kill(child, signal.SIGKILL)
            os.waitpid(child, 0)
            return ENDLESS
        time.sleep(0.05)


def _run(mutant: Mutant, tests: list[str]) -> None:
    """In the child: 0 if all tests pass. A mutant that cannot be imported, or never ends, is not 0."""
    status = 1
    try:
        few_examples()
        signal.setitimer(signal.ITIMER_PROF, ENDLESS_S)  # its signal ends the process
        instead = _Instead(mutant.file, mutant.source())
        with tempfile.TemporaryDirectory() as scratch, open(os.devnull, "w") as nowhere:
            os.environ["HYPOTHESIS_STORAGE_DIRECTORY"] = scratch
            os.chdir(ROOT)
            os.dup2(nowhere.fileno(), 1)
            os.dup2(nowhere.fileno(), 2)
            with contextlib.redirect_stdout(nowhere), contextlib.redirect_stderr(nowhere):
                status = int(
                    pytest.main(["-x", "-q", "-p", "no:cacheprovider", "--tb=no", *tests], [instead])
                )
    finally:
        os._exit(status)


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
