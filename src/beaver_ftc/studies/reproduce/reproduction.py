"""Fly the published study and say what became of its statements: a document, a text, a page."""

from collections.abc import Sequence
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from beaver_ftc.documents.document import parse
from beaver_ftc.results.metrics import Document, as_json, versions
from beaver_ftc.studies.engine.study import Progress, Study, run_study
from beaver_ftc.studies.present import page, tables
from beaver_ftc.studies.present.page import Files
from beaver_ftc.studies.present.tables import finite, printed
from beaver_ftc.studies.reproduce.cases import BESIDE, PUBLISHED, VARIANTS, Changed, Flown, fly_case
from beaver_ftc.studies.reproduce.choices import CHOICES
from beaver_ftc.studies.reproduce.claims import CLAIMS, Claim
from beaver_ftc.studies.reproduce.published_figures import FIGURES, SENSITIVITY, figures_of

if TYPE_CHECKING:
    from rich.table import Table

NAME, WIDTH = "reproduction", 118
VERDICT_HEAD = ("Published", "Statement", "Our number", "Verdict", "Remark")
SENSITIVITY_HEAD = ("Published", "Statement", "From", "To", "Held")
CHOICES_HEAD = ("Key", "Value", "Reason")
_SAYS = parse(Path(__file__).with_name("page.yaml").read_text(encoding="utf-8")).data
_VERDICT = {True: "borne out", False: "NOT BORNE OUT"}


def numbers_of(variant: Changed) -> list[float]:
    """The number of every claim, in the claims' order, with the variant's changes."""
    flights = {case.name: fly_case(case, variant.changes) for case in PUBLISHED}
    return [claim.measure(flights) for claim in CLAIMS]


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
    number, reading = claim.measure(flights), claim.reading
    return {
        "where": claim.where,
        "statement": claim.statement,
        "quantity": reading.quantity,
        "unit": reading.unit,
        "number": finite(number),
        "limit": reading.limit,
        "at_least": reading.at_least,
        "passed": reading.holds(number),
        "remark": claim.remark(flights),
        "lowest": finite(min(varied)),
        "highest": finite(max(varied)),
        "held_in": sum(reading.holds(other) for other in varied),
    }


def _missed(numbers: list[float]) -> list[Document]:
    """The claims that a variant does not bear out, with its number."""
    return [
        {"where": where, "statement": statement, "number": finite(number), "unit": reading.unit}
        for (where, statement, reading, *_), number in zip(CLAIMS, numbers, strict=True)
        if not reading.holds(number)
    ]


def number(value: float | None, unit: str = "") -> str:
    """A number in three digits with its unit; shares of something in percent."""
    if value is not None and unit.startswith("of "):
        return f"{100 * value:.1f} % {unit}"
    return tables.number(value, unit, none="never")


def ours(claim: Document) -> str:
    """Quantity, number, and the limit that the number must keep."""
    share = claim["unit"].startswith("of ")
    limit = f"{100 * claim['limit']:.0f} %" if share else number(claim["limit"])
    way = "at least" if claim["at_least"] else "at most"
    return f"{claim['quantity']} {number(claim['number'], claim['unit'])} ({way} {limit})"


def verdict_rows(document: Document) -> list[tuple[str, ...]]:
    """One row a statement, for VERDICT_HEAD."""
    return [
        (claim["where"], claim["statement"], ours(claim), _VERDICT[claim["passed"]], claim["remark"])
        for claim in document["claims"]
    ]


def sensitivity_rows(document: Document) -> list[tuple[str, ...]]:
    """One row a statement: its number's range over the variants, for SENSITIVITY_HEAD."""
    count = len(document["sensitivity"])
    return [
        (
            claim["where"],
            claim["statement"],
            number(claim["lowest"], claim["unit"]),
            number(claim["highest"], claim["unit"]),
            f"{claim['held_in']} of {count}",
        )
        for claim in document["claims"]
    ]


def exceptions(document: Document) -> list[str]:
    """One sentence for each statement that a variant does not bear out."""
    return [
        f"{row['variant']}: {missed['where']}, {missed['statement'][:1].lower()}{missed['statement'][1:-1]}: "
        f"{number(missed['number'], missed['unit'])}"
        for row in document["sensitivity"]
        for missed in row["missed"]
    ]


