"""What a flight amounts to: the document `metrics.json`.

Times are seconds from the start of the flight, rates deg/s. Delays are seconds from the first frame in which
the fault is there: `at_s`, or up to a frame later. A quantity that does not exist is null: a document never
holds NaN. Nothing in it depends on the wall clock or the machine's name, so that the same scenario and seed
give the same file.

`isolation.so_far` is true of a surface that is named because every other fault is excluded: no data have
excluded this one so far, and nothing within the class proves that a fault outside of it does not look alike.
It is false of `unanticipated` and of an instrument, null of nothing and of what a plug-in names.
`isolation.withdrawn`: surfaces that were named before, and from when to when.
`isolation.premature` is true of a name given before the fault that it names began, or the first one where it
names none that was declared: such a name is not correct and meets no expectation. Null of nothing.

`detection.inconclusive`: null, or the frames in which the built-in diagnosis can conclude nothing: their
`share`, the
first of them `from_s`, and `reasons`, each with the `quantity`, its own `share`, the range that was
`measured`, the
range that was `flown` outside of it, and what it `says`.
"""

import json
import math
import platform
from collections.abc import Collection, Sequence
from functools import cache
from importlib.metadata import version
from typing import TYPE_CHECKING, Any

from beaver_ftc.results.expectations import evaluate
from beaver_ftc.scenario.faults import DAMAGE, Damage, is_share, of_a_sensor
from beaver_ftc.scenario.pairs import failing, of_several

if TYPE_CHECKING:
    from beaver_ftc.loop.outcome import Landing
    from beaver_ftc.scenario.schema import Scenario

Document = dict[str, Any]
Rates = tuple[float, float, float]

AXES = ("p", "q", "r")
UNANTICIPATED = "unanticipated"
TIME_TOLERANCE_S = 1e-9
LOSS_OF_EFFECTIVENESS = "loss_of_effectiveness"
TAKEN_OVER, LONG_S = "reallocated", 1.0  # a change of mode that comes later than this is explained
ON_THE_BOUND = 0.9  # of the worst-case test's bound, in healthy flight
DRIFT_MPS, DRIFT_M = 5.0, 300.0  # a flight that ends further from where it began has wandered off
_NOT_SIZE = {"actuator", "sensor", "type", "at_s", "end_s", "profile"}


def metrics(flight: "Landing") -> Document:
    """The metrics of `flight`, key by key in the order documented."""
    scenario = flight.scenario
    fault = first_fault(scenario)
    at_once = fault is not None and fault["at_s"] <= 0  # then nothing was measured before it
    document = {
        "scenario": scenario.name,
        "seed": scenario.seed,
        "frames": flight.frames,
        "flight": flown(flight),
        "fault": fault,
        "faults": faults_of(scenario),
        "detection": _detection(flight, fault),
        "isolation": _isolation(flight, fault),
        # the alarm is latched: there is one a diagnosis
        "false_alarm": any(_is_false(time_s, fault) for time_s in _alarms_s(flight)),
        "fault_free_s": _number(fault_free_s(flight)),
        "tracking": {
            "pre_fault_rms_deg_s": None if at_once else _per_axis_deg_s(flight.pre_fault_rms_rad_s),
            "post_fault_rms_deg_s": _per_axis_deg_s(flight.post_fault_rms_rad_s),
            "surface_travel_deg": _rounded(_each_in_deg(flight.surface_travel_rad)),
            "surface_energy_deg2_s": _rounded(_each_in_deg(_each_in_deg(flight.surface_energy_rad2_s))),
        },
        "supervisor": [_named_values(change, "time_s", "mode") for change in flight.supervisor],
        "changes": [_judged(_rounded(change), fault) for change in flight.changes],
        "mode_changes_left_out": flight.mode_changes - len(flight.supervisor),
        "envelope_exits": [_named_values(exit, "start_s", "end_s") for exit in flight.envelope_exits],
        "envelope": {
            "exits": flight.exits,
            "outside_s": _number(flight.outside_s),
            "exits_left_out": flight.exits - len(flight.envelope_exits),
        },
        "departure": _named_values(flight.departure, "time_s", "signal"),
        "authority": _rounded(flight.authority),
        "engine_power": _rounded(flight.engine_power),
        "profile": _in_deg(flight.profile),
        "arrival": _arrival(flight),
        "limits": [_rounded(limit) for limit in flight.limits],
        "saturation_s": _rounded(flight.saturation_s),
    }
    document["hints"] = hints(flight, document)
    expectations = evaluate(scenario.expect, document)
    document["expectations"] = expectations
    document["passed"] = all(expectation["passed"] for expectation in expectations)
    document["versions"] = dict(versions())
    return document


