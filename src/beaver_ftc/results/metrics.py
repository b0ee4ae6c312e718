"""The metrics of a flight: the document metrics.json, with the expectations of the scenario (`expect:`).

This module alone decides whether an alarm is false, how late it is, and whether a name is correct:

    term         meaning
    in force     a fault is in force from the first frame whose time is not before `at_s`, until it ends
    false        an alarm before the first fault is in force
    delay, s     time from the first frame with the fault to an event
    premature    a name that is given before its fault began; such a name is never correct

Times are in s from the start of the flight, rates in deg/s. A quantity that does not exist is null: a
document never holds NaN. Nothing in the document depends on the wall clock or on the name of the machine, so
that the same scenario and seed give the same file.

The fields of `results/model.py` explain the keys. This module has three parts: the judgement of events
(`Onset`, `Truth`), the sections of the document (`measure`), and the hints (`hints`).
"""

import json
import math
import platform
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from importlib.metadata import version
from math import inf
from typing import TYPE_CHECKING, Any, Self

from beaver_ftc.results import model
from beaver_ftc.results.expectations import evaluate
from beaver_ftc.results.model import DeclaredFault, Document, Metrics, Quantity, rounded
from beaver_ftc.scenario.diagnosis import failing, of_several
from beaver_ftc.scenario.faults import UNANTICIPATED, Damage, acting_at, is_share, size_at
from beaver_ftc.scenario.signals import TIME_TOLERANCE_S, first_frame_s, is_before, is_in_force
from beaver_ftc.scenario.undeclared import declares_all
from beaver_ftc.scenario.warnings import outside_class

if TYPE_CHECKING:
    from beaver_ftc.loop.outcome import Landing
    from beaver_ftc.scenario.schema import Scenario


_TIME_DECIMALS = 9  # decimals of a second: removes the rounding of frame times


@dataclass(frozen=True)
class Onset:
    """The instant from which events are judged.

    at_s: begin of the fault as declared; None without a fault. rate_hz: rate of the frames; None for a
    recorded log, whose fault begins between frames.
    """

    at_s: Quantity
    rate_hz: Quantity = None

    @property
    def first_frame_with_fault_s(self) -> float:
        """Time of the first frame with the fault, s; infinite without a fault."""
        if self.at_s is None:
            return inf
        return self.at_s if self.rate_hz is None else first_frame_s(self.at_s, self.rate_hz)

    def is_false(self, time_s: Any) -> Any:
        """Whether an alarm at a time, or at each time of an array, is false: the fault has not begun."""
        return is_before(time_s, inf if self.at_s is None else self.at_s)

    def delay_s(self, time_s: Quantity) -> Quantity:
        """Time from the first frame with the fault to an event, s; None without an event, or for one before
        the fault."""
        if time_s is None or self.is_false(time_s):
            return None
        return round(max(time_s - self.first_frame_with_fault_s, 0.0), _TIME_DECIMALS)


def strikes_within(at_s: Any, flown_s: Any) -> Any:
    """Whether a fault, or each fault of an array, begins before its flight ends. NaN, no fault, gives
    False."""
    return at_s < flown_s


def is_late(delay_s: Any, guaranteed_delay_s: Any, frame_s: Any) -> Any:
    """Whether a detection, or each one of an array, came more than a frame after the instant from which it
    was certain: delay > guaranteed delay + frame, s."""
    return delay_s > guaranteed_delay_s + frame_s + TIME_TOLERANCE_S


