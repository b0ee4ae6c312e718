"""`python -m tools.suite_cost`: seconds of processor that the test suite takes, by test, fixture and kernel.

It runs what `make test` runs with this module as a plug-in (tests/conftest.py), and prints tables. Seconds
are those of the process and of the commands it has started and waited for: what else the machine does
meanwhile does not count.
"""

import json
import os
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

FOLDER = "BEAVER_FTC_SUITE_COST"  # where each process of a run appends its rows
LONGEST = 30  # rows of a table
KINDS = ("test", "fixture", "compilation", "rest")


def _now() -> float:
    """Seconds of processor of this process and of those it has waited for."""
    return sum(os.times()[:4])


class Cost:
    """The plug-in: a row (kind, name, seconds) for each part of a process, without the parts inside it."""

    def __init__(self, folder: Path) -> None:
        self._file = (folder / f"{os.getpid()}.jsonl").open("a", encoding="utf-8")
        self._inside = [0.0]  # of the parts inside the present one, at each depth

    def _write(self, kind: str, name: str, seconds: float) -> None:
        self._file.write(json.dumps([kind, name, round(seconds, 3)]) + "\n")
        self._file.flush()

    @contextmanager
    def _measured(self, kind: str, name: str) -> Iterator[None]:
        begin = _now()
        self._inside.append(0.0)
        try:
            yield
        finally:
            whole = _now() - begin
            self._write(kind, name, whole - self._inside.pop())
            self._inside[-1] += whole

    @pytest.hookimpl(wrapper=True, tryfirst=True)
    def pytest_runtest_protocol(self, item: Any) -> Iterator[None]:
        with self._measured("test", item.nodeid):
            return (yield)

    @pytest.hookimpl(wrapper=True, tryfirst=True)
    def pytest_fixture_setup(self, fixturedef: Any) -> Iterator[None]:
        if fixturedef.scope == "function":
            return (yield)
        with self._measured("fixture", f"{fixturedef.baseid}::{fixturedef.argname}"):
            return (yield)

    @pytest.hookimpl(tryfirst=True)
    def pytest_sessionstart(self) -> None:
        from beaver_ftc.compiled import target

        compiled = target.Kernel._compile_and_keep

        def measured(kernel: Any, types: Any) -> Any:
            name = f"{kernel.py_func.__module__}.{kernel.py_func.__qualname__}"
            with self._measured("compilation", name):
                return compiled(kernel, types)

        target.Kernel._compile_and_keep = measured

    def pytest_unconfigure(self, config: Any) -> None:
        if getattr(config.option, "numprocesses", None):  # it has waited for workers, which write their own
            self._write("rest", "sharing tests out", sum(os.times()[:2]))
        else:
            self._write("rest", "imports, collection and the rest", _now() - self._inside[0])


def pytest_configure(config: Any) -> None:
    """Measure, if this run is to be measured."""
    if FOLDER in os.environ:
        config.pluginmanager.register(Cost(Path(os.environ[FOLDER])), "suite-cost")


def tables(rows: list[tuple[str, str, float]]) -> Iterator[str]:
    """Sums by kind, and of each kind the dearest; of tests and fixtures also by file."""
    yield from _table("seconds of processor by kind", ((kind, seconds) for kind, _, seconds in rows))
    for kind in KINDS:
        yield from _table(kind, ((name, seconds) for of, name, seconds in rows if of == kind))
    files = ((name.partition("::")[0], seconds) for of, name, seconds in rows if of in KINDS[:2])
    yield from _table("file", files)


def _table(title: str, parts: Iterable[tuple[str, float]]) -> Iterator[str]:
    """Yield the lines of a table: time and number of the parts, the longest first."""
    seconds: dict[str, float] = {}
    times = Counter[str]()
    for name, part_s in parts:
        seconds[name] = seconds.get(name, 0.0) + part_s
        times[name] += 1
    yield f"\n{title}: {sum(seconds.values()):.0f} s in {times.total()}"
    for name in sorted(seconds, key=seconds.__getitem__, reverse=True)[:LONGEST]:
        yield f"{seconds[name]:8.1f} s {times[name]:6d} x  {name}"


def main() -> int:
    """Run the suite as `make test` does, or what stands behind `--`."""
    command = [word for word in sys.argv[1:] if word != "--"] or ["make", "test"]
    with tempfile.TemporaryDirectory() as folder:
        status = subprocess.run(command, env=os.environ | {FOLDER: folder}, check=False).returncode
        lines = [
            line for file in sorted(Path(folder).glob("*.jsonl")) for line in file.read_text().splitlines()
        ]
    print(*tables(list(map(json.loads, lines))), sep="\n")
    return status


if __name__ == "__main__":
    sys.exit(main())
