"""Tables for the terminal, as text."""

import io
from collections.abc import Iterable
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.table import Table

Lines = Iterable[tuple[str, str]]  # name and text


def verdict_table(
    headline: tuple[str, str], lines: Lines, expectations: Iterable[tuple[bool, str]], last: Lines
) -> "Table":
    """The table of a verdict: headline (text, style), lines, expectations (met, sentence), and the last
    lines."""
    from rich.table import Table
    from rich.text import Text

    table = Table(title=Text(*headline), title_justify="left", show_header=False, box=None)
    table.add_column(style="bold", no_wrap=True)
    table.add_column(overflow="fold")
    for line in lines:
        table.add_row(*line)
    for passed, sentence in expectations:
        mark = Text("met   " if passed else "MISSED", "green" if passed else "bold red")
        table.add_row("expected", Text.assemble(mark, f" {sentence}"))
    for line in last:
        table.add_row(*line)
    return table


def printed(tables: Iterable["Table"], width: int | None = None, colour: bool = False) -> str:
    """Tables of rich as text."""
    from rich.console import Console

    console = Console(
        file=io.StringIO(), force_terminal=colour, highlight=False, emoji=False, markup=False, width=width
    )
    with console.capture() as captured:
        for table in tables:
            console.print(table)
    return "\n".join(line.rstrip() for line in captured.get().splitlines())
