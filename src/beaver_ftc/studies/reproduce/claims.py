"""Each statement of [Zhang2005], how it is read as a number, and what becomes of it.

A statement holds if its number keeps its limit. That alone says little: it is borne out only if it fails in
the same flights once the mechanism it speaks of is taken out, its ablation; and borne out in a setting only
if the ablation fails in that setting. Statements that the code makes true by its construction, or that give
nothing to measure, are counted apart.
"""

from collections.abc import Callable, Mapping, Sequence
from math import nan
from pathlib import Path
from typing import NamedTuple

from beaver_ftc.aircraft import AXES
from beaver_ftc.documents.document import parse
from beaver_ftc.studies.reproduce import measures
from beaver_ftc.studies.reproduce.cases import Changed, Flown

BORNE_OUT, NOT_BORNE_OUT = "borne out", "not borne out"
STRONGER, CANNOT_BE_JUDGED = "stronger than the paper", "cannot be judged"
VERDICTS = (STRONGER, BORNE_OUT, NOT_BORNE_OUT, CANNOT_BE_JUDGED)

_FILE = parse(Path(__file__).with_name("claims.yaml").read_text(encoding="utf-8")).data
REASONS: dict[str, str] = _FILE["reasons"]
TAKES: dict[str, str] = {name: row["takes"] for name, row in _FILE["ablations"].items()}
ABLATIONS = tuple(Changed(name, row["changes"]) for name, row in _FILE["ablations"].items())


class Measure(NamedTuple):
    """How a number is measured, its quantity and unit, whether it is to be at least its limit, and the word
    for an infinite one. beside: how the names of the flights end that these are compared with, if any."""

    of: Callable[..., float]
    quantity: str
    unit: str = ""
    at_least: bool = False
    none: str = "never"
    beside: str = ""


MEASURES = {name: Measure(getattr(measures, name), **row) for name, row in _FILE["measures"].items()}


NO_MEASURE = Measure(lambda: nan, "")


class Claim(NamedTuple):
    """A published statement: what is measured in which flights, and of which axis, its limit with where that
    comes from, and the ablation, of ABLATIONS, in which it must fail.

    reason: why nothing is measured, for those without a measure. because: why it does not hold; such a claim
    is flown in the published setting alone. construction: whether the code makes it true by its construction.
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
        of = (name if name in AXES else flights[name] for name in (*self.names, *beside))
        return float(self.measure.of(*of))

    def holds(self, number: float) -> bool:
        """Whether the number keeps the limit."""
        return bool(number >= self.limit if self.measure.at_least else number <= self.limit)

    def is_borne_out(self, number: float, without: float) -> bool:
        """Whether it holds, and does not without its mechanism; a number that was not flown fails."""
        return self.holds(number) and not self.holds(without)

    def verdict(self, number: float, without: float, elsewhere: Sequence[tuple[float, float]]) -> str:
        """One of VERDICTS. number: as flown; without: in the ablation's flights; elsewhere: both in every
        setting that the paper did not fly (ELSEWHERE of reproduction.py). Of a construction, only whether it
        holds there."""
        if not self.holds(number):
            return NOT_BORNE_OUT
        if self.holds(without):
            return CANNOT_BE_JUDGED
        there = (self.holds(n) if self.construction else self.is_borne_out(n, w) for n, w in elsewhere)
        return STRONGER if all(there) else BORNE_OUT


def _claim(row: dict) -> Claim:
    if "reason" in row:
        return Claim(row["where"], row["says"], reason=REASONS[row["reason"]])
    what, *names = row["measure"]
    limit, source = _FILE["limits"][row["limit"]]
    return Claim(
        row["where"], row["says"], MEASURES[what], tuple(names), limit, source, row["without"],
        because=row.get("because", ""), construction=row.get("construction", False),
    )  # fmt: skip


CLAIMS = tuple(map(_claim, _FILE["claims"]))
MEASURED = tuple(claim for claim in CLAIMS if not claim.reason)
