"""Signal temporal logic over the columns of a log: what a formula says, and by how much a flight keeps it.

    always[0:10](abs(q_rad_s) <= 0.2)      eventually(detected >= 1)      (a >= 0) until[1:2] (b >= 0)

Comparisons of sums, differences, products and quotients of columns and numbers, joined by `not`, `and`, `or`,
`implies` (or `->`), `until`, `always`, `eventually`, and for the past `once`, `historically`; intervals in
seconds, both ends included; without one, to the end of the log. Its robustness is the quantitative semantics
at the first frame [Donze2010] in discrete time: positive where the formula is kept, negative where it is not,
and its size the least change of a signal that would turn it over.

The grammar is part of rtamt's, which gives the same numbers (tests). rtamt itself holds the parser's runtime
to a release of 2017 and Python below 3.13, so it is a check beside this and not what flights are judged by.
"""

import re
from collections.abc import Callable, Iterator, Mapping
from math import isfinite
from typing import NamedTuple

import numpy as np

MOST_CHARACTERS = 4000
MOST_DEPTH = 40
MOST_SECONDS = 360_000  # a hundred hours

_TOKEN_PATTERN = re.compile(
    r"\s*(\d+\.?\d*(?:[eE][-+]?\d+)?|\.\d+(?:[eE][-+]?\d+)?|[A-Za-z_][\w.]*|->|<=|>=|[-+*/()<>\[\]:,])"
)
_BINDING_POWER = {  # how tightly each binds what stands on its left
    "->": 1, "implies": 1, "or": 2, "and": 3, "until": 4,
    "<=": 5, ">=": 5, "<": 5, ">": 5, "+": 6, "-": 6, "*": 7, "/": 7,
}  # fmt: skip
_MAX_BINDING_POWER = 8
_TEMPORAL_OPERATORS = ("always", "eventually", "once", "historically")
_NUMERIC_OPERATORS = ("+", "-", "*", "/", "abs", "column", "number")
_RESERVED_WORDS = {*_TEMPORAL_OPERATORS, "not", "and", "or", "implies", "until", "abs"}


class FormulaError(ValueError):
    """The text is no formula; the message says why and what is allowed."""


Interval = tuple[float, float] | None
"""From and to, s; None for all that is to come."""


class Formula(NamedTuple):
    """An operator with its parts; column_or_number: name or value of an operator `column` or `number`."""

    operator: str
    parts: tuple["Formula", ...] = ()
    interval: Interval = None
    column_or_number: str | float = ""

    @property
    def columns(self) -> frozenset[str]:
        """The columns it is about."""
        own = {str(self.column_or_number)} if self.operator == "column" else set()
        return frozenset(own.union(*(part.columns for part in self.parts)))

    @property
    def looks_ahead_s(self) -> float:
        """How far it looks; infinite where it looks to the end of the log."""
        ahead = 0.0
        if self.operator in ("always", "eventually", "until"):
            ahead = self.interval[1] if self.interval else np.inf
        return ahead + max((part.looks_ahead_s for part in self.parts), default=0.0)

    def robustness(self, columns: Mapping[str, np.ndarray], rate_hz: float) -> float:
        """At the first frame of these columns (frames,); NaN where a column it depends on is not a number."""
        frames = len(next(iter(columns.values())))
        return float(_robustness_by_frame(self, columns, rate_hz, frames)[0])


def parse(text: str) -> Formula:
    """The formula in a text. Raises FormulaError."""
    if len(text) > MOST_CHARACTERS:
        raise FormulaError(f"has {len(text)} characters, allowed: at most {MOST_CHARACTERS}")
    found = _Parser(list(_tokens(text))).parse_all()
    if found.operator in _NUMERIC_OPERATORS:
        raise FormulaError("says nothing that can be true, allowed: a comparison such as abs(q_rad_s) <= 0.2")
    return found


def _tokens(text: str) -> Iterator[str]:
    at = 0
    while text[at:].strip():
        match = _TOKEN_PATTERN.match(text, at)
        if match is None:
            allowed = "names, numbers, + - * / <= < >= > ( ) [ : ] ->"
            raise FormulaError(f"{text[at:].strip()[:20]!r} is not read, allowed: {allowed}")
        yield match[1]
        at = match.end()


