"""The numbers of all settings judged: rows of claims, ablations, gains and settings, and counts of verdicts.

Each setting has a pair of numbers for each of MEASURED: in the setting, and in its ablation there.
"""

from collections import Counter
from collections.abc import Mapping

from beaver_ftc.results.model import Document
from beaver_ftc.studies.present.tables import finite, grouped, sum_of
from beaver_ftc.studies.reproduce.cases import AS_PUBLISHED, ELSEWHERE, GAINS
from beaver_ftc.studies.reproduce.choices import gains
from beaver_ftc.studies.reproduce.claims import (
    ABLATIONS,
    BORNE_OUT,
    CANNOT_BE_JUDGED,
    CLAIMS,
    MEASURED,
    NOT_BORNE_OUT,
    STRONGER,
    TAKES,
    Claim,
)

Rows = list[Document]
Pair = tuple[float, float]  # number of a claim in a setting, and its number in the ablation
BySetting = Mapping[str, list[Pair]]  # by name of the setting, the pair of each of MEASURED
UNMEASURED: Document = {  # a claim without a measure; its reason follows
    "verdict": CANNOT_BE_JUDGED, "reason": "", "because": "", "number": None, "construction": False,
}  # fmt: skip


def rows_of_claims(pairs_of: BySetting) -> Rows:
    """A row for each claim."""
    judged = {
        claim: _judged(claim, {name: pairs[i] for name, pairs in pairs_of.items()})
        for i, claim in enumerate(MEASURED)
    }
    return [
        {"where": claim.where, "statement": claim.statement}
        | (judged.get(claim) or UNMEASURED | {"reason": claim.reason})
        for claim in CLAIMS
    ]


def _judged(claim: Claim, pair_of: Mapping[str, Pair]) -> Document:
    """The row of a measured claim. pair_of: its pair of numbers by name of the setting. `lowest` and
    `highest` are over ELSEWHERE; a claim with `because` has only its number in the published setting."""
    number, number_without = pair_of[AS_PUBLISHED.name]
    elsewhere = [] if claim.because else [pair_of[setting.name] for setting in ELSEWHERE]
    measure = claim.measure
    verdict = claim.verdict(number, number_without, elsewhere)
    everywhere = [n for n, _ in elsewhere] or [number]
    return {
        "measure": measure.name,
        "quantity": measure.quantity,
        "unit": measure.unit,
        "flights": list(claim.names),
        "limit": claim.limit,
        "limit_from": claim.source,
        "at_least": measure.at_least,
        "none": measure.none,
        "number": finite(number),
        "ablation": claim.ablation,
        "without": TAKES[claim.ablation],
        "number_without": finite(number_without),
        "fails_without": not claim.holds(number_without),
        "construction": claim.construction,
        "lowest": finite(min(everywhere)),
        "highest": finite(max(everywhere)),
        "held_in": sum(claim.holds(n) for n, _ in elsewhere),
        "borne_out_in": sum(claim.is_borne_out(*pair) for pair in elsewhere),
        "elsewhere": len(elsewhere),
        "verdict": verdict,
        "because": claim.because if verdict == NOT_BORNE_OUT else "",
        "reason": "",
    }


def counted_apart(claims: Rows) -> Document:
    """Counts of the statements that can be tested, with their verdicts; of those that are true by
    construction; and of those without a measure. claims: the rows of `rows_of_claims`."""
    tested = Counter(row["verdict"] for row in claims if not row["reason"] and not row["construction"])
    built = [row["verdict"] != NOT_BORNE_OUT for row in claims if row["construction"]]
    return {
        "testable": {
            "statements": tested.total(),
            "hold": tested[STRONGER] + tested[BORNE_OUT],
            "elsewhere": tested[STRONGER],
            "do_not": tested[NOT_BORNE_OUT],
            "unsettled": tested[CANNOT_BE_JUDGED],
        },
        "construction": {"statements": len(built), "hold": sum(built)},
        "background": sum(bool(row["reason"]) for row in claims),
    }


def rows_of_ablations(claims: Rows) -> Rows:
    """A row for each ablation: its changes, how many statements refer to its mechanism, and how many fail
    without it. claims: the rows of `rows_of_claims`."""
    fails_without = grouped((row for row in claims if not row["reason"]), "ablation")
    rows = []
    for ablation in ABLATIONS:
        statements = fails_without.get((ablation.name,), [])
        rows.append({
            "ablation": ablation.name, "takes": TAKES[ablation.name], "changes": dict(ablation.changes),
            "statements": len(statements), "fail": sum_of(statements, "fails_without"),
        })  # fmt: skip
    return rows


def rows_of_gains(pairs_of: BySetting) -> Rows:
    """A row for each gain: the claims that no longer hold if the gain is halved, and if it is doubled."""
    rows = []
    for gain in gains():
        halved, doubled = (_missed(pairs_of, s.name) for s in GAINS if gain.key in s.changes)
        rows.append({**gain._asdict(), "halved": halved, "doubled": doubled})
    return rows


def sensitivity_rows(pairs_of: BySetting) -> Rows:
    """A row for each setting of ELSEWHERE: the claims that no longer hold, and those that hold in their
    ablation only there."""
    return [
        {
            "variant": setting.name,
            "changes": dict(setting.changes),
            "missed": _missed(pairs_of, setting.name),
            "also_without": _also_without(pairs_of, setting.name),
        }
        for setting in ELSEWHERE
    ]


def _also_without(pairs_of: BySetting, setting: str) -> Rows:
    """The claims that hold in a setting and in its ablation, but do not hold in the ablation of the published
    setting."""
    pairs = zip(MEASURED, pairs_of[setting], pairs_of[AS_PUBLISHED.name], strict=True)
    return [
        _claim_row(claim, number_without) | {"without": TAKES[claim.ablation]}
        for claim, (number, number_without), (_, published_without) in pairs
        if claim.holds(number) and claim.holds(number_without) and not claim.holds(published_without)
    ]


def _claim_row(claim: Claim, number: float) -> Document:
    """A claim with its number in a setting, or in the ablation of a setting."""
    return {
        "where": claim.where,
        "statement": claim.statement,
        "number": finite(number),
        "unit": claim.measure.unit,
        "none": claim.measure.none,
    }


def _missed(pairs_of: BySetting, setting: str) -> Rows:
    """The claims that hold in the published setting but not in this setting, with their numbers there."""
    pairs = zip(MEASURED, pairs_of[AS_PUBLISHED.name], pairs_of[setting], strict=True)
    return [
        _claim_row(claim, number)
        for claim, (published_number, _), (number, _) in pairs
        if claim.holds(published_number) and not claim.holds(number)
    ]
