"""The summary of a sweep in words, for the terminal and for its report (summary_page.py).

All numbers are taken from the summary document, so that they cannot disagree with `summary.json`. The
function of a line in `facts` returns an empty text if there is nothing to say, and the line is left out.
"""

from functools import partial
from math import floor, log10

from beaver_ftc.aircraft import AXES
from beaver_ftc.results.hints import NEAR_THRESHOLD_SHARE
from beaver_ftc.results.model import Document, Expectation, Judged
from beaver_ftc.results.terminal import printed, verdict_table
from beaver_ftc.results.verdict import headed
from beaver_ftc.studies.present.tables import number
from beaver_ftc.studies.sweep.expectations import SIDES

MANY = 0.1  # share of the faulted flights from which on there is a warning
# A key is named if it has at most this p-value and explains at least this share of the ranks.
MAX_P_VALUE = 0.05
MIN_EXPLAINED = 0.01
SHOWN = 3  # number of keys of an outcome, and of worst flights, for the terminal
value = partial(number, none="none")
seconds = partial(number, unit="s", none="never")
_UNITS = {"delay": " s", "false_alarm": " of the threshold", "tracking": " deg/s"}
_SIGNS = dict(zip(SIDES, "≥≤", strict=True))


def title(summary: Document) -> str:
    """The name of the sweep, and whether its expectations are met."""
    if not summary["expectations"]:
        return f"{summary['sweep']}: flown, nothing was expected"
    return f"{summary['sweep']}: {'PASSED' if summary['passed'] else 'FAILED'}"


def facts(summary: Document) -> list[tuple[str, str]]:
    """(name, text) of each line about the flights."""
    departures = summary["departures"]
    wrong_names = summary["isolation"]["wrong"]
    lines = (
        ("flights", _flights(summary)),
        ("searched for", _search(summary)),
        ("detection", _rate(summary["detection"], "faults detected")),
        ("warning", _on_the_bound(summary["on_the_bound"])),
        ("inconclusive", _inconclusive(summary["inconclusive"])),
        ("detection delay", _quantiles(summary["detection"]["delay_s"])),
        ("isolation", _rate(summary["isolation"], "faults named rightly")),
        ("wrongly named", "{count} of {of} named".format(**wrong_names) if wrong_names["count"] else ""),
        ("false alarms", _false_alarms(summary["false_alarms"])),
        ("guarantee", _guarantee(summary["guarantee"])),
        ("departures", _rate(departures, "flights lost") if departures["count"] else ""),
        ("delay follows", _drivers(summary["sensitivity"]["detection_delay"])),
        ("misses follow", _drivers(summary["sensitivity"]["missed_detection"])),
    )
    return [(name, text) for name, text in lines if text]


def tracking(summary: Document) -> list[tuple[str, str, str, str]]:
    """(name, p, q, r): medians of the tracking errors before and after the fault, deg/s, and of their
    ratio, without rows that have no number."""
    rows = {"before the fault": "pre_fault_rms_deg_s", "after": "post_fault_rms_deg_s", "ratio": "ratio"}
    medians = {name: [summary["tracking"][a][key]["median"] for a in AXES] for name, key in rows.items()}
    return [
        (name, value(p), value(q), value(r)) for name, (p, q, r) in medians.items() if {p, q, r} != {None}
    ]


def expectations(summary: Document) -> list[tuple[str, str, str, bool]]:
    """(name, expected, actual, passed) for each expectation."""
    return [
        (each["name"], limit_text(each["expected"]), value(each["actual"]), each["passed"])
        for each in summary["expectations"]
    ]


def verdict(summary: Document) -> Judged:
    """The judgement of the sweep, like that of a run. Each limit is an expectation with its own name."""
    bounds = tuple(
        Expectation(
            f"{each['name']}.{_side(each['expected'])}", each["passed"], limit_text(each["expected"]),
            f"{value(each['actual'])} of {each['of']} flights",
        )
        for each in summary["expectations"]
    )  # fmt: skip
    return Judged(summary["sweep"], summary["passed"], bounds)


def limit_text(level: Document) -> str:
    """An expected limit in words, such as `95 % quantile ≤ 0.5 with 95 % confidence`."""
    quantile = f"{exact_percent(level['quantile'])} quantile " if "quantile" in level else ""
    side = _side(level)
    confidence = f" with {exact_percent(level['confidence'])} confidence" if "confidence" in level else ""
    return f"{quantile}{_SIGNS[side]} {value(level[side])}{confidence}"


def _side(level: Document) -> str:
    """The side of a limit, `at_least` or `at_most`: its key in the level."""
    return next(side for side in _SIGNS if side in level)


