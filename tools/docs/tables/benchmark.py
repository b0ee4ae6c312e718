"""The tables of benchmark.md: what schemes find and how laws track; better numbers of rivals are bold."""

from collections.abc import Callable
from functools import partial
from typing import Any

from beaver_ftc.plugins import DETECTORS, LAWS, registered
from beaver_ftc.studies.compare.scores import document_of
from beaver_ftc.studies.compare.sets import SetFlight, of_set
from beaver_ftc.studies.compare.trial import LAW, SCHEME, STATISTICAL, Entry, entries_of, fly_case
from beaver_ftc.studies.engine.statistics import CONFIDENCE, poisson_bound, wilson
from beaver_ftc.studies.engine.study import fly_all
from beaver_ftc.studies.present.page import Table
from beaver_ftc.studies.present.tables import estimate, markdown_table
from tools.docs.tables import aside

Document = dict[str, Any]
Rows = dict[str, dict[str, Document]]  # set -> scheme or law -> its line
EXACT = ("published", "envelope", "fault-types", "realism", "healthy")
SHOWN = (*EXACT, "air-still", "air-light", "air-moderate")
HIDDEN = (
    "none",
    "oracle",
    "fault-tolerant-published",
    "oracle-published",
)  # the yardsticks, and parts of ours
PROBED = ("published", "realism", "air-light")  # one of each grade that is tuned
PROBED_S = 30.0  # the longest flight of the probe: flights of a minute without a fault are left out
NO_SCHEME = "none"
SHARES = (1.0, 0.92, 0.75, 0.5, 0.42)  # of which a table has intervals
BOLD = "in brackets: faulted flights; bold: a rival's number is better than that of"
_RATIO = "Tracking error divided by the oracle's in the same flight, median; below 1: better than the oracle"
_RATIO_90 = "Tracking error divided by the oracle's, not exceeded in 90 % of the flights"
_SHARES = "Wilson 95 % intervals of the shares in Tables 2 and 3, %"
_LOWER, _UPPER = "Lower 95 % limit of the median {}", "Upper 95 % limit of the median {}"
ALONE = f"{LAW}, no scheme"  # our law without any diagnosis
PASSIVE_LAWS = ("nominal", "lqr", "indi", ALONE)  # fixed gains, and nothing from a diagnosis


def benchmark() -> str:
    """The standard sets that the page shows, flown by every scheme and by every law."""
    return _tables(_compared([case for name in SHOWN for case in of_set(name)]))


def benchmark_probe() -> str:
    """One flight of each sweep of a set of each grade: a change of any number of theirs shows here first."""
    cases = [case for name in PROBED for case in of_set(name, 1)]
    return _tables(_compared([case for case in cases if case.scenario.duration_s <= PROBED_S], workers=1))


def _compared(cases: list[SetFlight], workers: int = 2) -> Document:
    """Everybody on these flights, as tuned.json has them."""
    entries = everybody()
    trials = fly_all(partial(fly_case, entries=entries, trade_off=False), cases, workers)
    return document_of(trials, entries)


def everybody() -> list[Entry]:
    """Each scheme with our law, each law with our scheme, and our law without any scheme."""
    schemes = [name for name in (*registered(DETECTORS), STATISTICAL) if name not in HIDDEN]
    laws = [name for name in registered(LAWS) if name not in HIDDEN]
    return [*entries_of(schemes, laws), Entry(NO_SCHEME, LAW)]


def _form(form: str, none: str, factor: float = 1.0) -> Callable[[Any], str]:
    return lambda value: none if value is None else format(factor * value, form)


_percent, _seconds, _ratio = _form(".0f", "-", 100.0), _form(".2f", "never"), _form(".2f", "lost")


def _tables(document: Document) -> str:
    """The tables of the page."""
    sets = {name: document["sets"][name]["lines"] for name in SHOWN if name in document["sets"]}
    faulted = {name: lines for name, lines in sets.items() if lines[0]["faults"]}
    every = {name: _by("scheme", lines, law=LAW) for name, lines in sets.items()}
    schemes = {name: every[name] for name in faulted}
    laws = {
        name: _by("law", lines, scheme=SCHEME) | {ALONE: _by("law", lines, scheme=NO_SCHEME)[LAW]}
        for name, lines in faulted.items()
    }
    return "\n\n".join([
        _block(2, "Faults detected, %", schemes, "detection_rate", _percent, more=True),
        _block(3, "Faults named correctly at the end, %", schemes, "isolation_rate", _percent, more=True),
        _block(4, "Median delay of the alarm, s", schemes, "delay_median_s", _seconds, more=False),
        _alarms(5, every),
        _block(6, _RATIO, laws, "ratio_median", _ratio, more=False),
        _block(7, _RATIO_90, laws, "ratio_90", _ratio, more=False),
        "\n".join([
            aside("benchmark-shares", _SHARES, _rates(faulted)),
            aside("benchmark-delays", _UPPER.format("delay of Table 4, s"),
                  _cells(schemes, "delay_median_high_s", _seconds)),
            aside("benchmark-ratios-low", _LOWER.format("ratio of Table 6"),
                  _cells(laws, "ratio_median_low", _ratio)),
            aside("benchmark-ratios-high", _UPPER.format("ratio of Table 6"),
                  _cells(laws, "ratio_median_high", _ratio)),
        ]),
    ])  # fmt: skip


