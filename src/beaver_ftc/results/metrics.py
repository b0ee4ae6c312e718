"""The metrics of a flight: the document metrics.json, with the expectations of the scenario (`expect:`).

This module alone decides whether an alarm is false, how late it is, and whether a name is correct. A fault is
in force in the first frame whose time is not before `at_s`. An alarm in that very frame, or later, is no
false alarm; its delay counts from that frame. A name given before its fault began is premature, and is not
correct, whatever it says.

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

`windows`, of a flight with several faults or one that ends: each time in which the same faults are in force,
with the first frame in it in which a detector is beyond its threshold, and the names and sizes that the
diagnosis gives in its last frame, held against the faults that act then. A name that stands since before
counts from the fault's first frame on.

`detection.inconclusive`: null, or the frames in which the built-in diagnosis can conclude nothing: their
`share`, the first of them `from_s`, and `reasons`, each with the `quantity`, its own `share`, the range that
was `measured`, the range that was `flown` outside of it, and what it `says`.
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


_TIME_DECIMALS = 9  # of a second: without the rounding of frame times


@dataclass(frozen=True)
class Onset:
    """The instant from which events are judged. at_s: as declared, None where nothing breaks. rate_hz: of the
    frames, None where the truth has none (a recorded log)."""

    at_s: Quantity
    rate_hz: Quantity = None

    @property
    def first_frame_with_fault_s(self) -> float:
        """Time of the first frame with the fault; infinite where nothing breaks."""
        if self.at_s is None:
            return inf
        return self.at_s if self.rate_hz is None else first_frame_s(self.at_s, self.rate_hz)

    def is_false(self, time_s: Any) -> Any:
        """Whether an alarm at a time, or at each of several, is a false one: there is no fault yet."""
        return is_before(time_s, inf if self.at_s is None else self.at_s)

    def delay_s(self, time_s: Quantity) -> Quantity:
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
        faults = sorted(map(DeclaredFault.of_scenario, scenario.faults), key=lambda fault: fault.at_s)
        damage = scenario.airframe.damage
        cases = [fault.case for fault in scenario.faults if isinstance(fault, Damage)]
        removed_surfaces = frozenset(surface for case in cases for surface in damage[case].takes)
        began_s = sorted(failing(scenario).values())
        beyond = None
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

    def against(self, name: str | None, time_s: Quantity) -> DeclaredFault | None:
        """The fault that a name given then is held against: the first one in force of those that it names
        rightly, or the first one that strikes."""
        meant = self.faults_named_rightly_by(name, time_s)
        now = (fault for fault in meant if time_s is not None and is_in_force(fault, time_s))
        return next(now, meant[0] if meant else None)

    def is_type_right(self, fault: DeclaredFault | None, kind: str | None, time_s: Quantity) -> bool | None:
        """Whether a type decided then is that of `fault`, or of another one that acts on its surface then."""
        if fault is None:
            return None if kind is None else False
        alike = [one for one in acting_at(self.faults, time_s or 0.0) if one.actuator == fault.actuator]
        right = [one.is_of_type(kind) for one in (fault, *(alike if fault.actuator else ()))]
        return None if right[0] is None else any(right)

    def faults_named_rightly_by(self, name: str | None, time_s: Quantity) -> tuple[DeclaredFault, ...]:
        """The declared faults of which a name given then is right, as they strike."""
        candidates = self.faults
        beyond = self.outside_class_from_second_fault
        if beyond is not None and time_s is not None and not self.onset_of(beyond).is_false(time_s):
            candidates += (beyond,)
        return tuple(fault for fault in candidates if fault.is_named_by(name, self.removed_surfaces))

    def is_premature(self, name: str | None, time_s: Quantity, fault: DeclaredFault | None) -> bool | None:
        """Whether a name was given before the fault it is held against began; None without a name."""
        if name is None or time_s is None:
            return None
        return fault is not None and self.onset_of(fault).is_false(time_s)


# When a hint is given:
TAKEN_OVER = "reallocated"  # this mode begins
LONG_S = 1.0  # so long after the name, or longer
NEAR_THRESHOLD_SHARE = 0.9  # the residual in healthy flight exceeds this share of its threshold
DRIFT_MPS, DRIFT_M = 5.0, 300.0  # airspeed, or altitude, changes by more over the flight


def metrics(flight: "Landing") -> Document:
    """The document of a flight, key by key in the order documented."""
    return measure(flight).document()


def measure(flight: "Landing") -> Metrics:
    """The metrics of a flight."""
    truth = Truth.of(flight.scenario)
    found = Metrics.of(rounded(_found(flight, truth)) | _declared(flight, truth))
    found = replace(found, hints=tuple(hints(flight, found)))
    expectations = tuple(evaluate(flight.scenario.expect, found))
    return replace(found, expectations=expectations, passed=all(one.passed for one in expectations))


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


def _found(flight: "Landing", truth: Truth) -> Document:
    """The sections that are measured. A key of a section, or of the document, that has the name of a field of
    the landing has its value, unless it stands below."""
    landed = vars(flight)
    onset = truth.onset
    at_once = truth.first is not None and truth.first.at_s <= 0  # then nothing was measured before it
    return landed | {
        "detection": landed | {
            "detected": flight.detection_time_s is not None,
            "time_s": flight.detection_time_s,
            "delay_s": onset.delay_s(flight.detection_time_s),
            "axis": flight.detection_axis,
        },
        "isolation": _isolation(flight, truth),
        "windows": _windows(flight, truth),
        # the alarm is latched: there is one a diagnosis
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
    return text.encode(errors="backslashreplace").decode()  # a path that is not UTF-8: JSON's own escapes


@cache
def versions() -> Document:
    """Versions of Python and of the packages that compute the numbers."""
    packages = {name: version(name) for name in ("beaver-ftc", "jsbsim", "numpy", "numba")}
    return packages | {"python": platform.python_version()}


def faults_of(scenario: "Scenario") -> list[Document]:
    """Every declared fault, in the order in which they strike: what, when, and how large."""
    return [fault.document() for fault in Truth.of(scenario).faults]


def _isolation(flight: "Landing", truth: Truth) -> Document:
    return _named(vars(flight), truth, truth.first) | {
        "isolated": flight.isolated is not None,
        "names": _names_given_in_flight(flight, truth),
        "faults": [_named(found, truth) for found in flight.faults],
        "types_withdrawn": flight.withdrawn_types or None,
    }


def _windows(flight: "Landing", truth: Truth) -> list[Document] | None:
    """The alarm and the names in each window; None if one window lasts to the end of the flight."""
    known = flight.windows
    end_s = flight.frames / truth.rate_hz
    if len(known) > 1 or any(window["to_s"] < end_s for window in known):
        return [_window(rounded(window), truth) for window in known]
    return None


def _window(window: Document, truth: Truth) -> Document:
    """One window. A name given before a fault of the window began counts from the begin of this fault."""
    last_frame_s = window["to_s"] - 1.0 / truth.rate_hz
    alarm_s = window["alarm_s"]
    found = window["found"]
    acting = acting_at(truth.faults, last_frame_s)
    here = truth.within(acting)
    return window | {
        "faults": [i for i, fault in enumerate(truth.faults) if fault in acting],
        "detected": alarm_s is not None,
        "time_s": alarm_s,
        "delay_s": Onset(window["from_s"], truth.rate_hz).delay_s(alarm_s),
        "isolation": [_name_in_window(one, here, last_frame_s) for one in found.get("faults") or (found,)],
    }


def _name_in_window(found: Document, truth: Truth, last_frame_s: float) -> Document:
    against = truth.against(found["isolated"], last_frame_s)
    if against is not None:
        begins_s = truth.onset_of(against).first_frame_with_fault_s
        times = {key: found.get(key) for key in ("isolation_time_s", "type_time_s")}
        found = found | {key: max(time, begins_s) for key, time in times.items() if time is not None}
    at_s = found.get("estimate_at_s") or last_frame_s
    on_place = [fault for fault in truth.faults if fault.actuator == found["isolated"]]
    has_size = on_place and found.get("estimate") is not None
    true_size = size_at(found["isolation_type"], on_place, at_s) if has_size else None
    return _named(found | {"estimate_at_s": at_s}, truth) | {"true_size": true_size}


def _names_given_in_flight(flight: "Landing", truth: Truth) -> tuple[str, ...]:
    """All names given in flight that were not premature, also withdrawn ones, each once: in the order of the
    faults that they name, then of time."""
    given = [(gone["fault"], gone["from_s"]) for gone in flight.withdrawn]
    given += [(one["isolated"], one["isolation_time_s"]) for one in flight.faults or (vars(flight),)]
    said = []
    for name, time_s in given:
        meant = truth.faults_named_rightly_by(name, time_s)
        of = meant[0] if meant else truth.first
        if name is not None and not truth.is_premature(name, time_s, of):
            said.append((of.at_s if of else 0.0, time_s, name))
    return tuple(dict.fromkeys(name for _, _, name in sorted(said)))


def _named(found: Document, truth: Truth, otherwise: DeclaredFault | None = None) -> Document:
    """A named fault; `fault` is None while several candidates remain. otherwise: the fault with which a wrong
    name is compared."""
    name = found["isolated"]
    kind = found["isolation_type"]
    time_s = found["isolation_time_s"]
    estimate = found.get("estimate")
    type_time_s = found.get("type_time_s")
    right = truth.against(name, time_s)
    fault = right or otherwise
    onset = truth.onset_of(fault)
    premature = truth.is_premature(name, time_s, fault)
    type_is_right = truth.is_type_right(fault, kind, type_time_s)
    # several are named by our diagnosis alone, which excludes all others
    return {"so_far": None if name is None else True, **found} | {
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


def _deviations(off: Mapping[str, Quantity] | None) -> Document | None:
    """Deviations from the commanded profile, angles in deg; None without an autopilot."""
    angles = ("heading_deg", "bank_deg")
    if off is None:
        return None
    return {
        name: math.degrees(away) if name in angles and away is not None else away
        for name, away in off.items()
    }


def _arrival(flight: "Landing") -> Document | None:
    """Deviations from the profile at the end; None without an autopilot, or if the aircraft is lost."""
    off = _deviations(flight.arrival)
    return None if off is None or flight.departure else off | {"in_envelope": not flight.outside_at_end}


def _in_deg(angles: Any) -> Any:
    """Angles by name, or of each axis, in deg."""
    if isinstance(angles, dict):
        return {name: math.degrees(angle) for name, angle in angles.items()}
    return angles and tuple(map(math.degrees, angles))


def _alarm_times_s(flight: "Landing") -> list[float]:
    """Times of the alarms of the last diagnosis, and of those that changes in flight replaced."""
    alarms = [flight.detection_time_s, *(change.get("detection_time_s") for change in flight.changes)]
    return [time_s for time_s in alarms if time_s is not None]


def fault_free_s(flight: "Landing") -> float:
    """Time under observation in which an alarm is a false one: until the first fault, the first alarm of any
    diagnosis, or the end. Rates of false alarms are per this time."""
    faults = [fault.at_s for fault in flight.scenario.faults]
    return min([flight.frames / flight.scenario.rate_hz, *_alarm_times_s(flight), *faults])


def _change(change: Document, truth: Truth) -> Document:
    """A change in flight, and whether the alarm of the diagnosis that it ended was a false one."""
    alarm_s = change.get("detection_time_s")
    return change if alarm_s is None else change | {"false_alarm": truth.onset.is_false(alarm_s)}


def hints(flight: "Landing", flight_metrics: Metrics) -> list[str]:
    """Notes without which a reader would misread the verdict: one sentence each."""
    scenario = flight.scenario
    of_diagnosis = (
        _hint_alarm_in_one_frame(scenario, flight_metrics),
        "" if scenario.fdi.pairs else of_several(scenario),
        _hint_fault_too_small(scenario, flight_metrics),
    )
    said = (
        *(of_diagnosis if scenario.fdi.diagnoses else ()),
        _hint_residual_near_threshold(flight),
        _hint_late_reallocation(flight_metrics),
        _hint_drift(flight),
    )
    return [sentence for sentence in said if sentence]


def _hint_fault_too_small(scenario: "Scenario", flight_metrics: Metrics) -> str:
    detection = flight_metrics.detection
    found = detection.detected or detection.guaranteed_delay_s is not None
    if not scenario.faults or found or detection.inconclusive:  # the last has a line of its own
        return ""
    return (
        "no alarm, and no alarm was guaranteed: the effect of the fault stayed within the uncertainty that "
        "fdi.bounds declares; a larger fault, a stronger reference or tighter bounds would make it detectable"
    )


def _hint_alarm_in_one_frame(scenario: "Scenario", flight_metrics: Metrics) -> str:
    """An alarm in the first frame: of no meaning for flights with errors, noise or wind."""
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
    used = max(flight.closest_approach, default=0.0)
    if not NEAR_THRESHOLD_SHARE <= used <= 1.0:
        return ""
    before = " before the fault" if flight.scenario.faults else ""
    return (
        f"the residual already reaches {math.floor(1000.0 * used) / 10.0:g} % of its threshold{before}: a "
        "slightly larger error would raise a false alarm"
    )


def _hint_late_reallocation(flight_metrics: Metrics) -> str:
    """Why the demand of a named surface was reallocated late: only a surface that is certainly weak or stuck
    is replaced. No hint for several faults, as the modes do not say which surface was replaced."""
    isolation = flight_metrics.isolation
    taken_s = [change.time_s for change in flight_metrics.supervisor if change.mode == TAKEN_OVER]
    if not taken_s or isolation.faults or isolation.time_s is None:
        return ""
    if taken_s[0] - isolation.time_s < LONG_S:
        return ""
    return (
        f"{isolation.fault} was named at {isolation.time_s:.2f} s; its demand was reallocated at "
        f"{taken_s[0]:.2f} s, when it was certain that the surface is weak or stuck. The law would have "
        "corrected an offset or a slow surface without reallocation"
    )


def _hint_drift(flight: "Landing") -> str:
    """Airspeed or altitude changed a lot, as no autopilot held them."""
    if flight.end is None or flight.scenario.autopilot:
        return ""
    initial = flight.scenario.initial
    airspeed_mps, altitude_m = flight.end
    ends = (
        ("airspeed", initial.airspeed_mps, airspeed_mps, DRIFT_MPS, "m/s"),
        ("altitude", initial.altitude_m, altitude_m, DRIFT_M, "m"),
    )
    far = [
        f"{what} {'fell' if b < a else 'rose'} from {a:.0f} to {b:.0f} {unit}"
        for what, a, b, most, unit in ends
        if abs(b - a) > most
    ]
    return f"{' and '.join(far)} (only the body rates are controlled in this scenario)" if far else ""
