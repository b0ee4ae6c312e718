"""The comparison as one self-contained HTML page."""

from base64 import b64encode
from html import escape
from pathlib import Path
from typing import Any

from beaver_ftc.studies.compare.table import sections

Document = dict[str, Any]

_HEAD = """<!doctype html>
<html lang="en"><head><meta charset="utf-8"><title>{title}</title>
<meta name="viewport" content="width=device-width, initial-scale=1">
<style>
body {{ font: 15px/1.5 system-ui, sans-serif; margin: 2rem auto; max-width: 75rem; padding: 0 1rem; color:
#1a1a1a }} table {{ border-collapse: collapse; margin: 1rem 0; font-size: 14px }}
th, td {{ text-align: right; padding: .25rem .7rem; border-bottom: 1px solid #ddd }}
th:first-child, td:first-child {{ text-align: left }}
img {{ max-width: 100% }}
</style></head><body>
<h1>{title}</h1>
<p>{says}</p>
<img alt="Detection rate and delay against false alarms, and tracking against the oracle"
src="data:image/png;base64,{figure}">
"""
_SAYS = (
    "The same flights for every scheme, with the fault-tolerant law, and for every law, with our scheme. "
    "Lines in the figure run over all alarm levels of a scheme's statistic, on flights under the nominal "
    "law; the mark is the level it ships with."
)


def write_page(document: Document, figure: Path, path: Path, title: str) -> None:
    """Write the page; the figure goes into it."""
    image = b64encode(figure.read_bytes()).decode()
    parts = [_HEAD.format(title=escape(title), says=_SAYS, figure=image)]
    for name, part in document["sets"].items():
        parts.append(f"<h2>{escape(name)}: {part['flights']} flights</h2>")
        parts += [_table(header, rows) for header, rows in sections(part)]
        parts.append(_losses(part["better_than_ours"]))
    versions = ", ".join(f"{name} {version}" for name, version in document["versions"].items())
    path.write_text("\n".join([*parts, f"<p>{escape(versions)}</p></body></html>\n"]), encoding="utf-8")


def _table(header: list[str], rows: list[list[str]]) -> str:
    head = "".join(f"<th>{escape(cell)}</th>" for cell in header)
    body = "".join("<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>" for row in rows)
    return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


def _losses(sentences: list[str]) -> str:
    if not sentences:
        return "<p>No rival does better than ours here.</p>"
    items = "".join(f"<li>{escape(sentence)}</li>" for sentence in sentences)
    return f"<p>Where ours is beaten:</p><ul>{items}</ul>"
