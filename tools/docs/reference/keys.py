"""The keys of scenario, sweep, plan, aircraft and vehicle files: each as the schema has it that loads it.

keys.yaml has the pages (title, first words, kinds of files, next page) and links below headings of sections.
"""

import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path as File
from typing import Any, NamedTuple

import yaml

from beaver_ftc.aircraft import load
from beaver_ftc.aircraft.schema import AircraftFile
from beaver_ftc.plugins import DETECTORS, LAWS, options_of, registered
from beaver_ftc.scenario import actuators, sensors
from beaver_ftc.scenario.schema import json_schema
from beaver_ftc.scenario.sweeps import sweep_json_schema
from beaver_ftc.studies.present.tables import markdown_table
from beaver_ftc_assurance.evidence.plan import plan_json_schema
from beaver_ftc_logs.vehicle import Vehicle
from tools.docs.reference.schema import ITEM, NAME, Key, Node, Path, Place, Section, Sections, dotted

EXAMPLES = File(__file__).with_name("examples")  # a whole file of each kind
_PARTS = ("p", "q", "r", ITEM, NAME)  # of a path: below the key that they are parts of
_NAMED = {  # sections that stand in many places: heading, part
    "QuantityColumn": ("COLUMN", ""),
    "Level": ("LIMIT", "a rate"),
    "QuantileLevel": ("LIMIT", "a time or an error"),
}
_SURFACES = load().surfaces
_FEW = 6  # words of a key that shares its row
_HEAD = ("in", "key", "meaning", "value", "default")
_WORDS = {"string": "text", "boolean": "flag", "integer": "whole number", "number": "number"}


class Kind(NamedTuple):
    """A kind of file: the schema of what loads it, what else is said of it."""

    schema: Callable[[], Node]
    more: Callable[[], Iterator[str]] = lambda: iter(())


class Row(NamedTuple):
    """A key in the table of a section."""

    part: str  # the section below that of the table
    key: str
    says: str
    value: str
    default: str


def page(title: str, first: str, kinds: Iterable[str], after: str) -> str:
    """The page of one or several kinds of files."""
    parts = [f"# {title}", f"{first} {_READ}"]
    shown: dict[str, str] = {}  # title of a section -> heading under which its keys stand
    for name in kinds:
        parts += _kind(name, shown)
    text = "\n\n".join([*parts, f"## Next\n\n{after}"]) + "\n"
    return re.sub(r"\[([A-Z][A-Za-z]+\d{4}[^\]]*)\](?!\()", r"[[\1]](../REFERENCES.md)", text)


def _kind(name: str, shown: dict[str, str]) -> Iterator[str]:
    """The example, a table for each key at the top of the file, and what else is to be said."""
    kind, what, links = KINDS[name], name.removesuffix("-keys"), _TEXTS["links"].get(name, {})
    example = (EXAMPLES / f"{name}.yaml").read_text(encoding="utf-8")
    yield f"## {what.capitalize()} file\n\n```yaml\n{example}```"
    sections = Sections(kind.schema())
    groups: dict[str, list[Section]] = {}
    for section in sections:
        if section.title not in shown:
            heading = _heading(section)
            groups.setdefault(heading, []).append(section)
            shown[section.title] = heading
    for heading, members in groups.items():
        if heading:
            says = [" ".join(part.split()) for part in members[0].says.split("\n\n")]
            alone = heading in dict(_NAMED.values()) or sum(not _part(one) for one in members) == 1
            yield f"## {heading}"
            yield from says if alone else ()
            if link := links.get(heading.strip("`")):
                yield f"More: {link}."
        yield _table(list(_rows(heading, members, sections, shown)))
    yield from kind.more()


def _heading(section: Section) -> str:
    """The key at the top of the file, and whether it holds a list or names."""
    path = section.places[0].path
    if section.title in _NAMED:
        return _NAMED[section.title][0]
    of = " of a sensor" if any(key.name == "sensor" for key in section.keys) else ""
    top = dotted(path[: 2 if path[1:2] in ((ITEM,), (NAME,)) else 1])
    return f"`{top}`{of}" if top else ""


def _part(section: Section) -> str:
    """What a section is called below its heading."""
    if section.title in _NAMED:
        return _NAMED[section.title][1]
    if kind := _kind_of(section):
        return f"`{kind}`"
    first = section.places[0].path
    return ", ".join(
        dict.fromkeys(
            f"`{name}`"
            for place in section.places
            if place.path[:1] == first[:1] and (name := _below(place.path[1:]))
        )
    )


