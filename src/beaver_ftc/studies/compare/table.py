"""The comparison as tables."""

from collections.abc import Callable, Sequence
from typing import Any

from beaver_ftc.studies.compare.trial import LAW, SCHEME
from beaver_ftc.studies.present.tables import aligned

Document = dict[str, Any]
Cell = Callable[[Document, Document], str]


def _share(value: float | None) -> str:
    return "-" if value is None else f"{100 * value:.0f}"


def _seconds(value: float | None) -> str:
    return "never" if value is None else f"{value:.2f}"


def _alarms(row: Document, _: Document) -> str:
    rate, upper = row["false_alarms_per_h"], row["false_alarms_per_h_upper"]
    return "-" if rate is None else f"{rate:.3g} (<{upper:.2g})"


def _of_faults(show: Callable[[Document], str]) -> Cell:
    return lambda row, _: show(row) if row["faults"] else "-"


def _free(row: Document, part: Document) -> str:
    point = part["without_false_alarm"].get(row["scheme"])
    if point is None or not row["faults"]:
        return "-"
    return f"{_share(point['detection_rate'])} / {_seconds(point['delay_median_s'])}"


def _ratio(row: Document, _: Document) -> str:
    def shown(value: float | None) -> str:
        return "lost" if value is None else f"{value:.2f}"

    return f"{shown(row['ratio_median'])} / {shown(row['ratio_90'])}"


def _rate(value: float | None) -> str:
    return "-" if value is None else f"{value:.3g}"


def _pair(part: str) -> Cell:
    """Median and 90 % of the tracking error of a part of the flight."""
    return lambda row, _: f"{_rate(row.get(part + '_median'))} / {_rate(row.get(part + '_90'))}"


DIAGNOSIS: tuple[tuple[str, Cell], ...] = (
    ("scheme", lambda row, _: row["scheme"]),
    ("false alarms/h (95 %)", _alarms),
    ("detected %", _of_faults(lambda row: _share(row["detection_rate"]))),
    (
        "delay s 50/90 %",
        _of_faults(lambda row: f"{_seconds(row['delay_median_s'])} / {_seconds(row['delay_90_s'])}"),
    ),
    ("isolated %", _of_faults(lambda row: _share(row["isolation_rate"]))),
    ("with no false alarm: detected % / delay s", _free),
    ("tracking/oracle 50/90 %", _ratio),
    ("lost", lambda row, _: str(row["departures"])),
    ("us/frame", lambda row, _: f"{row['us']:.0f}"),
)
CONTROL: tuple[tuple[str, Cell], ...] = (
    ("law", lambda row, _: row["law"]),
    *DIAGNOSIS[6:],
    ("error before, deg/s 50/90 %", _pair("before")),
    ("after", _pair("after")),
    ("travel deg/s", lambda row, _: _rate(row.get("travel_median"))),
    ("energy deg2/s2", lambda row, _: _rate(row.get("energy_median"))),
)


def sections(part: Document) -> list[tuple[list[str], list[list[str]]]]:
    """(header, rows) of the schemes with our law, and of the laws with our scheme."""
    schemes = [row for row in part["lines"] if row["law"] == LAW]
    laws = [row for row in part["lines"] if row["scheme"] == SCHEME]
    return [_section(DIAGNOSIS, schemes, part), _section(CONTROL, laws, part)]


def _section(
    columns: Sequence[tuple[str, Cell]], rows: Sequence[Document], part: Document
) -> tuple[list[str], list[list[str]]]:
    return [name for name, _ in columns], [[cell(row, part) for _, cell in columns] for row in rows]


def as_text(document: Document) -> str:
    """For a terminal."""
    blocks = []
    for name, part in document["sets"].items():
        blocks.append(f"{name}: {part['flights']} flights")
        blocks += [aligned([header, *rows]) + "\n" for header, rows in sections(part)]
        blocks += part["better_than_ours"] + [f"could not fly: {error}" for error in part["errors"]]
        blocks.append("")
    return "\n".join(blocks)
