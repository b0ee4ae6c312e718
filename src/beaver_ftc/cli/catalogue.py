"""`beaver-ftc list`, `show` and `schema`: what there is to choose from, and what a file may say."""

from collections.abc import Iterator
from pathlib import Path
from typing import Annotated

import typer

from beaver_ftc.cli.inputs import complete_names
from beaver_ftc.cli.output import Document, Format, FormatOption, answer, emit, emit_json
from beaver_ftc.documents.errors import BadInput, suggestion

Entries = list[dict[str, str]]


def list_choices(
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
    answer(format, available, lambda: "\n\n".join(map(_section, available, available.values())))


def _available() -> dict[str, Entries]:
    """Kind -> entries, each a name and a description."""
    from beaver_ftc.plugins import DETECTORS, LAWS
    from beaver_ftc.scenario.loader import builtin_scenarios
    from beaver_ftc.scenario.schema import Scenario

    parts = Scenario.model_json_schema()["$defs"]
    return {
        "scenarios": [{"name": name, "description": says.strip()} for name, says, _ in builtin_scenarios()],
        "sweeps": _sweeps(),
        "aircraft": _aircraft(),
        "schemes": _registered(DETECTORS),
        "laws": _registered(LAWS),
        "faults": [entry for key in ("actuator", "sensor") for entry in _faults(parts, key)],
        "signals": [_kind(parts, name, part) for name, part in parts["Signal"]["properties"].items()],
    }


def _sweeps() -> Entries:
    from beaver_ftc.scenario.loader import builtin_sweeps
    from beaver_ftc.scenario.sweeps import load_sweep

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


def _faults(schema: Document, key: str) -> Iterator[dict[str, str]]:
    """The parts of the schema that are fault types, with a fixed `type`; key: actuator or sensor."""
    of = "of a sensor: " if key == "sensor" else ""
    for part in schema.values():
        has = part.get("properties", {})
        kind = has.get("type", {}).get("const")
        if kind and ("sensor" in has) == (key == "sensor"):
            yield {"name": kind, "description": of + _first_line(part)}


def _kind(schema: Document, name: str, node: Document) -> dict[str, str]:
    references = [branch["$ref"] for branch in node.get("anyOf", [node]) if "$ref" in branch]
    part = schema[references[0].rpartition("/")[2]] if references else {}
    return {"name": name, "description": _first_line(part)}


def _first_line(part: Document) -> str:
    return part.get("description", "").partition("\n")[0]


def _section(kind: str, entries: Entries) -> str:
    width = max((len(entry["name"]) for entry in entries), default=0)
    lines = (f"  {entry['name']:{width}}  {entry['description']}".rstrip() for entry in entries)
    return "\n".join((kind, *lines))


def show(
    name: Annotated[
        str,
        typer.Argument(metavar="NAME", help="A built-in scenario or sweep.", autocompletion=complete_names),
    ],
) -> None:
    """Print a built-in scenario or sweep.

    What is printed is a file that `run` or `sweep` takes.
    """
    emit(_file(name).read_text(encoding="utf-8"))


def _file(name: str) -> Path:
    from beaver_ftc.scenario.loader import builtin_names, builtin_path, builtin_sweeps, resolve

    if name in builtin_names():
        return builtin_path(name)
    if name in builtin_sweeps():
        return resolve(name, "sweep")
    known = [*builtin_names(), *builtin_sweeps()]
    raise BadInput(f"show: no built-in scenario or sweep {name[:100]!r}{suggestion(name, known)}")


def schema(
    sweep: Annotated[bool, typer.Option("--sweep", help="Of a sweep file instead of a scenario.")] = False,
) -> None:
    """Print the JSON Schema of a scenario.

    Editors that know it complete and check a scenario as it is written.
    """
    if sweep:
        from beaver_ftc.scenario.sweeps import sweep_json_schema

        emit_json(sweep_json_schema())
        return
    from beaver_ftc.scenario.schema import Scenario

    emit_json({"$schema": "https://json-schema.org/draft/2020-12/schema", **Scenario.model_json_schema()})
