"""The reproduction as one document: what the tables, the page and `--format json` are made from."""

from collections.abc import Sequence
from dataclasses import asdict

from beaver_ftc.results.metrics import Document, versions
from beaver_ftc.studies.present.tables import finite
from beaver_ftc.studies.reproduce.cases import BESIDE, PUBLISHED, Flown, fly_case
from beaver_ftc.studies.reproduce.choices import CHOICES
from beaver_ftc.studies.reproduce.claims import CLAIMS, Claim
from beaver_ftc.studies.reproduce.sensitivity import VARIANTS


def fly_published() -> dict[str, Flown]:
    """Every case, published and beside it, by name."""
    return {case.name: fly_case(case) for case in (*PUBLISHED, *BESIDE)}


def document_of(flights: dict[str, Flown], numbers: Sequence[list[float]]) -> Document:
    """Judge the flights; numbers: of every claim under each of the sensitivity study's VARIANTS."""
    claims = [_judged(claim, flights, [row[i] for row in numbers]) for i, claim in enumerate(CLAIMS)]
    return {
        "passed": all(claim["passed"] for claim in claims),
        "claims": claims,
        "choices": [asdict(choice) for choice in CHOICES],
        "sensitivity": [
            {"variant": variant.name, "changes": dict(variant.changes), "missed": _missed(row)}
            for variant, row in zip(VARIANTS, numbers, strict=True)
        ],
        "cases": [
            {"case": case.name, "shown_in": case.shown_in, "metrics": flights[case.name].metrics}
            for case in (*PUBLISHED, *BESIDE)
        ],
        "versions": dict(versions()),
    }


def _judged(claim: Claim, flights: dict[str, Flown], varied: list[float]) -> Document:
    number = claim.measure(flights)
    return {
        "where": claim.where,
        "statement": claim.statement,
        "quantity": claim.quantity,
        "unit": claim.unit,
        "number": finite(number),
        "limit": claim.limit,
        "at_least": claim.at_least,
        "passed": claim.holds(number),
        "remark": claim.remark(flights),
        "lowest": finite(min(varied)),
        "highest": finite(max(varied)),
        "held_in": sum(claim.holds(other) for other in varied),
    }


def _missed(numbers: list[float]) -> list[Document]:
    """The claims that a variant does not bear out, with its number."""
    return [
        {"where": claim.where, "statement": claim.statement, "number": finite(number), "unit": claim.unit}
        for claim, number in zip(CLAIMS, numbers, strict=True)
        if not claim.holds(number)
    ]
