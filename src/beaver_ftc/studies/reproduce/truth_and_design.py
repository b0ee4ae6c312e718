"""The terms of truth and design model: eq. (2) of [Zhang2005] as printed omits the engine."""

from collections.abc import Mapping
from functools import partial
from typing import Any

from beaver_ftc.aircraft import AXES, load
from beaver_ftc.aircraft.aircraft import MOMENTS
from beaver_ftc.results.model import Document
from beaver_ftc.studies.present.tables import number, seconds
from beaver_ftc.studies.reproduce.cases import CASES, HEALTHY, fly_case
from beaver_ftc.studies.reproduce.flown import Flown

COVERED = {
    "p": 0.05,
    "q": 0.3,
    "r": 0.06,
}  # rad/s2: above the moments of the engine, as `beaver-ftc mismatch` measures
_PRINTED: Document = {"design_model.engine_terms": False}
_WIDE = {**_PRINTED, "fdi.bounds.constant_rad_s2": COVERED}
DESIGNS: tuple[tuple[str, str, Mapping[str, Any]], ...] = (  # name, bound, changes
    ("all terms of the truth", "as published", {}),
    ("eq. (2) as printed", "as published", _PRINTED),
    ("eq. (2) as printed", "wide enough: 0.05, 0.3, 0.06 rad/s2", _WIDE),
)


def terms() -> list[Document]:
    """A row for each moment: the terms of the truth, and those that eq. (2) omits."""
    aircraft = load()
    rows = []
    for moment in MOMENTS:
        terms_of_moment = [term for term in aircraft.moments if term.coefficient == moment]
        engine = [
            term.name for term in terms_of_moment if any(signal in aircraft.signals for signal, _ in term.of)
        ]
        rows.append({"moment": moment, "truth": [term.name for term in terms_of_moment], "omitted": engine})
    return rows


def document_of() -> Document:
    """The document: the terms, and a row for each of DESIGNS, of a healthy flight and one with the published
    elevator fault."""
    rows = [
        _row(name, bound, fly_case(HEALTHY, changes), fly_case(CASES["elevator"], changes))
        for name, bound, changes in DESIGNS
    ]
    return {"terms": terms(), "designs": rows}


def _row(name: str, bound: str, healthy: Flown, faulty: Flown) -> Document:
    """A design: alarm and |residual| / threshold in the healthy flight, detection and name in the faulty
    one."""
    metrics = faulty.metrics
    return {
        "design": name,
        "bound": bound,
        "alarm_s": healthy.metrics.detection.time_s,
        "share": {axis: float(share) for axis, share in zip(AXES, healthy.shares().max(axis=1), strict=True)},
        "detected_s": metrics.fault_found_s,
        "false_alarm": metrics.false_alarm,
        "named": metrics.isolation.fault,
    }


def _printed(row: Document) -> str:
    """The terms of eq. (2) as printed."""
    return ", ".join(name for name in row["truth"] if name not in row["omitted"])


def _detected(row: Document) -> str:
    return "after a false alarm" if row["false_alarm"] else number(row["detected_s"], "s", none="never")


TERMS = (  # a row a moment
    ("Moment", "moment"), ("Truth, and our design", "truth", ", ".join), ("Eq. (2) as printed", _printed),
    ("Omitted there", "omitted", ", ".join),
)  # fmt: skip
FLOWN = (  # a row a design
    ("Design model", "design"), ("Constant bound", "bound"),
    ("First alarm without a fault", "alarm_s", partial(seconds, none="none")),
    ("|residual| / threshold: p", "share.p"), ("q", "share.q"), ("r", "share.r"),
    ("40 % loss of the elevator: detected after", _detected), ("named", "named"),
)  # fmt: skip
