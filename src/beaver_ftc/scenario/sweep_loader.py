"""A sweep from its file: the base scenario made self-contained, every key tried on it before it flies."""

import contextlib
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ValidationError

from beaver_ftc.aircraft import Aircraft, load
from beaver_ftc.documents.base import Location
from beaver_ftc.documents.document import Document, Problem
from beaver_ftc.documents.keys import UnusableKeyError, parse_key, with_values
from beaver_ftc.documents.paths import data_root, inside
from beaver_ftc.documents.problems import ScenarioError, key_path
from beaver_ftc.documents.validation import validate
from beaver_ftc.scenario.airframe import checked_against
from beaver_ftc.scenario.builtin import (
    builtin_names,
    builtin_path,
    builtin_sweeps,
    looks_like_a_path,
    no_such,
)
from beaver_ftc.scenario.loader import load_scenario, parse_document, read_file
from beaver_ftc.scenario.schema import Scenario
from beaver_ftc.scenario.sweep_schema import SweepFile, Variation

_DERIVED = {"name": "follows from the sweep's name", "seed": "follows from the sweep's seed"}


@dataclass(frozen=True)
class Sweep:
    """A sweep ready to fly: the file's content and its base scenario's data, which names no other file.

    aircraft: the base's, found beside its file.
    """

    file: SweepFile
    base: dict[str, Any]
    aircraft: Aircraft = field(default_factory=load)

    @property
    def name(self) -> str:
        """Name of the result folder."""
        return self.file.name

    @property
    def flights(self) -> int:
        """Number of flights."""
        return self.file.flights

    @property
    def keys(self) -> tuple[str, ...]:
        """The dotted keys that vary."""
        return tuple(self.file.vary)

    def scenario(self, values: dict[str, Any], **settings: Any) -> Scenario:
        """The base with these values at these dotted keys, and these top-level settings.

        Raises pydantic's ValidationError if they contradict each other.
        """
        places = {parse_key(key): value for key, value in values.items()}
        varied = {place[0] for place in places}
        ready = {} if "aircraft" in varied else self._sections
        ready = {name: section for name, section in ready.items() if name not in varied}
        rest = {name: value for name, value in self.base.items() if name not in ready}
        with checked_against(self.aircraft, self.base.get("aircraft")):
            return Scenario.model_validate({**with_values(rest, places), **ready, **settings})

    @cached_property
    def _sections(self) -> dict[str, BaseModel]:
        """Sections of the base, read once for the flights that do not vary them; none if it cannot fly."""
        try:
            with checked_against(self.aircraft, self.base.get("aircraft")):
                base = Scenario.model_validate({"name": self.name, **self.base})
        except ValidationError:
            return {}
        return {
            name: section for name, section in base if name in self.base and isinstance(section, BaseModel)
        }


def load_sweep(path_or_name: str | Path) -> Sweep:
    """The sweep in a file or of a built-in name. Raises ScenarioError with one line a mistake."""
    path = resolve_sweep(path_or_name)
    text = read_file(path, str(path), "sweep")
    return load_sweep_text(text, source=str(path), folder=path.parent, name=path.stem)


def load_sweep_text(
    text: str, source: str = "<text>", folder: Path | None = None, name: str = "sweep"
) -> Sweep:
    """The sweep in a text; `folder` is where its base and CSV files are, `name` its name if it says none."""
    document = parse_document(text, source)
    keys = document.data.keys()
    if {"base", "vary", "runs"}.isdisjoint(keys) and keys <= Scenario.model_fields.keys():
        says = f"this is a scenario, allowed: a sweep file; `beaver-ftc run {source}` flies it"
        raise ScenarioError(source, [Problem(1, (), says)])
    document.data.setdefault("name", re.sub(r"[^A-Za-z0-9_-]", "-", name.removesuffix(".sweep"))[:70])
    return validate_sweep(document, source, folder)


def validate_sweep(document: Document, source: str = "", folder: Path | None = None) -> Sweep:
    """The sweep in a document; without a source its error lines begin with the key."""
    file = validate(SweepFile, document, source, folder)
    base, aircraft = _base(file.base, document, source, folder)
    with checked_against(aircraft, base.get("aircraft")):
        base, problems = _with_settings(base, file.set, document)
        problems = problems or [*_key_problems(base, file.vary, document)]
    if problems:
        raise ScenarioError(source, problems)
    return Sweep(file, base, aircraft)


def is_sweep(path_or_name: str | Path) -> bool:
    """Whether a file (or name) that can be read is a sweep: it has a `base`, as no scenario has."""
    path = resolve_sweep(path_or_name)
    try:
        return path.is_file() and "base" in parse_document(read_file(path, str(path)), str(path)).data
    except ScenarioError:
        return False


