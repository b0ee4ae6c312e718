"""The keys of scenario, sweep, plan, aircraft and vehicle files: each as the schema has it that loads it."""

import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path as File
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
from tools.docs.reference.schema import ITEM, NAME, Key, Node, Path, Place, Section, Sections, dotted

_PARTS = ("p", "q", "r", ITEM, NAME)  # of a path: below the key that they are parts of
EXAMPLES = File(__file__).with_name("examples")  # a whole file of each kind, by the name of its page
HEAD = ("key", "what it is", "value", "range", "default")
_TYPES = {"string": "text", "boolean": "true or false", "integer": "whole number", "number": "number"}
_PLURALS = {one: f"{one}s" for one in ("text", "choice", "whole number", "number", "value", "section")}


class Kind(NamedTuple):
    """A kind of file: the schema of what loads it, what to say first, of its example, where to go next."""

    schema: Callable[[], Node]
    title: str
    says: str
    example: str
    next: str
    more: Callable[[], Iterator[str]] = lambda: iter(())
    links: Mapping[str, str] = {}  # path of a section -> link to the page that explains it


def page(name: str) -> str:
    """The page of a kind of file."""
    kind = KINDS[name]
    sections = list(Sections(kind.schema()))
    more = list(kind.more())
    headings = [part.removeprefix("## ") for part in more if part.startswith("## ")]
    groups = list(_groups(sections))
    parts = (_section(group, number, kind.links) for number, group in enumerate(groups, 2))
    captioned = _captioned(more, len(groups) + 2)
    return _with_sources(
        "\n\n".join(
            [
                f"# {kind.title}", f"{kind.says} {_READ}", _whole_file(name), _contents(sections, headings),
                *parts, *captioned,
                f"## Next\n\n{kind.next}",
            ]
        )
        + "\n"
    )  # fmt: skip


def _with_sources(text: str) -> str:
    """The page with a link at each key of a source, such as [Zhang2005]."""
    return re.sub(r"\[([A-Z][A-Za-z]+\d{4}[^\]]*)\](?!\()", r"[[\1]](../REFERENCES.md)", text)


def _whole_file(name: str) -> str:
    text = (EXAMPLES / f"{name}.yaml").read_text(encoding="utf-8")
    return f"## Example\n\n{KINDS[name].example}\n\n```yaml\n{text}```"


_READ = "[How to read these tables](reference/README.md#tables-of-keys) explains the columns."
# Sections that have most of their keys in common, by title: they share a table. What a member is called.
_FAMILIES: tuple[tuple[str, tuple[str, ...]], ...] = (
    ("Kinds of signals", ("Sine", "Doublet", "Step", "Square", "Ramp", "Chirp", "Csv")),
    ("Legs of a flight path", ("AltitudeLeg", "AirspeedLeg", "HeadingLeg", "BankLeg")),
    (
        "Faults of surfaces",
        ("Damage", "LossOfEffectiveness", "Stuck", "Hardover", "Float", "Bias", "RateLimit", "Oscillatory",
         "Unanticipated"),
    ),
    ("Faults of sensors", ("SensorBias", "SensorNoise", "SensorScale", "SensorFreeze", "SensorLost")),
    (
        "Errors of one sensor",
        ("RateGyro", "FlowVane", "Airspeed", "DynamicPressure", "AttitudeAngle", "Altimeter", "Tachometer",
         "ManifoldGauge", "Accelerometer"),
    ),
    ("Limits of a rate", ("Level", "QuantileLevel")),
)  # fmt: skip
_IN_UNITS = ("noise_std_", "bias_", "quantum_")  # of a sensor: its unit follows
_CONTENTS = "*Table 1. The keys at the top level of the file, and the sections that belong to each key.*"


def _contents(sections: Iterable[Section], headings: Iterable[str]) -> str:
    """A row for each key at the top of the file, with links to its section and to the sections below it."""
    rows: dict[str, list[str]] = {}
    for section in sections:
        path = section.places[0].path
        top = path[0] if path else ""
        rows.setdefault(top, []).append(f"[{_heading(section)}](#{_anchor(section.title)})")
    links = [(f"`{top}`" if top else "top of the file", ", ".join(of)) for top, of in rows.items()]
    links += [("names", f"[{heading}](#{_slug(heading)})") for heading in headings]
    return f"## Contents\n\n{_CONTENTS}\n\n{markdown_table(('key', 'sections'), links)}"


