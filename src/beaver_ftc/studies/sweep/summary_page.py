"""The summary of a sweep in words: for the terminal and at the head of the report.

Everything is said from the summary document, so that the words and `summary.json` cannot disagree.
"""

from collections.abc import Mapping, Sequence
from functools import partial
from math import floor, log10
from pathlib import Path

from beaver_ftc.aircraft import AXES
from beaver_ftc.results.metrics import NEAR_THRESHOLD_SHARE
from beaver_ftc.results.model import Document, Expectation, Judged
from beaver_ftc.results.verdict import printed, verdict_table
from beaver_ftc.studies.present.page import (
    Heading,
    Links,
    Part,
    Pictures,
    Table,
    as_html,
    drawn_in,
    versions_line,
)
from beaver_ftc.studies.present.tables import Rows, number, tabulated
from beaver_ftc.studies.sweep.pictures import FIGURES
from beaver_ftc.studies.sweep.summary import OUTCOMES

MANY = 0.1  # of a sweep's flights
# Of a key that an outcome is said to follow.
MAX_P_VALUE = 0.05
MIN_EXPLAINED = 0.01
SHOWN = 3  # keys of an outcome, and worst flights
_STEERED = "The search steered these flights towards the worst: rates say nothing about flights in general."
_EXPLAINED = (
    "Share of the ranks of an outcome that a varied key explains (Kruskal and Wallis' epsilon squared), "
    "Spearman's rank correlation, and how often chance alone explains as much."
)
value = partial(number, none="none")
_seconds = partial(number, unit="s", none="never")
_UNITS = {"delay": " s", "false_alarm": " of the threshold", "tracking": " deg/s"}


def title(summary: Document) -> str:
    """The sweep's name and whether it shows what it should."""
    if not summary["expectations"]:
        return f"{summary['sweep']}: flown, nothing was expected"
    return f"{summary['sweep']}: {'PASSED' if summary['passed'] else 'FAILED'}"


def facts(summary: Document) -> list[tuple[str, str]]:
    """(what, what the flights show) for each thing worth knowing."""
    lost = summary["departures"]
    wrong = summary["isolation"]["wrong"]
    said = (
        ("flights", _flights(summary)),
        ("searched for", _search(summary)),
        ("detection", _rate(summary["detection"], "faults detected")),
        ("warning", _on_the_bound(summary["on_the_bound"])),
        ("inconclusive", _inconclusive(summary["inconclusive"])),
        ("detection delay", _quantiles(summary["detection"]["delay_s"])),
        ("isolation", _rate(summary["isolation"], "faults named rightly")),
        ("wrongly named", f"{wrong['count']} of {wrong['of']} named" if wrong["count"] else ""),
        ("false alarms", _false_alarms(summary["false_alarms"])),
        ("guarantee", _guarantee(summary["guarantee"])),
        ("departures", _rate(lost, "flights lost") if lost["count"] else ""),
        ("delay follows", _drivers(summary["sensitivity"]["detection_delay"])),
        ("misses follow", _drivers(summary["sensitivity"]["missed_detection"])),
    )
    return [(what, how) for what, how in said if how]


def tracking(summary: Document) -> list[tuple[str, str, str, str]]:
    """(what, p, q, r): medians of the tracking errors, deg/s, and of their ratio."""
    rows = {"before the fault": "pre_fault_rms_deg_s", "after": "post_fault_rms_deg_s", "ratio": "ratio"}
    medians = {what: [summary["tracking"][a][key]["median"] for a in AXES] for what, key in rows.items()}
    return [
        (what, value(p), value(q), value(r)) for what, (p, q, r) in medians.items() if {p, q, r} != {None}
    ]


def expectations(summary: Document) -> list[tuple[str, str, str, bool]]:
    """(name, expected, actual, passed) for each expectation."""
    return [
        (found["name"], expected(found["expected"]), value(found["actual"]), found["passed"])
        for found in summary["expectations"]
    ]