@dataclass(frozen=True)
class Truth:
    """The faults that are injected in a flight, in the order in which they strike.

    removed_surfaces: surfaces that damage takes away. outside_class_from_second_fault: an unanticipated fault
    that stands for all faults together. It begins when a second surface fails, since no single fault explains
    the flight from then on. None if one surface fails at most, or if the diagnosis tests pairs of faults.

    A name is compared with one fault. Its delay counts from the first frame with this fault, and is None if
    the name is premature, that is, given before the fault began:

        the name is right for       compared with                   correct
        a fault in force then       the first of these              yes
        other faults only           the first of these              no if premature; yes if it has ended
        no fault                    the first fault that strikes    no
        (no name)                   the first fault that strikes    None

    `DeclaredFault.is_named_by` says which names are right. `unanticipated` is also right for the fault
    outside of the class, once this one has begun. A wrong name in a window, or of several, is compared with
    no fault.
    """

    faults: tuple[DeclaredFault, ...]
    rate_hz: float
    removed_surfaces: frozenset[str] = frozenset()
    outside_class_from_second_fault: DeclaredFault | None = None

    @classmethod
    def of(cls, scenario: Any) -> Self:
        """The truth of a `schema.Scenario`."""
        faults = sorted(map(DeclaredFault.of_scenario, scenario.faults), key=lambda fault: fault.at_s)
        damage = scenario.airframe.damage
        cases = [fault.case for fault in scenario.faults if isinstance(fault, Damage)]
        removed_surfaces = frozenset(surface for case in cases for surface in damage[case].takes)
        began_s = sorted(failing(scenario).values())
        outside = None
        if not scenario.fdi.pairs and len(began_s) > 1:
            outside = DeclaredFault(None, UNANTICIPATED, began_s[1])
        return cls(tuple(faults), scenario.rate_hz, removed_surfaces, outside)

    @property
    def first(self) -> DeclaredFault | None:
        """The fault that strikes first."""
        return self.faults[0] if self.faults else None

    @property
    def onset(self) -> Onset:
        """The begin of the first fault."""
        return self.onset_of(self.first)

    def onset_of(self, fault: DeclaredFault | None) -> Onset:
        """The begin of a fault; without a fault, an onset that never comes."""
        return Onset(None if fault is None else fault.at_s, self.rate_hz)

    def within(self, acting: Sequence[DeclaredFault]) -> Self:
        """The truth of a window in which these faults act."""
        surfaces = {fault.actuator for fault in acting if fault.actuator is not None}
        outside = self.outside_class_from_second_fault if len(surfaces) > 1 else None
        return replace(self, faults=tuple(acting), outside_class_from_second_fault=outside)

    def against(self, name: str | None, time_s: Quantity) -> DeclaredFault | None:
        """The fault with which a name given at `time_s` is compared. Among the faults for which the name is
        right: the first one in force then, or else the first one that strikes. None if there is no such
        fault."""
        faults = self.faults_named_rightly_by(name, time_s)
        in_force = (fault for fault in faults if time_s is not None and is_in_force(fault, time_s))
        return next(in_force, faults[0] if faults else None)

    def is_type_right(self, fault: DeclaredFault | None, kind: str | None, time_s: Quantity) -> bool | None:
        """Whether a type named at `time_s` is the type of `fault`, or of another fault that acts on the same
        surface then. None if no type is named, or if `fault` has no type that can be named; without `fault`,
        a named type is wrong."""
        if fault is None:
            return None if kind is None else False
        others = [
            other for other in acting_at(self.faults, time_s or 0.0) if other.actuator == fault.actuator
        ]
        verdicts = [other.is_of_type(kind) for other in (fault, *(others if fault.actuator else ()))]
        return None if verdicts[0] is None else any(verdicts)

    def faults_named_rightly_by(self, name: str | None, time_s: Quantity) -> tuple[DeclaredFault, ...]:
        """The faults for which a name given at `time_s` is right, in the order in which they strike."""
        candidates = self.faults
        outside = self.outside_class_from_second_fault
        if outside is not None and time_s is not None and not self.onset_of(outside).is_false(time_s):
            candidates += (outside,)
        return tuple(fault for fault in candidates if fault.is_named_by(name, self.removed_surfaces))

    def is_premature(self, name: str | None, time_s: Quantity, fault: DeclaredFault | None) -> bool | None:
        """Whether a name was given before `fault` began. fault: the one with which the name is compared. None
        without a name."""
        if name is None or time_s is None:
            return None
        return fault is not None and self.onset_of(fault).is_false(time_s)


