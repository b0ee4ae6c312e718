"""What a flight amounts to: the document `metrics.json`, and what the scenario expects of it (`expect:`).

Whether an alarm is false, how late it is and whether a name is right is decided here, once, of an event and
the truth. A fault is in force in the first frame whose time is not before `at_s`. An alarm in that very
frame, or later, is no false alarm; its delay counts from that frame. A name given before its fault began is
premature, and is not correct, whatever it says.

Times are seconds from the start of the flight, rates deg/s. Delays are seconds from the first frame in which
the fault is there: `at_s`, or up to a frame later. A quantity that does not exist is null: a document never
holds NaN. Nothing in it depends on the wall clock or the machine's name, so that the same scenario and seed
give the same file.

`isolation.so_far` is true of a surface that is named because every other fault is excluded: no data have
excluded this one so far, and nothing within the class proves that a fault outside of it does not look alike.
It is false of `unanticipated` and of an instrument, null of nothing and of what a plug-in names.
`isolation.withdrawn`: surfaces that were named before, and from when to when. `isolation.premature` is true
of a name given before the fault that it names began, or the first one where it names none that was declared:
such a name is not correct and meets no expectation. Null of nothing. An estimate is that of the last frame,
unless `estimate_at_s` says another instant.

`windows`, of a flight with several faults or one that ends: each spell in which the same faults are in force,
with the first frame in it in which a detector is beyond its threshold, and the names and sizes that the
diagnosis gives in its last frame, held against the faults that act then. A name that stands since before
counts from the fault's first frame on.

`detection.inconclusive`: null, or the frames in which the built-in diagnosis can conclude nothing: their
`share`, the first of them `from_s`, and `reasons`, each with the `quantity`, its own `share`, the range that
was `measured`, the range that was `flown` outside of it, and what it `says`.

Expectations are held against the metrics; a CI job asserts them. One row a key: how the metrics document says
what was found, and whether that will do for what was expected. Where the quantity does not exist (nothing was
detected, say) the expectation fails. A name that was given before its fault began meets none. If an
expectation of the diagnosis is not met because of that, because the name was withdrawn, or because there were
frames in which nothing could be concluded, the reason is given.
"""

import json
import math
import platform
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from importlib.metadata import version
from math import inf
from operator import eq
from typing import TYPE_CHECKING, Any, Self, TypeVar

from beaver_ftc.results import model
from beaver_ftc.results.model import Document, Expectation, Metrics
from beaver_ftc.scenario.declared import OF_DIAGNOSIS, declares_all, in_words, outside_class
from beaver_ftc.scenario.diagnosis import failing, of_several
from beaver_ftc.scenario.faults import (
    DAMAGE,
    LOSS_OF_EFFECTIVENESS,
    UNANTICIPATED,
    Damage,
    acting_at,
    is_share,
    of_a_sensor,
    size_at,
)
from beaver_ftc.scenario.sensors import sensor_words
from beaver_ftc.scenario.signals import TIME_TOLERANCE_S, first_frame_s, is_before, is_in_force

if TYPE_CHECKING:
    from beaver_ftc.loop.outcome import Landing
    from beaver_ftc.scenario.schema import Scenario


_FIELDS_THAT_ARE_NO_SIZE = {"actuator", "sensor", "type", "at_s", "end_s", "profile"}
_TIME_DECIMALS = 9  # of a second: without the rounding of frame times


@dataclass(frozen=True)
class Onset:
    """The instant from which events are judged. at_s: as declared, None where nothing breaks. rate_hz: of the
    frames, None where the truth has none (a recorded log)."""

    at_s: float | None
    rate_hz: float | None = None

    @property
    def first_frame_with_fault_s(self) -> float:
        """Time of the first frame with the fault; infinite where nothing breaks."""
        if self.at_s is None:
            return inf
        return self.at_s if self.rate_hz is None else first_frame_s(self.at_s, self.rate_hz)

    def is_false(self, time_s: Any) -> Any:
        """Whether an alarm at a time, or at each of several, is a false one: there is no fault yet."""
        return is_before(time_s, inf if self.at_s is None else self.at_s)

    def delay_s(self, time_s: float | None) -> float | None:
        """From the fault's first frame to an event; None without one, or if it came before the fault."""
        if time_s is None or self.is_false(time_s):
            return None
        return round(max(time_s - self.first_frame_with_fault_s, 0.0), _TIME_DECIMALS)