def choice_rows(document: Document) -> list[tuple[str, ...]]:
    """One row a choice, for CHOICES_HEAD."""
    return [(choice["key"], _value(choice["value"]), choice["reason"]) for choice in document["choices"]]


def _value(value: Any) -> str:
    if isinstance(value, dict):
        return ", ".join(f"{key} {_value(part)}" for key, part in value.items())
    if isinstance(value, list):
        return "; ".join(_value(part) for part in value)
    return f"{value:g}" if isinstance(value, float) else str(value)


def summary(document: Document) -> str:
    """The outcome in a sentence."""
    claims, variants = document["claims"], document["sensitivity"]
    held = sum(claim["passed"] for claim in claims)
    always = sum(claim["held_in"] == len(variants) for claim in claims)
    return (
        f"{held} of {len(claims)} published statements are borne out; {always} of them under every one of "
        f"{len(variants)} changes to what the paper leaves open."
    )


def as_text(document: Document, folder: str, colour: bool = False) -> str:
    """The table of statements, what the sensitivity study says, and where the rest lies."""
    except_for = [f"  except {sentence}" for sentence in exceptions(document)]
    table = printed([_table(document)], WIDTH, colour)
    page_line = f"page: {folder}/reproduction.html"
    return "\n".join([table, "", summary(document), *except_for, "", page_line])


def _table(document: Document) -> "Table":
    from rich import box
    from rich.table import Table
    from rich.text import Text

    table = Table(title="[Zhang2005] flown again", title_justify="left", box=box.SIMPLE_HEAD)
    for head in VERDICT_HEAD[:4]:
        table.add_column(head, no_wrap=head in ("Published", "Verdict"))
    for claim, row in zip(document["claims"], verdict_rows(document), strict=True):
        where, statement, said, verdict, remark = row
        style = "green" if claim["passed"] else "bold red"
        table.add_row(where, statement, f"{said}\n{remark}" if remark else said, Text(verdict, style))
    return table


def as_markdown(document: Document, figures: str) -> str:
    """The page as Markdown; `figures` is the folder of the pictures, as the page sees it."""
    return page.as_markdown([f"# {_SAYS['title']}", *_page(document)], figures)


def as_html(document: Document, folder: Path) -> str:
    """The HTML page, with the pictures that are in the folder's `figures`."""
    whole = [*_page(document), page.versions_line(document["versions"])]
    return page.as_html(_SAYS["title"], whole, {path.stem: path for path in (folder / "figures").iterdir()})


def _page(document: Document) -> list[page.Part]:
    missed = exceptions(document)
    changes = "; ".join(row["variant"] for row in document["sensitivity"])
    return [
        _SAYS["introduction"], summary(document),
        page.Table(VERDICT_HEAD, verdict_rows(document), {said: good for good, said in _VERDICT.items()}),
        page.Heading("Figures"), _SAYS["figures"],
        page.Pictures([(view.title, view.name) for view, _, _ in FIGURES]),
        page.Heading("What the conclusions hang on"), _SAYS["sensitivity"],
        page.Pictures([(_SAYS["margins"], SENSITIVITY)]),
        page.Table(SENSITIVITY_HEAD, sensitivity_rows(document)),
        *([page.Bullets("Where one does not:", missed)] if missed else []),
        f"The changes: {changes}.",
        page.Heading("What the paper leaves open"), _SAYS["choices"],
        page.Table(CHOICES_HEAD, choice_rows(document)),
    ]  # fmt: skip


def files_of(found: tuple[Document, dict[str, Flown]]) -> Files:
    """The figures, the document, and its page as Markdown and as HTML."""
    document, flights = found
    return {
        "figures": figures_of(document, flights),
        f"{NAME}.json": as_json(document),
        f"{NAME}.md": as_markdown(document, "figures"),
        f"{NAME}.html": partial(as_html, document),
    }


def reproduce(out: Path, workers: int = 2, progress: Progress | None = None) -> Document:
    """Write `out/reproduction/` (table as JSON, Markdown and HTML, and the figures); return the document."""

    def judged(numbers: Sequence[list[float]]) -> tuple[Document, dict[str, Flown]]:
        flights = fly_published()
        return document_of(flights, numbers), flights

    study = Study(NAME, VARIANTS, numbers_of, judged, files_of, row=list[float])
    document: Document = run_study(study, out, workers, progress)[0]
    return document
