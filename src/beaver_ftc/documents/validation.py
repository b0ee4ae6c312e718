"""From a text to a model: every mistake at once, one line each, at its line in the file.

A line is `FILE:LINE: key.path: what is wrong, what is allowed`. What is allowed is read from the JSON
Schema, the same text an editor shows, so the two cannot disagree. A dotted key such as
`faults[0].magnitude` is a place in the data.
"""

import re
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from difflib import get_close_matches
from functools import lru_cache
from itertools import islice
from os import PathLike
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

from pydantic import BaseModel, ValidationError

from beaver_ftc.documents.document import (
    MAX_PROBLEMS,
    Conflict,
    Document,
    Location,
    MalformedDocumentError,
    Problem,
    copied,
    has,
    parse,
)
from beaver_ftc.documents.errors import BadInput, hint, nearest
from beaver_ftc.documents.files import AbsentFileError, UnreadableError, read_text

WHOLE_FILE = "(file)"
_SHOWN = 48
MIN_ALIKE_TO_COUNT = 3  # mistakes of one kind in one list, from which on they share a line


class ScenarioError(BadInput):
    """A file that cannot be used; `str` is one line a mistake, `problems` the mistakes.

    What comes from no file has an empty source: its lines begin with the key.
    """

    def __init__(self, source: str, problems: Sequence[Problem]) -> None:
        self.source = source
        self.problems = _in_order(problems)
        super().__init__("\n".join(self.lines))

    def below(self, source: str, *at: int | str) -> "ScenarioError":
        """The same mistakes in a document of this source, of which what was read stands at these keys; those
        of another file as they are."""
        if self.source != source:
            return self
        return ScenarioError(source, [replace(one, location=(*at, *one.location)) for one in self.problems])

    @property
    def lines(self) -> tuple[str, ...]:
        alike: dict[Any, list[Problem]] = {}
        for problem in self.problems:
            alike.setdefault(_list_and_allowed(problem), []).append(problem)
        return tuple(line for problems in alike.values() for line in self._lines_of_alike(problems))

    def _lines_of_alike(self, problems: list[Problem]) -> list[str]:
        """A line each; one line for many of one list, as in a matrix of which no number is allowed."""
        if len(problems) < MIN_ALIKE_TO_COUNT:
            return [self._line(problem) for problem in problems]
        return [f"{self._line(problems[0])} (and {len(problems) - 1} more of this list)"]

    def _line(self, problem: Problem) -> str:
        """file:line: key: what; of a file as a whole file: what."""
        file, says = one_line(self.source, 4096), one_line(problem.says, 2000)
        if file and not problem.line:
            return f"{file}: {says}"
        return (f"{file}:{problem.line}: " if file else "") + f"{key_path(problem.location)}: {says}"

    def __reduce__(self) -> tuple[Any, ...]:
        return (type(self), (self.source, self.problems))


def _list_and_allowed(problem: Problem) -> tuple[Any, ...]:
    """What entries of one list that are wrong alike have in common: one line is about all of them."""
    location = problem.location
    while location and isinstance(location[-1], int):
        location = location[:-1]
    if location == problem.location:
        return (problem,)
    return problem.line, location, problem.says.rpartition(", allowed: ")[2]


def _in_order(problems: Sequence[Problem]) -> tuple[Problem, ...]:
    """By line, each once; after the first MAX_PROBLEMS a word that there are more."""
    distinct = list(dict.fromkeys(sorted(problems, key=lambda problem: problem.line)))
    if len(distinct) <= MAX_PROBLEMS:
        return tuple(distinct)
    more = Problem(distinct[MAX_PROBLEMS].line, (), f"has more than {MAX_PROBLEMS} mistakes, allowed: none")
    return (*distinct[:MAX_PROBLEMS], more)


def key_path(location: Location) -> str:
    """('faults', 0, 'at_s') -> faults[0].at_s"""
    parts = (
        f"[{part}]" if isinstance(part, int) else f".{one_line(part, _SHOWN) or '(empty)'}"
        for part in location
    )
    return "".join(parts).removeprefix(".") or WHOLE_FILE


