"""What a flight was: its condition, what broke and how much, and what a reader should know of the result."""

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from beaver_ftc.loop.flight import Flight
    from beaver_ftc.scenario.schema import Scenario

Document = dict[str, Any]

OURS = "adaptive-estimators"
TAKEN_OVER, LONG_S = "reallocated", 1.0  # a change of mode that comes later than this is explained
DRIFT_MPS, DRIFT_M = 5.0, 300.0  # a flight that ends further from where it began has wandered off
_NOT_SIZE = {"actuator", "sensor", "type", "at_s", "end_s", "profile"}


def flown(flight: "Flight") -> Document:
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
            "actuator": getattr(fault, "actuator", None),
            **sensor_of(fault),
            "type": fault.type,
            "at_s": fault.at_s,
            "end_s": fault.end_s,
            "profile": fault.profile,
            "size": fault.model_dump(exclude=_NOT_SIZE, exclude_none=True),
        }
        for fault in sorted(scenario.faults, key=lambda fault: fault.at_s)
    ]


def sensor_of(fault: Any) -> Document:
    """The instrument that a fault is on, as the documents have it; nothing for other faults."""
    return {"sensor": fault.sensor} if hasattr(fault, "sensor") else {}


def hints(flight: "Flight", document: Document) -> list[str]:
    """What would mislead a reader who is not told of it: one sentence each."""
    scenario = flight.scenario
    of_diagnosis = (_outside_the_class, _several, _too_small) if scenario.fdi.scheme == OURS else ()
    said = [*(says(scenario, document) for says in of_diagnosis), _waited(document), _drift(flight)]
    return [sentence for sentence in said if sentence]


def _outside_the_class(scenario: "Scenario", document: Document) -> str:
    strange = list(_strangers(scenario))
    if scenario.fdi.fault_class == "all" or not strange:
        return ""
    *first, last = scenario.airframe.primary
    return (
        f"{' and '.join(strange)}: outside the fault class the diagnosis looks for (loss of effectiveness of "
        f"{', '.join(first)} or {last}), so it cannot be named; set fdi.fault_class: all"
    )


def _strangers(scenario: "Scenario") -> Iterator[str]:
    """Faults that are not of the published class, but for the one that is meant to be none."""
    for fault in scenario.faults:
        actuator = getattr(fault, "actuator", None)
        lost = fault.type == "loss_of_effectiveness" and actuator in scenario.airframe.primary
        if actuator and not lost:
            yield f"{actuator} {fault.type.replace('_', ' ')}"


def _several(scenario: "Scenario", document: Document) -> str:
    surfaces = {getattr(fault, "actuator", None) for fault in scenario.faults if not sensor_of(fault)}
    if len(surfaces) < 2 or scenario.fdi.pairs or not _together(scenario):
        return ""
    wanted = (
        "fdi.pairs: true" if scenario.fdi.fault_class == "all" else "fdi: {fault_class: all, pairs: true}"
    )
    return f"faults on several surfaces at once: the diagnosis looks for one; set {wanted}"


def _together(scenario: "Scenario") -> bool:
    """Whether two faults of different surfaces are in force at one time."""
    spans = [
        (fault.at_s, fault.end_s or scenario.duration_s, getattr(fault, "actuator", None))
        for fault in scenario.faults
        if not sensor_of(fault)
    ]
    return any(
        one[2] != other[2] and one[0] < other[1] and other[0] < one[1] for one in spans for other in spans
    )


def _too_small(scenario: "Scenario", document: Document) -> str:
    detection = document["detection"]
    if not scenario.faults or detection["detected"] or detection["guaranteed_delay_s"] is not None:
        return ""
    return (
        "no alarm, and none was certain: what the fault did stayed within what fdi.bounds declares as "
        "uncertainty; a larger fault, a livelier reference or tighter bounds would show it"
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


def _drift(flight: "Flight") -> str:
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
