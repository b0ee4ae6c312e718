"""The keys of scenario, sweep, plan, aircraft and vehicle files: each as the schema has it that loads it."""

import re
from collections.abc import Callable, Iterator, Mapping
from typing import Any, NamedTuple

import yaml

from beaver_ftc.aircraft.schema import AircraftFile
from beaver_ftc.plugins import DETECTORS, LAWS, options_of, registered
from beaver_ftc.scenario import airframe, sensors
from beaver_ftc.scenario.schema import json_schema
from beaver_ftc.scenario.sweeps import sweep_json_schema
from beaver_ftc.studies.present.tables import markdown_table
from beaver_ftc_assurance.evidence.plan import plan_json_schema
from beaver_ftc_logs.vehicle import Vehicle
from tools.docs.reference.schema import Key, Node, Place, Section, Sections, dotted

HEAD = ("key", "what it is", "type", "unit", "range", "default", "example")
_TYPES = {"string": "text", "boolean": "true or false", "integer": "whole number", "number": "number"}
_HOLDING = ("array", "items", "list of"), ("object", "additionalProperties", "mapping of names to")
_PLURALS = {"text": "texts", "choice": "choices", "whole number": "whole numbers", "number": "numbers"}


class Kind(NamedTuple):
    """A kind of file: the schema of what loads it, and what to say first."""

    schema: Callable[[], Node]
    title: str
    says: str
    more: Callable[[], Iterator[str]] = lambda: iter(())


def page(kind: Kind) -> str:
    """The page of a kind of file."""
    parts = (_section(section) for section in Sections(kind.schema()))
    return "\n\n".join([f"# {kind.title}", kind.says, _READ, *parts, *kind.more()]) + "\n"


_READ = """Each section has a table of its keys, and each key an example that loads. In a heading `[]` is
an item of a list, `NAME` a name of your own. Unit 1 is a pure number. *Left out*: no value by itself."""


def _section(section: Section) -> str:
    parts = [f'<a id="{_anchor(section.title)}"></a>\n\n## {_heading(section)}']
    if elsewhere := _elsewhere(section):
        parts.append(f"The same: {elsewhere}.")
    if section.says:
        parts += [" ".join(part.split()) for part in section.says.split("\n\n")]
    parts.append(markdown_table(HEAD, [_row(key, section.places) for key in section.keys]))
    return "\n\n".join(parts)


def _anchor(title: str) -> str:
    return title.replace(" ", "-")


def _heading(section: Section) -> str:
    first = section.places[0].path
    if not first:
        return "The file"
    beside = [place.path for place in section.places if place.path[:-1] == first[:-1]]
    kind = next((key.choices[0] for key in section.keys if key.name == "type"), "")
    of = " of a sensor" if any(key.name == "sensor" for key in section.keys) else ""
    return ", ".join(f"`{dotted(path)}`" for path in beside) + (f", type `{kind}`{of}" if kind else "")


def _elsewhere(section: Section) -> str:
    """Where else it stands."""
    first = section.places[0].path[:-1]
    others = dict.fromkeys(place.path[:-1] for place in section.places)
    return ", ".join(f"below `{dotted(path)}`" if path else "of the file" for path in others if path != first)


def _row(key: Key, places: list[Place]) -> tuple[str, ...]:
    units = list(dict.fromkeys(key.unit(place) for place in places)) if key.number else []
    wanted = ", ".join(f"`{name}: {in_a_line(value)}`" for name, value in key.needs.items())
    says = key.says + (f"; the example goes with {wanted}" if wanted else "")
    example = "" if key.example is None else f"`{key.name}: {in_a_line(key.example)}`"
    unit = ", ".join(filter(None, units)) or ("1" if key.number else "")
    return f"`{key.name}`", says, _type(key), unit, _range(key), _default(key), example


def _type(key: Key) -> str:
    if key.sections:
        kinds = [kind for form in key.forms if (kind := _type_of(form)) in ("choice", "text")]
        names = [f"[{_called(title)}](#{_anchor(title)})" for title in key.sections]
        below = f"[section](#{_anchor(key.sections[0])})" if len(names) == 1 else "one of " + ", ".join(names)
        several = any(form.get("type") == "array" for form in key.forms)
        return " or ".join([*kinds, f"list, each {below}" if several else below])
    return " or ".join(dict.fromkeys(map(_type_of, key.forms)))


def _called(title: str) -> str:
    """The title of a section as words."""
    return re.sub(r"(?<=[a-z])(?=[A-Z])", " ", title).lower()


