"""The mismatch as a section of `report.html`: a fragment of HTML with its pictures inside it."""

import base64
import json
from html import escape
from pathlib import Path

from beaver_ftc.studies.engine.words import html_table, number
from beaver_ftc.studies.mismatch.document import Document
from beaver_ftc.studies.mismatch.states import AXES
from beaver_ftc.studies.mismatch.text import findings
from beaver_ftc.studies.mismatch.words import label, percent

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
    parts = [_heading(found), _sources(found), _bounds(found), _modes(found), *pictures]
    return f"<section>{''.join(parts)}</section>"


def _heading(found: Document) -> str:
    said = "".join(f"<p>{escape(line)}</p>" for line in findings(found))
    return f"<h2>Truth against design: {escape(found['scenario'])}</h2>{said}"


def _sources(found: Document) -> str:
    heads = ["source", *(f"{axis} {what}" for axis in AXES for what in ("RMS", "largest", "of the bound"))]
    rows = [
        [label(name), *(cell for axis in AXES for cell in _cells(found["axes"][axis][name]))]
        for name in found["axes"]["p"]
        if any(found["axes"][axis][name]["max"] > 0.0 for axis in AXES)
    ]
    return html_table(heads, rows, "Sources of the mismatch, 1e-3 rad/s²")


def _cells(of: Document) -> list[str]:
    if of["max"] == 0.0:
        return ["–", "–", "–"]
    return [number(1e3 * of["rms"]), number(1e3 * of["max"]), percent(of["bound_share"])]


def _bounds(found: Document) -> str:
    heads = ["axis", "constant rad/s²", "smallest that covers", "worst use", "exceeded"]
    rows = [
        [axis, f"{of['constant_rad_s2']:.4g}", f"{of['smallest_constant_rad_s2']:.4g}",
         percent(of["worst_ratio"]), f"{of['exceeded_s']:.2f} s in {of['exceeded_times']} times"]
        for axis, of in found["bound"].items()
    ]  # fmt: skip
    return html_table(heads, rows, "The bound, faults aside")


def _modes(found: Document) -> str:
    heads = ["mode", "frequency rad/s", "damping", "FDC equations off by", "design model off by"]
    rows = [
        [label(name), f"{of['truth']['frequency_rad_s']:.4g}", f"{of['truth']['damping']:.3g}",
         percent(of["deviation"]["fdc"]), percent(of["deviation"]["design"])]
        for name, of in found["linear"]["modes"].items()
    ]  # fmt: skip
    return html_table(heads, rows, "Modes at trim")


def _picture(path: Path, says: str) -> str:
    if not path.exists():
        return ""
    data = base64.b64encode(path.read_bytes()).decode("ascii")
    image = f'<img style="max-width: 100%" alt="{escape(says)}" src="data:image/png;base64,{data}">'
    return f"<figure>{image}<figcaption>{escape(says)}</figcaption></figure>"
