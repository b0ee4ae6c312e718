"""Signal temporal logic over the columns of a log: formulas, and by how much a flight fulfils them.

    always[0:10](abs(q_rad_s) <= 0.2)      eventually(detected >= 1)      (a >= 0) until[1:2] (b >= 0)

A formula compares sums, differences, products and quotients of columns and numbers. Comparisons are joined by
`not`, `and`, `or`, `implies` (or `->`), `until`, `always` and `eventually`, and for the past by `once` and
`historically`. An interval is in s, both ends included; without an interval, an operator reaches to the end
of the log, and one for the past to its begin.

The robustness rho of a formula at frame k [Donze2010], in discrete time, is positive if the formula is
fulfilled and negative if not. Its size is a margin: the result stays as long as the difference of the two
sides of each comparison changes by less. K: frames k + begin to k + end of the interval; backwards for the
past. Without a frame in K, rho is infinite: positive for always and historically, else negative.

    a <= b                          b - a
    not f, f and g, f or g          -rho(f), min(rho(f), rho(g)), max(rho(f), rho(g))
    f implies g                     max(-rho(f), rho(g))
    always f, historically f        min of rho(f) over K
    eventually f, once f            max of rho(f) over K
    f until g                       max over j in K of min(rho(g) at j, min of rho(f) over k .. j - 1)

The grammar is a part of that of rtamt, which gives the same numbers in the tests. rtamt needs a release of
its parser of 2017 and Python below 3.13, so flights are not judged with it.
"""

import re
from collections.abc import Callable, Iterator, Mapping
from math import isfinite
from typing import NamedTuple

import numpy as np

MOST_CHARACTERS = 4000
MOST_DEPTH = 40  # levels of operands in operands
MOST_SECONDS = 360_000  # a hundred hours

