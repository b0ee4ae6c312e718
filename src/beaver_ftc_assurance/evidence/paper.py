"""The parts of a page as PDF, with the same text as the HTML page. The summary is on a page of its own."""

import io
from collections.abc import Iterator, Sequence
from functools import cache
from pathlib import Path
from typing import Any
from xml.sax.saxutils import escape

from beaver_ftc.studies.present import Heading, Part, Table

MARGIN_PT = 45  # margin of a page, points
FOOT_PT = 24  # distance from the edge of a page to its foot, points
MOST_OF_HEAD = 9  # number of letters of a column's header that its width allows for
MOST_TOGETHER = 20  # a table with fewer rows is kept on one page
MET_COLOUR = "#00614a"
MISSED_COLOUR = "#a33b00"
LINE_COLOUR = "#d8d8d8"
_FONTS = {"Body": "DejaVuSans.ttf", "Bold": "DejaVuSans-Bold.ttf"}  # they come with matplotlib


def as_pdf(title: str, parts: Sequence[Part], foot: str) -> bytes:
    """The page as PDF; the same parts give the same bytes. foot: text below every page, beside the number."""
    from reportlab.lib.pagesizes import A4
    from reportlab.platypus import SimpleDocTemplate

    _register()
    file = io.BytesIO()
    document = SimpleDocTemplate(
        file, pagesize=A4, invariant=1, title=title, author="beaver-ftc",
        leftMargin=MARGIN_PT, rightMargin=MARGIN_PT, topMargin=MARGIN_PT, bottomMargin=MARGIN_PT,
    )  # fmt: skip

    def below(canvas: Any, _: Any) -> None:
        """Draw the foot of a page."""
        canvas.setFont("Body", 7)
        canvas.drawString(MARGIN_PT, FOOT_PT, foot)
        canvas.drawRightString(A4[0] - MARGIN_PT, FOOT_PT, str(canvas.getPageNumber()))

    document.build(list(_flowables(title, parts, document.width)), onFirstPage=below, onLaterPages=below)
    return file.getvalue()


@cache
def _register() -> None:
    """Register the fonts, once."""
    import matplotlib
    from reportlab.pdfbase import pdfmetrics
    from reportlab.pdfbase.ttfonts import TTFont

    folder = Path(matplotlib.get_data_path()) / "fonts" / "ttf"
    for name, file in _FONTS.items():
        pdfmetrics.registerFont(TTFont(name, str(folder / file)))


def _flowables(title: str, parts: Sequence[Part], width: float) -> Iterator[Any]:
    """Title and parts of the page as reportlab's flowables; the first heading begins a new page."""
    from reportlab.platypus import KeepTogether, PageBreak

    yield _text(title, 15, bold=True, before=0)
    first = True
    for part in parts:
        if isinstance(part, Heading):
            if first:
                yield PageBreak()
            first = False
            yield _text(part.text, 12, bold=True, keep=True)
        elif isinstance(part, Table):
            table = _table(part, width)
            yield KeepTogether([table]) if len(part.rows) < MOST_TOGETHER else table
        elif isinstance(part, str):
            yield _text(part, 8.5)
        else:
            raise TypeError(f"no PDF of {type(part).__name__}")


def _text(
    text: str, size: float, bold: bool = False, colour: str = "#111111", keep: bool = False, before: float = 7
) -> Any:
    """A paragraph, `before` points below the previous one. size: of the letters, points. Text of a plan is
    escaped, so that it is never markup.
    """
    from reportlab.lib.styles import ParagraphStyle
    from reportlab.platypus import Paragraph

    style = ParagraphStyle(
        "text", fontName="Bold" if bold else "Body", fontSize=size, leading=1.3 * size, textColor=colour,
        splitLongWords=True, keepWithNext=keep, spaceBefore=before,
    )  # fmt: skip
    return Paragraph(escape(text), style)


def _table(table: Table, width: float) -> Any:
    """A table that repeats its header on each page. A table with many columns has smaller letters."""
    from reportlab.platypus import LongTable

    wide = len(table.head) > 6
    size = 5.8 if wide else 7.5
    cells = [[_text(cell, size, bold=True, before=0) for cell in table.head]]
    cells += [[_cell(cell, size, table) for cell in row] for row in table.rows]
    flowable = LongTable(cells, colWidths=_widths(table, width), repeatRows=1)
    flowable.setStyle([
        ("VALIGN", (0, 0), (-1, -1), "TOP"), ("LINEBELOW", (0, 0), (-1, -1), 0.4, LINE_COLOUR),
        ("LEFTPADDING", (0, 0), (-1, -1), 0), ("RIGHTPADDING", (0, 0), (-1, -1), 6),
        ("TOPPADDING", (0, 0), (-1, -1), 1.5), ("BOTTOMPADDING", (0, 0), (-1, -1), 2.5),
    ])  # fmt: skip
    flowable.hAlign = "LEFT"
    flowable.spaceBefore = 7
    return flowable


def _cell(cell: str, size: float, table: Table) -> Any:
    """A cell of a table; a verdict with its colour and a mark."""
    if cell not in table.verdicts:
        return _text(cell, size, before=0)
    good = table.verdicts[cell]
    colour = MET_COLOUR if good else MISSED_COLOUR
    return _text(f"{'✓' if good else '✗'} {cell}", size, bold=not good, colour=colour, before=0)


def _widths(table: Table, width: float) -> list[float]:
    """Widths of the columns, points, in proportion to 4 letters more than the longest of its cells, at most
    40 letters, and of the first MOST_OF_HEAD letters of its header. Of two columns, the first has 17 % of the
    width.
    """
    columns = list(zip(table.head, *table.rows, strict=True))
    if len(columns) == 2:
        return [0.17 * width, 0.83 * width]
    longest = [min(max(map(len, (head[:MOST_OF_HEAD], *cells))), 40) + 4 for head, *cells in columns]
    return [width * n / sum(longest) for n in longest]