def strikes_within(at_s: Any, flown_s: Any) -> Any:
    """Whether a fault, or each of several, comes before its flight ends; NaN: there is none."""
    return at_s < flown_s


def is_late(delay_s: Any, guaranteed_delay_s: Any, frame_s: Any) -> Any:
    """Whether a detection, or each of several, came more than a frame after the instant from which it was
    certain."""
    return delay_s > guaranteed_delay_s + frame_s + TIME_TOLERANCE_S


@dataclass(frozen=True)
class DeclaredFault:
    """A fault as a verdict is held against it. size: what else its type has."""

    actuator: str | None
    type: str
    at_s: float
    sensor: str | None = None
    end_s: float | None = None
    profile: str | None = None
    size: Mapping[str, Any] | None = None

    @classmethod
    def of(cls, fault: Any) -> Self:
        """A scenario's."""
        return cls(
            getattr(fault, "actuator", None),
            fault.type,
            fault.at_s,
            fault.sensor if of_a_sensor(fault) else None,
            fault.end_s,
            fault.profile,
            fault.model_dump(exclude=_FIELDS_THAT_ARE_NO_SIZE, exclude_none=True),
        )

    def is_named_by(self, name: str | None, removed_surfaces: frozenset[str] = frozenset()) -> bool:
        """Whether a name is right. removed_surfaces: surfaces that damage takes away."""
        if self.sensor is not None:  # outside the class of surface faults is right as well
            return name in (sensor_words(self.sensor), UNANTICIPATED)
        if self.type == DAMAGE:  # outside of every class, unless a surface that it takes
            return name == UNANTICIPATED or name in removed_surfaces
        return name is not None and name == (UNANTICIPATED if self.type == UNANTICIPATED else self.actuator)

    def is_of_type(self, kind: str | None) -> bool | None:
        """Whether a type is right; None while none is named, as an instrument's never is."""
        if self.sensor is not None:
            return None
        if self.type == DAMAGE:  # a surface that is gone has lost all its effect
            return None if kind in (None, UNANTICIPATED) else kind == LOSS_OF_EFFECTIVENESS
        return None if kind is None else kind == self.type


@dataclass(frozen=True)
class Truth:
    """The faults that are injected in a flight, in the order in which they strike.

    removed_surfaces: surfaces that damage takes away. outside_class_from_second_fault: an unanticipated fault
    that stands for all faults together, from the instant at which a second surface fails; None if the
    diagnosis looks for pairs. No single fault explains such a flight, so it is outside the fault class.
    """

    faults: tuple[DeclaredFault, ...]
    rate_hz: float
    removed_surfaces: frozenset[str] = frozenset()
    outside_class_from_second_fault: DeclaredFault | None = None

    @classmethod
    def of(cls, scenario: Any) -> Self:
        """That of a `schema.Scenario`."""
        faults = sorted(map(DeclaredFault.of, scenario.faults), key=lambda fault: fault.at_s)
        damage = scenario.airframe.damage
        cases = [fault.case for fault in scenario.faults if isinstance(fault, Damage)]
        removed_surfaces = frozenset(surface for case in cases for surface in damage[case].takes)
        began_s, beyond = sorted(failing(scenario).values()), None
        if not scenario.fdi.pairs and len(began_s) > 1:
            beyond = DeclaredFault(None, UNANTICIPATED, began_s[1])
        return cls(tuple(faults), scenario.rate_hz, removed_surfaces, beyond)

    @property
    def first(self) -> DeclaredFault | None:
        """The fault that strikes first."""
        return self.faults[0] if self.faults else None

    @property
    def onset(self) -> Onset:
        """When the flight ceases to be healthy."""
        return self.onset_of(self.first)

    def onset_of(self, fault: DeclaredFault | None) -> Onset:
        """When a fault begins."""
        return Onset(None if fault is None else fault.at_s, self.rate_hz)

    def within(self, acting: Sequence[DeclaredFault]) -> Self:
        """That of a window in which these faults act."""
        surfaces = {fault.actuator for fault in acting if fault.actuator is not None}
        outside = self.outside_class_from_second_fault if len(surfaces) > 1 else None
        return replace(self, faults=tuple(acting), outside_class_from_second_fault=outside)

    def against(self, name: str | None, time_s: float | None) -> DeclaredFault | None:
        """The fault that a name given then is held against: the first one in force of those that it names
        rightly, or the first one that strikes."""
        meant = self.faults_named_rightly_by(name, time_s)
        now = (fault for fault in meant if time_s is not None and is_in_force(fault, time_s))
        return next(now, meant[0] if meant else None)

    def is_type_right(
        self, fault: DeclaredFault | None, kind: str | None, time_s: float | None
    ) -> bool | None:
        """Whether a type decided then is that of `fault`, or of another one that acts on its surface then."""
        if fault is None:
            return None if kind is None else False
        alike = [one for one in acting_at(self.faults, time_s or 0.0) if one.actuator == fault.actuator]
        right = [one.is_of_type(kind) for one in (fault, *(alike if fault.actuator else ()))]
        return None if right[0] is None else any(right)

    def faults_named_rightly_by(self, name: str | None, time_s: float | None) -> tuple[DeclaredFault, ...]:
        """The declared faults of which a name given then is right, as they strike."""
        candidates = [*self.faults]
        if self.outside_class_from_second_fault is not None and time_s is not None:
            candidates += (
                []
                if self.onset_of(self.outside_class_from_second_fault).is_false(time_s)
                else [self.outside_class_from_second_fault]
            )
        return tuple(fault for fault in candidates if fault.is_named_by(name, self.removed_surfaces))

    def is_premature(
        self, name: str | None, time_s: float | None, fault: DeclaredFault | None
    ) -> bool | None:
        """Whether a name was given before the fault it is held against began; None without a name."""
        if name is None or time_s is None:
            return None
        return fault is not None and self.onset_of(fault).is_false(time_s)


