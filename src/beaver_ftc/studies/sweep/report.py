"""The report of a sweep as one HTML file that needs nothing else but leads to the flights kept beside it."""

import base64
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from beaver_ftc.studies.sweep import words
from beaver_ftc.studies.sweep.figures import FIGURES

if TYPE_CHECKING:
    from jinja2 import Environment

Document = dict[str, Any]

_TEMPLATES = Path(__file__).parent / "templates"
_OUTCOMES = {
    "detection_delay": "detection delay",
    "missed_detection": "missed detection",
    "tracking_error": "tracking error",
    "residual_before_fault": "residual before the fault",
}


def render(summary: Document, folder: Path) -> str:
    """The report as HTML text, from the summary and the figures and flights in the sweep's folder."""
    return _environment().get_template("sweep.html.j2").render(
        summary=summary,
        title=words.title(summary),
        facts=words.facts(summary),
        tracking=words.tracking(summary),
        expectations=words.expectations(summary),
        sensitivity=[(_OUTCOMES[name], ranking) for name, ranking in summary["sensitivity"].items()
                     if ranking],
        worst=[flight | {"link": _link(folder, flight["name"])} for flight in summary["worst"]],
        figures=_figures(folder),
        value=words.value,
        percent=words.percent,
    )  # fmt: skip


def _link(folder: Path, name: str) -> str | None:
    """Where a kept flight is to be seen, relative to the report."""
    for seen in ("report.html", "metrics.json", "scenario.yaml"):
        if (folder / "flights" / name / seen).is_file():
            return f"flights/{name}/{seen}"
    return None


def _figures(folder: Path) -> list[tuple[str, str]]:
    """(title, PNG as base64) of each figure there is."""
    paths = [(title, folder / "figures" / f"{name}.png") for name, (title, _) in FIGURES.items()]
    return [(title, base64.b64encode(path.read_bytes()).decode()) for title, path in paths if path.exists()]


@cache
def _environment() -> "Environment":
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    options: dict[str, Any] = {"autoescape": True, "trim_blocks": True, "lstrip_blocks": True}
    return Environment(loader=FileSystemLoader(_TEMPLATES), undefined=StrictUndefined, **options)
