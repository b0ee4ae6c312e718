"""What is wrong with a value, and what is allowed, in words.

What is allowed is read from the JSON Schema, the same text an editor shows, so the two cannot disagree.
"""

import re
from collections.abc import Iterator, Sequence
from difflib import get_close_matches
from typing import Any, NamedTuple

from pydantic import ValidationError

from beaver_ftc.documents.document import Document, Location, Problem, has
from beaver_ftc.documents.errors import hint, nearest
from beaver_ftc.documents.report import SHOWN_CHARACTERS, one_line


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
    return one_line(f"{given:g}" if isinstance(given, float) else repr(given), SHOWN_CHARACTERS)


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