ExpectationRule = tuple[Callable[[Metrics], Any], Callable[[Any, Any], bool]]
"""From the metrics what was found; from that and what was expected whether it will do."""


def evaluate(expect: Any, metrics: Metrics) -> list[Expectation]:
    """One record for each expectation set in `expect`, in its fields' order; with `reason`, where one is
    known."""
    return [
        _judged_expectation(name, rule, expected, metrics)
        for name, rule, expected in _names_rules_and_limits(expect)
    ]


def _judged_expectation(name: str, rule: ExpectationRule, expected: Any, metrics: Metrics) -> Expectation:
    found, met = rule
    actual = found(metrics)
    actual = list(actual) if isinstance(actual, tuple) else actual
    of_one_name = name in _EXPECTATIONS_OF_ONE_NAME and not isinstance(
        expected, list
    )  # a list holds none that is premature
    early = of_one_name and metrics.isolation is not None and bool(metrics.isolation.premature)
    passed = met(actual, expected) and not early
    why = "" if passed or name not in OF_DIAGNOSIS else _reason_not_met(expected, early, metrics)
    return Expectation(name, passed, expected, actual, reason=why or None)


def _reason_not_met(expected: Any, early: bool, metrics: Metrics) -> str:
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


def expectation_names(expect: Any) -> list[str]:
    """The names of what a scenario expects, as in `evaluate`."""
    return [name for name, _, _ in _names_rules_and_limits(expect)]


def _names_rules_and_limits(expect: Any) -> Iterator[tuple[str, ExpectationRule, Any]]:
    if expect is None:
        return
    for name, expected in expect.model_dump(exclude_none=True).items():
        if isinstance(expected, tuple):
            yield name, _RULE_OF_LIST_EXPECTATION[name], list(expected)
        elif isinstance(expected, dict):
            yield from (
                (f"{name}.{part}", _rule_of_part(name, part), limit) for part, limit in expected.items()
            )
        else:
            yield name, _RULE_OF_EXPECTATION[name], expected


def _rule_of_part(name: str, part: str) -> ExpectationRule:
    """The rule of one part of an expectation that has several: of an arrival, or of a tracking error."""
    if name == "arrives":
        return _getter_of_metric("arrival", part), eq if part == "in_envelope" else _magnitude_at_most
    return lambda metrics: getattr(getattr(metrics.tracking, name), part, None), _at_most


def _getter_of_metric(section: str, key: str) -> Callable[[Metrics], Any]:
    return lambda metrics: getattr(getattr(metrics, section), key, None)


def _isolated_names(metrics: Metrics) -> list[str]:
    return list(metrics.isolation.names)


def _at_most(found: float | None, limit: float) -> bool:
    return found is not None and found <= limit


