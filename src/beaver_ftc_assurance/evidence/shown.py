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

ON_THE_SUMMARY = 24  # requirements: what one page holds
MOST_LETTERS = 90  # of a requirement's text there
MOST_SHOWN = 10  # flights of a requirement that fail
VERDICTS = {MET: True, NOT_MET: False, NOT_SHOWN: False}
NO_APPROVAL = (
    "Clauses are quoted by number, with our reading of them. This document records flights of a simulation; "
    "it claims no approval by any authority."
)


def run_plan(
    plan: EvidencePlan, folder: Path, workers: int = 1, progress: Progress | None = None
) -> Document:
    """Fly a plan, write evidence.json, .html and .pdf into a folder, and return the document.

    Raises BadInput where what writes PDF is not installed: before anything flies.
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
        lost=lambda case, why: failed(plan, case, why),
    )
    document: Document = run_study(study, folder.parent, workers, progress)
    return document


def _html(document: Document) -> str:
    """The document as a page."""
    return as_html(_title(document), list(page(document)), {})


def _pdf(document: Document) -> bytes:
    """The same as PDF."""
    from beaver_ftc_assurance.evidence.paper import as_pdf

    return as_pdf(_title(document), list(page(document)), f"{document['plan']} · {document['date']}")


def _title(document: Document) -> str:
    """The title of both."""
    return f"Evidence: {document['plan']}"


FILES: Makers = {"evidence.json": as_json, "evidence.html": _html, "evidence.pdf": _pdf}


def page(document: Document) -> Iterator[Part]:
    """The parts of the page: the summary, which fills a page of the PDF, then all under headings."""
    if document["description"]:
        yield document["description"].strip()
    flights = len(document["flights"])
    yield f"{counted(document)}, by {flights} flights. {document['date']}."
    yield _summary(document["requirements"])
    yield NO_APPROVAL
    yield f"Plan {document['hashes']['plan'][:16]}, flight code {document['hashes']['flight code']}."
    yield Heading("Requirements")
    for each in document["requirements"]:
        yield from _requirement(each)
    yield Heading("Coverage")
    for each in document["coverage"]:
        yield from _coverage(each)
    yield Heading("What it follows from")
    yield f"Plan {document['hashes']['plan']}; flight code {document['hashes']['flight code']}."
    yield versions_line(document["versions"])
    yield Table(
        ("flown", "as the plan names it", "flights", "SHA-256"),
        [
            (each["name"], each["given"], str(each["flights"]), each["sha256"][:32])
            for each in document["sources"]
        ],
    )
    yield "Of each flight evidence.json has the SHA-256 of its scenario and of its log."


def counted(document: Document) -> str:
    """The number of requirements, in all and by verdict."""
    counts = document["counts"]
    return f"{sum(counts.values())} requirements: " + ", ".join(
        f"{n} {verdict}" for verdict, n in counts.items()
    )


def _summary(requirements: list[Document]) -> Table:
    """The table of requirements. If there are more than a page holds, those not met come first, and the last
    line counts the others."""
    shown = requirements
    if len(shown) > ON_THE_SUMMARY:
        shown = sorted(shown, key=lambda each: WORST_FIRST.index(each["verdict"]))[:ON_THE_SUMMARY]
    rows = [
        (each["id"], _short(each["text"]), each["verdict"], margin_of(each), each["worst"]["flight"])
        for each in shown
    ]
    left = len(requirements) - len(shown)
    rows += [("", f"{left} more", "", "", "")] if left else []
    return Table(("", "requirement", "verdict", "margin", "worst flight"), rows, VERDICTS)


def _short(text: str) -> str:
    """A text, cut to MOST_LETTERS."""
    return text if len(text) <= MOST_LETTERS else f"{text[: MOST_LETTERS - 3]}..."


def margin_of(requirement: Document) -> str:
    """A requirement's margin and what it is of, or what its worst flight says."""
    worst = requirement["worst"]
    if requirement["margin"] is None:
        return worst["says"] or f"{worst['name']}: {said(worst['actual'])}"
    return f"{signed(requirement['margin'])} ({requirement['margin_of']})"


def signed(value: float) -> str:
    """A margin with its sign."""
    return f"{value:+.3g}" if abs(value) < 1000 else f"{value:+.0f}"


def said(value: Any) -> str:
    """An expected or actual value in words."""
    if isinstance(value, dict):
        return ", ".join(f"{key.replace('_', ' ')} {said(each)}" for key, each in value.items())
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, list):
        return ", ".join(map(said, value)) or "none"
    return value if isinstance(value, str) else number(value, none="none")


