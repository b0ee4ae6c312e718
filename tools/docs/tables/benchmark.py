"""The tables of benchmark.md: what schemes find and how laws track; better numbers of rivals are bold."""

import json
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from beaver_ftc.plugins import DETECTORS, LAWS, registered
from beaver_ftc.studies.compare.scores import document_of
from beaver_ftc.studies.compare.trial import (
    LAW,
    SCHEME,
    STATISTICAL,
    Entry,
    SetFlight,
    entries_of,
    fly_case,
    of_set,
)
from beaver_ftc.studies.compare.tune import is_adopted
from beaver_ftc.studies.engine.statistics import wilson
from beaver_ftc.studies.engine.study import fly_all
from beaver_ftc.studies.present.tables import markdown_table
from tools.docs.tables import aside, table_of

TUNING = Path(__file__).parents[3] / "benchmarks" / "tuning.json"  # how the values in tuned.json were found
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


GAINS = {
    "method": "name", "grade": "grade", "draw": "draw",
    "judged on": lambda again: f"{again['draw'] + 1} to {again['draw'] + again['judged']}",
    "flights": "flights", "cost, before": "built_in .3f", "cost, after": "retuned .3f",
    "gain, %": "gain *100 .1f", "from, %": "gain_low *100 .1f", "to, %": "gain_high *100 .1f",
    "adopted": lambda again: "yes" if is_adopted(again) else "no",
}  # fmt: skip


def benchmark_gains() -> str:
    """By how much the cost of a method falls that is tuned again, on flights of its own: of every search that
    finds other values, as the record of the searches has it."""
    rows = json.loads(TUNING.read_text(encoding="utf-8"))["methods"]
    found = [{**row, **again} for row in rows for again in row["again"] if again.get("gain")]
    last = {
        f"`{row['name']}` on `{row['grade']}`": row["again"][-1]
        for row in rows
        if row["again"] and row["again"][-1]["draw"] != row.get("draw")
    }
    kept = sum(again.get("gain") == 0.0 for again in last.values())
    none = [pair for pair, again in last.items() if "gain" not in again]
    drawn = [f"`{row['name']}` on `{row['grade']}` (draw {row['draw']})" for row in rows if "draw" in row]
    says = (
        f"The table leaves out searches that found no better values. Of {len(rows)} pairs of method and "
        f"grade, {len(last)} were tuned again after their last change. The last search found no better "
        f"values for {kept}, no admissible values for {', '.join(none)}, and values that were not adopted "
        f"for {len(last) - kept - len(none)}. A second tuning found the values of {', '.join(drawn)}."
    )
    table = table_of(found, GAINS)
    return f"{aside('benchmark-gains', 'Gain of a second tuning', table)}\n\n{says}"


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


def _tables(document: Document) -> str:
    """The tables of the page."""
    sets = {name: document["sets"][name] for name in SHOWN if name in document["sets"]}
    faulted = {name: part for name, part in sets.items() if part["lines"][0]["faults"]}
    schemes, laws = _schemes(faulted), _laws(faulted)
    return "\n\n".join([
        _block(2, "Faults detected, %", schemes, "detection_rate", _percent, more=True),
        _block(3, "Faults named correctly at the end, %", schemes, "isolation_rate", _percent, more=True),
        _block(4, "Median delay of the alarm, s", schemes, "delay_median_s", _seconds, more=False),
        _alarms(5, _schemes(sets)),
        _block(6, _RATIO, laws, "ratio_median", _ratio, more=False),
        _block(7, _RATIO_90, laws, "ratio_90", _ratio, more=False),
        "\n".join([
            aside("benchmark-shares", _SHARES, _rates(faulted)),
            aside("benchmark-delays", _UPPER.format("delay of Table 4, s"),
                  _limit_of(schemes, "delay_median_high_s", _seconds)),
            aside("benchmark-ratios-low", _LOWER.format("ratio of Table 6"),
                  _limit_of(laws, "ratio_median_low", _ratio)),
            aside("benchmark-ratios-high", _UPPER.format("ratio of Table 6"),
                  _limit_of(laws, "ratio_median_high", _ratio)),
        ]),
    ])  # fmt: skip


def _schemes(sets: dict[str, Document]) -> Rows:
    return {
        name: {
            row["scheme"]: row for row in part["lines"] if row["law"] == LAW and row["scheme"] not in HIDDEN
        }
        for name, part in sets.items()
    }


def _laws(sets: dict[str, Document]) -> Rows:
    """By law; our law without a scheme has a row of its own."""
    rows: Rows = {}
    for name, part in sets.items():
        shown = [row for row in part["lines"] if row["law"] not in HIDDEN]
        rows[name] = {row["law"]: row for row in shown if row["scheme"] == SCHEME}
        rows[name] |= dict.fromkeys([ALONE], _alone(shown))
    return rows


def _alone(lines: list[Document]) -> Document:
    return next(row for row in lines if (row["scheme"], row["law"]) == (NO_SCHEME, LAW))