def _magnitude_at_most(found: float | None, limit: float) -> bool:
    return found is not None and abs(found) <= limit


def _type_is_among_candidates(candidates: tuple[str, ...], kind: str) -> bool:
    return any(kind == candidate.rpartition(":")[2] for candidate in candidates)


_EXPECTATIONS_OF_ONE_NAME = ("isolated_as", "isolated_within_s", "isolated_type", "candidate_type")
_RULE_OF_LIST_EXPECTATION: dict[str, ExpectationRule] = {"isolated_as": (_isolated_names, eq)}
"""Of the expectations that may be a list."""

_RULE_OF_EXPECTATION: dict[str, ExpectationRule] = {
    "detected_within_s": (_getter_of_metric("detection", "delay_s"), _at_most),
    "isolated_as": (_getter_of_metric("isolation", "fault"), eq),
    "isolated_within_s": (_getter_of_metric("isolation", "delay_s"), _at_most),
    "isolated_type": (_getter_of_metric("isolation", "type"), eq),
    "candidate_type": (_getter_of_metric("isolation", "candidates"), _type_is_among_candidates),
    "no_false_alarm": (lambda metrics: not metrics.false_alarm, eq),
    "no_departure": (lambda metrics: metrics.departure is None, eq),
    "altitude_within_m": (_getter_of_metric("profile", "altitude_m"), _at_most),
    "airspeed_within_mps": (_getter_of_metric("profile", "airspeed_mps"), _at_most),
    "airspeed_within_limits_mps": (_getter_of_metric("profile", "airspeed_limited_mps"), _at_most),
    "heading_within_deg": (_getter_of_metric("profile", "heading_deg"), _at_most),
    "stays_in_envelope": (lambda metrics: metrics.envelope.exits == 0, eq),
}


RatesPqr = tuple[float, float, float]
MetricsRecord = TypeVar("MetricsRecord", bound=model.Part)

TAKEN_OVER, LONG_S = "reallocated", 1.0  # a change of mode that comes later than this is explained
NEAR_THRESHOLD_SHARE = 0.9  # of the worst-case test's bound, in healthy flight
DRIFT_MPS, DRIFT_M = 5.0, 300.0  # a flight that ends further from where it began has wandered off


def metrics(flight: "Landing") -> Document:
    """The document of a flight, key by key in the order documented."""
    return measure(flight).document()


def measure(flight: "Landing") -> Metrics:
    """What a flight amounts to."""
    found = _metrics_before_expectations(flight, Truth.of(flight.scenario))
    found = replace(found, hints=tuple(hints(flight, found)))
    expectations = tuple(evaluate(flight.scenario.expect, found))
    return replace(found, expectations=expectations, passed=all(one.passed for one in expectations))


def _metrics_before_expectations(flight: "Landing", truth: Truth) -> Metrics:
    """The same before it is held against what was expected."""
    scenario = flight.scenario
    return Metrics(
        scenario=scenario.name,
        seed=scenario.seed,
        frames=flight.frames,
        flight=_condition_record(flight),
        fault=_first_fault_record(truth),
        faults=tuple(map(_declared_fault_record, truth.faults)),
        assumes=("sensors-sound",) if scenario.fdi.assumes_sound_sensors else (),
        outside_class=outside_class(scenario),
        detection=_detection_record(flight, truth),
        isolation=_isolation_record(flight, truth),
        windows=_window_records(flight, truth),
        # the alarm is latched: there is one a diagnosis
        false_alarm=any(truth.onset.is_false(time_s) for time_s in _alarm_times_s(flight)),
        fault_free_s=_rounded_known_number(fault_free_s(flight)),
        tracking=_tracking_record(flight, truth),
        supervisor=tuple(
            model.ModeChange(_rounded_known_number(time_s), mode) for time_s, mode in flight.supervisor
        ),
        changes=tuple(_change_record(change, truth) for change in flight.changes),
        mode_changes_left_out=flight.mode_changes - len(flight.supervisor),
        envelope_exits=tuple(
            model.EnvelopeExit(*map(_rounded_known_number, exit)) for exit in flight.envelope_exits
        ),
        envelope=model.EnvelopeExitTotals(
            flight.exits, _rounded_known_number(flight.outside_s), flight.exits - len(flight.envelope_exits)
        ),
        departure=_departure_record(flight),
        authority=_record_of_mapping(model.Authority, flight.authority),
        engine_power=_record_of_mapping(model.EnginePowerUse, flight.engine_power),
        profile=_record_of_mapping(model.ProfileDeviations, _profile_deviations_in_deg(flight.profile)),
        arrival=_arrival_record(flight),
        limits=tuple(model.ProtectionLimit.of(_with_rounded_numbers(limit)) for limit in flight.limits),
        saturation_s=_with_rounded_numbers(flight.saturation_s),
        hints=(),
        expectations=(),
        passed=True,
        versions=dict(versions()),
    )