def resolve_sweep(path_or_name: str | Path) -> Path:
    """The file a built-in sweep's name stands for; anything else is a path already."""
    given = str(path_or_name)
    if not looks_like_a_path(given) and given in builtin_sweeps():
        return data_root() / "scenarios" / "sweeps" / f"{given}.yaml"
    return Path(path_or_name)


def _base(
    base: str | dict[str, Any], document: Document, source: str, folder: Path | None
) -> tuple[dict[str, Any], Aircraft]:
    """The base scenario's data as its author wrote it, but with the tables of its CSV files in it."""
    if isinstance(base, dict):
        return _self_contained(base, _inline(document, source, folder))
    path = _base_path(base, document, source, folder)
    return _self_contained(parse_document(read_file(path, base), str(path)).data, load_scenario(path))


def _base_path(base: str, document: Document, source: str, folder: Path | None) -> Path:
    if not looks_like_a_path(base) and base in builtin_names():
        return builtin_path(base)
    path = inside(folder or Path(), base)
    if path is None:
        allowed = "a file in the sweep's own folder or below it, or a built-in scenario"
        says = f"{base[:100]!r} is outside, allowed: {allowed}"
        raise ScenarioError(source, [Problem(document.line(("base",)), ("base",), says)])
    with contextlib.suppress(OSError):  # a name no file can have
        if path.is_file():
            return path
    says = f"no such file: {base[:100]!r}, allowed: a scenario file"
    says = says if looks_like_a_path(base) else no_such(base, "scenario")
    raise ScenarioError(source, [Problem(document.line(("base",)), ("base",), says)])


def _inline(document: Document, source: str, folder: Path | None) -> Scenario:
    lines = {at[1:]: line for at, line in document.lines.items() if at[:1] == ("base",)}
    document.data["base"].setdefault("name", document.data["name"])
    try:
        return validate(Scenario, Document(document.data["base"], lines), source, folder)
    except ScenarioError as error:
        raise ScenarioError(source, [_moved(problem, ("base",)) for problem in error.problems]) from None


def _moved(problem: Problem, below: Location) -> Problem:
    return Problem(problem.line, (*below, *problem.location), problem.says)


def _self_contained(data: dict[str, Any], scenario: Scenario) -> tuple[dict[str, Any], Aircraft]:
    reference = scenario.model_dump(mode="json", include={"reference"}, exclude_unset=True)
    return {"name": scenario.name, **data, **reference}, scenario.airframe


def _with_settings(
    base: dict[str, Any], settings: dict[str, Any], document: Document
) -> tuple[dict[str, Any], list[Problem]]:
    """The base with the file's `set` applied one by one, and what is wrong with that."""
    problems: list[Problem] = []
    changed = base
    for key, value in settings.items():
        at: Location = ("set", key)
        try:
            changed = with_values(changed, {_usable(key): value})
        except UnusableKeyError as error:
            problems.append(Problem(document.line(at), at, str(error)))
    if settings and not problems:
        mistakes = _mistakes(changed, "set", list(settings))
        problems = [Problem(document.line(at), at, says) for at, says in mistakes]
    return changed, problems


def _usable(key: str) -> Location:
    location = parse_key(key)
    if key in _DERIVED:
        raise UnusableKeyError(f"cannot be chosen: it {_DERIVED[key]}")
    return location


def _key_problems(base: dict[str, Any], vary: dict[str, Variation], document: Document) -> Iterator[Problem]:
    """Every varied key tried alone on the base, at each of its probes."""
    places: dict[Location, str] = {}
    for key, how in vary.items():
        at: Location = ("vary", key)
        for says in dict.fromkeys([*_overlap(key, places), *_refusals(base, key, how)]):
            yield Problem(document.line(at), at, says)


def _overlap(key: str, places: dict[Location, str]) -> Iterator[str]:
    try:
        location = parse_key(key)
    except UnusableKeyError:
        return
    for other, name in places.items():
        shorter = min(len(other), len(location))
        if other[:shorter] == location[:shorter]:
            yield f"is varied twice, allowed: either it or {name}"
    places[location] = key


def _refusals(base: dict[str, Any], key: str, how: Variation) -> Iterator[str]:
    for probe in how.probes():
        try:
            changed = with_values(base, {_usable(key): probe})
        except UnusableKeyError as error:
            yield str(error)
            return
        yield from (says for _, says in _mistakes(changed, "vary", [key]))


def _mistakes(data: dict[str, Any], section: str, keys: list[str]) -> Iterator[tuple[Location, str]]:
    """(place in the sweep file, what is wrong) for a changed base: at the key that changed it."""
    try:
        validate(Scenario, Document(data), "base")
    except ScenarioError as error:
        for problem in error.problems:
            path = key_path(problem.location)
            key = next((key for key in keys if path == key or path.startswith((f"{key}.", f"{key}["))), None)
            says = problem.says if path == key else f"{path}: {problem.says}"
            yield (section, key or keys[0]), says
