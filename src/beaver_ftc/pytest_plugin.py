"""Scenario files as tests: each expectation is an item of its own, with what was expected and what came out.

    pytest --beaver scenarios/          every scenario file below the folder
    pytest                              files named *.scenario.yaml
    pytest my-scenario.yaml my-sweep.yaml

A sweep is many flights: it is a test where it is named. What lies in result folders is one where it is named.

Nothing of the testbed is imported before there is a scenario to collect. A scenario or sweep is flown once a
process, when the first of its items runs; of one that fails, the whole result with its figures is kept
below pytest's temporary folder.
"""

from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import pytest

if TYPE_CHECKING:
    from beaver_ftc.results.model import Expectation

_MARKED = (".scenario.yaml", ".scenario.yml")
_YAML = (".yaml", ".yml")
_OF_A_RESULT = (
    ("scenario.yaml", "metrics.json"),
    ("scenario.yaml", "log.parquet"),
    ("sweep.json", "results.parquet"),
)
_COMPLETES = "completes"
_NEAR = 0.8


class ExpectationMissed(Exception):
    """An expectation that the flight did not meet."""


def pytest_addoption(parser: pytest.Parser) -> None:
    """--beaver: collect every YAML file that is a scenario, not only those named so."""
    group = parser.getgroup("beaver-ftc", "flight scenarios")
    group.addoption(
        "--beaver", action="store_true", help="collect scenario files (*.yaml) as tests, one an expectation"
    )
    group.addoption(
        "--beaver-plugin",
        action="append",
        default=[],
        metavar="[NAME=]MODULE:CLASS",
        help="register a detector or law that scenarios may name",
    )


def pytest_configure(config: pytest.Config) -> None:
    """Declare the mark that xdist reads, which is unknown without xdist; `--beaver-plugin` does what
    `beaver-ftc run --plugin` does."""
    config.addinivalue_line("markers", "xdist_group(name): items of one flight run in one worker")
    given = config.getoption("--beaver-plugin")
    if not given:
        return
    from beaver_ftc.documents.errors import BadInput
    from beaver_ftc.plugins import register

    try:
        for text in given:
            register(text)
    except BadInput as error:
        raise pytest.UsageError(str(error).replace("--plugin", "--beaver-plugin", 1)) from None


def pytest_collect_file(file_path: Path, parent: pytest.Collector) -> pytest.Collector | None:
    """A scenario file becomes a collector, and so does a sweep file that is named."""
    if not file_path.name.endswith(_YAML):
        return None
    named = parent.session.isinitpath(file_path)
    kind = _kind(file_path, named, parent.config.getoption("--beaver"))
    return kind.from_parent(parent, path=file_path) if kind else None


def _kind(path: Path, named: bool, all_of_them: bool) -> "type[FlownFile] | None":
    """What a YAML file is collected as."""
    if path.name.endswith(_MARKED):
        return ScenarioFile
    if not named and (not all_of_them or any(map(_is_a_result, path.parents))):
        return None
    return _kind_by_its_keys(path, named, all_of_them)


@cache
def _is_a_result(folder: Path) -> bool:
    """Whether a run or a sweep has written this folder: what is in it has been flown, and is no test."""
    return any(all((folder / name).is_file() for name in names) for names in _OF_A_RESULT)


def _kind_by_its_keys(path: Path, named: bool, all_of_them: bool) -> "type[FlownFile] | None":
    """A file is read as `run` reads it. What is there to be collected and cannot be read is, so that it fails
    and is not missed; a file that is named alone may be another tool's."""
    from beaver_ftc.documents.report import ScenarioError
    from beaver_ftc.documents.validation import parse_document
    from beaver_ftc.scenario.builtin import read_file

    try:
        keys = list(parse_document(read_file(path, str(path)), str(path)).data)
    except ScenarioError as error:
        none = all(problem.no_mapping for problem in error.problems)  # a YAML file of another tool
        return ScenarioFile if all_of_them and not none else None
    if not {"base", "vary"}.isdisjoint(keys):
        return SweepFile if named and not {"vary", "runs", "set"}.isdisjoint(keys) else None
    return ScenarioFile if _looks_like_a_scenario(keys) else None