def as_json(document: Any) -> str:
    """`document` as JSON text, keys in the order given; raises ValueError on NaN or infinity."""
    text = json.dumps(document, indent=2, allow_nan=False, ensure_ascii=False) + "\n"
    return text.encode(errors="backslashreplace").decode()  # a path that is not UTF-8: JSON's own escapes


@cache
def versions() -> Document:
    """Versions of what produces the numbers."""
    packages = {name: version(name) for name in ("beaver-ftc", "jsbsim", "numpy", "numba")}
    return packages | {"python": platform.python_version()}


def faults_of(scenario: "Scenario") -> list[Document]:
    """Every declared fault, in the order in which they strike: what, when, and how large."""
    return [_declared_fault_record(fault).document() for fault in Truth.of(scenario).faults]


def _declared_fault_record(fault: DeclaredFault) -> model.DeclaredFault:
    return model.DeclaredFault(
        fault.actuator, fault.type, fault.at_s, fault.end_s, str(fault.profile), dict(fault.size or {}),
        sensor=fault.sensor,
    )  # fmt: skip


def _first_fault_record(truth: Truth) -> model.Fault | None:
    """The earliest declared fault."""
    first = truth.first
    if first is None:
        return None
    return model.Fault(first.actuator, first.type, first.at_s, sensor=first.sensor)


def _detection_record(flight: "Landing", truth: Truth) -> model.Detection:
    return model.Detection(
        detected=flight.detection_time_s is not None,
        time_s=_rounded_number_or_none(flight.detection_time_s),
        delay_s=truth.onset.delay_s(flight.detection_time_s),
        axis=flight.detection_axis,
        guaranteed_delay_s=_rounded_number_or_none(flight.guaranteed_delay_s),
        statistical=_record_of_mapping(model.Statistical, flight.statistical),
        inconclusive=_record_of_mapping(model.Inconclusive, flight.inconclusive),
    )


def _isolation_record(flight: "Landing", truth: Truth) -> model.Isolation:
    meant = truth.against(flight.isolated, flight.isolation_time_s)
    against = meant or truth.first
    correct = None if flight.isolated is None else meant is not None
    type_correct = truth.is_type_right(against, flight.isolation_type, flight.type_time_s)
    named = _named_fault_record(vars(flight), against, (correct, type_correct), truth)
    return model.Isolation(
        isolated=flight.isolated is not None,
        **vars(named),
        withdrawn=tuple(map(_withdrawn_record, flight.withdrawn)),
        names=_names_given_in_flight(flight, truth),
        probing_s=_rounded_interval(flight.probing_s),
        faults=tuple(_record_of_one_of_several_faults(found, truth) for found in flight.faults),
        types_withdrawn=tuple(map(_withdrawn_record, flight.withdrawn_types)) or None,
    )


def _withdrawn_record(gone: Document) -> model.Withdrawn:
    return model.Withdrawn.of(_with_rounded_numbers(gone))


def _window_records(flight: "Landing", truth: Truth) -> tuple[model.Window, ...] | None:
    """What was found in each window; null of a flight that has no more than one, to its end."""
    known = flight.windows
    if len(known) < 2 and not (known and known[0]["to_s"] < flight.frames / truth.rate_hz):
        return None
    return tuple(_window_record(_with_rounded_numbers(window), truth) for window in known)


def _window_record(window: Document, truth: Truth) -> model.Window:
    """A name that stands since before a fault of the window counts from that fault on."""
    last_frame_s, found = window["to_s"] - 1.0 / truth.rate_hz, window["found"]
    acting = acting_at(truth.faults, last_frame_s)
    here = truth.within(acting)
    alarm_s = window["alarm_s"]
    return model.Window(
        from_s=window["from_s"],
        to_s=window["to_s"],
        faults=tuple(i for i, fault in enumerate(truth.faults) if fault in acting),
        detected=alarm_s is not None,
        time_s=alarm_s,
        delay_s=Onset(window["from_s"], truth.rate_hz).delay_s(alarm_s),
        isolation=tuple(_name_in_window(one, here, last_frame_s) for one in found.get("faults") or (found,)),
    )


