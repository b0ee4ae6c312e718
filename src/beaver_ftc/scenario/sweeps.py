"""The sweep file: a base scenario, what varies in it, and what the statistics must show.

Loaded, its base is self-contained, and every key has been tried on it before it flies.
"""

import contextlib
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import Field, ValidationError, model_validator

from beaver_ftc.aircraft import Aircraft, load
from beaver_ftc.documents.document import (
    Conflict,
    Document,
    Location,
    Number,
    Problem,
    Section,
    Whole,
    deny,
    entry,
    number,
    refuse,
)
from beaver_ftc.documents.dotted import UnusableKeyError, parse_key, with_values
from beaver_ftc.documents.files import inside
from beaver_ftc.documents.report import ScenarioError, key_path
from beaver_ftc.documents.validation import parse_document, validate
from beaver_ftc.scenario.airframe import checked_against
from beaver_ftc.scenario.builtin import (
    builtin_names,
    builtin_path,
    looks_like_a_path,
    no_such,
    read_file,
    resolve,
)
from beaver_ftc.scenario.schema import NAME_PATTERN, Scenario, load_scenario

MAX_RUNS = 10_000_000
Sampling = Literal["random", "grid", "lhs", "sobol"]
KINDS = ("uniform", "loguniform", "normal", "linspace", "choice")
COUNTED = ("linspace", "choice")  # kinds with a finite number of values: what a grid is made of

Span = tuple[Number, Number]

_DERIVED = {"name": "follows from the sweep's name", "seed": "follows from the sweep's seed"}


class Variation(Section):
    """How one key varies: exactly one of these kinds.

    uniform: [lowest, highest]: equally likely values
    loguniform: [lowest, highest]: equally likely logarithms
    normal: [mean, standard deviation] of a normal distribution
    within: [lowest, highest] of `normal`
    linspace: [first, last, count]: evenly spaced values, flown in this order
    choice: equally likely values
    """

    uniform: Span | None = number(None, "as the key", range="rising", examples=[[0.2, 0.8]])
    loguniform: Span | None = number(None, "as the key", range="rising, above 0", examples=[[0.05, 0.5]])
    normal: Span | None = number(None, "as the key", range="the second above 0", examples=[[0.4, 0.1]])
    within: Span | None = number(
        None, "as the key", range="rising", needs={"normal": [0.4, 0.1]}, examples=[[0.2, 0.6]]
    )
    linspace: tuple[Number, Number, Annotated[Whole, Field(ge=1, le=1_000_000)]] | None = number(
        None, "as the key", range="any two, a count of 1 to 1000000", examples=[[0.2, 0.8, 4]]
    )
    choice: tuple[Any, ...] | None = entry(None, min_length=1, max_length=100_000, examples=[[0.2, 0.4, 0.8]])

    @model_validator(mode="after")
    def _makes_sense(self) -> Self:
        given = sum(getattr(self, kind) is not None for kind in KINDS)
        if given != 1:
            deny(f"{given} kinds of variation, allowed: exactly one of {', '.join(KINDS)}")
        refuse(self._conflicts())
        return self

    def _conflicts(self) -> Iterator[Conflict]:
        for key in ("uniform", "loguniform", "within"):
            span = getattr(self, key)
            if span and span[0] >= span[1]:
                yield (key,), "out of order, allowed: [lowest, highest]"
        if self.loguniform and self.loguniform[0] <= 0:
            yield ("loguniform",), "has no logarithm, allowed: a lowest value over 0"
        if self.within and not self.normal:
            yield ("within",), "has no meaning here, allowed: only with normal"
        if self.normal and self.normal[1] <= 0:
            yield ("normal",), "a spread of zero or less, allowed: [mean, standard deviation over 0]"

    @property
    def kind(self) -> str:
        """Which of KINDS it is."""
        return next(kind for kind in KINDS if getattr(self, kind) is not None)

    @property
    def count(self) -> int | None:
        """How many values there are; None for a continuous kind."""
        if self.linspace is not None:
            return self.linspace[2]
        return None if self.choice is None else len(self.choice)

    def probes(self) -> tuple[Any, ...]:
        """Values at which the base is tried when the file is read: the ends, or every choice."""
        if self.choice is not None:
            return self.choice
        if self.normal is not None:
            return (self.normal[0], *(self.within or ()))
        span = self.uniform or self.loguniform or self.linspace
        assert span is not None
        return span[:2]


