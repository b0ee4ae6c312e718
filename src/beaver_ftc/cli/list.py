"""`beaver-ftc list`: what there is to choose from."""

from typing import Any

from beaver_ftc.cli.output import Format, FormatOption, emit, emit_json

Entries = list[dict[str, str]]


def command(format: FormatOption = Format.text) -> None:
    """List what there is to choose from.

    Built-in scenarios and sweeps, diagnosis schemes, control laws, fault types and reference signals.
    """
    available = _available()
    if format is Format.json:
        emit_json(available)
    else:
        emit("\n\n".join(_section(kind, entries) for kind, entries in available.items()))


def _available() -> dict[str, Entries]:
    """Kind -> entries, each a name and a description."""
    from beaver_ftc.plugins import DETECTORS, LAWS
    from beaver_ftc.scenario.builtin import builtin_scenarios
    from beaver_ftc.scenario.schema import Scenario

    schema = Scenario.model_json_schema()["$defs"]
    return {
        "scenarios": [{"name": name, "description": says.strip()} for name, says, _ in builtin_scenarios()],
        "sweeps": _sweeps(),
        "schemes": _registered(DETECTORS),
        "laws": _registered(LAWS),
        "faults": [entry for part in schema.values() for entry in _fault(part)],
        "signals": [_kind(schema, name, part) for name, part in schema["Signal"]["properties"].items()],
    }


def _sweeps() -> Entries:
    from beaver_ftc.scenario.sweep_loader import builtin_sweeps, load_sweep

    return [
        {"name": name, "description": load_sweep(name).file.description.strip()} for name in builtin_sweeps()
    ]


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


def _fault(part: dict[str, Any]) -> Entries:
    """A part of the schema as a fault type, if it is one: it has a fixed `type`."""
    kind = part.get("properties", {}).get("type", {}).get("const")
    return [{"name": kind, "description": _first_line(part)}] if kind else []


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
