"""The report of a sweep: its summary in words and tables, with figures and links, as one HTML page.

All numbers are taken from the summary document.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path

from beaver_ftc.aircraft import AXES
from beaver_ftc.results.model import Document
from beaver_ftc.studies.present.page import (
    Heading,
    Links,
    Part,
    Pictures,
    Table,
    as_html,
    drawn_in,
    versions_line,
)
from beaver_ftc.studies.present.tables import Rows, tabulated
from beaver_ftc.studies.sweep.pictures import FIGURES
from beaver_ftc.studies.sweep.summary import OUTCOMES
from beaver_ftc.studies.sweep.summary_words import (
    exact_percent,
    expectations,
    facts,
    interval,
    seconds,
    title,
    tracking,
    value,
)

_STEERED = "The search steered these flights towards the worst: rates say nothing about flights in general."
_SENSITIVITY_NOTE = (
    "Share of the ranks of an outcome that a varied key explains (Kruskal and Wallis' epsilon squared), "
    "Spearman's rank correlation, and the probability that chance alone explains as much with any key."
)
BY_FAULT = (
    ("fault", "fault"), ("flights", "flights"), ("detected", "detection.rate", exact_percent),
    ("95 % interval", "detection", interval), ("delay: median", "detection.delay_s.median", seconds),
    ("95 %", "detection.delay_s.p95", seconds), ("max", "detection.delay_s.max", seconds),
    ("named rightly", "isolation.rate", exact_percent), ("95 % interval", "isolation", interval),
    ("named wrongly", "isolation.wrong.count"),
)  # fmt: skip
WORST = (("flight", "run"), ("why", "why", "; ".join), ("flies it again", "replay"))
SENSITIVITY = (
    ("outcome", "outcome"), ("key", "key"), ("explained", "explained", value),
    ("correlation", "rank_correlation", value), ("p", "p_value", value),
)  # fmt: skip
FAILED = (("flights", "count"), ("why", "reason"), ("first", "first_run"))


def render(summary: Document, folder: Path) -> str:
    """The report as HTML text, from the summary, and from the figures and flights in the folder of the
    sweep."""
    figures = drawn_in(folder, FIGURES)
    return as_html(title(summary), _parts(summary, folder, figures), figures)


def _parts(summary: Document, folder: Path, figures: Mapping[str, Path]) -> list[Part]:
    """The parts of the report."""
    judged = [("✓ met" if passed else "✗ MISSED", *row) for *row, passed in expectations(summary)]
    links = [(entry["name"], link) for entry in summary["worst"] if (link := _link(folder, entry["name"]))]
    explained = [
        entry | {"outcome": OUTCOMES[outcome]}
        for outcome, ranking in summary["sensitivity"].items()
        for entry in ranking
    ]
    plan_text = "{flights} flights, sampling {sampling}, seed {seed}".format(**summary)
    return [
        summary["description"],
        _STEERED if "search" in summary else "",
        *_section("What the flights show", ("", ""), facts(summary)),
        *_section("Expectations", ("", "of", "expected", "found"), judged),
        *_section("Tracking error, median RMS in deg/s", ("", *AXES), tracking(summary)),
        *_section("By fault", *tabulated(BY_FAULT, summary["by_fault"])),
        Heading("Figures"),
        Pictures([(FIGURES[name][0], name) for name in figures]),
        *_section("Flights worth a look", *tabulated(WORST, summary["worst"])),
        Links("Flights that have been flown again: ", links) if links else "",
        *_section("Flights that could not be flown", *tabulated(FAILED, summary["reasons"])),
        *_section("Sensitivity", *tabulated(SENSITIVITY, explained)),
        _SENSITIVITY_NOTE if explained else "",
        f"{plan_text}; {versions_line(summary['versions'])}",
    ]


def _section(heading: str, head: Sequence[str], rows: Rows) -> list[Part]:
    """A heading and its table; no part without rows."""
    return [Heading(heading), Table(head, rows)] if rows else []


def _link(folder: Path, name: str) -> str | None:
    """The path of the first file of a kept flight that exists, relative to the report; None if there is
    none."""
    paths = [f"flights/{name}/{file}" for file in ("report.html", "metrics.json", "scenario.yaml")]
    return next((path for path in paths if (folder / path).is_file()), None)
