"""Which lines each test executes, and the time that it takes: measured, and kept until a source changes."""

import functools
import importlib
import json
import os
import pkgutil
import signal
import sys
import tempfile
import warnings
from collections import Counter
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager, suppress
from multiprocessing import get_context
from pathlib import Path
from types import FrameType

import coverage
import hypothesis
import pytest

from tools.mutants.reach import Reach, digests, kept_file, known
from tools.mutants.scope import COMPILED, PLAIN, ROOT, SOURCES, tests
from tools.mutants.trial import SURVIVED, in_a_child, processor_s, pytest_quietly, turn_to

# Of processor, counting lines; a test that takes longer is none for this.
SLOW_S = {PLAIN: 40.0, COMPILED: 25.0}
WAITS_S = 120.0  # nor is what waits so long, for other processes
HANGS_S = 900.0  # of processor for the tests of one file, far more than the limits allow
EXAMPLES = 4
APART = ("beaver_ftc.compiled",)
SHARED = ("conftest.py", "kept.py")


def reach(mode: str, jobs: int, say: Callable[[str], None]) -> Reach:
    """The lines that the tests of a mode execute. The result of a test file is kept until a source that it
    executes changes."""
    files = tests(mode)
    due = [file for file in files if known(mode, file) is None]
    if due:
        say(f"finding out what the tests of {len(due)} of {len(files)} files execute ({mode})")
        with ProcessPoolExecutor(jobs, get_context("fork"), _load, (mode,)) as pool:
            for file, lost in zip(due, pool.map(_measure, [mode] * len(due), due), strict=True):
                if lost:
                    say(f"{file.relative_to(ROOT)}: its tests could not be measured, and are left out")
    return Reach(found for file in files if (found := known(mode, file)))


def _load(mode: str) -> None:
    """Import the whole package, and load compiled code, once for all test files."""
    turn_to(mode)
    few_examples()
    for module in pkgutil.walk_packages([str(SOURCES)]):
        with suppress(ImportError), warnings.catch_warnings(action="ignore"):
            importlib.import_module(module.name)
    if mode == COMPILED:
        from beaver_ftc.loop.loop import fly
        from beaver_ftc.scenario.schema import Scenario

        fly(Scenario(name="short", duration_s=0.2))


def _measure(mode: str, file: Path) -> bool:
    """Measure a test file in a process of its own, so that it changes nothing for the next. Returns
    whether that failed."""
    return in_a_child(lambda: _write(mode, file), HANGS_S) != SURVIVED


def _write(mode: str, file: Path) -> int:
    kept = kept_file(mode, file)
    kept.parent.mkdir(parents=True, exist_ok=True)
    kept.write_text(json.dumps(_measured(mode, file)))
    return 0


def _measured(mode: str, file: Path) -> dict:
    """Lines that each test of a file runs, and how long it takes."""
    watch = coverage.Coverage(data_file=None, source=[str(SOURCES)], config_file=False, messages=False)
    timed = _Timed(watch, SLOW_S[mode])
    with tempfile.TemporaryDirectory() as others:
        os.environ["MUTANTS_LINES"] = f"{others}/lines"
        os.environ["PYTHONPATH"] = os.pathsep.join([str(Path(__file__).parent), str(ROOT / "src")])
        with watch.collect():
            pytest_quietly([str(file)], [timed])
        data = watch.get_data()
        for lines in Path(others).iterdir():
            with suppress(coverage.exceptions.DataError):  # of a process that was ended while it wrote
                data.update(_read(lines))
    lines = _lines(data, timed)
    sources = {*lines, *_tests_own(), file.relative_to(ROOT).as_posix()}
    return {
        "sources": digests(sources),
        "seconds": timed.seconds,
        "left_out": timed.left_out,
        "lines": lines,
    }


def _read(file: Path) -> coverage.CoverageData:
    data = coverage.CoverageData(basename=str(file))
    data.read()
    return data


def _lines(data: coverage.CoverageData, timed: "_Timed") -> dict[str, dict[int, list[str]]]:
    """{file: {line: tests}} of the files of which a test executes a line."""
    found = {}

    def known(contexts: list[str]) -> list[str]:
        users = {test for context in contexts for test in timed.users.get(context, [context])}
        return sorted(users & timed.seconds.keys())

    for file in data.measured_files():
        by_line = {line: known(contexts) for line, contexts in data.contexts_by_lineno(file).items()}
        if any(by_line.values()):
            found[Path(file).relative_to(ROOT).as_posix()] = by_line
    return found


