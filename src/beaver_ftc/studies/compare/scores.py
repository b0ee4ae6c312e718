"""From the results of many flights to one line an entry, with the uncertainty of counting, and one document:
what tables, figure, page and `--format json` are made from.
"""

from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from math import inf
from operator import itemgetter
from statistics import median as middle

from beaver_ftc.results.metrics import versions
from beaver_ftc.results.model import Document
from beaver_ftc.studies.compare.replay import Trace, alarms_at
from beaver_ftc.studies.compare.trial import LAW, ORACLE, SCHEME, Entry, Result, Trial
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

Results = Sequence[Result]  # of one entry, a flight after the other


def line_of(entry: Entry, results: Results, oracle: Results, ours: Results = ()) -> Document:
    """Tally one entry over one set; oracle, ours: results of the yardstick, and of our entry if there are
    any, in the same flights, in the same order.

    What never comes is infinite; None where there was nothing to count.
    """
    flown = [(mine, best) for mine, best in zip(results, oracle, strict=True) if mine.error is None]
    mine = [result for result, _ in flown]
    faulted = [result for result in mine if result.faulted]
    ratios = [m.rms_deg_s / o.rms_deg_s for m, o in flown if o.error is None and 0 < o.rms_deg_s < inf]
    return {
        **vars(entry),
        "flights": len(mine),
        "failed": len(results) - len(mine),
        **_false_alarms(mine),
        **_diagnosis(faulted),
        **_spread("ratio", ratios),
        **_interval("ratio_median", ratios),
        "detected": sum(r.delay_s < inf for r in faulted),
        "isolated": sum(r.correct for r in faulted),
        "departures": sum(r.departed for r in mine),
        "us": middle(r.us for r in mine) if mine else 0.0,
        **_spread("before", [r.before_deg_s for r in mine]),
        **_spread("after", [r.after_deg_s for r in faulted]),
        **_spread("travel", [r.travel_deg_s for r in mine], ("median",)),
        **_spread("energy", [r.energy_deg2_s2 for r in mine], ("median",)),
        "against_ours": _duel(entry, results, ours),
    }


def _false_alarms(mine: Results) -> Document:
    """False alarms, and the rate per hour in which an alarm would have been one, with its upper bound."""
    alarms = sum(r.false_alarm for r in mine)
    hours = sum(r.fault_free_s for r in mine) / 3600.0
    return {
        "false_alarms": alarms,
        "healthy_h": hours,
        "false_alarms_per_h": alarms / hours if hours else None,
        "false_alarms_per_h_upper": poisson_bound(alarms, hours, CONFIDENCE, upper=True) if hours else None,
    }


def _diagnosis(faulted: Results) -> Document:
    """How many faults are detected and named in these flights, and how soon."""
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
    """In how many flights with a fault an entry is better or worse than ours, and the probability of so
    uneven a result between equals. Of schemes: whether the fault is detected; of laws: the tracking error."""

    def badness(result: Result) -> float:
        return result.rms_deg_s if entry.law != LAW else float(result.delay_s == inf)

    both = zip(mine, ours, strict=bool(ours))
    pairs = [(badness(a), badness(b)) for a, b in both if a.faulted and b.faulted]
    return dict(zip(("worse", "better", "p"), duel(pairs), strict=True))


def _spread(name: str, values: Sequence[float], which: Sequence[str] = ("median", "90")) -> Document:
    shares = {"median": 0.5, "90": 0.9}
    return {f"{name}_{part}": share_within(values, shares[part]) if values else None for part in which}


def _interval(name: str, values: Sequence[float], unit: str = "") -> Document:
    """The two-sided interval of a median, free of any distribution."""
    found = median(values)
    return {f"{name}_{side}{unit}": found[side] for side in ("low", "high")} if values else {}


def _results(trials: Iterable[Trial], entry: Entry) -> list[Result]:
    return [result for trial in trials for result in trial.results if result.entry == entry]


def trade_off(traces: Sequence[Trace]) -> list[Document]:
    """Every level at which the number of false alarms changes, from the strictest; and the scheme's own,
    1."""
    levels = sorted({1.0, *(trace.before for trace in traces if trace.before > 0.0)}, reverse=True)
    return [point_at(traces, level) for level in levels]


def point_at(traces: Sequence[Trace], level: float) -> Document:
    """The false alarms of a scheme at a level of its statistic, and its detections.

    Detections and delays are of the flights in which the fault was still to be detected: no false alarm
    before it.
    """
    alarms, hours = alarms_at(traces, level)
    delays = [trace.delay_s(level) for trace in traces if trace.faulted and not trace.false_alarm(level)]
    rate = sum(delay < inf for delay in delays) / len(delays) if delays else 0.0
    per_h = alarms / hours if hours else 0.0
    median_s = share_within(delays, 0.5)
    return {"level": level, "false_alarms_per_h": per_h, "detection_rate": rate, "delay_median_s": median_s}


def matched(points: Sequence[Document]) -> Document:
    """The most sensitive level without a false alarm."""
    return min((p for p in points if p["false_alarms_per_h"] <= 0.0), key=itemgetter("level"))


