"""Every fault type on every surface: the verdict of the diagnosis, and the tracking of the flight.

Each flight is flown with the fault-tolerant law and with the oracle; a cell of the matrix is a fault on a
surface, the worst of its airspeeds.
"""

from collections import Counter
from functools import lru_cache
from math import degrees
from pathlib import Path
from typing import NamedTuple

from beaver_ftc.aircraft import AXES, DEFAULT, Aircraft
from beaver_ftc.loop.loop import fly
from beaver_ftc.loop.outcome import Landing
from beaver_ftc.plant.adapter import Plant
from beaver_ftc.plant.trim import trim
from beaver_ftc.results.metrics import measure
from beaver_ftc.results.model import Document, Metrics
from beaver_ftc.scenario.airframe import air_of, find_aircraft, initial_of
from beaver_ftc.scenario.faults import TYPES
from beaver_ftc.scenario.schema import Scenario
from beaver_ftc.scenario.schema import load as load_scenario
from beaver_ftc.studies.detectability.certain import axis_of
from beaver_ftc.studies.detectability.places import usual_airspeeds
from beaver_ftc.studies.engine.study import Study
from beaver_ftc.studies.matrix.clairvoyant import columns_of, seen_when_told
from beaver_ftc.studies.matrix.matrix_shown import FILES, NAME, VERDICTS
from beaver_ftc.studies.reproduce.choices import SETTING

TOLERANCE = 0.05
SENSORS = "tactical-grade"
AIRSPEEDS_MPS = (38.0, 45.0, 52.0)
AT_S = 12.0
DURATION_S = 30.0
NAMED = ("surface", "named")
DECLARED = "fault-matrix-declared"  # the name of the folder, as NAME
LIKELY = 0.5  # a test that finds a fault more often than not sees it
REFERENCE, UNCERTAINTY = SETTING["reference"], SETTING["uncertainty"]

# Name in the table, and the fault; off_deg: a jam this far off the trimmed command.
FAULTS: tuple[tuple[str, Document], ...] = tuple(
    (name, {"type": kind, **keys}) for kind, row in TYPES.items() for name, keys in row.examples
)


Rows = list[Document]  # of flights


class FaultCase(NamedTuple):
    """One cell of the matrix at one airspeed."""

    fault: str
    surface: str
    airspeed_mps: float
    declared: bool = False  # with the errors of `declared`
    aircraft: str = DEFAULT
    turbulence: str = "none"  # flown and declared, with `declared`


def airspeeds_of(reference: str) -> tuple[float, ...]:
    """Airspeeds to fly an aircraft at, m/s."""
    return usual_airspeeds(aircraft_of(reference), AIRSPEEDS_MPS)


def aircraft_of(reference: str) -> Aircraft:
    """The aircraft of that name; a folder is looked for in the working directory."""
    return find_aircraft(reference, Path())


def cases(
    airspeeds_mps: tuple[float, ...], declared: bool = False, aircraft: str = DEFAULT,
    turbulence: str = "none",
) -> list[FaultCase]:  # fmt: skip
    """Every fault on every surface at every airspeed, fault by fault."""
    return [
        FaultCase(fault, surface, V, declared, aircraft, turbulence)
        for fault, _ in FAULTS
        for surface in aircraft_of(aircraft).surfaces
        for V in airspeeds_mps
    ]


def declared(turbulence: str = "none", aircraft: str = DEFAULT) -> Document:
    """Real sensors, servos, air, and coefficients at the ends of their tolerance by turns, where the truth
    lets them be wrong: all of it declared.
    """
    names = adjustable_terms(aircraft)
    wrong = {name: 1.0 + (TOLERANCE if i % 2 else -TOLERANCE) for i, name in enumerate(names)}
    bounds = {"coefficients": TOLERANCE if wrong else 0.0, "sensors": SENSORS, "turbulence": turbulence}
    return {
        "uncertainty": UNCERTAINTY | {"coefficients": wrong} if wrong else {},
        "sensors": SENSORS,
        "actuators": "servo",
        "environment": air_of(turbulence),
        "fdi": {
            "fault_class": "all",
            "bounds": bounds,
            "statistical": {},
        },
    }


@lru_cache
def adjustable_terms(aircraft: str) -> tuple[str, ...]:
    """Names of an aircraft's terms that its truth lets be wrong; none of a derived one."""
    flown = aircraft_of(aircraft)
    plant = Plant(100, aircraft=flown)
    return tuple(t.name for t in flown.moments if plant.has(f"uncertainty/{t.name}-scale"))


