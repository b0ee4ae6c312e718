"""Words for the user: what can go wrong, with the exit status of each kind; what was perhaps meant; what a
docstring says of a command's options and of a section's keys.
"""

import sys
from collections.abc import Iterable
from difflib import SequenceMatcher, get_close_matches
from functools import cache
from inspect import cleandoc

SHORTEST_BEGINNING = 3  # of a name, to be taken for it
CLEAR_LINE = "\r\033[K"  # of a terminal


class BeaverFtcError(Exception):
    """A failure with a message fit for the user: one line, no traceback."""

    exit_code = 3


class BadInput(BeaverFtcError):
    """The input of the user cannot be used: a wrong file, key, value or unit, or a flight without a trim."""

    exit_code = 2


class SimulationFailed(BeaverFtcError):
    """The simulation could not be completed: a value is infinite or NaN, or a folder cannot be written."""

    exit_code = 3


class Stopped(SystemExit):
    """A signal ends the command: no failure of the code in which it arrives."""


NO_FAILURE = (BeaverFtcError, KeyboardInterrupt, Stopped)  # of a plug-in: what passes through its code


def suggestion(given: str, known: Iterable[str]) -> str:
    """`, did you mean x?` if something known is near to what was given, and what is allowed."""
    names = list(known)
    return hint(nearest(given, names), names)


def hint(near: str | None, known: Iterable[str]) -> str:
    """The same of a name that is known to be near, if there is one."""
    meant = f", did you mean {near}?" if near else ","
    return f"{meant} allowed: {', '.join(known)}"


def nearest(given: str, names: Iterable[str], cutoff: float = 0.6) -> str | None:
    """The name that is nearest to what was given, or else begins so; of several the first, of none None."""
    meant = given.lower()[:100]
    lower: dict[str, str] = {}
    for name in names:
        lower.setdefault(name.lower(), name)
    near = set(get_close_matches(meant, lower, n=len(lower) or 1, cutoff=cutoff))
    ranked = (name for name in lower if name in near)
    best = max(ranked, key=lambda name: SequenceMatcher(None, name, meant).ratio(), default=None)
    if best is None and len(meant) >= SHORTEST_BEGINNING:
        best = next((name for name in lower if name.startswith(meant)), None)
    return None if best is None else lower[best]


@cache
def say_once(line: str) -> None:
    """Say something on standard error, once a process; a line of progress may stand there."""
    print(f"{CLEAR_LINE * sys.stderr.isatty()}beaver-ftc: {line}", file=sys.stderr, flush=True)


def split_docstring(docstring: str | None, names: Iterable[str]) -> tuple[str | None, dict[str, str]]:
    """The docstring without its end, and what it says there of each of these names: `name: ...`."""
    if docstring is None:
        return None, {}
    known, about = set(names), list[str]()
    said, into = dict[str, list[str]](), about
    for line in cleandoc(docstring).split("\n"):
        name, colon, text = line.partition(": ")
        if colon and name in known:
            into = said[name] = [text]
        else:
            into.append(line)
    return "\n".join(about).rstrip(), {name: " ".join(" ".join(of).split()) for name, of in said.items()}
