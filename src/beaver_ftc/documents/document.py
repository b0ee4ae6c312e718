"""What a file holds: sections (frozen, strict about their keys, without coercion of values), and before them
plain data that remembers the line of each value.

The plain data is built from libyaml's event stream, so nothing but mappings, lists, texts, numbers, truth
values and null can come out, and a hostile file is stopped while it is read: nesting, size and alias
expansion are bounded. No library does that: PyYAML's composer, whose nodes have lines too, ends the
process by recursion; ruamel.yaml's bounds none of them, and takes twenty times as long.

Anchors and aliases are read, because repeating a value by name is what YAML users do, but what they expand
to counts towards the bound: an alias bomb ends at MAX_NODES. Merge keys (`<<`) and tags are not read.
Numbers are read as YAML 1.2 and everybody's eyes do: 1e-3 is a number, 12:30 and 012 are not.
"""

import re
import sys
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from os import PathLike
from typing import Annotated, Any, NamedTuple, NoReturn

import yaml
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, Strict
from pydantic_core import PydanticCustomError

from beaver_ftc.documents.errors import split_docstring

Location = tuple[int | str, ...]
Conflict = tuple[Location, str]


class Section(BaseModel):
    """A part of a file (scenario, aircraft, model): immutable, strict about its keys, finite in its numbers.

    Lines `name: text` at the end of a section's docstring become the descriptions of its fields in the JSON
    schema, which editors show.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    def __init_subclass__(cls, **given: Any) -> None:
        super().__init_subclass__(**given)
        cls.__doc__, says = split_docstring(cls.__doc__, cls.__annotations__)
        for name, text in says.items():
            cls.__annotations__[name] = Annotated[cls.__annotations__[name], Field(description=text)]


def _whole(value: Any) -> Any:
    """1e4 and 2.0 are accepted as whole numbers."""
    return int(value) if isinstance(value, float) and value.is_integer() else value


Number = Annotated[float, Strict()]
Whole = Annotated[int, Strict(), BeforeValidator(_whole)]
Flag = Annotated[bool, Strict()]


def entry(default: Any, says: str | None = None, **limits: Any) -> Any:
    """A field and its description in the JSON schema.

    default: a value, a function that makes one, or ... where the key must be given. says: the description,
    where the section's docstring has none. limits: those of pydantic, and unit; examples, each a value;
    range, a text where limits do not say it; needs, other keys that the example requires.
    """
    how = "default_factory" if callable(default) else "default"
    said: dict[str, Any] = {"description": says} if says else {}
    if shown := {key: limits.pop(key) for key in ("unit", "range", "needs") if key in limits}:
        said["json_schema_extra"] = shown
    return Field(**{how: default}, **said, **limits)


def number(default: Any, unit: str, says: str | None = None, **limits: Any) -> Any:
    """A field of one number, or several alike: the JSON Schema has their unit and meaning."""
    return entry(default, says and f"{says}, {unit}", unit=unit, **limits)


def refuse(conflicts: Iterable[Conflict]) -> None:
    """Raise if values that are each fine contradict one another; every conflict keeps its own location."""
    if found := list(conflicts):
        raise PydanticCustomError("conflict", "contradictory values", {"conflicts": found})


def refuse_unknown(keys: Iterable[Any], known: Iterable[str]) -> None:
    """Raise if there are keys of a mapping that are none of those known."""
    if unknown := list(keys):
        raise PydanticCustomError("unknown_keys", "unknown keys", {"unknown": unknown, "known": list(known)})


def deny(says: str, *at: int | str) -> NoReturn:
    """Raise what is wrong with a value, or with what is below it at these keys."""
    raise PydanticCustomError("conflict", "contradictory values", {"conflicts": [(at, says)]})


def order_conflicts(start_s: float, end_s: float | None, start_key: str) -> list[Conflict]:
    """The conflict of an end that does not come after its start."""
    if end_s is None or end_s > start_s:
        return []
    return [(("end_s",), f"{end_s:g} is not after {start_key}, allowed: later than {start_s:g} s")]


MAX_NODES = 400_000
MAX_DEPTH = 32
MAX_PROBLEMS = 100
_LONGEST_NUMBER = 400

_LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
_INTEGER = re.compile(r"[-+]?(0|[1-9][0-9_]*)")
_FLOAT = re.compile(r"[-+]?([0-9][0-9_]*(\.[0-9_]*)?|\.[0-9][0-9_]*)([eE][-+]?[0-9]+)?")
_TOO_DEEP = f"nested too deeply, allowed: {MAX_DEPTH} levels"
_LEADING_ZERO = re.compile(r"[-+]?0[0-9_]+")
_WORDS = {
    **dict.fromkeys(("", "~", "null", "Null", "NULL"), None),
    **dict.fromkeys(("true", "True", "TRUE", "yes", "Yes", "YES", "on", "On", "ON"), True),
    **dict.fromkeys(("false", "False", "FALSE", "no", "No", "NO", "off", "Off", "OFF"), False),
    **dict.fromkeys((".nan", ".NaN", ".NAN"), float("nan")),
    **dict.fromkeys((".inf", ".Inf", ".INF", "+.inf", "+.Inf", "+.INF"), float("inf")),
    **dict.fromkeys(("-.inf", "-.Inf", "-.INF"), float("-inf")),
}


@dataclass(frozen=True)
class Problem:
    """One mistake: the line it is on, where in the document, what is wrong and what is allowed."""

    line: int
    location: Location
    says: str
    unknown_key: bool = field(default=False, compare=False)  # the last key of the location is no key there
    meant: str | None = field(default=None, compare=False)  # the key or value that was meant, if one is near
    no_mapping: bool = field(default=False, compare=False)  # the whole document is nothing with keys


class MalformedDocumentError(Exception):
    """The text is no YAML document that can be read on; carries the one problem that stopped it."""

    def __init__(self, problem: Problem) -> None:
        super().__init__(problem.says)
        self.problem = problem


def has(data: Any, part: int | str) -> bool:
    """Whether plain data has such a part: a key of a mapping, a place in a list."""
    if isinstance(data, dict):
        return part in data
    return isinstance(data, list) and isinstance(part, int) and part < len(data)


def copied(data: Any) -> Any:
    """A copy of mappings and lists all the way down; for plain data several times faster than deepcopy."""
    if isinstance(data, dict):
        return {key: copied(value) for key, value in data.items()}
    return [copied(value) for value in data] if isinstance(data, list) else data


def plain(value: Any) -> Any:
    """Mappings, lists and numbers as a YAML file would give them: no NumPy, no tuples, no models."""
    if isinstance(value, BaseModel):
        return value.model_dump(mode="json", by_alias=True, exclude_unset=True)
    if isinstance(value, Mapping):
        return {key: plain(entry) for key, entry in value.items()}
    numpy = sys.modules.get("numpy")  # which nobody has an array of who has not imported it
    if numpy and isinstance(value, numpy.ndarray | numpy.generic):
        return plain(value.tolist())
    if isinstance(value, list | tuple):
        return [plain(entry) for entry in value]
    return str(value) if isinstance(value, PathLike) else value


@dataclass
class Document:
    """Plain data, the line of each value by location, and the mistakes that did not stop the reading."""

    data: Any = None
    lines: dict[Location, int] = field(default_factory=dict)
    problems: list[Problem] = field(default_factory=list)

    def line(self, location: Location) -> int:
        """The line of a location, or of the nearest thing around it that the file does contain."""
        while location not in self.lines and location:
            location = location[:-1]
        return self.lines.get(location, 1)

    def below(self, *at: int | str) -> "Document":
        """What stands at these keys as a document by itself, with the lines it has here."""
        data = self.data
        for part in at:
            data = data[part]
        lines = {where[len(at) :]: n for where, n in self.lines.items() if where[: len(at)] == at}
        return Document(data, lines)


def parse(text: str) -> Document:
    """Read one YAML document.

    Raises MalformedDocumentError; mistakes that leave the rest readable are in `.problems`.
    """
    try:
        return _Builder(text).build()
    except yaml.YAMLError as error:
        raise MalformedDocumentError(Problem(_error_line(error, text), (), _error_text(error))) from None


def first_text(text: str, key: str) -> str:
    """The text of a key at the top of a YAML mapping, read no further than that; empty where it has none.

    Raises MalformedDocumentError for a text that is no YAML up to there.
    """
    depth, name = 0, None  # of the key whose value is next
    try:
        for event in yaml.parse(text, _LOADER):
            if depth == 1 and isinstance(event, yaml.ScalarEvent):
                if name == key:
                    return str(event.value)
                name = event.value if name is None else None
            elif depth == 1 and isinstance(event, yaml.CollectionStartEvent):
                name = None
            depth += isinstance(event, yaml.CollectionStartEvent) - isinstance(event, yaml.CollectionEndEvent)
        return ""
    except yaml.YAMLError as error:
        raise MalformedDocumentError(Problem(_error_line(error, text), (), _error_text(error))) from None


def _error_line(error: yaml.YAMLError, text: str) -> int:
    mark = getattr(error, "problem_mark", None) or getattr(error, "context_mark", None)
    if mark is not None:
        return mark.line + 1
    position = getattr(error, "position", None)
    return 1 if position is None else 1 + text.encode()[:position].count(b"\n")


def _error_text(error: yaml.YAMLError) -> str:
    reason = getattr(error, "problem", None) or getattr(error, "reason", None) or "not readable"
    if "maximum nesting depth" in reason:  # PyYAML from 6.0.4 on has a limit of its own
        return _TOO_DEEP
    if "cannot start any token" in reason:
        reason += " (a tab, or a character that wants quotes?)"
    context = getattr(error, "context", None)
    where = f"{context}: " if context else ""
    return f"is not YAML: {where}{reason}, allowed: one YAML mapping indented with spaces"


def scalar(text: str) -> Any:
    """A plain scalar: null, truth value, number, or the text itself."""
    if text in _WORDS:
        return _WORDS[text]
    if len(text) > _LONGEST_NUMBER or _LEADING_ZERO.fullmatch(text):
        return text  # a leading zero is octal in YAML 1.1, decimal in 1.2: nobody's number
    if _INTEGER.fullmatch(text):
        return int(text.replace("_", ""))
    return float(text.replace("_", "")) if _FLOAT.fullmatch(text) else text


class _Anchored(NamedTuple):
    """What an anchor names: the value, how many values it is when written out, and how deep."""

    value: Any
    nodes: int
    depth: int


class _Builder:
    """Turns the event stream into a Document."""

    def __init__(self, text: str) -> None:
        self.document = Document()
        self._events = yaml.parse(text, _LOADER)
        self._anchors: dict[str, _Anchored] = {}
        self._nodes = 0

    def build(self) -> Document:
        for event in self._events:
            if isinstance(event, yaml.DocumentStartEvent) and self._nodes:
                raise _malformed(event, "a second document starts here, allowed: one a file")
            if isinstance(event, yaml.NodeEvent):
                self.document.data = self._value(event, ())
        return self.document

    def _value(self, event: Any, location: Location) -> Any:
        """One value with all that is below it. Recursion is bounded by MAX_DEPTH."""
        before = self._nodes
        self._count(1, event)
        self.document.lines.setdefault(location, _line(event))
        if isinstance(event, yaml.AliasEvent):
            return self._alias(event, location)
        if event.tag is not None and event.tag != "!":
            raise _malformed(event, f"tag {event.tag} is not read, allowed: plain values", location)
        value = self._content(event, location)
        if event.anchor is not None:
            self._anchors[event.anchor] = _Anchored(value, self._nodes - before, _depth(value))
        return value

    def _content(self, event: Any, location: Location) -> Any:
        if isinstance(event, yaml.ScalarEvent):
            return scalar(event.value) if event.implicit[0] else event.value
        if len(location) >= MAX_DEPTH:
            raise _malformed(event, _TOO_DEEP)
        return self._mapping(location) if isinstance(event, yaml.MappingStartEvent) else self._list(location)

    def _list(self, location: Location) -> list[Any]:
        items: list[Any] = []
        while not isinstance(event := next(self._events), yaml.SequenceEndEvent):
            items.append(self._value(event, (*location, len(items))))
        return items

    def _mapping(self, location: Location) -> dict[str, Any]:
        mapping: dict[str, Any] = {}
        key_lines: dict[str, int] = {}
        while not isinstance(event := next(self._events), yaml.MappingEndEvent):
            key = self._key(event, location)
            below, line = (*location, key), _line(event)
            if key in mapping:
                self._duplicate(line, below, key_lines[key])
                continue
            key_lines[key] = self.document.lines[below] = line
            mapping[key] = self._value(next(self._events), below)
        return mapping

    def _duplicate(self, line: int, location: Location, first: int) -> None:
        """Note it, and read past its value."""
        says = f"duplicate key, first on line {first}, allowed: each key once"
        if len(self.document.problems) < MAX_PROBLEMS:
            self.document.problems.append(Problem(line, location, says))
        self._value(next(self._events), (*location, "(duplicate)"))

    def _key(self, event: yaml.Event, location: Location) -> str:
        if not isinstance(event, yaml.ScalarEvent):
            raise _malformed(event, "a key is not plain text, allowed: key: value", location)
        if event.value == "<<":
            raise _malformed(event, "merge keys are not read, allowed: the keys themselves", location)
        self._count(1, event)
        return event.value

    def _alias(self, event: yaml.AliasEvent, location: Location) -> Any:
        if event.anchor not in self._anchors:
            says = f"alias *{event.anchor} has no complete anchor before it, allowed: the value itself"
            raise _malformed(event, says, location)
        anchored = self._anchors[event.anchor]
        self._count(anchored.nodes, event)
        if len(location) + anchored.depth > MAX_DEPTH:
            raise _malformed(event, _TOO_DEEP)
        return anchored.value

    def _count(self, nodes: int, event: yaml.Event) -> None:
        self._nodes += nodes
        if self._nodes > MAX_NODES:
            says = f"the file holds or its aliases expand to too many values, allowed: at most {MAX_NODES}"
            raise _malformed(event, says)


def _depth(value: Any) -> int:
    """Levels of lists and mappings in a value that is itself no deeper than MAX_DEPTH."""
    if not isinstance(value, dict | list):
        return 0
    return 1 + max(map(_depth, value.values() if isinstance(value, dict) else value), default=0)


def _malformed(event: yaml.Event, says: str, location: Location = ()) -> MalformedDocumentError:
    return MalformedDocumentError(Problem(_line(event), location, says))


def _line(event: Any) -> int:
    return event.start_mark.line + 1
