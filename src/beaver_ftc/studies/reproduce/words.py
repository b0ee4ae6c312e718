"""The document of the reproduction in words: a text for the terminal, a page as Markdown and as HTML."""

from collections import Counter
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from beaver_ftc.results.model import Document
from beaver_ftc.results.terminal import printed
from beaver_ftc.studies.present import page, tables
from beaver_ftc.studies.present.tables import tabulated
from beaver_ftc.studies.reproduce import beside, truth_and_design
from beaver_ftc.studies.reproduce.choices import data_of
from beaver_ftc.studies.reproduce.claims import BORNE_OUT, CANNOT_BE_JUDGED, NOT_BORNE_OUT, STRONGER
from beaver_ftc.studies.reproduce.published_figures import FIGURES, SENSITIVITY

if TYPE_CHECKING:
    from rich.table import Table

NAME = "reproduction"
WIDTH = 132
VERDICT_HEAD = ("Published", "Statement", "Our number", "Limit", "Without", "Verdict", "Remark")
_SAYS = data_of("page.yaml")
ELSEWHERE_TOO = "borne out, elsewhere too"
DEVIATIONS: list[str] = _SAYS["deviations from the paper"]
_STYLE = {STRONGER: "green", BORNE_OUT: "green", NOT_BORNE_OUT: "bold red"}
_GOOD = {ELSEWHERE_TOO: True, BORNE_OUT: True, NOT_BORNE_OUT: False}


def number(value: float | None, unit: str = "", none: str = "never") -> str:
    """A number with its unit. One whose unit begins with `of ` is a share: in per cent with one decimal, all
    others with three digits. None is `none`."""
    if value is not None and unit.startswith("of "):
        return f"{100 * value:.1f} % {unit}"
    return tables.number(value, unit, none=none)


def _number_text(claim: Document, key: str = "number") -> str:
    """A number of a claim as text. key: of the number in the row of the claim."""
    return number(claim[key], claim["unit"], claim["none"])


def quantity_text(claim: Document) -> str:
    """Quantity and number of a claim."""
    return f"{claim['quantity']} {_number_text(claim)}"


def limit(claim: Document) -> str:
    """The limit that the number must keep; that of a share in per cent, without its unit."""
    share = claim["unit"].startswith("of ")
    text = tables.number(100 * claim["limit"], "%") if share else tables.number(claim["limit"], claim["unit"])
    return f"{'at least' if claim['at_least'] else 'at most'} {text}"


def ablation_text(claim: Document) -> str:
    """The mechanism that is removed, and the number without it."""
    return f"{claim['without']}: {_number_text(claim, 'number_without')}"


def verdict_rows(document: Document) -> list[tuple[str, ...]]:
    """A row for each statement, below VERDICT_HEAD."""
    return [
        (claim["where"], claim["statement"], "-", "-", "-", verdict_words(claim), claim["reason"])
        if claim["reason"]
        else (
            claim["where"], claim["statement"], f"{', '.join(claim['flights'])}: {quantity_text(claim)}",
            f"{limit(claim)}: {claim['limit_from']}",
            ablation_text(claim), verdict_words(claim), remark(claim),
        )
        for claim in document["claims"]
    ]  # fmt: skip


def verdict_words(claim: Document) -> str:
    """The verdict on a claim in words; STRONGER, whose name in the document says too much, has its own."""
    return ELSEWHERE_TOO if claim["verdict"] == STRONGER else claim["verdict"]


def remark(claim: Document) -> str:
    """Whether a statement is true by construction, and what `_remark` says."""
    construction = "true by the construction of the code" if claim["construction"] else ""
    return "; ".join(filter(None, (construction, _remark(claim))))


def _remark(claim: Document) -> str:
    """In how many other settings a statement is borne out, or the reason of another verdict; may be empty."""
    if claim["verdict"] == BORNE_OUT and not claim["construction"]:
        return "in {borne_out_in} of {elsewhere} settings that the paper did not fly".format(**claim)
    return "holds without it as well" if claim["verdict"] == CANNOT_BE_JUDGED else claim["because"]