def verdict(summary: Document) -> Judged:
    """As of a run, each bound under a name of its own."""
    bounds = (
        Expectation(
            f"{found['name']}.{_side(found['expected'])}",
            found["passed"],
            expected(found["expected"]),
            f"{value(found['actual'])} of {found['of']} flights",
        )
        for found in summary["expectations"]
    )
    return Judged(summary["sweep"], summary["passed"], tuple(bounds))


def expected(level: Document) -> str:
    """A bound in words: `95 % quantile ≤ 0.5 with 95 % confidence`."""
    part = f"{exact_percent(level['quantile'])} quantile " if "quantile" in level else ""
    side = _side(level)
    sure = f" with {exact_percent(level['confidence'])} confidence" if "confidence" in level else ""
    return f"{part}{_SIGNS[side]} {value(level[side])}{sure}"


_SIGNS = {"at_least": "≥", "at_most": "≤"}


def _side(level: Document) -> str:
    """The side of a bound: the key of its limit."""
    return next(side for side in _SIGNS if side in level)


def exact_percent(share: float | None) -> str:
    """A share in percent, with the digits that matter near 0 and 1."""
    if share is None:
        return "none"
    rest = min(share, 1.0 - share)
    digits = 1 if rest >= 0.01 or not rest else max(2, -floor(log10(100.0 * rest)))
    text = f"{100 * share:.{digits}f}"
    return f"{text.rstrip('0').rstrip('.')} %"


def summary_text(summary: Document, colour: bool = False) -> str:
    """The summary as a table for the terminal."""
    # commands each on a line of its own to be copied
    worst = [f" {'; '.join(flight['why'])}:\n   {flight['replay']}" for flight in summary["worst"][:SHOWN]]
    headline = (title(summary), "bold green" if summary["passed"] else "bold red")
    lines = facts(summary)
    for what, p, q, r in tracking(summary):
        unit = "" if what == "ratio" else " deg/s"
        label = "tracking RMS, median" if what.startswith("before") else ""
        lines.append((label, f"p {p}  q {q}  r {r}{unit} {what}"))
    held = [(passed, f"{name} {bound}: {actual}") for name, bound, actual, passed in expectations(summary)]
    table = verdict_table(headline, lines, held, [("results", summary["folder"])])
    return "\n".join([printed([table], colour=colour), *worst]) + "\n"


def _flights(summary: Document) -> str:
    statuses = [(count, name.replace("_", " ")) for name, count in summary["statuses"].items()]
    others = ", ".join(f"{count} {name}" for count, name in statuses if name != "flown")
    return f"{summary['flights']}, {summary['flown_h']:.3g} h in the air" + (f" ({others})" if others else "")


def _search(summary: Document) -> str:
    search = summary.get("search")
    if search is None:
        return ""
    score = "none" if search["score"] is None else f"{search['score']:.4g}{_UNITS[search['objective']]}"
    return f"the worst {search['objective'].replace('_', ' ')}: {score} in flight {search['run']}"


def _rate(rate: Document, what: str) -> str:
    if not rate["of"]:
        return ""
    return f"{exact_percent(rate['rate'])} ({_interval(rate)}): {rate['count']} of {rate['of']} {what}"


def _quantiles(delays: Document) -> str:
    if not delays["of"]:
        return ""
    quantiles = {"median": "median", "p95": "95 %", "p99": "99 %", "max": "max"}
    return ", ".join(f"{says} {_seconds(delays[name])}" for name, says in quantiles.items())


def _false_alarms(found: Document) -> str:
    if not found["hours"]:
        return ""
    return (
        f"{found['count']} in {value(found['hours'])} h without a fault: {value(found['per_hour'])}/h "
        f"({value(found['low'])} to {value(found['high'])}); largest residual/threshold ratio "
        f"{found['closest_residual_ratio']:.4g}"
    )


def _on_the_bound(found: Document) -> str:
    """That detection shows the uncertainty flown, where the healthy part has used up the bound in many
    flights."""
    if not found["of"] or found["rate"] < MANY:
        return ""
    return (
        f"in {found['count']} of {found['of']} flights the residual of the healthy flight already reaches "
        f"{exact_percent(NEAR_THRESHOLD_SHARE)} of its threshold or more; the detection of small faults then "
        "measures the scenario's own uncertainty, not the diagnosis"
    )


