"""The comparison as one self-contained HTML page, and in the leaderboard of the standard sets."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from beaver_ftc.studies.compare.table import sections
from beaver_ftc.studies.present import page

Document = dict[str, Any]

MARK = "<!-- everything below is written by `beaver-ftc compare --benchmark` -->"
_SAYS = (
    "The same flights for every scheme, with the fault-tolerant law, and for every law, with our scheme. "
    "Lines in the figure run over all alarm levels of a scheme's statistic, on flights under the nominal "
    "law; the mark is the level it ships with."
)
_STEM = "comparison"
_FIGURE = "Detection rate and delay against false alarms, and tracking against the oracle"


def page_of(document: Document, title: str, folder: Path) -> str:
    """The page; the figure in the folder goes into it."""
    versions = page.versions_line(document["versions"])
    parts = [_SAYS, page.Pictures([(_FIGURE, _STEM)]), *_sets(document), versions]
    return page.as_html(title, parts, {_STEM: folder / f"{_STEM}.png"})


def write_leaderboard(document: Document, path: Path) -> None:
    """Replace what stands below the mark; what stands above it was written by hand and stays."""
    above = path.read_text(encoding="utf-8").partition(MARK)[0] if path.exists() else "# Benchmark\n\n"
    made = f"Made with {page.versions_line(document['versions'])}."
    path.write_text(above + page.as_markdown([MARK, made, *_sets(document)]), encoding="utf-8")


def _sets(document: Document) -> Iterator[page.Part]:
    for name, part in document["sets"].items():
        yield page.Heading(f"{name}: {part['flights']} flights")
        yield from (page.Table(header, rows) for header, rows in sections(part))
        losses = [f"{sentence}." for sentence in part["better_than_ours"]]
        nothing = "nothing here: in these tables no rival has a better number than ours, us/frame aside."
        yield page.Bullets("What loses:", losses or [nothing])