def _slug(heading: str) -> str:
    return re.sub(r"[^\w -]", "", heading.lower()).replace(" ", "-")


def _captioned(parts: Iterable[str], number: int) -> Iterator[str]:
    """The parts, with a caption above each table."""
    for part in parts:
        if part.startswith("|"):
            first, second, *_ = part.split("\n")[0].strip("| ").split(" | ")
            shown = {"option": f"Options of each {first}", "part": "Values of each preset"}
            yield f"*Table {number}. {shown.get(second, f'The {first}s, and what each of them does')}.*"
            number += 1
        yield part


def _groups(sections: Iterable[Section]) -> Iterator[tuple[str, list[Section]]]:
    """Sections that share a table, under its heading; the heading of one alone is empty."""
    titles = {title: heading for heading, of in _FAMILIES for title in of}
    whole = list(sections)
    done = set[str]()
    for section in whole:
        heading = titles.get(section.title, "")
        if not heading:
            yield "", [section]
        elif heading not in done:
            done.add(heading)
            yield heading, [one for one in whole if titles.get(one.title) == heading]


def _section(group: tuple[str, list[Section]], number: int, links: Mapping[str, str]) -> str:
    heading, members = group
    if not heading:
        return _alone(members[0], number, links)
    first = members[0]
    parts = [f"## {heading}"]
    units = _unit_in_names(members)
    parts += ["\n".join(_member(section, units.get(section.title, "")) for section in members)]
    if page := _link(first, links):
        parts.append(f"More: {page}.")
    typed = any(key.name == "type" for key in first.keys)
    says = "Each section also needs `type`, its name. " if typed else ""
    parts.append(f'*Table {number}. Keys of these sections. {says}"in": the sections that have the key.*')
    parts.append(markdown_table(("in", *HEAD), _shared(members)))
    return "\n\n".join(parts)


def _member(section: Section, unit: str) -> str:
    says = " ".join(section.says.split())
    path = section.places[0].path
    elsewhere = (
        f" Also: {found}." if not unit and path[0] == "expect" and (found := _elsewhere(section)) else ""
    )
    ends = f" UNIT is `{unit}`." if unit else ""
    return f'- <a id="{_anchor(section.title)}"></a>{_in_family(section)}: {says}{ends}{elsewhere}'


def _unit_in_names(members: list[Section]) -> dict[str, str]:
    """Title -> the end of its keys that is a unit, where sections have the same keys in other units."""
    found: dict[str, str] = {}
    if not all(any(key.name.startswith(_IN_UNITS[0]) for key in section.keys) for section in members):
        return found
    for section in members:
        names = [key.name for key in section.keys if key.name.startswith(_IN_UNITS)]
        if names:
            found[section.title] = names[0].removeprefix(
                next(one for one in _IN_UNITS if names[0].startswith(one))
            )
    return found


def _in_family(section: Section) -> str:
    """What a section is called among those with which it shares a table."""
    kind = next((key.choices[0] for key in section.keys if key.name == "type"), "")
    if kind:
        return f"`{kind}`"
    path = section.places[0].path
    if path[-1] == ITEM:
        return f"`{path[-2]}`"
    return ", ".join(f"`{one[-1]}`" for one in _beside(section))


def _shared(members: list[Section]) -> list[tuple[str, ...]]:
    """A row for each meaning; what differs between sections stands with their names."""
    found: dict[str, list[tuple[str, tuple[str, ...]]]] = {}
    for section in members:
        for key in section.keys:
            row = _row(key, section.places)
            if key.name != "type":  # it is what the section is called
                found.setdefault(row[1], []).append((_in_family(section), row))
    return [_of_all(of, [_in_family(section) for section in members]) for of in found.values()]


def _of_all(rows: list[tuple[str, tuple[str, ...]]], every: list[str]) -> tuple[str, ...]:
    cells = []
    begins = next((one for one in _IN_UNITS if len(rows) > 1 and rows[0][1][0].startswith(f"`{one}")), "")
    if begins and len({row[0] for _, row in rows}) > 1:
        rows = [(name, (f"`{begins}UNIT`", row[1], "number in UNIT", *row[3:])) for name, row in rows]
    for column in range(len(HEAD)):
        names: dict[str, list[str]] = {}
        for name, row in rows:
            names.setdefault(row[column], []).append(name)
        several = len(names) > 1
        cells.append(
            "; ".join(f"{text or '-'} ({', '.join(of)})" if several else text for text, of in names.items())
        )
    members = [name for name, _ in rows]
    others = [name for name in every if name not in members]
    most = f"all but {', '.join(others)}" if others else "all"
    return (most if len(others) < len(members) else ", ".join(members), *cells)


