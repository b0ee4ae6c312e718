"""The document of a plan as text, as one HTML page and as PDF; and the study that flies it."""

from collections.abc import Iterator
from datetime import UTC, datetime
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from beaver_ftc.documents import BadInput
from beaver_ftc.results import Expectation, as_json
from beaver_ftc.studies.engine import Progress, Study, run_study
from beaver_ftc.studies.present import Heading, Makers, Part, Table, aligned, as_html, number, versions_line
from beaver_ftc_assurance.evidence.flown import MET, NOT_MET, NOT_SHOWN, WORST_FIRST, failed, fly_flight
from beaver_ftc_assurance.evidence.judged import Document, document_of
from beaver_ftc_assurance.evidence.plan import EvidencePlan

ON_THE_SUMMARY = 24  # largest number of requirements in the summary, which fills one page
MOST_LETTERS = 90  # longest text of a requirement in the summary
MOST_SHOWN = 10  # largest number of failing flights that are named for a requirement
# Verdict -> whether it is shown as good.
VERDICTS = {MET: True, NOT_MET: False, NOT_SHOWN: False}
NO_APPROVAL = (
    "Clauses are quoted by number, with our reading of them. This document records flights of a simulation; "
    "it claims no approval by any authority."
)


def run_plan(
    plan: EvidencePlan, folder: Path, workers: int = 1, progress: Progress | None = None
) -> Document:
    """Fly a plan, write evidence.json, .html and .pdf into a folder, and return the document.

    Raises BadInput before any flight if reportlab, which writes the PDF, is not installed.
    """
    if find_spec("reportlab") is None:
        raise BadInput("evidence.pdf is written by reportlab, allowed: pip install 'beaver-ftc[evidence]'")
    now = datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC")
    study = Study(
        name=folder.name,
        cases=plan.cases,
        fly=partial(fly_flight, plan),
        document=lambda rows: document_of(plan, rows, now),
        files=FILES,
        follows_from=[plan.sha256, [source.sha256 for source in plan.sources.values()]],
        lost=partial(failed, plan),
    )
    return run_study(study, folder.parent, workers, progress)


def _html(document: Document) -> str:
    """The document as an HTML page."""
    return as_html(_title(document), list(page(document)), {})


def _pdf(document: Document) -> bytes:
    """The document as PDF, with the parts of the HTML page."""
    from beaver_ftc_assurance.evidence.paper import as_pdf

    return as_pdf(_title(document), list(page(document)), f"{document['plan']} · {document['date']}")


def _title(document: Document) -> str:
    """The title of HTML page and PDF."""
    return f"Evidence: {document['plan']}"


FILES: Makers = {"evidence.json": as_json, "evidence.html": _html, "evidence.pdf": _pdf}


def page(document: Document) -> Iterator[Part]:
    """The parts of the page: the summary, which fills the first page of the PDF, then all results under
    headings."""
    if document["description"]:
        yield document["description"].strip()
    flights = len(document["flights"])
    yield f"{counted(document)}, by {flights} flights. {document['date']}."
    yield _summary(document["requirements"])
    yield NO_APPROVAL
    yield f"Plan {document['hashes']['plan'][:16]}, flight code {document['hashes']['flight code']}."
    yield Heading("Requirements")
    for requirement in document["requirements"]:
        yield from _requirement(requirement)
    yield Heading("Coverage")
    for coverage in document["coverage"]:
        yield from _coverage(coverage)
    yield Heading("What it follows from")
    yield f"Plan {document['hashes']['plan']}; flight code {document['hashes']['flight code']}."
    yield versions_line(document["versions"])
    yield Table(
        ("flown", "as the plan names it", "flights", "SHA-256"),
        [
            (source["name"], source["given"], str(source["flights"]), source["sha256"][:32])
            for source in document["sources"]
        ],
    )
    yield "Of each flight evidence.json has the SHA-256 of its scenario and of its log."


