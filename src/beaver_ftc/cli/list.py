"""`beaver-ftc list`: what there is to choose from."""

from collections.abc import Iterator
from typing import Annotated, Any

import typer

from beaver_ftc.cli.output import Format, FormatOption, emit, emit_json
from beaver_ftc.documents.errors import BadInput, suggestion

Entries = list[dict[str, str]]


def command(
    kind: Annotated[str | None, typer.Argument(metavar="KIND", help="One kind only, e.g. aircraft.")] = None,
    format: FormatOption = Format.text,
) -> None:
    """List what there is to choose from.

    Built-in scenarios and sweeps, aircraft, diagnosis schemes, control laws, fault types and reference
    signals.
    """
    available = _available()
    if kind is not None and kind not in available:
        raise BadInput(f"there is no list of {kind[:60]!r}{suggestion(kind, available)}")
    available = available if kind is None else {kind: available[kind]}
    if format is Format.json:
        emit_json(available)
    else:
        emit("\n\n".join(_section(kind, entries) for kind, entries in available.items()))


def _available() -> dict[str, Entries]:
    """Kind -> entries, each a name and a description."""
    from beaver_ftc.plugins import DETECTORS, LAWS
    from beaver_ftc.scenario.loader import builtin_scenarios
    from beaver_ftc.scenario.schema import Scenario

    schema = Scenario.model_json_schema()["$defs"]
    return {
        "scenarios": [{"name": name, "description": says.strip()} for name, says, _ in builtin_scenarios()],
        "sweeps": _sweeps(),
        "aircraft": _aircraft(),
        "schemes": _registered(DETECTORS),
        "laws": _registered(LAWS),
        "faults": [entry for key in ("actuator", "sensor") for entry in _faults(schema, key)],
        "signals": [_kind(schema, name, part) for name, part in schema["Signal"]["properties"].items()],
    }


def _sweeps() -> Entries:
    from beaver_ftc.scenario.sweep_loader import builtin_sweeps, load_sweep

    return [
        {"name": name, "description": load_sweep(name).file.description.strip()} for name in builtin_sweeps()
    ]


def _aircraft() -> Entries:
    """The built-in aircraft, and those of the jsbsim package that have been derived or can be."""
    from beaver_ftc.aircraft import builtin_names, load
    from beaver_ftc.aircraft.loading import is_derived
    from beaver_ftc.plant.instrumented import names

    ours = [{"name": name, "description": load(name).file.description} for name in builtin_names()]
    says = {True: "of the jsbsim package, derived", False: "of the jsbsim package: derived at first use"}
    known = [(name, is_derived(name)) for name in names()]
    return ours + [{"name": f"jsbsim:{name}", "description": says[made]} for name, made in known]


def _registered(group: str) -> Entries:
    """The detectors or laws that a scenario may name, those of other installed packages included."""
    from beaver_ftc.plugins import OURS, registered

    return [
        {
            "name": entry.name,
            "description": entry.description() + ("" if entry.package == OURS else f" [{entry.package}]"),
        }
        for entry in registered(group).values()
    ]


def _faults(schema: dict[str, Any], key: str) -> Iterator[dict[str, str]]:
    """The parts of the schema that are fault types, with a fixed `type`; key: actuator or sensor."""
    of = "of a sensor: " if key == "sensor" else ""
    for part in schema.values():
        has = part.get("properties", {})
        kind = has.get("type", {}).get("const")
        if kind and ("sensor" in has) == (key == "sensor"):
            yield {"name": kind, "description": of + _first_line(part)}


def _kind(schema: dict[str, Any], name: str, node: dict[str, Any]) -> dict[str, str]:
    references = [branch["$ref"] for branch in node.get("anyOf", [node]) if "$ref" in branch]
    part = schema[references[0].rpartition("/")[2]] if references else {}
    return {"name": name, "description": _first_line(part)}


def _first_line(part: dict[str, Any]) -> str:
    return part.get("description", "").partition("\n")[0]


def _section(kind: str, entries: Entries) -> str:
    width = max((len(entry["name"]) for entry in entries), default=0)
    lines = (f"  {entry['name']:{width}}  {entry['description']}".rstrip() for entry in entries)
    return "\n".join((kind, *lines))