def one_line(text: str, longest: int) -> str:
    """Text fit for one line of a terminal: control characters escaped, length bounded."""
    shown = "".join(
        c if c.isprintable() else c.encode("unicode_escape", "replace").decode() for c in text[:longest]
    )
    return shown if len(text) <= longest else f"{shown}..."


def problems_of(error: ValidationError, document: Document, schema: dict[str, Any]) -> Iterator[Problem]:
    """The mistakes in a document's data, each at its line."""
    details = [of for of in error.errors(include_url=False) if not _is_short_of_good_items(of)]
    places = [_in_document(of["loc"], document.data, of["type"] == "missing") for of in details]
    for detail, at in _of_branches_meant(list(zip(details, places, strict=True))):
        for where, said in _said_of(detail, at, document.data, schema):
            unknown_key, meant = said.unknown_key, said.meant
            yield Problem(document.line(where), where, said.text, unknown_key=unknown_key, meant=meant)


def _is_short_of_good_items(detail: Any) -> bool:
    """Whether a list is long enough, but for its items with mistakes, which pydantic does not count."""
    return detail["type"] == "too_short" and len(detail["input"]) >= detail["ctx"]["min_length"]


class _Said(NamedTuple):
    """What is said of a mistake, and what follows from it: nothing follows from the words."""

    text: str
    unknown_key: bool = False
    meant: str | None = None  # what was meant, if something known is near


def _said_of(
    detail: Any, at: Location, data: Any, schema: dict[str, Any]
) -> Iterator[tuple[Location, _Said]]:
    """What is said of one of pydantic's errors, and where."""
    context, kind = detail.get("ctx", {}), detail["type"]
    if kind == "conflict":
        for below, says in context["conflicts"]:
            yield _in_document((*at, *below), data), _Said(says)
    elif kind == "unknown_keys":
        for key in context["unknown"]:
            yield _in_document((*at, key), data), _unknown_key(str(key), context["known"])
    elif kind == "union_tag_not_found" and (near := _near_miss_of_type(detail["input"])):
        yield (*at, near), _unknown_key(near, ["type"])
    else:
        yield (*at, "type") if kind.startswith("union_tag") else at, _says(detail, at, data, schema)


def _unknown_key(key: str, known: Sequence[str]) -> _Said:
    near = nearest(key, known, cutoff=0.5)
    return _Said(f"unknown key{hint(near, known)}", True, near)


def _of_branches_meant(located: list[tuple[Any, Location]]) -> Iterator[tuple[Any, Location]]:
    """Mistakes without those that say a value is of another type than one branch of a union wants, where
    another branch has found more in it."""
    told = {at[:n] for _, at in located for n in range(len(at))}
    told |= {at for detail, at in located if not detail["type"].endswith(_WRONG_TYPE)}
    return (each for each in located if each[1] not in told or not each[0]["type"].endswith(_WRONG_TYPE))


def _near_miss_of_type(given: Any) -> str:
    """The key that was meant to be `type`, if there is one."""
    keys = [key for key in given if isinstance(key, str)] if isinstance(given, dict) else []
    return next(iter(get_close_matches("type", keys, n=1)), "")


def _in_document(loc: Location, data: Any, is_missing: bool = True) -> Location:
    """Pydantic's location without the steps it adds for itself (a union's branch, an expanded preset).

    is_missing: its last step is a key even where the data does not have it.
    """
    location: list[int | str] = []
    for i, part in enumerate(loc):
        if has(data, part):
            location.append(part)
            data = data[part]
        elif is_missing and i == len(loc) - 1 and isinstance(data, dict):
            location.append(part)
    return tuple(location)