def measured(document: Document) -> list[Document]:
    """The claims that have a measure."""
    return [claim for claim in document["claims"] if not claim["reason"]]


def exceptions(document: Document) -> list[str]:
    """A sentence for each statement and setting in which, unlike in the published one, it does not hold, or
    also holds without its mechanism."""
    return [
        f"{row['variant']}: {sentence}"
        for row in document["sensitivity"]
        for sentence in (
            *map(_sentence, row["missed"]),
            *(f"{_sentence(claim)}, without {claim['without']}" for claim in row["also_without"]),
        )
    ]


def _sentence(missed: Document) -> str:
    """A statement with its number, without its full stop and with a small first letter."""
    statement = missed["statement"]
    return f"{missed['where']}, {statement[:1].lower()}{statement[1:-1]}: {_number_text(missed)}"


def _sentences(missed: list[Document]) -> str:
    """Statements with their numbers, in a cell."""
    return "; ".join(map(_sentence, missed)) or "none"


def _value(value: Any) -> str:
    """A value of a scenario as text."""
    if isinstance(value, dict):
        return ", ".join(f"{key} {_value(part)}" for key, part in value.items())
    if isinstance(value, list):
        return "; ".join(_value(part) for part in value) or "none"
    return f"{value:g}" if isinstance(value, float) else str(value)


def _changes(changes: Document) -> str:
    """Changes of a scenario as text."""
    return "; ".join(f"{key}: {_value(value)}" for key, value in changes.items())


ABLATION_COLUMNS = (
    ("Taken out", "takes"), ("By", "changes", _changes), ("Statements that speak of it", "statements"),
    ("Fail without it", "fail"),
)  # fmt: skip
RANGE_COLUMNS = (  # columns of a measured statement: `lowest` and `highest` of its row
    ("Published", "where"), ("Statement", "statement"), ("From", partial(_number_text, key="lowest")),
    ("To", partial(_number_text, key="highest")), ("Held", "{held_in} of {elsewhere}".format_map),
)  # fmt: skip
CHOICE_COLUMNS = (("Key", "key"), ("Value", "value", _value), ("Reason", "reason"))
GAIN_COLUMNS = (
    ("Option", "key"), ("Default", "default", _value), ("What it is", "says"), ("Chosen by", "origin"),
    ("Halved: no longer hold", "halved", _sentences), ("Doubled: no longer hold", "doubled", _sentences),
)  # fmt: skip


def headline(document: Document) -> str:
    """The verdicts on the statements, in sentences."""
    n_tested, built = document["testable"]["statements"], document["construction"]
    all_hold = built["hold"] == built["statements"]
    holding = "All {statements} hold" if all_hold else "{hold} of these {statements} hold"
    return (
        "The paper has {total} statements. {testable[statements]} of them can be tested: {testable[hold]} "
        "hold, {testable[do_not]} do not hold, and {testable[unsettled]} hold even without the mechanism "
        "that the paper gives as the reason. {testable[elsewhere]} of the {testable[hold]} also hold in each "
        "of {settings} settings that the paper did not fly. {construction[statements]} other statements "
        "follow from the construction of the code. {holding} in our flights, but they show nothing about the "
        "scheme. The last {background} statements contain nothing that can be measured."
    ).format(
        total=n_tested + built["statements"] + document["background"],
        settings=len(document["sensitivity"]),
        holding=holding.format(**built),
        **document,
    )


def adaptation_sentence(document: Document) -> str:
    """A sentence about the effect of the adaptation of the isolation estimators."""
    return (
        "Each isolation estimator adapts its estimate of the fault in flight. Without this adaptation "
        "(gain 0), the alarm, the named surface and the times stay the same in {same} of {flights} flights "
        "with a fault."
    ).format(**document["adaptation"])


def summary(document: Document) -> str:
    """The results in a few sentences."""
    return (
        f"{headline(document)} A statement holds if its number keeps its limit. In the same setting without "
        f"their mechanism, the {document['testable']['hold']} do not hold. {adaptation_sentence(document)}"
    )