def as_json(document: Any) -> str:
    """`document` as JSON text, keys in the order given; raises ValueError on NaN or infinity."""
    text = json.dumps(document, indent=2, allow_nan=False, ensure_ascii=False) + "\n"
    return text.encode(errors="backslashreplace").decode()  # a path that is not UTF-8: JSON's own escapes


def first_fault(scenario: "Scenario") -> Document | None:
    """The earliest declared fault as {actuator, type, at_s}; the actuator of an unanticipated one is null, of
    an instrument's too, which has `sensor` besides."""
    if not scenario.faults:
        return None
    fault = min(scenario.faults, key=lambda fault: fault.at_s)
    where = {"actuator": surface_of(fault), **sensor_of(fault)}
    return {**where, "type": fault.type, "at_s": fault.at_s}


@cache
def versions() -> Document:
    """Versions of what produces the numbers."""
    packages = {name: version(name) for name in ("beaver-ftc", "jsbsim", "numpy", "numba")}
    return packages | {"python": platform.python_version()}


def _detection(flight: "Landing", fault: Document | None) -> Document:
    return {
        "detected": flight.detection_time_s is not None,
        "time_s": _number(flight.detection_time_s),
        "delay_s": _delay(flight.detection_time_s, fault, flight.scenario),
        "axis": flight.detection_axis,
        "guaranteed_delay_s": _number(flight.guaranteed_delay_s),
        "statistical": _rounded(flight.statistical),
        "inconclusive": _rounded(flight.inconclusive),
    }


# What the document says of the fault that is named, in its order.
_NAMED = (
    "fault", "type", "time_s", "delay_s", "correct", "estimate", "candidates", "type_correct", "type_delay_s",
    "estimate_deg", "estimate_interval", "frequency_rad_s", "so_far", "premature",
)  # fmt: skip


def _isolation(flight: "Landing", fault: Document | None) -> Document:
    scenario = flight.scenario
    meant = _meant(flight.isolated, flight.isolation_time_s, scenario)
    held_against = meant[0] if meant else fault
    correct = None if flight.isolated is None else bool(meant)
    right = correct, _type_correct(flight.isolation_type, held_against)
    named = _named(vars(flight), held_against, right, scenario)
    return {
        "isolated": flight.isolated is not None,
        **{key: named[key] for key in _NAMED},
        "withdrawn": [_rounded(gone) for gone in flight.withdrawn],
        "names": _names(flight, fault),
        "probing_s": _rounded(flight.probing_s or ()) or None,
        "faults": [_one_of_several(found, scenario) for found in flight.faults],
    }


def _names(flight: "Landing", fault: Document | None) -> list[str]:
    """The names given in flight, those that were withdrawn too, each once, in the order of the faults that
    they name, and as they were given; without those that were premature."""
    given = [(gone["fault"], gone["from_s"]) for gone in flight.withdrawn]
    if flight.faults:
        given += [(one["isolated"], one["isolation_time_s"]) for one in flight.faults]
    else:
        given.append((flight.isolated, flight.isolation_time_s))
    said = []
    for name, time_s in given:
        meant = _meant(name, time_s, flight.scenario)
        of = meant[0] if meant else fault
        if name is not None and not _premature(name, time_s, of):
            said.append((of["at_s"] if of else 0.0, time_s, name))
    return list(dict.fromkeys(name for _, _, name in sorted(said)))


