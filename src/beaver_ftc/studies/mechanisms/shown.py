"""What mechanisms are worth, as sentences, tables, a figure and files."""

from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

from beaver_ftc.results.model import Document
from beaver_ftc.studies.mechanisms.systems import DEFAULT, PAPER
from beaver_ftc.studies.present.figures import GRID, SERIES, label_edges, panels
from beaver_ftc.studies.present.page import Heading, Part, Pictures, Table, study_files, versions_line
from beaver_ftc.studies.present.tables import Rows, aligned, estimate, number, or_never, percent

if TYPE_CHECKING:
    from matplotlib.figure import Figure

NAME = "mechanisms"
CRITERIA = {  # of effects.py, in the words of tables
    "false_alarms": "false alarms",
    "late": "late alarms",
    "names": "lost names",
    "tracking": "worse tracking",
}
INTERVAL = "95 % interval"
NET_HEAD = ("mechanism", *(head for words in CRITERIA.values() for head in (f"{words}, points", INTERVAL)))
SAME_HEAD = ("mechanism", "flights", "same verdict", "same tracking")
MEDIAN_HEAD = ("mechanism", "delay with, s", "delay without, s", "error with, deg/s", "error without, deg/s",
               "error ratio", INTERVAL)  # fmt: skip
SYSTEM_SHARES = {
    "false_alarms": "false alarms, %", "detected": "detected, %", "named": "named rightly, %",
    "lost": "aircraft lost, %",
}  # fmt: skip
ALARM_HEAD = (
    "system", "mechanisms", "false alarms", "with an undeclared error", "certified", "unexplained",
)  # fmt: skip
MARGIN_HEAD = ("system", "bandwidth", "instruments", "gain margin, dB", "phase margin, deg")


CAPTIONS = (
    "Both systems with all of their mechanisms.",
    "Net share of flights that are worse without the mechanism, percentage points.",
    "Pairs of flights with the same alarm, name and time of both, and with the same tracking error.",
    "Medians with and without the mechanism; error ratio: without over with.",
    "False alarms, and how many of them are explained.",
)


def as_text(document: Document) -> str:
    """The findings, and the tables."""
    shown = (
        f"{caption}\n{aligned([head, *rows])}"
        for caption, (head, rows) in zip(CAPTIONS, tables(document), strict=True)
    )
    return "\n\n".join(["\n".join(sentences(document)), *shown])


def tables(document: Document) -> Iterator[tuple[Sequence[str], Rows]]:
    """Head and rows of a table for each of CAPTIONS."""
    yield system_head(document), system_rows(document)
    for head, row_of in ((NET_HEAD, net_row), (SAME_HEAD, same_row), (MEDIAN_HEAD, median_row)):
        yield head, [row_of(row) for row in document["mechanisms"]]
    yield ALARM_HEAD, alarm_rows(document)


def sentences(document: Document) -> Iterator[str]:
    """What was flown, what each mechanism improves or worsens, and whether false alarms have a reason."""
    names = " x ".join(f"{len(values)} {_FACTOR_WORDS[name]}" for name, values in document["factors"].items())
    yield f"{document['draws']} draws over {names}, each flown with and without every mechanism."
    yield from (finding(row) for row in document["mechanisms"])
    yield alarms_sentence(document)


_FACTOR_WORDS = {
    "fault": "faults", "bandwidth": "bandwidths", "error": "undeclared errors", "instruments": "instruments",
}  # fmt: skip


def label(row: Document) -> str:
    """A mechanism with its system."""
    return f"{row['mechanism']} ({row['system']})"


def finding(row: Document) -> str:
    """What the removal of a mechanism changes, beyond chance."""
    if row["same_verdict"] == row["same_tracking"] == row["flights"]:
        return f"{label(row)}: without it all {row['flights']} flights are the same."
    certain = {name: row[name] for name in CRITERIA if row[name]["low"] > 0.0 or row[name]["high"] < 0.0}
    if not certain:
        changed = row["flights"] - row["same_verdict"]
        differ = f"{changed} of {row['flights']} verdicts differ" if changed else "no verdict differs"
        return f"{label(row)}: without it {differ}, and no criterion changes beyond chance."
    said = (f"{CRITERIA[name]} {100 * found['value']:+.1f} points" for name, found in certain.items())
    return f"{label(row)}: without it, {', '.join(said)}."


def alarms_sentence(document: Document) -> str:
    """Whether each false alarm of a worst-case detector has its reason."""
    rows = [row for row in document["false_alarms"] if row["worst_case"]]
    total, without = (sum(row[key] for row in rows) for key in ("count", "unexplained"))
    certified, certifiable = (sum(row[key] for row in rows) for key in ("certified", "certifiable"))
    return (
        f"In all of these flights, worst-case detectors raise {total} false alarms. The reason of "
        f"{total - without} of them is an undeclared error. Of {certifiable} false alarms of the default "
        f"scheme, {certified} have a certificate."
    )


def net_row(row: Document) -> tuple[str, ...]:
    """A mechanism's row for NET_HEAD."""
    return label(row), *(cell for name in CRITERIA for cell in net_cells(row[name]))


def net_cells(found: Document) -> tuple[str, str]:
    """A net share and its interval, percentage points."""
    value, limits = estimate(found, lambda share: f"{100.0 * share:+.1f}")
    return "0.0" if value[1:] == "0.0" else value, limits


def same_row(row: Document) -> tuple[str, ...]:
    """A mechanism's row for SAME_HEAD."""
    return label(row), str(row["flights"]), str(row["same_verdict"]), str(row["same_tracking"])


