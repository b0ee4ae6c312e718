"""The plan of evidence: requirements on scenarios and sweeps. Reading it reports every mistake at once."""

import contextlib
import hashlib
import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from math import inf
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import Field, StringConstraints, model_validator

from beaver_ftc.aircraft import Aircraft
from beaver_ftc.documents import (
    BadInput,
    Document,
    Location,
    Number,
    Problem,
    ScenarioError,
    Section,
    Whole,
    deny,
    entry,
    inside,
    number,
    parse_document,
    suggestion,
    validate_model,
)
from beaver_ftc.results import Formula, FormulaError, parse_formula
from beaver_ftc.scenario import (
    NAME_PATTERN,
    Expect,
    Scenario,
    Sweep,
    SweepExpect,
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
from beaver_ftc.studies.engine import digest_of_aircraft
from beaver_ftc.studies.sweep import Assignment, Plan, flight_name, scenario_of

MOST_REQUIREMENTS = 500
MOST_FLIGHTS = 100_000
Text = Annotated[str, StringConstraints(max_length=2000)]


class OfSweep(SweepExpect):
    """Conditions as in `expect` of a sweep file."""

    type: Literal["sweep"]


class OfHandling(Section):
    """Level of handling qualities of MIL-F-8785C: at the end of a flight with a fault, otherwise in trim."""

    type: Literal["handling_qualities"]
    level: Whole = number(1, "1", "worst allowed level, 1: best", ge=1, le=3)


class OfMargins(Section):
    """Stability margins of the loop of each surface, healthy and after each loss for which the default law
    is designed."""

    type: Literal["margins"]
    gain_db: Number = number(6.0, "dB", "smallest gain margin", ge=0, le=100)
    phase_deg: Number = number(45.0, "deg", "smallest phase margin", ge=0, le=180)


Bar = Annotated[OfSweep | OfHandling | OfMargins, Field(discriminator="type")]


class Requirement(Section):
    """One requirement, with exactly one of `expect`, `formula` and `bar`.

    id: name of the requirement: letters, digits, - and _
    text: the requirement in words
    clause: clause of the regulation or standard
    over: flights that must meet it: names from `flights`, built-in names, or files
    expect: conditions that each flight must meet, as in `expect` of a scenario
    formula: formula of signal temporal logic over columns of the log, times in s. Operators: `always`,
    `eventually`, `until`, `once`, `historically`, `not`, `and`, `or`, `implies`
    bar: limit that the result of a study must meet
    """

    id: str = entry(..., pattern=NAME_PATTERN, max_length=40, examples=["JAM-1"])
    text: Text = entry("", examples=["No jam loses the aircraft."])
    clause: Text = entry("", examples=["CS 25.671(c)(3)"])
    over: tuple[str, ...] = entry(..., min_length=1, max_length=200, examples=[["elevator-stuck"]])
    expect: dict[str, Any] | None = entry(None, min_length=1, examples=[{"no_departure": True}])
    formula: str | None = entry(None, max_length=4000, examples=["always(abs(q_rad_s) <= 0.5)"])
    bar: Bar | None = None

    @model_validator(mode="after")
    def _one_kind(self) -> Self:
        given = [key for key in ("expect", "formula", "bar") if getattr(self, key) is not None]
        if len(given) != 1:
            said = " and ".join(given) or "nothing that can be judged"
            deny(f"has {said}, allowed: exactly one of expect, formula, bar")
        return self


class PlanFile(Section, title="beaver-ftc plan of evidence"):
    """Requirements, and the flights that are flown for them.

    name: name of the plan: letters, digits, - and _
    description: purpose of the plan
    flights: scenarios and sweeps of this plan, by name
    requirements: list of the requirements
    """

    name: str = entry(..., pattern=NAME_PATTERN, max_length=70, examples=["flight-controls"])
    description: str = entry("", max_length=4000, examples=["The flight controls after one failure."])
    flights: dict[Annotated[str, StringConstraints(pattern=NAME_PATTERN, max_length=70)], dict[str, Any]] = (
        entry(dict, max_length=200, examples=[{"own": {"duration_s": 30}}])
    )
    requirements: tuple[Requirement, ...] = entry(..., min_length=1, max_length=MOST_REQUIREMENTS)


def plan_json_schema() -> dict[str, Any]:
    """The JSON Schema of a plan, for editors."""
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **PlanFile.model_json_schema()}


