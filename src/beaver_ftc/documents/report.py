"""The mistakes in a file as lines: `FILE:LINE: key.path: what is wrong, what is allowed`, one for each."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from beaver_ftc.documents.document import MAX_PROBLEMS, Location, Problem
from beaver_ftc.documents.errors import BadInput

WHOLE_FILE = "(file)"
SHOWN_CHARACTERS = 48
MIN_ALIKE_TO_COUNT = 3  # mistakes of one kind in one list, from which on they share a line


class ScenarioError(BadInput):
    """A file that cannot be used; `str` is one line a mistake, `problems` the mistakes.

    What comes from no file has an empty source: its lines begin with the key.
    """

    def __init__(self, source: str, problems: Sequence[Problem]) -> None:
        self.source = source
        self.problems = _in_order(problems)
        super().__init__("\n".join(self.lines))

    def below(self, source: str, *at: int | str) -> "ScenarioError":
        """The same mistakes in a document of this source, of which what was read stands at these keys; those
        of another file as they are."""
        if self.source != source:
            return self
        return ScenarioError(source, [replace(one, location=(*at, *one.location)) for one in self.problems])

    @property
    def lines(self) -> tuple[str, ...]:
        alike: dict[Any, list[Problem]] = {}
        for problem in self.problems:
            alike.setdefault(_list_and_allowed(problem), []).append(problem)
        return tuple(line for problems in alike.values() for line in self._lines_of_alike(problems))

    def _lines_of_alike(self, problems: list[Problem]) -> list[str]:
        """A line each; one line for many of one list, as in a matrix of which no number is allowed."""
        if len(problems) < MIN_ALIKE_TO_COUNT:
            return [self._line(problem) for problem in problems]
        return [f"{self._line(problems[0])} (and {len(problems) - 1} more of this list)"]

    def _line(self, problem: Problem) -> str:
        """file:line: key: what; of a file as a whole file: what."""
        file, says = one_line(self.source, 4096), one_line(problem.says, 2000)
        if file and not problem.line:
            return f"{file}: {says}"
        return (f"{file}:{problem.line}: " if file else "") + f"{key_path(problem.location)}: {says}"

    def __reduce__(self) -> tuple[Any, ...]:
        return (type(self), (self.source, self.problems))


def _list_and_allowed(problem: Problem) -> tuple[Any, ...]:
    """What entries of one list that are wrong alike have in common: one line is about all of them."""
    location = problem.location
    while location and isinstance(location[-1], int):
        location = location[:-1]
    if location == problem.location:
        return (problem,)
    return problem.line, location, problem.says.rpartition(", allowed: ")[2]


def _in_order(problems: Sequence[Problem]) -> tuple[Problem, ...]:
    """By line, each once; after the first MAX_PROBLEMS a word that there are more."""
    distinct = list(dict.fromkeys(sorted(problems, key=lambda problem: problem.line)))
    if len(distinct) <= MAX_PROBLEMS:
        return tuple(distinct)
    more = Problem(distinct[MAX_PROBLEMS].line, (), f"has more than {MAX_PROBLEMS} mistakes, allowed: none")
    return (*distinct[:MAX_PROBLEMS], more)


def key_path(location: Location) -> str:
    """('faults', 0, 'at_s') -> faults[0].at_s"""
    parts = (
        f"[{part}]" if isinstance(part, int) else f".{one_line(part, SHOWN_CHARACTERS) or '(empty)'}"
        for part in location
    )
    return "".join(parts).removeprefix(".") or WHOLE_FILE


def one_line(text: str, longest: int) -> str:
    """Text fit for one line of a terminal: control characters escaped, length bounded."""
    shown = "".join(
        c if c.isprintable() else c.encode("unicode_escape", "replace").decode() for c in text[:longest]
    )
    return shown if len(text) <= longest else f"{shown}..."