class _Parser:
    """Operators by their power; bounded in depth, so that no text can exhaust the stack."""

    def __init__(self, tokens: list[str]) -> None:
        self._tokens = [*tokens, ""]
        self._at = 0
        self._depth = 0

    def parse_all(self) -> Formula:
        found = self._parse_operand(0)
        if self._next_token:
            raise FormulaError(f"{self._next_token!r} is one too many, allowed: the end of the formula")
        return found

    @property
    def _next_token(self) -> str:
        return self._tokens[self._at]

    def _take_token(self, expected: str = "") -> str:
        token = self._next_token
        if expected and token != expected:
            raise FormulaError(f"{token or 'the end'!r} where {expected!r} is due")
        self._at += 1
        return token

    def _parse_operand(self, power: int) -> Formula:
        self._depth += 1
        if self._depth > MOST_DEPTH:
            raise FormulaError(f"is nested too deeply, allowed: {MOST_DEPTH} levels")
        left = self._parse_prefix()
        while _BINDING_POWER.get(self._next_token, 0) > power:
            operator = self._take_token()
            interval = self._parse_interval() if operator == "until" else None
            if operator in ("->", "implies"):  # a - b - c is (a - b) - c, but a -> b -> c is a -> (b -> c)
                left = _formula("implies", left, self._parse_operand(0))
            else:
                right = self._parse_operand(_BINDING_POWER[operator])
                left = _formula(operator, left, right, interval=interval)
        self._depth -= 1
        return left

    def _parse_prefix(self) -> Formula:
        token = self._take_token()
        if token == "(":
            return self._parse_rest_of_parentheses()
        if token == "-":
            zero = Formula("number", column_or_number=0.0)
            return _formula("-", zero, self._parse_operand(_BINDING_POWER["*"] - 1))
        if token == "abs":
            self._take_token("(")
            return _formula("abs", self._parse_rest_of_parentheses())
        if token == "not" or token in _TEMPORAL_OPERATORS:
            interval = self._parse_interval() if token in _TEMPORAL_OPERATORS else None
            return _formula(token, self._parse_operand(_MAX_BINDING_POWER), interval=interval)
        if re.fullmatch(r"[\d.].*", token):
            if not isfinite(float(token)):
                raise FormulaError(f"{token[:40]!r} is too large for a number")
            return Formula("number", column_or_number=float(token))
        if not token or token in _RESERVED_WORDS or not re.fullmatch(r"[A-Za-z_].*", token):
            raise FormulaError(f"{token or 'the end'!r} where a column, a number or ( is due")
        return Formula("column", column_or_number=token)

    def _parse_rest_of_parentheses(self) -> Formula:
        found = self._parse_operand(0)
        self._take_token(")")
        return found

    def _parse_interval(self) -> Interval:
        if self._next_token != "[":
            return None
        self._take_token("[")
        begin = self._parse_seconds()
        if self._take_token() not in (":", ","):
            raise FormulaError("an interval is due, allowed: [from:to] in seconds")
        end = self._parse_seconds()
        self._take_token("]")
        if end < begin:
            raise FormulaError(
                f"the interval [{begin:g}:{end:g}] is out of order, allowed: [from:to] in seconds"
            )
        return begin, end

    def _parse_seconds(self) -> float:
        token = self._take_token()
        if not re.fullmatch(r"[\d.].*", token) or float(token) > MOST_SECONDS:
            raise FormulaError(
                f"{token or 'the end'!r} is no time, allowed: seconds from 0 to {MOST_SECONDS}"
            )
        return float(token)


def _formula(operator: str, *parts: Formula, interval: Interval = None) -> Formula:
    """An operator of these parts, which are what it is of: numbers, or what is true or false."""
    of_numbers = operator in ("-", "abs") or _BINDING_POWER.get(operator, 0) >= _BINDING_POWER["<="]
    if any((part.operator in _NUMERIC_OPERATORS) != of_numbers for part in parts):
        if of_numbers:
            says = "of numbers, and is given what is true or false, allowed: columns and numbers"
        else:
            says = "of what is true or false, allowed: a comparison, in parentheses"
        raise FormulaError(f"{operator!r} is {says}")
    return Formula(operator, parts, interval)


_ValueFunction = Callable[..., np.ndarray]
_FRAMEWISE_FUNCTION_OF_OPERATOR: dict[str, _ValueFunction] = {
    "+": np.add, "-": np.subtract, "*": np.multiply,
    "/": np.divide,
    "<=": lambda a, b: b - a, "<": lambda a, b: b - a, ">=": np.subtract, ">": np.subtract,
    "and": np.minimum, "or": np.maximum, "implies": lambda a, b: np.maximum(-a, b),
    "abs": np.abs, "not": np.negative,
}  # fmt: skip


def _robustness_by_frame(
    formula: Formula, columns: Mapping[str, np.ndarray], rate_hz: float, frames: int
) -> np.ndarray:
    """The robustness of a formula at each frame, (frames,)."""
    operator = formula.operator
    if operator == "number":
        return np.full(frames, formula.column_or_number)
    if operator == "column":
        return columns[str(formula.column_or_number)]
    parts = [_robustness_by_frame(part, columns, rate_hz, frames) for part in formula.parts]
    if operator in _FRAMEWISE_FUNCTION_OF_OPERATOR:
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            return _FRAMEWISE_FUNCTION_OF_OPERATOR[operator](*parts)
    begin, end = (round(t * rate_hz) for t in formula.interval or (0.0, frames / rate_hz))
    if operator == "until":
        return _until_robustness(parts[0], parts[1], begin, min(end, frames))
    sign = 1.0 if operator in ("always", "historically") else -1.0
    # the past is the future of the flight backwards
    along = -1 if operator in ("once", "historically") else 1
    return sign * _future_minimum(sign * parts[0][::along], begin, end)[::along]


def _future_minimum(values: np.ndarray, begin: int, end: int) -> np.ndarray:
    """min(values[k + begin : k + end + 1]) at each k, infinite where that is beyond the log: twice as long a
    stretch at each step."""
    frames = len(values)
    width = min(end, frames) - begin + 1
    if width < 1:
        return np.full(frames, np.inf)
    least = np.concatenate((values[begin:], np.full(begin + width, np.inf)))
    span = 1
    while 2 * span <= width:
        least = np.minimum(least[:-span], least[span:])
        span = 2 * span
    return np.minimum(least[:frames], least[width - span :][:frames])


def _until_robustness(held: np.ndarray, reached: np.ndarray, begin: int, end: int) -> np.ndarray:
    """max over j in begin..end of min(reached[k + j], min(held[k : k + j])) at each k."""
    frames = len(held)
    best, so_far = np.full(frames, -np.inf), np.full(frames, np.inf)
    for j in range(end + 1):
        left = frames - j
        if left <= 0:
            break
        if j >= begin:
            best[:left] = np.maximum(best[:left], np.minimum(so_far[:left], reached[j:]))
        so_far[:left] = np.minimum(so_far[:left], held[j:])
    return best
