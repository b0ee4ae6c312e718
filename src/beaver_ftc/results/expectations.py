"""What a scenario expects of its flight (`expect:`), held against the metrics: what a CI job asserts.

One row a key: how the metrics document says what was found, and whether that will do for what was expected.
Where the quantity does not exist (nothing was detected, say) the expectation fails. A name that was given
before its fault began meets none. If an expectation of the diagnosis is not met because of that, because the
name was withdrawn, or because there were frames in which nothing could be concluded, the reason is given.
"""

from collections.abc import Callable, Iterator
from operator import eq
from typing import Any

from beaver_ftc.results.model import Expectation, Metrics
from beaver_ftc.scenario.measured import in_words
from beaver_ftc.scenario.warnings import OF_DIAGNOSIS

Rule = tuple[Callable[[Metrics], Any], Callable[[Any, Any], bool]]
"""From the metrics what was found; from that and what was expected whether it will do."""


def evaluate(expect: Any, metrics: Metrics) -> list[Expectation]:
    """One record for each expectation set in `expect`, in its fields' order; with `reason`, where one is
    known."""
    return [_judged(name, rule, expected, metrics) for name, rule, expected in _each(expect)]


def _judged(name: str, rule: Rule, expected: Any, metrics: Metrics) -> Expectation:
    found, met = rule
    actual = found(metrics)
    actual = list(actual) if isinstance(actual, tuple) else actual
    of_one_name = name in _OF_A_NAME and not isinstance(expected, list)  # a list holds none that is premature
    early = of_one_name and metrics.isolation is not None and bool(metrics.isolation.premature)
    passed = met(actual, expected) and not early
    why = "" if passed or name not in OF_DIAGNOSIS else _reason(expected, early, metrics)
    return Expectation(name, passed, expected, actual, reason=why or None)


def _reason(expected: Any, early: bool, metrics: Metrics) -> str:
    """Why what was expected of the diagnosis is not met, if it is known."""
    detection, isolation = metrics.detection, metrics.isolation
    if early:
        return f"{isolation.fault} was named at {isolation.time_s:g} s, before the fault began"
    gone = [one for one in (isolation.withdrawn if isolation else ()) if one.fault == expected]
    if gone:
        last = gone[-1]
        return f"{expected} was named at {last.from_s:g} s, and the name withdrawn at {last.to_s:g} s"
    inconclusive = detection and detection.inconclusive
    return in_words(inconclusive.document()) if inconclusive else ""


def margin(found: Expectation) -> float | None:
    """How far inside its limit an expectation is, in the limit's unit and below 0 where it is not met; None
    where the expectation has no size, or the quantity does not exist."""
    expected, actual = found.expected, found.actual
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
        if isinstance(expected, tuple):
            yield name, _LIST_RULES[name], list(expected)
        elif isinstance(expected, dict):
            yield from ((f"{name}.{part}", _rule_of(name, part), limit) for part, limit in expected.items())
        else:
            yield name, _RULES[name], expected


def _rule_of(name: str, part: str) -> Rule:
    """The rule of one part of an expectation that has several: of an arrival, or of a tracking error."""
    if name == "arrives":
        return _entry("arrival", part), eq if part == "in_envelope" else _off_by_at_most
    return lambda metrics: getattr(getattr(metrics.tracking, name), part, None), _at_most


def _entry(section: str, key: str) -> Callable[[Metrics], Any]:
    return lambda metrics: getattr(getattr(metrics, section), key, None)


def _names(metrics: Metrics) -> list[str]:
    return list(metrics.isolation.names)


def _at_most(found: float | None, limit: float) -> bool:
    return found is not None and found <= limit


def _off_by_at_most(found: float | None, limit: float) -> bool:
    return found is not None and abs(found) <= limit


def _among(candidates: tuple[str, ...], kind: str) -> bool:
    return any(kind == candidate.rpartition(":")[2] for candidate in candidates)


_OF_A_NAME = ("isolated_as", "isolated_within_s", "isolated_type", "candidate_type")
_LIST_RULES: dict[str, Rule] = {"isolated_as": (_names, eq)}
"""Of the expectations that may be a list."""

_RULES: dict[str, Rule] = {
    "detected_within_s": (_entry("detection", "delay_s"), _at_most),
    "isolated_as": (_entry("isolation", "fault"), eq),
    "isolated_within_s": (_entry("isolation", "delay_s"), _at_most),
    "isolated_type": (_entry("isolation", "type"), eq),
    "candidate_type": (_entry("isolation", "candidates"), _among),
    "no_false_alarm": (lambda metrics: not metrics.false_alarm, eq),
    "no_departure": (lambda metrics: metrics.departure is None, eq),
    "altitude_within_m": (_entry("profile", "altitude_m"), _at_most),
    "airspeed_within_mps": (_entry("profile", "airspeed_mps"), _at_most),
    "airspeed_within_limits_mps": (_entry("profile", "airspeed_limited_mps"), _at_most),
    "heading_within_deg": (_entry("profile", "heading_deg"), _at_most),
    "stays_in_envelope": (lambda metrics: metrics.envelope.exits == 0, eq),
}
