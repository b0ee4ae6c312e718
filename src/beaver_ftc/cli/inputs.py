"""What commands are given: options that several share, and scenarios, checked before the first one flies."""

from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import is_dataclass
from functools import wraps
from inspect import Parameter, Signature, signature
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, get_args

import typer

from beaver_ftc.documents.docstrings import split_docstring
from beaver_ftc.documents.errors import BadInput
from beaver_ftc.studies.engine.command import (
    SCENARIO,
    ScenarioArgument,
    WorkersOption,
    complete_names,
    listed,
)

if TYPE_CHECKING:
    from beaver_ftc.scenario.schema import Scenario

__all__ = ["ScenarioArgument", "WorkersOption", "complete_names", "listed"]  # those that studies have as well

ScenariosArgument = Annotated[list[str], SCENARIO]
ResultsOption = Annotated[Path, typer.Option(help="Folder for the results, one folder a scenario in it.")]
NoReportOption = Annotated[bool, typer.Option("--no-report", help="Skip report.html and the figures.")]
JunitOption = Annotated[
    Path | None, typer.Option(metavar="FILE", help="Also write the verdict as JUnit XML, for CI.")
]
PluginOption = Annotated[
    list[str] | None,
    typer.Option(
        "--plugin",
        metavar="[NAME=]MODULE:CLASS",
        help="Register a detector or law for this run, under NAME; if left out, MyClass is my-class.",
    ),
]


def as_typer_reads(command: Callable[..., None], flies: bool) -> Callable[..., None]:
    """A command as typer reads it: its parameters, or the fields of the dataclass that is its only one.

    What the command's docstring says of one, `name: ...` at its end, is the help of that one. One that is not
    annotated is an option; one that is true or false a switch, off if left out. A command that flies has
    --plugin besides, whose classes are registered before it runs.
    """
    first = next(iter(signature(command).parameters.values())).annotation
    record = first if isinstance(first, type) and is_dataclass(first) else None
    own = signature(record or command).parameters
    about, helps = split_docstring(command.__doc__, own)
    parameters = [_annotated(each, helps.get(name)) for name, each in own.items()]
    if flies:
        parameters.append(Parameter("plugin", Parameter.KEYWORD_ONLY, default=None, annotation=PluginOption))

    @wraps(command)
    def called(plugin: Sequence[str] | None = None, **given: Any) -> None:
        if plugin:
            from beaver_ftc.plugins import register

            for each in plugin:
                register(each)
        command(**given) if record is None else command(record(**given))

    called.__doc__ = about
    called.__signature__ = Signature(parameters)  # type: ignore[attr-defined]
    called.__annotations__ = {each.name: each.annotation for each in parameters}
    return called


def _annotated(parameter: Parameter, help: str | None) -> Parameter:
    """A parameter as typer is to read it, with this help if any."""
    kind, given = parameter.annotation, None
    if hasattr(kind, "__metadata__"):
        kind, given = get_args(kind)
    switch = [f"--{parameter.name.replace('_', '-')}"] if kind is bool else []
    option = copy(given) or typer.Option(*switch)
    if help:
        option.help = help
    return parameter.replace(annotation=Annotated[kind, option])


def load_all(names: list[str]) -> list["Scenario"]:
    """The scenarios of these files or built-in names. Raises BadInput with every mistake in all of them."""
    from beaver_ftc.scenario.loader import load_scenario

    loaded: list[Scenario] = []
    mistakes: list[str] = []
    for name in names:
        try:
            loaded.append(load_scenario(name))
            check_flyable(loaded[-1], name)
        except BadInput as error:
            mistakes.append(str(error))
    given = [scenario.name for scenario in loaded]
    twice = dict.fromkeys(name for name in given if given.count(name) > 1)
    mistakes += [f"two scenarios are named {name}: one result would replace the other" for name in twice]
    if mistakes:
        raise BadInput("\n".join(mistakes))
    return loaded


def check_flyable(scenario: "Scenario", name: str) -> None:
    """Raise BadInput, in the form of any other mistake in a file, if the flight cannot be trimmed.

    The trim is kept: the flight does not search for it again."""
    from beaver_ftc.documents.validation import parse_document
    from beaver_ftc.plant.conditions import find_trim
    from beaver_ftc.scenario.builtin import read_file, resolve

    try:
        find_trim(scenario)
    except BadInput as error:
        path = resolve(name)
        line = parse_document(read_file(path, name), str(path)).line(("initial",))
        raise BadInput(f"{path}:{line}: initial: {error}") from None
