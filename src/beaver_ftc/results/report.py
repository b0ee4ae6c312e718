"""The report of one or more runs as one HTML file that needs nothing else: no network, no other file.

The page draws the same views as the figures, from numbers of the log that it contains: the whole flight, and
if that is thinned, also the time around the events with at most about 10 000 points. Its script (report.js)
draws them. A plotting library would add one to four megabytes to every report, and has no marks, shades and
mode bands like those of the figures.
"""

import base64
import json
from collections.abc import Callable, Sequence
from dataclasses import asdict
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from beaver_ftc.documents.files import read_json
from beaver_ftc.results import log, verdict
from beaver_ftc.results.expectations import expectations_in_words
from beaver_ftc.results.model import Document, Metrics
from beaver_ftc.results.panels import Panel, View
from beaver_ftc.results.series import MAX_CURVE_POINTS, series_of
from beaver_ftc.results.style import LOOKS, MODE_COLOURS, SHADES, closeup_window, marks
from beaver_ftc.results.views import expected_airspeed_mps, surfaces, surfaces_by_kind, views

if TYPE_CHECKING:
    from jinja2 import Template

ReportSection = Callable[[Path], str]
"""A function from a result folder to the section of a study as HTML; empty if the folder has no such
results."""

_TEMPLATE_FOLDER = Path(__file__).parent / "templates"
AROUND_S = 2.5  # shown in detail before and after the closer view of the events, s
MAX_DETAIL_POINTS = 10_000  # about the most points of each curve there: longer times are thinned, too
_POSE_COLUMNS = ("north_m", "east_m", "altitude_m", "phi_rad", "theta_rad", "psi_rad")


def write_report(
    path: Path, folders: Sequence[Path], names: Sequence[str] = (), sections: Sequence[ReportSection] = ()
) -> None:
    """Write the report of the runs in these result folders, side by side, as one HTML file.

    Each folder holds `scenario.yaml`, `metrics.json` and `log.parquet`. names: what to call the runs, if not
    by their scenarios' names. sections: of studies.
    """
    path.write_text(render(folders, names, sections), encoding="utf-8")


def render(folders: Sequence[Path], names: Sequence[str] = (), sections: Sequence[ReportSection] = ()) -> str:
    """The report as HTML text.

    The legend has one entry for each name of a mark (fault, detection, ...) that any run has: the mark of the
    last run that has it. Only for a single run it shows times: the first one, and those of the others from
    it on.
    """
    from markupsafe import Markup

    documents = [read_json(folder / "metrics.json") for folder in folders]
    all_metrics = [*map(Metrics.of, documents)]
    last_marks = {mark.name: mark for metrics in all_metrics for mark in marks(metrics)}.values()
    return template(_TEMPLATE_FOLDER / "report.html.j2").render(
        runs=list(map(_verdict_entry, all_metrics, folders)),
        names=names,
        modes=MODE_COLOURS,
        marks=last_marks,
        first_mark_s=next((mark.time_s for mark in last_marks), 0.0),
        **script_style_and_data(folders, all_metrics, names),
        sections=[Markup(section(folder)) for folder in folders for section in sections],
    )


def _verdict_entry(metrics: Metrics, folder: Path) -> Document:
    """The verdict of a run as the template shows it."""
    import yaml

    scenario = (folder / "scenario.yaml").read_text(encoding="utf-8")
    return {
        "metrics": metrics,
        "title": verdict.title(metrics),
        "outcome_class": verdict.outcome_class(metrics),
        "description": yaml.safe_load(scenario).get("description", ""),
        "facts": verdict.verdict_lines(metrics),
        "tracking": verdict.tracking_rms_in_words(metrics),
        "expectations": expectations_in_words(metrics),
        "scenario": scenario,
    }


def script_style_and_data(
    folders: Sequence[Path],
    all_metrics: Sequence[Metrics],
    names: Sequence[str] = (),
    shown: Sequence[View] | None = None,
) -> Document:
    """Script, style and data of a page that replays flights.

    all_metrics: of each flight. shown: the views on the page, None for all that the flights have in common.
    """
    from markupsafe import Markup

    data = json.dumps(_page_data(folders, all_metrics, names, shown), allow_nan=False, separators=(",", ":"))
    return {
        "data": Markup(data.replace("<", "\\u003c")),  # it cannot end the script element it stands in
        "css": _asset_text("report.css"),
        "script": _asset_text("report.js"),
    }