def _says(detail: Any, location: Location, data: Any, schema: dict[str, Any]) -> _Said:
    kind, given = detail["type"], detail["input"]
    if kind == "extra_forbidden":
        return _unknown_key(str(location[-1]), _keys(_at(schema, location[:-1], data)))
    here = _at(schema, location, data)
    if kind == "missing" and isinstance(detail["loc"][-1], int):
        return _Said(f"too few items, allowed: {_allowed(here)}")
    if kind in ("missing", "union_tag_not_found"):
        types = [tag for node in here for tag in _types(node)] if kind != "missing" else []
        return _Said(f"required key is missing, allowed: {', '.join(types) or _allowed(here)}")
    if kind in ("literal_error", "enum", "union_tag_invalid"):
        return _not_one_of(detail, given, here)
    near = nearest(given, map(str, _choices(here))) if isinstance(given, str) else None
    if near:
        return _Said(f"{_shown(given)} is not known{hint(near, [_allowed(here)])}", meant=near)
    items = ", each begun with `- `" if kind in _NO_LIST and isinstance(given, dict) else ""
    return _Said(f"{_wrong(detail, given)}, allowed: {_allowed(here)}{items}")


_NO_LIST = ("list_type", "tuple_type")


def _not_one_of(detail: Any, given: Any, here: list[dict[str, Any]]) -> _Said:
    if detail["type"] == "union_tag_invalid":
        given, allowed = detail["ctx"]["tag"], [tag for node in here for tag in _types(node)]
        near = nearest(str(given), allowed)
    else:
        choices = list(map(str, _choices(here)))
        allowed = choices or [detail["ctx"]["expected"]]
        near = nearest(given, choices) if isinstance(given, str) else None
    return _Said(f"{_shown(given)} is not known{hint(near, allowed)}", meant=near)


_WRONG_TYPE = ("_type", "_parsing")
_TYPES = {bool: "a truth value", dict: "a mapping", list: "a list", str: "text"}
_SAYS = {
    "is out of range": ("greater_than", "greater_than_equal", "less_than", "less_than_equal"),
    "is too long": ("too_long", "string_too_long"),
    "is too short": ("too_short", "string_too_short"),
    "is not finite": ("finite_number",),
    "has characters that are not allowed": ("string_pattern_mismatch",),
}


def _wrong(detail: Any, given: Any) -> str:
    kind, shown = detail["type"], _shown(given)
    if kind == "too_short" and not given:
        return f"{shown} is empty"
    for says, kinds in _SAYS.items():
        if kind in kinds:
            return f"{shown} {says}"
    if kind.endswith(_WRONG_TYPE):
        return "has no value" if given is None else f"{shown} is {_TYPES.get(type(given), 'a number')}"
    return one_line(f"{shown}: {detail['msg']}", 300)


def _shown(given: Any) -> str:
    if isinstance(given, dict | list | tuple):
        return "this"
    if given is None or isinstance(given, bool):
        return {None: "nothing", True: "true", False: "false"}[given]
    if isinstance(given, int) and abs(given) >= 10**15:
        return "a whole number this large"
    return one_line(f"{given:g}" if isinstance(given, float) else repr(given), _SHOWN)


def _at(schema: dict[str, Any], location: Location, data: Any) -> list[dict[str, Any]]:
    """The schemas a location may have: one, or the branches of a union that fit what the data says it is."""
    nodes = _branches(schema, schema, data)
    for part in location:
        data = data[part] if has(data, part) else None
        below = [child for node in nodes for child in _children(node, part)]
        nodes = [branch for node in below for branch in _branches(node, schema, data)]
    return nodes


def _children(node: dict[str, Any], part: int | str) -> Iterator[dict[str, Any]]:
    if isinstance(part, int):
        prefix = node.get("prefixItems", [])
        yield from prefix[part : part + 1] or ([node["items"]] if isinstance(node.get("items"), dict) else [])
    elif part in node.get("properties", {}):
        yield node["properties"][part]
    elif isinstance(node.get("additionalProperties"), dict):
        yield node["additionalProperties"]
    else:  # a mapping whose keys are names
        yield from node.get("patternProperties", {}).values()