def _kind_of(section: Section) -> str:
    return next((key.choices[0] for key in section.keys if key.name == "type"), "")


def _below(path: Path) -> str:
    """The end of a path: after the last item or name in it, without one at its end."""
    while path and path[-1] in (ITEM, NAME):
        path = path[:-1]
    marks = [i for i, part in enumerate(path) if part in (ITEM, NAME)]
    names = ("SURFACE" if part in _SURFACES else part for part in path[marks[-1] + 1 if marks else 0 :])
    return dotted(tuple(names))


def _table(rows: list[Row]) -> str:
    """The rows; those that differ in section, in key, or in key and a few words alone are one."""
    first = 0 if any(row.part for row in rows) else 1
    every = list(dict.fromkeys(row.part for row in rows if row.part and row.value))
    for differ in (("part",), ("key",), ("key", "says")):
        alike: dict[Row, list[Row]] = {}
        for row in rows:
            same = row._replace(**dict.fromkeys(differ, ""))
            alike.setdefault(same if len(differ) == 1 or _is_short(row) else row, []).append(row)
        rows = [_joined(of, every) for of in alike.values()]
    return markdown_table(_HEAD[first:], [row[first:] for row in rows])


def _is_short(row: Row) -> bool:
    """Whether a few words describe one key."""
    return "" not in (row.value, row.says) and len(row.says.split()) <= _FEW and "," not in row.key + row.says


def _joined(rows: list[Row], every: list[str]) -> Row:
    parts, keys, says = (list(dict.fromkeys(cells)) for cells in list(zip(*rows, strict=True))[:3])
    return rows[0]._replace(part=_all_of(parts, every), key=", ".join(keys), says=", ".join(says))


def _all_of(names: list[str], every: list[str]) -> str:
    """Names of sections, or which of them all are not meant."""
    others = [name for name in every if name not in names]
    names = [name or "itself" for name in names] if len(names) > 1 else names
    if len(names) < 3 or len(others) >= len(names):
        return ", ".join(names)
    return f"all but {', '.join(others)}" if others else "all"


def _rows(
    heading: str, members: Iterable[Section], sections: Sections, shown: Mapping[str, str]
) -> Iterator[Row]:
    """Yield a row for each key of these sections."""
    for section in members:
        part = _part(section)
        for key in section.keys:
            if key.sections and section.title == "OfSweep":  # the keys of `expect`, as its text says
                continue
            if key.sections:
                yield _of_sections(heading, part, key, sections, shown)
            elif key.name == "type":
                yield Row(part, f"`type: {_kind_of(section)}`", _in_a_row(section.says), "", "required")
            else:
                yield _of_values(part, key, section)


def _of_sections(heading: str, part: str, key: Key, sections: Sections, shown: Mapping[str, str]) -> Row:
    """The row of a key that holds sections: what they are, and where their keys stand."""
    first = sections.found[key.sections[0]]
    where = shown[first.title]
    says = key.says
    if not heading and where.startswith(f"`{key.name}") and len(key.sections) == 1:  # its heading says it
        says = _in_a_row(says)
        says = says[says.index("Left out:") :] if "Left out:" in says else ""
    value = [*(f"`{word}`" for word in key.choices), _size(key)]
    if where != heading and (heading or where in dict(_NAMED.values())):
        value.append(f"[{where}](#{_slug(where)})")
    if unit := _unit_of_keys(first):
        value.append(f"UNIT `{unit}`, LIMIT {_limit(first)}")
    name = f"`{key.name}`" if heading else f"[`{key.name}`](#{_slug(where)})"
    return Row(part, name, _in_a_row(says), ", ".join(filter(None, value)), _default(key))


def _of_values(part: str, key: Key, section: Section) -> Row:
    """The row of a key with a value. A key that ends with the unit of its instrument stands for those of
    all."""
    units = dict.fromkeys(key.unit(place) for place in section.places)
    says = _in_a_row(key.says)
    says = next((says.removesuffix(end) for unit in units if says.endswith(end := f", {unit or 1}")), says)
    if isinstance(key.example, Mapping) and key.example:
        also = "".join(f", {name}: {in_a_line(value)}" for name, value in key.needs.items())
        says += f". *Example:* `{key.name}: {in_a_line(key.example)}{also}`"
    name, value = key.name, _value(key, section.places)
    if (unit := _unit_of_keys(section)) and name.endswith(f"_{unit}"):
        name = f"{name.removesuffix(unit)}UNIT"
        value = f"{value.replace(_limit(section), 'LIMIT').rpartition(' ')[0]} UNIT"
    return Row(part, f"`{name}`", says, value, _default(key))