def _block(number: int, title: str, rows: Rows, key: str, cell: Callable[[Any], str], more: bool) -> str:
    """A caption and a table of one number a cell. more: whether more is better."""
    ours = _ours(rows)

    def shown(name: str, of: dict[str, Document]) -> str:
        theirs, is_rival = of[name].get(key), name not in (ours, STATISTICAL, ALONE)
        is_better = is_rival and _less(of[ours].get(key), theirs, more)
        return f"**{cell(theirs)}**" if is_better else cell(theirs)

    marked = f"; bold: a rival's number is better than that of `{ours}`"
    caption = _caption(number, f"{title}; in brackets: faulted flights{marked}")
    return "\n\n".join([caption, _cells(rows, shown), _who_is_better(rows, ours, key, cell, more)])


def _ours(rows: Rows) -> str:
    return SCHEME if SCHEME in next(iter(rows.values())) else LAW


def _cells(rows: Rows, shown: Callable[[str, dict[str, Document]], str]) -> str:
    """A row for each scheme or law, a column for each set."""
    counts = {name: next(iter(of.values()))["faults"] for name, of in rows.items()}
    head = ("", *(f"{name} ({count})" for name, count in counts.items()))
    body = [(_label(name), *(shown(name, of) for of in rows.values())) for name in next(iter(rows.values()))]
    return markdown_table(head, body)


def _limit_of(rows: Rows, key: str, cell: Callable[[Any], str]) -> str:
    """A table of limits, which are compared with nothing."""
    return _cells(rows, lambda name, of: cell(of[name].get(key)))


def _who_is_better(rows: Rows, ours: str, key: str, cell: Callable[[Any], str], more: bool) -> str:
    """The first sentence below a table: the best rival of each set in which one is better than ours."""

    def said(row: Document) -> str:
        limits = [cell(limit) for limit in _limits(row, key)]
        return f"{cell(row.get(key))} ({' to '.join(limits)})" if limits else cell(row.get(key))

    found = []
    for name, of in rows.items():
        better = [
            rival for rival in of
            if rival not in (ours, STATISTICAL, ALONE) and _less(of[ours].get(key), of[rival].get(key), more)
        ]  # fmt: skip
        if better:
            numbers = {rival: of[rival][key] for rival in better}
            best = (max if more else min)(numbers, key=lambda rival: numbers[rival])
            found.append(f"`{best}` in `{name}`, {said(of[best])} against {said(of[ours])}")
    if not found:
        return f"In no set is a rival better than `{ours}`."
    rest = "" if len(found) == len(rows) else f" In the other sets no rival is better than `{ours}`."
    return f"Better than `{ours}` are: {'; '.join(found)}.{rest}"


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


def _label(name: str) -> str:
    return f"{name} (passive)" if name in PASSIVE_LAWS else name


def _percent(share: float | None) -> str:
    return "-" if share is None else f"{100 * share:.0f}"


def _seconds(delay_s: float | None) -> str:
    return "never" if delay_s is None else f"{delay_s:.2f}"


def _ratio(ratio: float | None) -> str:
    return "lost" if ratio is None else f"{ratio:.2f}"


def _less(ours: float | None, theirs: float | None, more: bool) -> bool:
    """Whether theirs is better; a delay without end, or an aircraft lost, is None and the worst."""
    if theirs is None or ours is None:
        return theirs is not None
    return theirs > ours if more else theirs < ours


def _rates(sets: dict[str, Document]) -> str:
    """What the numbers of flights say of a rate."""
    counts = sorted({part["lines"][0]["faults"] for part in sets.values()})
    rows = [(str(n), *(_interval(n, share) for share in SHARES)) for n in counts]
    return markdown_table(("faulted flights", *(f"measured {100 * share:.0f} %" for share in SHARES)), rows)


def _interval(n: int, share: float) -> str:
    found = wilson(round(share * n), n)
    return f"{100 * found.low:.0f} to {100 * found.high:.0f}"


def _alarms(number: int, rows: Rows) -> str:
    """Per hour flown without a fault, with exact sensors and with declared errors."""
    head = ("", "exact sensors", "upper limit, 95 %", "in air", "upper limit, 95 %")
    names = list(next(iter(rows.values())))
    body = [(name, *_of_one(rows, name, False), *_of_one(rows, name, True)) for name in names]
    hours = [_hours(rows, in_air) for in_air in (False, True)]
    flown = f"{hours[0]:.2f} h with exact sensors, {hours[1]:.2f} h in air"
    return "\n\n".join(
        [
            _caption(number, f"False alarms per flight hour without a fault; flown: {flown}"),
            markdown_table(head, body),
        ]
    )


def _hours(rows: Rows, in_air: bool) -> float:
    return sum(of[SCHEME]["healthy_h"] for name, of in rows.items() if (name not in EXACT) == in_air)


def _of_one(rows: Rows, name: str, in_air: bool) -> tuple[str, str]:
    from beaver_ftc.studies.engine.statistics import CONFIDENCE, poisson_bound

    lines = [of[name] for of_set, of in rows.items() if (of_set not in EXACT) == in_air]
    alarms, hours = (sum(line[key] for line in lines) for key in ("false_alarms", "healthy_h"))
    if not hours:
        return "-", "-"
    return f"{alarms / hours:.3g}", f"{poisson_bound(alarms, hours, CONFIDENCE, upper=True):.3g}"