def counted(document: Document) -> str:
    """Words for the number of requirements, of all and by verdict."""
    counts = document["counts"]
    return f"{sum(counts.values())} requirements: " + ", ".join(
        f"{n} {verdict}" for verdict, n in counts.items()
    )


def _summary(requirements: list[Document]) -> Table:
    """The table of requirements. If one page does not hold all, those not met come first, and the last line
    has the number of the others.
    """
    n_left = max(len(requirements) - ON_THE_SUMMARY, 0)
    if n_left:
        requirements = sorted(requirements, key=lambda row: WORST_FIRST.index(row["verdict"]))
    rows = [
        (row["id"], _short(row["text"]), row["verdict"], margin_of(row), row["worst"]["flight"])
        for row in requirements[:ON_THE_SUMMARY]
    ]
    rows += [("", f"{n_left} more", "", "", "")] if n_left else []
    return Table(("", "requirement", "verdict", "margin", "worst flight"), rows, VERDICTS)


def _short(text: str) -> str:
    """A text, cut to MOST_LETTERS."""
    return text if len(text) <= MOST_LETTERS else f"{text[: MOST_LETTERS - 3]}..."


def margin_of(requirement: Document) -> str:
    """Words for the margin of a requirement and the part that has it; without a margin, for the worst
    flight."""
    worst = requirement["worst"]
    if requirement["margin"] is None:
        return worst["says"] or f"{worst['name']}: {in_words(worst['actual'])}"
    return f"{signed(requirement['margin'])} ({requirement['margin_of']})"


def signed(value: float) -> str:
    """A margin with its sign."""
    return f"{value:+.3g}" if abs(value) < 1000 else f"{value:+.0f}"


def in_words(value: Any) -> str:
    """Words for an expected or actual value."""
    if isinstance(value, dict):
        return ", ".join(f"{key.replace('_', ' ')} {in_words(entry)}" for key, entry in value.items())
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, list):
        return ", ".join(map(in_words, value)) or "none"
    return value if isinstance(value, str) else number(value, none="none")


def _requirement(requirement: Document) -> Iterator[Part]:
    """The table of a requirement."""
    worst = requirement["worst"]
    rows = [
        ("verdict", requirement["verdict"]),
        ("clause", requirement["clause"]),
        ("asked", _condition_in_words(requirement["asked"])),
        ("over", f"{', '.join(requirement['over'])} ({requirement['flights']} flights)"),
        ("flights", ", ".join(f"{n} {verdict}" for verdict, n in requirement["counts"].items() if n)),
        ("worst flight", worst["flight"]),
        ("there", _result_in_words(worst)),
        ("margin", "" if requirement["margin"] is None else signed(requirement["margin"])),
        ("flies it again", worst["command"] or ""),
    ]
    failing = [flight["flight"] for flight in requirement["failing"]]
    if len(failing) > 1:
        more = f" and {len(failing) - MOST_SHOWN} more" if len(failing) > MOST_SHOWN else ""
        rows.append(("do not meet it", ", ".join(failing[:MOST_SHOWN]) + more))
    yield Table((requirement["id"], requirement["text"]), [row for row in rows if row[1]], VERDICTS)


def _condition_in_words(condition: Document) -> str:
    """Words for the condition of a requirement: its formula, bar or expectations. condition: the field
    `asked`."""
    if "formula" in condition:
        return str(condition["formula"])
    if "bar" in condition:
        kind = condition["bar"]["type"].replace("_", " ")
        return f"{kind}: {in_words({key: value for key, value in condition['bar'].items() if key != 'type'})}"
    return in_words(condition["expect"])


def _result_in_words(worst: Document) -> str:
    """Words for the result of a part, with the limit. worst: a part of a requirement on its worst flight."""
    if worst["name"] == "robustness":
        return " ".join(filter(None, (f"robustness {in_words(worst['actual'])}", worst["says"])))
    allowed = "" if worst["expected"] is None else f", asked {in_words(worst['expected'])}"
    remark = f" ({worst['says']})" if worst["says"] else ""
    return f"{worst['name'].replace('_', ' ')}: {in_words(worst['actual'])}{allowed}{remark}"


