"""The comparison as tables and page, and the study that it shows."""

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from beaver_ftc.diagnosis.rivals import TunedValuesByGrade
from beaver_ftc.results.model import Document
from beaver_ftc.studies.compare.comparison_figure import figure_of
from beaver_ftc.studies.compare.scores import document_of
from beaver_ftc.studies.compare.sets import SetFlight
from beaver_ftc.studies.compare.trial import LAW, SCHEME, Entry, Trial, fly_case
from beaver_ftc.studies.engine.study import Study
from beaver_ftc.studies.present import page
from beaver_ftc.studies.present.tables import Columns, aligned, bare_percent

Cell = Callable[[Document], str]


def _cell(form: Callable[[Any], str], *keys: str, none: str = "-") -> Cell:
    """A cell with the numbers under these keys, a slash between them; `none` in place of a missing number."""
    return lambda row: " / ".join(none if row.get(key) is None else form(row[key]) for key in keys)


def _of_faults(cell: Cell) -> Cell:
    """The cell, or `-` in a row without faulted flights."""
    return lambda row: cell(row) if row["faults"] else "-"


def _alarms(row: Document) -> str:
    """The rate of false alarms and its upper bound."""
    rate = row["false_alarms_per_h"]
    upper = row["false_alarms_per_h_upper"]
    return "-" if rate is None else f"{rate:.3g} (<{float(f'{upper:.2g}'):g})"


def _free(row: Document) -> str:
    """Detection rate and median delay of a scheme at its most sensitive level without a false alarm."""
    if row.get("free") is None:
        return "-"
    rate = _cell(bare_percent, "detection_rate")
    delay = _cell("{:.2f}".format, "delay_median_s", none="never")
    return f"{rate(row['free'])} / {delay(row['free'])}"


FLIGHT: Columns = (
    ("tracking/oracle 50/90 %", _cell("{:.2f}".format, "ratio_median", "ratio_90", none="lost")),
    ("lost", "departures"),
    ("us/frame", _cell("{:.0f}".format, "us")),
)
DIAGNOSIS: Columns = (
    ("scheme", "scheme"),
    ("false alarms/h (95 %)", _alarms),
    ("detected %", _cell(bare_percent, "detection_rate")),
    ("delay s 50/90 %", _of_faults(_cell("{:.2f}".format, "delay_median_s", "delay_90_s", none="never"))),
    ("isolated %", _cell(bare_percent, "isolation_rate")),
    ("with no false alarm: detected % / delay s", _of_faults(_free)),
    *FLIGHT,
)
CONTROL: Columns = (
    ("law", "law"),
    *FLIGHT,
    ("error before, deg/s 50/90 %", _cell("{:.3g}".format, "before_median", "before_90")),
    ("after", _cell("{:.3g}".format, "after_median", "after_90")),
    ("travel deg/s", _cell("{:.3g}".format, "travel_median")),
    ("energy deg2/s2", _cell("{:.3g}".format, "energy_median")),
)


def sections(part: Document) -> Iterator[tuple[page.Table, list[str]]]:
    """The table of the schemes with our law, and that of the laws with our scheme, each with the sentence
    that says which is better; without it if no flight has a fault."""
    lines = [row | {"free": part["without_false_alarm"].get(row["scheme"])} for row in part["lines"]]
    best = part["who_is_better"]
    for kind, columns, key, ours in (("schemes", DIAGNOSIS, "law", LAW), ("laws", CONTROL, "scheme", SCHEME)):
        table = page.table(columns, [row for row in lines if row[key] == ours])
        yield table, [best[kind]] if best else []


def as_text(document: Document) -> str:
    """The comparison for a terminal."""
    blocks = []
    for name, part in document["sets"].items():
        blocks.append(f"{name}: {part['flights']} flights")
        for table, first in sections(part):
            blocks.append("\n".join([aligned([table.head, *table.rows]), *first, ""]))
        blocks += part["better_than_ours"] + [f"could not fly: {error}" for error in part["errors"]]
        blocks.append("")
    return "\n".join(blocks)


MARK = "<!-- everything below is written by `beaver-ftc compare --benchmark` -->"
_SAYS = (
    "The same flights for every scheme, with the fault-tolerant law, and for every law, with our scheme. "
    "Lines in the figure run over all alarm levels of a scheme's statistic, on flights under the nominal "
    "law; the mark is the level it ships with."
)
_FIGURE = "Detection rate and delay against false alarms, and tracking against the oracle"


def page_of(document: Document, name: str) -> page.Page:
    """Title and parts of the page."""
    versions = page.versions_line(document["versions"])
    parts = [_SAYS, page.Pictures([(_FIGURE, "comparison")]), *_sets(document), versions]
    return f"Comparison: {name}", parts


def write_leaderboard(document: Document, path: Path) -> None:
    """Replace the part of a page below MARK. The part above it is written by hand and stays."""
    above = path.read_text(encoding="utf-8").partition(MARK)[0] if path.exists() else "# Benchmark\n\n"
    origin = f"Made with {page.versions_line(document['versions'])}."
    path.write_text(above + page.as_markdown([MARK, origin, *_sets(document)]), encoding="utf-8")


def _sets(document: Document) -> Iterator[page.Part]:
    """Heading, tables and sentences of each set."""
    for name, part in document["sets"].items():
        yield page.Heading(f"{name}: {part['flights']} flights")
        for table, first in sections(part):
            yield table
            yield from first
        losses = [f"{sentence}." for sentence in part["better_than_ours"]]
        nothing = "nothing here: in these tables no rival has a better number than ours, us/frame aside."
        yield page.Bullets("What loses:", losses or [nothing])


def comparison_study(
    name: str, cases: Sequence[SetFlight], entries: Sequence[Entry], chosen: TunedValuesByGrade | None
) -> Study:
    """The study of all cases with all entries. chosen: tuned values of schemes and laws, as in trial.py."""
    files = page.study_files("comparison", partial(page_of, name=name), {}, {"comparison": figure_of})
    return Study(
        name, cases, partial(fly_case, entries=tuple(entries), chosen=chosen),
        partial(document_of, entries=entries), files, row=Trial,
        follows_from=(entries, chosen), lost=lost,
    )  # fmt: skip


def lost(case: SetFlight, why: str) -> Trial:
    """The trial of a case that ends its process: no results, but the reason."""
    return Trial(case.set, failures=[f"{case.scenario.name}: {why}"])
