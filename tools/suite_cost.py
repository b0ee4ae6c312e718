"""`python -m tools.suite_cost`: seconds of processor that the test suite takes, by test, fixture and kernel.

It runs what `make test` runs with this module as a plug-in (tests/conftest.py), and prints tables; `--read`
prints those of an earlier run again. Seconds are those of the process and of the commands it has started and
waited for: what else the machine does meanwhile does not count.
"""

import argparse
import json
import os
import shlex
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

FOLDER = "BEAVER_FTC_SUITE_COST"  # where each process of a run appends its rows
_BORN = sum(os.times()[:4])


def _now() -> float:
    """Seconds of processor of this process and of those it has waited for."""
    return sum(os.times()[:4])


class Cost:
    """The plug-in: a row for each part of a process's time, without the parts inside it."""

    def __init__(self, folder: Path) -> None:
        self._file = (folder / f"{os.getpid()}.jsonl").open("a", encoding="utf-8")
        self._inner = [(0.0, 0.0)]  # processor and clock of the parts inside the present one, at each depth
        self._started = 0
        sys.addaudithook(self._count)

    def _count(self, event: str, _: Any) -> None:
        self._started += event == "subprocess.Popen"

    def _write(self, kind: str, name: str, seconds: float, clock: float = 0.0, started: int = 0) -> None:
        row = {"kind": kind, "name": name, "seconds": round(seconds, 3), "clock": round(clock, 3)}
        row |= {"started": started, "end": round(time.time(), 3)}
        self._file.write(json.dumps(row) + "\n")
        self._file.flush()

    @pytest.hookimpl(wrapper=True, tryfirst=True)
    def pytest_runtest_protocol(self, item: Any) -> Iterator[None]:
        return (yield from self._around("test", item.nodeid))

    @pytest.hookimpl(wrapper=True, tryfirst=True)
    def pytest_fixture_setup(self, fixturedef: Any) -> Iterator[None]:
        if fixturedef.scope == "function":
            return (yield)
        return (yield from self._around("fixture", f"{fixturedef.baseid}::{fixturedef.argname}"))

    @pytest.hookimpl(wrapper=True, tryfirst=True)
    def pytest_collection(self) -> Iterator[None]:
        return (yield from self._around("collection", "collection"))

    @pytest.hookimpl(wrapper=True, tryfirst=True)
    def pytest_make_collect_report(self, collector: Any) -> Iterator[None]:
        return (yield from self._around("collection", collector.nodeid or "session"))

    def _around(self, kind: str, name: str) -> Iterator[None]:
        with self._measured(kind, name):
            return (yield)

    @contextmanager
    def _measured(self, kind: str, name: str) -> Iterator[None]:
        """Write down what is done within this, without the measured parts inside it."""
        start, begin, started = _now(), time.monotonic(), self._started
        self._inner.append((0.0, 0.0))
        try:
            yield
        finally:
            whole, clock = _now() - start, time.monotonic() - begin
            inner, inner_clock = self._inner.pop()
            outer, outer_clock = self._inner[-1]
            self._inner[-1] = outer + whole, outer_clock + clock
            self._write(kind, name, whole - inner, clock - inner_clock, self._started - started)

    @pytest.hookimpl(tryfirst=True)
    def pytest_sessionstart(self) -> None:
        self._write("start", "start", _BORN)
        from beaver_ftc.compiled import target

        compiled = target.Kernel._compiled

        def measured(kernel: Any, types: Any) -> Any:
            name = f"{kernel.py_func.__module__}.{kernel.py_func.__qualname__}"
            with self._measured("compilation", name):
                return compiled(kernel, types)

        target.Kernel._compiled = measured

    def pytest_unconfigure(self) -> None:
        self._write("rest", "rest", _now() - _BORN - self._inner[0][0])


def pytest_configure(config: Any) -> None:
    """Measure, if this run is to be measured."""
    if FOLDER in os.environ:
        config.pluginmanager.register(Cost(Path(os.environ[FOLDER])), "suite-cost")


def rows(folder: Path) -> list[dict[str, Any]]:
    """All that the processes of a run have written."""
    texts = [file.read_text(encoding="utf-8") for file in sorted(folder.glob("*.jsonl"))]
    return [json.loads(line) for text in texts for line in text.splitlines()]


def tables(found: list[dict[str, Any]], longest: int) -> Iterator[str]:
    """Sums by kind, and of each kind the dearest; of tests also by file."""
    yield from _table("seconds of processor by kind", [(row["kind"], row) for row in found], longest)
    for kind in ("compilation", "fixture", "collection", "test"):
        yield from _table(kind, [(row["name"], row) for row in found if row["kind"] == kind], longest)
    tests = [row for row in found if row["kind"] in ("test", "fixture")]
    yield from _table("file", [(row["name"].partition("::")[0], row) for row in tests], longest)
    yield from _waits(found, longest)


def _waits(found: list[dict[str, Any]], longest: int) -> Iterator[str]:
    """Parts that take longer by the clock than of the processor: they wait, or the machine is busy."""
    waits = sorted(found, key=lambda row: row["seconds"] - row["clock"])
    yield f"\nwaiting: {sum(max(row['clock'] - row['seconds'], 0.0) for row in found):.0f} s"
    for row in waits[:longest]:
        yield f"{row['clock'] - row['seconds']:8.1f} s  {row['kind']}  {row['name']}"


def _table(title: str, named: list[tuple[str, dict[str, Any]]], longest: int) -> Iterator[str]:
    seconds: dict[str, float] = defaultdict(float)
    times: dict[str, int] = defaultdict(int)
    processes: dict[str, int] = defaultdict(int)
    for name, row in named:
        seconds[name] += row["seconds"]
        times[name] += 1
        processes[name] += row["started"] if row["kind"] in ("test", "fixture") else 0
    total, started = sum(seconds.values()), sum(processes.values())
    yield f"\n{title}: {total:.0f} s in {len(named)}, {started} processes started"
    for name in sorted(seconds, key=seconds.__getitem__, reverse=True)[:longest]:
        yield f"{seconds[name]:8.1f} s {times[name]:6d} x {processes[name]:4d} p  {name}"


def main() -> int:
    """Run the suite as `make test` does, or read what a run has written."""
    parser = argparse.ArgumentParser(prog="python -m tools.suite_cost", description=__doc__)
    parser.add_argument("--read", type=Path, help="the folder of an earlier run")
    parser.add_argument("--keep", type=Path, help="where to write the rows")
    parser.add_argument("--longest", type=int, default=30, help="rows a table")
    parser.add_argument("command", nargs="*", default=["make", "test"], help="what runs pytest")
    options = parser.parse_args()
    folder = options.read or options.keep or Path(tempfile.mkdtemp(prefix="suite-cost-"))
    status = 0
    if not options.read:
        folder.mkdir(parents=True, exist_ok=True)
        begin = time.monotonic()
        status = subprocess.run(
            options.command, env=os.environ | {FOLDER: str(folder.resolve())}, check=False
        ).returncode
        took, clock = _now() - _BORN, time.monotonic() - begin
        print(f"{shlex.join(options.command)}: {took:.0f} s of processor, {clock:.0f} s by the clock")
        print(f"rows: {folder}")
    for line in tables(rows(folder), options.longest):
        print(line)
    return status


if __name__ == "__main__":
    sys.exit(main())