def _one_of_several(found: Document, scenario: "Scenario") -> Document:
    """One of several faults at once; `fault` is null where a plane's is open between its candidates."""
    name, kind = found["isolated"], found["isolation_type"]
    meant = _meant(name, found["isolation_time_s"], scenario)
    correct = None if name is None else bool(meant)
    type_correct = None if kind is None else any(bool(_type_correct(kind, fault)) for fault in meant)
    of_ours = {**found, "so_far": None if name is None else True}  # no other diagnosis names several
    return _named(of_ours, meant[0] if meant else None, (correct, type_correct), scenario)


def _named(
    found: Document, fault: Document | None, right: tuple[bool | None, bool | None], scenario: "Scenario"
) -> Document:
    """A fault that is named; fault: since when it is there. right: whether it, and its type, are, unless they
    were named before."""
    estimate, kind = found.get("estimate"), found["isolation_type"]
    premature = _premature(found["isolated"], found["isolation_time_s"], fault)
    angle_rad = None if is_share(kind) else estimate
    return {
        "fault": found["isolated"],
        "type": kind,
        "time_s": _number(found["isolation_time_s"]),
        "delay_s": _delay(found["isolation_time_s"], fault, scenario),
        "correct": right[0] and not premature,
        "candidates": list(found["candidates"]),
        "type_correct": right[1] and not premature,
        "type_delay_s": _delay(found.get("type_time_s"), fault, scenario),
        "estimate": _number(estimate),
        "estimate_deg": None if angle_rad is None else _number(math.degrees(angle_rad)),
        "estimate_interval": _rounded(found.get("estimate_interval") or ()) or None,
        "frequency_rad_s": _number(found.get("frequency_rad_s")),
        "so_far": found["so_far"],
        "premature": premature,
    }


def _premature(name: str | None, time_s: float | None, fault: Document | None) -> bool | None:
    """Whether a name was given before its fault began; null without a name."""
    if name is None or time_s is None:
        return None
    return fault is not None and _is_false(time_s, fault)


def _meant(name: str | None, time_s: float | None, scenario: "Scenario") -> list[Document]:
    """The declared faults of which a name given then is right, as they strike."""
    declared = [*faults_of(scenario), *_beyond_one_fault(time_s, scenario)]
    return [fault for fault in declared if _is_right(name, fault, _takes(scenario))]


def _beyond_one_fault(time_s: float | None, scenario: "Scenario") -> list[Document]:
    """From the instant on at which a second surface fails, no single fault explains the flight: to a
    diagnosis that looks for one, both together are outside the class, an unanticipated fault."""
    began = failing(scenario)
    if scenario.fdi.pairs or len(began) < 2 or time_s is None:
        return []
    both = {"actuator": None, "type": UNANTICIPATED, "at_s": sorted(began.values())[1]}
    return [] if _is_false(time_s, both) else [both]


def _takes(scenario: "Scenario") -> set[str]:
    """Surfaces that the scenario's damage takes away."""
    damage = scenario.airframe.damage
    cases = [fault.case for fault in scenario.faults if isinstance(fault, Damage)]
    return {surface for case in cases for surface in damage[case].takes}


def _is_right(name: str | None, fault: Document, takes: Collection[str]) -> bool:
    """Whether a name is that of a declared fault. takes: surfaces that are lost with damage."""
    if "sensor" in fault:  # outside the class of surface faults is right as well
        return name in (f"sensor {fault['sensor']}", UNANTICIPATED)
    if fault["type"] == DAMAGE:  # outside of every class, unless a surface that it takes
        return name == UNANTICIPATED or name in takes
    return name is not None and name == (
        UNANTICIPATED if fault["type"] == UNANTICIPATED else fault["actuator"]
    )


def _type_correct(kind: str | None, fault: Document | None) -> bool | None:
    """Whether the type named is the declared one; null while none is named, as an instrument's never is."""
    if fault is not None and "sensor" in fault:
        return None
    if fault is not None and fault["type"] == DAMAGE:  # a surface that is gone has lost all its effect
        return None if kind in (None, UNANTICIPATED) else kind == LOSS_OF_EFFECTIVENESS
    return None if kind is None else fault is not None and kind == fault["type"]


def _in_deg(off: dict[str, float | None] | None) -> Document | None:
    """Deviations from the commanded profile; null without an autopilot, or where a channel is not flown."""
    if off is None:
        return None
    in_deg = {"heading_deg": math.degrees, "bank_deg": math.degrees}
    return {
        name: None if away is None else _number(in_deg.get(name, float)(away)) for name, away in off.items()
    }


