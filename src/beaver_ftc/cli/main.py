"""The command `beaver-ftc`: its commands, and what becomes of errors.

`commands.py` has a row each. A command is a study, or a thin function of a module of this package. Its
docstring is its help: what it does, examples, what each option means. `--help` must answer at once. A
study as a command has its options, a progress bar, its answer and its exit status, the same for all.
"""

import signal
import sys
from collections.abc import Callable
from inspect import Parameter, Signature, signature
from typing import Annotated, Any, NoReturn

import typer
from typer.core import TyperCommand, TyperGroup

from beaver_ftc import __version__, commands
from beaver_ftc.cli import (
    Format,
    FormatOption,
    answer,
    as_typer_reads,
    complain,
    failure_of,
    progress_bar,
    repeat,
    report_last,
    status_of_stop,
)
from beaver_ftc.commands import Reporter, StudyCommand
from beaver_ftc.documents.errors import Stopped
from beaver_ftc.plugins import loaded


def command_of(study: type[StudyCommand]) -> Callable[..., None]:
    """The command that runs a study; its parameters are the study's fields and `format`."""

    def command(format: Format, **options: Any) -> None:
        asked = study(**options)
        with progress_bar(asked.label) as progress:
            document = asked.run(Reporter(progress, complain))
        answer(format, document, lambda: asked.as_text(document, sys.stdout.isatty()))
        if not asked.passed(document):
            raise typer.Exit(1)

    own = signature(study).parameters.values()
    last = Parameter("format", Parameter.KEYWORD_ONLY, default=Format.text, annotation=FormatOption)
    command.__signature__ = Signature([*own, last])  # type: ignore[attr-defined]
    command.__doc__ = study.__doc__
    return command


class Row(TyperCommand):
    """A command by its row: its summary is read from the source, the rest imported when it is called."""

    def __init__(self, name: str, target: str) -> None:
        super().__init__(name)
        self.target = target

    def get_short_help_str(self, limit: int = 45) -> str:
        """The first line of its help."""
        return TyperCommand(self.name, help=commands.summary(self.target)).get_short_help_str(limit)

    def read(self) -> Callable[..., None]:
        """What the row names, as typer reads it."""
        target = loaded(self.target)
        command = command_of(target) if isinstance(target, type) else target
        return as_typer_reads(command, getattr(target, "PLUGINS", True))

    def whole(self) -> Any:
        """The command with its options and its help; the examples at its end on lines of their own."""
        read = self.read()
        read.__doc__, _, examples = str(read.__doc__).partition("\n\nExamples:\n")
        alone = typer.Typer(add_completion=False, rich_markup_mode=None)
        alone.command(self.name, epilog=f"\b\nExamples:\n{examples}" if examples else None)(read)
        return typer.main.get_command(alone)


class Rows(TyperGroup):
    """Commands by their rows, those of a group without its name."""

    def __init__(self, **attributes: Any) -> None:
        super().__init__(**attributes)
        above = f"{self.name} " if self.name in commands.groups() else ""
        for name, target in commands.registered().items():
            last = name.removeprefix(above)
            if name.startswith(above) and " " not in last:
                self.add_command(Row(last, target))

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Those of the program by topic, on one screen."""
        if ctx.parent is not None:
            super().format_commands(ctx, formatter)
            return
        rows = [
            (topic, "; ".join(f"{name}: {says}".removesuffix(": ") for name, says in of.items()))
            for topic, of in commands.topics(self.commands).items()
        ]
        with formatter.section("Commands"):
            formatter.write_dl(rows)

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """The command that is called, whole; by a former name with a notice."""
        if ctx.parent is None and args[0] in commands.FORMER:
            now = commands.FORMER[args[0]]
            complain(f"{args[0]} is a former name: type beaver-ftc {' '.join(now)}")
            args = [*now, *args[1:]]
        name, command, rest = super().resolve_command(ctx, args)
        return name, command.whole() if isinstance(command, Row) else command, rest


app = typer.Typer(
    name="beaver-ftc",
    cls=Rows,
    no_args_is_help=True,
    add_completion=True,
    rich_markup_mode=None,  # plain help: importing rich for it would cost a third of the time to answer
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"beaver-ftc {__version__}")
        raise typer.Exit


@app.callback()
def options(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    """Fault diagnosis and fault-tolerant control of the DHC-2 Beaver in JSBSim.

    Exit status: 0 = done and every expectation met, 1 = an expectation or a check failed, 2 = bad input or
    usage, 3 = the simulation could not be completed.
    """


for _name, _says in commands.groups().items():
    _group = typer.Typer(name=_name, cls=Rows, help=_says, no_args_is_help=True, rich_markup_mode=None)
    app.add_typer(_group, context_settings={"help_option_names": ["-h", "--help"]})


def every_command() -> dict[str, Any]:
    """Each command by name, whole, with its options and its help."""
    return {name: Row(name.rpartition(" ")[2], at).whole() for name, at in commands.registered().items()}


def _stop(received: int, _: object) -> NoReturn:
    def lose(lost: Any) -> None:
        if issubclass(lost.exc_type, (KeyboardInterrupt, Stopped)):
            repeat(received)
        # else: of an object that the signal leaves half made nobody needs to read

    sys.unraisablehook = lose
    raise Stopped(128 + received)


def main() -> NoReturn:
    """Run the command line; an error becomes a line on standard error and the exit status of its kind."""
    for name in ("SIGTERM", "SIGHUP"):  # unwind: leave nothing half written
        number = getattr(signal, name, None)
        if number is not None and signal.getsignal(number) is signal.SIG_DFL:  # not under nohup
            signal.signal(number, _stop)
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="replace")  # a terminal that lacks a letter is no reason to fail
    try:
        app()
    except Exception as error:
        sys.exit(status_of_stop(error) or report_last(failure_of(error)))
    sys.exit(0)
