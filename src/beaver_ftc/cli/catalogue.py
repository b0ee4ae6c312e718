"""`beaver-ftc list`, `show` and `schema`: what there is to choose from, and what a file may say."""

from collections.abc import Iterable, Iterator
from textwrap import fill, indent
from typing import Annotated

import typer

from beaver_ftc.cli.inputs import complete_names
from beaver_ftc.cli.output import Document, Format, FormatOption, answer, emit, emit_json
from beaver_ftc.commands import declare
from beaver_ftc.documents.errors import BadInput, suggestion

Entries = list[dict[str, str]]
WIDTH = 76


def list_choices(
    kind: Annotated[str | None, typer.Argument(metavar="KIND")] = None,
    short: bool = False,
    format: FormatOption = Format.text,
) -> None:
    """List what there is to choose from.

    Built-in scenarios, sweeps and plans of evidence, aircraft, diagnosis schemes, control laws, fault types
    and reference signals.

    Examples:
      beaver-ftc list --short

    kind: One kind only, e.g. aircraft.
    short: Names alone.
    """
    available = _available()
    if kind is not None and kind not in available:
        raise BadInput(f"there is no list of {kind[:60]!r}{suggestion(kind, available)}")
    available = available if kind is None else {kind: available[kind]}
    section, gap = (_names, "\n") if short else (_section, "\n\n")
    answer(format, available, lambda: gap.join(map(section, available, available.values())))


def _available() -> dict[str, Entries]:
    """Kind -> entries, each a name and a description."""
    from beaver_ftc.plugins import DETECTORS, LAWS
    from beaver_ftc.scenario.loader import builtin_plans, builtin_scenarios, builtin_sweeps
    from beaver_ftc.scenario.schema import Scenario
    from beaver_ftc.scenario.sweeps import load_sweep

    parts = Scenario.model_json_schema()["$defs"]
    available: dict[str, Iterable[tuple[str, str]]] = {
        "scenarios": ((name, says.strip()) for name, says, _ in builtin_scenarios()),
        "sweeps": ((name, load_sweep(name).file.description.strip()) for name in builtin_sweeps()),
        "plans": ((name, _described(name)) for name in builtin_plans()),
        "aircraft": _aircraft(),
        "schemes": _registered(DETECTORS),
        "laws": _registered(LAWS),
        "faults": _faults(parts),
        "signals": _signals(parts),
    }
    return {
        kind: [{"name": name, "description": says} for name, says in entries]
        for kind, entries in available.items()
    }


def _described(plan: str) -> str:
    """What a built-in plan of evidence says of itself."""
    from beaver_ftc.documents.validation import parse_document
    from beaver_ftc.scenario.loader import read_file, resolve

    path = resolve(plan, "plan")
    return str(parse_document(read_file(path, plan, "plan"), str(path)).data["description"]).strip()


def _aircraft() -> Iterator[tuple[str, str]]:
    """The built-in aircraft, those that are imported or can be, and those of the jsbsim package."""
    from beaver_ftc.aircraft import builtin_names, load
    from beaver_ftc.aircraft.loading import FILE, IMPORTED, imported_folder, is_derived
    from beaver_ftc.plant.instrumented import names

    for name in builtin_names():
        yield name, load(name).file.description
    for name, how in IMPORTED.items():
        here = (imported_folder(name) / FILE).is_file()
        yield name, load(name).file.description if here else f"not here yet: after {how}"
    for name in names():
        made = ", derived" if is_derived(name) else ": derived at first use"
        yield f"jsbsim:{name}", f"of the jsbsim package{made}"


def _registered(group: str) -> Iterator[tuple[str, str]]:
    """The detectors or laws that a scenario may name, those of other installed packages included."""
    from beaver_ftc.plugins import OURS, registered

    for entry in registered(group).values():
        yield entry.name, entry.description() + ("" if entry.package == OURS else f" [{entry.package}]")


def _faults(schema: Document) -> Iterator[tuple[str, str]]:
    """The parts of the schema that are fault types, with a fixed `type`: of actuators, then of sensors."""
    for of_a_sensor, of in ((False, ""), (True, "of a sensor: ")):
        for part in schema.values():
            has = part.get("properties", {})
            kind = has.get("type", {}).get("const")
            if kind and ("sensor" in has) == of_a_sensor:
                yield kind, of + _first_line(part)


def _signals(schema: Document) -> Iterator[tuple[str, str]]:
    for name, node in schema["Signal"]["properties"].items():
        references = [branch["$ref"] for branch in node.get("anyOf", [node]) if "$ref" in branch]
        yield name, _first_line(schema[references[0].rpartition("/")[2]] if references else {})


def _first_line(part: Document) -> str:
    return part.get("description", "").partition("\n")[0]


def _section(kind: str, entries: Entries) -> str:
    width = max((len(entry["name"]) for entry in entries), default=0)
    lines = (f"  {entry['name']:{width}}  {entry['description']}".rstrip() for entry in entries)
    return "\n".join((kind, *lines))


def _names(kind: str, entries: Entries) -> str:
    names = fill(", ".join(entry["name"] for entry in entries), WIDTH, break_on_hyphens=False)
    return f"{kind}\n{indent(names, '  ')}"


@declare(plugins=False)
def show(
    name: Annotated[str, typer.Argument(metavar="NAME", autocompletion=complete_names)],
) -> None:
    """Print a built-in scenario, sweep or plan of evidence.

    What is printed is a file that `run`, `sweep` or `evidence` takes.

    Examples:
      beaver-ftc show elevator-partial-loss

    name: A built-in scenario, sweep or plan.
    """
    from beaver_ftc.scenario.loader import builtin_names, builtin_plans, builtin_sweeps, resolve

    kinds = {"scenario": builtin_names(), "sweep": builtin_sweeps(), "plan": builtin_plans()}
    kind = next((kind for kind, names in kinds.items() if name in names), None)
    if kind is None:
        known = [each for names in kinds.values() for each in names]
        raise BadInput(f"show: no built-in scenario, sweep or plan {name[:100]!r}{suggestion(name, known)}")
    path = resolve(name, kind)
    emit(path.read_text(encoding="utf-8"))


@declare(plugins=False)
def schema(sweep: bool = False, plan: bool = False) -> None:
    """Print the JSON Schema of a scenario.

    Editors that know it complete and check a scenario as it is written.

    Examples:
      beaver-ftc schema

    sweep: Of a sweep file instead of a scenario.
    plan: Of a plan of evidence instead of a scenario.
    """
    if plan:
        from beaver_ftc.extensions import required

        emit_json(required("plan_json_schema", "schema --plan")())
        return
    if sweep:
        from beaver_ftc.scenario.sweeps import sweep_json_schema

        emit_json(sweep_json_schema())
        return
    from beaver_ftc.scenario.schema import Scenario

    emit_json({"$schema": "https://json-schema.org/draft/2020-12/schema", **Scenario.model_json_schema()})
