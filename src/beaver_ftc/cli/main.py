"""The command `beaver-ftc`: its commands, and what becomes of errors.

A command is one thin function of a module of this package, that imports what it needs when it runs, and one
row here. Its docstring is its help: what it does, examples, what each option means. `--help` must answer at
once.
"""

import signal
import sys
from importlib import import_module
from typing import Annotated, NoReturn

import typer

from beaver_ftc import __version__
from beaver_ftc.cli.inputs import as_typer_reads
from beaver_ftc.cli.output import failure_of, report_last, status_of_stop

# Where each is: a module, and its function there.
COMMANDS = {
    "run": "beaver_ftc.cli.run:command",
    "check": "beaver_ftc_assurance.commands.check:command",
    "mismatch": "beaver_ftc.cli.mismatch:command",
    "validate": "beaver_ftc.cli.scenarios:validate",
    "schema": "beaver_ftc.cli.catalogue:schema",
    "trim": "beaver_ftc.cli.studies:trim",
    "linearise": "beaver_ftc.cli.studies:linearise",
    "list": "beaver_ftc.cli.catalogue:list_choices",
    "show": "beaver_ftc.cli.catalogue:show",
    "new": "beaver_ftc.cli.scenarios:new",
    "sweep": "beaver_ftc.cli.sweep:command",
    "compare": "beaver_ftc.cli.compare:command",
    "evidence": "beaver_ftc_assurance.commands.evidence:command",
    "reproduce": "beaver_ftc.cli.studies:reproduce",
    "matrix": "beaver_ftc.cli.surveys:matrix",
    "power": "beaver_ftc.cli.surveys:power",
    "smallest": "beaver_ftc.cli.surveys:smallest",
    "bench": "beaver_ftc.cli.studies:bench",
    "derive": "beaver_ftc_aircraft.commands:derive",
    "verify": "beaver_ftc.cli.studies:verify",
    "detectability": "beaver_ftc.cli.studies:detectability",
    "separate": "beaver_ftc_assurance.commands.separate:command",
    "identify": "beaver_ftc_logs.commands:identify",
    "diagnose": "beaver_ftc_logs.commands:diagnose",
    "live": "beaver_ftc_live.commands.live:command",
    "sitl": "beaver_ftc_links.commands:command",
    "import gtm": "beaver_ftc_aircraft.commands:gtm",
    "challenge new": "beaver_ftc_live.commands.challenge:new",
    "challenge submit": "beaver_ftc_live.commands.challenge:submit",
    "challenge grade": "beaver_ftc_live.commands.challenge:grade",
}
# Of a command that has commands of its own: what it is for.
GROUPS = {
    "import": "Make aircraft of data that others publish.",
    "challenge": "Grade a class's detectors and laws on hidden flights.",
}
# Those that fly no scenario of the user's choice: no plug-in can be registered for them.
WITHOUT_PLUGINS = {
    "check",
    "schema",
    "show",
    "new",
    "reproduce",
    "bench",
    "derive",
    "verify",
    "detectability",
}
WITHOUT_PLUGINS |= {"import gtm", "challenge new", "challenge submit", "challenge grade"}

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


_groups = {
    name: typer.Typer(name=name, help=says, no_args_is_help=True, rich_markup_mode=None)
    for name, says in GROUPS.items()
}
for _group in _groups.values():
    app.add_typer(_group, context_settings={"help_option_names": ["-h", "--help"]})
for _name, _where in COMMANDS.items():
    _module, _, _function = _where.partition(":")
    _command = getattr(import_module(_module), _function)
    _read = as_typer_reads(_command, flies=_name not in WITHOUT_PLUGINS)
    # the examples at the end of its help, each on a line of its own
    _read.__doc__, _, _examples = str(_read.__doc__).partition("\n\nExamples:\n")
    _above, _, _last = _name.rpartition(" ")
    _place = _groups.get(_above, app)
    _place.command(_last, epilog=f"\b\nExamples:\n{_examples}" if _examples else None)(_read)


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
        sys.exit(status_of_stop(error) or report_last(failure_of(error)))
    sys.exit(0)