def median_row(row: Document) -> tuple[str, ...]:
    """A mechanism's row for MEDIAN_HEAD."""
    medians = [row[of][which]["value"] for of in ("delay_s", "tracking_deg_s") for which in _BOTH]
    return (
        label(row),
        *(or_never(value) for value in medians),
        *estimate(row["tracking_ratio"]),
    )


_BOTH = ("with", "without")


def system_head(document: Document) -> tuple[str, ...]:
    """The head of `system_rows`: two columns a system."""
    return "quantity", *(head for system in document["systems"] for head in (system, INTERVAL))


def system_rows(document: Document) -> Rows:
    """A row a quantity of both systems."""
    systems = document["systems"].values()
    return [
        ("flights", *(cell for row in systems for cell in (str(row["flights"]), ""))),
        *(
            (words, *(cell for row in systems for cell in estimate(row[name], partial(percent, unit=""))))
            for name, words in SYSTEM_SHARES.items()
        ),
        ("error, deg/s", *(cell for row in systems for cell in estimate(row["tracking_deg_s"]))),
    ]


def alarm_rows(document: Document) -> Rows:
    """A row of what was flown for ALARM_HEAD."""
    return [
        (
            *_system_and_mechanisms(row["flown"]), str(row["count"]), str(row["undeclared"]),
            str(row["certified"]) if row["certifiable"] or not row["count"] else "-",
            str(row["unexplained"]) if row["worst_case"] else "-",
        )
        for row in document["false_alarms"]
    ]  # fmt: skip


def _system_and_mechanisms(flown: str) -> tuple[str, str]:
    """Both of a key such as "published" or "without default: bank of poles"."""
    first, _, rest = flown.partition(" ")
    system, _, mechanism = rest.partition(": ")
    return (system, f"{first} {mechanism}") if rest else (first, "all")


def margin_rows(document: Document) -> Rows:
    """A row a system, bandwidth and instruments for MARGIN_HEAD."""
    return [
        (row["system"], row["bandwidth"], row["instruments"], number(row["gain_margin_db"], none="none"),
         number(row["phase_margin_deg"], none="none"))
        for row in document["margins"]
    ]  # fmt: skip


def level_head(document: Document, factor: str) -> tuple[str, ...]:
    """The head of `level_rows`: two columns a level of a factor."""
    levels = document["factors"][factor]
    return "mechanism", *(head for value in levels for head in (_level(factor, value), INTERVAL))


def _level(factor: str, value: Any) -> str:
    return f"error {100 * value:g} %" if factor == "error" else str(value)


def level_rows(document: Document, factor: str, criterion: str, serves: str) -> Rows:
    """By level of a factor, the net share by a criterion, of the mechanisms that serve diagnosis or law."""
    return [
        (label(row), *(cell for found in row["by"][factor].values() for cell in net_cells(found[criterion])))
        for row in document["mechanisms"]
        if row["serves"] == serves
    ]


def figure_of(document: Document) -> "Figure":
    """A panel a criterion, a dot a mechanism with its interval; to the right of 0 the mechanism helps."""
    rows = document["mechanisms"]
    figure, grid = panels(1, len(CRITERIA), 13.0, 0.28 * len(rows) + 1.4, sharey=True)
    for panel, (name, words) in zip(grid[0], CRITERIA.items(), strict=True):
        for place, row in enumerate(rows):
            _dot(panel, place, row[name], SERIES[(PAPER, DEFAULT).index(row["system"])])
        panel.axvline(0.0, color="#444444", linewidth=0.8)
        panel.grid(axis="x", color=GRID, linewidth=0.6)
        panel.set_title(words, fontsize=9)
        panel.tick_params(labelsize=8)
    grid[0][0].set_yticks(range(len(rows)), [label(row) for row in rows], fontsize=8)
    grid[0][0].invert_yaxis()
    label_edges(grid, "worse without it, net points")
    for system, colour in zip((PAPER, DEFAULT), SERIES, strict=False):
        grid[0][0].plot([], [], "o", color=colour, label=f"{system} system")
    figure.legend(loc="outside lower center", ncols=2, fontsize=9, frameon=False)
    return figure


def _dot(panel: Any, place: int, found: Mapping[str, float], colour: str) -> None:
    value, low, high = (100.0 * found[key] for key in ("value", "low", "high"))
    panel.errorbar(
        [value], [place], xerr=[[value - low], [high - value]], fmt="o", markersize=4, capsize=2,
        linewidth=1.2, color=colour,
    )  # fmt: skip


def page_of(document: Document) -> tuple[str, Sequence[Part]]:
    """The title; the sentences, the figure and the tables."""
    shown = zip(CAPTIONS, tables(document), strict=True)
    return "What each mechanism is worth", [
        *sentences(document), Pictures([(CAPTIONS[1], NAME)]),
        *(part for caption, (head, rows) in shown for part in (Heading(caption), Table(head, rows))),
        Heading("Margins of the healthy loop, the least"), Table(MARGIN_HEAD, margin_rows(document)),
        versions_line(document["versions"]),
    ]  # fmt: skip


def pairs_of(document: Document) -> list[Document]:
    """The rows of the CSV file: all pairs of each mechanism."""
    left_out = ("delay_s", "tracking_deg_s", "by")
    return [{key: row[key] for key in row if key not in left_out} for row in document["mechanisms"]]


FILES = study_files(NAME, page_of, {NAME: pairs_of}, {NAME: figure_of})