def exact_percent(share: float | None) -> str:
    """A share in per cent, with more digits near 0 and 1."""
    if share is None:
        return "none"
    distance = min(share, 1.0 - share)
    digits = 1 if distance >= 0.01 or not distance else max(2, -floor(log10(100.0 * distance)))
    text = f"{100 * share:.{digits}f}"
    return f"{text.rstrip('0').rstrip('.')} %"


def interval(rate: Document) -> str:
    """The interval of a rate."""
    return f"{exact_percent(rate['low'])} to {exact_percent(rate['high'])}"


def summary_text(summary: Document, colour: bool = False) -> str:
    """The summary as a table for the terminal, and the commands that fly the worst flights again."""
    # each command is on its own line, to be copied
    worst = [f" {'; '.join(flight['why'])}:\n   {flight['replay']}" for flight in summary["worst"][:SHOWN]]
    headline = (title(summary), "bold green" if summary["passed"] else "bold red")
    lines = facts(summary)
    errors = [
        f"p {p}  q {q}  r {r}{'' if name == 'ratio' else ' deg/s'} {name}"
        for name, p, q, r in tracking(summary)
    ]
    lines += headed("tracking RMS, median", errors)
    expected_lines = [
        (passed, f"{name} {bound}: {actual}") for name, bound, actual, passed in expectations(summary)
    ]
    table = verdict_table(headline, lines, expected_lines, [("results", summary["folder"])])
    return "\n".join([printed([table], colour=colour), *worst]) + "\n"


def _flights(summary: Document) -> str:
    """The number of flights, the flown time, and the numbers with other statuses than `flown`."""
    statuses = [(count, name.replace("_", " ")) for name, count in summary["statuses"].items()]
    others = ", ".join(f"{count} {name}" for count, name in statuses if name != "flown")
    flown = "{flights}, {flown_h:.3g} h in the air".format(**summary)
    return f"{flown} ({others})" if others else flown


def _search(summary: Document) -> str:
    """The objective of a search, the worst score and its flight."""
    search = summary.get("search")
    if search is None:
        return ""
    score = "none" if search["score"] is None else f"{search['score']:.4g}{_UNITS[search['objective']]}"
    return f"the worst {search['objective'].replace('_', ' ')}: {score} in flight {search['run']}"


def _rate(rate: Document, noun: str) -> str:
    """A rate with its interval and counts."""
    if not rate["of"]:
        return ""
    return "{} ({}): {count} of {of} {}".format(exact_percent(rate["rate"]), interval(rate), noun, **rate)


def _quantiles(delays: Document) -> str:
    """Quantiles of delays."""
    if not delays["of"]:
        return ""
    quantiles = {"median": "median", "p95": "95 %", "p99": "99 %", "max": "max"}
    return ", ".join(f"{text} {seconds(delays[name])}" for name, text in quantiles.items())


def _false_alarms(alarms: Document) -> str:
    """The false alarms, their rate with its interval, and the largest |residual| / threshold in healthy
    flight."""
    if not alarms["hours"]:
        return ""
    hours, per_hour, low, high = (value(alarms[key]) for key in ("hours", "per_hour", "low", "high"))
    return (
        f"{alarms['count']} in {hours} h without a fault: {per_hour}/h ({low} to {high}); largest "
        f"residual/threshold ratio {alarms['closest_residual_ratio']:.4g}"
    )


def _on_the_bound(rate: Document) -> str:
    """A warning if the residual of the healthy flight comes near its threshold in a share MANY of the faulted
    flights."""
    if not rate["of"] or rate["rate"] < MANY:
        return ""
    return (
        "in {count} of {of} flights the residual of the healthy flight already reaches {} of its threshold "
        "or more; the detection of small faults then measures the scenario's own uncertainty, not the "
        "diagnosis"
    ).format(exact_percent(NEAR_THRESHOLD_SHARE), **rate)


def _inconclusive(rate: Document) -> str:
    """The number of flights in which the diagnosis could conclude nothing for some time."""
    if not rate["count"]:
        return ""
    return (
        "in {count} of {of} flights the diagnosis could conclude nothing for part or all of the time "
        "(detection.inconclusive.share); the verdict of a kept flight states the reason"
    ).format(**rate)


def _guarantee(counts: Document) -> str:
    """How many faults were detected later than guaranteed."""
    if not counts["promised"]:
        return ""
    return "{broken} of {promised} faults detected later than guaranteed".format(**counts)


def _drivers(ranking: list[Document]) -> str:
    """At most SHOWN keys that explain an outcome within MAX_P_VALUE and MIN_EXPLAINED."""
    keys = [
        entry for entry in ranking if entry["p_value"] <= MAX_P_VALUE and entry["explained"] >= MIN_EXPLAINED
    ][:SHOWN]
    return ", ".join(
        f"{entry['key']} (explains {exact_percent(entry['explained'])} of the ranks)" for entry in keys
    )