def _coverage(coverage: Document) -> Iterator[Part]:
    """The number of flights with each fault type on each surface by cell of the envelope, and the types never
    flown."""
    yield (
        f"{coverage['aircraft']}: {coverage['combinations']} of {coverage['of']} combinations of surface, "
        "fault type and cell of the envelope flown. Numbers are flights that were in the cell after the "
        "fault had struck."
    )
    head = ["surface", "fault", *(_cell(cell) for cell in coverage["cells"])]
    rows = [
        [row["surface"], row["type"].replace("_", " "), *(str(n) if n else "·" for n in row["flights"])]
        for row in coverage["flown"]
    ]
    yield Table(head, rows)
    never = {surface: [kind.replace("_", " ") for s, kind in coverage["never"] if s == surface]
             for surface, _ in coverage["never"]}  # fmt: skip
    if never:
        lacking = (f"{surface}: {', '.join(kinds)}" for surface, kinds in never.items())
        yield f"Never flown: {'; '.join(lacking)}."


def _cell(cell: Document) -> str:
    """Words for the airspeeds and altitudes of a cell of the envelope."""
    slow, fast = cell["airspeed_mps"]
    low, high = cell["altitude_m"]
    if low is None:
        where = f"below {high / 1000:g} km"
    else:
        where = f"above {low / 1000:g} km" if high is None else f"{low / 1000:g} to {high / 1000:g} km"
    return f"{slow:.0f} to {fast:.0f} m/s, {where}"


def as_text(document: Document, folder: str) -> str:
    """The text for a terminal: the table of requirements, and the commands that repeat the worst flight of
    each requirement that is not met.
    """
    table = _summary(document["requirements"])
    lines = aligned([[row[0], *row[2:]] for row in (table.head, *table.rows)])
    again = [
        f"{requirement['id']} {requirement['verdict']}: {requirement['worst']['command']}"
        for requirement in document["requirements"]
        if requirement["verdict"] != MET and requirement["worst"]["command"]
    ]
    return "\n\n".join(filter(None, (lines, "\n".join(again), counted(document), f"results: {folder}")))


def as_expectations(document: Document) -> tuple[Expectation, ...]:
    """The requirements for JUnit XML, each with its worst flight."""
    return tuple(
        _expectation(row["id"], _condition_in_words(row["asked"]), row["worst"])
        for row in document["requirements"]
    )


def _expectation(name: str, expected: str, worst: Document) -> Expectation:
    """The result of a part as an expectation for JUnit XML, with the command that repeats the flight if it is
    known. name: of the requirement; expected: words for its condition.
    """
    again = f"; again: {worst['command']}" if worst.get("command") else ""
    return Expectation(
        name, worst["verdict"] == MET, expected, f"{worst['verdict']}: {_result_in_words(worst)}{again}"
    )


def of_flight(plan: EvidencePlan, name: str) -> tuple[Any, tuple[Expectation, ...]]:
    """The scenario of a flight, by the name of the flight, and the results of all parts of its requirements.
    The flight is flown again. Raises BadInput for a name that the plan does not have.

    named: name of each flight -> its source and its number there.
    """
    from beaver_ftc.documents import suggestion

    named = {plan.sources[source].flight(run): (source, run) for source, run in plan.cases}
    if name not in named:
        raise BadInput(
            f"--replay: {plan.given} has no flight {name[:100]!r}{suggestion(name, list(named)[:50])}"
        )
    source, run = named[name]
    results = fly_flight(plan, (source, run))["found"]
    judged = tuple(
        _expectation(id, in_words(part["expected"]), part)
        for id, parts in results.items() for part in parts
    )  # fmt: skip
    return plan.sources[source].scenario(run), judged
