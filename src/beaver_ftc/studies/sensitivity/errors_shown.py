"""The effects of larger errors: as sentences, a table, a figure and files."""

from collections.abc import Callable, Iterator, Sequence
from operator import itemgetter
from typing import Any

from beaver_ftc.results.model import Document
from beaver_ftc.results.style import BLACK
from beaver_ftc.studies.present.figures import GRID, Figure, draw_estimates, label_edges, panels
from beaver_ftc.studies.present.page import Page, Pictures, study_files, table, versions_line
from beaver_ftc.studies.present.tables import bare_percent, estimate, grouped, number_or_never, values_of

NAME = "sensitivity"
CAPTION = (
    "In brackets 95 % intervals. Delay, tracking and bound used are medians: of the flights in which the "
    "aircraft is lost the tracking error is infinite. The bound used is the part of the detection bound that "
    "the healthy part of a flight takes."
)
SHOWN = {
    "false_alarm": "false alarms, %", "named": "named rightly, %", "tracking_deg_s": "RMS rate error, deg/s",
}  # fmt: skip


def page_of(document: Document) -> Page:
    """The title and the parts of the page, and of the text without its pictures."""
    return f"Beyond what is declared: {document['scenario']}", [
        *error_sentences(document), table(COLUMNS, document["rows"]), CAPTION,
        Pictures([("False alarms, right names and tracking over the factor", NAME)]),
        versions_line(document["versions"]),
    ]  # fmt: skip


def error_sentences(document: Document) -> Iterator[str]:
    """A sentence about the flights with all declared errors at their limit, and one for each error: the
    smallest factor with a false alarm or a wrong name."""
    errors = list(grouped(document["rows"], "error").values())
    alarms, misnamed = _counts(errors[-1][0])
    yield (
        f"{document['scenario']}: with every error at the limit of what is declared, {alarms} flights have a "
        f"false alarm and {misnamed} a wrong name."
    )
    undeclared = [error["error"] for error in document["errors"] if not error["is_declared"]]
    for rows in errors:
        yield _onset(rows, rows[0]["error"] not in undeclared)


def _counts(row: Document) -> list[str]:
    """How many flights have a false alarm, and how many a wrong name."""
    return ["{count} of {of}".format(**row[name]) for name in ("false_alarm", "misnamed")]


def _onset(rows: Sequence[Document], is_declared: bool) -> str:
    """A sentence about the smallest factor of one error with a false alarm or a wrong name. rows: by
    increasing factor."""
    size = "the declared size" if is_declared else "the unit"
    head = "{error} ({declared})".format(**rows[0]).replace("(none; ", "(not declared; ", 1)
    broken = next((row for row in rows if row["false_alarm"]["count"] or row["misnamed"]["count"]), None)
    if broken is None:
        return f"{head}: no false alarm and no wrong name up to {rows[-1]['factor']:g} times {size}."
    alarms, misnamed = _counts(broken)
    return (
        f"{head}: an error of {broken['factor']:g} times {size} gives a false alarm in {alarms} flights "
        f"and a wrong name in {misnamed}."
    )


def _share(values: Document) -> str:
    """A share with its interval, per cent."""
    return "{} ({})".format(*estimate(values, bare_percent))


def _interval(values: Document, form: Callable[[Any], str] = number_or_never) -> str:
    """A median with its interval, unless the median is infinite or the interval has no width."""
    value, limits = estimate(values, form)
    return value if values["value"] is None or values["low"] == values["high"] else f"{value} ({limits})"


def _used(values: Document) -> str:
    """A share of the bound with its interval, per cent."""
    return _interval(values, lambda share: number_or_never(share and 100.0 * share))


COLUMNS = (
    ("error", "error"), ("declared", "declared"), ("times", "factor"), ("flights", "flights"),
    ("false alarms, %", "false_alarm", _share), ("detected, %", "detected", _share),
    ("named rightly, %", "named", _share), ("named wrongly, %", "misnamed", _share),
    ("delay, s", "delay_s", _interval), ("tracking RMS, deg/s", "tracking_deg_s", _interval),
    ("bound used, %", "bound_used", _used),
)  # fmt: skip


def draw_errors(document: Document) -> Figure:
    """A row of panels for each quantity, a column for each error, over the factor. Bars are intervals; a
    value that is infinite has no point."""
    errors = [*grouped(document["rows"], "error").values()]
    titles = ["{error}\n{declared}".format(**rows[0]) for rows in errors]
    title = f"{document['scenario']}: errors larger than declared"
    figure, grid = panels(
        len(SHOWN),
        len(errors),
        0.8 + 1.9 * len(errors),
        0.9 + 1.5 * len(SHOWN),
        title,
        sharex=True,
        sharey="row",
    )
    for line, quantity in zip(grid, SHOWN, strict=True):
        times = 1.0 if quantity.endswith("_deg_s") else 100.0
        for panel, rows in zip(line, errors, strict=True):
            drawn_rows = [row for row in rows if None not in (row[quantity]["value"], row[quantity]["low"])]
            draw_estimates(
                panel, values_of(drawn_rows, "factor"), values_of(drawn_rows, quantity), times,
                color=BLACK, marker="o", markersize=4, linewidth=1.2, capsize=2,
            )  # fmt: skip
            panel.set_xscale("log", base=2)
            panel.set_xticks(document["factors"], [f"{factor:g}" for factor in document["factors"]])
            panel.minorticks_off()
            panel.grid(color=GRID, linewidth=0.6)
    label_edges(grid, "times the size", list(SHOWN.values()), titles)
    return figure


FILES = study_files(NAME, page_of, {NAME: itemgetter("rows")}, {NAME: draw_errors})
