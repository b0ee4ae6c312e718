"""The plan of evidence: requirements on scenarios and sweeps. First the mistakes of its keys and values are
reported together, then those of its sources, formulas and expectations.

A *source* is a scenario or a sweep, out of the plan itself, built in, or from another file.
"""

import contextlib
import hashlib
import re
from collections.abc import Iterator
from dataclasses import dataclass
from math import inf
from pathlib import Path
from typing import Any

from beaver_ftc.documents import (
    BadInput,
    Document,
    Location,
    Problem,
    ScenarioError,
    inside,
    parse_document,
    suggestion,
    validate_model,
)
from beaver_ftc.results import Formula, FormulaError, parse_formula
from beaver_ftc.scenario import (
    Expect,
    Scenario,
    builtin_names,
    builtin_sweeps,
    checked_against,
    conflicts,
    is_of_a_sweep,
    is_sweep,
    load_scenario,
    load_sweep,
    looks_like_a_path,
    read_file,
    resolve,
    validate_scenario,
    validate_sweep,
)
from beaver_ftc_assurance.evidence.plan_file import OfSweep, PlanFile, Requirement
from beaver_ftc_assurance.evidence.source import Source, SweepSource

MOST_FLIGHTS = 100_000  # largest number of flights of a plan


def plan_json_schema() -> dict[str, Any]:
    """The JSON Schema of a plan, for editors."""
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **PlanFile.model_json_schema()}


@dataclass(frozen=True)
class EvidencePlan:
    """A plan ready to fly.

    sources: name -> source. expect, formulas: id of a requirement -> its expectations, or its formula. over:
    id of a requirement -> names of its sources. given: name or path of the plan on the command line. sha256:
    of its text.
    """

    file: PlanFile
    sources: dict[str, Source]
    over: dict[str, tuple[str, ...]]
    expect: dict[str, Expect]
    formulas: dict[str, Formula]
    given: str
    sha256: str

    @property
    def cases(self) -> list[tuple[str, int]]:
        """Each flight once, as (name of its source, number in the source)."""
        return [(source.name, run) for source in self.sources.values() for run in range(source.flights)]

    def of(self, source: str) -> Iterator[Requirement]:
        """The requirements for which a source is flown."""
        return (requirement for requirement in self.file.requirements if source in self.over[requirement.id])


def load_plan(path_or_name: str) -> EvidencePlan:
    """The plan in a file or of a built-in name. Raises BadInput with one line a mistake."""
    path = resolve(path_or_name, "plan")
    text = read_file(path, path_or_name, "plan")
    document = parse_document(text, str(path), "a plan's keys: name, description, flights and requirements")
    document.data.setdefault("name", re.sub(r"[^A-Za-z0-9_-]", "-", path.stem)[:70])
    file = validate_model(PlanFile, document, str(path))
    return _Reading(file, document, path, path_or_name).plan(hashlib.sha256(text.encode()).hexdigest())


