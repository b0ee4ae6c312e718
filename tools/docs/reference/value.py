"""What may stand as the value of a key, in words: kind, range, unit, size, default."""

from collections.abc import Iterable, Mapping
from typing import Any

import yaml

from tools.docs.reference.schema import ITEM, NAME, Key, Node, Place

_PARTS = ("p", "q", "r", ITEM, NAME)  # of a path: below the key that they are parts of
_WORDS = {"string": "text", "boolean": "flag", "integer": "whole number", "number": "number"}


def value_of(key: Key, places: list[Place]) -> str:
    """What may stand there: kind of value, range, unit."""
    if key.choices:
        return ", ".join(f"`{in_a_line(choice)}`" for choice in dict.fromkeys(key.choices))
    kinds = " or ".join(dict.fromkeys(map(_kind_of_value, key.forms)))
    unit = _unit(key, places) if key.number else ""
    in_words = key.range[-1:].isalpha() or unit.startswith(("as ", "the "))
    limit = (", " if in_words else " ").join(filter(None, (key.range, unit)))
    if kinds == "number" and limit:
        return limit
    return ", ".join(filter(None, (kinds, limit, size_of(key)))).replace("text, ≤", "text ≤")


def _kind_of_value(form: Node) -> str:
    if form.get("type") == "array" and "prefixItems" in form:
        return f"list of {len(form['prefixItems'])}"
    for kind, inside, words in (
        ("array", "items", "list of"),
        ("object", "additionalProperties", "mapping to"),
    ):
        if form.get("type") == kind:
            of = form.get(inside)
            forms = of["anyOf"] if isinstance(of, Mapping) and of else ({},)
            return f"{words} " + " or ".join(dict.fromkeys(map(_kind_of_value, forms)))
    return _WORDS.get(form.get("type", ""), "value")


def _unit(key: Key, places: list[Place]) -> str:
    """The unit of a key; of several, each with the names of what has it, the commonest one last."""
    names: dict[str, dict[str, None]] = {}
    for place in places:
        of = next((part for part in reversed(place.path) if part not in _PARTS), "")
        names.setdefault(key.unit(place) or "1", {})[of] = None
    usual = max(names, key=lambda unit: len(names[unit]))
    others = [f"{unit} for {_quoted(of)}" for unit, of in names.items() if unit != usual]
    if usual in ("1", "share of 1"):
        return ", ".join(others)
    return ", ".join([*others, f"otherwise {usual}"]) if others else usual


def _quoted(names: Iterable[str]) -> str:
    return " and ".join(f"`{name}`" for name in names)


def size_of(key: Key) -> str:
    """How long a text, a list or a mapping may be."""
    for form in key.forms:
        if "maxLength" in form:
            return f"≤ {form['maxLength']}"
        of = "Items" if form.get("type") == "array" else "Properties"
        if f"max{of}" in form and "prefixItems" not in form:
            least = form.get(f"min{of}")
            return f"{f'{least} to ' if least else '≤ '}{form[f'max{of}']} entries"
    return ""


def default_of(key: Key) -> str:
    if key.required:
        return "required"
    default = key.node.get("default")
    flat = not isinstance(default, Mapping) or not any(isinstance(one, Mapping) for one in default.values())
    return f"`{in_a_line(default)}`" if default not in (None, "", [], {}) and flat else ""


def in_a_line(value: Any) -> str:
    """A value as one line of YAML."""
    text = yaml.safe_dump(_short(value), default_flow_style=True, width=10_000, sort_keys=False)
    return text.removesuffix("\n").removesuffix("\n...")


def _short(value: Any) -> Any:
    """30 for 30.0."""
    if isinstance(value, Mapping):
        return {name: _short(one) for name, one in value.items()}
    if isinstance(value, list | tuple):
        return [_short(one) for one in value]
    return int(value) if isinstance(value, float) and value.is_integer() else value