@dataclass(frozen=True)
class Source:
    """A scenario or a sweep (`what`) to fly. given: its name or path in the plan."""

    name: str
    given: str
    what: Scenario | Sweep

    @property
    def flights(self) -> int:
        """How many flights it has."""
        return self.what.flights if isinstance(self.what, Sweep) else 1

    @property
    def aircraft(self) -> Aircraft:
        """The aircraft of all its flights."""
        return self.what.aircraft if isinstance(self.what, Sweep) else self.what.airframe

    def assignment(self, run: int) -> Assignment | None:
        """The varied values of one flight of a sweep; None for a scenario."""
        return Plan(self.what).assignments([run])[0] if isinstance(self.what, Sweep) else None

    def flight(self, run: int) -> str:
        """The name of one flight."""
        return flight_name(self.what, run) if isinstance(self.what, Sweep) else self.name

    def scenario(self, run: int) -> Scenario:
        """One flight. Raises BadInput if its values contradict each other."""
        if not isinstance(self.what, Sweep):
            return self.what
        assigned = self.assignment(run)
        assert assigned is not None
        return scenario_of(self.what, assigned)

    @property
    def base(self) -> Scenario:
        """The scenario of all its flights, without variations."""
        return self.what.scenario({}) if isinstance(self.what, Sweep) else self.what

    @cached_property
    def columns(self) -> tuple[str, ...]:
        """The columns of its logs; none if it cannot fly, which the row of the flight reports."""
        from beaver_ftc.loop import Loop

        with contextlib.suppress(BadInput):
            loop = Loop(self.base)
            loop.release()
            return loop.columns
        return ()

    @property
    def sha256(self) -> str:
        """SHA-256 of the resolved scenario or sweep, and of the files of its aircraft."""
        aircraft = digest_of_aircraft(self.aircraft.folder)
        left_out = {"description", "expect"}
        if isinstance(self.what, Sweep):
            file = self.what.file.model_dump(mode="json", exclude=left_out | {"base", "set"})
            text = repr([aircraft, self.what.base, file])
        else:
            text = repr([aircraft, self.what.model_dump(mode="json", exclude=left_out)])
        return hashlib.sha256(text.encode()).hexdigest()


