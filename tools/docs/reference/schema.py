"""The keys of a kind of file, read from the JSON Schema of what loads it: sections, and in each its keys."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from math import ceil, floor
from typing import Any

from beaver_ftc.results.units import unit_of
from tools.schema import Node, inlined

Path = tuple[str, ...]
NAME, ITEM = "NAME", "[]"  # in a path: any name, an item of a list
NUMBERS = ("number", "integer")
PURE = ("1", "")  # units of what has none


def dotted(path: Path) -> str:
    """A path as a page has it: `faults[].at_s`."""
    return ".".join(path).replace(f".{ITEM}", ITEM)


@dataclass(frozen=True)
class Place:
    """Where a section stands, and the unit that is declared there for all that is in it."""

    path: Path
    unit: str = ""


@dataclass(frozen=True)
class Key:
    """One key of a section; forms: the schema of each kind of value it takes, null left out."""

    name: str
    node: Node
    forms: tuple[Node, ...]
    required: bool
    sections: tuple[str, ...]  # titles of the sections below it

    @property
    def scalars(self) -> tuple[Node, ...]:
        """The schemas of single values, in lists and mappings too."""
        return tuple(one for form in self.forms for one in _innermost(form))

    @property
    def number(self) -> Node | None:
        """The schema of the numbers that may stand here, if any."""
        return next((one for one in self.scalars if one.get("type") in NUMBERS and "enum" not in one), None)

    @property
    def says(self) -> str:
        """What it means."""
        kind = "name of this type" if self.name == "type" else ""
        return next((one["description"] for one in (self.node, *self.forms) if "description" in one), kind)

    @property
    def range(self) -> str:
        """The range of its numbers in words; empty where there is none."""
        said = (one["range"] for one in (self.node, *self.forms, *self.scalars) if "range" in one)
        return next(said, None) or (limits(self.number) if self.number else "")

    @property
    def choices(self) -> tuple[Any, ...]:
        """The values that may stand here, where they are few."""
        each = (one.get("enum", [one["const"]] if "const" in one else []) for one in self.scalars)
        return (*(choice for choices in each for choice in choices), *self.words)

    @property
    def words(self) -> tuple[Any, ...]:
        """The words that may stand in place of a section."""
        branches = (one for form in self.forms if "properties" in form for one in form.get("anyOf", ()))
        return tuple(word for one in branches for word in one.get("enum", ()))

    def unit(self, place: Place) -> str:
        """Of its numbers: as declared, or as declared of the section, or read off the name."""
        said = [one["unit"] for one in (self.node, *self.scalars) if "unit" in one]
        return (said or [place.unit or _read_off((*place.path, self.name))])[0]

    @property
    def example(self) -> Any:
        """A value to show: as declared, or another choice than the default, or the default; None is none."""
        return next(self._examples(), None)

    @property
    def needs(self) -> Mapping[str, Any]:
        """The keys beside it that the example wants."""
        return self.node.get("needs", {})

    def _examples(self) -> Iterator[Any]:
        """Values that may stand there, the best example first."""
        default = self.node.get("default")
        for one in (self.node, *self.forms):
            yield from one.get("examples", ())
        yield from (choice for choice in self.choices if choice != default and not self.sections)
        if any(form.get("type") == "boolean" for form in self.forms):
            yield not default
        if self.number and default:
            yield default


@dataclass
class Section:
    """A mapping of a file: what it is, where it stands, its keys."""

    title: str
    says: str
    keys: tuple[Key, ...]
    places: list[Place] = field(default_factory=list)


class Sections:
    """Every section of a schema, by its title, in the order in which a reader meets them."""

    def __init__(self, schema: Node) -> None:
        self.found: dict[str, Section] = {}
        self._meet(schema["title"], inlined(schema), Place(()))

    def __iter__(self) -> Iterator[Section]:
        return iter(self.found.values())

    def _meet(self, title: str, node: Node, place: Place) -> None:
        keys = node["properties"].items()
        if title not in self.found:
            required = node.get("required", ())
            made = tuple(self._key(name, of, name in required) for name, of in keys)
            self.found[title] = Section(title, node.get("description", ""), made)
        self.found[title].places.append(place)
        for name, of in keys:
            for below in _below(of, (*place.path, name)):
                self._meet(*below[1:], Place(below[0], of.get("unit", "") or place.unit))

    def _key(self, name: str, node: Node, required: bool) -> Key:
        sections = tuple(dict.fromkeys(title for _, title, _ in _below(node, ())))
        return Key(name, node, tuple(_forms(node)), required, sections)


def _forms(node: Node) -> Iterator[Node]:
    """What may stand here."""
    if branches := _branches(node):
        for branch in branches:
            yield from _forms(branch)
    elif node.get("type") != "null":
        inner = {key: {"anyOf": [*_forms(of)]} for key, of in _inner(node)}
        yield {**node, **inner}


def _below(node: Node, path: Path) -> Iterator[tuple[Path, str, Node]]:
    """(path, title, schema) of each section in what may stand here."""
    if node.get("properties"):
        yield path, node["title"], node
    else:
        for branch in _branches(node):
            yield from _below({"title": node.get("title"), **branch}, path)
        for key, of in _inner(node):
            yield from _below(of, (*path, ITEM if key == "items" else NAME))


def _branches(node: Node) -> list[Node]:
    return [*node.get("anyOf", ()), *node.get("oneOf", ())]


def _inner(node: Node) -> Iterator[tuple[str, Node]]:
    """The schemas of the items of a list, of the values of a mapping with names of one's own."""
    for key in ("items", "additionalProperties"):
        if isinstance(node.get(key), Mapping) and not node.get("properties"):
            yield key, node[key]
    for of in node.get("patternProperties", {}).values():
        yield "additionalProperties", of


def _innermost(node: Node) -> Iterator[Node]:
    inner = [of for _, of in _inner(node)] + list(node.get("prefixItems", ()))
    inner = [branch for one in inner for branch in one.get("anyOf", [one])]
    if not inner:
        yield node
    for one in inner:
        yield from _innermost(one)


def _read_off(path: Path) -> str:
    unit = unit_of(".".join(path))
    return "" if unit in PURE else unit


def limits(node: Node) -> str:
    """The range of a number in words; empty where it has none."""
    least, most = (node.get(name, node.get(short)) for name, short in (("minimum", "ge"), ("maximum", "le")))
    above, below = node.get("exclusiveMinimum"), node.get("exclusiveMaximum")
    low = f"({shown(above)}" if above is not None else "" if least is None else _inward(least, ceil)
    high = f"{shown(below)})" if below is not None else "" if most is None else _inward(most, floor)
    if not low or not high:
        words = ((above, ">"), (least, "≥"), (below, "<"), (most, "≤"))
        return "".join(f"{sign} {shown(value)}" for value, sign in words if value is not None)
    if above is None and below is None:
        return f"{low} to {high}"
    return f"{low if above is not None else f'[{low}'}, {high if below is not None else f'{high}]'}"


def _inward(limit: float, towards: Callable[[float], int]) -> str:
    """A limit that was converted to another unit is rounded towards the inside of the range."""
    text = shown(limit)
    many = len(text.lstrip("-").replace(".", "")) > 5 and "." in text and "e" not in text
    return shown(towards(limit * 100.0) / 100.0) if many else text


def shown(value: float) -> str:
    """A number without trailing noise."""
    if value == 2**63 - 1:
        return "2^63 - 1"
    return str(value) if isinstance(value, int) else f"{value:.6g}"
