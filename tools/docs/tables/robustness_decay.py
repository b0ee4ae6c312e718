"""Tables of docs/results/robustness.md: verdicts beyond what is declared."""

from typing import Any

from beaver_ftc.scenario.schema import load_scenario
from beaver_ftc.studies.present.page import Table
from beaver_ftc.studies.present.tables import markdown_table, tabulated
from beaver_ftc.studies.sensitivity.beyond import TOGETHER
from beaver_ftc.studies.sensitivity.command import errors_study
from beaver_ftc.studies.sensitivity.errors_shown import COLUMNS
from beaver_ftc.studies.sensitivity.errors_shown import error_sentences as sentences
from tools.docs.tables import aside, picture, studied, table_of

Document = dict[str, Any]

DECAYS = ("elevator-loss-in-turbulence", "elevator-partial-loss")  # all of it declared; next to nothing
DECAY_HEAD = (
    "error", "declared", "times", "false alarms, %", "detected, %", "named rightly, %", "named wrongly, %",
    "tracking RMS, deg/s",
)  # fmt: skip
DECAY_WORDS = ("error", "declared")
DECAY_CAPTION = (
    "*Table 1. Verdicts beyond the declaration. Shares in % of the flights; tracking: median of the flights, "
    "deg/s. Columns as explained above.*"
)
DECAY_TITLE = "Verdicts beyond the declaration: shares in % of the flights, and median tracking error"
DECAY_FIGURE = (
    "*Figure 2. False alarms, right names (both in % of the flights) and tracking RMS (deg/s) for "
    "`elevator-loss-in-turbulence`. Horizontal: size of the error divided by its declared size, or by its "
    "unit. Columns: error, with its declared size or unit. Bars: 95 % intervals.*"
)
_PICTURED = "False alarms, right names and tracking over the size of each error, with 95 % intervals"
PUBLISHED = "The published case has no margin"
PUBLISHED_COLUMNS = {
    "error": "error", "declared": "declared", "times": "factor g", "false alarms": "false_alarm.count",
    "named wrongly": "misnamed.count",
}  # fmt: skip


def robustness_decay() -> str:
    """How verdicts decay beyond what is declared, of two scenarios; and a picture of the first."""
    (whole, drawn), (published, _) = (studied(errors_study(load_scenario(one)), 2) for one in DECAYS)
    shown = picture("decay.png", _PICTURED, drawn["sensitivity.png"])
    table = aside("robustness-decay", DECAY_TITLE, _decay_table(whole))
    return "\n\n".join([table, shown, DECAY_FIGURE, f"### {PUBLISHED}", _published(published)])


def robustness_decay_probe() -> str:
    """Two flights of each row of the first."""
    document, _ = studied(errors_study(load_scenario(DECAYS[0]), 2))
    says = "\n".join(f"- {sentence}" for sentence in sentences(document))
    flown = f"`{document['scenario']}`, {document['flights']} flights a row"
    table = _decay_table(document)
    return f"{flown}:\n\n{says}\n\n{DECAY_CAPTION}\n\n{markdown_table(table.head, table.rows)}"


def _decay_table(document: Document) -> Table:
    """A table without intervals, which the figure has."""
    shown = [
        row
        for row in document["rows"]
        if row["factor"] > 1.0 or row["error"] == TOGETHER or _is_undeclared(document, row)
    ]
    heads, lines = tabulated(COLUMNS, shown)
    rows = [
        tuple(
            cell if head in DECAY_WORDS else cell.partition(" (")[0]
            for head, cell in zip(heads, line, strict=True)
            if head in DECAY_HEAD
        )
        for line in lines
    ]
    return Table(DECAY_HEAD, rows)


def _published(document: Document) -> str:
    """All together as declared; then of each error the least size with a wrong verdict, or the largest."""
    rows = document["rows"]
    together = [row for row in rows if row["error"] == TOGETHER]
    each = [
        next((row for row in of if row["false_alarm"]["count"] or row["misnamed"]["count"]), of[-1])
        for name in dict.fromkeys(row["error"] for row in rows)
        for of in [[row for row in rows if row["error"] == name]]
    ]
    caption = (
        f"*Table 6. Verdicts of `{document['scenario']}`. First row: all errors as declared. Other "
        'rows: the smallest size with a wrong verdict. "times": this size, divided by the declared size or '
        f"by the unit. Last columns: numbers of flights, of {document['flights']} a row.*"
    )
    return f"{caption}\n\n{table_of((together[0], *each), PUBLISHED_COLUMNS)}"


def _is_undeclared(document: Document, row: Document) -> bool:
    """Whether no bound covers the error of a row."""
    return any(e["error"] == row["error"] and not e["is_declared"] for e in document["errors"])