def _branches(node: dict[str, Any], root: dict[str, Any], data: Any) -> list[dict[str, Any]]:
    """The node with references and unions resolved; a union on `type` by the data's own type."""
    if "$ref" in node:
        target = root["$defs"][node["$ref"].rsplit("/", 1)[-1]]
        around = {key: value for key, value in node.items() if key != "$ref"}
        return _branches({**target, **around}, root, data)
    mapping = _types(node)
    tag = data.get("type") if isinstance(data, dict) else None
    if mapping and isinstance(tag, str) and tag in mapping:
        return _branches({"$ref": mapping[tag]}, root, data)
    union = node.get("anyOf") or node.get("oneOf")
    if not union or mapping:
        return [node]
    inherited: dict[str, Any] = {key: node[key] for key in ("description", "unit") if key in node}
    fitting = [branch for branch in union if _fits(branch, root, data)] or union
    return [b for branch in fitting for b in _branches({**inherited, **branch}, root, data)]


def _fits(branch: dict[str, Any], root: dict[str, Any], data: Any) -> bool:
    """Whether a branch of the faults' union is meant: instruments by `sensor`, surfaces by the lack of it."""
    targets = list(_types(branch).values())
    if not targets or not isinstance(data, dict):
        return True
    return ("sensor" in root["$defs"][targets[0].rsplit("/", 1)[-1]]["properties"]) == ("sensor" in data)


def _keys(nodes: list[dict[str, Any]]) -> list[str]:
    return list(dict.fromkeys(key for node in nodes for key in node.get("properties", {})))


def _types(node: dict[str, Any]) -> dict[str, str]:
    """Where the schema of each `type` is, of a node that has several."""
    types: dict[str, str] = node.get("discriminator", {}).get("mapping", {})
    return types


def _choices(nodes: list[dict[str, Any]]) -> list[Any]:
    return [
        choice for node in nodes for choice in node.get("enum", [node["const"]] if "const" in node else [])
    ]


def _allowed(nodes: list[dict[str, Any]]) -> str:
    kinds = list(dict.fromkeys(_kind(node) for node in nodes if node.get("type") != "null"))
    says = next((node["description"] for node in nodes if {"unit", "description"} <= node.keys()), "")
    meaning = f" ({says})" if says and len(kinds) == 1 else ""
    return " or ".join(kinds) + meaning if kinds else "see `beaver-ftc schema`"


def _kind(node: dict[str, Any]) -> str:
    if choices := _choices([node]) or list(_types(node)):
        return f"{'a mapping of type ' if 'discriminator' in node else ''}{', '.join(map(str, choices))}"
    keys = ", ".join(_keys([node])) or "names to values"
    kinds = {
        "number": f"a number{_range(node)}",
        "integer": f"a whole number{_range(node)}",
        "boolean": "true or false",
        "array": f"a list{_length(node, 'Items', 'items')}",
        "string": f"text{_pattern(node)}{_length(node, 'Length', 'characters')}",
        "object": f"a mapping of {keys}{_length(node, 'Properties', 'entries')}",
    }
    return str(kinds.get(node.get("type", ""), node.get("description", "another value")))


def _range(node: dict[str, Any]) -> str:
    above, below = node.get("exclusiveMinimum"), node.get("exclusiveMaximum")
    low, high = node.get("minimum", above), node.get("maximum", below)
    if low is not None and high is not None:
        ends = f"below {high:g}" if below is not None else _bound(high)
        up = "and " if below is not None else "up to "
        return f" over {low:g} {up}{ends}" if above is not None else f" from {low:g} to {ends}"
    if low is not None:
        return f" over {low:g}" if above is not None else f" of at least {low:g}"
    return "" if high is None else f" of at most {high:g}"


def _bound(value: float) -> str:
    return str(value) if isinstance(value, int) else f"{value:g}"


