"""`beaver-ftc list`, `show` and `schema`: the built-in choices, their files, and the JSON Schemas."""

from collections.abc import Iterable, Iterator
from textwrap import fill, indent
from typing import Annotated, get_args

import typer

from beaver_ftc.cli import Format, FormatOption, answer, complete_names, emit, emit_json
from beaver_ftc.commands import declare
from beaver_ftc.documents.errors import BadInput, suggestion

Entries = list[dict[str, str]]
WIDTH = 76


def list_choices(
    kind: Annotated[str | None, typer.Argument(metavar="KIND")] = None,
    short: bool = False,
    format: FormatOption = Format.text,
) -> None:
    """List scenarios, aircraft, schemes, laws and fault types.

    The lists are: built-in scenarios, sweeps and plans of evidence, aircraft, diagnosis schemes, control
    laws, fault types and reference signals.

    Examples:
      beaver-ftc list --short

    kind: Print only this list, e.g. aircraft.
    short: Print only the names, without descriptions.
    """
    available = _available()
    if kind is not None and kind not in available:
        raise BadInput(f"there is no list of {kind[:60]!r}{suggestion(kind, available)}")
    available = available if kind is None else {kind: available[kind]}
    section, gap = (_names, "\n") if short else (_section, "\n\n")
    answer(format, available, lambda: gap.join(map(section, available, available.values())))


def _available() -> dict[str, Entries]:
    """The lists by kind; an entry has a name and a description."""
    from beaver_ftc.plugins import DETECTORS, LAWS
    from beaver_ftc.scenario.builtin import described

    available: dict[str, Iterable[tuple[str, str]]] = {
        "scenarios": described("scenario"),
        "sweeps": described("sweep"),
        "plans": described("plan"),
        "aircraft": _aircraft(),
        "schemes": _registered(DETECTORS),
        "laws": _registered(LAWS),
        "faults": _faults(),
        "signals": _signals(),
    }
    return {
        kind: [{"name": name, "description": description} for name, description in entries]
        for kind, entries in available.items()
    }


def _aircraft() -> Iterator[tuple[str, str]]:
    """The built-in aircraft, the imported ones and those that can be imported, and those of the jsbsim
    package."""
    from beaver_ftc.aircraft import builtin_names, load
    from beaver_ftc.aircraft.aircraft import FILE, IMPORTED, imported_folder, is_derived
    from beaver_ftc.plant.instrumented import names

    for name in builtin_names():
        yield name, load(name).file.description
    for name, how in IMPORTED.items():
        here = (imported_folder(name) / FILE).is_file()
        yield name, load(name).file.description if here else f"not imported yet, allowed after {how}"
    for name in names():
        made = "derived" if is_derived(name) else "derived at first use"
        yield f"jsbsim:{name}", f"from the jsbsim package, {made}"


def _registered(group: str) -> Iterator[tuple[str, str]]:
    """The detectors or laws that a scenario may name, also those of other installed packages."""
    from beaver_ftc.plugins import OURS, registered

    for entry in registered(group).values():
        yield entry.name, entry.description() + ("" if entry.package == OURS else f" [{entry.package}]")


def _faults() -> Iterator[tuple[str, str]]:
    """The fault types: of actuators, then of sensors."""
    from beaver_ftc.scenario.faults import SENSOR_TYPES, TYPES

    for types, beginning in ((TYPES, ""), (SENSOR_TYPES, "of a sensor: ")):
        for name, row in sorted(types.items(), key=lambda name_and_row: name_and_row[1].__name__):
            yield name, beginning + _first_paragraph(row)


def _signals() -> Iterator[tuple[str, str]]:
    """The reference signals."""
    from beaver_ftc.scenario.signals import Signal

    for name, shape in Signal.model_fields.items():
        yield name, _first_paragraph(get_args(shape.annotation)[0])


def _first_paragraph(described: type) -> str:
    """The first paragraph of the docstring, as one line."""
    return " ".join((described.__doc__ or "").partition("\n\n")[0].split())


def _section(kind: str, entries: Entries) -> str:
    """A list with descriptions, as text."""
    width = max((len(entry["name"]) for entry in entries), default=0)
    lines = (f"  {entry['name']:{width}}  {entry['description']}".rstrip() for entry in entries)
    return "\n".join((kind, *lines))


def _names(kind: str, entries: Entries) -> str:
    """A list of names, as text."""
    names = fill(", ".join(entry["name"] for entry in entries), WIDTH, break_on_hyphens=False)
    return f"{kind}\n{indent(names, '  ')}"


@declare(plugins=False)
def show(
    name: Annotated[str, typer.Argument(metavar="NAME", autocompletion=complete_names)],
) -> None:
    """Print a built-in scenario, sweep or plan of evidence.

    If you save the text in a file, `run`, `sweep` or `evidence` can read this file.

    Examples:
      beaver-ftc show elevator-partial-loss

    name: Name of a built-in scenario, sweep or plan of evidence.
    """
    from beaver_ftc.scenario.builtin import builtin_names, builtin_plans, builtin_sweeps, resolve

    kinds = {"scenario": builtin_names(), "sweep": builtin_sweeps(), "plan": builtin_plans()}
    kind = next((kind for kind, names in kinds.items() if name in names), None)
    if kind is None:
        known = [choice for names in kinds.values() for choice in names]
        raise BadInput(f"show: no built-in scenario, sweep or plan {name[:100]!r}{suggestion(name, known)}")
    emit(resolve(name, kind).read_text(encoding="utf-8"))


@declare(plugins=False)
def schema(sweep: bool = False, plan: bool = False) -> None:
    """Print the JSON Schema of a scenario.

    An editor that reads the schema completes and checks a scenario while you write it.

    Examples:
      beaver-ftc schema

    sweep: Print the schema of a sweep file.
    plan: Print the schema of a plan of evidence.
    """
    if sweep and plan:
        raise BadInput("--sweep and --plan exclude each other, allowed: one of them")
    if plan:
        from beaver_ftc.plugins import required

        json_schema = required("plan_json_schema", "schema --plan")
    elif sweep:
        from beaver_ftc.scenario.sweeps import sweep_json_schema as json_schema
    else:
        from beaver_ftc.scenario.schema import json_schema
    emit_json(json_schema())