class Level(Section):
    """The estimate must meet the limit, or with `confidence` its one-sided confidence bound.

    at_least: smallest allowed value
    at_most: largest allowed value
    confidence: confidence of the one-sided bound
    """

    at_least: Number | None = entry(None, range="any", examples=[0.9])
    at_most: Number | None = entry(None, range="any", examples=[0.1])
    confidence: Number | None = number(
        None, "share of 1", ge=0.5, lt=1, needs={"at_least": 0.9}, examples=[0.95]
    )

    @model_validator(mode="after")
    def _bounds_something(self) -> Self:
        if self.at_least is None and self.at_most is None:
            deny("bounds nothing, allowed: at_least, at_most or both")
        return self


class QuantileLevel(Level):
    """A limit for a quantile over the flights. Without `confidence`, the estimate must meet the limit. With
    `confidence`, its one-sided confidence bound must meet the limit: the lower bound for `at_least`, the
    upper bound for `at_most`.

    at_least: smallest allowed value
    at_most: largest allowed value
    confidence: confidence of the one-sided bound
    """

    at_least: Number | None = entry(None, range="any", examples=[0.01])
    at_most: Number | None = entry(None, range="any", examples=[1])
    confidence: Number | None = number(
        None, "share of 1", ge=0.5, lt=1, needs={"at_most": 1}, examples=[0.95]
    )

    quantile: Number = number(
        0.95,
        "share of 1",
        "quantile that must meet the limit",
        gt=0,
        lt=1,
        needs={"at_most": 1},
    )


class AxisLevels(Section):
    """One limit for each axis."""

    p: QuantileLevel | None = entry(None, "limit for roll")
    q: QuantileLevel | None = entry(None, "limit for pitch")
    r: QuantileLevel | None = entry(None, "limit for yaw")


class SweepExpect(Section):
    """Conditions on the statistics of a sweep. A condition that is left out is not checked.

    detection_rate: share of detected faults
    isolation_rate: share of rightly named faults
    false_alarms_per_hour: false alarms in each hour without a fault
    departure_rate: share of lost aircraft
    failure_rate: share of flights that failed
    pass_rate: share of flights that met every expectation
    detection_delay_s: time from the fault to the alarm, infinite for a missed fault
    isolation_delay_s: time from the fault to the correct name, infinite for a missing or wrong name
    post_fault_rms_deg_s: RMS tracking error after the fault, infinite for a lost aircraft
    tracking_ratio: its ratio to that before the fault
    """

    detection_rate: Level | None = number(None, "share of 1")
    isolation_rate: Level | None = number(None, "share of 1")
    false_alarms_per_hour: Level | None = number(None, "1/h")
    departure_rate: Level | None = number(None, "share of 1")
    failure_rate: Level | None = number(None, "share of 1")
    pass_rate: Level | None = number(None, "share of 1")
    detection_delay_s: QuantileLevel | None = None
    isolation_delay_s: QuantileLevel | None = None
    post_fault_rms_deg_s: AxisLevels | None = None
    tracking_ratio: AxisLevels | None = number(None, "1")


class SweepFile(Section, title="beaver-ftc sweep"):
    """Many flights: a base scenario, the keys that vary, and the conditions that the statistics must meet.

    name: name of the result folder: letters, digits, - and _
    description: purpose of the sweep
    base: scenario that is varied: a built-in name, a file, or its keys
    set: new values of keys of the base, the same in all flights
    runs: number of flights, which cuts or repeats a grid; left out: one for each point of the grid
    seed: seed of all random values of the sweep
    sampling: how values are drawn. `lhs` (Latin hypercube) and `sobol` fill the ranges more evenly. `grid`:
    all combinations of `linspace` and `choice`
    vary: keys of the base that vary, and how each key varies. A key is written as in `set`. Where `sensors`
    or `actuators` vary, the designer knows those of the base, unless `design_model` has them. Unknown errors
    of servos are keys of `uncertainty.actuators`
    expect: conditions that the statistics must meet
    """

    name: str = entry(..., pattern=NAME_PATTERN, max_length=70, examples=["loss-of-the-elevator"])
    description: str = entry("", max_length=2000, examples=["Which losses are detected?"])
    base: str | dict[str, Any] = entry(..., examples=["elevator-partial-loss"])
    set: dict[str, Any] = entry(dict, examples=[{"duration_s": 20}])
    runs: Whole | None = entry(None, ge=1, le=MAX_RUNS, examples=[100])
    seed: Whole = entry(1, ge=0, le=2**63 - 1)
    sampling: Sampling = "random"
    vary: dict[str, Variation] = entry(dict, max_length=200)
    expect: SweepExpect = entry(SweepExpect)

    @model_validator(mode="after")
    def _parts_fit_together(self) -> Self:
        refuse(self._conflicts())
        return self

    @property
    def grid_size(self) -> int:
        """Number of points gone through in turn: of the `linspace` keys, and in a grid of all keys."""
        size = 1
        for how in self.vary.values():
            if how.linspace is not None or self.sampling == "grid":
                size *= how.count or 1
        return size

    @property
    def flights(self) -> int:
        """Number of flights."""
        return self.grid_size if self.runs is None else self.runs

    def _conflicts(self) -> Iterator[Conflict]:
        for key, how in self.vary.items():
            if self.sampling == "grid" and how.count is None:
                yield ("vary", key), f"cannot be counted, allowed in a grid: {', '.join(COUNTED)}"
        size = self.grid_size
        if self.runs is None and size > MAX_RUNS:
            yield ("vary",), f"a grid of {size} points, allowed: at most {MAX_RUNS}"
        if self.runs is None and size == 1:
            yield ("runs",), "required key is missing, allowed: the number of flights (only a grid gives it)"


