"""The mismatch as a section of `report.html`: a fragment of HTML with its pictures inside it."""

import base64
import json
from html import escape
from pathlib import Path

from beaver_ftc.studies.mismatch.document import Document
from beaver_ftc.studies.mismatch.states import AXES
from beaver_ftc.studies.mismatch.words import label, number, percent, seconds

PICTURES = {
    "mismatch-sources": "What the mismatch is made of, in time",
    "mismatch-bound": "How much of the bound each source uses",
    "mismatch-linear": "Poles and frequency responses: truth, FDC equations, design model",
    "mismatch-zeros": "Zeros from each surface to its rate",
    "mismatch-response": "Pulse responses of the linear models",
}


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
    worst = found["dominant"]
    says = "Truth and design agree." if worst is None else (
        f"Most of a bound is used by {label(worst['source'])}: "
        f"{percent(worst['bound_share'])} on {worst['axis']}."
    )  # fmt: skip
    case = found["guarantee"]["recommended"]
    if found["false_alarm"]:
        says += f" It raised a false alarm at {seconds(found['detection']['time_s'], 'no time')}."
    constant = ", ".join(f"{axis} {found['recommended']['constant_rad_s2'][axis]:g}" for axis in AXES)
    certain = seconds(case["guaranteed_delay_s"], "no time: it is not")
    return (
        f"<h2>Truth against design: {escape(found['scenario'])}</h2>"
        f"<p>{says} A constant bound of {constant} rad/s² would have covered this flight; "
        f"with it, detection of the published elevator case is certain within {certain}.</p>"
    )


def _table(caption: str, heads: list[str], rows: list[list[str]]) -> str:
    head = "".join(f'<th scope="col">{escape(each)}</th>' for each in heads)
    body = "".join(
        f'<tr><th scope="row">{escape(first)}</th>{"".join(f"<td>{escape(cell)}</td>" for cell in rest)}</tr>'
        for first, *rest in rows
    )
    return f"<table><caption>{escape(caption)}</caption><tr>{head}</tr>{body}</table>"


def _sources(found: Document) -> str:
    heads = ["source", *(f"{axis} {what}" for axis in AXES for what in ("RMS", "largest", "of the bound"))]
    rows = [
        [label(name), *(cell for axis in AXES for cell in _cells(found["axes"][axis][name]))]
        for name in found["axes"]["p"]
        if any(found["axes"][axis][name]["max"] > 0.0 for axis in AXES)
    ]
    return _table("Sources of the mismatch, 1e-3 rad/s²", heads, rows)


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
    return _table("The bound, faults aside", heads, rows)


def _modes(found: Document) -> str:
    heads = ["mode", "frequency rad/s", "damping", "FDC equations off by", "design model off by"]
    rows = [
        [label(name), f"{of['truth']['frequency_rad_s']:.4g}", f"{of['truth']['damping']:.3g}",
         percent(of["deviation"]["fdc"]), percent(of["deviation"]["design"])]
        for name, of in found["linear"]["modes"].items()
    ]  # fmt: skip
    return _table("Modes at trim", heads, rows)


def _picture(path: Path, says: str) -> str:
    if not path.exists():
        return ""
    data = base64.b64encode(path.read_bytes()).decode("ascii")
    image = f'<img style="max-width: 100%" alt="{escape(says)}" src="data:image/png;base64,{data}">'
    return f"<figure>{image}<figcaption>{escape(says)}</figcaption></figure>"
