"""Hints: notes without which a reader could misunderstand the verdict of a flight."""

import math
from typing import TYPE_CHECKING

from beaver_ftc.results.model import Metrics
from beaver_ftc.scenario.instants import TIME_TOLERANCE_S
from beaver_ftc.scenario.pairs import of_several
from beaver_ftc.scenario.undeclared import declares_all

if TYPE_CHECKING:
    from beaver_ftc.loop.outcome import Landing
    from beaver_ftc.scenario.schema import Scenario

TAKEN_OVER = "reallocated"  # mode that replaces the named surface
LONG_S = 1.0  # a reallocation that begins so long after the name is late
NEAR_THRESHOLD_SHARE = 0.9  # a residual of a healthy flight beyond this share of its threshold is near it
DRIFT_MPS, DRIFT_M = 5.0, 300.0  # a larger change of airspeed or altitude over the flight is a drift


def hints(flight: "Landing", flight_metrics: Metrics) -> list[str]:
    """Notes without which a reader could misunderstand the verdict, a sentence each."""
    scenario = flight.scenario
    of_diagnosis = (
        _hint_alarm_in_one_frame(scenario, flight_metrics),
        "" if scenario.fdi.pairs else of_several(scenario),
        _hint_fault_too_small(scenario, flight_metrics),
    )
    others = (
        _hint_residual_near_threshold(flight),
        _hint_late_reallocation(flight_metrics),
        _hint_drift(flight),
    )
    return [*filter(None, (*of_diagnosis, *others) if scenario.fdi.diagnoses else others)]


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
    if delay_s is None or delay_s > frame_s + TIME_TOLERANCE_S or not declares_all(scenario):
        return ""
    if not (scenario.sensors.is_ideal and scenario.actuators.is_ideal and scenario.environment.is_still):
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
    if not begun_s or isolation.faults or isolation.time_s is None or begun_s[0] - isolation.time_s < LONG_S:
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
