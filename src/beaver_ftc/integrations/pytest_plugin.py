"""Scenario files as tests: each expectation is an item of its own, with what was expected and what came out.

    pytest --beaver scenarios/          every scenario file below the folder
    pytest                              files named *.scenario.yaml

Nothing of the testbed is imported before there is a scenario to collect. A scenario is flown once a
process, when the first of its items runs; of one that fails, the whole result with its figures is kept
below pytest's temporary folder.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

_MARKED = (".scenario.yaml", ".scenario.yml")
_YAML = (".yaml", ".yml")
_COMPLETES = "completes"
_NO_MAPPING = ("is empty", "is not a mapping")  # a YAML file of another tool
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
    """--beaver-plugin: what `beaver-ftc run --plugin` does."""
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
    """A scenario file becomes a collector."""
    name = file_path.name
    if name.endswith(_MARKED) or (name.endswith(_YAML) and _is_asked_for(file_path, parent.config)):
        return ScenarioFile.from_parent(parent, path=file_path)
    return None


def _is_asked_for(path: Path, config: pytest.Config) -> bool:
    """With --beaver, every file that is a scenario for `run`, or was meant to be one, and no sweep.

    A file is read as `run` reads it. What cannot be read is collected, so that it fails and is not missed.
    """
    if not config.getoption("--beaver"):
        return False
    from beaver_ftc.documents.problems import ScenarioError
    from beaver_ftc.scenario.loader import parse_document, read_file

    try:
        data = parse_document(read_file(path, str(path)), str(path)).data
    except ScenarioError as error:
        return not all(problem.says.startswith(_NO_MAPPING) for problem in error.problems)
    return not data.keys() & {"base", "vary"} and _looks_like_a_scenario(list(data))


def _looks_like_a_scenario(keys: list[str]) -> bool:
    """Whether these are keys of a scenario, or near misses of some: other tools' files have a name too."""
    from difflib import get_close_matches

    from beaver_ftc.scenario.schema import Scenario

    known = set(Scenario.model_fields)
    own = known - {"name", "description"}
    near = any(get_close_matches(str(key).lower(), own, n=1, cutoff=_NEAR) for key in keys)
    return near or ("name" in keys and set(keys) <= known)


class ScenarioFile(pytest.File):
    """One scenario file; flown when the first of its expectations is asked about."""

    _flown: dict[str, Any] | Exception | None = None

    def collect(self) -> Iterator[pytest.Item]:
        """One item an expectation; of a scenario that expects nothing, that it can be flown."""
        from beaver_ftc.documents.errors import BadInput
        from beaver_ftc.results.expectations import names
        from beaver_ftc.scenario.given import load

        try:
            self.scenario = load(self.path)
        except BadInput as error:
            raise self.CollectError(str(error)) from None
        for name in names(self.scenario.expect) or [_COMPLETES]:
            item = ExpectationItem.from_parent(self, name=name)
            # `pytest -n 2 --dist loadgroup` then flies a scenario in one worker only
            item.add_marker(pytest.mark.xdist_group(str(self.path)))
            yield item

    def flown(self) -> dict[str, Any]:
        """The metrics of the flight; raises again what went wrong with it."""
        if self._flown is None:
            try:
                self._flown = self._fly()
            except Exception as error:
                self._flown = error
        if isinstance(self._flown, Exception):
            raise self._flown
        return self._flown

    def _fly(self) -> dict[str, Any]:
        from beaver_ftc.results.flight import fly

        out = self.config._tmp_path_factory.mktemp("beaver-ftc")  # type: ignore[attr-defined]
        flight = fly(self.scenario)
        return flight.metrics | {"folder": str(flight.save(out, report=not flight.passed))}


class ExpectationItem(pytest.Item):
    """One expectation of one scenario."""

    parent: ScenarioFile

    def runtest(self) -> None:
        """Fly, if nobody has yet, and hold the expectation against what came out."""
        document = self.parent.flown()
        self.user_properties.append(("result", document["folder"]))
        for expectation in document["expectations"]:
            if expectation["name"] == self.name and not expectation["passed"]:
                raise ExpectationMissed(
                    f"{self.name}: expected {expectation['expected']}, actual {expectation['actual']}\n"
                    f"kept: {document['folder']} (figures/, report.html, log.parquet)"
                )

    def repr_failure(self, excinfo: pytest.ExceptionInfo[BaseException], style: Any = None) -> Any:
        """What was missed, without a traceback through the testbed."""
        from beaver_ftc.documents.errors import BeaverFtcError

        if isinstance(excinfo.value, ExpectationMissed | BeaverFtcError):
            return str(excinfo.value)
        return super().repr_failure(excinfo, style)

    def reportinfo(self) -> tuple[Path, int, str]:
        """Where it stands."""
        return self.path, 0, f"{self.parent.scenario.name}: {self.name}"
