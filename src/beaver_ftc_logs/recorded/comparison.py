"""Tables, page and figure of the benchmark on recorded flights, from its document (`benchmark`); tables and
page of the other days made of them (`other_days`)."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from beaver_ftc.results import SERIES_COLOURS as SERIES
from beaver_ftc.results import Document, as_json
from beaver_ftc.studies.present import (
    GRID,
    Files,
    aligned,
    markdown_table,
    marker,
    panels,
    replace_between,
    tabulated,
)
from beaver_ftc_logs.energy import ENGINE
from beaver_ftc_logs.recorded.benchmark import LABEL_TITLES

# A table: the headers of its columns, and the cells of each row.
HeaderAndRows = tuple[list[str], list[list[str]]]
# Function from a row of the document to the text of a cell.
Cell = Callable[[Document], str]
_SHOWN_DELAY_S = 30.0  # longer delays share one place at the right of the figure


def result_files(document: Document) -> Files:
    """The document, its tables and its figure."""
    return {
        "flights.png": draw_comparison_figure(document),
        "flights.json": as_json(document),
        "flights.md": as_markdown(document),
    }


def score_tables(document: Document) -> list[tuple[str, HeaderAndRows]]:
    """A title and a table for each data set."""
    if "other_days" in document:
        return _tables_of_other_days(document["other_days"])
    tables = []
    for data in document["sets"]:
        columns = LABEL_COLUMNS if data["scored_by"] == "labels" else FAILURE_COLUMNS
        table = tabulated(columns, [*data["rows"], *data["published"]])
        tables.append((f"{data['set']}: left out, {data['left_out']}", table))
    return tables


def _tables_of_other_days(document: Document) -> list[tuple[str, HeaderAndRows]]:
    """A title and a table for each data set: every day with one change, then mean and worst of each kind."""
    columns = (("day", "day"), *LABEL_SHARES, ("classes by sliding least squares", _share("beside")))
    tables = []
    for data in document["sets"]:
        days = [day for day in data["rows"] if day["kind"] == "one change"]
        for summary in data["summary"]:
            days += [summary[key] | {"day": f"{summary['kind']}: {key}"} for key in ("mean", "worst")]
        title = f"{data['set']}: other days made of it, each part left out in turn"
        tables.append((title, tabulated(columns, days)))
    return tables


def _share(key: str) -> Cell:
    """Cells of a score with three digits; empty if the row does not have it."""
    return lambda row: "" if row.get(key) is None else f"{row[key]:.3f}"


def _delay(kind: str) -> Cell:
    """Cells of the mean delay, s, for a kind of surface, with the numbers of failures that were found and of
    all if both are known. Without a delay: `not found` if there were failures, otherwise empty."""

    def cell_of(row: Document) -> str:
        delay = row["delay_s"].get(kind, {})
        if delay.get("mean") is None:
            return "not found" if delay.get("failures") else ""
        return f"{delay['mean']:.1f}" + (
            " ({found} of {failures})".format(**delay) if "found" in delay else ""
        )

    return cell_of


def _ours(text_of: Cell) -> Cell:
    """Cells only for methods that the benchmark ran; empty for published ones."""
    return lambda row: text_of(row) if "false_alarms_per_hour" in row else ""


def _soon_text(row: Document) -> str:
    """How many failures of ailerons and rudders were found within 5 s, of all of them."""
    delays = [row["delay_s"][kind] for kind in ("aileron", "rudder")]
    return " of ".join(str(sum(delay[key] for delay in delays)) for key in ("within_5_s", "failures"))


# Columns of tables: (header, key of the text in a row, or function from a row to the text).
LABEL_SHARES = tuple((title, _share(key)) for key, title in LABEL_TITLES.items())
LABEL_COLUMNS = (("method", "method"), *LABEL_SHARES)
FAILURE_COLUMNS = (
    ("method", "method"),
    ("precision", _share("precision")),
    ("recall", _share("recall")),
    ("accuracy", _share("accuracy")),
    ("mean delay, s: aileron", _delay("aileron")),
    ("rudder", _delay("rudder")),
    ("elevator", _delay("elevator")),
    ("ailerons and rudders within 5 s", _ours(_soon_text)),
    (
        "false alarms an hour (95 %)",
        _ours(lambda row: "{value:.1f} ({low:.1f} to {high:.1f})".format(**row["false_alarms_per_hour"])),
    ),
    (
        "healthy flights with an alarm",
        _ours(lambda row: f"{row['healthy_flights_with_an_alarm']} of {row['healthy_flights']}"),
    ),
    ("wrong group", _ours(lambda row: str(row["wrong_group"]))),
)


def as_text(document: Document) -> str:
    """The tables for a terminal."""
    return "\n".join(f"{title}\n{aligned([head, *rows])}\n" for title, (head, rows) in score_tables(document))


def as_markdown(document: Document) -> str:
    """The tables for a Markdown page."""
    tables = score_tables(document)
    return "\n".join(f"### {title}\n\n{markdown_table(head, rows)}\n" for title, (head, rows) in tables)


def update_page(document: Document, page: Path) -> None:
    """Put the tables between the marks of a Markdown page. Raises BadInput where it has none."""
    name = "other days" if "other_days" in document else "recorded flights"
    replace_between(page, f"<!-- {name}: begin -->", f"<!-- {name}: end -->", as_markdown(document))


def draw_comparison_figure(document: Document) -> Any:
    """A panel for each data set: the delay of each method on each failure or, for labelled flights, the
    shares of rows that are right.
    """
    data_sets = document["sets"]
    height = sum(0.27 * len(_method_titles(data)) + 1.3 for data in data_sets)
    figure, axes = panels(len(data_sets), 1, 8.6, height)
    for axis, data in zip(axes[:, 0], data_sets, strict=True):
        draw, shown = (
            (_draw_shares, "rows that are right")
            if data["scored_by"] == "labels"
            else (_draw_failure_delays, "delay of each method on each failure")
        )
        draw(axis, data)
        axis.set_title(f"{data['set']}: {shown}", fontsize=10, loc="left")
        titles = _method_titles(data)
        axis.set_yticks(range(len(titles)), titles)
        axis.set_ylim(len(titles) - 0.5, -0.5)
        axis.tick_params(labelsize=8)
        axis.grid(color=GRID, linewidth=0.5)
        axis.set_axisbelow(True)
        if axis.lines:
            axis.legend(fontsize=8, loc="upper left", bbox_to_anchor=(1.0, 1.0), frameon=False)
    return figure


def _method_titles(data: Document) -> list[str]:
    """The methods of a panel. For published methods only scores are known, not the delay on each failure, so
    a panel of delays leaves them out.
    """
    published = data["published"] if data["scored_by"] == "labels" else ()
    return [row["method"] for row in (*data["rows"], *published)]


def _draw_failure_delays(axis: Any, data: Document) -> None:
    """Draw a row for each method, with a mark for each failure of surfaces at its delay. The grey area at the
    right has the failures that were not found within _SHOWN_DELAY_S.
    """
    titles = _method_titles(data)
    logged = dict.fromkeys(row["failure"] for row in data["flights"])
    failures = [failure for failure in logged if failure and ENGINE not in failure]
    for i, failure in enumerate(failures):
        shift = 0.7 * ((i + 0.5) / len(failures) - 0.5)
        entries = [row for row in data["flights"] if row["failure"] == failure and row["method"] in titles]
        delays_s = [np.inf if entry["delay_s"] is None else entry["delay_s"] for entry in entries]
        delays_s = [min(delay, _SHOWN_DELAY_S + 1.0) for delay in delays_s]
        heights = [titles.index(entry["method"]) + shift for entry in entries]
        label = failure.replace("_", " ").replace("+", " + ")
        axis.plot(delays_s, heights, marker(i), color=SERIES[i % len(SERIES)], label=label)
    axis.axvspan(_SHOWN_DELAY_S, _SHOWN_DELAY_S + 2.0, color=GRID)
    axis.set_xlim(-0.5, _SHOWN_DELAY_S + 2.0)
    axis.set_xlabel(f"delay, s (grey: not found within {_SHOWN_DELAY_S:g} s)", fontsize=9)


def _draw_shares(axis: Any, data: Document) -> None:
    """Draw a row for each method, published ones included, with a mark for each share of the rows that are
    right."""
    labels = {"classes": "class", "healthy_or_faulty": "healthy or faulty", "side": "side of the aircraft"}
    rows = [*data["rows"], *data["published"]]
    for i, (key, label) in enumerate(labels.items()):
        scored = [k for k, row in enumerate(rows) if row.get(key) is not None]
        heights = [k + 0.22 * (i - 1) for k in scored]
        axis.plot([rows[k][key] for k in scored], heights, marker(i), color=SERIES[i], label=label)
    axis.set_xlim(0, 1)
    axis.set_xlabel("share of the rows that are right", fontsize=9)