def scenario_of(case: FaultCase, law: str, trimmed_deg: float) -> Scenario:
    """The flight of a case under a law; trimmed_deg: the surface's deflection in trim."""
    fault = dict(dict(FAULTS)[case.fault])
    if "off_deg" in fault:
        fault["position_deg"] = trimmed_deg + fault.pop("off_deg")
    return load_scenario(
        {
            "name": "matrix",
            "aircraft": case.aircraft,
            "duration_s": DURATION_S,
            "initial": {"airspeed_mps": case.airspeed_mps},
            "reference": REFERENCE,
            "uncertainty": UNCERTAINTY if case.aircraft == DEFAULT else {},
            "faults": [{**fault, "actuator": case.surface, "at_s": AT_S}],
            "fdi": {"fault_class": "all"},
            "control": {"law": law},
        }
        | (declared(case.turbulence, case.aircraft) if case.declared else {})
    )


@lru_cache
def trimmed_deg(airspeed_mps: float, surface: str, aircraft: str = DEFAULT) -> float:
    """Deflection of a surface in the trim the cases start from."""
    flown = aircraft_of(aircraft)
    altitude_m = initial_of(flown)().altitude_m
    point = trim(airspeed_mps, altitude_m, plant=Plant(100, aircraft=flown))
    return degrees(point.surfaces_rad[surface])


def fly_case(case: FaultCase) -> Document:
    """The row of a case: fault, verdict, tracking beside the oracle's, and why it was lost, if so."""
    off_deg = trimmed_deg(case.airspeed_mps, case.surface, case.aircraft)
    ours, best = (scenario_of(case, law, off_deg) for law in ("fault-tolerant-published", "oracle-published"))
    kept = columns_of(ours.airframe) if case.declared else None
    flight, oracle = fly(ours, kept), fly(best)
    seen = {} if kept is None else seen_when_told(ours, kept, case.surface)
    return {**case._asdict(), **_diagnosis(flight, case), **_tracking(flight, oracle, case), **seen}


DIAGNOSED = {  # by key of a row where it is in the metrics
    "detected": "detection.detected", "delay_s": "detection.delay_s", "false_alarm": "false_alarm",
    "isolated": "isolation.fault", "isolation_delay_s": "isolation.delay_s", "type": "isolation.type",
    "candidates": "isolation.candidates", "estimate": "isolation.estimate",
}  # fmt: skip


def _diagnosis(flight: Landing, case: FaultCase) -> Document:
    found = measure(flight)
    row = {key: found.at(path) for key, path in DIAGNOSED.items()}
    row["candidates"] = list(row["candidates"])
    return row | {"verdict": verdict(found, case.surface, flight.scenario.faults[0].type)}


def verdict(found: Metrics, surface: str, true_type: str) -> str:
    """named (surface and type right), surface (right, type open), open (still possible), unseen or WRONG."""
    isolation = found.isolation
    if not found.detection.detected:
        return "unseen"
    if found.false_alarm:
        return "WRONG"
    if isolation.fault is None:
        left = isolation.candidates
        return "open" if surface in left or f"{surface}:{true_type}" in left else "WRONG"
    if not isolation.correct or isolation.type_correct is False:
        return "WRONG"
    if isolation.type is None:
        return "surface" if true_type in isolation.candidates or not isolation.candidates else "WRONG"
    return "named"


def _tracking(flight: Landing, oracle: Landing, case: FaultCase) -> Document:
    axis = axis_of(flight.scenario, case.surface)
    rms_rad_s = [(one.post_fault_rms_rad_s or (0.0,) * 3)[AXES.index(axis)] for one in (flight, oracle)]
    ours, best = map(degrees, rms_rad_s)
    departure_s, signal = flight.departure or (None, None)
    return {
        "axis": axis,
        "rms_deg_s": ours,
        "oracle_rms_deg_s": best,
        "ratio": ours / best if best else None,
        "departure_s": departure_s,
        "oracle_departure_s": oracle.departure[0] if oracle.departure else None,
        "departure_signal": signal,
        "oracle_beyond_s": oracle.authority[axis]["beyond_s"] if oracle.authority else 0.0,
        "oracle_left_envelope_s": oracle.envelope_exits[0][0] if oracle.envelope_exits else None,
    }


