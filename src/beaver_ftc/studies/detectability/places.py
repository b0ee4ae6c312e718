"""The survey of losses that are certain to be found: a scenario at several airspeeds, altitudes,
excitations."""

from collections.abc import Collection, Mapping, Sequence
from functools import partial
from itertools import permutations, product
from pathlib import Path

import numpy as np

from beaver_ftc.aircraft import Aircraft, load
from beaver_ftc.documents.errors import BadInput, BeaverFtcError, SimulationFailed
from beaver_ftc.results.model import Document
from beaver_ftc.scenario.airframe import find_aircraft
from beaver_ftc.scenario.schema import Scenario
from beaver_ftc.studies.detectability import isolability, places_shown
from beaver_ftc.studies.detectability.certain import (
    AMPLITUDES,
    DETECT_WITHIN_S,
    ISOLATE_WITHIN_S,
    MAGNITUDES,
    SETTLED_S,
    excitation,
    judge,
    pairs_of,
)
from beaver_ftc.studies.detectability.shown import NAME
from beaver_ftc.studies.engine.study import Study

SPEEDS_MPS = (36.0, 40.0, 44.0, 48.0, 52.0)
ALTITUDES_M = (0.0, 1000.0, 2000.0, 3000.0)
SHARES = (0.9, 1.0, 1.1)  # of the usual airspeed of another aircraft
EXCITATIONS = (0.25, 0.5, 1.0, 2.0)  # factors on the references of the scenario
PLACE = ("airspeed_mps", "altitude_m", "excitation")
TOO_SHORT = "the flight ends before a fault could be isolated"
PARTS = ("points", "pairs")  # of the document: rows for each fault, and for each fault and other fault
POINT_COLUMNS = (*PLACE, "fault", *MAGNITUDES, "confused_with", "why")
PAIR_COLUMNS = (*PLACE, "fault", "other", *isolability.LOSS_COLUMNS, *isolability.DOUBLET_COLUMNS)


def places_study(
    scenario: Scenario,
    speeds_mps: Sequence[float] = (),
    altitudes_m: Sequence[float] = (),
    excitations: Sequence[float] = EXCITATIONS,
) -> Study:
    """The survey of a scenario at all combinations of these airspeeds, altitudes and excitations. No
    airspeeds or altitudes: the usual ones.

    Raises BadInput if another scheme than the sharpened one diagnoses, or its fastest filter is below 1e6
    1/s.
    """
    fdi = scenario.fdi
    sharp = fdi.sharpen.pole_bank and fdi.sharpen.memory and fdi.sharpen.shared_effectiveness
    if not fdi.is_ours or not sharp or max(fdi.pole_bank_per_s, default=0.0) < 1e6:
        raise BadInput(
            f"{scenario.name}: fdi: detectability is worked out for the sharpened scheme, allowed: "
            "scheme adaptive-estimators, sharpen all, a filter of 1e6 in pole_bank_per_s"
        )
    start_m = scenario.airframe.file.start.altitude_m
    if not speeds_mps:
        speeds_mps = usual_airspeeds(scenario.airframe, SPEEDS_MPS)
    if not altitudes_m:  # the model error of another aircraft is known near its start altitude
        altitudes_m = ALTITUDES_M if start_m is None else (start_m,)
    return Study(
        f"{scenario.name[:86]}-{NAME}", list(product(speeds_mps, altitudes_m, excitations)),
        partial(rows_at_place, scenario), partial(document_of, scenario.name), places_shown.FILES,
        row=dict[str, list[Document]], follows_from=scenario,
    )  # fmt: skip


def usual_airspeeds(aircraft: Aircraft, of_the_beaver: tuple[float, ...]) -> tuple[float, ...]:
    """These airspeeds (m/s) for the built-in aircraft; for another one, SHARES of its usual airspeed."""
    if aircraft is load():
        return of_the_beaver
    return tuple(round(share * aircraft.usual_airspeed_mps, 1) for share in SHARES)


def with_aircraft(scenario: Scenario, reference: str) -> Scenario:
    """The scenario with another aircraft in its own start condition, with ideal actuators. Faults, model
    errors and declared servo errors belong to the first aircraft and are left out. A folder is looked for in
    the working directory."""
    find_aircraft(reference, Path())
    given: Document = {"aircraft": reference, "initial": {}, "uncertainty": {}, "actuators": "ideal"}
    given |= {"faults": [], "expect": {}}
    document = scenario.model_dump(mode="json", exclude_none=True)
    del document["fdi"]["bounds"]["actuators"]
    return Scenario.model_validate(document | given)


def rows_at_place(scenario: Scenario, point: tuple[float, float, float]) -> dict[str, list[Document]]:
    """The rows of each of PARTS at a place. If the flight fails, they have the reason in place of results."""
    place = dict(zip(PLACE, point, strict=True))
    flown = at(scenario, *point)
    faults = scenario.airframe.class_of_losses
    try:
        flight = excitation(flown)
        if len(flight.bound) < flight.windows[1]:
            raise SimulationFailed(TOO_SHORT)
        doublets = isolability.smallest_doublets(at(flown, *point[:2], 0.0), SETTLED_S)
    except BeaverFtcError as error:
        why = {"why": str(error)}
        points = [{"fault": fault, **why} for fault in faults]
        pairs = [{"fault": fault, "other": other, **why} for fault, other in permutations(faults, 2)]
    else:
        points = [{"fault": fault, **judge(flight, fault)} for fault in flight.moment]
        pairs = [row | doublets[row["fault"], row["other"]] for row in pairs_of(flight)]
    return {
        "points": [dict.fromkeys(POINT_COLUMNS) | place | row for row in points],
        "pairs": [dict.fromkeys(PAIR_COLUMNS) | place | row for row in pairs],
    }


def at(scenario: Scenario, speed_mps: float, altitude_m: float, excitation: float) -> Scenario:
    """The scenario at another airspeed and altitude, with its references times `excitation`."""
    signals = scenario.model_dump(mode="json", exclude_none=True)["reference"]
    reference = {axis: scaled(of_axis, AMPLITUDES, excitation) for axis, of_axis in signals.items()}
    place = {"initial.airspeed_mps": speed_mps, "initial.altitude_m": altitude_m}
    return scenario.with_({"faults": [], "expect": {}, "reference": reference, **place})


def scaled(signals: Sequence[Document], keys: Collection[str], times: float) -> list[Document]:
    """Reference signals; their parameters with these keys are multiplied by `times`."""
    return [
        {
            name: parameters
            | {key: (np.asarray(parameters[key]) * times).tolist() for key in parameters.keys() & {*keys}}
            for name, parameters in signal.items()
        }
        for signal in signals
    ]


def document_of(name: str, points: Sequence[Mapping[str, Sequence[Document]]]) -> Document:
    """The document `detectability.json`."""
    return {
        "scenario": name,
        "detect_within_s": DETECT_WITHIN_S,
        "isolate_within_s": ISOLATE_WITHIN_S,
        **{part: [row for point in points for row in point[part]] for part in PARTS},
    }
