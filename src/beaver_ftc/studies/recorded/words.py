"""The benchmark as tables: for a terminal, for the documentation."""

from pathlib import Path
from typing import Any

from beaver_ftc.documents.errors import BadInput
from beaver_ftc.studies.recorded import robustness

Document = dict[str, Any]
Table = tuple[list[str], list[list[str]]]


def tables(document: Document) -> list[tuple[str, Table]]:
    """A title and a table for each data set."""
    if "other_days" in document:
        return robustness.tables(document["other_days"])
    found = []
    for part in document["sets"]:
        by_labels = part["scored_by"] == "labels"
        table = _labels(part) if by_labels else _events(part)
        found.append((f"{part['set']}: left out, {part['left_out']}", table))
    return found


def _labels(part: Document) -> Table:
    header = ["method", "classes", "healthy or faulty", "side", "mean error", "held by 90 % bounds"]
    keys = ("classes", "healthy_or_faulty", "side", "mean_error", "held_by_bounds")
    rows = [
        [row["method"], *(_number(row.get(key)) for key in keys)]
        for row in [*part["rows"], *part["published"]]
    ]
    return header, rows


def _events(part: Document) -> Table:
    header = [
        "method", "precision", "recall", "accuracy", "mean delay, s: aileron", "rudder", "elevator",
        "ailerons and rudders within 5 s", "false alarms an hour (95 %)", "healthy flights with an alarm",
        "wrong group",
    ]  # fmt: skip
    return header, [_event_row(row) for row in [*part["rows"], *part["published"]]]


def _event_row(row: Document) -> list[str]:
    delays = row["delay_s"]
    alarms = row.get("false_alarms_per_hour")
    lateral = [delays[kind] for kind in ("aileron", "rudder") if "within_5_s" in delays.get(kind, {})]
    return [
        row["method"],
        *(_number(row.get(key)) for key in ("precision", "recall", "accuracy")),
        *(_delay(delays.get(kind, {})) for kind in ("aileron", "rudder", "elevator")),
        f"{sum(x['within_5_s'] for x in lateral)} of {sum(x['failures'] for x in lateral)}"
        if lateral
        else "",
        f"{alarms['value']:.1f} ({alarms['low']:.1f} to {alarms['high']:.1f})" if alarms else "",
        f"{row['healthy_flights_with_an_alarm']} of {row['healthy_flights']}" if alarms else "",
        str(row.get("wrong_group", "")),
    ]


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:.3f}"


def _delay(known: Document) -> str:
    if known.get("mean") is None:
        return "not found" if known.get("failures") else ""
    count = f" ({known['found']} of {known['failures']})" if "found" in known else ""
    return f"{known['mean']:.1f}{count}"


def as_text(document: Document) -> str:
    """The tables for a terminal."""
    lines: list[str] = []
    for title, (header, rows) in tables(document):
        widths = [max(len(row[i]) for row in [header, *rows]) for i in range(len(header))]
        lines += [title, *("  ".join(c.ljust(w) for c, w in zip(r, widths, strict=True)).rstrip()
                           for r in [header, *rows]), ""]  # fmt: skip
    return "\n".join(lines)


def as_markdown(document: Document) -> str:
    """The tables for a Markdown page."""
    lines: list[str] = []
    for title, (header, rows) in tables(document):
        lines += [f"### {title}", "", _row(header), _row(["---"] * len(header)), *map(_row, rows), ""]
    return "\n".join(lines)


def _row(cells: list[str]) -> str:
    return f"| {' | '.join(cells)} |"


def marks(document: Document) -> tuple[str, str]:
    """What stands before and after the tables in a page."""
    name = "other days" if "other_days" in document else "recorded flights"
    return f"<!-- {name}: begin -->", f"<!-- {name}: end -->"


def update_page(document: Document, page: Path) -> None:
    """Put the tables between the marks of a Markdown page. Raises BadInput where it has none."""
    begin, end = marks(document)
    text = page.read_text(encoding="utf-8") if page.is_file() else ""
    if begin not in text or end not in text:
        raise BadInput(f"{page}: has no place for the tables, allowed: a page with {begin} and {end}")
    before, _, rest = text.partition(begin)
    _, _, after = rest.partition(end)
    page.write_text(f"{before}{begin}\n{as_markdown(document)}{end}{after}", encoding="utf-8")