def _inconclusive(found: Document) -> str:
    if not found["count"]:
        return ""
    return (
        "in {count} of {of} flights the diagnosis could conclude nothing for part or all of the time "
        "(detection.inconclusive.share); the verdict of a kept flight states the reason"
    ).format(**found)


def _guarantee(found: Document) -> str:
    if not found["promised"]:
        return ""
    return "{broken} of {promised} faults detected later than guaranteed".format(**found)


def _drivers(ranking: list[Document]) -> str:
    told = [
        entry for entry in ranking if entry["p_value"] <= MAX_P_VALUE and entry["explained"] >= MIN_EXPLAINED
    ][:SHOWN]
    return ", ".join(
        f"{entry['key']} (explains {exact_percent(entry['explained'])} of the ranks)" for entry in told
    )


def render(summary: Document, folder: Path) -> str:
    """The report as HTML text, from the summary and the figures and flights in the sweep's folder."""
    figures = drawn_in(folder, FIGURES)
    return as_html(title(summary), _parts(summary, folder, figures), figures)


def _parts(summary: Document, folder: Path, figures: Mapping[str, Path]) -> list[Part]:
    judged = [("✓ met" if passed else "✗ MISSED", *row) for *row, passed in expectations(summary)]
    again = [(each["name"], link) for each in summary["worst"] if (link := _link(folder, each["name"]))]
    explained = [
        each | {"outcome": OUTCOMES[outcome]}
        for outcome, ranking in summary["sensitivity"].items()
        for each in ranking
    ]
    flown = "{flights} flights, sampling {sampling}, seed {seed}".format(**summary)
    return [
        summary["description"],
        _STEERED if "search" in summary else "",
        *_section("What the flights show", ("", ""), facts(summary)),
        *_section("Expectations", ("", "of", "expected", "found"), judged),
        *_section("Tracking error, median RMS in deg/s", ("", *AXES), tracking(summary)),
        *_section("By fault", *tabulated(BY_FAULT, summary["by_fault"])),
        Heading("Figures"),
        Pictures([(FIGURES[name][0], name) for name in figures]),
        *_section("Flights worth a look", *tabulated(WORST, summary["worst"])),
        Links("Flights that have been flown again: ", again) if again else "",
        *_section("Flights that could not be flown", *tabulated(FAILED, summary["reasons"])),
        *_section("Sensitivity", *tabulated(EXPLAINED, explained)),
        _EXPLAINED if explained else "",
        f"{flown}; {versions_line(summary['versions'])}",
    ]


def _section(heading: str, head: Sequence[str], rows: Rows) -> list[Part]:
    """A heading and its table; nothing without rows."""
    return [Heading(heading), Table(head, rows)] if rows else []


def _interval(rate: Document) -> str:
    return f"{exact_percent(rate['low'])} to {exact_percent(rate['high'])}"


BY_FAULT = (
    ("fault", "fault"), ("flights", "flights"), ("detected", "detection.rate", exact_percent),
    ("95 % interval", "detection", _interval), ("delay: median", "detection.delay_s.median", _seconds),
    ("95 %", "detection.delay_s.p95", _seconds), ("max", "detection.delay_s.max", _seconds),
    ("named rightly", "isolation.rate", exact_percent), ("95 % interval", "isolation", _interval),
    ("named wrongly", "isolation.wrong.count"),
)  # fmt: skip
WORST = (("flight", "run"), ("why", "why", "; ".join), ("flies it again", "replay"))
EXPLAINED = (
    ("outcome", "outcome"), ("key", "key"), ("explained", "explained", value),
    ("correlation", "rank_correlation", value), ("p", "p_value", value),
)  # fmt: skip
FAILED = (("flights", "count"), ("why", "reason"), ("first", "first_run"))


def _link(folder: Path, name: str) -> str | None:
    """Where a kept flight is to be seen, relative to the report."""
    seen = [f"flights/{name}/{file}" for file in ("report.html", "metrics.json", "scenario.yaml")]
    return next((path for path in seen if (folder / path).is_file()), None)