def _link(section: Section, links: Mapping[str, str]) -> str:
    return links.get(_SENSOR_FAULTS if _is_of_a_sensor(section) else dotted(section.places[0].path), "")


def _alone(section: Section, number: int, links: Mapping[str, str]) -> str:
    parts = [f'<a id="{_anchor(section.title)}"></a>\n\n## {_heading(section)}']
    if _is_also_a_list(section):
        parts.append("The value is one mapping with these keys, or a list of such mappings.")
    elif elsewhere := _elsewhere(section):
        parts.append(f"Sections with the same keys: {elsewhere}.")
    if section.says and section.places[0].path:
        parts += [" ".join(part.split()) for part in section.says.split("\n\n")]
    if page := _link(section, links):
        parts.append(f"More: {page}.")
    parts.append(f"*Table {number}. Keys {_called_file(section)}.*")
    parts.append(markdown_table(HEAD, [_row(key, section.places) for key in section.keys]))
    return "\n\n".join(parts)


def _called_file(section: Section) -> str:
    heading = _heading(section)
    if section.title in _HEADINGS:
        return f"of {heading[0].lower()}{heading[1:]}"
    if heading == "The file":
        return "at the top level of the file"
    beside = _beside(section)
    above = beside[0][:-1]
    if len(beside) > 1 and above:
        return "of " + _together(above, [path[-1] for path in beside])
    if _is_of_a_sensor(section):
        heading = heading.removesuffix(" of a sensor").replace(", type", " for a sensor fault of type")
    return f"of {heading}"


_TYPES_OF = {"OfHandling": "handling_qualities"}  # title of a section -> its type, if not its words
_HEADINGS = {"QuantityColumn": "A column (`rates.p`, `commands[]`, `labels.NAME`, ...)"}


def _anchor(title: str) -> str:
    return title.replace(" ", "-")


def _heading(section: Section) -> str:
    first = section.places[0].path
    if not first:
        return "The file"
    if section.title in _HEADINGS:
        return _HEADINGS[section.title]
    beside = _beside(section)
    kind = next((key.choices[0] for key in section.keys if key.name == "type"), "")
    of = " of a sensor" if _is_of_a_sensor(section) else ""
    return _named(beside) + (f", type `{kind}`{of}" if kind else "")


def _beside(section: Section) -> list[Path]:
    """Its paths with the same key above them as the first path."""
    above = section.places[0].path[:-1]
    return [place.path for place in section.places if place.path[:-1] == above]


def _is_of_a_sensor(section: Section) -> bool:
    return any(key.name == "sensor" for key in section.keys)


def _named(beside: list[Path]) -> str:
    """Paths side by side; of more than one, what they share stands once."""
    above = beside[0][:-1]
    if len(beside) == 1 or not above:
        return ", ".join(f"`{dotted(path)}`" for path in beside)
    return f"`{dotted(above)}`: " + ", ".join(f"`{path[-1]}`" for path in beside)


def _is_also_a_list(section: Section) -> bool:
    """Whether it stands at one place only, by itself or as an item of a list."""
    paths = {place.path for place in section.places}
    return len(paths) == 2 and (*section.places[0].path, ITEM) in paths


def _elsewhere(section: Section) -> str:
    """Where else it stands: paths below the same key together."""
    first = section.places[0].path[:-1]
    groups: dict[Path, dict[str, None]] = {}
    for place in section.places if section.places[0].path else ():
        if place.path[-1] in (ITEM, NAME):
            groups.setdefault(place.path, {})[""] = None
        elif place.path[:-1] != first:
            groups.setdefault(place.path[:-1], {})[place.path[-1]] = None
    groups.pop(section.places[0].path, None)
    return "; ".join(_together(above, list(names)) for above, names in groups.items())


def _together(above: Path, names: list[str]) -> str:
    """Keys with what is above them, which stands once."""
    if not names[0]:
        return f"`{dotted(above)}`"
    if len(names) == 1:
        return f"`{dotted((*above, names[0]))}`"
    return ", ".join(f"`{name}`" for name in names) + (f" in `{dotted(above)}`" if above else "")