def _arrival(flight: "Landing") -> Document | None:
    """Where a flight along a profile has come to; null without an autopilot, or if the aircraft is lost."""
    off = _in_deg(flight.arrival)
    if off is None or flight.departure is not None:
        return None
    return {**off, "in_envelope": not flight.outside_at_end}


def _alarms_s(flight: "Landing") -> list[float]:
    """When there was an alarm: of the diagnosis at the end, and of those that changes in flight replaced."""
    alarms = [flight.detection_time_s, *(change.get("detection_time_s") for change in flight.changes)]
    return [time_s for time_s in alarms if time_s is not None]


def fault_free_s(flight: "Landing") -> float:
    """Time under observation in which an alarm is a false one: until the first fault, the first alarm of any
    diagnosis, or the end. Rates of false alarms are per this time."""
    scenario, fault = flight.scenario, first_fault(flight.scenario)
    ends = [flight.frames / scenario.rate_hz, *_alarms_s(flight)]
    return min(ends if fault is None else [*ends, fault["at_s"]])


def _judged(change: Document, fault: Document | None) -> Document:
    """A change in flight, with what to think of the alarm of the diagnosis that it ended."""
    if change.get("detection_time_s") is None:
        return change
    return {**change, "false_alarm": _is_false(change["detection_time_s"], fault)}


def _is_false(time_s: float, fault: Document | None) -> bool:
    """Whether an alarm then is a false one. Frame times and declared times carry rounding dust: a fault is in
    force at its very time."""
    return fault is None or time_s < fault["at_s"] - TIME_TOLERANCE_S


def _delay(time_s: float | None, fault: Document | None, scenario: "Scenario") -> float | None:
    """Time since the fault's first frame; null without one, or where the event came before it."""
    if time_s is None or fault is None or _is_false(time_s, fault):
        return None
    first_frame_s = math.ceil((fault["at_s"] - TIME_TOLERANCE_S) * scenario.rate_hz) / scenario.rate_hz
    return _number(max(time_s - first_frame_s, 0.0))


def _per_axis_deg_s(rates_rad_s: Rates | None) -> Document | None:
    return _named_values(rates_rad_s and [math.degrees(rate) for rate in rates_rad_s], *AXES)


def _named_values(values: Sequence[Any] | None, *names: str) -> Document | None:
    return None if values is None else _rounded(dict(zip(names, values, strict=True)))


def _each_in_deg(angles: dict[str, float]) -> dict[str, float]:
    return {name: math.degrees(angle) for name, angle in angles.items()}


