"""The mismatch as a section of `report.html`: a fragment of HTML with its pictures inside it."""

import base64
import json
from html import escape
from pathlib import Path

from beaver_ftc.studies.mismatch.document import Document
from beaver_ftc.studies.mismatch.text import findings, tables
from beaver_ftc.studies.present.tables import html_table

PICTURES = {
    "mismatch-sources": "What the mismatch is made of, in time",
    "mismatch-bound": "How much of the bound each source uses",
    "mismatch-linear": "Poles and frequency responses: truth, FDC equations, design model",
    "mismatch-zeros": "Zeros from each surface to its rate",
    "mismatch-response": "Pulse responses of the linear models",
}


def show_in_reports() -> None:
    """Add the section to the reports of folders that hold a mismatch."""
    from beaver_ftc.results.report import register_section

    register_section(mismatch_section)


def mismatch_section(folder: Path) -> str:
    """The section of a result folder as HTML; empty where the folder holds no mismatch."""
    path = folder / "mismatch.json"
    if not path.exists():
        return ""
    found = json.loads(path.read_text(encoding="utf-8"))
    pictures = [_picture(folder / "figures" / f"{name}.png", says) for name, says in PICTURES.items()]
    shown = [html_table(head, rows, caption) for caption, head, rows in tables(found)]
    parts = [_heading(found), *shown, *pictures]
    return f"<section>{''.join(parts)}</section>"


def _heading(found: Document) -> str:
    said = "".join(f"<p>{escape(line)}</p>" for line in findings(found))
    return f"<h2>Truth against design: {escape(found['scenario'])}</h2>{said}"


def _picture(path: Path, says: str) -> str:
    if not path.exists():
        return ""
    data = base64.b64encode(path.read_bytes()).decode("ascii")
    image = f'<img style="max-width: 100%" alt="{escape(says)}" src="data:image/png;base64,{data}">'
    return f"<figure>{image}<figcaption>{escape(says)}</figcaption></figure>"