def _type_of(form: Node) -> str:
    if "properties" in form:
        return "section"
    if "enum" in form or "const" in form:
        return "choice"
    if form.get("type") == "array" and "prefixItems" in form:
        return f"list of {len(form['prefixItems'])} numbers"
    for kind, inside, words in (
        ("array", "items", "list of"),
        ("object", "additionalProperties", "names to"),
    ):
        if form.get("type") == kind:
            of = form.get(inside)
            inner = (
                dict.fromkeys(map(_type_of, of["anyOf"])) if isinstance(of, Mapping) and of else ["values"]
            )
            return f"{words} " + " or ".join(_PLURALS.get(one, one) for one in inner)
    return _TYPES.get(form.get("type", ""), "value")


def _range(key: Key) -> str:
    if key.choices:
        return ", ".join(f"`{in_a_line(choice)}`" for choice in dict.fromkeys(key.choices))
    said = [key.range] if key.range else []
    for form in key.forms:
        if "maxLength" in form:
            said.append(f"up to {form['maxLength']} characters")
        of = "Items" if form.get("type") == "array" else "Properties"
        if f"max{of}" in form and "prefixItems" not in form:
            said.append(f"{form.get(f'min{of}', 0)} to {form[f'max{of}']} of them")
    return ", ".join(said)


def _default(key: Key) -> str:
    if key.required:
        return "required"
    default = key.node.get("default")
    if default is None and "default" in key.node:
        return "*left out*"
    if key.sections or default is None:
        return "its own" if key.sections else "none"
    return "none" if default in ("", [], {}) else f"`{in_a_line(default)}`"


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
    return int(value) if isinstance(value, float) and value.is_integer() and abs(value) < 1e6 else value


def _of_scenarios() -> Iterator[str]:
    """What a scenario may name: schemes and laws with their options, presets."""
    for group, what, where in ((DETECTORS, "schemes", "fdi"), (LAWS, "laws", "control")):
        yield f"## {what.capitalize()}, and their `{where}.options`"
        entries = [entry for entry in registered(group).values() if entry.package == "beaver-ftc"]
        yield markdown_table((what, "what it is"), [(f"`{one.name}`", one.description()) for one in entries])
        rows = [
            (f"`{one.name}`", f"`{name}`", _option_range(of), f"`{of['default']:g}`", of["says"])
            for one in entries
            for name, of in options_of(group, one.name).items()
        ]
        yield markdown_table(("of", "option", "range", "default", "what it is"), rows)
    for what, presets in (("sensors", sensors.PRESETS), ("actuators", airframe.PRESETS)):
        yield f"## Presets of `{what}`"
        rows = [(f"`{name}`", *each) for name, of in presets.items() for each in _preset(of)]
        yield markdown_table(("preset", "of", "is"), rows)


def _option_range(of: Mapping[str, Any]) -> str:
    kind = "whole number, " if of.get("whole") else ""
    return f"{kind}{of.get('low', 0):g} to {of['high']:g}"


def _preset(of: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    if not of:
        yield "all", "no error, no lag, no limit"
    alike: dict[str, list[str]] = {}
    for name, values in of.items():
        text = in_a_line(values) if isinstance(values, dict) else f"{name}: {values}"
        alike.setdefault(text, []).append(name if isinstance(values, dict) else "all")
    for text, names in alike.items():
        yield ", ".join(f"`{name}`" for name in names), f"`{text}`"


_AS_SCHEMA = "`beaver-ftc schema{}` prints the same as JSON Schema, for an editor."
KINDS = {
    "scenario-keys": Kind(
        json_schema,
        "Scenario keys",
        f"Which keys does a scenario file have? {_AS_SCHEMA.format('')}",
        _of_scenarios,
    ),
    "sweep-keys": Kind(
        sweep_json_schema, "Sweep keys", f"Which keys does a sweep file have? {_AS_SCHEMA.format(' --sweep')}"
    ),
    "plan-keys": Kind(
        plan_json_schema,
        "Plan keys",
        f"Which keys does a plan of evidence have? {_AS_SCHEMA.format(' --plan')}",
    ),
    "aircraft-keys": Kind(
        AircraftFile.model_json_schema, "Aircraft file keys", "Which keys does an `aircraft.yaml` have?"
    ),
    "vehicle-keys": Kind(
        Vehicle.model_json_schema,
        "Vehicle file keys",
        "Which keys does the file have that says what the columns of a log are?",
    ),
}
