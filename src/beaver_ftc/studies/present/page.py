"""A page from its parts, as Markdown and as one HTML file that needs nothing else; a study's files."""

from base64 import b64encode
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import partial
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

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

if TYPE_CHECKING:
    from matplotlib.figure import Figure


Drawn = Mapping[str, Path]
"""Files of pictures by their stems."""


class Heading(NamedTuple):
    """A heading below the title."""

    text: str


class Table(NamedTuple):
    """A table. verdicts: which cells are a verdict, and whether it is a good one."""

    head: Sequence[str]
    rows: Rows
    verdicts: Mapping[str, bool] = {}


class Bullets(NamedTuple):
    """Sentences, one below the other."""

    lead: str
    sentences: Sequence[str]


class Links(NamedTuple):
    """Links in a line of an HTML page: (text, address)."""

    lead: str
    links: Sequence[tuple[str, str]]


class Pictures(NamedTuple):
    """Pictures side by side: (title, stem of the file)."""

    shown: Sequence[tuple[str, str]]


Part = str | Heading | Table | Bullets | Links | Pictures


Parts = Sequence[Part]  # of a page, from above


def table(columns: Columns, rows: Iterable[Any]) -> Table:
    """A table of these columns."""
    return Table(*tabulated(columns, rows))


def as_markdown(parts: Parts, figures: str = "") -> str:
    """The parts as Markdown; figures: the folder of the pictures, as the page sees it."""
    return "\n\n".join(text for part in parts for text in _markdown(part, figures)) + "\n"


def _markdown(part: Part, figures: str) -> Iterator[str]:
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
    """The page as HTML; figures: stem to file of the pictures, which go into it."""
    body = html_of(parts, figures)
    page = (Path(__file__).parent / "page.html").read_text(encoding="utf-8")
    return page.format(title=escape(title), body=body)


def html_of(parts: Parts, figures: Drawn) -> str:
    """The parts as HTML, for a page of others."""
    return "\n".join(_html(part, figures) for part in parts if part)


def _html(part: Part, figures: Drawn) -> str:
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
    data = b64encode(path.read_bytes()).decode("ascii")
    return f'<img alt="{escape(title)}" src="data:image/png;base64,{data}">'


def drawn_in(folder: Path, stems: Iterable[str]) -> dict[str, Path]:
    """The pictures of a result folder that are there, by their stems."""
    files = {stem: folder / "figures" / f"{stem}.png" for stem in stems}
    return {stem: file for stem, file in files.items() if file.exists()}


def study_files(
    name: str, page: Callable[[Any], tuple[str, Parts]], rows: Mapping[str, Callable[[Any], Any]],
    figures: "Makers",
) -> "Makers":  # fmt: skip
    """A study's files: document, rows as CSV, figures, and the page of a title and parts that shows them."""

    def html(document: Any) -> Content:
        return lambda folder: as_html(*page(document), {stem: folder / f"{stem}.png" for stem in figures})

    return {
        f"{name}.json": as_json,
        **{f"{stem}.csv": partial(_csv, rows_of) for stem, rows_of in rows.items()},
        **{f"{stem}.png": draw for stem, draw in figures.items()},
        f"{name}.html": html,
    }


class Summary(dict[str, Any]):
    """A document, and what is behind it: its files show that too, but the document does not have it."""

    def __init__(self, document: Document, behind: Any) -> None:
        super().__init__(document)
        self.behind = behind


def _csv(rows_of: Callable[[Any], Any], document: Any) -> str:
    return as_csv(rows_of(document))


def replace_between(path: Path, begin: str, end: str, text: str) -> None:
    """Put text between two marks of a page, whose other parts stay. Raises BadInput unless it has both, the
    first before the second."""
    page = path.read_text(encoding="utf-8") if path.is_file() else ""
    before, _, rest = page.partition(begin)
    _, found, after = rest.partition(end)
    if not found:
        raise BadInput(f"{path}: has no place for the tables, allowed: a page with {begin} and {end}")
    path.write_text(f"{before}{begin}\n{text}{end}{after}", encoding="utf-8")


def versions_line(versions: Mapping[str, str]) -> str:
    """The versions that made the numbers, in a line."""
    return ", ".join(f"{name} {version}" for name, version in versions.items())


Content = Any  # text, bytes, a figure, a folder of these, or a function that makes one, given the folder
Files = Mapping[str, Content]
Makers = Mapping[str, Callable[[Any], Content]]  # by the name of a file what makes its content of a document


def contents(files: Makers, document: Any) -> Files:
    """The content of each file of a document."""
    return {name: make(document) for name, make in files.items()}


def write_files(folder: Path, files: Files) -> None:
    """Write each file of a folder, in order; a content of None is no file."""
    folder.mkdir(exist_ok=True)
    for name, content in files.items():
        _write(folder / name, content)


def _write(path: Path, content: Content) -> None:
    if isinstance(content, Mapping):
        write_files(path, content)
    elif isinstance(content, str):
        path.write_text(content, encoding="utf-8")
    elif isinstance(content, bytes):
        path.write_bytes(content)
    elif isinstance(content, Callable):  # type: ignore[arg-type]
        _write(path, content(path.parent))
    elif content is not None:
        save(content, path)


def save(figure: "Figure", path: Path) -> Path:
    """Write a figure as PNG; the same figure gives the same bytes."""
    figure.savefig(path, metadata={"Software": SOFTWARE_MARK})
    return path
