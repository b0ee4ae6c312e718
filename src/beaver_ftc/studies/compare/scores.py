"""From the results of many flights to one line for each entry, with intervals of its counts, and to the
document of the comparison, from which tables, figure and page are made.
"""

from collections import defaultdict
from collections.abc import Iterable, Sequence
from math import inf

from beaver_ftc.results.metrics import versions
from beaver_ftc.results.model import Document
from beaver_ftc.studies.compare.replay import Trace
from beaver_ftc.studies.compare.rivals import better_than_ours, who_is_better
from beaver_ftc.studies.compare.trade_off import matched, trade_off
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
from beaver_ftc.studies.present.tables import all_finite, finite

Results = Sequence[Result]  # of one entry, in the order of the flights


def line_of(entry: Entry, results: Results, oracle: Results, ours: Results = ()) -> Document:
    """The line of one entry over one set. oracle: results of the oracle in the same flights, in the same
    order. ours: the same of our entry, or nothing to compare with. Flights that failed with an error are only
    in `failed`. ratio: tracking error over that of the oracle, where the oracle has one.

    The delay of an event that never comes is infinite, and so are a quantile of nothing and an upper bound in
    no time. None: a rate in no flight, or in no time.
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
        "false_alarms_per_h_upper": poisson_bound(alarms, hours, CONFIDENCE, upper=True),
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
