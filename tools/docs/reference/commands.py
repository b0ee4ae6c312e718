"""The commands with all their options, and the exit statuses: from the argument parsers and the errors."""

import re
from collections.abc import Iterator, Mapping
from typing import Any

import typer

from beaver_ftc.cli.main import app, every_command
from beaver_ftc.documents import errors
from beaver_ftc.studies.present.tables import markdown_table
from tools.docs.pages import ROOT

PARSER: Any = typer.main.get_command(app)


_SAYS = """Which options does each command have? This page lists every command of `beaver-ftc` with its
options, for readers who already know the command. If you do not know the command, begin with [which command
answers my question](README.md#which-command-answers-my-question). `beaver-ftc COMMAND --help` prints the text
of one command.

## How to read an entry

**Usage line.** A word in capitals stands for a value that you give. `{X}` is required. `[X]` can be left out.
You can give several values if `...` follows the word. Write the options before or after the values.
*Example.* `beaver-ftc run [OPTIONS] {SCENARIO}...` requires at least one scenario, and accepts several.

**Table of options.** The first column has the option, and the kind of its value in `<...>`. A kind is a path,
a text (`str`), a whole number (`int`), a number (`float`) or one of the listed words. `int range` and
`float range` are numbers with limits. A word in capitals says what you give, for example FILE,
HOST:PORT or HZ. `list` means that you can give the option or value several times. The
second column has the effect and the unit. In brackets it has:

- `[default: X]`: the value if the option is left out. If there is no such entry, the text states the default,
  or the option is off.
- `[1<=x<=60]`: the allowed range of the value, here from 1 to 60.
- `[required]`: the command does not run without this value.

**Results.** `--out` is the folder for the results. With `--format json` a command prints one JSON document
instead of text. [Columns](reference/columns.md) lists the columns of the tables. The
[glossary](reference/glossary.md) explains the terms of the diagnosis."""
_NEXT = """## Next

[Exit statuses](reference/exit-statuses.md) explains what each exit status means.
[Columns](reference/columns.md) has the columns of the tables that commands write."""
_CONTENTS = '*Table 1. The commands, by purpose. "more": the page that shows or explains the command.*'

# Purpose -> command -> page that shows or explains it. A command that is not here is listed under "other".
_PURPOSES = {
    "fly": {
        "run": "tutorials/start.md", "live": "how-to/live.md", "sitl": "how-to/autopilots.md",
    },
    "prepare": {
        "list": "gallery.md", "show": "reference/scenarios.md", "new": "tutorials/own-scenario.md",
        "validate": "tutorials/own-scenario.md", "schema": "reference/scenario-keys.md",
        "trim": "reference/beaver.md", "linearise": "explanation/laws.md",
    },
    "fly many": {
        "sweep": "tutorials/sweep.md", "compare": "how-to/compare.md", "matrix": "explanation/fault-types.md",
    },
    "measure the diagnosis": {
        "detectability": "results/verification.md", "smallest": "results/verification.md",
        "power": "results/robustness.md", "decay": "results/beyond-declared.md",
        "mechanisms": "results/mechanisms.md", "mismatch": "results/mismatch.md",
        "reproduce": "how-to/reproduce.md", "bench": "results/performance.md",
    },
    "prove": {
        "verify": "results/verification.md", "check": "explanation/certificates.md",
        "separate": "explanation/certificates.md", "evidence": "how-to/evidence.md",
    },
    "recorded flights": {"identify": "tutorials/flight-log.md", "diagnose": "tutorials/flight-log.md"},
    "other aircraft": {"derive": "tutorials/own-aircraft.md", "import gtm": "how-to/gtm.md"},
    "teach": {
        "challenge new": "how-to/challenge.md", "challenge submit": "how-to/challenge.md",
        "challenge grade": "how-to/challenge.md",
    },
}  # fmt: skip

# Command -> what its first example prints, where the help does not say it.
_PRINTED = {
    "live": "Each example prints the address of the page. The second example also prints 30 links for "
    "guests.",
    "run": "The first example prints a verdict of about 20 lines: fault, detection, isolation, modes of the"
    " supervisor, notes, tracking errors, and each expectation with its result.",
    "list": "The example prints the names of each list.",
    "show": "The example prints the YAML text of the scenario.",
    "new": "Each example prints the name of the written file or folder, and a command to run next.",
    "validate": "The example prints one line for each file: `valid`, or its mistakes.",
    "schema": "The example prints one JSON document.",
    "trim": "The example prints one line for each state, setting and surface, with its value and unit.",
    "linearise": "The example prints one row for each fault and surface: how far the gain of the loop can "
    "rise and fall (dB), the phase margin (deg), and the airspeed at which the margin is smallest (m/s). A "
    "second table has the modes at each airspeed.",
    "sweep": "The first example prints rates of detection, isolation and false alarms with their 95 % "
    "intervals, the delays (s), the tracking errors (deg/s), and each expectation with its result. The "
    "second example also prints the worst flight that the search found.",
    "compare": "The first two examples fly two scenarios and compare the runs. The table has one row for "
    "each quantity and one column for each run. A `*` marks the rows that differ. The third example prints "
    "one row for each scheme and each law. The fourth example chooses the parameters of one scheme.",
    "matrix": "The first example prints a table with a row for each fault and a column for each surface. A "
    "cell has the verdict, the delay of the alarm (s), and the tracking error divided by that of the "
    "informed law.",
    "detectability": "The example prints one sentence for each amplitude of the reference, such as "
    '"at 45 m/s and 1000 m, 1.5 deg/s of pitch: a loss of elevator of 18 % and more is certain to be '
    'detected within 0.5 s".',
    "smallest": "The example prints the two losses, and a table with one row for each change of "
    "the conditions.",
    "power": "The example prints one line for each size of the loss.",
    "decay": "The example prints a table with a row for each error and size.",
    "mismatch": "The first example prints RMS, largest value and share of the bound for each source and "
    "axis, in 1e-3 rad/s². The output ends with the smallest constant bound that would contain the error.",
    "bench": "The example prints the time of a frame, and its ratio to the time of the bare aircraft.",
    "verify": "The example prints the number of flights, violations and upper confidence limits for each "
    "scheme.",
    "check": "The second example prints each statement as a sentence.",
    "evidence": "The example prints one row for each requirement: verdict, margin and worst flight.",
    "mechanisms": "The example prints one row for each mechanism.",
    "separate": "The example prints one line for each pair of candidates.",
    "identify": "The example needs the folder `my-logs` of `beaver-ftc new my-logs --log`. It prints the "
    "number of samples. For each rate it also prints the share that the model explains in data that the fit "
    "did not use.",
    "diagnose": "The example prints each event with its time span, and the effectiveness of each surface "
    "with its interval.",
    "derive": "The example prints the number of terms of each moment coefficient. For each axis it prints "
    "the largest error (rad/s²) in states of the fit and in other states, and the declared bound.",
    "challenge submit": "The example prints the points of the practice flight, and the path of the "
    "submission.",
    "challenge grade": "The example prints the ranking: one row for each submission.",
}