def _looks_like_a_scenario(keys: list[str]) -> bool:
    """Whether these are keys of a scenario, or near misses of some: other tools' files have a name too."""
    from difflib import get_close_matches

    from beaver_ftc.scenario.schema import Scenario

    known = set(Scenario.model_fields)
    own = known - {"name", "description"}
    near = any(get_close_matches(str(key).lower(), own, n=1, cutoff=_NEAR) for key in keys)
    return near or ("name" in keys and known.issuperset(keys))


class Flown(NamedTuple):
    """What came of a file, and the folder in which it is kept."""

    expectations: "tuple[Expectation, ...]"
    folder: str


class FlownFile(pytest.File):
    """A file of flights; flown when the first of its expectations is asked about."""

    name_flown: str
    _flown: Flown | Exception | None = None

    def collect(self) -> Iterator[pytest.Item]:
        """One item an expectation; of a file that expects nothing, that it can be flown."""
        from beaver_ftc.documents.errors import BadInput

        try:
            self.name_flown, names = self._read()
        except BadInput as error:
            raise self.CollectError(str(error)) from None
        for name in names or [_COMPLETES]:
            item = ExpectationItem.from_parent(self, name=name)
            # `pytest -n 2 --dist loadgroup` then flies a file in one worker only
            item.add_marker(pytest.mark.xdist_group(str(self.path)))
            yield item

    def flown(self) -> Flown:
        """What was flown; raises again what went wrong with it."""
        if self._flown is None:
            try:
                self._flown = self._fly(self.config._tmp_path_factory.mktemp("beaver-ftc"))  # type: ignore[attr-defined]
            except Exception as error:
                self._flown = error
        if isinstance(self._flown, Exception):
            raise self._flown
        return self._flown

    def _read(self) -> tuple[str, list[str]]:
        """Its name, and the names of what it expects. Raises BadInput."""
        raise NotImplementedError

    def _fly(self, out: Path) -> Flown:
        """Fly into a folder, with figures if an expectation is missed."""
        raise NotImplementedError


class ScenarioFile(FlownFile):
    """One scenario."""

    def _read(self) -> tuple[str, list[str]]:
        from beaver_ftc.results.expectations import expectation_names
        from beaver_ftc.scenario.schema import load

        self.scenario = load(self.path)
        return self.scenario.name, expectation_names(self.scenario.expect)

    def _fly(self, out: Path) -> Flown:
        from beaver_ftc.results.flight import fly

        flight = fly(self.scenario)
        return Flown(flight.expectations, str(flight.save(out, report=not flight.passed)))


class SweepFile(FlownFile):
    """One sweep, flown on all cores."""

    def _read(self) -> tuple[str, list[str]]:
        from beaver_ftc.scenario.sweeps import load_sweep
        from beaver_ftc.studies.sweep.expectations import names

        self.sweep = load_sweep(self.path)
        return self.sweep.name, names(self.sweep.file.expect)

    def _fly(self, out: Path) -> Flown:
        from beaver_ftc.studies.sweep.campaign import Options, run_sweep
        from beaver_ftc.studies.sweep.summary_words import verdict

        summary = run_sweep(self.sweep, Options(out, report=False, source=str(self.path)))
        if not summary["passed"]:
            run_sweep(self.sweep, Options(out, resume=True, source=str(self.path)))  # nothing is flown again
        return Flown(verdict(summary).expectations, str(out / self.sweep.name))


class ExpectationItem(pytest.Item):
    """One expectation of one file."""

    parent: FlownFile

    def runtest(self) -> None:
        """Fly, if nobody has yet, and hold the expectation against what came out."""
        flown = self.parent.flown()
        self.user_properties.append(("result", flown.folder))
        for expectation in flown.expectations:
            if expectation.name == self.name and not expectation.passed:
                why = f"; {expectation.reason}" if expectation.reason else ""
                missed = f"{self.name}: {expectation.expected_and_actual_text}{why}"
                raise ExpectationMissed(f"{missed}\nkept: {flown.folder} (see report.html)")

    def repr_failure(self, excinfo: pytest.ExceptionInfo[BaseException], style: Any = None) -> Any:
        """What was missed, without a traceback through the testbed."""
        from beaver_ftc.documents.errors import BeaverFtcError

        if isinstance(excinfo.value, ExpectationMissed | BeaverFtcError):
            return str(excinfo.value)
        return super().repr_failure(excinfo, style)

    def reportinfo(self) -> tuple[Path, int, str]:
        """Where it stands."""
        return self.path, 0, f"{self.parent.name_flown}: {self.name}"
