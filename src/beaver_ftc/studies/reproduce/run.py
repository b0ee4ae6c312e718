"""Fly the published study and keep what came out, in a result folder."""

from collections.abc import Callable
from functools import partial
from pathlib import Path

from beaver_ftc.results.metrics import Document, as_json
from beaver_ftc.results.writer import result_folder
from beaver_ftc.studies.compare.crew import spread
from beaver_ftc.studies.reproduce.document import document_of, fly_published
from beaver_ftc.studies.reproduce.figures import write_figures
from beaver_ftc.studies.reproduce.margins import write_margins
from beaver_ftc.studies.reproduce.page import as_markdown, write_page

NAME = "reproduction"


def reproduce(out: Path, workers: int = 2, progress: Callable[[float], None] | None = None) -> Document:
    """Write `out/reproduction/` (table as JSON, Markdown and HTML, and the figures); return the document."""
    with result_folder(out, NAME) as folder:
        flights = fly_published()
        document = document_of(flights, partial(spread, workers=workers, progress=progress))
        drawn = [*write_figures(flights, folder / "figures"), write_margins(document, folder / "figures")]
        figures = {path.stem: path for path in drawn}
        (folder / f"{NAME}.json").write_text(as_json(document), encoding="utf-8")
        (folder / f"{NAME}.md").write_text(as_markdown(document, "figures"), encoding="utf-8")
        write_page(document, figures, folder / f"{NAME}.html")
    return document
