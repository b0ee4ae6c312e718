"""Fly a case of the matrix, once with the fault-tolerant law and once with the oracle."""

from functools import lru_cache
from math import degrees
from typing import TYPE_CHECKING, Any

from beaver_ftc.aircraft import DEFAULT
from beaver_ftc.studies.matrix.cases import Case, aircraft_of, own_axis, scenario_of
from beaver_ftc.studies.matrix.told import columns_of, told

if TYPE_CHECKING:
    from beaver_ftc.loop.flight import Flight

Document = dict[str, Any]


@lru_cache
def trimmed_deg(airspeed_mps: float, surface: str, aircraft: str = DEFAULT) -> float:
    """Deflection of a surface in the trim the cases start from."""
    from beaver_ftc.plant.adapter import Plant
    from beaver_ftc.plant.trim import trim
    from beaver_ftc.scenario.initial import initial_of

    flown = aircraft_of(aircraft)
    altitude_m = initial_of(flown)().altitude_m
    point = trim(airspeed_mps, altitude_m, plant=Plant(100, aircraft=flown))
    return degrees(point.surfaces_rad[surface])


def fly_case(case: Case) -> Document:
    """The row of a case: fault, verdict, tracking beside the oracle's, and why it was lost, if so."""
    from beaver_ftc.loop.loop import fly

    off_deg = trimmed_deg(case.airspeed_mps, case.surface, case.aircraft)
    ours, best = (scenario_of(case, law, off_deg) for law in ("fault-tolerant-published", "oracle-published"))
    kept = columns_of(ours.airframe) if case.declared else None
    flight, oracle = fly(ours, kept), fly(best)
    seen = {} if kept is None else told(ours, kept, case.surface)
    return {**case._asdict(), **_diagnosis(flight, case), **_tracking(flight, oracle, case), **seen}


def _diagnosis(flight: "Flight", case: Case) -> Document:
    from beaver_ftc.results.metrics import metrics

    document = metrics(flight)
    isolation, true_type = document["isolation"], flight.scenario.faults[0].type
    return {
        "detected": document["detection"]["detected"],
        "delay_s": document["detection"]["delay_s"],
        "false_alarm": document["false_alarm"],
        "isolated": isolation["fault"],
        "isolation_delay_s": isolation["delay_s"],
        "type": isolation["type"],
        "candidates": isolation["candidates"],
        "estimate": isolation["estimate"],
        "verdict": verdict(document, case.surface, true_type),
    }


def verdict(document: Document, surface: str, true_type: str) -> str:
    """named (surface and type right), surface (right, type open), open (still possible), unseen or WRONG."""
    isolation = document["isolation"]
    if not document["detection"]["detected"]:
        return "unseen"
    if document["false_alarm"]:
        return "WRONG"
    if isolation["fault"] is None:
        left = isolation["candidates"]
        return "open" if surface in left or f"{surface}:{true_type}" in left else "WRONG"
    if isolation["fault"] != surface or isolation["type_correct"] is False:
        return "WRONG"
    if isolation["type"] is None:
        return "surface" if true_type in isolation["candidates"] or not isolation["candidates"] else "WRONG"
    return "named"


def _tracking(flight: "Flight", oracle: "Flight", case: Case) -> Document:
    axis = own_axis(case)
    ours, best = (_rms_deg_s(one, axis) for one in (flight, oracle))
    return {
        "axis": axis,
        "rms_deg_s": ours,
        "oracle_rms_deg_s": best,
        "ratio": ours / best if best else None,
        "departure_s": flight.departure[0] if flight.departure else None,
        "oracle_departure_s": oracle.departure[0] if oracle.departure else None,
        "departure_signal": flight.departure[1] if flight.departure else None,
        "oracle_beyond_s": oracle.authority[axis][1] if oracle.authority else 0.0,
        "oracle_left_envelope_s": oracle.envelope_exits[0][0] if oracle.envelope_exits else None,
    }


def _rms_deg_s(flight: "Flight", axis: str) -> float:
    return degrees((flight.post_fault_rms_rad_s or (0.0,) * 3)["pqr".index(axis)])
