"""The reproduction for the terminal."""

from typing import TYPE_CHECKING

from beaver_ftc.results.metrics import Document
from beaver_ftc.studies.present.tables import printed
from beaver_ftc.studies.reproduce import words

if TYPE_CHECKING:
    from rich.table import Table

WIDTH = 118


def as_text(document: Document, folder: str, colour: bool = False) -> str:
    """The table of statements, what the sensitivity study says, and where the rest lies."""
    exceptions = [f"  except {sentence}" for sentence in words.exceptions(document)]
    table = printed([_table(document)], WIDTH, colour)
    return "\n".join(
        [table, "", words.summary(document), *exceptions, "", f"page: {folder}/reproduction.html"]
    )


def _table(document: Document) -> "Table":
    from rich import box
    from rich.table import Table
    from rich.text import Text

    table = Table(title="[Zhang2005] flown again", title_justify="left", box=box.SIMPLE_HEAD)
    for head in words.VERDICT_HEAD[:4]:
        table.add_column(head, no_wrap=head in ("Published", "Verdict"))
    for claim, row in zip(document["claims"], words.verdict_rows(document), strict=True):
        where, statement, ours, verdict, remark = row
        style = "green" if claim["passed"] else "bold red"
        table.add_row(where, statement, f"{ours}\n{remark}" if remark else ours, Text(verdict, style))
    return table