def _requirement(each: Document) -> Iterator[Part]:
    """The table of a requirement."""
    worst = each["worst"]
    rows = [
        ("verdict", each["verdict"]),
        ("clause", each["clause"]),
        ("asked", _asked(each["asked"])),
        ("over", f"{', '.join(each['over'])} ({each['flights']} flights)"),
        ("flights", ", ".join(f"{n} {verdict}" for verdict, n in each["counts"].items() if n)),
        ("worst flight", worst["flight"]),
        ("there", _found(worst)),
        ("margin", "" if each["margin"] is None else signed(each["margin"])),
        ("flies it again", worst["command"] or ""),
    ]
    failing = [one["flight"] for one in each["failing"]]
    if len(failing) > 1:
        more = f" and {len(failing) - MOST_SHOWN} more" if len(failing) > MOST_SHOWN else ""
        rows.append(("do not meet it", ", ".join(failing[:MOST_SHOWN]) + more))
    yield Table((each["id"], each["text"]), [row for row in rows if row[1]], VERDICTS)


def _asked(asked: Document) -> str:
    """What a requirement asks for: a formula, a bar or expectations, in words."""
    if "formula" in asked:
        return str(asked["formula"])
    if "bar" in asked:
        kind = asked["bar"]["type"].replace("_", " ")
        return f"{kind}: {said({key: value for key, value in asked['bar'].items() if key != 'type'})}"
    return said(asked["expect"])


def _found(worst: Document) -> str:
    """What the worst flight shows, with what was asked."""
    if worst["name"] == "robustness":
        return " ".join(filter(None, (f"robustness {said(worst['actual'])}", worst["says"])))
    allowed = "" if worst["expected"] is None else f", asked {said(worst['expected'])}"
    says = f" ({worst['says']})" if worst["says"] else ""
    return f"{worst['name'].replace('_', ' ')}: {said(worst['actual'])}{allowed}{says}"


def _coverage(each: Document) -> Iterator[Part]:
    """The fault types of each surface by cell of the envelope, and those never flown."""
    yield (
        f"{each['aircraft']}: {each['combinations']} of {each['of']} combinations of surface, fault type and "
        "cell of the envelope flown. Numbers are flights that were in the cell after the fault had struck."
    )
    head = ["surface", "fault", *(_cell(cell) for cell in each["cells"])]
    rows = [
        [one["surface"], one["type"].replace("_", " "), *(str(n) if n else "·" for n in one["flights"])]
        for one in each["flown"]
    ]
    yield Table(head, rows)
    never = {surface: [kind.replace("_", " ") for s, kind in each["never"] if s == surface]
             for surface, _ in each["never"]}  # fmt: skip
    if never:
        lacking = (f"{surface}: {', '.join(kinds)}" for surface, kinds in never.items())
        yield f"Never flown: {'; '.join(lacking)}."


def _cell(cell: Document) -> str:
    """The airspeeds and altitudes of a cell of the envelope."""
    slow, fast = cell["airspeed_mps"]
    low, high = cell["altitude_m"]
    if low is None:
        where = f"below {high / 1000:g} km"
    else:
        where = f"above {low / 1000:g} km" if high is None else f"{low / 1000:g} to {high / 1000:g} km"
    return f"{slow:.0f} to {fast:.0f} m/s, {where}"


def as_text(document: Document, folder: str) -> str:
    """The text for a terminal."""
    table = _summary(document["requirements"])
    lines = aligned([[row[0], *row[2:]] for row in (table.head, *table.rows)])
    again = [
        f"{each['id']} {each['verdict']}: {each['worst']['command']}"
        for each in document["requirements"]
        if each["verdict"] != MET and each["worst"]["command"]
    ]
    return "\n\n".join(filter(None, (lines, "\n".join(again), counted(document), f"results: {folder}")))


def as_expectations(document: Document) -> tuple[Expectation, ...]:
    """The requirements for JUnit XML, each by its worst flight."""
    asked = ((each["id"], _asked(each["asked"]), each["worst"]) for each in document["requirements"])
    return tuple(_expectation(*each) for each in asked)


def _expectation(name: str, expected: str, found: Document) -> Expectation:
    """What a flight shows of a requirement, with the command that repeats the flight if one is known."""
    again = f"; again: {found['command']}" if found.get("command") else ""
    return Expectation(name, found["verdict"] == MET, expected, f"{found['verdict']}: {_found(found)}{again}")


def of_flight(plan: EvidencePlan, name: str) -> tuple[Any, tuple[Expectation, ...]]:
    """The scenario of a flight, by the name of the flight, and all parts of its requirements.

    Raises BadInput for a name that the plan does not have.
    """
    from beaver_ftc.documents import suggestion

    named = {plan.sources[source].flight(run): (source, run) for source, run in plan.cases}
    if name not in named:
        raise BadInput(
            f"--replay: {plan.given} has no flight {name[:100]!r}{suggestion(name, list(named)[:50])}"
        )
    found = fly_flight(plan, named[name])["found"]
    (source, run) = named[name]
    judged = tuple(
        _expectation(id, said(one["expected"]), one)
        for id, parts in found.items() for one in parts
    )  # fmt: skip
    return plan.sources[source].scenario(run), judged