def _unit_of_keys(section: Section) -> str:
    """The end of keys that is a unit, of an instrument."""
    noise = (key.name for key in section.keys if key.name.startswith("noise_std_"))
    return next((name.removeprefix("noise_std_") for name in noise), "")


def _limit(section: Section) -> str:
    return next(key.range.split()[-1] for key in section.keys if key.name.startswith("noise_std_"))


def _in_a_row(says: str) -> str:
    return " ".join(says.split()).replace("; left out: ", ". Left out: ").removesuffix(".")


def _value(key: Key, places: list[Place]) -> str:
    """What may stand there: kind of value, range, unit."""
    if key.choices:
        return ", ".join(f"`{in_a_line(choice)}`" for choice in dict.fromkeys(key.choices))
    kinds = " or ".join(dict.fromkeys(map(_kind_of_value, key.forms)))
    unit = _unit(key, places) if key.number else ""
    in_words = key.range[-1:].isalpha() or unit.startswith(("as ", "the "))
    limit = (", " if in_words else " ").join(filter(None, (key.range, unit)))
    if kinds == "number" and limit:
        return limit
    return ", ".join(filter(None, (kinds, limit, _size(key)))).replace("text, ≤", "text ≤")


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


def _size(key: Key) -> str:
    """How long a text, a list or a mapping may be."""
    for form in key.forms:
        if "maxLength" in form:
            return f"≤ {form['maxLength']}"
        of = "Items" if form.get("type") == "array" else "Properties"
        if f"max{of}" in form and "prefixItems" not in form:
            least = form.get(f"min{of}")
            return f"{f'{least} to ' if least else '≤ '}{form[f'max{of}']} entries"
    return ""


def _default(key: Key) -> str:
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


def _slug(heading: str) -> str:
    return re.sub(r"[^\w -]", "", heading.lower()).replace(" ", "-")


def _of_scenarios() -> Iterator[str]:
    """What a scenario may name: schemes and laws with their options, presets."""
    for group, what, where in ((DETECTORS, "scheme", "fdi"), (LAWS, "law", "control")):
        yield f"## {what.capitalize()}s, and their `{where}.options`"
        entries = [entry for entry in registered(group).values() if entry.package == "beaver-ftc"]
        yield markdown_table((what, "meaning"), [(f"`{one.name}`", one.description()) for one in entries])
        rows = [
            (f"`{one.name}`", f"`{name}`", of["says"], _option_range(of), f"`{of['default']:g}`")
            for one in entries
            for name, of in options_of(group, one.name).items()
        ]
        yield markdown_table((what, "option", "meaning", "value", "default"), rows)
    for what, presets in (("sensors", sensors.PRESETS), ("actuators", actuators.PRESETS)):
        yield f"## Presets of `{what}`"
        rows = [(f"`{name}`", *each) for name, of in presets.items() for each in _preset(of)]
        yield markdown_table(("preset", what, "values"), rows)


def _option_range(of: Mapping[str, Any]) -> str:
    kind = "whole number, " if of.get("whole") else ""
    return f"{kind}{of.get('low', 0):g} to {of['high']:g}"


def _preset(of: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """(instruments or surfaces, their values) of a preset."""
    if not all(isinstance(values, Mapping) for values in of.values()):
        of = {"all": of}
    alike: dict[str, list[str]] = {}
    for name, values in of.items():
        alike.setdefault(f"`{in_a_line(values)}`", []).append(f"`{name}`")
    yield from (
        ((", ".join(names), text) for text, names in alike.items()) if alike else (("all", "no error"),)
    )


_READ = "[How to read these tables](reference/README.md#tables-of-keys) explains the columns."
KINDS = {
    "scenario-keys": Kind(json_schema, _of_scenarios),
    "sweep-keys": Kind(sweep_json_schema),
    "plan-keys": Kind(plan_json_schema),
    "aircraft-keys": Kind(AircraftFile.model_json_schema),
    "vehicle-keys": Kind(Vehicle.model_json_schema),
}
_TEXTS = yaml.safe_load(File(__file__).with_suffix(".yaml").read_text(encoding="utf-8"))
PAGES: dict[str, tuple[Any, ...]] = {name: tuple(of.values()) for name, of in _TEXTS["pages"].items()}
