"""From the results of many flights to one line for each entry, with intervals of its counts, and to the
document of the comparison, from which tables, figure and page are made.
"""

from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from math import inf
from operator import itemgetter

from beaver_ftc.results.metrics import versions
from beaver_ftc.results.model import Document
from beaver_ftc.studies.compare.replay import Trace, alarms_at
from beaver_ftc.studies.compare.trial import LAW, ORACLE, SCHEME, STATISTICAL, Entry, Result, Trial
from beaver_ftc.studies.engine.statistics import (
    CONFIDENCE,
    duel,
    median,
    poisson_bound,
    share_within,
    wilson,
    wilson_bound,
)
from beaver_ftc.studies.present.tables import all_finite, finite, percent

Results = Sequence[Result]  # of one entry, in the order of the flights


def line_of(entry: Entry, results: Results, oracle: Results, ours: Results = ()) -> Document:
    """The line of one entry over one set. oracle: results of the oracle in the same flights, in the same
    order. ours: the same of our entry, or nothing to compare with. Flights that failed with an error are only
    in `failed`. ratio: tracking error over that of the oracle, where the oracle has one.

    The delay of an event that never comes is infinite, and so is a quantile of nothing. None: a rate in no
    flight.
    """
    pairs = [(mine, best) for mine, best in zip(results, oracle, strict=True) if mine.error is None]
    completed = [mine for mine, _ in pairs]
    faulted = [result for result in completed if result.faulted]
    ratios = [m.rms_deg_s / o.rms_deg_s for m, o in pairs if o.error is None and 0 < o.rms_deg_s < inf]
    return {
        **vars(entry),
        "flights": len(completed),
        "failed": len(results) - len(completed),
        **_false_alarms(completed),
        **_diagnosis(faulted),
        **_spread("ratio", ratios),
        **_interval("ratio_median", ratios),
        "detected": sum(r.delay_s < inf for r in faulted),
        "isolated": sum(r.correct for r in faulted),
        "departures": sum(r.departed for r in completed),
        "us": share_within([r.us for r in completed], 0.5),
        **_spread("before", [r.before_deg_s for r in completed]),
        **_spread("after", [r.after_deg_s for r in faulted]),
        "travel_median": share_within([r.travel_deg_s for r in completed], 0.5),
        "energy_median": share_within([r.energy_deg2_s2 for r in completed], 0.5),
        "against_ours": _duel(entry, results, ours),
    }


def _false_alarms(completed: Results) -> Document:
    """Number and rate of false alarms, per hour in which an alarm would be false, with the one-sided upper
    bound of the rate."""
    alarms = sum(r.false_alarm for r in completed)
    hours = sum(r.fault_free_s for r in completed) / 3600.0
    return {
        "false_alarms": alarms,
        "healthy_h": hours,
        "false_alarms_per_h": alarms / hours if hours else None,
        "false_alarms_per_h_upper": poisson_bound(alarms, hours, CONFIDENCE, upper=True) if hours else None,
    }


def _diagnosis(faulted: Results) -> Document:
    """Rates and delays of detection and isolation in these flights."""
    n = len(faulted)
    delays_s = [r.delay_s for r in faulted]
    detected = sum(delay_s < inf for delay_s in delays_s)
    rate = wilson(detected, n)
    return {
        "faults": n,
        "detection_rate": finite(rate.value),
        "detection_rate_lower": wilson_bound(detected, n, CONFIDENCE, upper=False) if n else None,
        **({"detection_rate_low": rate.low, "detection_rate_high": rate.high} if n else {}),
        "delay_median_s": share_within(delays_s, 0.5),
        "delay_90_s": share_within(delays_s, 0.9),
        "isolation_rate": sum(r.correct for r in faulted) / n if n else None,
        **_interval("delay_median", delays_s, "_s"),
        "isolation_delay_median_s": share_within([r.isolation_delay_s for r in faulted], 0.5),
    }


def _duel(entry: Entry, mine: Results, ours: Results) -> Document:
    """In how many flights with a fault an entry is worse or better than ours, and the probability p of a
    result at least as uneven between equals. Schemes are compared by whether the fault is detected, laws by
    the tracking error. A flight that failed with an error on either side is left out."""

    def badness(result: Result) -> float:
        return result.rms_deg_s if entry.law != LAW else float(result.delay_s == inf)

    flights = [pair for pair in zip(mine, ours, strict=bool(ours)) if all(r.error is None for r in pair)]
    pairs = [(badness(a), badness(b)) for a, b in flights if a.faulted and b.faulted]
    return dict(zip(("worse", "better", "p"), duel(pairs), strict=True))


