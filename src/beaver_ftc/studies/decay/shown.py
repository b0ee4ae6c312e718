"""The decay of a verdict as sentences, a table, a figure and files."""

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from operator import itemgetter
from typing import TYPE_CHECKING, Any

from beaver_ftc.results.model import Document
from beaver_ftc.results.style import BLACK
from beaver_ftc.studies.present.figures import GRID, label_edges, panels
from beaver_ftc.studies.present.page import Part, Pictures, Table, study_files, versions_line
from beaver_ftc.studies.present.tables import aligned, estimate, grouped, or_never, percent

if TYPE_CHECKING:
    from matplotlib.figure import Figure

NAME = "decay"
HEAD = (
    "error", "declared", "times", "flights", "false alarms, %", "detected, %", "named rightly, %",
    "named wrongly, %", "delay, s", "tracking RMS, deg/s", "bound used, %",
)  # fmt: skip
CAPTION = (
    "In brackets 95 % intervals. Delay, tracking and bound used are medians: of the flights in which the "
    "aircraft is lost the tracking error is infinite. The bound used is the part of the detection bound that "
    "the healthy part of a flight takes."
)
SHOWN = (
    ("false_alarm", "false alarms, %"),
    ("named", "named rightly, %"),
    ("tracking_deg_s", "RMS rate error, deg/s"),
)


def as_text(document: Document) -> str:
    """What changes first, and the table."""
    return "\n".join([*sentences(document), "", aligned([HEAD, *map(cells, document["rows"])]), "", CAPTION])


def sentences(document: Document) -> Iterator[str]:
    """What holds as declared, and the least factor at which an error changes the verdict."""
    errors = list(grouped(document["rows"], "error").values())
    alarms, misnamed = (_count(errors[-1][0], name) for name in ("false_alarm", "misnamed"))
    yield (
        f"{document['scenario']}: with every error at the limit of what is declared, {alarms} flights have a "
        f"false alarm and {misnamed} a wrong name."
    )
    yield from map(_onset, errors)


def _count(row: Document, name: str) -> str:
    return f"{row[name]['count']} of {row[name]['of']}"


def _onset(rows: Sequence[Document]) -> str:
    """The least factor with a false alarm or a wrong name, of one error."""
    what, declared = rows[0]["error"], rows[0]["declared"]
    unknown = declared.startswith("none; ")
    size = "the unit" if unknown else "the declared size"
    head = f"{what} ({declared.replace('none', 'not declared', 1)})" if unknown else f"{what} ({declared})"
    broken = next((row for row in rows if row["false_alarm"]["count"] or row["misnamed"]["count"]), None)
    if broken is None:
        most = rows[-1]["factor"]
        return f"{head}: no false alarm and no wrong name up to {most:g} times {size}."
    alarms, misnamed = (_count(broken, name) for name in ("false_alarm", "misnamed"))
    return (
        f"{head}: an error of {broken['factor']:g} times {size} gives a false alarm in {alarms} flights "
        f"and a wrong name in {misnamed}."
    )


def cells(row: Document) -> tuple[str, ...]:
    """One row for HEAD."""
    return (
        row["error"], row["declared"], f"{row['factor']:g}", str(row["flights"]),
        *(_share(row[name]) for name in ("false_alarm", "detected", "named", "misnamed")),
        *(_interval(row[name]) for name in ("delay_s", "tracking_deg_s")),
        _interval(row["bound_used"], _used),
    )  # fmt: skip


def _share(found: Document) -> str:
    return "{} ({})".format(*estimate(found, partial(percent, unit="")))


def _used(share: float | None) -> str:
    return or_never(share and 100.0 * share)


def _interval(found: Document, form: Callable[[Any], str] = or_never) -> str:
    value, limits = estimate(found, form)
    return value if found["value"] is None or found["low"] == found["high"] else f"{value} ({limits})"


def figure_of(document: Document) -> "Figure":
    """A row a quantity, a column an error, over the factor; bars are intervals."""
    errors = [*grouped(document["rows"], "error").values()]
    titles = [f"{rows[0]['error']}\n{rows[0]['declared']}" for rows in errors]
    title = f"{document['scenario']}: errors larger than declared"
    size = 0.8 + 1.9 * len(errors), 0.9 + 1.5 * len(SHOWN)
    figure, grid = panels(len(SHOWN), len(errors), *size, title, sharex=True, sharey="row")
    for line, (quantity, _) in zip(grid, SHOWN, strict=True):
        for panel, rows in zip(line, errors, strict=True):
            _curve(panel, rows, quantity)
            panel.set_xscale("log", base=2)
            panel.set_xticks(document["factors"], [f"{factor:g}" for factor in document["factors"]])
            panel.minorticks_off()
            panel.grid(color=GRID, linewidth=0.6)
    label_edges(grid, "times the size", [label for _, label in SHOWN], titles)
    return figure


def _curve(panel: Any, rows: Sequence[Document], quantity: str) -> None:
    times = 1.0 if quantity.endswith("_deg_s") else 100.0
    known = [row for row in rows if None not in (row[quantity]["value"], row[quantity]["low"])]
    value, low, high = (
        [float("nan") if row[quantity][key] is None else times * row[quantity][key] for row in known]
        for key in ("value", "low", "high")
    )
    bars = [
        [middle - end for middle, end in zip(value, low, strict=True)],
        [end - middle for middle, end in zip(value, high, strict=True)],
    ]
    at = [row["factor"] for row in known]
    panel.errorbar(at, value, bars, color=BLACK, marker="o", markersize=4, linewidth=1.2, capsize=2)


def page_of(document: Document) -> tuple[str, Sequence[Part]]:
    """The title; the sentences, the table and the figure."""
    return f"Beyond what is declared: {document['scenario']}", [
        *sentences(document), Table(HEAD, [list(cells(row)) for row in document["rows"]]), CAPTION,
        Pictures([("False alarms, right names and tracking over the factor", NAME)]),
        versions_line(document["versions"]),
    ]  # fmt: skip


FILES = study_files(NAME, page_of, {NAME: itemgetter("rows")}, {NAME: figure_of})