def _page_data(
    folders: Sequence[Path],
    all_metrics: Sequence[Metrics],
    names: Sequence[str],
    shown: Sequence[View] | None,
) -> Document:
    """The runs with their curves and marks, the views, and the looks, from which the script draws the page.

    shown: the views on the page, None for all that the runs have in common.
    """
    logs = [log.StoredLog(folder / "log.parquet") for folder in folders]
    shown = _common_views(logs, all_metrics) if shown is None else shown
    columns = tuple(
        dict.fromkeys([*_POSE_COLUMNS, "mode", *(name for view in shown for name in view.columns)])
    )
    # the more runs, the fewer points of each curve, so that the page has a few megabytes; 600 still show it
    points = MAX_CURVE_POINTS if len(logs) <= 2 else max(600, 2 * MAX_CURVE_POINTS // len(logs))
    runs = zip(logs, all_metrics, names or [run_metrics.scenario for run_metrics in all_metrics], strict=True)
    return {
        "runs": [_run_entry(source, metrics, columns, name, points) for source, metrics, name in runs],
        "views": [asdict(view) | {"panels": list(map(_panel_entry, view.panels))} for view in shown],
        "looks": {role: asdict(look) for role, look in LOOKS.items()},
        "modes": list(MODE_COLOURS.items()),
    }


def _common_views(logs: Sequence[log.Log], all_metrics: Sequence[Metrics]) -> tuple[View, ...]:
    """Every view that all runs have. The views show the expected airspeed deviation if it is the same in all
    runs."""
    within_mps = {expected_airspeed_mps(metrics) for metrics in all_metrics}
    common = within_mps.pop() if len(within_mps) == 1 else None
    first, *others = (
        views(source.columns, bool(metrics.engine_power), common)
        for source, metrics in zip(logs, all_metrics, strict=True)
    )
    return tuple(view for view in first if all(view in views_of_run for views_of_run in others))


def _run_entry(source: log.Log, metrics: Metrics, columns: Sequence[str], name: str, points: int) -> Document:
    """A run for the script: name, marks, damage, and its curves at one or two levels of detail."""
    event_marks = marks(metrics)
    window = closeup_window(event_marks)
    levels = [series_of(source, columns, max_points=points)]
    t_s = levels[0]["t_s"]
    if window and t_s.size < source.row_count():
        around = window[0] - AROUND_S, window[1] + AROUND_S
        levels.append(series_of(source, columns, around, MAX_DETAIL_POINTS))
    return {
        "name": name,
        "jet": not {"spoiler", "stabiliser"}.isdisjoint(surfaces_by_kind(surfaces(source.columns))),
        "damage": [
            # a case such as left-wing-tip-off takes the part off
            {"part": fault.size["case"].removesuffix("-off"), "at_s": fault.at_s, "end_s": fault.end_s}
            for fault in metrics.faults
            if fault.type == "damage"
        ],
        "marks": [asdict(mark) for mark in event_marks],
        "window": window or ((float(t_s[0]), float(t_s[-1])) if t_s.size else (0.0, 0.0)),
        "levels": [
            {column: _base64_floats(column, values) for column, values in level.items()} for level in levels
        ],
    }


def _base64_floats(name: str, values: np.ndarray) -> str:
    """Values as base64 of little-endian floats: double precision for time, single for curves."""
    return base64.b64encode(values.astype("<f8" if name == "t_s" else "<f4").tobytes()).decode("ascii")


def _panel_entry(panel: Panel) -> Document:
    """A panel for the script: its fields, and the properties that are computed from them."""
    return asdict(panel) | {
        "unit": panel.unit,
        "steps": panel.steps,
        "shade_colour": SHADES.get(panel.shade_label, ""),
        "traces": [asdict(trace) | {"factor": trace.factor} for trace in panel.traces],
    }


@cache
def _asset_text(name: str) -> Any:
    """A file of the template folder, which is inserted without escapes."""
    from markupsafe import Markup

    return Markup((_TEMPLATE_FOLDER / name).read_text(encoding="utf-8"))


@cache
def template(path: Path) -> "Template":
    """The template of a page, by its file."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    pages = Environment(
        loader=FileSystemLoader(path.parent),
        undefined=StrictUndefined,
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return pages.get_template(path.name)
