"""The report of a run as one HTML file that needs nothing else: no network, no other file."""

import base64
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from beaver_ftc.results import verdict
from beaver_ftc.results.metrics import Document

if TYPE_CHECKING:
    from jinja2 import Environment

_TEMPLATES = Path(__file__).parent / "templates"


def write_report(folder: Path, metrics: Document) -> None:
    """Write `report.html` into a result folder, from its figures, its `scenario.yaml` and the metrics."""
    (folder / "report.html").write_text(render(folder, metrics), encoding="utf-8")


def render(folder: Path, metrics: Document) -> str:
    """The report as HTML text."""
    return (
        _environment()
        .get_template("report.html.j2")
        .render(
            metrics=metrics,
            title=verdict.title(metrics),
            facts=verdict.facts(metrics),
            tracking=verdict.tracking(metrics),
            expectations=verdict.expectations(metrics),
            scenario=(folder / "scenario.yaml").read_text(encoding="utf-8"),
            figures=[(path.stem, _data_uri(path)) for path in sorted((folder / "figures").glob("*.png"))],
        )
    )


@cache
def _environment() -> "Environment":
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    options: dict[str, Any] = {"autoescape": True, "trim_blocks": True, "lstrip_blocks": True}
    return Environment(loader=FileSystemLoader(_TEMPLATES), undefined=StrictUndefined, **options)


def _data_uri(path: Path) -> str:
    return "data:image/png;base64," + base64.b64encode(path.read_bytes()).decode("ascii")