# Conditions of the hints.
TAKEN_OVER = "reallocated"  # mode that replaces the named surface
LONG_S = 1.0  # a reallocation that begins so long after the name is late
NEAR_THRESHOLD_SHARE = 0.9  # a residual of a healthy flight beyond this share of its threshold is near it
DRIFT_MPS, DRIFT_M = 5.0, 300.0  # a larger change of airspeed or altitude over the flight is a drift


def metrics(flight: "Landing") -> Document:
    """The document of a flight, with its keys in the order of `model.Metrics`."""
    return measure(flight).document()


def measure(flight: "Landing") -> Metrics:
    """The metrics of a flight. Hints follow from the other metrics, and expectations are evaluated last."""
    truth = Truth.of(flight.scenario)
    amounts = Metrics.of(rounded(_measured(flight, truth)) | _declared(flight, truth))
    amounts = replace(amounts, hints=tuple(hints(flight, amounts)))
    expectations = tuple(evaluate(flight.scenario.expect, amounts))
    return replace(amounts, expectations=expectations, passed=all(bound.passed for bound in expectations))


def _declared(flight: "Landing", truth: Truth) -> Document:
    """The sections that repeat what the scenario declares."""
    scenario = flight.scenario
    first = truth.first
    return {
        "scenario": scenario.name, "seed": scenario.seed,
        "flight": model.FlightCondition(
            airspeed_mps=scenario.initial.airspeed_mps,
            altitude_m=scenario.initial.altitude_m,
            rate_hz=scenario.rate_hz,
            flown_s=round(flight.frames / scenario.rate_hz, _TIME_DECIMALS),
            scheme=scenario.fdi.scheme,
            fault_class=scenario.fdi.fault_class,
            law=scenario.control.law,
        ),
        "fault": first and model.Fault(first.actuator, first.type, first.at_s, sensor=first.sensor),
        "faults": truth.faults,
        "assumes": ("sensors-sound",) if scenario.fdi.assumes_sound_sensors else (),
        "outside_class": outside_class(scenario),
        "versions": dict(versions()),
    }  # fmt: skip


def _measured(flight: "Landing", truth: Truth) -> Document:
    """The sections that are measured. `Metrics.of` takes only the keys that a section has. Values that keep
    their name are therefore taken from all values of the landing, `landed`:

        the document   frames, supervisor, envelope_exits, departure, authority, engine_power, limits,
                       saturation_s
        detection      guaranteed_delay_s, statistical, inconclusive
        isolation      candidates, estimate_interval, frequency_rad_s, so_far, estimate_at_s, withdrawn,
                       probing_s
        envelope       exits, outside_s
    """
    landed = vars(flight)
    onset = truth.onset
    at_once = truth.first is not None and truth.first.at_s <= 0  # no frame is before the fault
    return landed | {
        "detection": landed | {
            "detected": flight.detection_time_s is not None,
            "time_s": flight.detection_time_s,
            "delay_s": onset.delay_s(flight.detection_time_s),
            "axis": flight.detection_axis,
        },
        "isolation": _isolation(flight, truth),
        "windows": _windows(flight, truth),
        # the alarm is latched, so that each diagnosis has one alarm
        "false_alarm": any(onset.is_false(time_s) for time_s in _alarm_times_s(flight)),
        "fault_free_s": fault_free_s(flight),
        "tracking": {
            "pre_fault_rms_deg_s": None if at_once else _in_deg(flight.pre_fault_rms_rad_s),
            "post_fault_rms_deg_s": _in_deg(flight.post_fault_rms_rad_s),
            "surface_travel_deg": _in_deg(flight.surface_travel_rad),
            "surface_energy_deg2_s": _in_deg(_in_deg(flight.surface_energy_rad2_s)),
        },
        "changes": [_change(change, truth) for change in flight.changes],
        "mode_changes_left_out": flight.mode_changes - len(flight.supervisor),
        "envelope": landed | {"exits_left_out": flight.exits - len(flight.envelope_exits)},
        "profile": _deviations(flight.profile),
        "arrival": _arrival(flight),
        "passed": True,
    }  # fmt: skip


