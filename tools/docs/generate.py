"""What is generated, and where it goes."""

from collections.abc import Iterator
from pathlib import Path

from beaver_ftc.documents.errors import BadInput
from beaver_ftc.documents.paths import data_root
from tools.docs.pictures import lighten


def write_docs(folder: Path | None = None) -> Iterator[Path]:
    """Write every generated page and picture into `folder` (the source tree's `docs/`); yield the files.

    Raises BadInput in an installed package, which has no such folder.
    """
    docs = folder or _docs_of_source_tree()
    (docs / "images").mkdir(exist_ok=True)
    yield _write_properties(docs)
    yield from _write_reproduction(docs)


def _docs_of_source_tree() -> Path:
    docs = data_root() / "docs"
    if not docs.is_dir():
        raise BadInput("the documentation is generated into a source tree, and this is none")
    return docs


def _write_properties(docs: Path) -> Path:
    from tools.docs.properties import as_markdown

    path = docs / "properties.md"
    path.write_text(as_markdown(), encoding="utf-8")
    return path


def _write_reproduction(docs: Path) -> Iterator[Path]:
    from beaver_ftc.studies.present.page import write_files
    from beaver_ftc.studies.reproduce.published_figures import figures_of
    from beaver_ftc.studies.reproduce.reproduction import reproduced
    from beaver_ftc.studies.reproduce.words import as_markdown

    document, flights = reproduced()
    path = docs / "reproduction.md"
    path.write_text(as_markdown(document, "images/reproduction"), encoding="utf-8")
    yield path
    folder = docs / "images" / "reproduction"
    figures = figures_of(document, flights.published)
    write_files(folder, figures)
    yield from (lighten(folder / name) for name in figures)
