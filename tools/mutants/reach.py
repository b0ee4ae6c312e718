"""Which tests execute a line, and how long each of them takes in plain Python."""

import functools
import hashlib
import json
import signal
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import get_context
from pathlib import Path
from types import FrameType

import coverage
import hypothesis
import pytest

from tools.mutants.scope import ROOT
from tools.mutants.trial import SURVIVED, in_a_child, pytest_quietly

SLOW_S = 1.0  # of processor, counting lines; a test that takes longer in plain Python is none for this
FLIES = 4  # so many slow tests first in a file, and none of it is tried: all of them fly
HANGS_S = 600.0  # of processor for the tests of one file, far more than the limits allow
EXAMPLES = 4
FORGETS = tuple(f"beaver_ftc.{folder}." for folder in ("design", "diagnosis", "control"))
KEPT = ROOT / ".mutants"


class Reach:
    """The tests of some folders: what they execute, and those that are none for this."""

    def __init__(self, files: Iterable[dict]) -> None:
        self.seconds: dict[str, float] = {}
        self.left_out: Counter[str] = Counter()
        self._lines: dict[str, dict[int, list[str]]] = {}
        for file in files:
            self.seconds |= file["seconds"]
            self.left_out.update(file["left_out"])
            for name, lines in file["lines"].items():
                known = self._lines.setdefault(name, {})
                for line, tests in lines.items():
                    known.setdefault(int(line), []).extend(tests)

    def of(self, name: str, lines: Iterable[int]) -> list[str]:
        """Those that execute the first of the lines; of one that ran at import, all that execute anything;
        of a module without functions, all that execute what imports it.
        """
        by_line = self._lines.get(name)
        if by_line is None:
            users = [file for file in self._lines if _imports(ROOT / file, name)]
            return sorted({t for file in users for tests in self._lines[file].values() for t in tests})
        for line in lines:
            if tests := by_line.get(line):
                return tests
        if any(line in by_line for line in lines):
            return sorted({test for tests in by_line.values() for test in tests})
        return []


def _imports(file: Path, name: str) -> bool:
    """Whether a module imports something of another, that of a file below src/."""
    module = ".".join(Path(name).with_suffix("").parts[1:])
    return file.exists() and f"from {module} import" in file.read_text()


def reach(folders: Iterable[str], jobs: int, say: Callable[[str], None]) -> Reach:
    """What the tests of the folders execute. Kept a test file each, until a source it executes changes."""
    files = [f for folder in folders for f in sorted((ROOT / "tests" / folder).rglob("test_*.py"))]
    due = [file for file in files if _known(file) is None]
    if due:
        say(f"finding out what the tests of {len(due)} of {len(files)} files execute")
    with ProcessPoolExecutor(jobs, mp_context=get_context("fork")) as pool:
        for file, lost in zip(due, pool.map(_measure, due), strict=True):
            if lost:
                say(f"{file.relative_to(ROOT)}: its tests could not be measured, and are left out")
    return Reach(known for file in files if (known := _known(file)))


def _kept(file: Path) -> Path:
    return KEPT / file.relative_to(ROOT / "tests").with_suffix(".json")


def _known(file: Path) -> dict | None:
    kept = _kept(file)
    found = json.loads(kept.read_text()) if kept.exists() else None
    return found if found and found["sources"] == _digests(found["sources"]) else None


def _digests(sources: Iterable[str]) -> dict[str, str]:
    def digest(file: Path) -> str:
        return hashlib.sha256(file.read_bytes()).hexdigest()[:16] if file.exists() else ""

    return {name: digest(ROOT / name) for name in sorted(sources)}


def _measure(file: Path) -> bool:
    """Whether it failed, in a process of its own: what one test file imports is not there for the next."""
    return in_a_child(lambda: _write(file), HANGS_S) != SURVIVED


def _write(file: Path) -> int:
    kept = _kept(file)
    kept.parent.mkdir(parents=True, exist_ok=True)
    kept.write_text(json.dumps(_measured(file)))
    return 0


def _measured(file: Path) -> dict:
    few_examples()
    watch = coverage.Coverage(data_file=None, source_pkgs=["beaver_ftc"], config_file=False)
    timed = _Timed(watch, _slow_before(file))
    with watch.collect():
        pytest_quietly(["-m", "not acceptance", str(file)], [timed])
    lines = _lines(watch.get_data(), timed)
    sources = {*lines, *_tests_own(), file.relative_to(ROOT).as_posix()}
    return {
        "sources": _digests(sources),
        "seconds": timed.seconds,
        "left_out": timed.left_out,
        "slow": sorted(timed.slow),
        "lines": lines,
    }