def _name_in_window(found: Document, truth: Truth, last_frame_s: float) -> model.NameInWindow:
    against = truth.against(found["isolated"], last_frame_s)
    if against is not None:
        begins_s = truth.onset_of(against).first_frame_with_fault_s
        times = {key: found.get(key) for key in ("isolation_time_s", "type_time_s")}
        found = found | {key: max(time, begins_s) for key, time in times.items() if time is not None}
    at_s = found.get("estimate_at_s") or last_frame_s
    named = _record_of_one_of_several_faults(found | {"estimate_at_s": at_s}, truth)
    on_place = [fault for fault in truth.faults if fault.actuator == named.fault]
    true_size = size_at(named.type, on_place, at_s) if on_place and named.estimate is not None else None
    return model.NameInWindow(**vars(named), true_size=_rounded_number_or_none(true_size))


def _names_given_in_flight(flight: "Landing", truth: Truth) -> tuple[str, ...]:
    """The names given in flight, those that were withdrawn too, each once, in the order of the faults that
    they name, and as they were given; without those that were premature."""
    given = [(gone["fault"], gone["from_s"]) for gone in flight.withdrawn]
    if flight.faults:
        given += [(one["isolated"], one["isolation_time_s"]) for one in flight.faults]
    else:
        given.append((flight.isolated, flight.isolation_time_s))
    said = []
    for name, time_s in given:
        meant = truth.faults_named_rightly_by(name, time_s)
        of = meant[0] if meant else truth.first
        if name is not None and not truth.is_premature(name, time_s, of):
            said.append((of.at_s if of else 0.0, time_s, name))
    return tuple(dict.fromkeys(name for _, _, name in sorted(said)))


def _record_of_one_of_several_faults(found: Document, truth: Truth) -> model.Named:
    """One of several faults at once; `fault` is null where a plane's is open between its candidates."""
    name, kind = found["isolated"], found["isolation_type"]
    meant = truth.against(name, found["isolation_time_s"])
    correct = None if name is None else meant is not None
    type_correct = None if kind is None else truth.is_type_right(meant, kind, found.get("type_time_s"))
    of_ours = {"so_far": None if name is None else True, **found}  # no other diagnosis names several
    return _named_fault_record(of_ours, meant, (correct, type_correct), truth)


def _named_fault_record(
    found: Document, fault: DeclaredFault | None, right: tuple[bool | None, bool | None], truth: Truth
) -> model.Named:
    """A fault that is named; fault: since when it is there. right: whether it, and its type, are, unless they
    were named before."""
    estimate, kind, onset = found.get("estimate"), found["isolation_type"], truth.onset_of(fault)
    premature = truth.is_premature(found["isolated"], found["isolation_time_s"], fault)
    angle_rad = None if is_share(kind) else estimate
    return model.Named(
        fault=found["isolated"],
        type=kind,
        time_s=_rounded_number_or_none(found["isolation_time_s"]),
        delay_s=onset.delay_s(found["isolation_time_s"]),
        correct=right[0] and not premature,
        candidates=tuple(found["candidates"]),
        type_correct=right[1] and not premature,
        type_delay_s=onset.delay_s(found.get("type_time_s")),
        estimate=_rounded_number_or_none(estimate),
        estimate_deg=None if angle_rad is None else _rounded_number_or_none(math.degrees(angle_rad)),
        estimate_interval=_rounded_interval(found.get("estimate_interval")),
        frequency_rad_s=_rounded_number_or_none(found.get("frequency_rad_s")),
        so_far=found["so_far"],
        premature=premature,
        estimate_at_s=_rounded_number_or_none(found.get("estimate_at_s")),
    )


def _tracking_record(flight: "Landing", truth: Truth) -> model.Tracking:
    at_once = truth.first is not None and truth.first.at_s <= 0  # then nothing was measured before it
    return model.Tracking(
        pre_fault_rms_deg_s=None if at_once else _rates_record_deg_s(flight.pre_fault_rms_rad_s),
        post_fault_rms_deg_s=_rates_record_deg_s(flight.post_fault_rms_rad_s),
        surface_travel_deg=_with_rounded_numbers(_values_in_deg(flight.surface_travel_rad)),
        surface_energy_deg2_s=_with_rounded_numbers(
            _values_in_deg(_values_in_deg(flight.surface_energy_rad2_s))
        ),
    )