def document_of(rows: Rows) -> Document:
    """The whole matrix as a document: cells, single flights, and what went wrong anywhere."""
    surfaces = dict.fromkeys(row["surface"] for row in rows)
    told = [row for row in rows if "told_chance" in row]
    wrong = sum(row["verdict"] == "WRONG" for row in rows)
    false_alarms = sum(row["false_alarm"] for row in rows)
    return {
        "aircraft": rows[0].get("aircraft"),
        "cells": [_cell(fault, surface, rows) for fault, _ in FAULTS for surface in surfaces],
        "flights": rows,
        "wrong": wrong,
        "false_alarms": false_alarms,
        "lost_though_the_oracle_was_not": [
            row for row in rows if row["departure_s"] is not None and row["oracle_departure_s"] is None
        ],
        "passed": not wrong and not false_alarms,
        **({"told": beside_told(told)} if told else {}),
    }


def beside_told(rows: Rows) -> Document:
    """The outcome of the flights in which a test that knows the fault detects it.

    named: the right surface, whether or not its type is still open; type_kept: the right type is named or
    among the candidates.
    """
    seen = [row for row in rows if row["told_chance"] > LIKELY]
    named = [row for row in seen if row["verdict"] in NAMED]
    seen_on, named_on = (Counter(row["surface"] for row in of_it) for of_it in (seen, named))
    surfaces = dict.fromkeys(row["surface"] for row in rows)
    return {
        "flights": len(rows),
        "seen": len(seen),
        "detected": sum(row["detected"] for row in seen),
        "named": len(named),
        "share": len(named) / len(seen) if seen else None,
        "type_kept": sum(row["detected"] and row["verdict"] != "WRONG" for row in seen),
        "by_surface": {s: {"seen": seen_on[s], "named": named_on[s]} for s in surfaces},
        "detected_but_not_told": sum(row["detected"] and row["told_chance"] <= LIKELY for row in rows),
    }


def _cell(fault: str, surface: str, rows: Rows) -> Document:
    here = [row for row in rows if (row["fault"], row["surface"]) == (fault, surface)]
    delays = [row["delay_s"] for row in here]
    return {
        "fault": fault,
        "surface": surface,
        "verdict": min((row["verdict"] for row in here), key=VERDICTS.index),
        "delay_s": None if None in delays else max(delays),
        "candidates": sorted({candidate for row in here for candidate in row["candidates"]}),
        "ratio": max((row["ratio"] for row in here if row["ratio"] is not None), default=None),
        "lost": sum(row["departure_s"] is not None for row in here),
        "oracle_lost": sum(row["oracle_departure_s"] is not None for row in here),
        "flights": len(here),
        "remark": _remark(here),
        **({"told": sum(row["told_chance"] > LIKELY for row in here)} if "told_chance" in here[0] else {}),
    }


def _reason(lost: Rows) -> str:
    """Why the aircraft is lost, as the flights of the oracle show it."""
    beyond_s = max(row["oracle_beyond_s"] for row in lost)
    if beyond_s > 0.0:
        return f"for {beyond_s:.1f} s no deflection could hold the {lost[0]['axis']} rate"
    left_s = [row["oracle_left_envelope_s"] for row in lost if row["oracle_left_envelope_s"] is not None]
    if left_s:
        return f"the validated envelope was left at {min(left_s):.1f} s, the outer loops being open"
    return f"{lost[0]['departure_signal']} diverged"


def _remark(here: Rows) -> str:
    """How many flights lose the aircraft, and why; or that the fault has no effect in any of them."""
    lost = [row for row in here if row["departure_s"] is not None]
    if lost:
        also = sum(row["oracle_departure_s"] is not None for row in lost)
        return f"lost in {len(lost)} of {len(here)} flights, the oracle in {also}: {_reason(lost)}"
    if all(not row["detected"] for row in here):
        return "no effect beyond the declared uncertainty: tracking is as before"
    return ""


def matrix_study(
    airspeeds_mps: tuple[float, ...] | None = None, declared: bool = False, aircraft: str = DEFAULT,
    turbulence: str = "none",
) -> Study:  # fmt: skip
    """The matrix of an aircraft, with errors or without, in such air."""
    name = DECLARED if declared else NAME
    folder = name if turbulence == "none" else f"{name}-{turbulence}"
    all_cases = cases(airspeeds_mps or airspeeds_of(aircraft), declared, aircraft, turbulence)
    return Study(folder, all_cases, fly_case, document_of, FILES)
