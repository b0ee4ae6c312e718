"""A page from its parts, as Markdown, text, or one HTML file without other files; and the files of a
study."""

from base64 import b64encode
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import partial
from html import escape
from pathlib import Path
from typing import Any, NamedTuple

from beaver_ftc.documents.errors import BadInput
from beaver_ftc.documents.files import Document
from beaver_ftc.results.metrics import as_json
from beaver_ftc.results.style import SOFTWARE_MARK
from beaver_ftc.studies.present.tables import (
    Columns,
    Rows,
    aligned,
    as_csv,
    html_table,
    markdown_table,
    tabulated,
)

Drawn = Mapping[str, Path]
"""Files of pictures, by the stems of their names."""


class Heading(NamedTuple):
    """A heading below the title."""

    text: str


class Table(NamedTuple):
    """A table. verdicts: by text of a cell that is a verdict, whether it is a good one."""

    head: Sequence[str]
    rows: Rows
    verdicts: Mapping[str, bool] = {}


class Bullets(NamedTuple):
    """A list of sentences below a lead."""

    lead: str
    sentences: Sequence[str]


class Links(NamedTuple):
    """Links (text, address) in a line of an HTML page, behind a lead."""

    lead: str
    links: Sequence[tuple[str, str]]


class Pictures(NamedTuple):
    """Pictures side by side: (title, stem of the file)."""

    shown: Sequence[tuple[str, str]]


Part = str | Heading | Table | Bullets | Links | Pictures


Parts = Sequence[Part]  # the parts of a page from top to bottom; HTML leaves out an empty text
Page = tuple[str, Parts]  # title and parts


def table(columns: Columns, rows: Iterable[Any]) -> Table:
    """A table of rows with these columns."""
    return Table(*tabulated(columns, rows))


def as_markdown(parts: Parts, figures: str = "") -> str:
    """The parts as Markdown. figures: path of the folder of the pictures, relative to the page."""
    return "\n\n".join(text for part in parts for text in _markdown(part, figures)) + "\n"


def _markdown(part: Part, figures: str) -> Iterator[str]:
    """The paragraphs of a part; links have none."""
    match part:
        case Heading():
            yield f"## {part.text}"
        case Table():
            yield markdown_table(part.head, part.rows)
        case Bullets():
            yield part.lead
            yield "\n".join(f"- {sentence}" for sentence in part.sentences)
        case Pictures():
            yield from (f"![{title}]({figures}/{stem}.png)" for title, stem in part.shown)
        case str():
            yield part


def as_text(parts: Parts) -> str:
    """The parts as lines for a terminal, without pictures or links."""
    lines: list[str] = []
    for part in parts:
        match part:
            case Heading():
                lines += ["", part.text]
            case Table():
                lines += ["", aligned([part.head, *part.rows])]
            case Bullets():
                lines += ["", part.lead, *(f"- {sentence}" for sentence in part.sentences)]
            case str():
                lines.append(part)
    return "\n".join(lines)


def as_html(title: str, parts: Parts, figures: Drawn) -> str:
    """The page as HTML, which contains the pictures. figures: the file of each picture."""
    body = html_of(parts, figures)
    page = (Path(__file__).parent / "page.html").read_text(encoding="utf-8")
    return page.format(title=escape(title), body=body)


def html_of(parts: Parts, figures: Drawn) -> str:
    """The parts as HTML, as a section of another page."""
    return "\n".join(_html(part, figures) for part in parts if part)


def _html(part: Part, figures: Drawn) -> str:
    """A part as HTML; verdicts in a table get a tick or a cross, and a text loses its backticks."""
    match part:
        case Heading():
            return f"<h2>{escape(part.text)}</h2>"
        case Table():
            signs = {text: f"{'✓' if good else '✗'} {text}" for text, good in part.verdicts.items()}
            return html_table(part.head, [[signs.get(cell, cell) for cell in row] for row in part.rows])
        case Bullets():
            items = "".join(f"<li>{escape(sentence)}</li>" for sentence in part.sentences)
            return f"<p>{escape(part.lead)}</p><ul>{items}</ul>"
        case Links():
            links = ", ".join(f'<a href="{escape(to)}">{escape(text)}</a>' for text, to in part.links)
            return f"<p>{escape(part.lead)}{links}</p>"
        case Pictures():
            shown = "".join(_picture(name, figures[stem]) for name, stem in part.shown)
            return f'<div class="figures">{shown}</div>'
        case _:
            return f"<p>{escape(part.replace('`', ''))}</p>"


