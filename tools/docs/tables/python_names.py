"""The public Python names, in docs/reference/python.md: those of python_names.yaml, with their docstrings."""

import inspect
import re
from collections.abc import Iterator, Mapping
from typing import Any

from pydantic import BaseModel

import beaver_ftc as bf
from beaver_ftc.studies.present.tables import markdown_table
from tools.data import beside

RECORDS = "results.model"
Names = Mapping[str, list[str]]
NAMES: dict[str, Names] = beside(__file__)
SAYS = {
    "Records of a flight": "The attributes of a `Flight` are records, with the fields of `metrics.json`.",
    "Aircraft, trim and linear models": "`bf.aircraft(NAME)` calls `aircraft.load`. It also derives "
    "`jsbsim:NAME` at the first use, and checks `./FOLDER` against its JSBSim model.",
    "Errors": "Subclasses of `BadInput` are `ScenarioError`, `UnknownAircraft` and `NotDerived`.",
}
FIRST = 2  # number of the first of these tables on the page


def python_names() -> str:
    """For a reader of Markdown: a table for each heading, with signatures and first sentences."""
    parts = []
    for number, (heading, names) in enumerate(NAMES.items(), FIRST):
        caption = " ".join(filter(None, [f"Table {number}. {heading}.", SAYS.get(heading)]))
        parts += [f"*{caption}*", markdown_table(("name", "meaning"), list(_described(names)))]
    return "\n\n".join(parts) + "\n"


def directives() -> str:
    """For a generator that reads docstrings by itself: a directive a name."""
    parts = []
    for heading, names in NAMES.items():
        parts += [f"### {heading}", *filter(None, [SAYS.get(heading)])]
        parts += [_directive(name, members) for name, members in names.items()]
    return "\n\n".join(parts)


def _directive(name: str, members: list[str]) -> str:
    options = [f"      members: [{', '.join(members)}]"] if members else []
    options += ["      inherited_members: false"] if name.startswith(RECORDS) else []
    return "\n".join([f"::: beaver_ftc.{name}", *(["    options:"] if options else []), *options])


def found(name: str) -> Any:
    """What a name of the page stands for."""
    from importlib import import_module

    module, _, last = f"beaver_ftc.{name}".rpartition(".")
    return getattr(bf, name) if hasattr(bf, name) else getattr(import_module(module), last)


def _described(names: Names) -> Iterator[tuple[str, str]]:
    """Signature and docstring, of a class those of its methods too; of a record, its own methods alone."""
    for name, members in names.items():
        what = found(name)
        yield _entry(name, what)
        for member, of in inspect.getmembers(what, inspect.isfunction) if inspect.isclass(what) else ():
            shown = member in members if members else not member.startswith("_")
            own = member in vars(what) or not name.startswith(RECORDS)
            if shown and own and of.__doc__ and of.__module__.startswith("beaver_ftc"):
                yield _entry(f"{name}.{member}", of)


def _entry(name: str, what: Any) -> tuple[str, str]:
    return f"`{_signature(name, what)}`", _first(what)


def _signature(name: str, what: Any) -> str:
    """The call with the names of its arguments; of a record, the name alone."""
    contract = getattr(what, "_is_protocol", False)  # its class needs no arguments
    if contract or (inspect.isclass(what) and issubclass(what, BaseModel | Exception)):
        return name
    shown = [
        one.replace(annotation=inspect.Parameter.empty, default=inspect.Parameter.empty)
        for one in inspect.signature(what).parameters.values()
        if one.name != "self" and not one.name.startswith("_")
    ]
    return name + str(inspect.Signature(shown))


def _first(what: Any) -> str:
    """The first sentence of the docstring."""
    return re.split(r"\.\s", " ".join((inspect.getdoc(what) or "").partition("\n\n")[0].split()))[0].rstrip(
        "."
    )