def as_text(document: Document, folder: str, colour: bool = False) -> str:
    """The results for a terminal: tables, sentences, exceptions, and the path of the page."""
    comparison = document["beside"]
    unjudged = Counter(c["reason"] for c in document["claims"] if c["reason"])
    side_by_side = tables.plain("Side by side", *tabulated(beside.COLUMNS, comparison["rows"]))
    flown = tabulated(truth_and_design.FLOWN, document["truth_and_design"]["designs"])
    designs = tables.plain("Truth and design", *flown)
    lines = [
        printed([_table(document)], WIDTH, colour), "", "Nothing to measure:",
        *(f"  {count:2} {reason}" for reason, count in unjudged.items()), "",
        summary(document), *(f"  except {sentence}" for sentence in exceptions(document)), "",
        printed([side_by_side], WIDTH, colour), "", beside.alarms_sentence(comparison), beside.BETTER,
        *(f"  {sentence}" for sentence in beside.sentences(comparison) or ["nowhere"]), "",
        printed([designs], WIDTH, colour), "", f"page: {folder}/{NAME}.html",
    ]  # fmt: skip
    return "\n".join(lines)


def _table(document: Document) -> "Table":
    """The measured statements as a table for a terminal."""
    from rich import box
    from rich.table import Table
    from rich.text import Text

    table = Table(title="[Zhang2005] flown again", title_justify="left", box=box.SIMPLE_HEAD)
    for head in ("Published", "Statement", "Our number", "Without", "Verdict"):
        table.add_column(head)
    for claim in measured(document):
        cell = f"{quantity_text(claim)} ({limit(claim)})"
        note = remark(claim)
        table.add_row(
            claim["where"], claim["statement"], f"{cell}; {note}" if note else cell,
            ablation_text(claim), Text(verdict_words(claim), _STYLE.get(claim["verdict"], "")),
        )  # fmt: skip
    return table


def as_markdown(document: Document, figures: str) -> str:
    """The page as Markdown. figures: path of the folder of the pictures, relative to the page."""
    return page.as_markdown([f"# {_SAYS['title']}", *_page(document)], figures)


def as_html(document: Document, folder: Path) -> str:
    """The HTML page, with the pictures that are in the folder's `figures`."""
    whole = [*_page(document), page.versions_line(document["versions"])]
    return page.as_html(_SAYS["title"], whole, {path.stem: path for path in (folder / "figures").iterdir()})


def _page(document: Document) -> list[page.Part]:
    """The parts of the page."""
    sentences = exceptions(document)
    comparison = document["beside"]
    designs = document["truth_and_design"]
    changes = "; ".join(row["variant"] for row in document["sensitivity"])
    return [
        _SAYS["introduction"], summary(document),
        page.Table(VERDICT_HEAD, verdict_rows(document), _GOOD),
        _SAYS["ablations"], page.table(ABLATION_COLUMNS, document["ablations"]),
        page.Heading("Beside ours"), _SAYS["beside"],
        page.table(beside.COLUMNS, comparison["rows"]), beside.alarms_sentence(comparison),
        page.Bullets(beside.BETTER, beside.sentences(comparison) or ["nowhere"]),
        page.Heading("Truth and design"), _SAYS["truth"],
        page.table(truth_and_design.TERMS, designs["terms"]), _SAYS["designs"],
        page.table(truth_and_design.FLOWN, designs["designs"]),
        page.Heading("Figures"), _SAYS["figures"],
        page.Pictures([(view.title, view.name) for view, _, _ in FIGURES]),
        page.Heading("What the conclusions hang on"), _SAYS["sensitivity"],
        page.Pictures([(_SAYS["margins"], SENSITIVITY)]),
        page.table(RANGE_COLUMNS, measured(document)),
        *([page.Bullets("Where one does not:", sentences)] if sentences else []),
        f"The settings: {changes}.",
        page.Heading("What the paper leaves open"), _SAYS["gains"],
        page.table(GAIN_COLUMNS, document["gains"]), _SAYS["choices"],
        page.table(CHOICE_COLUMNS, document["choices"]),
        page.Bullets(_SAYS["deviations"], DEVIATIONS),
    ]  # fmt: skip