# What is held against ours in `better_than_ours`: of each key of a line, what it is called.
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
    """Tally every set; numbers that do not exist are null."""
    names = list(dict.fromkeys(trial.set for trial in trials))
    sets = {name: _set([t for t in trials if t.set == name], entries) for name in names}
    return {"sets": sets, "versions": dict(versions())}


def _set(trials: Sequence[Trial], entries: Sequence[Entry]) -> Document:
    traces = defaultdict[str, list[Trace]](list)
    for trial in trials:
        for scheme, trace in trial.traces.items():
            traces[scheme].append(trace)
    oracle, ours = (_results(trials, Entry(SCHEME, law)) for law in (ORACLE, LAW))
    lines = [all_finite(line_of(entry, _results(trials, entry), oracle, ours)) for entry in entries]
    points = {s: [all_finite(point) for point in trade_off(of)] for s, of in traces.items()}
    free = {s: matched(of) for s, of in points.items()}
    failed = {result.error for trial in trials for result in trial.results if result.error}
    return {
        "flights": len(trials),
        "lines": lines,
        "trade_off": points,
        "without_false_alarm": free,
        "who_is_better": who_is_better(lines),
        "better_than_ours": better_than_ours(lines, free if any(line["faults"] for line in lines) else {}),
        "errors": sorted({error for trial in trials for error in trial.failures} | failed),
    }


YARDSTICKS = ("none", ORACLE, "oracle-published", "fault-tolerant-published")  # and parts of ours


def who_is_better(lines: Sequence[Document]) -> Document:
    """A sentence on the schemes, and one on the laws: who is best, with intervals, and how sure that is."""
    if not any(row["faults"] for row in lines):
        return {}
    schemes = {row["scheme"]: row for row in lines if row["law"] == LAW and row["scheme"] not in YARDSTICKS}
    laws = {row["law"]: row for row in lines if row["scheme"] == SCHEME and row["law"] not in YARDSTICKS}
    return {
        "schemes": leader(schemes, SCHEME, "detection_rate", "Faults detected", percent, more=True),
        "laws": leader(
            laws, LAW, "ratio_median", "Tracking error over the oracle's, median", "{:.2f}".format, False
        ),
    }


def leader(
    rows: Mapping[str, Document], ours: str, key: str, what: str, cell: Callable[[float], str], more: bool
) -> str:
    """One sentence: who has the best number of this key, with its interval, and ours with its own.

    rows: by name, each with `against_ours`: how often it is better and worse than ours, and how likely that
    is between equals.
    """
    sign = -1.0 if more else 1.0
    badness = {name: inf if row.get(key) is None else sign * row[key] for name, row in rows.items()}

    def said(name: str) -> str:
        value, low, high = (
            none if rows[name].get(key + end) is None else cell(rows[name][key + end])
            for end, none in (("", "none"), ("_low", "no limit"), ("_high", "no limit"))
        )
        return f"{name} {value} ({low} to {high})"

    rivals = [name for name in rows if not name.startswith(ours)]
    if not rivals:
        return f"{what}: {said(ours)}."
    best = min(rivals, key=badness.__getitem__)
    if badness[best] == badness[ours]:
        alike = [name for name in rivals if badness[name] == badness[ours]]
        return f"{what}: {ours} and {', '.join(alike)} are equally good: {said(ours)}."
    duel = rows[best]["against_ours"]
    wins = {best: duel["better"], ours: duel["worse"]}
    first, second = sorted(wins, key=badness.__getitem__)
    sure = "" if duel["p"] < SIGNIFICANT else ", so this may be chance"
    return (
        f"{what}: {said(first)} is better than {said(second)}; wins: {wins[first]} against {wins[second]}, "
        f"p = {duel['p']:.2g}{sure}."
    )


def better_than_ours(lines: Sequence[Document], free: Document) -> list[str]:
    """Where a rival does better than our scheme or our law: one sentence each.

    free: of each scheme, the most sensitive level without a false alarm.
    """
    ours = next(row for row in lines if (row["scheme"], row["law"]) == (SCHEME, LAW))
    schemes = [row for row in lines if row["law"] == LAW and row["scheme"] not in (SCHEME, "none")]
    laws = [row for row in lines if row["scheme"] == SCHEME and row["law"] not in (LAW, ORACLE)]
    said = [s for row in schemes for s in _better(row, ours, COMPARED | TRACKING, row["scheme"])]
    said += [
        f"with no false alarm, {sentence}"
        for scheme, point in free.items()
        if scheme != SCHEME and SCHEME in free
        for sentence in _better(point, free[SCHEME], MATCHED, scheme)
    ]
    return said + [s for row in laws for s in _better(row, ours, TRACKING | EFFORT, row["law"])]


def _better(row: Document, ours: Document, compared: Mapping[str, str], name: str) -> Iterator[str]:
    """None is the worst there is: a delay that never ends, a rate of nothing."""
    for key, what in compared.items():
        value = row.get(key)
        than = ours.get(key)
        if value is None:
            continue
        sign = 1 if key in MORE_IS_BETTER else -1
        if than is None or sign * value > sign * than + 1e-9:
            against = "never" if than is None else f"{than:.3g}"
            yield f"{name} has the better {what}: {value:.3g} against {against}"