def _profile_deviations_in_deg(off: dict[str, float | None] | None) -> Document | None:
    """Deviations from the commanded profile; null without an autopilot, or where a channel is not flown."""
    if off is None:
        return None
    in_deg = {"heading_deg": math.degrees, "bank_deg": math.degrees}
    return {name: None if away is None else in_deg.get(name, float)(away) for name, away in off.items()}


def _arrival_record(flight: "Landing") -> model.ArrivalDeviations | None:
    """Where a flight along a profile has come to; null without an autopilot, or if the aircraft is lost."""
    off = _profile_deviations_in_deg(flight.arrival)
    if off is None or flight.departure is not None:
        return None
    return _record_of_mapping(model.ArrivalDeviations, {**off, "in_envelope": not flight.outside_at_end})


def _departure_record(flight: "Landing") -> model.Departure | None:
    return flight.departure and model.Departure(
        _rounded_known_number(flight.departure[0]), flight.departure[1]
    )


def _alarm_times_s(flight: "Landing") -> list[float]:
    """When there was an alarm: of the diagnosis at the end, and of those that changes in flight replaced."""
    alarms = [flight.detection_time_s, *(change.get("detection_time_s") for change in flight.changes)]
    return [time_s for time_s in alarms if time_s is not None]


def fault_free_s(flight: "Landing") -> float:
    """Time under observation in which an alarm is a false one: until the first fault, the first alarm of any
    diagnosis, or the end. Rates of false alarms are per this time."""
    faults = [fault.at_s for fault in flight.scenario.faults]
    return min([flight.frames / flight.scenario.rate_hz, *_alarm_times_s(flight), *faults])


def _change_record(change: Document, truth: Truth) -> model.ChangeInFlight:
    """A change in flight, with what to think of the alarm of the diagnosis that it ended."""
    made, alarm_s = model.ChangeInFlight.of(_with_rounded_numbers(change)), change.get("detection_time_s")
    return made if alarm_s is None else replace(made, false_alarm=truth.onset.is_false(alarm_s))


def _record_of_mapping(of: type[MetricsRecord], found: Mapping[str, Any] | None) -> MetricsRecord | None:
    """A section that a flight has as a mapping; null if it has none."""
    return None if found is None else of.of(_with_rounded_numbers(found))


def _rates_record_deg_s(rates_rad_s: RatesPqr | None) -> model.Rates | None:
    return rates_rad_s and model.Rates(*(_rounded_number_or_none(math.degrees(rate)) for rate in rates_rad_s))


def _values_in_deg(angles: dict[str, float]) -> dict[str, float]:
    return {name: math.degrees(angle) for name, angle in angles.items()}


def _rounded_interval(ends: tuple[float, float] | None) -> Any:
    return tuple(map(_rounded_number_or_none, ends)) if ends else None


def _with_rounded_numbers(value: Any) -> Any:
    """A part of a landing as the document has it: each number as `_rounded_number_or_none` gives it, each
    sequence as a list."""
    if isinstance(value, float):  # first, as most are
        return _rounded_number_or_none(value)
    if isinstance(value, dict):
        return {key: _with_rounded_numbers(entry) for key, entry in value.items()}
    return [_with_rounded_numbers(entry) for entry in value] if isinstance(value, list | tuple) else value


def _rounded_known_number(value: float) -> Any:
    return _rounded_number_or_none(value)


def _rounded_number_or_none(value: float | None) -> float | None:
    """A finite Python float without the rounding dust of frame times (nine decimals), or null."""
    if value is None or not math.isfinite(value):
        return None
    return round(float(value), 9)


def _condition_record(flight: "Landing") -> model.FlightCondition:
    scenario = flight.scenario
    return model.FlightCondition(
        airspeed_mps=scenario.initial.airspeed_mps,
        altitude_m=scenario.initial.altitude_m,
        rate_hz=scenario.rate_hz,
        flown_s=round(flight.frames / scenario.rate_hz, 9),
        scheme=scenario.fdi.scheme,
        fault_class=scenario.fdi.fault_class,
        law=scenario.control.law,
    )


