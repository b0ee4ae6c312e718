"""The statements of [Zhang2005]: the number that measures each, its limit, and the verdict.

    holds            the number keeps its limit
    ablation         the same flights without the mechanism to which the statement refers
    borne out        the statement holds, and does not hold in its ablation
    not borne out    the number does not keep its limit
    stronger         it is also borne out in each setting that the paper did not fly; there a statement that
                     is true by the construction of the code must only hold
    cannot be judged it holds also in its ablation, or there is nothing to measure (judged.py)

A number that keeps its limit does not yet show that the mechanism is the reason. Statements that are true by
the construction of the code are counted separately.
"""

from collections.abc import Callable, Mapping, Sequence
from math import nan
from typing import NamedTuple

from beaver_ftc.aircraft import AXES
from beaver_ftc.studies.reproduce import measures
from beaver_ftc.studies.reproduce.cases import Changed
from beaver_ftc.studies.reproduce.choices import data_of
from beaver_ftc.studies.reproduce.flown import Flown

BORNE_OUT, NOT_BORNE_OUT = "borne out", "not borne out"
STRONGER, CANNOT_BE_JUDGED = "stronger than the paper", "cannot be judged"
VERDICTS = (STRONGER, BORNE_OUT, NOT_BORNE_OUT, CANNOT_BE_JUDGED)

_FILE = data_of("claims.yaml")
REASONS: dict[str, str] = _FILE["reasons"]
TAKES: dict[str, str] = {name: row["takes"] for name, row in _FILE["ablations"].items()}
ABLATIONS = tuple(Changed(name, row["changes"]) for name, row in _FILE["ablations"].items())


class Measure(NamedTuple):
    """How a number is measured.

    - name: in claims.yaml. of: the function of flights and axes. quantity, unit: of the number. at_least:
      whether it must be at least its limit, otherwise at most. none: the word for an infinite number.
    - beside: ending of the names of flights with which the flights of a claim are compared; empty for none.
    """

    name: str
    of: Callable[..., float]
    quantity: str
    unit: str = ""
    at_least: bool = False
    none: str = "never"
    beside: str = ""


MEASURES = {name: Measure(name, getattr(measures, name), **row) for name, row in _FILE["measures"].items()}


NO_MEASURE = Measure("", lambda: nan, "")  # of a statement with nothing to measure


class Claim(NamedTuple):
    """A published statement.

    - where, statement: its place in the paper, and its words.
    - measure, names: the measure, and its arguments: names of cases, and axes.
    - limit, source: the limit of the number, and its origin. ablation: name of the ablation.
    - reason: of a statement without a measure, why nothing is measured.
    - because: why it does not hold. Such a claim is flown in the published setting alone.
    - construction: whether it is true by the construction of the code.
    """

    where: str
    statement: str
    measure: Measure = NO_MEASURE
    names: tuple[str, ...] = ()
    limit: float = 0.0
    source: str = ""
    ablation: str = ""
    reason: str = ""
    because: str = ""
    construction: bool = False

    @property
    def testable(self) -> bool:
        """Whether flights can contradict it."""
        return not self.reason and not self.construction

    def number(self, flights: Mapping[str, Flown]) -> float:
        """The number that is measured in the flights."""
        beside = [name + self.measure.beside for name in self.names if self.measure.beside]
        arguments = (name if name in AXES else flights[name] for name in (*self.names, *beside))
        return float(self.measure.of(*arguments))

    def holds(self, number: float) -> bool:
        """Whether the number keeps the limit."""
        return bool(number >= self.limit if self.measure.at_least else number <= self.limit)

    def is_borne_out(self, number: float, without: float) -> bool:
        """Whether the claim holds, and not in its ablation, whose number is `without`. False for a claim that
        flights cannot contradict, since its ablation is flown in the published setting alone."""
        return self.testable and self.holds(number) and not self.holds(without)

    def verdict(self, number: float, without: float, elsewhere: Sequence[tuple[float, float]]) -> str:
        """One of VERDICTS. number: in the published setting. without: in its ablation. elsewhere: both
        numbers in each setting that the paper did not fly (ELSEWHERE of cases.py); empty for a claim
        with `because`. A statement that is true by construction must only hold there."""
        if not self.holds(number):
            return NOT_BORNE_OUT
        if self.holds(without):
            return CANNOT_BE_JUDGED
        outcomes = (self.holds(n) if self.construction else self.is_borne_out(n, w) for n, w in elsewhere)
        return STRONGER if all(outcomes) else BORNE_OUT


def _claim(row: dict) -> Claim:
    """A claim from its row in claims.yaml."""
    if "reason" in row:
        return Claim(row["where"], row["says"], reason=REASONS[row["reason"]])
    measure, *names = row["measure"]
    limit, source = _FILE["limits"][row["limit"]]
    return Claim(
        row["where"], row["says"], MEASURES[measure], tuple(names), limit, source, row["without"],
        because=row.get("because", ""), construction=row.get("construction", False),
    )  # fmt: skip


CLAIMS = tuple(map(_claim, _FILE["claims"]))
MEASURED = tuple(claim for claim in CLAIMS if not claim.reason)
