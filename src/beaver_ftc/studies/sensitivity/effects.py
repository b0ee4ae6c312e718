"""The effect of each mechanism, from pairs of flights with it and without it.

By each criterion (a false alarm, a late alarm, no right name, worse tracking), a pair may be worse or better
without the mechanism. The net share of a criterion, worse less better, is the worth of the mechanism.
"""

from collections.abc import Callable, Mapping, Sequence
from itertools import compress
from math import isfinite

from beaver_ftc.results.metrics import versions
from beaver_ftc.results.model import Document
from beaver_ftc.studies.engine.statistics import CONFIDENCE, binomial, counted, median, or_never
from beaver_ftc.studies.present.tables import known_values, sum_of, values_of
from beaver_ftc.studies.sensitivity.mechanisms import FACTORS, Flight, cases_of
from beaver_ftc.studies.sensitivity.systems import MECHANISMS, SYSTEMS, Mechanism

LATE_S = 0.1  # an alarm that is later by more than this is late
WORSE = 1.1  # a tracking error larger by more than this factor is worse
Outcome = Document  # of a flight, as `outcome_of` of outcomes.py returns it
Rows = Sequence[Mapping[str, Outcome]]  # for each draw, the outcomes by key, as `fly_one` returns them
Pair = tuple[Outcome, Outcome]  # outcomes (a, b) of a draw: a with the mechanism, b without it


def document_of(seed: int, draws: int, rows: Rows, margins: list[Document]) -> Document:
    """The document: the settings of the study, and the rows of margins, systems, mechanisms and false alarms.
    It has passed if no false alarm of a worst-case scheme is unexplained. draws: in a cell; the document has
    those of all cells. rows: of each case of `cases_of`, in order."""
    cases = cases_of(draws)
    alarms = [_alarms_of(key, rows) for key in rows[0]]
    return {
        "passed": not any(row["unexplained"] for row in alarms if row["worst_case"]),
        "seed": seed,
        "draws": len(cases),
        "confidence": CONFIDENCE,
        "factors": {name: list(values) for name, values in FACTORS.items()},
        "late_s": LATE_S,
        "worse": WORSE,
        "margins": margins,
        "systems": {system: _system_row(values_of(rows, system)) for system in SYSTEMS},
        "mechanisms": [_row_of(mechanism, cases, rows) for mechanism in MECHANISMS],
        "false_alarms": alarms,
        "versions": dict(versions()),
    }


def _row_of(mechanism: Mechanism, cases: Sequence[Flight], rows: Rows) -> Document:
    """The row of a mechanism: its effect in all pairs, and by each value of each factor."""
    pairs = [(row[mechanism.with_key], row[mechanism.without_key]) for row in rows]
    by_factor = {
        factor: {
            str(value): effect_of([*compress(pairs, (getattr(case, factor) == value for case in cases))])
            for value in values
        }
        for factor, values in FACTORS.items()
    }
    return {
        "system": mechanism.system,
        "mechanism": mechanism.name,
        "serves": mechanism.serves,
        **effect_of(pairs),
        "by": by_factor,
    }


def effect_of(pairs: Sequence[Pair]) -> Document:
    """The effect of the mechanism in these pairs: net shares by criterion, and medians with and without it.
    Pairs with a failed flight are left out; those with a false alarm are left out of the delays."""
    completed = [pair for pair in pairs if not any(values_of(pair, "failed"))]
    return {
        "flights": len(completed),
        "failed": len(pairs) - len(completed),
        "same_verdict": sum(a["verdict"] == b["verdict"] for a, b in completed),
        "same_tracking": sum(a["tracking_deg_s"] == b["tracking_deg_s"] for a, b in completed),
        **{name: net(completed, is_worse) for name, is_worse in CRITERIA.items()},
        "delay_s": _both([p for p in completed if not any(values_of(p, "false_alarm"))], "delay_s"),
        "tracking_deg_s": _both(completed, "tracking_deg_s"),
        "tracking_ratio": median(_ratio(a, b) for a, b in completed),
    }


