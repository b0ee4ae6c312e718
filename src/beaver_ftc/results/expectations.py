"""The expectations of a scenario (`expect:`), compared with the metrics, and their words: a row for each key.

An expectation fails if its quantity does not exist, for example if there was no alarm, unless it expects an
absence. A name that was given before its fault began meets no expectation. A failed expectation of the
diagnosis has a reason if the name was premature, if the one name that `isolated_as` expects was withdrawn, or
if there were frames in which the diagnosis could conclude nothing.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

from beaver_ftc.results.model import Expectation, Metrics
from beaver_ftc.results.words import MOTION_OF_AXIS, three_digits, value_text, without_underscores
from beaver_ftc.scenario import measured_range
from beaver_ftc.scenario.expect import OF_DIAGNOSIS

Texts = tuple[str, str]
"""Two texts: the expected value, and the actual value; the second is empty if it adds nothing."""


@dataclass(frozen=True)
class Rule:
    """An expectation that a value of the metrics equals.

    path: keys that lead to the value, such as `detection.delay_s`. says: the name of the value in words.
    """

    path: str
    says: str

    def actual(self, metrics: Metrics) -> Any:
        """The value in the metrics; a tuple as a list, as a scenario file has it."""
        value = metrics.at(self.path)
        return list(value) if isinstance(value, tuple) else value

    def is_met(self, actual: Any, expected: Any) -> bool:
        """Whether the actual value meets the expectation."""
        return bool(actual == expected)

    def texts(self, result: Expectation) -> Texts:
        """Expected and actual value in words; the second text is empty if an equal value meets the
        expectation."""
        is_as_expected = result.passed and result.actual == result.expected
        actual = "" if is_as_expected else value_text(result.actual)
        return f"{self.says} {value_text(result.expected)}", actual

    def margin(self, result: Expectation) -> float | None:
        """Distance of the actual value from a limit, in the unit of the limit; None here: it is no limit."""

    def share(self, result: Expectation) -> float | None:
        """Share of a limit that the actual value takes; None here: it is no limit."""


class AmongCandidates(Rule):
    """An expectation that a fault type is among the candidates."""

    def is_met(self, actual: Any, expected: Any) -> bool:
        """Whether a candidate has the type."""
        return any(expected == candidate.rpartition(":")[2] for candidate in actual)


@dataclass(frozen=True)
class Limit(Rule):
    """An expectation |value| <= limit, both in `unit`."""

    unit: str

    def is_met(self, actual: Any, expected: Any) -> bool:
        """Whether the value exists, and is within the limit."""
        return actual is not None and abs(actual) <= expected

    def texts(self, result: Expectation) -> Texts:
        """The limit, and the value with its share of the limit."""
        share = self.share(result)
        of_limit = "" if share is None else f" ({three_digits(100 * share)} % of the limit)"
        actual = value_text(result.actual) + ("" if result.actual is None else f" {self.unit}{of_limit}")
        return f"{self.says} ≤ {value_text(result.expected)} {self.unit}", actual

    def margin(self, result: Expectation) -> float | None:
        """Limit - |actual|, negative if the limit is exceeded; None if there is no actual value."""
        return None if result.actual is None else float(result.expected - abs(result.actual))

    def share(self, result: Expectation) -> float | None:
        """|actual| / limit; None if there is no actual value, or if the limit is 0."""
        if result.actual is None or not result.expected:
            return None
        return abs(float(result.actual)) / result.expected


@dataclass(frozen=True)
class Flag(Rule):
    """An expectation of true or false. says: the words for true; says_not: the words for false."""

    says_not: str

    def texts(self, result: Expectation) -> Texts:
        """The words for the expected value, and those for the actual value if it exists and is the
        opposite."""
        words = (self.says_not, self.says)
        is_as_expected = result.passed or result.actual is None
        return words[result.expected], "" if is_as_expected else words[result.actual]


class Absence(Flag):
    """An expectation that something did not happen: true if the value of the metrics is false, 0 or None."""

    def actual(self, metrics: Metrics) -> bool:
        """True if it did not happen."""
        return not metrics.at(self.path)


# The rule of the key `isolated_as` if the scenario expects a list of names.
ALL_NAMES = Rule("isolation.names", "isolated fault")
RULES: dict[str, Rule] = {
    "detected_within_s": Limit("detection.delay_s", "detection delay", "s"),
    "isolated_within_s": Limit("isolation.delay_s", "isolation delay", "s"),
    "isolated_as": Rule("isolation.fault", "isolated fault"),
    "isolated_type": Rule("isolation.type", "fault type"),
    "candidate_type": AmongCandidates("isolation.candidates", "possible fault types include"),
    "no_false_alarm": Absence("false_alarm", "no false alarm", "a false alarm"),
    "no_departure": Absence("departure", "no departure", "a departure"),
    "stays_in_envelope": Absence("envelope.exits", "stays in the envelope", "leaves the envelope"),
    "altitude_within_m": Limit("profile.altitude_m", "altitude deviation", "m"),
    "airspeed_within_mps": Limit("profile.airspeed_mps", "airspeed deviation (10 s mean)", "m/s"),
    "airspeed_within_limits_mps": Limit(
        "profile.airspeed_limited_mps", "deviation from the limited airspeed (10 s mean)", "m/s"
    ),
    "heading_within_deg": Limit("profile.heading_deg", "heading deviation", "deg"),
    "arrives.altitude_m": Limit("arrival.altitude_m", "altitude deviation at the end", "m"),
    "arrives.airspeed_mps": Limit("arrival.airspeed_mps", "airspeed deviation at the end", "m/s"),
    "arrives.heading_deg": Limit("arrival.heading_deg", "heading deviation at the end", "deg"),
    "arrives.in_envelope": Flag(
        "arrival.in_envelope", "inside the envelope at the end", "outside the envelope at the end"
    ),
    **{
        f"{key}.{axis}": Limit(f"tracking.{key}.{axis}", f"{name} rate RMS {when} the fault", "deg/s")
        for key, when in (("pre_fault_rms_deg_s", "before"), ("post_fault_rms_deg_s", "after"))
        for axis, name in MOTION_OF_AXIS.items()
    },
}


def evaluate(expect: Any, metrics: Metrics) -> list[Expectation]:
    """One record for each expectation that is set in `expect`, in the order of its fields. A record has a
    `reason` if the reason of a failure is known."""
    return [_judged(name, expected, metrics) for name, expected in expected_of(expect)]


def expectation_names(expect: Any) -> list[str]:
    """The names of what a scenario expects, as in `evaluate`."""
    return [name for name, _ in expected_of(expect)]


def expected_of(expect: Any) -> Iterator[tuple[str, Any]]:
    """(name, value) of each expectation that is set in `expect`. An entry of a section has the name
    `section.key`."""
    entries = expect.model_dump(exclude_none=True) if expect else {}
    for name, expected in entries.items():
        if isinstance(expected, dict):
            yield from ((f"{name}.{part}", limit) for part, limit in expected.items())
        else:
            yield name, list(expected) if isinstance(expected, tuple) else expected


def _judged(name: str, expected: Any, metrics: Metrics) -> Expectation:
    """One expectation compared with the metrics. A premature name meets no expectation about a name."""
    rule = ALL_NAMES if isinstance(expected, list) else RULES[name]
    actual = rule.actual(metrics)
    # `isolation.names` leaves out premature names: ALL_NAMES needs no test for them
    is_of_a_name = rule.path.startswith("isolation.") and rule is not ALL_NAMES
    is_early = is_of_a_name and bool(metrics.at("isolation.premature"))
    passed = rule.is_met(actual, expected) and not is_early
    reason = None
    if not passed and name in OF_DIAGNOSIS:
        reason = _reason_not_met(expected, is_early, metrics)
    return Expectation(name, passed, expected, actual, reason=reason)


def _reason_not_met(expected: Any, is_early: bool, metrics: Metrics) -> str | None:
    """The reason why an expectation of the diagnosis is not met; None if it is not known. is_early: the fault
    was named before it began."""
    isolation = metrics.isolation
    if is_early:
        return f"{isolation.fault} was named at {isolation.time_s:g} s, before the fault began"
    for earlier in reversed(isolation.withdrawn):
        if earlier.fault == expected:
            return (
                f"{expected} was named at {earlier.from_s:g} s, and the name withdrawn at {earlier.to_s:g} s"
            )
    inconclusive = metrics.at("detection.inconclusive")
    return measured_range.in_words(inconclusive.document()) if inconclusive else None


def _rule_of(result: Expectation) -> Rule:
    """The rule of an expectation. A key without a rule has the words of its name."""
    return RULES.get(result.name) or Rule("", without_underscores(result.name))


def margin(expectation: Expectation) -> float | None:
    """Distance of a value from its limit, in the unit of the limit, negative if the limit is exceeded. None
    if the expectation has no limit, or the quantity does not exist."""
    return _rule_of(expectation).margin(expectation)


class ExpectationInWords(NamedTuple):
    """An expectation compared with the flight.

    expected, actual: the two values; the actual one is empty if it adds nothing, and ends with the reason of
    a failure. share_of_limit: |actual| / limit; None if the expectation is no limit, the limit is 0, or there
    is no actual value.
    """

    name: str
    expected: str
    actual: str
    passed: bool
    share_of_limit: float | None

    @property
    def sentence(self) -> str:
        """Expected and actual in one line."""
        return f"{self.expected}, got {self.actual}" if self.actual else self.expected


def expectations_in_words(metrics: Metrics) -> list[ExpectationInWords]:
    """Each expectation in words."""
    return [_in_words(expectation) for expectation in metrics.expectations]


def _in_words(result: Expectation) -> ExpectationInWords:
    """One expectation in words."""
    rule = _rule_of(result)
    expected, actual = rule.texts(result)
    actual = "; ".join(filter(None, (actual, result.reason)))
    return ExpectationInWords(result.name, expected, actual, result.passed, rule.share(result))