def _row(key: Key, places: list[Place]) -> tuple[str, ...]:
    units = list(dict.fromkeys(key.unit(place) for place in places)) if key.number else []
    says = _without_unit(key.says, units)
    if key.example is not None and _is_long(key.example):
        also = "".join(f", {name}: {in_a_line(value)}" for name, value in key.needs.items())
        says += f". *Example:* `{key.name}: {in_a_line(key.example)}{also}`"
    unit = _unit(key, places) if key.number else ""
    value = ", ".join(filter(None, (_type(key), "" if unit == "1" else unit)))
    return f"`{key.name}`", says, value, _range(key), _default(key)


def _is_long(example: Any) -> bool:
    """Whether it shows more than a value of the range."""
    return isinstance(example, Mapping | list)


def _unit(key: Key, places: list[Place]) -> str:
    """The unit of a key; of several, each with the names of what has it, the commonest one last."""
    names: dict[str, dict[str, None]] = {}
    for place in places:
        of = next((part for part in reversed(place.path) if part not in _PARTS), "")
        names.setdefault(key.unit(place) or "1", {})[of] = None
    usual = max(names, key=lambda unit: len(names[unit]))
    others = [
        f"{unit} for {' and '.join(f'`{name}`' for name in of)}"
        for unit, of in names.items()
        if unit != usual
    ]
    return ", ".join([*others, f"otherwise {usual}"]) if others else usual


def _without_unit(says: str, units: list[str]) -> str:
    """The text in one line and without the unit at its end, for which the table has a column."""
    says = " ".join(says.split()).replace("; left out: ", ". Left out: ")
    return next((says.removesuffix(end) for unit in units if says.endswith(end := f", {unit or 1}")), says)


def _type(key: Key) -> str:
    if key.sections:
        kinds = [kind for form in key.forms if (kind := _type_of(form)) in ("choice", "text")]
        kinds += ["choice"] * bool(key.words)
        names = [f"[{_called(title)}](#{_anchor(title)})" for title in key.sections]
        below = f"[section](#{_anchor(key.sections[0])})" if len(names) == 1 else "one of " + ", ".join(names)
        several = any(form.get("type") == "array" for form in key.forms)
        return " or ".join([*kinds, f"list, each {below}" if several else below])
    return " or ".join(dict.fromkeys(map(_type_of, key.forms)))


def _called(title: str) -> str:
    """The title of a section as words, or the name of its type."""
    return _TYPES_OF.get(title) or re.sub(r"(?<=[a-z])(?=[A-Z])", " ", title).lower().removeprefix("of ")


def _type_of(form: Node) -> str:
    if "properties" in form:
        return "section"
    if "enum" in form or "const" in form:
        return "choice"
    if form.get("type") == "array" and "prefixItems" in form:
        return f"list of {len(form['prefixItems'])} numbers"
    for kind, inside, words in (
        ("array", "items", "list of"),
        ("object", "additionalProperties", "mapping of names to"),
    ):
        if form.get("type") == kind:
            of = form.get(inside)
            inner = (
                dict.fromkeys(map(_type_of, of["anyOf"])) if isinstance(of, Mapping) and of else ["values"]
            )
            return f"{words} " + " or ".join(map(_plural, inner))
    return _TYPES.get(form.get("type", ""), "value")


def _plural(kind: str) -> str:
    """A kind of value, of several."""
    first, of, rest = kind.partition(" of ")
    return f"{first}s{of}{rest}" if of else _PLURALS.get(kind, kind)


def _range(key: Key) -> str:
    if key.choices:
        return ", ".join(f"`{in_a_line(choice)}`" for choice in dict.fromkeys(key.choices))
    said = [key.range] if key.range else []
    for form in key.forms:
        if "maxLength" in form:
            said.append(f"up to {form['maxLength']} characters")
        of = "Items" if form.get("type") == "array" else "Properties"
        if f"max{of}" in form and "prefixItems" not in form:
            rows = any(one.get("type") == "array" for one in form.get("items", {}).get("anyOf", ()))
            what = "rows" if rows else "of them"
            least = form.get(f"min{of}")
            said.append(f"{f'{least} to' if least else 'up to'} {form[f'max{of}']} {what}")
    return ", ".join(said)


def _default(key: Key) -> str:
    if key.required:
        return "required"
    default = key.node.get("default")
    if default is None and "default" in key.node:
        return "*left out*"
    if default is None and any(
        form.get("type") == "object" and "properties" not in form for form in key.forms
    ):
        return "none"
    if default in ("", [], {}) or (default is None and not key.sections):
        return "none"
    flat = not isinstance(default, Mapping) or not any(isinstance(one, Mapping) for one in default.values())
    return "see section" if default is None or not flat else f"`{in_a_line(default)}`"


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
    return int(value) if isinstance(value, float) and value.is_integer() and abs(value) <= 1e6 else value