def as_json(document: Any) -> str:
    """`document` as JSON text, keys in the order given; raises ValueError on NaN or infinity."""
    text = json.dumps(document, indent=2, allow_nan=False, ensure_ascii=False) + "\n"
    return text.encode(
        errors="backslashreplace"
    ).decode()  # a path that is not UTF-8 is written with escapes of JSON


@cache
def versions() -> Document:
    """Versions of Python and of the packages that compute the numbers."""
    packages = {name: version(name) for name in ("beaver-ftc", "jsbsim", "numpy", "numba")}
    return packages | {"python": platform.python_version()}


def faults_of(scenario: "Scenario") -> list[Document]:
    """Every declared fault as a document, in the order in which the faults strike."""
    return [fault.document() for fault in Truth.of(scenario).faults]


def _isolation(flight: "Landing", truth: Truth) -> Document:
    """The section `isolation`: the name at the end, all names, and each of several named faults."""
    return _named(vars(flight), truth, truth.first) | {
        "isolated": flight.isolated is not None,
        "names": _names_given_in_flight(flight, truth),
        "faults": [_named(finding, truth) for finding in flight.faults],
        "types_withdrawn": flight.withdrawn_types or None,
    }


def _windows(flight: "Landing", truth: Truth) -> list[Document] | None:
    """The alarm and the names in each window; None if one window lasts to the end of the flight."""
    windows = flight.windows
    end_s = flight.frames / truth.rate_hz
    if len(windows) > 1 or any(window["to_s"] < end_s for window in windows):
        return [_window(rounded(window), truth) for window in windows]
    return None


def _window(window: Document, truth: Truth) -> Document:
    """One window. A name that was given before a fault of the window began is counted from the begin of this
    fault."""
    last_frame_s = window["to_s"] - 1.0 / truth.rate_hz
    alarm_s = window["alarm_s"]
    finding = window["found"]
    acting = acting_at(truth.faults, last_frame_s)
    truth_within = truth.within(acting)
    return window | {
        "faults": [i for i, fault in enumerate(truth.faults) if fault in acting],
        "detected": alarm_s is not None,
        "time_s": alarm_s,
        "delay_s": Onset(window["from_s"], truth.rate_hz).delay_s(alarm_s),
        "isolation": [
            _name_in_window(name, truth_within, last_frame_s) for name in finding.get("faults") or (finding,)
        ],
    }


def _name_in_window(finding: Document, truth: Truth, last_frame_s: float) -> Document:
    """A name in the last frame of a window, with the true size. truth: the faults that act in the window."""
    fault = truth.against(finding["isolated"], last_frame_s)
    if fault is not None:
        begins_s = truth.onset_of(fault).first_frame_with_fault_s
        times = {key: finding.get(key) for key in ("isolation_time_s", "type_time_s")}
        finding = finding | {key: max(time, begins_s) for key, time in times.items() if time is not None}
    at_s = finding.get("estimate_at_s") or last_frame_s
    on_place = [fault for fault in truth.faults if fault.actuator == finding["isolated"]]
    has_size = on_place and finding.get("estimate") is not None
    true_size = size_at(finding["isolation_type"], on_place, at_s) if has_size else None
    return _named(finding | {"estimate_at_s": at_s}, truth) | {"true_size": true_size}


def _names_given_in_flight(flight: "Landing", truth: Truth) -> tuple[str, ...]:
    """All names given in flight that were not premature, withdrawn ones included, each once. They are ordered
    by the begin of the fault that they name, then by time."""
    names_and_times = [(withdrawn["fault"], withdrawn["from_s"]) for withdrawn in flight.withdrawn]
    names_and_times += [
        (name["isolated"], name["isolation_time_s"]) for name in flight.faults or (vars(flight),)
    ]
    names = []  # at_s of the fault, time of the name, name
    for name, time_s in names_and_times:
        faults = truth.faults_named_rightly_by(name, time_s)
        fault = faults[0] if faults else truth.first
        if name is not None and not truth.is_premature(name, time_s, fault):
            names.append((fault.at_s if fault else 0.0, time_s, name))
    return tuple(dict.fromkeys(name for _, _, name in sorted(names)))