def _spread(name: str, values: Sequence[float]) -> Document:
    """Median and 90 % quantile of values."""
    return {f"{name}_median": share_within(values, 0.5), f"{name}_90": share_within(values, 0.9)}


def _interval(name: str, values: Sequence[float], unit: str = "") -> Document:
    """The two-sided interval of a median, which assumes no distribution."""
    estimate = median(values)
    return {f"{name}_{side}{unit}": estimate[side] for side in ("low", "high")} if values else {}


def _results(trials: Iterable[Trial], entry: Entry) -> list[Result]:
    """The results of an entry in all trials."""
    return [result for trial in trials for result in trial.results if result.entry == entry]


def trade_off(traces: Sequence[Trace]) -> list[Document]:
    """The points at each level at which the number of false alarms changes, and at level 1, with which the
    scheme ships; from the highest level to the lowest."""
    levels = sorted({1.0, *(trace.before for trace in traces if trace.before > 0.0)}, reverse=True)
    return [point_at(traces, level) for level in levels]


def point_at(traces: Sequence[Trace], level: float) -> Document:
    """False alarms and detections of a scheme at a level of its statistic.

    Detections and delays are counted in the flights without a false alarm before the fault. None: a rate in
    no flight, or in no time.
    """
    alarms, hours = alarms_at(traces, level)
    delays = [trace.delay_s(level) for trace in traces if trace.faulted and not trace.false_alarm(level)]
    return {
        "level": level,
        "false_alarms_per_h": alarms / hours if hours else None,
        "detection_rate": sum(delay < inf for delay in delays) / len(delays) if delays else None,
        "delay_median_s": share_within(delays, 0.5),
    }


def matched(points: Sequence[Document]) -> Document | None:
    """The most sensitive level without a false alarm; None if no alarm could have been false."""
    return min((p for p in points if p["false_alarms_per_h"] == 0.0), key=itemgetter("level"), default=None)


# The keys of a line in which `better_than_ours` compares rivals with ours, and their names.
MATCHED = {"detection_rate": "detection rate", "delay_median_s": "median detection delay, s"}
COMPARED = {
    "false_alarms_per_h": "false alarms per hour",
    **MATCHED,
    "delay_90_s": "90 % detection delay, s",
    "isolation_rate": "isolation accuracy",
}
TRACKING = {
    "ratio_median": "median tracking ratio to the oracle",
    "ratio_90": "90 % tracking ratio to the oracle",
    "departures": "departures",
}
EFFORT = {
    "before_median": "median error before the fault, deg/s",
    "before_90": "90 % error before the fault, deg/s",
    "after_median": "median error after the fault, deg/s",
    "after_90": "90 % error after the fault, deg/s",
    "travel_median": "median travel of the surfaces, deg/s",
    "energy_median": "median energy of the surfaces, deg2/s2",
}
MORE_IS_BETTER = ("detection_rate", "isolation_rate")
SIGNIFICANT = 0.05


def document_of(trials: Sequence[Trial], entries: Sequence[Entry]) -> Document:
    """Tally every set; numbers that do not exist are null. entries: among them our scheme with our law, and
    with the oracle."""
    names = list(dict.fromkeys(trial.set for trial in trials))
    sets = {name: _set_document([t for t in trials if t.set == name], entries) for name in names}
    return {"sets": sets, "versions": dict(versions())}


def _set_document(trials: Sequence[Trial], entries: Sequence[Entry]) -> Document:
    """The part of the document of one set of flights."""
    traces = defaultdict[str, list[Trace]](list)
    for trial in trials:
        for scheme, trace in trial.traces.items():
            traces[scheme].append(trace)
    oracle, ours = (_results(trials, Entry(SCHEME, law)) for law in (ORACLE, LAW))
    lines = [all_finite(line_of(entry, _results(trials, entry), oracle, ours)) for entry in entries]
    points = {
        s: [all_finite(point) for point in trade_off(points_of_scheme)]
        for s, points_of_scheme in traces.items()
    }
    without_false_alarm = {s: point for s in points if (point := matched(points[s]))}
    failed = {result.error for trial in trials for result in trial.results if result.error}
    return {
        "flights": len(trials),
        "lines": lines,
        "trade_off": points,
        "without_false_alarm": without_false_alarm,
        "who_is_better": who_is_better(lines),
        "better_than_ours": better_than_ours(lines, without_false_alarm),
        "errors": sorted({error for trial in trials for error in trial.failures} | failed),
    }


