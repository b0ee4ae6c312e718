"""The parameters of a command as typer reads them, from its signature and its docstring."""

from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import is_dataclass
from functools import wraps
from inspect import Parameter, Signature, signature
from typing import Annotated, Any, get_args

import typer

from beaver_ftc.documents.errors import split_docstring

PluginOption = Annotated[
    list[str] | None,
    typer.Option(
        "--plugin",
        metavar="[NAME=]MODULE:CLASS",
        help="Register your own detector or law as NAME for this command. Without NAME: MyClass as my-class.",
    ),
]


def as_typer_reads(command: Callable[..., None], flies: bool) -> Callable[..., None]:
    """A command as typer reads it. Its parameters are those of the function, or the fields of the dataclass
    that is its first parameter.

    A line `name: help` at the end of the docstring is the help of this parameter. A parameter without an
    annotation for typer is an option, and a bool among them a switch. A command that `flies` also has the
    option --plugin, whose classes are registered before the command runs.
    """
    first = next(iter(signature(command).parameters.values())).annotation
    record = first if isinstance(first, type) and is_dataclass(first) else None
    named = signature(record or command).parameters
    about, helps = split_docstring(command.__doc__, named)
    parameters = [_annotated(parameter, helps.get(name)) for name, parameter in named.items()]
    if flies:
        parameters.append(Parameter("plugin", Parameter.KEYWORD_ONLY, default=None, annotation=PluginOption))

    @wraps(command)
    def called(plugin: Sequence[str] | None = None, **given: Any) -> None:
        if plugin:
            from beaver_ftc.plugins import register

            for class_path in plugin:
                register(class_path)
        command(**given) if record is None else command(record(**given))

    called.__doc__ = about
    called.__signature__ = Signature(parameters)  # type: ignore[attr-defined]
    called.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
    return called


def _annotated(parameter: Parameter, help: str | None) -> Parameter:
    """A parameter annotated for typer, with this help, if there is one."""
    kind = parameter.annotation
    declared = None
    if hasattr(kind, "__metadata__"):
        kind, declared = get_args(kind)
    switch = [f"--{parameter.name.replace('_', '-')}"] if kind is bool else []
    option = copy(declared) or typer.Option(*switch)
    if help:
        option.help = help
    return parameter.replace(annotation=Annotated[kind, option])
