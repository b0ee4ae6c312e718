"""The commands with their options, and the exit statuses: from the argument parsers and the errors."""

import re
from collections import Counter
from collections.abc import Iterator
from typing import Any

import typer

from beaver_ftc.cli.main import app, every_command
from beaver_ftc.documents import errors
from beaver_ftc.studies.present.tables import markdown_table

_HEAD = ("option", "meaning")
PARSER: Any = typer.main.get_command(app)


_SAYS = """Which options does each command have, and which exit status? If you do not know the command, begin
with [which command answers my question](README.md#which-command-answers-my-question). `beaver-ftc COMMAND
--help` prints usage, examples, what the command computes, and which files it writes. `...` follows what can
be given several times. In brackets: the default, the allowed range, or `[required]`."""
_NEXT = """## Next

[Assert in CI](how-to/evidence.md#in-ci) uses the exit statuses."""
_KINDS = re.compile(r" <(?:str|int|path|(?:int|float) range|list\[\w+\])>")  # the text or the range says it
_SHARED = 2  # so many commands with the same option share its row
_SHARED_SAYS = "## Options of several commands"


def page() -> str:
    """Every command."""
    known = every_command()
    rows = {name: _options(command, f"beaver-ftc {name}") for name, command in sorted(known.items())}
    counted = Counter(row for of in rows.values() for row in of)
    common = [row for row, count in reversed(counted.most_common()) if count >= _SHARED]
    shared = list(reversed({row[0]: row for row in common}.values()))  # of each option, the commonest row
    contents = ", ".join(f"[{name}](#{name.replace(' ', '-')})" for name in rows)
    parts = ["# Commands", _SAYS, f"Contents: {contents}.", _SHARED_SAYS, markdown_table(_HEAD, shared)]
    parts += ["## beaver-ftc", *_described(PARSER, _options(PARSER, "beaver-ftc"), [])]
    for name, of in rows.items():
        parts += [f"## {name}", *_described(known[name], of, shared)]
    return "\n\n".join([*parts, statuses(), _NEXT]) + "\n"


def _options(command: Any, called: str) -> list[tuple[str, str]]:
    """(option, what it is) of each; what every command has, `--help`, is not an option of its own."""
    context = command.make_context(called, [], resilient_parsing=True)
    records = (each.get_help_record(context) for each in command.params)
    return [
        (f"`{_KINDS.sub('...' if ' <list[' in name else '', name)}`", _in_html(says))
        for name, says in filter(None, records)
    ]


def _described(command: Any, rows: list[tuple[str, str]], shared: list[tuple[str, str]]) -> Iterator[str]:
    """What it does, and its options."""
    yield _in_html(command.help.split("\n\n")[0])
    own = [row for row in rows if row not in shared]
    if own:
        yield markdown_table(_HEAD, own)
    if also := [f"{option.split()[0].strip('`')}" for option, _ in rows if (option, _) in shared]:
        yield f"Also: `{'`, `'.join(also)}`."


def _in_html(text: str) -> str:
    return " ".join(text.split()).replace("<", "&lt;")


_NOTES = """Some commands can end with status 1:

|command|status 1 means|
|---|---|
|`run`, `sitl`|a flight misses an expectation of its scenario|
|`sweep`|the sweep misses one of its expectations; with `--replay`, the flight misses one of its scenario|
|`evidence`|a requirement is not met or not shown|
|`verify`|a guarantee is violated|
|`check`|a statement of the certificate does not hold|
|`matrix`|a fault is named wrongly, or an alarm is false|
|`matrix --pitch-lost`|an aircraft is lost with control by engine power, but not without it|
|`reproduce`|a statement of the paper does not hold, and the reason is not known|
|`sensitivity --mechanisms`|a false alarm of a worst-case detector has no reason|
|`separate`|a doublet was flown, and both candidates remain|

After Ctrl-C, only `sitl` ends with status 1: it writes the results of the flight until then, with the verdict
INTERRUPTED."""


def statuses() -> str:
    """The exit statuses: what `beaver-ftc --help` says of each, and the errors that end with it."""
    _, _, listed = PARSER.help.partition("Exit status: ")
    found = re.findall(r"(\d+) = ([^,.]+)", " ".join(listed.split()))
    raised = {
        error.exit_code: f"`{error.__name__}`"
        for error in vars(errors).values()
        if isinstance(error, type) and issubclass(error, errors.BeaverFtcError)
    }
    rows = [(f"`{status}`", means, raised.get(int(status), "")) for status, means in found]
    rows.append(
        (
            "`128 + N`",
            "signal N ended the command: 130 for Ctrl-C. Each result file is complete or absent",
            "",
        )
    )
    table = markdown_table(("status", "meaning", "exception in Python"), rows)
    return f"## Exit statuses\n\n{table}\n\n{_NOTES}"