def _named(finding: Document, truth: Truth, otherwise: DeclaredFault | None = None) -> Document:
    """A named fault, judged by the table of `Truth`. The key `fault` is None while several candidates remain.

    finding: name, type, size and their times, as the diagnosis reports them. otherwise: the fault with which
    a wrong or missing name is compared.
    """
    name = finding["isolated"]
    kind = finding["isolation_type"]
    time_s = finding["isolation_time_s"]
    estimate = finding.get("estimate")
    type_time_s = finding.get("type_time_s")
    right = truth.against(name, time_s)
    fault = right or otherwise
    onset = truth.onset_of(fault)
    premature = truth.is_premature(name, time_s, fault)
    type_is_right = truth.is_type_right(fault, kind, type_time_s)
    # only the built-in diagnosis names several faults, by exclusion: their findings have no `so_far`
    return {"so_far": None if name is None else True, **finding} | {
        "fault": name,
        "type": kind,
        "time_s": time_s,
        "delay_s": onset.delay_s(time_s),
        "correct": None if name is None else right is not None and not premature,
        "type_correct": type_is_right and not premature,
        "type_delay_s": onset.delay_s(type_time_s),
        "estimate": estimate if estimate is None else float(estimate),
        "estimate_deg": None if estimate is None or is_share(kind) else math.degrees(estimate),
        "premature": premature,
    }


def _deviations(by_channel: Mapping[str, Quantity] | None) -> Document | None:
    """Deviations from the commanded profile, angles in deg; None without an autopilot. by_channel: the same
    deviations, angles in rad also under the names that end in `_deg`."""
    angles = ("heading_deg", "bank_deg")
    if by_channel is None:
        return None
    return {
        name: math.degrees(deviation) if name in angles and deviation is not None else deviation
        for name, deviation in by_channel.items()
    }


def _arrival(flight: "Landing") -> Document | None:
    """Deviations from the profile at the end; None without an autopilot, or if the aircraft is lost."""
    deviations = _deviations(flight.arrival)
    if deviations and not flight.departure:
        return deviations | {"in_envelope": not flight.outside_at_end}
    return None


def _in_deg(angles: Any) -> Any:
    """Angles (rad) by name, or of each axis, in deg; None stays None."""
    if isinstance(angles, dict):
        return {name: math.degrees(angle) for name, angle in angles.items()}
    return angles and tuple(map(math.degrees, angles))


def _alarm_times_s(flight: "Landing") -> list[float]:
    """Times of the alarms of the last diagnosis, and of those that changes in flight replaced."""
    alarms = [flight.detection_time_s, *(change.get("detection_time_s") for change in flight.changes)]
    return [time_s for time_s in alarms if time_s is not None]


def fault_free_s(flight: "Landing") -> float:
    """Time in which an alarm would be false, s: until the first fault, the first alarm of any diagnosis, or
    the end. Rates of false alarms are per this time."""
    faults = [fault.at_s for fault in flight.scenario.faults]
    return min([flight.frames / flight.scenario.rate_hz, *_alarm_times_s(flight), *faults])


def _change(change: Document, truth: Truth) -> Document:
    """A change in flight; if it ended a diagnosis with an alarm, also whether this alarm was false."""
    alarm_s = change.get("detection_time_s")
    return change if alarm_s is None else change | {"false_alarm": truth.onset.is_false(alarm_s)}


