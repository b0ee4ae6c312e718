"""The program `beaver-ftc`: its commands by the rows of `commands.py`, its errors and its exit status.

A row names a study or a function. The docstring is the help of the command: what it does, examples, and each
option. The module of a command is imported when the command is called, so that `--help` answers at once.
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
    complain,
    failure_of,
    progress_bar,
    repeat,
    report_last,
    status_of_stop,
)
from beaver_ftc.cli.parameters import as_typer_reads
from beaver_ftc.commands import Reporter, StudyCommand
from beaver_ftc.documents.errors import Stopped
from beaver_ftc.plugins import loaded


def command_of(study: type[StudyCommand]) -> Callable[..., None]:
    """The command that runs a study, with a progress bar, and prints its answer. Its parameters are the
    fields of the study and `format`. The exit status is 1 if the study is not passed."""

    def command(format: Format, **options: Any) -> None:
        configured = study(**options)
        with progress_bar(configured.label) as progress:
            document = configured.run(Reporter(progress, complain))
        answer(format, document, lambda: configured.as_text(document, sys.stdout.isatty()))
        if not configured.passed(document):
            raise typer.Exit(1)

    fields = signature(study).parameters.values()
    last = Parameter("format", Parameter.KEYWORD_ONLY, default=Format.text, annotation=FormatOption)
    command.__signature__ = Signature([*fields, last])  # type: ignore[attr-defined]
    command.__doc__ = study.__doc__
    return command


class Row(TyperCommand):
    """A command by its row. Its summary is read from the source; its module is imported by `read`."""

    def __init__(self, name: str, target: str) -> None:
        super().__init__(name)
        self.target = target

    def get_short_help_str(self, limit: int = 45) -> str:
        """The first line of its help."""
        return TyperCommand(self.name, help=commands.summary(self.target)).get_short_help_str(limit)

    def read(self) -> Callable[..., None]:
        """The study or function of the row, as typer reads it."""
        target = loaded(self.target)
        command = command_of(target) if isinstance(target, type) else target
        return as_typer_reads(command, getattr(target, "PLUGINS", True))

    def whole(self) -> Any:
        """The command with its options and its help. The examples are its epilog, each on its own line."""
        function = self.read()
        function.__doc__, _, examples = str(function.__doc__).partition("\n\nExamples:\n")
        program = typer.Typer(add_completion=False, rich_markup_mode=None)
        program.command(self.name, epilog=f"\b\nExamples:\n{examples}" if examples else None)(function)
        return typer.main.get_command(program)


class Rows(TyperGroup):
    """The commands of the program, or of a group, by their rows."""

    def __init__(self, **attributes: Any) -> None:
        super().__init__(**attributes)
        group = f"{self.name} " if self.name in commands.groups() else ""
        for name, target in commands.registered().items():
            last = name.removeprefix(group)
            if name.startswith(group) and " " not in last:
                self.add_command(Row(last, target))

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write the commands of the program by topic, on one screen; those of a group, one in a line."""
        if ctx.parent is not None:
            super().format_commands(ctx, formatter)
            return
        rows = [
            (topic, "; ".join(f"{name}: {text}".removesuffix(": ") for name, text in summaries.items()))
            for topic, summaries in commands.topics(self.commands).items()
        ]
        with formatter.section("Commands"):
            formatter.write_dl(rows)

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """The command that is called, with its options. A former name gives a notice on standard error."""
        if ctx.parent is None and args[0] in commands.FORMER:
            present = commands.FORMER[args[0]]
            complain(f"{args[0]} is a former name: type beaver-ftc {' '.join(present)}")
            args = [*present, *args[1:]]
        name, command, arguments = super().resolve_command(ctx, args)
        return name, command.whole() if isinstance(command, Row) else command, arguments


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


for _name, _help in commands.groups().items():
    _group = typer.Typer(name=_name, cls=Rows, help=_help, no_args_is_help=True, rich_markup_mode=None)
    app.add_typer(_group, context_settings={"help_option_names": ["-h", "--help"]})


def every_command() -> dict[str, Any]:
    """Each command by name, with its options and its help."""
    return {name: Row(name.rpartition(" ")[2], at).whole() for name, at in commands.registered().items()}


def _stop(received: int, _: object) -> NoReturn:
    """End the command after a signal, by an exception, so that it removes what it has half written."""

    def lose(lost: Any) -> None:
        if issubclass(lost.exc_type, (KeyboardInterrupt, Stopped)):
            repeat(received)
        # otherwise: the signal left an object half made, whose error has no reader

    sys.unraisablehook = lose
    raise Stopped(128 + received)


def main() -> NoReturn:
    """Run the command line; an error becomes a line on standard error and the exit status of its kind."""
    for name in ("SIGTERM", "SIGHUP"):
        number = getattr(signal, name, None)
        if number is not None and signal.getsignal(number) is signal.SIG_DFL:  # not under nohup
            signal.signal(number, _stop)
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="replace")  # a letter that the terminal lacks is replaced
    try:
        app()
    except Exception as error:
        sys.exit(status_of_stop(error) or report_last(failure_of(error)))
    sys.exit(0)