class _Reading:
    """Reads the sources of all requirements and checks them. Mistakes are collected, and raised together by
    `plan`."""

    def __init__(self, file: PlanFile, document: Document, path: Path, given: str) -> None:
        self._file = file
        self._document = document
        self._path = path
        self._given = given
        self._problems: list[Problem] = []
        self._elsewhere: list[str] = []  # lines on mistakes in other files
        # Name or path in the plan -> source, None if it has a mistake.
        self._sources: dict[str, Source | None] = {}

    def plan(self, sha256: str) -> EvidencePlan:
        """The plan; its mistakes are raised together. over, expect, formulas: as in `EvidencePlan`."""
        over: dict[str, tuple[str, ...]] = {}
        expect: dict[str, Expect] = {}
        formulas: dict[str, Formula] = {}
        for i, requirement in enumerate(self._file.requirements):
            place = ("requirements", i)
            if requirement.id in over:
                self._problem((*place, "id"), f"{requirement.id} is there twice, allowed: each id once")
            sources_or_none = [
                self._source(name, (*place, "over", k)) for k, name in enumerate(requirement.over)
            ]
            sources = [source for source in sources_or_none if source is not None]
            over[requirement.id] = tuple(dict.fromkeys(source.name for source in sources))
            formula = self._formula(requirement, place)
            if formula:
                formulas[requirement.id] = formula
            for k, source in enumerate(sources):
                if isinstance(requirement.bar, OfSweep) and not source.is_sweep:
                    text = f"{source.given} is a scenario, allowed with a bar of type sweep: sweeps"
                    self._problem((*place, "over", k), text)
                if formula:
                    self._check_formula(formula, source, (*place, "formula"))
                if requirement.expect is not None:
                    checked = self._expect(requirement.expect, source, (*place, "expect"))
                    if checked:  # the same for each source: a source only adds problems
                        expect[requirement.id] = checked
        self._check_unused()
        sources_by_name = self._by_name()
        self._raise()
        return EvidencePlan(self._file, sources_by_name, over, expect, formulas, self._given, sha256)

    def _problem(self, at: Location, says: str) -> None:
        """Add a mistake in the file of the plan, with its place and a text."""
        self._problems.append(Problem(self._document.line(at), at, says))

    def _raise(self) -> None:
        """Raise BadInput with a line for each mistake, if there is one."""
        lines = list(ScenarioError(str(self._path), self._problems).lines) if self._problems else []
        if lines or self._elsewhere:
            raise BadInput("\n".join(dict.fromkeys([*lines, *self._elsewhere])))

    def _by_name(self) -> dict[str, Source]:
        """Name -> source, for all sources that could be read. Equal names and too many flights are
        mistakes."""
        sources: dict[str, Source] = {}
        for source in filter(None, self._sources.values()):
            if source.name in sources:
                both = f"{source.given} and {sources[source.name].given}"
                text = f"{both} are both named {source.name}, allowed: each name once"
                self._problem(("requirements",), text)
            sources[source.name] = source
        flights = sum(source.flights for source in sources.values())
        if flights > MOST_FLIGHTS:
            self._problem(("requirements",), f"{flights} flights, allowed: at most {MOST_FLIGHTS}")
        return sources

    def _check_unused(self) -> None:
        """Add a mistake for each entry of `flights` that no requirement names. The entry is read, too, for
        its own mistakes."""
        for name in self._file.flights:
            if name not in self._sources:
                self._source(name, ("flights", name))
                self._problem(
                    ("flights", name), "no requirement is over these, allowed: flights that one names"
                )

    def _source(self, given: str, at: Location) -> Source | None:
        """The source of this name or path, read once; None if it has a mistake, which is added."""
        if given not in self._sources:
            self._sources[given] = None
            try:
                self._sources[given] = self._read(given, at)
            except ScenarioError as error:
                if error.source == str(self._path):
                    self._problems += error.problems
                else:
                    self._elsewhere += error.lines
        return self._sources[given]

    def _read(self, given: str, at: Location) -> Source:
        """The source of a name or path: of the plan, built in, or a file. Raises ScenarioError if there is
        none."""
        if given in self._file.flights:
            return self._own(given)
        if given in builtin_sweeps():
            return SweepSource(given, load_sweep(given))
        if given in builtin_names():
            return Source(given, load_scenario(given))
        path = inside(self._path.parent, given)
        if path is None:
            text = f"{given[:100]!r} is outside, allowed: a file in the plan's own folder or below it"
        elif not looks_like_a_path(given):
            known = [*self._file.flights, *builtin_names(), *builtin_sweeps()]
            text = f"{given[:100]!r} is no flight of the plan and not built in{suggestion(given, known)}"
        else:
            with contextlib.suppress(OSError):
                if path.is_file():
                    if is_sweep(path):
                        return SweepSource(given, load_sweep(path))
                    return Source(given, load_scenario(path))
            text = f"no such file: {given[:100]!r}, allowed: a scenario or sweep file"
        raise ScenarioError(str(self._path), [Problem(self._document.line(at), at, text)])

    def _own(self, name: str) -> Source:
        """The source of a scenario or sweep in the plan itself."""
        content = self._document.below("flights", name)
        content.data = {"name": name, **content.data}
        try:
            if is_of_a_sweep(content.data):
                return SweepSource(name, validate_sweep(content, str(self._path), self._path.parent))
            return Source(name, validate_scenario(content, str(self._path), self._path.parent))
        except ScenarioError as error:
            raise error.below(str(self._path), "flights", name) from None

    def _formula(self, requirement: Requirement, at: Location) -> Formula | None:
        """The formula of a requirement; None if it has none, or one with a mistake, which is added."""
        if requirement.formula is None:
            return None
        try:
            return parse_formula(requirement.formula)
        except FormulaError as error:
            self._problem((*at, "formula"), str(error))
            return None

    def _check_formula(self, formula: Formula, source: Source, at: Location) -> None:
        """Add a mistake if the logs of a source are too short for a formula, or lack one of its columns. A
        formula that looks ahead without end fits each log. A source that cannot fly has no columns."""
        ahead = formula.looks_ahead_s
        duration_s = source.base.duration_s
        if duration_s < ahead < inf:
            self._problem(
                at, f"looks {ahead:g} s ahead, allowed over {source.given}: at most its {duration_s:g} s"
            )
        for column in sorted(formula.columns.difference(source.columns)) if source.columns else ():
            text = f"{column[:60]!r} is no column of {source.given}'s log{suggestion(column, source.columns)}"
            self._problem(at, text)

    def _expect(self, given: dict[str, Any], source: Source, at: Location) -> Expect | None:
        """The expectations, checked with the base scenario of a source; None if they have a mistake, which is
        added. lines: the lines of the plan in which the keys of `expect` stand.
        """
        base = source.base
        data = base.model_dump(mode="json", by_alias=True, exclude_unset=True) | {"expect": given}
        lines = {("expect", *where): n for where, n in self._document.below(*at).lines.items()}
        try:
            with checked_against(base.airframe, base.aircraft):
                return validate_model(Scenario, Document(data, lines), "", None, conflicts).expect
        except ScenarioError as error:
            for problem in error.problems:
                if problem.location[:1] == ("expect",):
                    self._problem((*at, *problem.location[1:]), problem.says)
            return None
