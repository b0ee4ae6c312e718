"""The reproduction as Markdown, and as one self-contained HTML page."""

from collections.abc import Mapping
from pathlib import Path

from beaver_ftc.results.metrics import Document
from beaver_ftc.studies.present import page
from beaver_ftc.studies.reproduce import margins, words
from beaver_ftc.studies.reproduce.figures import FIGURES

_TITLE = "The published study, flown again"
_INTRODUCTION = (
    "Every case of [Zhang2005], flown on the JSBSim truth with the published scheme (norm-bound thresholds, "
    "none of the sharper tests), and each statement of its section VII held against our numbers. "
    '"Sharpened" is what the default estimators make of the same flight.'
)
_ABOUT_FIGURES = (
    "One figure for each published one. The paper names the upper panels (elevator and flap) and the lower "
    "right one (pitch rate); the lower left one is ours."
)
_ABOUT_SENSITIVITY = (
    "Each choice changed, one at a time, all cases flown again, every number measured again: its range, and "
    "under how many of the changes the statement still holds."
)
_ABOUT_MARGINS = "How far each number stays from its limit"
_ABOUT_CHOICES = "What the paper leaves open, in one place (`src/beaver_ftc/studies/reproduce/choices.py`)."


VERDICTS = {"borne out": True, "NOT BORNE OUT": False}


def as_markdown(document: Document, figures: str) -> str:
    """The page as Markdown; `figures` is the folder of the pictures, as the page sees it."""
    return page.as_markdown([f"# {_TITLE}", *_parts(document)], figures)


def write_page(document: Document, figures: Mapping[str, Path], path: Path) -> None:
    """Write the HTML page; `figures` are the pictures by name, which go into it."""
    parts = [*_parts(document), page.versions_line(document["versions"])]
    path.write_text(page.as_html(_TITLE, parts, figures), encoding="utf-8")


def _parts(document: Document) -> list[page.Part]:
    exceptions = words.exceptions(document)
    changes = "; ".join(row["variant"] for row in document["sensitivity"])
    return [
        _INTRODUCTION, words.summary(document),
        page.Table(words.VERDICT_HEAD, words.verdict_rows(document), VERDICTS),
        page.Heading("Figures"), _ABOUT_FIGURES,
        page.Pictures([(view.title, view.name) for view, _, _ in FIGURES]),
        page.Heading("What the conclusions hang on"), _ABOUT_SENSITIVITY,
        page.Pictures([(_ABOUT_MARGINS, margins.NAME)]),
        page.Table(words.SENSITIVITY_HEAD, words.sensitivity_rows(document)),
        *([page.Bullets("Where one does not:", exceptions)] if exceptions else []),
        f"The changes: {changes}.",
        page.Heading("What the paper leaves open"), _ABOUT_CHOICES,
        page.Table(words.CHOICES_HEAD, words.choice_rows(document)),
    ]  # fmt: skip