def _of_scenarios() -> Iterator[str]:
    """What a scenario may name: schemes and laws with their options, presets."""
    for group, what, where in ((DETECTORS, "schemes", "fdi"), (LAWS, "laws", "control")):
        yield f"## {what.capitalize()}, and their `{where}.options`"
        yield (
            f"`{where}.{what[:-1]}` has one of these names, and `{where}.options` sets the options below. "
            f"A {what[:-1]} that is not in the table of options has no options."
        )
        entries = [entry for entry in registered(group).values() if entry.package == "beaver-ftc"]
        yield markdown_table(
            (what[:-1], "what it is"), [(f"`{one.name}`", one.description()) for one in entries]
        )
        rows = [
            (f"`{one.name}`", f"`{name}`", _option_range(of), f"`{of['default']:g}`", of["says"])
            for one in entries
            for name, of in options_of(group, one.name).items()
        ]
        yield markdown_table((what[:-1], "option", "range", "default", "what it is"), rows)
    for what, presets in (("sensors", sensors.PRESETS), ("actuators", airframe.PRESETS)):
        yield f"## Presets of `{what}`"
        yield f"A preset is a name for a set of values. With `{what}: NAME` the section has these values."
        rows = [(f"`{name}`", *each) for name, of in presets.items() for each in _preset(of)]
        yield markdown_table(("preset", "part", "values"), rows)


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