@dataclass(frozen=True)
class EvidencePlan:
    """A plan ready to fly. expect, formulas: by requirement; over: the names of its sources, by requirement.

    given: as the command line names it. sha256: of the file's text.
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
        """Every flight once: its source and its number there."""
        return [(source.name, run) for source in self.sources.values() for run in range(source.flights)]

    def of(self, source: str) -> Iterator[Requirement]:
        """The requirements that a source is flown for."""
        return (each for each in self.file.requirements if source in self.over[each.id])


def load_plan(path_or_name: str) -> EvidencePlan:
    """The plan in a file or of a built-in name. Raises BadInput with one line a mistake."""
    path = resolve(path_or_name, "plan")
    text = read_file(path, path_or_name, "plan")
    document = parse_document(text, str(path), "a plan's keys: name, description, flights and requirements")
    document.data.setdefault("name", re.sub(r"[^A-Za-z0-9_-]", "-", path.stem)[:70])
    file = validate_model(PlanFile, document, str(path))
    return _Reading(file, document, path, path_or_name).plan(hashlib.sha256(text.encode()).hexdigest())


class _Reading:
    """Reads the sources of all requirements and checks them; mistakes are collected."""

    def __init__(self, file: PlanFile, document: Document, path: Path, given: str) -> None:
        self._file = file
        self._document = document
        self._path = path
        self._given = given
        self._problems: list[Problem] = []
        self._elsewhere: list[str] = []  # lines about other files
        self._sources: dict[str, Source | None] = {}  # by what the plan calls them

    def plan(self, sha256: str) -> EvidencePlan:
        """The plan; its mistakes are raised together."""
        over: dict[str, tuple[str, ...]] = {}
        expect: dict[str, Expect] = {}
        formulas: dict[str, Formula] = {}
        for i, requirement in enumerate(self._file.requirements):
            at = ("requirements", i)
            if requirement.id in over:
                self._problem((*at, "id"), f"{requirement.id} is there twice, allowed: each id once")
            found = [self._source(name, (*at, "over", k)) for k, name in enumerate(requirement.over)]
            sources = [source for source in found if source is not None]
            over[requirement.id] = tuple(dict.fromkeys(source.name for source in sources))
            formula = self._formula(requirement, at)
            if formula:
                formulas[requirement.id] = formula
            for k, source in enumerate(sources):
                if isinstance(requirement.bar, OfSweep) and not isinstance(source.what, Sweep):
                    says = f"{source.given} is a scenario, allowed with a bar of type sweep: sweeps"
                    self._problem((*at, "over", k), says)
                if formula:
                    self._fits(formula, source, (*at, "formula"))
                if requirement.expect is not None:
                    judged = self._expect(requirement.expect, source, (*at, "expect"))
                    if judged:  # the same for each source: a source only adds problems
                        expect[requirement.id] = judged
        self._unused()
        sources_by_name = self._by_name()
        self._raise()
        return EvidencePlan(self._file, sources_by_name, over, expect, formulas, self._given, sha256)

    def _problem(self, at: Location, says: str) -> None:
        self._problems.append(Problem(self._document.line(at), at, says))

    def _raise(self) -> None:
        lines = list(ScenarioError(str(self._path), self._problems).lines) if self._problems else []
        if lines or self._elsewhere:
            raise BadInput("\n".join(dict.fromkeys([*lines, *self._elsewhere])))

    def _by_name(self) -> dict[str, Source]:
        """The sources by their own names, which must differ."""
        found: dict[str, Source] = {}
        for source in filter(None, self._sources.values()):
            if source.name in found:
                both = f"{source.given} and {found[source.name].given}"
                says = f"{both} are both named {source.name}, allowed: each name once"
                self._problem(("requirements",), says)
            found[source.name] = source
        flights = sum(source.flights for source in found.values())
        if flights > MOST_FLIGHTS:
            self._problem(("requirements",), f"{flights} flights, allowed: at most {MOST_FLIGHTS}")
        return found

    def _unused(self) -> None:
        for name in self._file.flights:
            if name not in self._sources:
                self._source(name, ("flights", name))
                self._problem(
                    ("flights", name), "no requirement is over these, allowed: flights that one names"
                )

    def _source(self, given: str, at: Location) -> Source | None:
        """The source of this name, read once; its mistakes are noted."""
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
        """The scenario or sweep that a name or path stands for. Raises ScenarioError where there is none."""
        if given in self._file.flights:
            return self._own(given)
        if given in builtin_names() or given in builtin_sweeps():
            found: Scenario | Sweep = load_sweep(given) if given in builtin_sweeps() else load_scenario(given)
            return Source(found.name, given, found)
        path = inside(self._path.parent, given)
        if path is None:
            says = f"{given[:100]!r} is outside, allowed: a file in the plan's own folder or below it"
        elif not looks_like_a_path(given):
            known = [*self._file.flights, *builtin_names(), *builtin_sweeps()]
            says = f"{given[:100]!r} is no flight of the plan and not built in{suggestion(given, known)}"
        else:
            with contextlib.suppress(OSError):
                if path.is_file():
                    read = load_sweep(path) if is_sweep(path) else load_scenario(path)
                    return Source(read.name, given, read)
            says = f"no such file: {given[:100]!r}, allowed: a scenario or sweep file"
        raise ScenarioError(str(self._path), [Problem(self._document.line(at), at, says)])

    def _own(self, name: str) -> Source:
        """A scenario or sweep written into the plan."""
        own = self._document.below("flights", name)
        own.data = {"name": name, **own.data}
        read = validate_sweep if is_of_a_sweep(own.data) else validate_scenario
        try:
            found = read(own, str(self._path), self._path.parent)
        except ScenarioError as error:
            raise error.below(str(self._path), "flights", name) from None
        return Source(found.name, name, found)

    def _formula(self, requirement: Requirement, at: Location) -> Formula | None:
        if requirement.formula is None:
            return None
        try:
            return parse_formula(requirement.formula)
        except FormulaError as error:
            self._problem((*at, "formula"), str(error))
            return None

    def _fits(self, formula: Formula, source: Source, at: Location) -> None:
        """Note a problem if the logs of a source are too short for a formula, or lack one of its columns."""
        ahead = formula.looks_ahead_s
        most = source.base.duration_s
        if most < ahead < inf:
            self._problem(at, f"looks {ahead:g} s ahead, allowed over {source.given}: at most its {most:g} s")
        for column in sorted(formula.columns.difference(source.columns)) if source.columns else ():
            says = f"{column[:60]!r} is no column of {source.given}'s log{suggestion(column, source.columns)}"
            self._problem(at, says)

    def _expect(self, given: dict[str, Any], source: Source, at: Location) -> Expect | None:
        """The expectations, checked against the base scenario of a source; None if they have a mistake."""
        base = source.base
        data = base.model_dump(mode="json", by_alias=True, exclude_unset=True) | {"expect": given}
        lines = {("expect", *where): n for where, n in self._document.below(*at).lines.items()}
        try:
            with checked_against(base.airframe, base.aircraft):
                return validate_model(Scenario, Document(data, lines), "", None, conflicts).expect
        except ScenarioError as error:
            for one in error.problems:
                if one.location[:1] == ("expect",):
                    self._problem((*at, *one.location[1:]), one.says)
            return None