def hints(flight: "Landing", flight_metrics: Metrics) -> list[str]:
    """Notes without which a reader could misunderstand the verdict, a sentence each."""
    scenario = flight.scenario
    of_diagnosis = (
        _hint_alarm_in_one_frame(scenario, flight_metrics),
        "" if scenario.fdi.pairs else of_several(scenario),
        _hint_fault_too_small(scenario, flight_metrics),
    )
    sentences = (
        *(of_diagnosis if scenario.fdi.diagnoses else ()),
        _hint_residual_near_threshold(flight),
        _hint_late_reallocation(flight_metrics),
        _hint_drift(flight),
    )
    return [sentence for sentence in sentences if sentence]


def _hint_fault_too_small(scenario: "Scenario", flight_metrics: Metrics) -> str:
    """A fault without an alarm, and without an instant from which an alarm was certain."""
    detection = flight_metrics.detection
    is_detectable = detection.detected or detection.guaranteed_delay_s is not None
    if not scenario.faults or is_detectable or detection.inconclusive:  # `inconclusive` has its own line
        return ""
    return (
        "no alarm, and no alarm was guaranteed: the effect of the fault stayed within the uncertainty that "
        "fdi.bounds declares; a larger fault, a stronger reference or tighter bounds would make it detectable"
    )


def _hint_alarm_in_one_frame(scenario: "Scenario", flight_metrics: Metrics) -> str:
    """An alarm in the first frame of the fault shows nothing about flights with errors, noise or wind."""
    delay_s = flight_metrics.detection.delay_s
    frame_s = 1.0 / scenario.rate_hz
    if delay_s is None or delay_s > frame_s + TIME_TOLERANCE_S:
        return ""
    if not (scenario.sensors.is_ideal and scenario.actuators.is_ideal and scenario.environment.is_still):
        return ""
    if not declares_all(scenario):
        return ""
    return (
        f"the alarm came within one frame ({frame_s:.2g} s): sensors exact, servos ideal, the air "
        "is still, and all errors are declared"
    )


def _hint_residual_near_threshold(flight: "Landing") -> str:
    """The residual nearly reaches its threshold in healthy flight: a slightly larger error than declared
    would exceed it."""
    share = max(flight.closest_approach, default=0.0)
    if not NEAR_THRESHOLD_SHARE <= share <= 1.0:
        return ""
    when = " before the fault" if flight.scenario.faults else ""
    return (
        f"the residual already reaches {math.floor(1000.0 * share) / 10.0:g} % of its threshold{when}: a "
        "slightly larger error would raise a false alarm"
    )


def _hint_late_reallocation(flight_metrics: Metrics) -> str:
    """Why the demand of a named surface was reallocated late: only a surface that is certainly weak or stuck
    is replaced. No hint for several faults, as the modes do not say which surface was replaced."""
    isolation = flight_metrics.isolation
    begun_s = [change.time_s for change in flight_metrics.supervisor if change.mode == TAKEN_OVER]
    if not begun_s or isolation.faults or isolation.time_s is None:
        return ""
    if begun_s[0] - isolation.time_s < LONG_S:
        return ""
    return (
        f"{isolation.fault} was named at {isolation.time_s:.2f} s; its demand was reallocated at "
        f"{begun_s[0]:.2f} s, when it was certain that the surface is weak or stuck. The law would have "
        "corrected an offset or a slow surface without reallocation"
    )


def _hint_drift(flight: "Landing") -> str:
    """Airspeed or altitude changed by more than DRIFT_MPS or DRIFT_M, because no autopilot held them."""
    if flight.end is None or flight.scenario.autopilot:
        return ""
    initial = flight.scenario.initial
    airspeed_mps, altitude_m = flight.end
    ends = (
        ("airspeed", initial.airspeed_mps, airspeed_mps, DRIFT_MPS, "m/s"),
        ("altitude", initial.altitude_m, altitude_m, DRIFT_M, "m"),
    )
    drifts = [
        f"{quantity} {'fell' if end < begin else 'rose'} from {begin:.0f} to {end:.0f} {unit}"
        for quantity, begin, end, limit, unit in ends
        if abs(end - begin) > limit
    ]
    return f"{' and '.join(drifts)} (only the body rates are controlled in this scenario)" if drifts else ""
