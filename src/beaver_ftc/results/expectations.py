"""What a scenario expects of its flight (`expect:`), held against the metrics: what a CI job asserts.

One rule a key. A rule takes what was expected and the metrics document, and returns what was found and
whether that will do. Where the quantity does not exist (nothing was detected, say) the expectation fails.
"""

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

Document = dict[str, Any]
Rule = Callable[[Any, Document], tuple[Any, bool]]


def evaluate(expect: Any, metrics: Document) -> list[Document]:
    """One {name, passed, expected, actual} for each expectation set in `expect`, in its fields' order."""
    return [
        {"name": name, "passed": passed, "expected": expected, "actual": actual}
        for name, rule, expected in _each(expect)
        for actual, passed in [rule(expected, metrics)]
    ]


def names(expect: Any) -> list[str]:
    """The names of what a scenario expects, as in `evaluate`."""
    return [name for name, _, _ in _each(expect)]


def _each(expect: Any) -> Iterator[tuple[str, Rule, Any]]:
    if expect is None:
        return
    for name, expected in expect.model_dump(exclude_none=True).items():
        if isinstance(expected, dict):
            rule = _arrived if name == "arrives" else partial(_rms_at_most, name)
            yield from ((f"{name}.{part}", rule(part), limit) for part, limit in expected.items())
        else:
            yield name, _RULES[name], expected


def _at_most(actual: float | None, limit: float) -> tuple[float | None, bool]:
    return actual, actual is not None and actual <= limit


def _detected_within(limit_s: float, metrics: Document) -> tuple[Any, bool]:
    return _at_most(metrics["detection"]["delay_s"], limit_s)


def _isolated_within(limit_s: float, metrics: Document) -> tuple[Any, bool]:
    return _at_most(metrics["isolation"]["delay_s"], limit_s)


def _isolated_as(fault: str, metrics: Document) -> tuple[Any, bool]:
    actual = metrics["isolation"]["fault"]
    return actual, actual == fault


def _isolated_type(kind: str, metrics: Document) -> tuple[Any, bool]:
    actual = metrics["isolation"]["type"]
    return actual, actual == kind


def _candidate_type(kind: str, metrics: Document) -> tuple[Any, bool]:
    actual = metrics["isolation"]["candidates"]
    return actual, any(kind == candidate.rpartition(":")[2] for candidate in actual)


def _no_false_alarm(expected: bool, metrics: Document) -> tuple[Any, bool]:
    actual = not metrics["false_alarm"]
    return actual, actual == expected


def _no_departure(expected: bool, metrics: Document) -> tuple[Any, bool]:
    actual = metrics["departure"] is None
    return actual, actual == expected


def _rms_at_most(name: str, axis: str) -> Rule:
    def rule(limit_deg_s: float, metrics: Document) -> tuple[Any, bool]:
        rms = metrics["tracking"][name]
        return _at_most(rms[axis] if rms else None, limit_deg_s)

    return rule


def _profile_within(channel: str) -> Rule:
    def rule(limit: float, metrics: Document) -> tuple[Any, bool]:
        return _at_most((metrics["profile"] or {}).get(channel), limit)

    return rule


def _arrived(part: str) -> Rule:
    def rule(expected: Any, metrics: Document) -> tuple[Any, bool]:
        actual = (metrics["arrival"] or {}).get(part)
        if part == "in_envelope":
            return actual, actual == expected
        return actual, actual is not None and abs(actual) <= expected

    return rule


def _stays_in_envelope(expected: bool, metrics: Document) -> tuple[Any, bool]:
    actual = metrics["envelope"]["exits"] == 0
    return actual, actual == expected


_RULES: dict[str, Rule] = {
    "detected_within_s": _detected_within,
    "isolated_as": _isolated_as,
    "isolated_within_s": _isolated_within,
    "isolated_type": _isolated_type,
    "candidate_type": _candidate_type,
    "no_false_alarm": _no_false_alarm,
    "no_departure": _no_departure,
    "altitude_within_m": _profile_within("altitude_m"),
    "airspeed_within_mps": _profile_within("airspeed_mps"),
    "airspeed_within_limits_mps": _profile_within("airspeed_limited_mps"),
    "heading_within_deg": _profile_within("heading_deg"),
    "stays_in_envelope": _stays_in_envelope,
}
