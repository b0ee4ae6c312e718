"""Fly one drawn flight and keep what the promises are judged by."""

from math import ceil, exp
from typing import Any

from beaver_ftc.documents.errors import BadInput
from beaver_ftc.loop.flight import Flight
from beaver_ftc.results.metrics import fault_free_s
from beaver_ftc.scenario.faults import LossOfEffectiveness
from beaver_ftc.studies.verify.draw import Draw

PUBLISHED, SHARPENED = "published", "sharpened"
_OFF = {"pole_bank": False, "memory": False, "shared_effectiveness": False}
SCHEMES: dict[str, dict[str, Any]] = {PUBLISHED: {"thresholds": "published"}, SHARPENED: {}}
# From the published scheme to the default, and on to what takes a declaration, one step after the other.
STEPS: dict[str, dict[str, Any]] = {
    PUBLISHED: SCHEMES[PUBLISHED],
    "interval": {"sharpen": _OFF},
    "pole bank": {"sharpen": {**_OFF, "pole_bank": True}},
    "memory": {"sharpen": {"shared_effectiveness": False}},
    SHARPENED: SCHEMES[SHARPENED],
    "constant": {"fault_profile": "abrupt"},
}
_CONSTANT_ONLY = "constant"  # for faults that are: one that grows is outside what this step declares
_LATE_S = 1e-9  # rounding of frame times

Row = dict[str, Any]


def fly_draw(draw: Draw, schemes: dict[str, dict[str, Any]] = SCHEMES) -> Row:
    """The row of a flight. A fault is flown once with each scheme, in all else the same flight."""
    try:
        return _faulty(draw, schemes) if draw.kind == "faulty" else _healthy(draw)
    except BadInput as error:  # a draw without a trim: said, not counted
        return {"index": draw.index, "skipped": str(error)}


def _healthy(draw: Draw) -> Row:
    """The published filter is the sharpened scheme's first, so one flight tells of both."""
    from beaver_ftc.loop.loop import fly

    scenario = draw.scenario()
    flight = fly(scenario)
    return {
        "index": draw.index,
        "watched_s": fault_free_s(flight),
        "alarm": flight.detection_time_s is not None,
        "departed": flight.departure is not None,
        "outside_s": flight.outside_s,
        "closest": list(flight.closest_approach),
    }


def _faulty(draw: Draw, schemes: dict[str, dict[str, Any]]) -> Row:
    from beaver_ftc.loop.loop import fly

    row: Row = {"index": draw.index}
    for scheme, fdi in schemes.items():
        scenario = draw.scenario(fdi)
        abrupt = scenario.faults[0].profile == "abrupt"
        row[scheme] = judge(fly(scenario)) if abrupt or scheme != _CONSTANT_ONLY else row[SHARPENED]
    fault = scenario.faults[0]
    return row | {
        "rate_hz": scenario.rate_hz,
        "substeps": scenario.substeps,
        **fault.model_dump(exclude_none=True),
    }


def judge(flight: Flight) -> Row:
    """What became of the promises in a flight with one fault; delays in s from the first frame that bears
    it.
    """
    scenario = flight.scenario
    fault, frame_s = scenario.faults[0], 1.0 / scenario.rate_hz
    actuator = getattr(fault, "actuator", "unanticipated")
    struck_s = ceil((fault.at_s - _LATE_S) * scenario.rate_hz) * frame_s
    delay_s = None if flight.detection_time_s is None else flight.detection_time_s - struck_s
    earliest_s = frame_s if scenario.substeps == 1 else 0.0  # of one JSBSim frame a fault shows in the next
    guaranteed_s = flight.guaranteed_delay_s
    late = guaranteed_s is not None and (delay_s is None or delay_s > guaranteed_s + frame_s + _LATE_S)
    return {
        "delay_s": delay_s,
        "false_alarm": delay_s is not None and delay_s < earliest_s - _LATE_S,
        "guaranteed_s": guaranteed_s,
        "late": late,
        "isolation_s": flight.isolation_time_s - struck_s if flight.isolation_time_s is not None else None,
        "excluded": delay_s is not None and actuator not in (*flight.candidates, flight.isolated),
        "wrong": flight.isolated not in (None, actuator),
        "estimate_error": _estimate_error(flight) if flight.isolated == actuator else None,
    }


def _estimate_error(flight: Flight) -> float | None:
    """How far the estimated parameter is from the true one as the flight ends."""
    fault = flight.scenario.faults[0]
    if flight.estimate is None or not isinstance(fault, LossOfEffectiveness):
        return None
    age_s = flight.frames / flight.scenario.rate_hz - fault.at_s
    grown = 1.0 if fault.kappa_per_s is None else 1.0 - exp(-fault.kappa_per_s * age_s)
    return abs(flight.estimate + fault.magnitude * grown)
