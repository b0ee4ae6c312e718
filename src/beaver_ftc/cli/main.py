"""The command `beaver-ftc`: its commands, and what becomes of errors.

A command is one module of this package with a function `command`, thin, importing what it needs when it runs,
and one name here. `--help` must answer at once.
"""

import signal
import sys
from importlib import import_module
from typing import Annotated, NoReturn

import typer

from beaver_ftc import __version__
from beaver_ftc.cli.inputs import with_plugins
from beaver_ftc.cli.output import report_last, unexpected
from beaver_ftc.documents.errors import BeaverFtcError

COMMANDS = (
    "run",
    "mismatch",
    "validate",
    "schema",
    "trim",
    "linearise",
    "list",
    "show",
    "new",
    "sweep",
    "compare",
    "reproduce",
    "matrix",
    "power",
    "bench",
    "derive",
    "verify",
    "detectability",
    "identify",
    "diagnose",
    "live",
)

WITHOUT_SCENARIOS = ("schema", "show", "new", "bench", "verify", "detectability", "reproduce", "derive")

EXAMPLES = {
    "run": (
        "beaver-ftc run elevator-partial-loss",
        "beaver-ftc run elevator-partial-loss --format json --no-report",
    ),
    "validate": ("beaver-ftc validate elevator-partial-loss fault-free",),
    "show": ("beaver-ftc show elevator-partial-loss",),
    "new": ("beaver-ftc new my-case", "beaver-ftc new my-other-case --like elevator-partial-loss"),
    "list": ("beaver-ftc list",),
    "trim": ("beaver-ftc trim --airspeed-mps 40 --altitude-m 1000",),
    "schema": ("beaver-ftc schema",),
}

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


def _examples(name: str) -> str | None:
    """The examples at the end of a command's help, each on a line of its own."""
    lines = EXAMPLES.get(name)
    return "\n".join(["\b", "Examples:", *(f"  {line}" for line in lines)]) if lines else None


for _name in COMMANDS:
    _command = import_module(f"beaver_ftc.cli.{_name}").command
    app.command(_name, epilog=_examples(_name))(
        _command if _name in WITHOUT_SCENARIOS else with_plugins(_command)
    )


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
    except BeaverFtcError as error:
        sys.exit(report_last(error))
    except Exception as error:
        sys.exit(report_last(unexpected(error)))
    sys.exit(0)