def sweep_json_schema() -> dict[str, Any]:
    """The JSON Schema of a sweep file, for editors."""
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **SweepFile.model_json_schema()}


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
        ready = self._base_read.sections_beside(values) if self._base_read else {}
        with checked_against(self.aircraft, self.base.get("aircraft")):
            return Scenario.model_validate({**self.data_with(values), **ready, **settings})

    def data_with(self, values: dict[str, Any]) -> dict[str, Any]:
        """The data of the base with these values at these dotted keys."""
        data = with_values(self.base, {parse_key(key): value for key, value in values.items()})
        return _with_known_parts(data, self.base, self.keys)

    @cached_property
    def _base_read(self) -> Scenario | None:
        """The base, read once for the flights that do not vary all of it; None if it cannot fly."""
        with checked_against(self.aircraft, self.base.get("aircraft")), contextlib.suppress(ValidationError):
            return Scenario.model_validate({"name": self.name, **self.base})
        return None


def load_sweep(path_or_name: str | Path) -> Sweep:
    """The sweep in a file or of a built-in name. Raises ScenarioError with one line a mistake."""
    path = resolve(path_or_name, "sweep")
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
    return Sweep(file, _with_known_parts(base, base, file.vary), aircraft)


def _with_known_parts(data: dict[str, Any], base: dict[str, Any], vary: Iterable[str]) -> dict[str, Any]:
    """The data of the base or of a flight. Where `sensors` or `actuators` vary, the designer knows those of
    the base, unless `design_model` of the data has its own."""
    varied = sorted({"actuators", "sensors"} & {parse_key(key)[0] for key in vary})
    known = {part: base.get(part, "ideal") for part in varied}
    said = {key: value for key, value in (data.get("design_model") or {}).items() if value is not None}
    return {**data, "design_model": known | said} if varied else data


def _base(
    base: str | dict[str, Any], document: Document, source: str, folder: Path | None
) -> tuple[dict[str, Any], Aircraft]:
    """The base scenario's data as its author wrote it, but with the tables of its CSV files in it."""
    if isinstance(base, dict):
        return _self_contained(base, _inline(document, source, folder))
    path = _base_path(base, document, source, folder)
    return _self_contained(parse_document(read_file(path, base), str(path)).data, load_scenario(path))


def _base_path(base: str, document: Document, source: str, folder: Path | None) -> Path:
    if base in builtin_names():
        return builtin_path(base)
    path = inside(folder or Path(), base)
    if path is None:
        allowed = "a file in the sweep's own folder or below it, or a built-in scenario"
        says = f"{base[:100]!r} is outside, allowed: {allowed}"
    elif looks_like_a_path(base):
        says = f"no such file: {base[:100]!r}, allowed: a scenario file"
    else:
        says = no_such(base, "scenario")
    with contextlib.suppress(OSError):  # a name no file can have
        if path and path.is_file():
            return path
    raise ScenarioError(source, [Problem(document.line(("base",)), ("base",), says)])


def _inline(document: Document, source: str, folder: Path | None) -> Scenario:
    base = document.below("base")
    base.data.setdefault("name", document.data["name"])
    try:
        return validate(Scenario, base, source, folder)
    except ScenarioError as error:
        raise error.below(source, "base") from None


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
    with contextlib.suppress(UnusableKeyError):
        location = parse_key(key)
        for other, name in places.items():
            if all(one == same for one, same in zip(location, other, strict=False)):
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
