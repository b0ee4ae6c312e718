"""What commands are given: options that several share, and scenarios, checked before the first one flies."""

from collections.abc import Callable
from enum import StrEnum
from functools import wraps
from inspect import Parameter, Signature, signature
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from beaver_ftc.documents.errors import BadInput

if TYPE_CHECKING:
    from beaver_ftc.scenario.schema import Scenario


class TurbulenceName(StrEnum):
    """The air there is to fly in."""

    none = "none"
    light = "light"
    moderate = "moderate"


def complete_names(incomplete: str) -> list[str]:
    """Built-in scenarios whose names begin so, for the shell."""
    from beaver_ftc.scenario.loader import builtin_names

    return [name for name in builtin_names() if name.startswith(incomplete)]


_SCENARIO = typer.Argument(
    metavar="SCENARIO", help="A file, or the name of a built-in scenario.", autocompletion=complete_names
)
ScenarioArgument = Annotated[str, _SCENARIO]
ScenariosArgument = Annotated[list[str], _SCENARIO]
ResultsOption = Annotated[Path, typer.Option(help="Folder for the results, one folder a scenario in it.")]
NoReportOption = Annotated[bool, typer.Option("--no-report", help="Skip report.html and the figures.")]
JunitOption = Annotated[
    Path | None, typer.Option(metavar="FILE", help="Also write the verdict as JUnit XML, for CI.")
]
WorkersOption = Annotated[int | None, typer.Option(min=1, max=1024, help="Processes; default: one a core.")]
PluginOption = Annotated[
    list[str] | None,
    typer.Option(
        "--plugin",
        metavar="[NAME=]MODULE:CLASS",
        help="Register a detector or law for this run, under NAME; if left out, MyClass is my-class.",
    ),
]


def with_plugins(command: Callable[..., None]) -> Callable[..., None]:
    """The command with an option --plugin, whose classes are registered before it runs."""

    @wraps(command)
    def plugged(*arguments: Any, plugin: list[str] | None = None, **options: Any) -> None:
        if plugin:
            from beaver_ftc.plugins import register

            for given in plugin:
                register(given)
        command(*arguments, **options)

    own = signature(command)
    option = Parameter("plugin", Parameter.KEYWORD_ONLY, default=None, annotation=PluginOption)
    return _signed(plugged, own.replace(parameters=[*own.parameters.values(), option]))


def taking(record: type[Any]) -> Callable[[Callable[[Any], None]], Callable[..., None]]:
    """A command that takes its arguments and options as one record: the fields of a dataclass, in its order.

    @dataclass(frozen=True)
    class Options:
        files: Annotated[list[str], typer.Argument(help="...")]
        out: ResultsOption = Path("runs")

    @taking(Options)
    def command(options: Options) -> None: ...
    """

    def made(command: Callable[[Any], None]) -> Callable[..., None]:
        @wraps(command)
        def called(**given: Any) -> None:
            command(record(**given))

        return _signed(called, signature(record))

    return made


def _signed(command: Callable[..., None], own: Signature) -> Callable[..., None]:
    """The command as typer is to read it: its parameters, with what is annotated of them."""
    command.__signature__ = own  # type: ignore[attr-defined]
    command.__annotations__ = {name: each.annotation for name, each in own.parameters.items()}
    return command


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
    mistakes += _repeated([scenario.name for scenario in loaded])
    if mistakes:
        raise BadInput("\n".join(mistakes))
    return loaded


def check_flyable(scenario: "Scenario", name: str) -> None:
    """Raise BadInput, in the form of any other mistake in a file, if the flight cannot be trimmed."""
    from beaver_ftc.plant.conditions import trimmed

    try:
        trimmed(scenario)
    except BadInput as error:
        raise BadInput(f"{_place_of_initial(name)}: initial: {error}") from None


def _repeated(names: list[str]) -> list[str]:
    twice = dict.fromkeys(name for name in names if names.count(name) > 1)
    return [f"two scenarios are named {name}: one result would replace the other" for name in twice]


def _place_of_initial(name: str) -> str:
    """FILE:LINE of the flight condition, the file's first line where it is left to the defaults."""
    from beaver_ftc.documents.validation import parse_document
    from beaver_ftc.scenario.loader import read_file, resolve

    path = resolve(name)
    return f"{path}:{parse_document(read_file(path, name), str(path)).line(('initial',))}"