def _later(a: Outcome, b: Outcome) -> bool:
    """Whether the alarm of b is later than that of a by more than LATE_S. False if one of them has a false
    alarm, which has no delay."""
    if a["false_alarm"] or b["false_alarm"]:
        return False
    return or_never(b["delay_s"]) > or_never(a["delay_s"]) + LATE_S


IsWorse = Callable[[Outcome, Outcome], bool]  # whether the second flight b of a pair is worse than a
CRITERIA: Mapping[str, IsWorse] = {
    "false_alarms": lambda a, b: b["false_alarm"] > a["false_alarm"],
    "late": _later,
    "names": lambda a, b: a["named"] > b["named"],
    "tracking": lambda a, b: or_never(b["tracking_deg_s"]) > WORSE * or_never(a["tracking_deg_s"]),
}


def net(pairs: Sequence[Pair], is_worse: IsWorse) -> Document:
    """Share of pairs that are worse without the mechanism, less the share of those that are better.

    Each share has an exact interval with half of the error probability [ClopperPearson1934]. By the union
    bound, both hold together with CONFIDENCE. The net share then lies between their smallest and largest
    difference. Without pairs it is 0.
    """
    n = len(pairs)
    confidence = (1.0 + CONFIDENCE) / 2.0
    n_worse = sum(is_worse(a, b) for a, b in pairs)
    n_better = sum(is_worse(b, a) for a, b in pairs)
    worse, better = binomial(n_worse, n, confidence), binomial(n_better, n, confidence)
    return {
        "worse": n_worse,
        "better": n_better,
        "value": (n_worse - n_better) / n if n else 0.0,
        "low": worse.low - better.high,
        "high": worse.high - better.low,
    }


def _both(pairs: Sequence[Pair], name: str) -> Document:
    """Medians of a number with and without the mechanism."""
    return {
        "flights": len(pairs),
        "with": median(a[name] for a, _ in pairs),
        "without": median(b[name] for _, b in pairs),
    }


def _ratio(a: Outcome, b: Outcome) -> float:
    """Tracking error of b over that of a; infinite if only b loses the aircraft, 0 if only a does, 1 if both
    do."""
    error_b, error_a = or_never(b["tracking_deg_s"]), or_never(a["tracking_deg_s"])
    return error_b / error_a if isfinite(error_a) else float(not isfinite(error_b))


def _system_row(outcomes: Sequence[Outcome]) -> Document:
    """The row of a system with all of its mechanisms, over the completed flights."""
    completed = [o for o in outcomes if not o["failed"]]
    rates = {
        "false_alarms": sum_of(completed, "false_alarm"),
        "detected": len(known_values(completed, "delay_s")),
        "named": sum_of(completed, "named"),
        "lost": sum(o["tracking_deg_s"] is None for o in completed),
    }
    return {
        "flights": len(completed),
        **{name: counted(count, len(completed)) for name, count in rates.items()},
        "tracking_deg_s": median(values_of(completed, "tracking_deg_s")),
    }


def _alarms_of(key: str, rows: Rows) -> Document:
    """The false alarms in the flights of one key.

    worst_case: whether their scheme guarantees no false alarm within the declaration; only the statistical
    detector does not. undeclared: alarms with an undeclared error. certifiable: alarms of a scheme with
    certificates; certified: those with one. unexplained: alarms without an undeclared error, or of a
    worst-case scheme with certificates without one.
    """
    reasons = [row[key]["reason"] for row in rows if row[key]["false_alarm"]]
    worst_case = not any(m.with_key == key and "fdi.statistical" in m.present for m in MECHANISMS)
    return {
        "flown": key,
        "worst_case": worst_case,
        "count": len(reasons),
        "undeclared": sum(reason["undeclared"] > 0 for reason in reasons),
        "certified": sum(bool(reason["certified"]) for reason in reasons),
        "certifiable": len(known_values(reasons, "certified")),
        "unexplained": sum(r["undeclared"] == 0 or (worst_case and r["certified"] is False) for r in reasons),
    }
