"""The keys of scenario, sweep, plan, aircraft and vehicle files: each as the schema has it that loads it.

keys.yaml has the pages (title, first words, kinds of files, next page) and links below headings of sections.
"""

import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path as File
from typing import Any, NamedTuple

from beaver_ftc.aircraft import load
from beaver_ftc.aircraft.schema import AircraftFile
from beaver_ftc.scenario.schema import json_schema
from beaver_ftc.scenario.sweeps import sweep_json_schema
from beaver_ftc.studies.present.tables import markdown_table
from beaver_ftc_assurance.evidence.plan import plan_json_schema
from beaver_ftc_logs.vehicle import Vehicle
from tools.data import beside
from tools.docs.reference.options import options_and_presets
from tools.docs.reference.schema import ITEM, NAME, Key, Node, Path, Section, Sections, dotted
from tools.docs.reference.value import default_of, in_a_line, size_of, value_of

EXAMPLES = File(__file__).with_name("examples")  # a whole file of each kind
_NAMED = {  # sections that stand in many places: heading, part
    "QuantityColumn": ("COLUMN", ""),
    "Level": ("LIMIT", "a rate"),
    "QuantileLevel": ("LIMIT", "a time or an error"),
}
_SURFACES = load().surfaces
_FEW = 6  # words of a key that shares its row
_HEAD = ("in", "key", "meaning", "value", "default")


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
    value = [*(f"`{word}`" for word in key.choices), size_of(key)]
    if where != heading and (heading or where in dict(_NAMED.values())):
        value.append(f"[{where}](#{_slug(where)})")
    if unit := _unit_of_keys(first):
        value.append(f"UNIT `{unit}`, LIMIT {_limit(first)}")
    name = f"`{key.name}`" if heading else f"[`{key.name}`](#{_slug(where)})"
    return Row(part, name, _in_a_row(says), ", ".join(filter(None, value)), default_of(key))


def _of_values(part: str, key: Key, section: Section) -> Row:
    """The row of a key with a value. A key that ends with the unit of its instrument stands for those of
    all."""
    units = dict.fromkeys(key.unit(place) for place in section.places)
    says = _in_a_row(key.says)
    says = next((says.removesuffix(end) for unit in units if says.endswith(end := f", {unit or 1}")), says)
    if isinstance(key.example, Mapping) and key.example:
        also = "".join(f", {name}: {in_a_line(value)}" for name, value in key.needs.items())
        says += f". *Example:* `{key.name}: {in_a_line(key.example)}{also}`"
    name, value = key.name, value_of(key, section.places)
    if (unit := _unit_of_keys(section)) and name.endswith(f"_{unit}"):
        name = f"{name.removesuffix(unit)}UNIT"
        value = f"{value.replace(_limit(section), 'LIMIT').rpartition(' ')[0]} UNIT"
    return Row(part, f"`{name}`", says, value, default_of(key))


def _unit_of_keys(section: Section) -> str:
    """The end of keys that is a unit, of an instrument."""
    noise = (key.name for key in section.keys if key.name.startswith("noise_std_"))
    return next((name.removeprefix("noise_std_") for name in noise), "")


def _limit(section: Section) -> str:
    return next(key.range.split()[-1] for key in section.keys if key.name.startswith("noise_std_"))


def _in_a_row(says: str) -> str:
    return " ".join(says.split()).replace("; left out: ", ". Left out: ").removesuffix(".")


def _slug(heading: str) -> str:
    return re.sub(r"[^\w -]", "", heading.lower()).replace(" ", "-")


_READ = "[How to read these tables](reference/README.md#tables-of-keys) explains the columns."
KINDS = {
    "scenario-keys": Kind(json_schema, options_and_presets),
    "sweep-keys": Kind(sweep_json_schema),
    "plan-keys": Kind(plan_json_schema),
    "aircraft-keys": Kind(AircraftFile.model_json_schema),
    "vehicle-keys": Kind(Vehicle.model_json_schema),
}
_TEXTS = beside(__file__)
PAGES: dict[str, tuple[Any, ...]] = {name: tuple(of.values()) for name, of in _TEXTS["pages"].items()}
