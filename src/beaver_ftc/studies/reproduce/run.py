"""Fly the published study and keep what came out, in a result folder."""

from pathlib import Path

from beaver_ftc.results.metrics import Document, as_json
from beaver_ftc.results.writer import result_folder
from beaver_ftc.studies.engine.study import Progress, flown
from beaver_ftc.studies.reproduce.document import document_of, fly_published
from beaver_ftc.studies.reproduce.figures import write_figures
from beaver_ftc.studies.reproduce.margins import write_margins
from beaver_ftc.studies.reproduce.page import as_markdown, write_page
from beaver_ftc.studies.reproduce.sensitivity import VARIANTS, numbers_of

NAME = "reproduction"


def reproduce(out: Path, workers: int = 2, progress: Progress | None = None) -> Document:
    """Write `out/reproduction/` (table as JSON, Markdown and HTML, and the figures); return the document."""
    study = flown(out / NAME, VARIANTS, numbers_of, list[float], workers=workers, progress=progress)
    with study as numbers, result_folder(out, NAME) as folder:
        flights = fly_published()
        document = document_of(flights, numbers)
        drawn = [*write_figures(flights, folder / "figures"), write_margins(document, folder / "figures")]
        figures = {path.stem: path for path in drawn}
        (folder / f"{NAME}.json").write_text(as_json(document), encoding="utf-8")
        (folder / f"{NAME}.md").write_text(as_markdown(document, "figures"), encoding="utf-8")
        write_page(document, figures, folder / f"{NAME}.html")
    return document
