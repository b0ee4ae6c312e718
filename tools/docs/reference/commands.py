"""The commands with all their options, and the exit statuses: from the argument parsers and the errors."""

import re
from collections.abc import Iterator
from typing import Any

import typer

from beaver_ftc.cli.main import app, every_command
from beaver_ftc.documents import errors
from beaver_ftc.studies.present.tables import markdown_table

PARSER: Any = typer.main.get_command(app)


_SAYS = """Which options does each command have? Use this page to look up a command. If you do not know
which command you need, see [which command answers my
question](README.md#which-command-answers-my-question). `beaver-ftc COMMAND --help` prints the same text.

In each usage line, a word in capitals is a value that you give. `{X}` is required, `[X]` may be left out,
and a value with `...` after it may be repeated. In the tables, `<...>` is the kind of a value: a path, a
text, a number or one of the listed words. `1<=x<=60` is its range, and `[required]` marks a value without
which the command does not run. A rate, a time or an angle has the unit that the text states."""
_NEXT = """## Next

[Exit statuses](reference/exit-statuses.md) explains the status with which a command ends.
[Columns](reference/columns.md) has the columns of the tables that commands write."""


def page() -> str:
    """Every command."""
    parts = ["# Commands", _SAYS, *_described(PARSER, "beaver-ftc")]
    for name, command in every_command().items():
        parts += [f"## {name}", *_described(command, f"beaver-ftc {name}")]
    return "\n\n".join([*parts, _NEXT]) + "\n"


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


_CAPTION = """*Table 1. Exit statuses. "exception": what the same error raises in Python, and its meaning.*"""
_NOTES = """Status 1 has three possible reasons:

- A scenario, a sweep or a plan has an expectation that is not met.
- A command that checks something found a violation: for example `verify` (a guarantee), `check` (a
  certificate), `matrix` (a wrong name or a false alarm). `beaver-ftc COMMAND --help` states the condition.
- A flight of `sitl` was interrupted (Ctrl-C) after it had begun. Its results are written, with the verdict
  INTERRUPTED. Other commands that are interrupted end with status 130.

A command without expectations and without a check, such as `list`, ends with 0 if it is done.

*Example.* This script publishes the report only if the flight meets its expectations:

```bash
if beaver-ftc run elevator-partial-loss; then
    echo "publish runs/elevator-partial-loss/report.html"
fi
```

## Next

[Assert in CI](how-to/ci.md) uses the statuses. [Commands](reference/commands.md) lists all options.
"""


def statuses_page() -> str:
    """The exit statuses: what `beaver-ftc --help` says of each, and the errors that end with it."""
    says = "Which exit status does a command end with, and what does it mean? Scripts and CI jobs read it."
    _, _, listed = PARSER.help.partition("Exit status: ")
    found = re.findall(r"(\d+) ([^,.]+)", " ".join(listed.split()))
    raised = {
        error.exit_code: f"`{error.__name__}`: {' '.join(str(error.__doc__).split())}"
        for error in vars(errors).values()
        if isinstance(error, type) and issubclass(error, errors.BeaverFtcError)
    }
    rows = [(f"`{status}`", means, raised.get(int(status), "")) for status, means in found]
    rows.append(
        (
            "`128 + N`",
            "ended by signal N (2, so status 130, for Ctrl-C); each result file is complete or absent",
            "",
        )
    )
    return (
        f"# Exit statuses\n\n{says}\n\n{_CAPTION}\n\n"
        f"{markdown_table(('status', 'meaning', 'exception'), rows)}\n\n{_NOTES}"
    )