def hints(flight: "Landing", flight_metrics: Metrics) -> list[str]:
    """Notes without which a reader would misread the verdict: one sentence each."""
    scenario = flight.scenario
    of_diagnosis = (
        (_hint_alarm_in_one_frame, _hint_several_faults, _hint_fault_too_small)
        if scenario.fdi.diagnoses
        else ()
    )
    said = [
        *(says(scenario, flight_metrics) for says in of_diagnosis),
        _hint_residual_near_threshold(flight),
        _hint_late_reallocation(flight_metrics),
    ]
    said.append(_hint_drift(flight))
    return [sentence for sentence in said if sentence]


def _hint_several_faults(scenario: "Scenario", flight_metrics: Metrics) -> str:
    return "" if scenario.fdi.pairs else of_several(scenario)


def _hint_fault_too_small(scenario: "Scenario", flight_metrics: Metrics) -> str:
    detection = flight_metrics.detection
    if not scenario.faults or detection.detected or detection.guaranteed_delay_s is not None:
        return ""
    if detection.inconclusive:  # which has a line of its own
        return ""
    return (
        "no alarm, and no alarm was guaranteed: the effect of the fault stayed within the uncertainty that "
        "fdi.bounds declares; a larger fault, a stronger reference or tighter bounds would make it detectable"
    )


def _hint_alarm_in_one_frame(scenario: "Scenario", flight_metrics: Metrics) -> str:
    """The shortest delay that there is: it says nothing of a flight in which something is uncertain."""
    delay_s, frame_s = flight_metrics.detection.delay_s, 1.0 / scenario.rate_hz
    if delay_s is None or delay_s > frame_s + TIME_TOLERANCE_S or not _has_no_errors(scenario):
        return ""
    return (
        f"the alarm came within one frame ({frame_s:.2g} s): sensors exact, servos ideal, the air "
        "is still, and all errors are declared"
    )


def _has_no_errors(scenario: "Scenario") -> bool:
    """Whether sensors and servos are ideal, the air is still and nothing is undeclared."""
    parts = scenario.sensors.is_ideal, scenario.actuators.is_ideal, scenario.environment.is_still
    return all(parts) and declares_all(scenario)


def _hint_residual_near_threshold(flight: "Landing") -> str:
    """The worst-case test has next to nothing left before the fault, which any fault then takes, or an error
    that is larger than declared."""
    used = max(flight.closest_approach, default=0.0)
    if not NEAR_THRESHOLD_SHARE <= used <= 1.0:
        return ""
    before = " before the fault" if flight.scenario.faults else ""
    return (
        f"the residual already reaches {math.floor(1000.0 * used) / 10.0:g} % of its threshold{before}: a "
        "slightly larger error would raise a false alarm"
    )


def _hint_late_reallocation(flight_metrics: Metrics) -> str:
    """Why the law goes on with a surface that has been named long since: another takes over only where it is
    weak or stuck, which the name alone does not say. Nothing of several faults: which of them another surface
    took over is not known here."""
    isolation = flight_metrics.isolation
    taken_s = [change.time_s for change in flight_metrics.supervisor if change.mode == TAKEN_OVER]
    if not taken_s or isolation.time_s is None or taken_s[0] - isolation.time_s < LONG_S:
        return ""
    if isolation.faults:
        return ""
    return (
        f"{isolation.fault} was named at {isolation.time_s:.2f} s; its demand was reallocated at "
        f"{taken_s[0]:.2f} s, when it was certain that the surface is weak or stuck. The law would have "
        "corrected an offset or a slow surface without reallocation"
    )


def _hint_drift(flight: "Landing") -> str:
    """Attitude, height and speed are left alone unless a scenario has an autopilot."""
    if flight.end is None:
        return ""
    initial = flight.scenario.initial
    ends = (
        ("airspeed", initial.airspeed_mps, flight.end[0], DRIFT_MPS, "m/s"),
        ("altitude", initial.altitude_m, flight.end[1], DRIFT_M, "m"),
    )
    far = [
        f"{what} {'fell' if b < a else 'rose'} from {a:.0f} to {b:.0f} {unit}"
        for what, a, b, most, unit in ends
        if abs(b - a) > most
    ]
    if not far or getattr(flight.scenario, "autopilot", None):
        return ""
    return f"{' and '.join(far)} (only the body rates are controlled in this scenario)"
