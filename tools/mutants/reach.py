"""Which tests execute a line, and how long each of them takes."""

import hashlib
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from types import FrameType

import coverage
import hypothesis
import pytest

ROOT = Path(__file__).parents[2]
# Seconds of processor; a test that takes longer in plain Python is none for this. The diagnosis flies.
SLOW_S = {"diagnosis": 1.2}
SLOW_ELSEWHERE_S = 0.4
# What a change of shifts the lines: the rooms of the package from which mutants are made.
ROOMS = ("design", "diagnosis", "control", "scenario", "results", "studies")
EXAMPLES = 4
KEPT = ROOT / ".mutants"


def reach(folder: str) -> dict:
    """The tests of a folder: {"seconds": {test: s}, "lines": {file: {line: [tests]}}}.

    A line with no test ran when its module was imported. Kept until a file changes.
    """
    kept = KEPT / f"{folder}-{_digest(folder)}.json"
    if not kept.exists():
        for old in KEPT.glob(f"{folder}-*.json"):
            old.unlink()
        subprocess.run([sys.executable, "-m", "tools.mutants.reach", folder, str(kept)], cwd=ROOT, check=True)
    return json.loads(kept.read_text())


def _digest(folder: str) -> str:
    package = ROOT / "src" / "beaver_ftc"
    roots = [ROOT / "tests" / folder, *(package / room for room in ROOMS)]
    files = [file for root in roots for file in sorted(root.rglob("*.py"))]
    return hashlib.sha256(b"".join(file.read_bytes() for file in files)).hexdigest()[:16]


def _measured(folder: str) -> dict:
    few_examples()
    watch = coverage.Coverage(data_file=None, source_pkgs=["beaver_ftc"], config_file=False)
    timed = _Timed(watch, SLOW_S.get(folder, SLOW_ELSEWHERE_S))
    arguments = ["-q", "-p", "no:cacheprovider", "-m", "not acceptance", "--tb=no", "-rN"]
    with watch.collect():
        pytest.main([*arguments, str(ROOT / "tests" / folder)], plugins=[timed])
    data, lines = watch.get_data(), {}
    for file in data.measured_files():
        name = Path(file).relative_to(ROOT).as_posix()
        by_line = data.contexts_by_lineno(file).items()
        lines[name] = {line: [t for t in tests if t in timed.seconds] for line, tests in by_line}
    return {"seconds": timed.seconds, "lines": lines}


def few_examples() -> None:
    """From now on no property test draws more than `EXAMPLES`: what they draw is the same each time."""
    begin = hypothesis.settings.__init__

    def begin_with_few(self, parent=None, **given) -> None:
        wanted = given.get("max_examples", EXAMPLES)
        begin(self, parent, **{**given, "max_examples": min(wanted, EXAMPLES)})

    hypothesis.settings.__init__ = begin_with_few  # type: ignore[method-assign]


class _Timed:
    """Notes for each test that passes how long it took, and gives up one that is slow."""

    def __init__(self, watch: coverage.Coverage, slow_s: float) -> None:
        self._watch, self._slow_s = watch, slow_s
        self.seconds: dict[str, float] = {}

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Iterator[None]:
        self._watch.switch_context(item.nodeid)
        self._start = time.process_time()
        with limit(self._slow_s):
            return (yield)

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.when == "call" and report.passed:
            self.seconds[report.nodeid] = round(time.process_time() - self._start, 4)
        elif report.failed:
            self.seconds.pop(report.nodeid, None)


class limit:  # noqa: N801  # a context manager
    """End what runs inside as a skipped test: after so many seconds of processor, or a good while of waiting
    for other processes.
    """

    def __init__(self, seconds: float) -> None:
        self._seconds = seconds

    def __enter__(self) -> None:
        for number, timer, seconds in self._clocks():
            signal.signal(number, self._give_up)
            signal.setitimer(timer, seconds)

    def __exit__(self, *_) -> None:
        for _, timer, _ in self._clocks():
            signal.setitimer(timer, 0.0)

    def _clocks(self) -> tuple:
        return (
            (signal.SIGPROF, signal.ITIMER_PROF, self._seconds),
            (signal.SIGALRM, signal.ITIMER_REAL, 10 * self._seconds),
        )

    def _give_up(self, number: int, frame: FrameType | None) -> None:
        if frame and "coverage" in frame.f_code.co_filename:  # it holds a lock
            signal.setitimer({c[0]: c[1] for c in self._clocks()}[number], 0.01)
        else:
            pytest.skip("takes too long for this", allow_module_level=True)


if __name__ == "__main__":
    os.environ["NUMBA_DISABLE_JIT"] = "1"
    KEPT.mkdir(exist_ok=True)
    Path(sys.argv[2]).write_text(json.dumps(_measured(sys.argv[1])))