def _slow_before(file: Path) -> set[str]:
    """Tests that took too long when the package was another, and the test file the same: not tried again."""
    kept, name = _kept(file), file.relative_to(ROOT).as_posix()
    before = json.loads(kept.read_text()) if kept.exists() else {}
    same = before.get("sources", {}).get(name) == _digests([name])[name]
    return set(before.get("slow", ()) if same else ())


def _lines(data: coverage.CoverageData, timed: "_Timed") -> dict[str, dict[int, list[str]]]:
    """{file: {line: tests}} of the files of which a test executes more than the import."""
    found = {}

    def tests(contexts: list[str]) -> list[str]:
        users = {test for context in contexts for test in timed.users.get(context, [context])}
        return sorted(users & timed.seconds.keys())

    for file in data.measured_files():
        by_line = data.contexts_by_lineno(file)
        if any(context for contexts in by_line.values() for context in contexts):
            name = Path(file).relative_to(ROOT).as_posix()
            found[name] = {line: tests(contexts) for line, contexts in by_line.items()}
    return found


def _tests_own() -> set[str]:
    """The modules of tests/ and tools/ that are loaded."""
    files = (getattr(module, "__file__", None) for module in list(sys.modules.values()))
    roots = (ROOT / "tests", ROOT / "tools")
    inside = (Path(f) for f in files if f and any(Path(f).is_relative_to(root) for root in roots))
    return {
        file.relative_to(ROOT).as_posix()
        for file in inside
        if not file.is_relative_to(ROOT / "tools" / "mutants")
    }


def few_examples() -> None:
    """From now on no property test draws more than `EXAMPLES`: what they draw is the same each time."""
    begin = hypothesis.settings.__init__

    def begin_with_few(self, parent=None, **given) -> None:
        wanted = given.get("max_examples", EXAMPLES)
        begin(self, parent, **{**given, "max_examples": min(wanted, EXAMPLES)})

    hypothesis.settings.__init__ = begin_with_few  # type: ignore[method-assign]


def forget() -> None:
    """What the package keeps once a process, as the shape of a record, each test works out again: else only
    the first of a process would be known to execute it.
    """
    for name, module in list(sys.modules.items()):
        if name.startswith(FORGETS):
            for value in list(vars(module).values()):
                if isinstance(value, functools._lru_cache_wrapper) and value.__module__ == name:
                    value.cache_clear()


class _Timed:
    """Notes for each test that passes how long it took, and gives up one that is slow."""

    def __init__(self, watch: coverage.Coverage, known_slow: set[str]) -> None:
        self._watch = watch
        self.seconds: dict[str, float] = {}
        self.left_out: Counter[str] = Counter()
        self.slow: set[str] = set()  # after one slow case the other cases of a test are not tried
        self._known_slow = known_slow
        self.users: dict[str, list[str]] = {}  # the tests that share a fixture, by its name
        self._is_slow = False

    def pytest_collection_finish(self, session: pytest.Session) -> None:
        for item in session.items:
            for fixture in getattr(item, "fixturenames", ()):
                self.users.setdefault(fixture, []).append(item.nodeid)

    @pytest.hookimpl(wrapper=True)
    def pytest_fixture_setup(self, fixturedef: pytest.FixtureDef, request: pytest.FixtureRequest):
        """What a shared fixture executes, every test executes that uses it: each may be run alone."""
        if fixturedef.scope == "function":
            return (yield)
        self._watch.switch_context(fixturedef.argname)
        try:
            return (yield)
        finally:
            self._watch.switch_context(self._test)

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Iterator[None]:
        self._test = item.nodeid
        self._watch.switch_context(self._test)
        forget()
        self._start, self._is_slow = time.process_time(), False
        all_fly = not self.seconds and len(self.slow) >= FLIES
        if all_fly or _function(item.nodeid) in self.slow | self._known_slow:
            item.add_marker(pytest.mark.skip(reason="takes too long for this"))
            self._is_slow = True
        with _limit(self._give_up):
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
            self.seconds[report.nodeid] = round(time.process_time() - self._start, 4)
        elif report.failed:
            self.seconds.pop(report.nodeid, None)
            self.left_out["fails in plain Python"] += 1
        elif report.skipped and "takes too long for this" in str(report.longrepr):
            self._is_slow = True  # also those that share what took too long


def _function(test: str) -> str:
    return test.partition("[")[0]


@contextmanager
def _limit(give_up: Callable[[], None]) -> Iterator[None]:
    """Give up what runs inside after so many seconds of processor, or a good while of waiting for other
    processes; and again and again, as whoever was at work may not have let go.
    """
    clocks = {signal.SIGPROF: (signal.ITIMER_PROF, SLOW_S), signal.SIGALRM: (signal.ITIMER_REAL, 10 * SLOW_S)}

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
