"""The grades of submissions on the hidden flights, with the built-in scheme, law and oracle in the rankings.

A flight gives 0 to 100 points (`points_of_detector`, `points_of_law`); the score is their mean.
"""

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from math import inf, isfinite
from pathlib import Path
from random import Random
from statistics import fmean, median
from typing import TYPE_CHECKING, Any

from beaver_ftc.documents import BadInput, BeaverFtcError
from beaver_ftc.results import Document, as_json, versions
from beaver_ftc.studies.compare import ORACLE_LAW as ORACLE
from beaver_ftc.studies.compare import OUR_LAW as LAW
from beaver_ftc.studies.compare import OUR_SCHEME as SCHEME
from beaver_ftc.studies.compare import Entry, Result, result_of, with_entry
from beaver_ftc.studies.engine import Progress, Study, run_study
from beaver_ftc.studies.present import (
    Heading,
    Makers,
    Part,
    Table,
    aligned,
    as_html,
    as_markdown,
    finite,
    number,
    versions_line,
)
from beaver_ftc_live.challenge import confine, folders, line
from beaver_ftc_live.challenge.folders import Submission
from beaver_ftc_live.challenge.line import (
    Allowance,
    Barred,
    SubmittedCode,
    SubmittedDetector,
    SubmittedLaw,
    plain,
)

if TYPE_CHECKING:
    from beaver_ftc.scenario import Scenario

DETECTOR, BUILT_IN_LAW = "built-in scheme", "built-in law"
OURS = {DETECTOR: Entry(SCHEME, "nominal"), BUILT_IN_LAW: Entry(SCHEME, LAW), ORACLE: Entry(SCHEME, ORACLE)}
FULL, NAMED, SLOW_S = 100.0, 50.0, 5.0


def rules() -> dict[str, float]:
    """Limits and points, by their names in the rules for the students."""
    times = {"load_s": line.LOAD_S, "frame_s": line.FRAME_S, "all_s": line.ALL_S}
    sizes = {"kib": folders.MOST_BYTES >> 10, "mib": confine.MEMORY_BYTES >> 20}
    return times | sizes | {"quick": FULL - NAMED, "named": NAMED, "slow_s": SLOW_S}


@dataclass
class Graded:
    """The results of a submission in the order of the flights; None for a flight that it could not complete.

    walls: names of the protections of its process. reason: of its first failure. barred: without any points.
    """

    student: str
    kind: str = ""
    class_name: str = ""
    walls: str = ""
    reason: str = ""
    barred: bool = False
    results: list[Result | None] = field(default_factory=list)


def grade(challenge: Path, workers: int, progress: Progress | None) -> Document:
    """Grade the last submission of each student, and write the folder `grades` of the challenge."""
    flights = folders.hidden_flights(challenge)
    # Otherwise the number of a process would show whether its flight is healthy.
    Random(repr(flights)).shuffle(flights)
    cases = [*folders.submissions(challenge), *OURS]
    flown = hashlib.sha256(repr(flights).encode()).hexdigest()  # an interrupted study hides them, too
    study = Study(
        folders.GRADES, cases, partial(grade_case, flights=flights),
        partial(document_of, flights=len(flights)), FILES, row=Graded, follows_from=flown, lost=_lost,
    )  # fmt: skip
    return run_study(study, challenge, workers, progress)


def _lost(case: Any, why: str) -> Graded:
    """The row of a submission whose process was lost."""
    return Graded(case.student, reason=why, barred=True)


def tried(source: str, name: str) -> Document:
    """Kind, class, protections and points of a submission in the practice flight. Raises BadInput if the
    submission fails."""
    flight, allowance = folders.practice(), Allowance()
    try:
        with SubmittedCode(source, name, allowance) as first:
            first.look()
        result = fly_submission(first, source, name, allowance, flight)
    except BeaverFtcError as error:
        raise BadInput(f"{name}: {error}") from error
    if first.kind == "detector":
        points = points_of_detector(result)
    else:
        points = points_of_law(result, _flown(with_entry(flight, OURS[ORACLE]), OURS[ORACLE]))
    walls = first.walls.split()
    return {"kind": first.kind, "class": first.class_name, "walls": walls, "points": round(points, 1)}


