"""The metrics of a flight: the document metrics.json, with the expectations of the scenario (`expect:`).

Times are in s from the start of the flight, rates in deg/s. A quantity that does not exist is null: a
document never holds NaN. Nothing in the document depends on the wall clock or on the name of the machine, so
that the same scenario and seed give the same file.

The fields of `results/model.py` explain the keys; `judgement.py` decides whether alarms and names are right.
"""

import json
import math
import platform
from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from importlib.metadata import version
from typing import TYPE_CHECKING, Any

from beaver_ftc.results import model
from beaver_ftc.results.expectations import evaluate
from beaver_ftc.results.hints import hints
from beaver_ftc.results.judgement import TIME_DECIMALS, Onset, Truth
from beaver_ftc.results.model import DeclaredFault, Document, Metrics, Quantity
from beaver_ftc.results.part import rounded
from beaver_ftc.scenario.faults import acting_at, is_share, size_at
from beaver_ftc.scenario.warnings import outside_class

if TYPE_CHECKING:
    from beaver_ftc.loop.outcome import Landing
    from beaver_ftc.scenario.schema import Scenario


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
            flown_s=round(flight.frames / scenario.rate_hz, TIME_DECIMALS),
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
