"""Each statement of [Zhang2005], how it is read as a number, and what becomes of it.

A statement holds if its number keeps its limit. That alone says little: it is borne out only if it fails in
the same flights once the mechanism it speaks of is taken out, its ablation.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from beaver_ftc.documents.document import parse
from beaver_ftc.studies.reproduce.cases import Changed
from beaver_ftc.studies.reproduce.measures import MEASURES, Flights, Measure

BORNE_OUT, NOT_BORNE_OUT = "borne out", "not borne out"
STRONGER, CANNOT_BE_JUDGED = "stronger than the paper", "cannot be judged"
VERDICTS = (STRONGER, BORNE_OUT, NOT_BORNE_OUT, CANNOT_BE_JUDGED)

_FILE = parse(Path(__file__).with_name("claims.yaml").read_text(encoding="utf-8")).data
REASONS: dict[str, str] = _FILE["reasons"]
TAKES: dict[str, str] = {name: row["takes"] for name, row in _FILE["ablations"].items()}
ABLATIONS = tuple(Changed(name, row["changes"], "") for name, row in _FILE["ablations"].items())


class Claim(NamedTuple):
    """A published statement: what is measured in which flights, its limit with where that comes from, and the
    ablation, of ABLATIONS, in which it must fail.

    reason: why nothing is measured, for those without a measure. because: why it does not hold.
    """

    where: str
    statement: str
    measure: Measure | None = None
    names: tuple[str, ...] = ()
    limit: float = 0.0
    source: str = ""
    ablation: str = ""
    reason: str = ""
    because: str = ""

    def number(self, flights: Flights) -> float:
        """What is measured in the flights."""
        assert self.measure is not None
        return float(self.measure.of(flights, *self.names))

    def holds(self, number: float) -> bool:
        """Whether the number keeps the limit."""
        assert self.measure is not None
        return bool(number >= self.limit if self.measure.at_least else number <= self.limit)

    def verdict(self, number: float, without: float, elsewhere: Sequence[float]) -> str:
        """One of VERDICTS. number: as flown; without: in the ablation's flights; elsewhere: wherever else.

        *Stronger than the paper*: it holds, fails without the mechanism, and holds wherever the paper did not
        fly: with each inertia uncertainty theta at -0.25, 0 and 0.25 (27 corners and edges of what is
        published), at every whole airspeed from 42 to 48 m/s, under every change to what the paper leaves
        open and with every gain halved and doubled (BEYOND, VARIANTS and GAINS of cases.py).
        """
        if not self.holds(number):
            return NOT_BORNE_OUT
        if self.holds(without):
            return CANNOT_BE_JUDGED
        return STRONGER if all(map(self.holds, elsewhere)) else BORNE_OUT


def _claim(row: dict) -> Claim:
    if "reason" in row:
        return Claim(row["where"], row["says"], reason=REASONS[row["reason"]])
    what, *names = row["measure"]
    limit, source = _FILE["limits"][row["limit"]]
    return Claim(
        row["where"], row["says"], MEASURES[what], tuple(names), limit, source, row["without"],
        because=row.get("because", ""),
    )  # fmt: skip


CLAIMS = tuple(map(_claim, _FILE["claims"]))
MEASURED = tuple(claim for claim in CLAIMS if claim.measure)