def _picture(title: str, path: Path) -> str:
    """An HTML image that contains a PNG file."""
    data = b64encode(path.read_bytes()).decode("ascii")
    return f'<img alt="{escape(title)}" src="data:image/png;base64,{data}">'


def drawn_in(folder: Path, stems: Iterable[str]) -> dict[str, Path]:
    """The existing pictures of a result folder, by their stems."""
    files = {stem: folder / "figures" / f"{stem}.png" for stem in stems}
    return {stem: file for stem, file in files.items() if file.exists()}


def study_files(
    name: str, page: Callable[[Any], Page], rows: Mapping[str, Callable[[Any], Any]],
    figures: "Makers",
) -> "Makers":  # fmt: skip
    """The files of a study: document, CSV, figures and page.

    name: of document and page. page: from the document to title and parts. rows: by name of a CSV file, the
    function from the document to its rows. figures: by name, the function that draws one. The page is the
    last file, because it reads the figures from the folder.
    """

    def html(document: Any) -> Content:
        return lambda folder: as_html(*page(document), {stem: folder / f"{stem}.png" for stem in figures})

    return {
        f"{name}.json": as_json,
        **{f"{stem}.csv": partial(_csv, rows_of) for stem, rows_of in rows.items()},
        **{f"{stem}.png": draw for stem, draw in figures.items()},
        f"{name}.html": html,
    }


class Summary(dict[str, Any]):
    """A document, and data behind it, which figures and CSV files show but the document does not contain."""

    def __init__(self, document: Document, behind: Any) -> None:
        super().__init__(document)
        self.behind = behind


def _csv(rows_of: Callable[[Any], Any], document: Any) -> str:
    return as_csv(rows_of(document))


def replace_between(path: Path, begin: str, end: str, text: str) -> None:
    """Replace the text between two marks of a page. Raises BadInput unless the page has both marks in this
    order."""
    page = path.read_text(encoding="utf-8") if path.is_file() else ""
    before, _, behind = page.partition(begin)
    _, has_end, after = behind.partition(end)
    if not has_end:
        raise BadInput(f"{path}: has no place for the tables, allowed: a page with {begin} and {end}")
    path.write_text(f"{before}{begin}\n{text}{end}{after}", encoding="utf-8")


def versions_line(versions: Mapping[str, str]) -> str:
    """Names and versions of the packages, in a line."""
    return ", ".join(f"{name} {version}" for name, version in versions.items())


# A text, bytes, a figure, a mapping (a folder of these), None (no file), or a function from a folder to one.
Content = Any
Files = Mapping[str, Content]  # contents by name of the file
# By name of a file, the function from the document to its content.
Makers = Mapping[str, Callable[[Any], Content]]


def contents(files: Makers, document: Any) -> Files:
    """The content of each file of a document."""
    return {name: make(document) for name, make in files.items()}


def write_files(folder: Path, files: Files) -> None:
    """Write the files of a folder in their order. A content None is no file."""
    folder.mkdir(exist_ok=True)
    for name, content in files.items():
        _write(folder / name, content)


def _write(path: Path, content: Content) -> None:
    """Write a content to a path, by its type."""
    if isinstance(content, Mapping):
        write_files(path, content)
    elif isinstance(content, str):
        path.write_text(content, encoding="utf-8")
    elif isinstance(content, bytes):
        path.write_bytes(content)
    elif isinstance(content, Callable):  # type: ignore[arg-type]
        _write(path, content(path.parent))
    elif content is not None:
        content.savefig(path, metadata={"Software": SOFTWARE_MARK})  # the same figure gives the same bytes