_AS_SCHEMA = (
    "`beaver-ftc schema{}` prints the same keys as JSON Schema. "
    "With this schema, an editor completes and checks the file while you write it."
)
_SCENARIOS = "reference/scenarios.md"
_SENSOR_FAULTS = "faults[] of a sensor"
_LINKS = {
    "reference": f"[reference signals]({_SCENARIOS}#reference-signals)",
    "autopilot": f"[flight path]({_SCENARIOS}#flight-path), [outer loops](explanation/laws.md#outer-loops)",
    "faults[]": f"[faults]({_SCENARIOS}#faults), [fault types](explanation/fault-types.md), "
    "[signs of the surfaces](results/validation.md#surfaces-and-signs)",
    _SENSOR_FAULTS: f"[names and units of the sensors]({_SCENARIOS}#instruments-that-fail), "
    "[sensor monitor](explanation/instruments.md)",
    "uncertainty": f"[truth and design model]({_SCENARIOS}#truth-and-design-model)",
    "actuators": f"[real sensors, servos and air]({_SCENARIOS}#real-sensors-servos-and-air)",
    "sensors": f"[real sensors, servos and air]({_SCENARIOS}#real-sensors-servos-and-air)",
    "environment": f"[real sensors, servos and air]({_SCENARIOS}#real-sensors-servos-and-air)",
    "fdi": "[detection](explanation/detection.md), [isolation](explanation/isolation.md), "
    "[sensor monitor](explanation/instruments.md)",
    "fdi.probing": "[active probing](explanation/fault-types.md#active-probing)",
    "fdi.statistical": "[statistical detector](explanation/statistical.md)",
    "fdi.bounds": "[bound on the model error](explanation/detection.md#the-bound-on-the-model-error), "
    "[declare errors](how-to/declare-errors.md)",
    "fdi.sharpen": "[guarantees](explanation/assumptions.md), "
    "[bank of poles](explanation/detection.md#a-bank-of-poles), [isolation tests](explanation/isolation.md)",
    "control": "[control laws](explanation/laws.md)",
    "control.power": "[if elevator and flap are both lost]"
    "(explanation/laws.md#if-elevator-and-flap-are-both-lost)",
    "changes[]": f"[changes in flight]({_SCENARIOS}#changes-in-flight)",
    "design_model": f"[truth and design model]({_SCENARIOS}#truth-and-design-model)",
    "expect": f"[expectations]({_SCENARIOS}#expectations)",
}
_DERIVED = "explanation/derived-aircraft.md"
_AIRCRAFT_LINKS = {
    "surfaces.NAME": "[properties of the Beaver](reference/properties.md), [signs](reference/nomenclature.md"
    "#axes-and-signs)",
    "signals.NAME": f"[fit of the terms]({_DERIVED}#3-fit)",
    "moments.Cl[]": "[terms of the Beaver](reference/properties.md#aerodynamic-terms), "
    f"[fit of the terms]({_DERIVED}#3-fit)",
    "model_error_rad_s2": f"[meaning of the bound]({_DERIVED}#what-the-bound-means)",
    "model_error_map": f"[measurement of the error]({_DERIVED}#4-measure)",
    "effectors.NAME": "[fly with the engines](how-to/engines.md)",
    "channels": "[fly under an autopilot](how-to/autopilots.md)",
    "damage.NAME": "[damage on the GTM](results/gtm.md)",
}
KINDS = {
    "scenario-keys": Kind(
        json_schema,
        "Scenario keys",
        "Which keys can a scenario file have? A scenario describes one flight. This page lists every key, "
        "for readers who write or read a scenario. [Scenarios](reference/scenarios.md) "
        f"explains the sections with examples. {_AS_SCHEMA.format('')}",
        "In this flight, the elevator loses 40 % of its effectiveness at 12 s. One aerodynamic coefficient "
        "of the simulated aircraft is 5 % too large, and the diagnosis allows for errors of 5 %. Only `name` "
        "is required; every other key has a default.",
        "[Sweep keys](reference/sweep-keys.md) has the keys of a file with many flights, and "
        "[columns](reference/columns.md) lists the results of a flight.",
        _of_scenarios,
        _LINKS,
    ),
    "sweep-keys": Kind(
        sweep_json_schema,
        "Sweep keys",
        "Which keys can a sweep file have? This page lists every key, for readers who write a sweep. "
        "A sweep flies one scenario many times with varied values "
        f"([how to fly one](how-to/sweeps.md)). {_AS_SCHEMA.format(' --sweep')}",
        "This sweep flies 50 losses of the elevator. The size of the loss and the airspeed are random. At "
        "least 90 % of the losses must be detected, and half of the losses must be detected within 0.2 s.",
        "[Results of a sweep](how-to/sweeps.md#what-a-sweep-writes) has the files and statistics of a sweep.",
    ),
    "plan-keys": Kind(
        plan_json_schema,
        "Plan keys",
        "Which keys can a plan of evidence have? A plan lists requirements, and the flights that test these "
        "requirements. This page lists every key, for readers who write a plan "
        f"([how to write one](how-to/evidence.md)). {_AS_SCHEMA.format(' --plan')}",
        "This plan has one requirement of each kind. JAM-1 has expectations, RATE-1 has a formula, and "
        "STAT-1 has a limit for the result of a study.",
        "[Write evidence](how-to/evidence.md) explains the verdicts of a plan with an example.",
        links={
            "requirements[]": "[tests of a requirement, operators of a formula]"
            "(how-to/evidence.md#what-a-requirement-tests)"
        },
    ),
    "aircraft-keys": Kind(
        AircraftFile.model_json_schema,
        "Aircraft file keys",
        "Which keys can the file `aircraft.yaml` have? The file describes an aircraft for the diagnosis and "
        "the laws: its surfaces, mass, terms of the design model, and limits. The command `derive` writes "
        "the file ([your own aircraft](tutorials/own-aircraft.md)). This page is for readers who read or "
        "change this file.",
        "This file has the required sections and a few terms of the Beaver. The file of a complete aircraft "
        "has more terms, and also the error of its model. The names after `command`, `position` and "
        "`effective` are properties of the JSBSim model.",
        "[Derived aircraft](explanation/derived-aircraft.md) explains how `derive` finds the terms and the "
        "errors.",
        links=_AIRCRAFT_LINKS,
    ),
    "vehicle-keys": Kind(
        Vehicle.model_json_schema,
        "Vehicle file keys",
        "Which keys can a vehicle file have? The file states which column of a flight log contains which "
        "quantity ([prepare a log](how-to/flight-logs.md)). The command `identify --check` proposes a first "
        "version, and `beaver-ftc new NAME --log` writes an example. This page is for readers who "
        "complete such a file.",
        "The log of a small flying wing is a table with the columns `time_ms`, `gyro_x`, `gyro_y`, `gyro_z`, "
        "`roll_cmd`, `pitch_cmd`, `roll_deg`, `pitch_deg`, `airspeed_kmh` and `altitude_m`. The wing has two "
        "elevons, `right` and `left`. Its file can be:",
        "[Diagnose a flight log](tutorials/flight-log.md) uses such a file.",
    ),
}
