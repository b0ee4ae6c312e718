"""The metrics of a flight: the document metrics.json, with the expectations of the scenario (`expect:`).

Times are in s from the start of the flight, rates in deg/s. A quantity that does not exist is null: a
document never holds NaN. Nothing in the document depends on the wall clock or on the name of the machine, so
that the same scenario and seed give the same file.

The fields of `results/model.py` explain the keys. `named.py` has the sections about names, `judgement.py`
decides whether alarms and names are right.
"""

import json
import platform
from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from importlib.metadata import version
from math import degrees
from typing import TYPE_CHECKING, Any

from beaver_ftc.results import model
from beaver_ftc.results.expectations import evaluate
from beaver_ftc.results.hints import hints
from beaver_ftc.results.judgement import TIME_DECIMALS, Truth
from beaver_ftc.results.model import Document, Metrics, Quantity
from beaver_ftc.results.named import isolation_of, windows_of
from beaver_ftc.results.part import rounded
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
        "isolation": isolation_of(flight, truth),
        "windows": windows_of(flight, truth),
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
    # a path that is not UTF-8 is written with escapes of JSON
    return text.encode(errors="backslashreplace").decode()


@cache
def versions() -> Document:
    """Versions of Python and of the packages that compute the numbers."""
    packages = {name: version(name) for name in ("beaver-ftc", "jsbsim", "numpy", "numba")}
    return packages | {"python": platform.python_version()}


def faults_of(scenario: "Scenario") -> list[Document]:
    """Every declared fault as a document, in the order in which the faults strike."""
    return [fault.document() for fault in Truth.of(scenario).faults]


def _deviations(by_channel: Mapping[str, Quantity] | None) -> Document | None:
    """Deviations from the commanded profile, angles in deg; None without an autopilot. by_channel: the same
    deviations, angles in rad also under the names that end in `_deg`."""
    angles = ("heading_deg", "bank_deg")
    if by_channel is None:
        return None
    return {
        name: degrees(deviation) if name in angles and deviation is not None else deviation
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
        return {name: degrees(angle) for name, angle in angles.items()}
    return angles and tuple(map(degrees, angles))


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
