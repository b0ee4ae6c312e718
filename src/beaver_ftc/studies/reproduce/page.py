"""The reproduction as Markdown, and as one self-contained HTML page."""

from base64 import b64encode
from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path

from beaver_ftc.results.metrics import Document
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


def as_markdown(document: Document, figures: str) -> str:
    """The page as Markdown; `figures` is the folder of the pictures, as the page sees it."""
    parts = [
        f"# {_TITLE}", _INTRODUCTION, words.summary(document),
        _markdown_table(words.VERDICT_HEAD, words.verdict_rows(document)),
        "## Figures", _ABOUT_FIGURES,
        *(f"![{view.title}]({figures}/{view.name}.png)" for view, _, _ in FIGURES),
        "## What the conclusions hang on", _ABOUT_SENSITIVITY,
        f"![{_ABOUT_MARGINS}]({figures}/{margins.NAME}.png)",
        _markdown_table(words.SENSITIVITY_HEAD, words.sensitivity_rows(document)),
        *_markdown_exceptions(document), _changes(document),
        "## What the paper leaves open", _ABOUT_CHOICES,
        _markdown_table(words.CHOICES_HEAD, words.choice_rows(document)),
    ]  # fmt: skip
    return "\n\n".join(parts) + "\n"


def _markdown_table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |" for line in lines)


def _markdown_exceptions(document: Document) -> list[str]:
    sentences = words.exceptions(document)
    return ["Where one does not:", "\n".join(f"- {sentence}" for sentence in sentences)] if sentences else []


def _changes(document: Document) -> str:
    return "The changes: " + "; ".join(row["variant"] for row in document["sensitivity"]) + "."


def write_page(document: Document, figures: Mapping[str, Path], path: Path) -> None:
    """Write the HTML page; `figures` are the pictures by name, which go into it."""
    parts = [
        _HEAD.format(title=escape(_TITLE)), _paragraph(_INTRODUCTION), _paragraph(words.summary(document)),
        _html_table(words.VERDICT_HEAD, words.verdict_rows(document), 3),
        "<h2>Figures</h2>", _paragraph(_ABOUT_FIGURES), '<div class="figures">',
        *(_picture(view.title, figures[view.name]) for view, _, _ in FIGURES), "</div>",
        "<h2>What the conclusions hang on</h2>", _paragraph(_ABOUT_SENSITIVITY),
        _picture(_ABOUT_MARGINS, figures[margins.NAME]),
        _html_table(words.SENSITIVITY_HEAD, words.sensitivity_rows(document)),
        _html_exceptions(document), _paragraph(_changes(document)),
        "<h2>What the paper leaves open</h2>", _paragraph(_ABOUT_CHOICES.replace("`", "")),
        _html_table(words.CHOICES_HEAD, words.choice_rows(document)),
        _paragraph(", ".join(f"{name} {version}" for name, version in document["versions"].items())),
        "</main></body></html>",
    ]  # fmt: skip
    path.write_text("\n".join(parts) + "\n", encoding="utf-8")


def _paragraph(text: str) -> str:
    return f"<p>{escape(text)}</p>" if text else ""


def _html_table(head: Sequence[str], rows: Sequence[Sequence[str]], judged: int = -1) -> str:
    top = "".join(f'<th scope="col">{escape(cell)}</th>' for cell in head)
    body = "".join(
        f"<tr>{''.join(_cell(i == judged, cell) for i, cell in enumerate(row))}</tr>" for row in rows
    )
    table = f"<table><thead><tr>{top}</tr></thead><tbody>{body}</tbody></table>"
    return f'<div class="wide">{table}</div>'


def _cell(judged: bool, text: str) -> str:
    if not judged:
        return f"<td>{escape(text)}</td>"
    good = text == words.verdict({"passed": True})
    return f'<td class="{"met" if good else "missed"}">{"✓" if good else "✗"} {escape(text)}</td>'


def _html_exceptions(document: Document) -> str:
    sentences = words.exceptions(document)
    items = "".join(f"<li>{escape(sentence)}</li>" for sentence in sentences)
    return f"<p>Where one does not:</p><ul>{items}</ul>" if sentences else ""


def _picture(title: str, path: Path) -> str:
    data = b64encode(path.read_bytes()).decode("ascii")
    return f'<img alt="{escape(title)}" src="data:image/png;base64,{data}">'


_HEAD = """<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8"><title>{title}</title>
<meta name="viewport" content="width=device-width, initial-scale=1"><link rel="icon" href="data:,">
<style>
body {{ font: 15px/1.5 system-ui, sans-serif; margin: 0; color: #111; background: #fff }}
main {{ max-width: 84rem; margin: 0 auto; padding: 0 1rem 2rem }}
h1 {{ font-size: 1.4rem }} h2 {{ font-size: 1.15rem; margin-top: 2.2rem; break-after: avoid }}
p, ul {{ max-width: 60rem }}
.wide {{ overflow-x: auto }}
table {{ border-collapse: collapse; font-size: .9rem }}
th, td {{ text-align: left; vertical-align: top; padding: .2rem .9rem .2rem 0 }}
th, td {{ border-bottom: 1px solid #d8d8d8 }}
tr {{ break-inside: avoid }}
.met, .missed {{ white-space: nowrap }}
.met {{ color: #00614a }} .missed {{ color: #a33b00; font-weight: 700 }}
.figures {{ display: grid; grid-template-columns: repeat(auto-fit, minmax(min(100%, 36rem), 1fr)) }}
img {{ width: 100%; break-inside: avoid }}
@media print {{ body {{ font-size: 10px }} .wide {{ overflow: visible }} }}
</style></head><body><main>
<h1>{title}</h1>"""