_TOKEN_PATTERN = re.compile(
    r"\s*(\d+\.?\d*(?:[eE][-+]?\d+)?|\.\d+(?:[eE][-+]?\d+)?|[A-Za-z_][\w.]*|->|<=|>=|[-+*/()<>\[\]:,])"
)
_BINDING_POWER = {  # an operator with a larger power takes its operands first
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
"""Begin and end, s from the present frame; None for all frames to the end of the log, or to its begin."""


class Formula(NamedTuple):
    """An operator with its operands, the parts.

    column_or_number: name or value of an operator `column` or `number`, which has no parts.
    """

    operator: str
    parts: tuple["Formula", ...] = ()
    interval: Interval = None
    column_or_number: str | float = ""

    @property
    def columns(self) -> frozenset[str]:
        """The columns that the formula reads."""
        own = {str(self.column_or_number)} if self.operator == "column" else set()
        return frozenset(own.union(*(part.columns for part in self.parts)))

    @property
    def looks_ahead_s(self) -> float:
        """How far after the present frame the formula reads, s; infinite if it reads to the end of the
        log."""
        ahead = 0.0
        if self.operator in ("always", "eventually", "until"):
            ahead = self.interval[1] if self.interval else np.inf
        return ahead + max((part.looks_ahead_s for part in self.parts), default=0.0)

    def robustness(self, columns: Mapping[str, np.ndarray], rate_hz: float) -> float:
        """The robustness at the first frame of these columns (frames,); NaN if it depends on a NaN of a
        column."""
        frames = len(next(iter(columns.values())))
        return float(_robustness_by_frame(self, columns, rate_hz, frames)[0])


def parse(text: str) -> Formula:
    """The formula in a text. Raises FormulaError."""
    if len(text) > MOST_CHARACTERS:
        raise FormulaError(f"has {len(text)} characters, allowed: at most {MOST_CHARACTERS}")
    formula = _Parser(list(_tokens(text))).parse_all()
    if formula.operator in _NUMERIC_OPERATORS:
        raise FormulaError("says nothing that can be true, allowed: a comparison such as abs(q_rad_s) <= 0.2")
    return formula


def _tokens(text: str) -> Iterator[str]:
    """The tokens of a text. Raises FormulaError for a character that no token has."""
    at = 0
    while text[at:].strip():
        match = _TOKEN_PATTERN.match(text, at)
        if match is None:
            allowed = "names, numbers, + - * / <= < >= > ( ) [ : ] ->"
            raise FormulaError(f"{text[at:].strip()[:20]!r} is not read, allowed: {allowed}")
        yield match[1]
        at = match.end()


class _Parser:
    """A parser by binding power. It takes tokens from the left; its depth is limited, so that no text can
    exhaust the stack. The last token is empty and marks the end."""

    def __init__(self, tokens: list[str]) -> None:
        self._tokens = [*tokens, ""]
        self._at = 0
        self._depth = 0

    def parse_all(self) -> Formula:
        """The formula of all tokens."""
        formula = self._parse_operand(0)
        if self._next_token:
            raise FormulaError(f"{self._next_token!r} is one too many, allowed: the end of the formula")
        return formula

    @property
    def _next_token(self) -> str:
        return self._tokens[self._at]

    def _take_token(self, expected: str = "") -> str:
        """The next token, which is then behind the parser. Raises FormulaError unless it is `expected`, if
        given."""
        token = self._next_token
        if expected and token != expected:
            raise FormulaError(f"{token or 'the end'!r} where {expected!r} is due")
        self._at += 1
        return token

    def _parse_operand(self, power: int) -> Formula:
        """An operand: a prefix, and all operators behind it whose binding power is above `power`."""
        self._depth += 1
        if self._depth > MOST_DEPTH:
            raise FormulaError(f"is nested too deeply, allowed: {MOST_DEPTH} levels")
        formula = self._parse_prefix()
        while _BINDING_POWER.get(self._next_token, 0) > power:
            operator = self._take_token()
            interval = self._parse_interval() if operator == "until" else None
            if operator in ("->", "implies"):  # from the right: a -> b -> c is a -> (b -> c)
                formula = _formula("implies", formula, self._parse_operand(0))
            else:
                right = self._parse_operand(_BINDING_POWER[operator])
                formula = _formula(operator, formula, right, interval=interval)
        self._depth -= 1
        return formula

    def _parse_prefix(self) -> Formula:
        """A formula that begins with its own token: in parentheses, -a, abs(a), not, temporal, number,
        column."""
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
        """A formula and the closing parenthesis."""
        formula = self._parse_operand(0)
        self._take_token(")")
        return formula

    def _parse_interval(self) -> Interval:
        """`[begin:end]` or `[begin,end]`, s; None if no bracket follows."""
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
        """A time from 0 to MOST_SECONDS, s."""
        token = self._take_token()
        if not re.fullmatch(r"[\d.].*", token) or float(token) > MOST_SECONDS:
            raise FormulaError(
                f"{token or 'the end'!r} is no time, allowed: seconds from 0 to {MOST_SECONDS}"
            )
        return float(token)


def _formula(operator: str, *parts: Formula, interval: Interval = None) -> Formula:
    """An operator with these parts. Raises FormulaError if a part is a number where the operator needs a
    truth value, or a truth value where it needs a number."""
    of_numbers = operator in ("-", "abs") or _BINDING_POWER.get(operator, 0) >= _BINDING_POWER["<="]
    if any((part.operator in _NUMERIC_OPERATORS) != of_numbers for part in parts):
        if of_numbers:
            mistake = "of numbers, and is given what is true or false, allowed: columns and numbers"
        else:
            mistake = "of what is true or false, allowed: a comparison, in parentheses"
        raise FormulaError(f"{operator!r} is {mistake}")
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
        return _until_robustness(parts[0], parts[1], begin, end)
    sign = 1.0 if operator in ("always", "historically") else -1.0
    # in a flight backwards the past is the future
    along = -1 if operator in ("once", "historically") else 1
    return sign * _future_minimum(sign * parts[0][::along], begin, end)[::along]


def _future_minimum(values: np.ndarray, begin: int, end: int) -> np.ndarray:
    """min(values[k + begin : k + end + 1]) at each k, (frames,); infinite where these frames are beyond the
    log.

    least[k] is the minimum of `span` values from k on. Two of them give the minimum of 2 span values, until
    two overlapping ones cover the whole width.
    """
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
    """max over j in begin..end of min(reached[k + j], min(held[k : k + j])) at each k, (frames,)."""
    frames = len(held)
    best, least_held = np.full(frames, -np.inf), np.full(frames, np.inf)
    for j in range(min(end + 1, frames)):
        n = frames - j
        if j >= begin:
            best[:n] = np.maximum(best[:n], np.minimum(least_held[:n], reached[j:]))
        least_held[:n] = np.minimum(least_held[:n], held[j:])
    return best