def page() -> str:
    """Every command."""
    known = every_command()
    purposes = _with_others(known)
    parts = ["# Commands", _SAYS, "## Contents", _contents(known, purposes)]
    parts += ["## beaver-ftc", *_described(PARSER, "beaver-ftc")]
    for commands in purposes.values():
        for name, more in commands.items():
            parts += [f"## {name}", *_described(known[name], f"beaver-ftc {name}")]
            parts += [_PRINTED[name]] if name in _PRINTED else []
            parts += [f"More: [{_title(more)}]({more})."] if more else []
    return "\n\n".join([*parts, _NEXT]) + "\n"


def _with_others(known: Mapping[str, Any]) -> dict[str, dict[str, str]]:
    """The purposes, with the installed commands alone, and those that have none at the end."""
    listed = {
        purpose: {name: more for name, more in commands.items() if name in known}
        for purpose, commands in _PURPOSES.items()
    }
    named = {name for commands in listed.values() for name in commands}
    others = {name: "" for name in known if name not in named}
    return listed | ({"other": others} if others else {})


def _contents(known: Mapping[str, Any], purposes: Mapping[str, Mapping[str, str]]) -> str:
    """A row for each command, which links to its section and to the page that explains it."""
    rows = [
        (
            purpose if number == 0 else "",
            f"[{name}](#{name.replace(' ', '-')})",
            _in_html(known[name].help.split("\n\n")[0]),
            f"[{_title(more)}]({more})" if more else "",
        )
        for purpose, commands in purposes.items()
        for number, (name, more) in enumerate(commands.items())
    ]
    return f"{_CONTENTS}\n\n{markdown_table(('purpose', 'command', 'what it does', 'more'), rows)}"


def _title(page: str) -> str:
    """The title of a page."""
    return (ROOT / "docs" / page).read_text(encoding="utf-8").partition("# ")[2].partition("\n")[0]


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


_CAPTION = """*Table 1. Exit statuses. "exception": the exception that the same error raises in Python.*"""
_NOTES = """## Status 1 of each command

*Table 2. Commands that can end with status 1, and the reason.*

|command|status 1 means|
|---|---|
|`run`, `sitl`|a flight misses an expectation of its scenario|
|`sweep`|the sweep misses one of its expectations|
|`evidence`|a requirement is not met or not shown|
|`verify`|a guarantee is violated|
|`check`|a statement of the certificate does not hold|
|`matrix`|a fault is named wrongly, or an alarm is false|
|`matrix --pitch-lost`|an aircraft is lost with control by engine power, but not without it|
|`reproduce`|a statement of the paper does not hold, and the reason is not known|
|`mechanisms`|a false alarm of a worst-case detector has no reason|
|`separate`|a doublet was flown, and both candidates remain|

A command without expectations and without a check, such as `list`, ends with status 0 after it has finished
its work.

## After Ctrl-C

After Ctrl-C, a command ends with status 130. There is one exception, `sitl`. It writes the results of the
flight until Ctrl-C, with the verdict INTERRUPTED, and ends with status 1.

## Use in a script

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
    says = (
        "Which exit status does a command have, and what does the status mean? This page is for writers of "
        "scripts and of CI jobs (continuous integration). A script reads the exit status to find out whether "
        "the command was successful."
    )
    _, _, listed = PARSER.help.partition("Exit status: ")
    found = re.findall(r"(\d+) = ([^,.]+)", " ".join(listed.split()))
    raised = {
        error.exit_code: f"`{error.__name__}`: {' '.join(str(error.__doc__).split())}"
        for error in vars(errors).values()
        if isinstance(error, type) and issubclass(error, errors.BeaverFtcError)
    }
    rows = [(f"`{status}`", means, raised.get(int(status), "")) for status, means in found]
    rows.append(
        (
            "`128 + N`",
            "signal N of the operating system ended the command, for example 130 for Ctrl-C (signal 2). Each "
            "result file is complete or absent",
            "",
        )
    )
    return (
        f"# Exit statuses\n\n{says}\n\n{_CAPTION}\n\n"
        f"{markdown_table(('status', 'meaning', 'exception'), rows)}\n\n{_NOTES}"
    )