def grade_case(case: Submission | str, flights: Sequence["Scenario"]) -> Graded:
    """The results of a submission, or of a built-in entry (a key of OURS), on all flights."""
    if isinstance(case, str):
        return Graded(
            case, results=[_flown(with_entry(flight, OURS[case]), OURS[case]) for flight in flights]
        )
    graded = Graded(case.student)
    try:
        _grade(graded, folders.source_of(case.file), case.file.name, flights)
    except (Barred, BadInput) as error:
        graded.barred, graded.reason = True, plain(str(error))
    return graded


def _grade(graded: Graded, source: str, name: str, flights: Sequence["Scenario"]) -> None:
    """Load a submission and add its results to `graded`. Raises Barred if it cannot be loaded."""
    allowance = Allowance()
    try:
        with SubmittedCode(source, name, allowance) as first:
            first.look()
    except BeaverFtcError as error:  # it could not be loaded for any flight
        raise Barred(str(error)) from error
    graded.kind, graded.class_name, graded.walls = first.kind, first.class_name, first.walls
    for flight in flights:
        try:
            graded.results.append(fly_submission(first, source, name, allowance, flight))
        except Barred:
            raise
        except BeaverFtcError as error:
            graded.results.append(None)
            graded.reason = graded.reason or plain(str(error))


def fly_submission(
    first: SubmittedCode, source: str, name: str, allowance: Allowance, flight: "Scenario"
) -> Result:
    """Fly a flight with a submitted class in a process of its own. first: the class as it was loaded before,
    with its kind."""
    if first.kind == "detector":
        entry = OURS[DETECTOR]
        with SubmittedDetector(source, name, allowance) as detector:
            return _flown(with_entry(flight, entry), entry, detector=detector)
    entry = OURS[BUILT_IN_LAW]
    with SubmittedLaw(source, name, allowance) as law:
        law.fault_tolerant = first.fault_tolerant
        return _flown(with_entry(flight, entry), entry, law=law)


def _flown(scenario: "Scenario", entry: Entry, **plugged: Any) -> Result:
    from beaver_ftc.loop import fly

    return result_of(fly(scenario, **plugged), entry, 0.0)


def points_of_detector(result: Result | None) -> float:
    """Points of a detector in a flight:

    failed flight, or false alarm    0
    no fault                         FULL
    fault without an alarm           0
    fault with an alarm              (FULL - NAMED) max(0, 1 - delay / SLOW_S), and NAMED for the right name
    """
    if result is None or result.false_alarm:
        return 0.0
    if not result.faulted:
        return FULL
    if not isfinite(result.delay_s):
        return 0.0
    return (FULL - NAMED) * max(0.0, 1.0 - result.delay_s / SLOW_S) + NAMED * result.correct


def points_of_law(result: Result | None, oracle: Result) -> float:
    """Points of a law in a flight: FULL times the tracking error of the oracle over that of the law, at most
    FULL; 0 if the flight failed or the aircraft was lost."""
    if result is None or not isfinite(result.rms_deg_s):
        return 0.0
    return FULL * min(1.0, oracle.rms_deg_s / result.rms_deg_s)


def document_of(rows: Sequence[Graded], flights: int) -> Document:
    """The document grades.json, with both rankings. Numbers that do not exist are null."""
    yardstick = next(row.results for row in rows if row.student == ORACLE)
    oracle = [result for result in yardstick if result is not None]  # for the type: none is missing
    kinds: dict[str, Callable[[Graded], Document]] = {
        "detectors": detectors_row,
        "laws": partial(laws_row, oracle=oracle),
    }
    places = {"detectors": ("detector", DETECTOR), "laws": ("law", BUILT_IN_LAW)}
    ranked = {
        name: _ranked([row_of(row) for row in rows if _belongs(row, *places[name])])
        for name, row_of in kinds.items()
    }
    walls = sorted({row.walls for row in rows if row.walls})
    return {"flights": flights, "walls": walls, **ranked, "versions": dict(versions())}


def _belongs(row: Graded, kind: str, ours: str) -> bool:
    """Whether a row belongs to the ranking of this kind. A submission that could not be loaded is ranked
    with the detectors. ours: the built-in entry of this ranking."""
    return row.student == ours or (row.student not in OURS and (row.kind or "detector").endswith(kind))