def _pattern(node: dict[str, Any]) -> str:
    """What a text may be made of: the last set of characters of its pattern, and its ending."""
    pattern = node.get("pattern", "")
    classes = re.findall(r"\[((?:\\.|[^\]\\])+)\]", pattern)
    if not classes:
        return ""
    *others, last = sorted(set(re.sub(r"A-Z|a-z|0-9|\\", "", classes[-1])))
    ending = re.search(r"\\(\.[a-z]+)\$$", pattern)
    ends = f" that ends in {ending[1]}" if ending else ""
    return f" of letters, digits, {', '.join(others)} and {last}{ends}"


def _length(node: dict[str, Any], suffix: str, unit: str) -> str:
    low, high = node.get(f"min{suffix}"), node.get(f"max{suffix}")
    if low is not None and low == high:
        return f" of {low} {unit}"
    if low and high is not None:
        return f" of {low} to {high} {unit}"
    if low:
        return " that is not empty" if low == 1 else f" of at least {low} {unit}"
    return f" of at most {high} {unit}" if high is not None else ""


_PART = re.compile(r"(?:^|\.)([^.\[\]]+)|\[(\d{1,6})\]")
_IDEAL = "ideal"  # the preset that stands for a section with nothing in it


class UnusableKeyError(ValueError):
    """The key is none, or the data has no such place; the message says what is allowed."""


@lru_cache(maxsize=1024)  # a sweep asks for the same few again for each flight
def parse_key(key: str) -> Location:
    """'faults[0].magnitude' -> ('faults', 0, 'magnitude'). Raises UnusableKeyError."""
    parts = [(name or int(index)) for name, index in _PART.findall(key)] if isinstance(key, str) else []
    if not parts or key_path(tuple(parts)) != key:
        raise UnusableKeyError("is no dotted key, allowed: keys like faults[0].magnitude")
    return tuple(parts)


def with_values(data: dict[str, Any], values: dict[Location, Any]) -> dict[str, Any]:
    """A copy of the data with these values in these places; sections that are missing are made."""
    changed = copied(data)
    for location, value in values.items():
        _put(changed, location, copied(value))
    return changed


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


def _put(data: Any, location: Location, value: Any) -> None:
    *above, last = location
    here = data
    for depth, part in enumerate(above):
        here = _below(here, part, location[: depth + 1])
    if isinstance(here, list):
        _check_index(here, last, location)
    elif not isinstance(here, dict) or not isinstance(last, str):
        raise UnusableKeyError(f"{key_path(tuple(above))} has no such part, allowed: a key of the base")
    here[last] = value


def _below(here: Any, part: int | str, location: Location) -> Any:
    """The section one step down, made where it is missing or left to its empty preset."""
    if isinstance(here, list):
        _check_index(here, part, location)
    elif isinstance(here, dict) and isinstance(part, str):
        if here.get(part) in (None, _IDEAL):
            here[part] = {}
    else:
        raise UnusableKeyError(f"{key_path(location)} is not there, allowed: a key of the base")
    if not isinstance(here[part], dict | list):
        raise UnusableKeyError(f"{key_path(location)} is a single value, allowed: to vary it as a whole")
    return here[part]


def _check_index(here: list[Any], part: int | str, location: Location) -> None:
    if not isinstance(part, int) or part >= len(here):
        allowed = f"allowed: [0] to [{len(here) - 1}]" if here else "allowed: no index, the list is empty"
        raise UnusableKeyError(f"the base has no {key_path(location)}, {allowed}")


_Model = TypeVar("_Model", bound=BaseModel)


@lru_cache
def _schema(model: type[BaseModel]) -> dict[str, Any]:
    return model.model_json_schema()


def parse_document(text: str, source: str, keys: str = "the keys of `beaver-ftc schema`") -> Document:
    """The text's one mapping; `keys` says what it should hold. Raises ScenarioError."""
    try:
        document = parse(text)
    except MalformedDocumentError as error:
        raise ScenarioError(source, [error.problem]) from None
    if not isinstance(document.data, dict):
        says = "is empty" if document.data is None else "is not a mapping"
        problem = Problem(document.line(()), (), f"{says}, allowed: a mapping with {keys}", no_mapping=True)
        raise ScenarioError(source, [*document.problems, problem])
    return document