def _rounded(value: Any) -> Any:
    """A part of a landing as the document has it: each number as `_number` gives it, a sequence as a list."""
    if isinstance(value, dict):
        return {key: _rounded(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [_rounded(entry) for entry in value]
    return _number(value) if isinstance(value, float) else value


def _number(value: float | None) -> float | None:
    """A finite Python float without the rounding dust of frame times (nine decimals), or null."""
    if value is None or not math.isfinite(value):
        return None
    return round(float(value), 9)


def flown(flight: "Landing") -> Document:
    """The flight condition, and who diagnosed and controlled."""
    scenario = flight.scenario
    return {
        "airspeed_mps": scenario.initial.airspeed_mps,
        "altitude_m": scenario.initial.altitude_m,
        "rate_hz": scenario.rate_hz,
        "flown_s": round(flight.frames / scenario.rate_hz, 9),
        "scheme": scenario.fdi.scheme,
        "fault_class": scenario.fdi.fault_class,
        "law": scenario.control.law,
    }


def faults_of(scenario: "Scenario") -> list[Document]:
    """Every declared fault, in the order in which they strike: what, when, and how large."""
    return [
        {
            "actuator": surface_of(fault),
            **sensor_of(fault),
            "type": fault.type,
            "at_s": fault.at_s,
            "end_s": fault.end_s,
            "profile": fault.profile,
            "size": fault.model_dump(exclude=_NOT_SIZE, exclude_none=True),
        }
        for fault in sorted(scenario.faults, key=lambda fault: fault.at_s)
    ]


def surface_of(fault: Any) -> str | None:
    """The surface that a fault is on, if it is on one."""
    return getattr(fault, "actuator", None)


def sensor_of(fault: Any) -> Document:
    """The instrument that a fault is on, as the documents have it; nothing for other faults."""
    return {"sensor": fault.sensor} if of_a_sensor(fault) else {}


def hints(flight: "Landing", document: Document) -> list[str]:
    """What would mislead a reader who is not told of it: one sentence each."""
    scenario = flight.scenario
    of_diagnosis = (_outside_the_class, _several, _too_small) if scenario.fdi.diagnoses else ()
    said = [*(says(scenario, document) for says in of_diagnosis), _on_the_bound(flight), _waited(document)]
    said.append(_drift(flight))
    return [sentence for sentence in said if sentence]


def _outside_the_class(scenario: "Scenario", document: Document) -> str:
    strange = [
        f"{surface_of(fault)} {fault.type.replace('_', ' ')}"
        for fault in scenario.faults
        if surface_of(fault)  # what is on no surface is meant to be outside
        and (
            fault.type != LOSS_OF_EFFECTIVENESS or surface_of(fault) not in scenario.airframe.class_of_losses
        )
    ]
    if scenario.fdi.fault_class == "all" or not strange:
        return ""
    *first, last = scenario.airframe.class_of_losses
    return (
        f"{' and '.join(strange)}: outside the fault class the diagnosis looks for (loss of effectiveness of "
        f"{', '.join(first)} or {last}), so it cannot be named; set fdi.fault_class: all"
    )


def _several(scenario: "Scenario", document: Document) -> str:
    return "" if scenario.fdi.pairs else of_several(scenario)


def _too_small(scenario: "Scenario", document: Document) -> str:
    detection = document["detection"]
    if not scenario.faults or detection["detected"] or detection["guaranteed_delay_s"] is not None:
        return ""
    if detection.get("inconclusive"):  # which has a line of its own
        return ""
    return (
        "no alarm, and none was certain: what the fault did stayed within what fdi.bounds declares as "
        "uncertainty; a larger fault, a livelier reference or tighter bounds would show it"
    )


def _on_the_bound(flight: "Landing") -> str:
    """The worst-case test has next to nothing left before the fault, which any fault then takes."""
    used = max(flight.closest_approach, default=0.0)
    if not flight.scenario.faults or not ON_THE_BOUND <= used <= 1.0:
        return ""
    return (
        f"the healthy part of this flight already uses {math.floor(1000.0 * used) / 10.0:g} % of the "
        f"bound; that a "
        "small fault is detected here follows from the uncertainty this scenario flies with"
    )


def _waited(document: Document) -> str:
    """Why the law goes on with a surface that has been named long since: another takes over only where it is
    weak or stuck, which the name alone does not say."""
    isolation = document.get("isolation", {})
    taken_s = [change["time_s"] for change in document.get("supervisor", ()) if change["mode"] == TAKEN_OVER]
    if not taken_s or isolation["time_s"] is None or taken_s[0] - isolation["time_s"] < LONG_S:
        return ""
    return (
        f"{isolation['fault']} was named at {isolation['time_s']:.2f} s, and its demand handed over at "
        f"{taken_s[0]:.2f} s, once it was certain to be weak or stuck: an offset or a slow surface the law "
        "would have corrected instead"
    )


def _drift(flight: "Landing") -> str:
    """Attitude, height and speed are left alone unless a scenario has an autopilot."""
    if flight.end is None:
        return ""
    initial = flight.scenario.initial
    ends = (
        ("airspeed", initial.airspeed_mps, flight.end[0], DRIFT_MPS, "m/s"),
        ("altitude", initial.altitude_m, flight.end[1], DRIFT_M, "m"),
    )
    far = [f"{what} from {a:.0f} to {b:.0f} {unit}" for what, a, b, most, unit in ends if abs(b - a) > most]
    if not far or getattr(flight.scenario, "autopilot", None):
        return ""
    return f"the flight drifted in {' and in '.join(far)}: only the body rates are controlled"
