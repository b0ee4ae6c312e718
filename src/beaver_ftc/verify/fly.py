"""Fly one drawn flight and keep what the promises are judged by."""

from math import ceil
from typing import Any

from beaver_ftc.errors import BadInput
from beaver_ftc.flight import Flight
from beaver_ftc.verify.draw import Draw

SCHEMES: dict[str, dict[str, Any]] = {"published": {"thresholds": "published"}, "sharpened": {}}
_LATE_S = 1e-9  # rounding of frame times

Row = dict[str, Any]


def fly_draw(draw: Draw) -> Row:
    """The row of a flight. A fault is flown once with each scheme, in all else the same flight."""
    try:
        return _faulty(draw) if draw.kind == "faulty" else _healthy(draw)
    except BadInput as error:  # a draw without a trim: said, not counted
        return {"index": draw.index, "skipped": str(error)}


def _healthy(draw: Draw) -> Row:
    """The published filter is the sharpened scheme's first, so one flight tells of both."""
    from beaver_ftc.loop import fly

    scenario = draw.scenario()
    flight = fly(scenario)
    flown_s = flight.frames / scenario.rate_hz
    alarm_s = flight.detection_time_s
    return {
        "index": draw.index,
        "watched_s": flown_s if alarm_s is None else alarm_s,
        "alarm": alarm_s is not None,
        "departed": flight.departure is not None,
        "outside_s": sum(end - start for start, end in flight.envelope_exits),
        "closest": list(flight.closest_approach),
    }


def _faulty(draw: Draw) -> Row:
    from beaver_ftc.loop import fly

    row: Row = {"index": draw.index}
    for scheme, fdi in SCHEMES.items():
        scenario = draw.scenario(fdi)
        row[scheme] = judge(fly(scenario))
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
    }
