"""What a scenario expects of its flight (`expect:`), held against the metrics: what a CI job asserts.

One row a key: how the metrics document says what was found, and whether that will do for what was expected.
Where the quantity does not exist (nothing was detected, say) the expectation fails. If an expectation of the
diagnosis is not met and there were frames in which it could conclude nothing, that is given as the reason.
"""

from collections.abc import Callable, Iterator
from operator import eq
from typing import Any

from beaver_ftc.scenario.measured import in_words
from beaver_ftc.scenario.warnings import OF_DIAGNOSIS

Document = dict[str, Any]
Rule = tuple[Callable[[Document], Any], Callable[[Any, Any], bool]]
"""From the metrics what was found; from that and what was expected whether it will do."""


def evaluate(expect: Any, metrics: Document) -> list[Document]:
    """One {name, passed, expected, actual} for each expectation set in `expect`, in its fields' order; with
    `reason`, where one is known."""
    return [
        {"name": name, "passed": met(actual, expected), "expected": expected, "actual": actual}
        | ({} if met(actual, expected) else _reason(name, metrics))
        for name, (found, met), expected in _each(expect)
        for actual in [found(metrics)]
    ]


def _reason(name: str, metrics: Document) -> Document:
    """Why what was expected of the diagnosis is not met, if it could not conclude anything."""
    inconclusive = metrics.get("detection", {}).get("inconclusive") if name in OF_DIAGNOSIS else None
    return {"reason": in_words(inconclusive)} if inconclusive else {}


def margin(found: Document) -> float | None:
    """How far inside its limit one entry of `evaluate` is, in the limit's unit and below 0 where it is not
    met; None of what has no size, and where the quantity does not exist."""
    expected, actual = found["expected"], found["actual"]
    if isinstance(expected, bool) or not isinstance(expected, int | float) or actual is None:
        return None
    return float(expected - abs(actual))


def names(expect: Any) -> list[str]:
    """The names of what a scenario expects, as in `evaluate`."""
    return [name for name, _, _ in _each(expect)]


def _each(expect: Any) -> Iterator[tuple[str, Rule, Any]]:
    if expect is None:
        return
    for name, expected in expect.model_dump(exclude_none=True).items():
        if isinstance(expected, dict):
            yield from ((f"{name}.{part}", _rule_of(name, part), limit) for part, limit in expected.items())
        else:
            yield name, _RULES[name], expected


def _rule_of(name: str, part: str) -> Rule:
    """The rule of one part of an expectation that has several: of an arrival, or of a tracking error."""
    if name == "arrives":
        return _entry("arrival", part), eq if part == "in_envelope" else _off_by_at_most
    return lambda metrics: (metrics["tracking"][name] or {}).get(part), _at_most


def _entry(section: str, key: str) -> Callable[[Document], Any]:
    return lambda metrics: (metrics[section] or {}).get(key)


def _at_most(found: float | None, limit: float) -> bool:
    return found is not None and found <= limit


def _off_by_at_most(found: float | None, limit: float) -> bool:
    return found is not None and abs(found) <= limit


def _among(candidates: list[str], kind: str) -> bool:
    return any(kind == candidate.rpartition(":")[2] for candidate in candidates)


_RULES: dict[str, Rule] = {
    "detected_within_s": (_entry("detection", "delay_s"), _at_most),
    "isolated_as": (_entry("isolation", "fault"), eq),
    "isolated_within_s": (_entry("isolation", "delay_s"), _at_most),
    "isolated_type": (_entry("isolation", "type"), eq),
    "candidate_type": (_entry("isolation", "candidates"), _among),
    "no_false_alarm": (lambda metrics: not metrics["false_alarm"], eq),
    "no_departure": (lambda metrics: metrics["departure"] is None, eq),
    "altitude_within_m": (_entry("profile", "altitude_m"), _at_most),
    "airspeed_within_mps": (_entry("profile", "airspeed_mps"), _at_most),
    "airspeed_within_limits_mps": (_entry("profile", "airspeed_limited_mps"), _at_most),
    "heading_within_deg": (_entry("profile", "heading_deg"), _at_most),
    "stays_in_envelope": (lambda metrics: metrics["envelope"]["exits"] == 0, eq),
}
