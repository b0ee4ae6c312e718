"""The effects of the loss of a mechanism: as sentences, tables, a figure and files."""

from collections.abc import Callable, Iterator
from functools import partial
from itertools import chain

from beaver_ftc.results.model import Document
from beaver_ftc.studies.present.figures import GRID, SERIES, Figure, draw_estimates, label_edges, panels
from beaver_ftc.studies.present.page import Heading, Page, Pictures, Table, study_files, table, versions_line
from beaver_ftc.studies.present.tables import Columns, bare_percent, estimate, number, number_or_never, sum_of
from beaver_ftc.studies.sensitivity.systems import DEFAULT, MECHANISMS, PAPER, SYSTEMS

NAME = "sensitivity"
CRITERION_WORDS = {  # by criterion of effects.py
    "false_alarms": "false alarms",
    "late": "late alarms",
    "names": "lost names",
    "tracking": "worse tracking",
}
INTERVAL = "95 % interval"
SYSTEM_SHARES = {
    "false_alarms": "false alarms, %", "detected": "detected, %", "named": "named rightly, %",
    "lost": "aircraft lost, %",
}  # fmt: skip
CAPTIONS = {
    "systems": "Both systems with all of their mechanisms.",
    "net": "Net share of flights that are worse without the mechanism, percentage points.",
    "same": "Pairs of flights with the same alarm, name and time of both, and with the same tracking error.",
    "medians": "Medians with and without the mechanism; error ratio: without over with.",
    "alarms": "False alarms, and how many of them are explained.",
    "margins": "Margins of the healthy loop, the least.",
}
_FACTOR_WORDS = {
    "fault": "faults", "bandwidth": "bandwidths", "error": "undeclared errors", "instruments": "instruments",
}  # fmt: skip


def page_of(document: Document) -> Page:
    """The title and the parts of the page, and of the text without its pictures."""
    table_of = tables(document)
    return "What each mechanism is worth", [
        *mechanism_sentences(document), Pictures([(CAPTIONS["net"], NAME)]),
        *(part for name, caption in CAPTIONS.items() for part in (Heading(caption), table_of[name])),
        versions_line(document["versions"]),
    ]  # fmt: skip


def mechanism_sentences(document: Document) -> Iterator[str]:
    """Sentences about the number of flights, about each mechanism, and about the reasons of false alarms."""
    names = " x ".join(f"{len(values)} {_FACTOR_WORDS[name]}" for name, values in document["factors"].items())
    yield f"{document['draws']} draws over {names}, each flown with and without every mechanism."
    yield from (mechanism_sentence(row) for row in document["mechanisms"])
    alarms = [row for row in document["false_alarms"] if row["worst_case"]]
    total, without, certified, certifiable = (
        sum_of(alarms, key) for key in ("count", "unexplained", "certified", "certifiable")
    )
    yield (
        f"In all of these flights, worst-case detectors raise {total} false alarms. The reason of "
        f"{total - without} of them is an undeclared error. Of {certifiable} false alarms of the default "
        f"scheme, {certified} have a certificate."
    )


def label(row: Document) -> str:
    """A mechanism with its system."""
    return "{mechanism} ({system})".format(**row)


def mechanism_sentence(row: Document) -> str:
    """A sentence about the criteria whose net share without a mechanism has an interval that excludes 0."""
    flights = row["flights"]
    if row["same_verdict"] == row["same_tracking"] == flights:
        return f"{label(row)}: without it all {flights} flights are the same."
    changed_criteria = {
        name: row[name] for name in CRITERION_WORDS if row[name]["low"] > 0.0 or row[name]["high"] < 0.0
    }
    if not changed_criteria:
        changed = flights - row["same_verdict"]
        differ = f"{changed} of {flights} verdicts differ" if changed else "no verdict differs"
        return f"{label(row)}: without it {differ}, and no criterion changes beyond chance."
    texts = (
        f"{CRITERION_WORDS[name]} {100 * effect['value']:+.1f} points"
        for name, effect in changed_criteria.items()
    )
    return f"{label(row)}: without it, {', '.join(texts)}."


def tables(document: Document) -> dict[str, Table]:
    """The table of each of CAPTIONS."""
    return {
        "systems": _systems_table(document["systems"]),
        "net": table(NET, document["mechanisms"]),
        "same": table(SAME, document["mechanisms"]),
        "medians": table(MEDIANS, document["mechanisms"]),
        "alarms": table(ALARMS, document["false_alarms"]),
        "margins": table(MARGINS, document["margins"]),
    }


