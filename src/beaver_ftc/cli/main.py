"""The command `beaver-ftc`: its commands, and what becomes of errors.

A command is one thin function of a module of this package, that imports what it needs when it runs, and one
row here. `--help` must answer at once.
"""

import signal
import sys
from importlib import import_module
from typing import Annotated, NamedTuple, NoReturn

import typer

from beaver_ftc import __version__
from beaver_ftc.cli.inputs import as_typer_reads
from beaver_ftc.cli.output import failure_of, report_last


class Command(NamedTuple):
    """Where a command is, whether it flies scenarios (then plug-ins can be registered), examples of it."""

    module: str
    function: str = "command"
    flies: bool = True
    examples: tuple[str, ...] = ()


COMMANDS = {
    "run": Command("run", examples=(
        "beaver-ftc run elevator-partial-loss",
        "beaver-ftc run elevator-partial-loss --format json --no-report",
    )),
    "mismatch": Command("mismatch"),
    "validate": Command("scenarios", "validate", examples=(
        "beaver-ftc validate elevator-partial-loss fault-free",
    )),
    "schema": Command("catalogue", "schema", False, ("beaver-ftc schema",)),
    "trim": Command("studies", "trim", examples=("beaver-ftc trim --airspeed-mps 40 --altitude-m 1000",)),
    "linearise": Command("studies", "linearise"),
    "list": Command("catalogue", "list_choices", examples=("beaver-ftc list",)),
    "show": Command("catalogue", "show", False, ("beaver-ftc show elevator-partial-loss",)),
    "new": Command("scenarios", "new", flies=False, examples=(
        "beaver-ftc new my-case", "beaver-ftc new my-other-case --like elevator-partial-loss",
    )),
    "sweep": Command("sweep"),
    "compare": Command("compare"),
    "reproduce": Command("studies", "reproduce", False),
    "matrix": Command("surveys", "matrix"),
    "power": Command("surveys", "power"),
    "bench": Command("studies", "bench", False),
    "derive": Command("studies", "derive", False),
    "verify": Command("studies", "verify", False),
    "detectability": Command("studies", "detectability", False),
    "identify": Command("recorded", "identify"),
    "diagnose": Command("recorded", "diagnose"),
    "live": Command("run", "live"),
}  # fmt: skip

app = typer.Typer(
    name="beaver-ftc",
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
    """Fault diagnosis and fault-tolerant control of the DHC-2 Beaver, flown by JSBSim.

    Exit status: 0 done and every expectation met, 1 an expectation failed, 2 bad input or usage, 3 the
    simulation could not be completed.
    """


for _name, _command in COMMANDS.items():
    _function = getattr(import_module(f"beaver_ftc.cli.{_command.module}"), _command.function)
    # the examples at the end of its help, each on a line of its own
    _epilog = "\n".join(["\b", "Examples:", *(f"  {line}" for line in _command.examples)])
    _add = app.command(_name, epilog=_epilog if _command.examples else None)
    _add(as_typer_reads(_function, _command.flies))


def main() -> NoReturn:
    """Run the command line; an error becomes a line on standard error and the exit status of its kind."""
    for name in ("SIGTERM", "SIGHUP"):  # unwind: leave nothing half written
        number = getattr(signal, name, None)
        if number is not None and signal.getsignal(number) is signal.SIG_DFL:  # not under nohup
            signal.signal(number, lambda received, _: sys.exit(128 + received))
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="replace")  # a terminal that lacks a letter is no reason to fail
    try:
        app()
    except Exception as error:
        sys.exit(report_last(failure_of(error)))
    sys.exit(0)