# Schemes and laws that are no rivals: yardsticks, and variants and parts of ours.
NO_RIVALS = ("none", STATISTICAL, ORACLE, "oracle-published", "fault-tolerant-published")


def competitors(lines: Sequence[Document]) -> tuple[dict[str, Document], dict[str, Document]]:
    """The lines of our scheme and its rivals with our law, and of our law and its rivals with our scheme, by
    name."""
    schemes = {row["scheme"]: row for row in lines if row["law"] == LAW and row["scheme"] not in NO_RIVALS}
    laws = {row["law"]: row for row in lines if row["scheme"] == SCHEME and row["law"] not in NO_RIVALS}
    return schemes, laws


def who_is_better(lines: Sequence[Document]) -> Document:
    """A sentence about the schemes, and one about the laws: the best of them, with intervals and
    significance. Empty if no flight has a fault."""
    if not any(row["faults"] for row in lines):
        return {}
    schemes, laws = competitors(lines)
    return {
        "schemes": leader(schemes, SCHEME, "detection_rate", "Faults detected", percent, more_is_better=True),
        "laws": leader(
            laws, LAW, "ratio_median", "Tracking error over the oracle's, median", "{:.2f}".format,
            more_is_better=False,
        ),
    }  # fmt: skip


def leader(
    rows: Mapping[str, Document], ours: str, key: str, title: str, cell: Callable[[float], str],
    more_is_better: bool,
) -> str:  # fmt: skip
    """One sentence that compares the best rival with ours, each number with its interval. If their numbers
    are equal, it names all rivals that equal ours.

    rows: our line and those of the rivals, by name, each with the duel `against_ours`. ours: our name. key:
    of the number; the keys `<key>_low` and `<key>_high` are its interval. title: its name. cell: its format.
    """
    sign = -1.0 if more_is_better else 1.0
    badness = {name: inf if row.get(key) is None else sign * row[key] for name, row in rows.items()}
    texts = {name: f"{name} {_with_interval(row, key, cell)}" for name, row in rows.items()}
    rivals = [name for name in rows if name != ours]
    if not rivals:
        return f"{title}: {texts[ours]}."
    best = min(rivals, key=badness.__getitem__)
    if badness[best] == badness[ours]:
        equals = [name for name in rivals if badness[name] == badness[ours]]
        return f"{title}: {ours} and {', '.join(equals)} are equally good: {texts[ours]}."
    duel = rows[best]["against_ours"]
    wins = {best: duel["better"], ours: duel["worse"]}
    first, second = sorted(wins, key=badness.__getitem__)
    doubt = "" if duel["p"] < SIGNIFICANT else ", so this may be chance"
    return (
        f"{title}: {texts[first]} is better than {texts[second]}; wins: {wins[first]} against "
        f"{wins[second]}, p = {duel['p']:.2g}{doubt}."
    )


def _with_interval(row: Document, key: str, cell: Callable[[float], str]) -> str:
    """A number of a line and its interval."""
    value, low, high = (
        missing if row.get(key + end) is None else cell(row[key + end])
        for end, missing in (("", "none"), ("_low", "no limit"), ("_high", "no limit"))
    )
    return f"{value} ({low} to {high})"


def better_than_ours(lines: Sequence[Document], free: Document) -> list[str]:
    """One sentence for each number in which a rival is better than ours.

    lines: among them that of our entry. free: by scheme, the point at its most sensitive level without a
    false alarm, if there is one.
    """
    schemes, laws = competitors(lines)
    ours = schemes[SCHEME]
    sentences = [s for name, row in schemes.items() for s in _better(row, ours, COMPARED | TRACKING, name)]
    sentences += [
        f"with no false alarm, {sentence}"
        for scheme, point in free.items()
        if scheme in schemes and SCHEME in free
        for sentence in _better(point, free[SCHEME], MATCHED, scheme)
    ]
    return sentences + [s for name, row in laws.items() for s in _better(row, ours, TRACKING | EFFORT, name)]


def _better(row: Document, ours: Document, compared: Mapping[str, str], name: str) -> Iterator[str]:
    """The sentences of one rival. None is the worst value of each number, an infinite delay or an unknown
    rate, and printed as `never`. Our own row is never better than itself."""
    for key, name_of_number in compared.items():
        value = row.get(key)
        our_value = ours.get(key)
        if value is None:
            continue
        sign = 1 if key in MORE_IS_BETTER else -1
        if our_value is None or sign * value > sign * our_value + 1e-9:
            our_text = "never" if our_value is None else f"{our_value:.3g}"
            yield f"{name} has the better {name_of_number}: {value:.3g} against {our_text}"