def _systems_table(systems: Document) -> Table:
    """A row for each quantity, two columns for each system."""
    quantities = [
        ("flights", [(str(row["flights"]), "") for row in systems.values()]),
        *(
            (words, [estimate(row[name], bare_percent) for row in systems.values()])
            for name, words in SYSTEM_SHARES.items()
        ),
        ("error, deg/s", [estimate(row["tracking_deg_s"]) for row in systems.values()]),
    ]
    return Table(
        ("quantity", *(head for system in systems for head in (system, INTERVAL))),
        [(words, *chain.from_iterable(values)) for words, values in quantities],
    )


def net_points(values: Document) -> tuple[str, str]:
    """A net share and its interval, percentage points."""
    value, limits = estimate(values, lambda share: f"{100.0 * share:+.1f}")
    return "0.0" if value[1:] == "0.0" else value, limits


def _with_interval(head: str, key: str, cells: Callable[[Document], tuple[str, str]] = estimate) -> Columns:
    """The columns of an estimate and of its interval."""
    return (head, key, lambda values: cells(values)[0]), (INTERVAL, key, lambda values: cells(values)[1])


def _certified(row: Document) -> str:
    """Number of certified alarms; `-` if there are alarms, but of a scheme without certificates."""
    return str(row["certified"]) if row["certifiable"] or not row["count"] else "-"


MECHANISM = ("mechanism", label)
NET = (
    MECHANISM,
    *(column for name, words in CRITERION_WORDS.items()
      for column in _with_interval(f"{words}, points", name, net_points)),
)  # fmt: skip
SAME = (
    MECHANISM, ("flights", "flights"), ("same verdict", "same_verdict"), ("same tracking", "same_tracking"),
)  # fmt: skip
MEDIANS = (
    MECHANISM,
    ("delay with, s", "delay_s.with.value", number_or_never),
    ("delay without, s", "delay_s.without.value", number_or_never),
    ("error with, deg/s", "tracking_deg_s.with.value", number_or_never),
    ("error without, deg/s", "tracking_deg_s.without.value", number_or_never),
    *_with_interval("error ratio", "tracking_ratio"),
)
FLOWN = {  # by key of an outcome: the system, and its mechanisms in words
    **{mechanism.with_key: (mechanism.system, f"with {mechanism.name}") for mechanism in MECHANISMS},
    **{mechanism.without_key: (mechanism.system, f"without {mechanism.name}") for mechanism in MECHANISMS},
    **{system: (system, "all") for system in SYSTEMS},  # last, in place of equal keys above
}
ALARMS = (
    ("system", lambda row: FLOWN[row["flown"]][0]),
    ("mechanisms", lambda row: FLOWN[row["flown"]][1]), ("false alarms", "count"),
    ("with an undeclared error", "undeclared"), ("certified", _certified),
    ("unexplained", lambda row: str(row["unexplained"]) if row["worst_case"] else "-"),
)  # fmt: skip
MARGINS = (
    ("system", "system"), ("bandwidth", "bandwidth"), ("instruments", "instruments"),
    ("gain margin, dB", "gain_margin_db", partial(number, none="none")),
    ("phase margin, deg", "phase_margin_deg", partial(number, none="none")),
)  # fmt: skip


def draw_mechanisms(document: Document) -> Figure:
    """A panel for each criterion, a dot with its interval for each mechanism. To the right of 0, the
    mechanism helps."""
    rows = document["mechanisms"]
    figure, grid = panels(1, len(CRITERION_WORDS), 13.0, 0.28 * len(rows) + 1.4, sharey=True)
    for panel, (name, words) in zip(grid[0], CRITERION_WORDS.items(), strict=True):
        for colour, system in zip(SERIES, (PAPER, DEFAULT), strict=False):
            places = [place for place, row in enumerate(rows) if row["system"] == system]
            draw_estimates(
                panel, places, [rows[place][name] for place in places], 100.0, across=True, fmt="o",
                markersize=4, capsize=2, linewidth=1.2, color=colour, label=f"{system} system",
            )  # fmt: skip
        panel.axvline(0.0, color="#444444", linewidth=0.8)
        panel.grid(axis="x", color=GRID, linewidth=0.6)
        panel.set_title(words, fontsize=9)
        panel.tick_params(labelsize=8)
    grid[0][0].set_yticks(range(len(rows)), [label(row) for row in rows], fontsize=8)
    grid[0][0].invert_yaxis()
    label_edges(grid, "worse without it, net points")
    entries = grid[0][0].get_legend_handles_labels()
    figure.legend(*entries, loc="outside lower center", ncols=2, fontsize=9, frameon=False)
    return figure


def pairs_of(document: Document) -> list[Document]:
    """The rows of the CSV file: all pairs of each mechanism."""
    left_out = ("delay_s", "tracking_deg_s", "by")
    return [{key: row[key] for key in row if key not in left_out} for row in document["mechanisms"]]


FILES = study_files(NAME, page_of, {NAME: pairs_of}, {NAME: draw_mechanisms})
