"""Fly the published study and judge its statements: the document, and its files.

A setting is a change of the published setting (cases.py). For each setting of the claims, a row has the
numbers of all measured claims, in the order of MEASURED, and the numbers in their ablations. For each setting
of a healthy flight (beside.py), a row has whether the flight raises a false alarm. The document has the
verdicts that follow.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from math import nan
from pathlib import Path

from beaver_ftc.commands import Reporter, StudyCommand, WorkersOption
from beaver_ftc.results.metrics import as_json, versions
from beaver_ftc.results.model import Document
from beaver_ftc.studies.engine.study import Study, run_into
from beaver_ftc.studies.present.page import Makers, Summary
from beaver_ftc.studies.present.tables import finite
from beaver_ftc.studies.reproduce import beside, truth_and_design
from beaver_ftc.studies.reproduce.cases import (
    BEYOND,
    GAINS,
    PUBLISHED,
    VARIANTS,
    Changed,
    Flown,
    LazyFlights,
    fly_case,
)
from beaver_ftc.studies.reproduce.choices import CHOICES, OPTIONS, gains
from beaver_ftc.studies.reproduce.claims import (
    ABLATIONS,
    BORNE_OUT,
    CANNOT_BE_JUDGED,
    CLAIMS,
    MEASURED,
    NOT_BORNE_OUT,
    STRONGER,
    TAKES,
    VERDICTS,
    Claim,
)
from beaver_ftc.studies.reproduce.published_figures import figures_of
from beaver_ftc.studies.reproduce.words import NAME, as_html, as_markdown, as_text

Rows = list[Document]
Pair = tuple[float, float]  # number of a claim in a setting, and its number in the ablation
BySetting = Mapping[str, list[Pair]]  # by name of the setting, the pair of each of MEASURED
NUMBERS, ABLATED, SAME, FALSE_ALARM = "numbers", "without", "same", "false alarm"
AS_PUBLISHED = Changed("as published", {})
ELSEWHERE = (*BEYOND, *VARIANTS, *GAINS)  # settings that the paper did not fly
SETTINGS = (AS_PUBLISHED, *ELSEWHERE)
WITHOUT: Mapping[str, Changed] = {ablation.name: ablation for ablation in ABLATIONS}
NO_ADAPTATION = {"fdi.options.adaptation_gain": 0.0}  # of the isolation estimators
STUDIED: tuple[tuple[str, Changed], ...] = (  # kind of the row, and setting
    *((NUMBERS, setting) for setting in SETTINGS),
    *((FALSE_ALARM, setting) for _, setting in beside.healthy_settings()),
)


def row_of(studied: tuple[str, Changed]) -> Document:
    """The row of a setting: the numbers of the claims, or whether a healthy flight has a false alarm."""
    kind, setting = studied
    return claims_row(setting) if kind == NUMBERS else {FALSE_ALARM: beside.false_alarm_of(setting)}


def claims_row(setting: Changed) -> Document:
    """The row of a setting:

        numbers    the number of each of MEASURED
        without    the number of each in its ablation
        same       in how many flights of FAULTY (beside.py) the adaptation of the isolation estimators
                   changes neither the name nor the times of alarm and name

    A number that no verdict needs is not flown. It is nan, which keeps no limit.
    """
    flown_so_far: dict[str, Flown] = {}
    flights = LazyFlights(setting.changes, flown_so_far)
    is_published = setting.name == AS_PUBLISHED.name

    def number_without(claim: Claim) -> float:
        return claim.number(LazyFlights({**setting.changes, **WITHOUT[claim.ablation].changes}, flown_so_far))

    unadapted = LazyFlights({**setting.changes, **NO_ADAPTATION}, flown_so_far)
    return {
        NUMBERS: [claim.number(flights) if is_published or not claim.because else nan for claim in MEASURED],
        ABLATED: [
            number_without(claim) if is_published or (claim.testable and not claim.because) else nan
            for claim in MEASURED
        ],
        SAME: sum(
            _times_and_name(flights[name]) == _times_and_name(unadapted[name]) for name in beside.FAULTY
        ),
    }


def _times_and_name(flight: Flown) -> tuple[float | None, str | None, float | None]:
    """Time of the alarm, name, and time of the name."""
    metrics = flight.metrics
    return metrics.detection.time_s, metrics.isolation.fault, metrics.isolation.time_s


def fly_published() -> dict[str, Flown]:
    """The flights of the published cases, by name."""
    return {case.name: fly_case(case) for case in PUBLISHED}


def document_of(rows: Sequence[Document]) -> Summary:
    """The document, and behind it, for the figures, the flights of the published cases by name. rows: of each
    setting of STUDIED, in order. The published cases, those with our scheme and law, and the designs are
    flown here."""
    flights = fly_published()
    settings = {
        setting.name: row for (kind, setting), row in zip(STUDIED, rows, strict=True) if kind == NUMBERS
    }
    pairs_of = {name: list(zip(row[NUMBERS], row[ABLATED], strict=True)) for name, row in settings.items()}
    claims = _claims(pairs_of)
    counts = Counter(row["verdict"] for row in claims)
    document = {
        "passed": all(row["verdict"] != NOT_BORNE_OUT or row["because"] for row in claims),
        "counts": {verdict: counts[verdict] for verdict in VERDICTS},
        **_counted_apart(claims),
        "adaptation": {
            "flights": len(beside.FAULTY) * len(SETTINGS),
            "same": sum(row[SAME] for row in settings.values()),
        },
        "claims": claims,
        "ablations": _ablations(claims),
        "beside": beside.document_of(
            beside.fly_both(), [row[FALSE_ALARM] for row in rows if FALSE_ALARM in row]
        ),
        "truth_and_design": truth_and_design.document_of(truth_and_design.fly_designs()),
        "choices": [asdict(choice) for choice in (*CHOICES, *OPTIONS)],
        "gains": _gains(pairs_of),
        "sensitivity": _sensitivity(pairs_of),
        "cases": [
            {
                "case": case.name,
                "shown_in": case.shown_in,
                "metrics": flights[case.name].metrics.document(),
            }
            for case in PUBLISHED
        ],
        "versions": dict(versions()),
    }
    return Summary(document, flights)


def _claims(pairs_of: BySetting) -> Rows:
    """A row for each claim."""
    judged = {
        claim: _judged(claim, {name: pairs[i] for name, pairs in pairs_of.items()})
        for i, claim in enumerate(MEASURED)
    }
    rows = []
    for claim in CLAIMS:
        outcome = judged.get(claim) or {
            "verdict": CANNOT_BE_JUDGED, "reason": claim.reason, "because": "", "number": None,
            "construction": False,
        }  # fmt: skip
        rows.append({"where": claim.where, "statement": claim.statement, **outcome})
    return rows


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


def _counted_apart(claims: Rows) -> Document:
    """Counts of the statements that can be tested, with their verdicts; of those that are true by
    construction; and of those without a measure. claims: the rows of `_claims`."""
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


def _ablations(claims: Rows) -> Rows:
    """A row for each ablation: its changes, how many statements refer to its mechanism, and how many fail
    without it. claims: the rows of `_claims`."""
    rows = []
    for ablation in ABLATIONS:
        fails = [row["fails_without"] for row in claims if row.get("ablation") == ablation.name]
        rows.append({
            "ablation": ablation.name, "takes": TAKES[ablation.name], "changes": dict(ablation.changes),
            "statements": len(fails), "fail": sum(fails),
        })  # fmt: skip
    return rows


def _gains(pairs_of: BySetting) -> Rows:
    """A row for each gain: the claims that no longer hold if the gain is halved, and if it is doubled."""
    rows = []
    for gain in gains():
        halved, doubled = (_missed(pairs_of, s.name) for s in GAINS if gain.key in s.changes)
        rows.append({**gain._asdict(), "halved": halved, "doubled": doubled})
    return rows


def _sensitivity(pairs_of: BySetting) -> Rows:
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


FILES: Makers = {
    "figures": figures_of,
    f"{NAME}.json": as_json,
    f"{NAME}.md": partial(as_markdown, figures="figures"),
    f"{NAME}.html": lambda document: partial(as_html, document),
}


@dataclass(frozen=True)
class Reproduce(StudyCommand):
    """Reproduce the published study and check its statements.

    The study is [Zhang2005]. The command reports every figure and every statement of the study. For each
    statement it reports the value that it found and a verdict. It also reports the value without the
    mechanism to which the statement refers. The command also flies the same cases with the default scheme and
    law.

    The exit status is 1 if a statement does not hold and the reason is not known.

    If the command is interrupted, the same command resumes it.

    Examples:
      beaver-ftc reproduce --out runs

    out: Folder for the results.
    """

    out: Path = Path("runs")
    workers: WorkersOption = None

    FILES = FILES
    PLUGINS = False

    @property
    def label(self) -> str:
        """The words before the progress bar."""
        return "ablations, and changes to what the paper leaves open"

    def run(self, reporter: Reporter) -> Document:
        """Fly all settings with their ablations, then the other flights of the document."""
        study = Study(NAME, STUDIED, row_of, document_of, FILES)
        return run_into(study, self.out, self.processes, reporter.progress)

    def as_text(self, document: Document, colour: bool) -> str:
        """The tables, and sentences about the sensitivity."""
        return as_text(document, document["folder"], colour)