def _tests_own() -> set[str]:
    """The loaded modules of tests/ and tools/, without those that all tests share."""
    files = (getattr(module, "__file__", None) for module in list(sys.modules.values()))
    roots = (ROOT / "tests", ROOT / "tools")
    inside = (Path(f) for f in files if f and any(Path(f).is_relative_to(root) for root in roots))
    return {
        file.relative_to(ROOT).as_posix()
        for file in inside
        if not file.is_relative_to(ROOT / "tools" / "mutants") and file.name not in SHARED
    }


def few_examples() -> None:
    """Let each property test draw at most `EXAMPLES` examples, the same ones each time."""
    begin = hypothesis.settings.__init__

    def begin_with_few(self, parent=None, **given) -> None:
        wanted = given.get("max_examples", EXAMPLES)
        begin(self, parent, **{**given, "max_examples": min(wanted, EXAMPLES)})

    hypothesis.settings.__init__ = begin_with_few  # type: ignore[method-assign]


def forget() -> None:
    """Clear the caches of the package, so that each test computes their values again. Otherwise only the
    first test of a process would execute those lines.
    """
    for name, module in list(sys.modules.items()):
        if name.startswith("beaver_ftc") and not name.startswith(APART):
            for value in list(vars(module).values()):
                if isinstance(value, functools._lru_cache_wrapper) and value.__module__ == name:
                    value.cache_clear()


class _Timed:
    """A plug-in that records the time of each test that passes, and skips a test that is slow."""

    def __init__(self, watch: coverage.Coverage, slow_s: float) -> None:
        self._watch, self._slow_s = watch, slow_s
        self.seconds: dict[str, float] = {}
        self.left_out: Counter[str] = Counter()
        self.slow: set[str] = set()  # after one slow case the other cases of a test are not tried
        self.users: dict[str, list[str]] = {}  # the tests that share a fixture, by its name
        self._is_slow = False

    def pytest_collection_finish(self, session: pytest.Session) -> None:
        for item in session.items:
            for fixture in getattr(item, "fixturenames", ()):
                self.users.setdefault(fixture, []).append(item.nodeid)

    def _count_for(self, context: str) -> None:
        self._watch.switch_context(context)
        os.environ["MUTANTS_TEST"] = context

    @pytest.hookimpl(wrapper=True)
    def pytest_fixture_setup(self, fixturedef: pytest.FixtureDef, request: pytest.FixtureRequest):
        """Count the lines that a shared fixture executes for every test that uses it."""
        if fixturedef.scope == "function":
            return (yield)
        self._count_for(fixturedef.argname)
        try:
            return (yield)
        finally:
            self._count_for(self._test)

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Iterator[None]:
        self._test = item.nodeid
        self._count_for(self._test)
        forget()
        self._start, self._is_slow = processor_s(), False
        if _function(item.nodeid) in self.slow:
            item.add_marker(pytest.mark.skip(reason="takes too long for this"))
            self._is_slow = True
        with _limit(self._give_up, self._slow_s):
            yield
        if self._is_slow:
            self.seconds.pop(item.nodeid, None)
            self.slow.add(_function(item.nodeid))
            self.left_out["takes too long"] += 1

    def _give_up(self) -> None:
        self._is_slow = True
        pytest.skip("takes too long for this", allow_module_level=True)

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.when == "call" and report.passed:
            self.seconds[report.nodeid] = round(processor_s() - self._start, 4)
        elif report.failed:
            self.seconds.pop(report.nodeid, None)
            self.left_out["fails here"] += 1
        elif report.skipped and "takes too long for this" in str(report.longrepr):
            self._is_slow = True  # also those that share what took too long


def _function(test: str) -> str:
    return test.partition("[")[0]


@contextmanager
def _limit(give_up: Callable[[], None], slow_s: float) -> Iterator[None]:
    """Call `give_up` after this processor time, or after a long wait for other processes, and repeat the
    call, since running code may catch the first one.
    """
    clocks = {signal.SIGPROF: (signal.ITIMER_PROF, slow_s), signal.SIGALRM: (signal.ITIMER_REAL, WAITS_S)}

    def over(number: int, frame: FrameType | None) -> None:
        if frame and "coverage" in frame.f_code.co_filename:  # it holds a lock
            signal.setitimer(clocks[number][0], 0.01, 0.5)
        else:
            give_up()

    for number, (timer, seconds) in clocks.items():
        signal.signal(number, over)
        signal.setitimer(timer, seconds, 0.5)
    try:
        yield
    finally:
        for timer, _ in clocks.values():
            signal.setitimer(timer, 0.0)
