"""Every fault type on every surface: the verdict of the diagnosis, and the tracking of the flight.

Each case is flown with the laws `fault-tolerant-published` and `oracle-published`. A cell of the matrix is a
fault on a surface, with the worst result over the airspeeds.

    verdict    meaning, the best first
    named      surface and type are right
    surface    the surface is right, and its type is not determined, but not excluded
    open       no name, and the fault is among the candidates
    unseen     no alarm
    WRONG      a false alarm, a wrong name or type, or the fault is excluded
"""

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
from beaver_ftc.scenario.air import air_of
from beaver_ftc.scenario.airframe import find_aircraft, initial_of
from beaver_ftc.scenario.faults import TYPES
from beaver_ftc.scenario.schema import Scenario
from beaver_ftc.scenario.schema import load as load_scenario
from beaver_ftc.studies.detectability.certain import axis_of
from beaver_ftc.studies.detectability.places import usual_airspeeds
from beaver_ftc.studies.engine.study import Study
from beaver_ftc.studies.matrix.cells import document_of
from beaver_ftc.studies.matrix.informed import columns_of, informed_row
from beaver_ftc.studies.matrix.matrix_shown import FILES, NAME
from beaver_ftc.studies.reproduce.choices import SETTING

TOLERANCE = 0.05  # of the coefficients, with declared errors
SENSORS = "tactical-grade"
AIRSPEEDS_MPS = (38.0, 45.0, 52.0)
AT_S = 12.0  # begin of the fault
DURATION_S = 30.0
DECLARED = "fault-matrix-declared"  # name of the folder with declared errors, in place of NAME
REFERENCE, UNCERTAINTY = SETTING["reference"], SETTING["uncertainty"]

# Name in the table, and keys of the fault. off_deg: a jam at this angle from the trimmed deflection.
FAULTS: tuple[tuple[str, Document], ...] = tuple(
    (name, {"type": kind, **keys}) for kind, row in TYPES.items() for name, keys in row.examples
)


class FaultCase(NamedTuple):
    """One cell of the matrix at one airspeed."""

    fault: str
    surface: str
    airspeed_mps: float
    declared: bool = False  # whether it has the errors of `declared_errors`
    aircraft: str = DEFAULT
    turbulence: str = "none"  # flown and declared, with `declared`


def airspeeds_of(reference: str) -> tuple[float, ...]:
    """The airspeeds of the cases of an aircraft, m/s."""
    return usual_airspeeds(aircraft_of(reference), AIRSPEEDS_MPS)


def aircraft_of(reference: str) -> Aircraft:
    """The aircraft with this name. A folder is looked for in the working directory."""
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


def declared_errors(turbulence: str = "none", aircraft: str = DEFAULT) -> Document:
    """Keys of a scenario with errors of sensors, servos, air and coefficients, all of them declared.
    Coefficients are in turn at the lower and the upper end of their tolerance, if the truth has a factor for
    them. Without any factor, no model error is flown.
    """
    names = adjustable_terms(aircraft)
    factors = {name: 1.0 + (TOLERANCE if i % 2 else -TOLERANCE) for i, name in enumerate(names)}
    bounds = {"coefficients": TOLERANCE if factors else 0.0, "sensors": SENSORS, "turbulence": turbulence}
    return {
        "uncertainty": UNCERTAINTY | {"coefficients": factors} if factors else {},
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
    """Names of the terms of an aircraft whose truth has a factor for them; a derived aircraft has none."""
    airframe = aircraft_of(aircraft)
    plant = Plant(100, aircraft=airframe)
    return tuple(t.name for t in airframe.moments if plant.has(f"uncertainty/{t.name}-scale"))


def scenario_of(case: FaultCase, law: str, trimmed_deg: float) -> Scenario:
    """The flight of a case with a law. trimmed_deg: deflection of the surface in trim."""
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
        | (declared_errors(case.turbulence, case.aircraft) if case.declared else {})
    )


@lru_cache
def trimmed_deg(airspeed_mps: float, surface: str, aircraft: str = DEFAULT) -> float:
    """Deflection of a surface, deg, in the trim with which the cases start."""
    airframe = aircraft_of(aircraft)
    altitude_m = initial_of(airframe)().altitude_m
    point = trim(airspeed_mps, altitude_m, plant=Plant(100, aircraft=airframe))
    return degrees(point.surfaces_rad[surface])


def fly_case(case: FaultCase) -> Document:
    """The row of a case: fault, verdict, tracking with both laws, and the informed test if errors are
    declared."""
    off_deg = trimmed_deg(case.airspeed_mps, case.surface, case.aircraft)
    ours, best = (scenario_of(case, law, off_deg) for law in ("fault-tolerant-published", "oracle-published"))
    log = columns_of(ours.airframe) if case.declared else None
    flight, oracle = fly(ours, log), fly(best)
    informed = {} if log is None else informed_row(ours, log, case.surface)
    return {**case._asdict(), **_diagnosis(flight, case), **_tracking(flight, oracle, case), **informed}


DIAGNOSED = {  # key of a row: path in the metrics
    "detected": "detection.detected", "delay_s": "detection.delay_s", "false_alarm": "false_alarm",
    "isolated": "isolation.fault", "isolation_delay_s": "isolation.delay_s", "type": "isolation.type",
    "candidates": "isolation.candidates", "estimate": "isolation.estimate",
}  # fmt: skip


def _diagnosis(flight: Landing, case: FaultCase) -> Document:
    """The part of a row about the diagnosis."""
    metrics = measure(flight)
    row = {key: metrics.at(path) for key, path in DIAGNOSED.items()}
    row["candidates"] = list(row["candidates"])
    return row | {"verdict": verdict(metrics, case.surface, flight.scenario.faults[0].type)}


def verdict(metrics: Metrics, surface: str, true_type: str) -> str:
    """The verdict on a flight, as the table of the module says. true_type: type of the fault of the
    surface."""
    isolation = metrics.isolation
    if not metrics.detection.detected:
        return "unseen"
    if metrics.false_alarm:
        return "WRONG"
    if isolation.fault is None:
        candidates = isolation.candidates
        return "open" if surface in candidates or f"{surface}:{true_type}" in candidates else "WRONG"
    if not isolation.correct or isolation.type_correct is False:
        return "WRONG"
    if isolation.type is None:
        return "surface" if true_type in isolation.candidates or not isolation.candidates else "WRONG"
    return "named"


def _tracking(flight: Landing, oracle: Landing, case: FaultCase) -> Document:
    """The part of a row about tracking, on the axis of the largest effect of the surface, and about
    departures."""
    axis = axis_of(flight.scenario, case.surface)
    rms_rad_s = [
        (outcome.post_fault_rms_rad_s or (0.0,) * 3)[AXES.index(axis)] for outcome in (flight, oracle)
    ]
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


def matrix_study(
    airspeeds_mps: tuple[float, ...] | None = None, declared: bool = False, aircraft: str = DEFAULT,
    turbulence: str = "none",
) -> Study:  # fmt: skip
    """The study of an aircraft, with declared errors or without, and with this severity of turbulence."""
    name = DECLARED if declared else NAME
    folder = name if turbulence == "none" else f"{name}-{turbulence}"
    all_cases = cases(airspeeds_mps or airspeeds_of(aircraft), declared, aircraft, turbulence)
    return Study(folder, all_cases, fly_case, document_of, FILES)