def _by(part: str, lines: list[Document], **other: str) -> dict[str, Document]:
    """The lines with this other part, by scheme or by law."""
    return {row[part]: row for row in lines if row[part] not in HIDDEN and other.items() <= row.items()}


def _block(number: int, title: str, rows: Rows, key: str, cell: Callable[[Any], str], more: bool) -> str:
    """A caption, a table of one number a cell, and the best rival of each set in which one is better than
    ours. more: whether more is better.
    """
    ours = SCHEME if SCHEME in next(iter(rows.values())) else LAW
    better = {
        name: {
            rival: row[key] for rival, row in of.items()
            if rival not in (ours, STATISTICAL, ALONE) and _less(of[ours].get(key), row.get(key), more)
        }
        for name, of in rows.items()
    }  # fmt: skip

    def said(row: Document) -> str:
        limits = [cell(limit) for limit in _limits(row, key)]
        return f"{cell(row.get(key))} ({' to '.join(limits)})" if limits else cell(row.get(key))

    best = {
        name: (max if more else min)(of, key=lambda rival: of[rival]) for name, of in better.items() if of
    }
    found = [
        f"`{rival}` in `{name}`, {said(rows[name][rival])} against {said(rows[name][ours])}"
        for name, rival in best.items()
    ]
    rest = "" if len(found) == len(rows) else f" In the other sets no rival is better than `{ours}`."
    return "\n\n".join([
        _caption(number, f"{title}; {BOLD} `{ours}`"),
        markdown_table(*_cells(rows, key, cell, better)[:2]),
        f"Better than `{ours}` are: {'; '.join(found)}.{rest}" if found
        else f"In no set is a rival better than `{ours}`.",
    ])  # fmt: skip


def _cells(rows: Rows, key: str, cell: Callable[[Any], str], bold: Document | None = None) -> Table:
    """A row for each scheme or law, a column for each set. bold: of each set, who is."""
    head = [f"{name} ({next(iter(of.values()))['faults']})" for name, of in rows.items()]
    body = [
        [f"{name} (passive)" if name in PASSIVE_LAWS else name] + [
            f"**{cell(of[name].get(key))}**" if bold and name in bold[where] else cell(of[name].get(key))
            for where, of in rows.items()
        ]
        for name in next(iter(rows.values()))
    ]  # fmt: skip
    return Table(("", *head), body)


def _limits(row: Document, key: str) -> tuple[Any, ...]:
    """Lower and upper 95 % limit of a number of a row, if it has them."""
    if key == "isolation_rate":
        found = wilson(row["isolated"], row["faults"])
        return found.low, found.high
    stem, unit = (key[:-2], "_s") if key.endswith("_s") else (key, "")
    names = [f"{stem}_{side}{unit}" for side in ("low", "high")]
    return tuple(row[name] for name in names) if set(names) <= set(row) else ()


def _caption(number: int, title: str) -> str:
    return f"*Table {number}. {title}.*"


def _less(ours: float | None, theirs: float | None, more: bool) -> bool:
    """Whether theirs is better; a delay without end, or an aircraft lost, is None and the worst."""
    if theirs is None or ours is None:
        return theirs is not None
    return theirs > ours if more else theirs < ours


def _rates(sets: dict[str, list[Document]]) -> Table:
    """What the numbers of flights say of a rate."""
    counts = sorted({lines[0]["faults"] for lines in sets.values()})
    rows = [
        [str(n), *(estimate(vars(wilson(round(share * n), n)), _percent)[1] for share in SHARES)]
        for n in counts
    ]
    return Table(("faulted flights", *(f"measured {_percent(share)} %" for share in SHARES)), rows)


def _alarms(number: int, rows: Rows) -> str:
    """Per hour flown without a fault, with exact sensors and with declared errors."""
    groups = [[of for name, of in rows.items() if (name in EXACT) == exact] for exact in (True, False)]
    exact_h, air_h = (sum(of[SCHEME]["healthy_h"] for of in group) for group in groups)
    head = ("", "exact sensors", "upper limit, 95 %", "in air", "upper limit, 95 %")
    body = [
        [name, *(cell for group in groups for cell in _per_hour([of[name] for of in group]))]
        for name in next(iter(rows.values()))
    ]
    flown = f"{exact_h:.2f} h with exact sensors, {air_h:.2f} h in air"
    title = _caption(number, f"False alarms per flight hour without a fault; flown: {flown}")
    return f"{title}\n\n{markdown_table(head, body)}"


def _per_hour(lines: list[Document]) -> tuple[str, str]:
    alarms, hours = (sum(line[key] for line in lines) for key in ("false_alarms", "healthy_h"))
    if not hours:
        return "-", "-"
    return f"{alarms / hours:.3g}", f"{poisson_bound(alarms, hours, CONFIDENCE, upper=True):.3g}"