def text_of(path: Path | str, most_bytes: int, if_absent: Callable[[], str] | None = None) -> str:
    """A file's text. if_absent: what to say where there is no such file. Raises ScenarioError."""
    try:
        return read_text(path, most_bytes)
    except UnreadableError as error:
        says = if_absent() if if_absent and isinstance(error, AbsentFileError) else str(error)
        raise ScenarioError(str(path), [Problem(error.line, (), says)]) from None


def read_file(
    model: type[_Model], path: Path, most_bytes: int, keys: str = "the keys of `beaver-ftc schema`"
) -> _Model:
    """A file as a model. Raises ScenarioError with one line a mistake."""
    return validate(model, parse_document(text_of(path, most_bytes), str(path), keys), str(path))


def _all_of(
    error: ValidationError, model: type[BaseModel], document: Document, folder: Path | None
) -> list[Problem]:
    """The mistakes that an error names, and those that show once unknown keys and types are as meant."""
    found: list[Problem] = []
    known: set[Location] = set()
    while True:
        seen = islice(problems_of(error, document, _schema(model)), MAX_PROBLEMS)
        more = [problem for problem in seen if problem.location not in known]
        found += more
        known.update(problem.location for problem in more)
        mended = _repaired(document, more, known)
        if mended is None or len(found) >= MAX_PROBLEMS:
            return found
        try:
            model.model_validate(mended.data, context={"folder": folder})
        except ValidationError as hidden:
            document, error = mended, hidden
        else:
            return found


def _repaired(document: Document, problems: Iterable[Problem], known: set[Location]) -> Document | None:
    """The document with unknown keys and types as they were meant, or without; None if none is unknown.

    A mistyped key or type hides what else is wrong in its section: nothing there can be held against a
    schema. known: gets the keys that were renamed: a value given to another key is not to be judged by this
    one.
    """
    data, lines, changed = copied(document.data), dict(document.lines), False
    for problem in problems:
        section, key = _place(data, problem.location)
        if section is None:
            continue
        if problem.unknown_key:
            value = section.pop(key)
            if problem.meant and problem.meant not in section:
                section[problem.meant] = value
                renamed = (*problem.location[:-1], problem.meant)
                known.add(renamed)
                lines |= _moved(lines, problem.location, renamed)
            changed = True
        elif problem.meant and key == "type":
            section[key], changed = problem.meant, True
    return replace(document, data=data, lines=lines) if changed else None


def _place(data: Any, location: Location) -> tuple[dict[str, Any] | None, Any]:
    """The mapping that a location ends in and the key there; None where the data has no such place."""
    section, key = None, None
    for key in location:
        if not has(data, key):
            return None, key
        section, data = data, data[key]
    return section if isinstance(section, dict) else None, key


def _moved(lines: dict[Location, int], old: Location, new: Location) -> dict[Location, int]:
    depth = len(old)
    return {(*new, *at[depth:]): line for at, line in lines.items() if at[:depth] == old}


def validate(
    model: type[_Model],
    document: Document,
    source: str,
    folder: Path | None = None,
    conflicts_in: Callable[[dict[str, Any]], Iterable[Conflict]] = lambda data: (),
) -> _Model:
    """The document's data as a model. Raises ScenarioError with all mistakes, duplicate keys included.

    A model looks for contradictions between its sections once each is right in itself; `conflicts_in` finds
    them in data that is not.
    """
    problems, instance = list(document.problems), None
    try:
        instance = model.model_validate(document.data, context={"folder": folder})
    except ValidationError as error:
        problems += _all_of(error, model, document, folder)
        known = {problem.location for problem in problems}
        hidden = [(at, says) for at, says in conflicts_in(document.data) if at not in known]
        problems += [Problem(document.line(at), at, says) for at, says in hidden]
    if problems or instance is None:
        raise ScenarioError(source, problems)
    return instance
