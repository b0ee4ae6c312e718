"""The commands with all their options, and the exit statuses: from the argument parsers and the errors."""

import re
from collections.abc import Iterator
from typing import Any

import typer

from beaver_ftc.cli.main import app, every_command
from beaver_ftc.documents import errors
from beaver_ftc.studies.present.tables import markdown_table

PARSER: Any = typer.main.get_command(app)


def page() -> str:
    """Every command."""
    says = "Which commands are there, and what does each take? `beaver-ftc COMMAND --help` says the same."
    parts = ["# Commands", says, *_described(PARSER, "beaver-ftc")]
    for name, command in every_command().items():
        parts += [f"## {name}", *_described(command, f"beaver-ftc {name}")]
    return "\n\n".join(parts) + "\n"


def _described(command: Any, called: str) -> Iterator[str]:
    """What it does, how it is called, its options, its examples."""
    context = command.make_context(called, [], resilient_parsing=True)
    yield f"```text\n{' '.join([called, *command.collect_usage_pieces(context)])}\n```"
    yield "\n\n".join(_in_html(" ".join(part.split())) for part in command.help.split("\n\n"))
    records = (each.get_help_record(context) for each in command.params)
    rows = [(f"`{name}`", _in_html(says)) for name, says in filter(None, records)]
    yield markdown_table(("option", "what it is"), rows)
    _, _, examples = (command.epilog or "").partition("Examples:\n")
    if examples:
        yield "```console\n" + re.sub(r"^ +", "$ ", examples.rstrip(), flags=re.MULTILINE) + "\n```"


def _in_html(text: str) -> str:
    return " ".join(text.split()).replace("<", "&lt;")


def statuses_page() -> str:
    """The exit statuses: what `beaver-ftc --help` says of each, and the errors that end with it."""
    says = "Which exit status does a command end with, and what follows from it?"
    _, _, listed = PARSER.help.partition("Exit status: ")
    found = re.findall(r"(\d+) ([^,.]+)", " ".join(listed.split()))
    raised = {
        error.exit_code: f"`{error.__name__}`: {' '.join(str(error.__doc__).split())}"
        for error in vars(errors).values()
        if isinstance(error, type) and issubclass(error, errors.BeaverFtcError)
    }
    rows = [(f"`{status}`", means, raised.get(int(status), "")) for status, means in found]
    rows.append(("`128 + N`", "ended by signal N; each result file is complete or absent", ""))
    return f"# Exit statuses\n\n{says}\n\n{markdown_table(('status', 'means', 'in Python'), rows)}\n"