def _ranked(rows: list[Document]) -> list[Document]:
    """The rows with their places, the best first. A built-in entry has no place."""
    rows.sort(key=lambda row: (-row["score"], row["student"]))
    above = 0
    for row in rows:
        above += row["student"] not in OURS
        row["place"] = None if row["student"] in OURS else above
    return rows


def _row(graded: Graded, points: Sequence[float]) -> Document:
    """The columns of both rankings. points: of each flight."""
    score = 0.0 if graded.barred or not points else round(fmean(points), 1)
    return {"place": None, "student": graded.student, "class": graded.class_name, "score": score}


def detectors_row(graded: Graded) -> Document:
    """A row of the ranking of detectors, without its place."""
    flown = [result for result in graded.results if result is not None]
    delays = [r.delay_s for r in flown if r.faulted and not r.false_alarm and isfinite(r.delay_s)]
    return _row(graded, [points_of_detector(result) for result in graded.results]) | {
        "flights": len(flown),
        "false_alarms": sum(r.false_alarm for r in flown),
        "faults": sum(r.faulted for r in flown),
        "detected": len(delays),
        "delay_median_s": median(delays) if delays else None,
        "named_rightly": sum(r.correct for r in flown),
        "reason": _reason(graded, flown),
    }


def _reason(graded: Graded, flown: Sequence[Result]) -> str | None:
    """The reason of a failure, or a remark on a detector with false alarms in all flights."""
    if graded.reason:
        return graded.reason
    if graded.kind == "detector" and flown and all(result.false_alarm for result in flown):
        return "a false alarm in every flight"
    return None


def laws_row(graded: Graded, oracle: Sequence[Result]) -> Document:
    """A row of the ranking of laws, without its place. oracle: its results on the same flights."""
    pairs = list(zip(graded.results, oracle, strict=False))
    flown = [(mine, best) for mine, best in pairs if mine is not None]
    ratios = [mine.rms_deg_s / best.rms_deg_s for mine, best in flown]
    return _row(graded, [points_of_law(mine, best) for mine, best in pairs]) | {
        "flights": len(flown),
        "tracking_median": finite(median(ratios)) if ratios else None,
        "error_median_deg_s": finite(median(mine.rms_deg_s for mine, _ in flown)) if flown else None,
        "lost": sum(mine.rms_deg_s == inf for mine, _ in flown),
        "reason": graded.reason or None,
    }


_COLUMNS = {
    "place": "", "student": "student", "class": "class", "score": "score", "flights": "flights",
    "false_alarms": "false alarms", "faults": "faults", "detected": "detected",
    "delay_median_s": "delay s, median",
    "named_rightly": "named rightly", "tracking_median": "error/oracle's, median",
    "error_median_deg_s": "error deg/s, median", "lost": "aircraft lost", "reason": "reason",
}  # fmt: skip


def _table(rows: Sequence[Document]) -> Table:
    """The table of a ranking."""
    keys = [key for key in _COLUMNS if key in rows[0]]
    cells = [[_cell(key, row[key]) for key in keys] for row in rows]
    return Table([_COLUMNS[key] for key in keys], cells)


def _cell(key: str, value: Any) -> str:
    if key == "score":
        return f"{value:.1f}"
    return str(value) if isinstance(value, int) else number(value)


def as_text(document: Document) -> str:
    """The text for a terminal."""
    blocks = [f"{document['flights']} hidden flights; protections: {', '.join(document['walls']) or 'none'}"]
    for name in ("detectors", "laws"):
        table = _table(document[name])
        blocks.append(f"{name}\n" + aligned([table.head, *table.rows]))
    return "\n\n".join(blocks)


def parts_of(document: Document) -> list[Part]:
    """The parts of the page, for grades.md and grades.html."""
    parts: list[Part] = [f"{document['flights']} hidden flights, the same for everybody."]
    for name in ("detectors", "laws"):
        parts += [Heading(name.capitalize()), _table(document[name])]
    return [*parts, versions_line(document["versions"])]


FILES: Makers = {
    "grades.json": as_json,
    "grades.md": lambda document: as_markdown(parts_of(document)),
    "grades.html": lambda document: as_html("Grades", parts_of(document), {}),
}
