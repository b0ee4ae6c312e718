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
from beaver_ftc.studies.present.tables import sum_of
from beaver_ftc.studies.reproduce import beside, truth_and_design
from beaver_ftc.studies.reproduce.cases import (
    AS_PUBLISHED,
    ELSEWHERE,
    PUBLISHED,
    Changed,
    LazyFlights,
    fly_case,
)
from beaver_ftc.studies.reproduce.choices import CHOICES, OPTIONS
from beaver_ftc.studies.reproduce.claims import ABLATIONS, MEASURED, NOT_BORNE_OUT, VERDICTS, Claim
from beaver_ftc.studies.reproduce.flown import Flown
from beaver_ftc.studies.reproduce.judged import (
    counted_apart,
    rows_of_ablations,
    rows_of_claims,
    rows_of_gains,
    sensitivity_rows,
)
from beaver_ftc.studies.reproduce.published_figures import figures_of
from beaver_ftc.studies.reproduce.words import NAME, as_html, as_markdown, as_text

NUMBERS, ABLATED, SAME, FALSE_ALARM = "numbers", "without", "same", "false alarm"
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
    claims = rows_of_claims(pairs_of)
    counts = Counter(row["verdict"] for row in claims)
    document = {
        "passed": all(row["verdict"] != NOT_BORNE_OUT or row["because"] for row in claims),
        "counts": {verdict: counts[verdict] for verdict in VERDICTS},
        **counted_apart(claims),
        "adaptation": {
            "flights": len(beside.FAULTY) * len(SETTINGS),
            "same": sum_of(settings.values(), SAME),
        },
        "claims": claims,
        "ablations": rows_of_ablations(claims),
        "beside": beside.document_of(
            beside.fly_both(), [row[FALSE_ALARM] for row in rows if FALSE_ALARM in row]
        ),
        "truth_and_design": truth_and_design.document_of(),
        "choices": [asdict(choice) for choice in (*CHOICES, *OPTIONS)],
        "gains": rows_of_gains(pairs_of),
        "sensitivity": sensitivity_rows(pairs_of),
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
