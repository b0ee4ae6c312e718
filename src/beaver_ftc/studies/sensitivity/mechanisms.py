"""The flights that show the worth of each mechanism.

    cell       a combination of fault, bandwidth of the law, undeclared error and instruments
    draw       a random flight of a cell: airspeed, references, begin of the fault, declared model errors, and
               the signs of the undeclared ones
    outcome    the results of a system in a draw with all of its mechanisms, or without one (outcomes.py)

Each system flies each draw with all of its mechanisms, and without each of them.
"""

from collections.abc import Iterable, Mapping
from itertools import product
from typing import Any, NamedTuple

import numpy as np

from beaver_ftc.aircraft import AXES
from beaver_ftc.loop.loop import fly
from beaver_ftc.results.log import Columns
from beaver_ftc.results.model import Document
from beaver_ftc.scenario.air import air_of
from beaver_ftc.scenario.schema import Scenario
from beaver_ftc.studies.compare.criteria import least_margins
from beaver_ftc.studies.compare.margins_in_flight import margins_of
from beaver_ftc.studies.engine.draws import loss, sines, swings
from beaver_ftc.studies.present.tables import finite
from beaver_ftc.studies.sensitivity.errors import FACTOR_LIMITS, signed
from beaver_ftc.studies.sensitivity.outcomes import outcome_of
from beaver_ftc.studies.sensitivity.systems import (
    CONSTANT,
    MECHANISMS,
    PAPER,
    SYSTEMS,
    Changes,
    Mechanism,
)

SURFACES = ("aileron", "elevator", "rudder")  # the draws of a cell take these in turn
LOSSES = {"loss 20 %": 0.2, "loss 40 %": 0.4, "loss 80 %": 0.8}
UNANTICIPATED = "unanticipated"
FAULTS = (*LOSSES, UNANTICIPATED)
# Bandwidth of the rate loops: Kp of the published law, 1/s, and the gain margin, dB, from which the default
# law computes its bandwidth.
BANDWIDTHS: Mapping[str, tuple[float, float]] = {
    "low": (2.3, 20.0),
    "medium": (6.6, 12.0),
    "high": (14.0, 6.0),
}
ERRORS = (0.0, 0.005, 0.02, 0.05)  # undeclared relative error of every moment coefficient
SENSORS = "tactical-grade"
# Flown and declared: sensors, turbulence, inertia coupling, and unstructured acceleration, rad/s2.
INSTRUMENTS: Mapping[str, tuple[str, str, float, float]] = {
    "exact sensors": ("ideal", "none", 0.25, 0.02),  # the published bounds
    "real sensors": (SENSORS, "none", 0.0, 0.002),
    "real sensors, light turbulence": (SENSORS, "light", 0.0, 0.002),
}
FACTORS: Mapping[str, tuple[Any, ...]] = {
    "fault": FAULTS, "bandwidth": tuple(BANDWIDTHS), "error": ERRORS, "instruments": tuple(INSTRUMENTS),
}  # fmt: skip
DRAWS = 3  # of a cell
AIRSPEED_MPS = (38.0, 52.0)
STRIKES_S = (6.0, 9.0)  # begin of the fault
AFTER_S = 8.0  # time that is flown after it
RATE_HZ = 100.0
AMPLITUDE_DEG_S = 3.0
SWINGS_RAD_S = (1.0, 15.0)  # frequencies of the unstructured acceleration


class Flight(NamedTuple):
    """One draw of a cell."""

    fault: str
    bandwidth: str
    error: float
    instruments: str
    run: int


def cases_of(draws: int) -> list[Flight]:
    """Every draw of every cell."""
    return [Flight._make((*cell, run)) for cell in product(*FACTORS.values()) for run in range(draws)]


def scenario_of(flight: Flight, seed: int, system: str) -> Scenario:
    """The flight of a system with all of its mechanisms. Random numbers depend on seed, cell and run alone,
    so that both systems fly the same."""
    places = (values.index(value) for values, value in zip(FACTORS.values(), flight, strict=False))
    draws = np.random.default_rng([seed, *places, flight.run])
    at_s = round(draws.uniform(*STRIKES_S) * RATE_HZ) / RATE_HZ
    sensors, air, coupling, swing_rad_s2 = INSTRUMENTS[flight.instruments]
    scenario = Scenario.model_validate(
        {
            "name": "mechanisms",
            "seed": int(draws.integers(2**31)),
            "duration_s": at_s + AFTER_S,
            "rate_hz": RATE_HZ,
            "initial": {"airspeed_mps": float(draws.uniform(*AIRSPEED_MPS))},
            "reference": sines(draws, AMPLITUDE_DEG_S),
            "sensors": sensors,
            "environment": air_of(air),
            "faults": [_fault(flight, at_s)],
            "fdi": {
                "bounds": {
                    "sensors": sensors,
                    "turbulence": air,
                    "inertia_coupling": dict.fromkeys(AXES, coupling),
                    "constant_rad_s2": dict.fromkeys(AXES, swing_rad_s2),
                }
            },
        }
    )
    errors = _errors(coupling, swing_rad_s2, draws) | _undeclared(scenario, flight.error, draws)
    return scenario.with_({**SYSTEMS[system], **_bandwidth(flight, system), **errors})


def _fault(flight: Flight, at_s: float) -> Document:
    """The fault of a draw."""
    if flight.fault == UNANTICIPATED:
        return {"type": "unanticipated", "Cm_alpha3": 10.0, "at_s": at_s}
    return loss(SURFACES[flight.run % len(SURFACES)], LOSSES[flight.fault], at_s)


def _errors(coupling: float, swing_rad_s2: float, draws: np.random.Generator) -> Document:
    """Random model errors within the declaration."""
    thetas = draws.uniform(-coupling, coupling, len(AXES)).tolist()
    sizes = draws.uniform(0.0, swing_rad_s2, len(AXES)).tolist()
    return {
        "uncertainty.inertia_coupling": dict(zip(AXES, thetas, strict=True)),
        "uncertainty.sinusoid": swings(draws, sizes, SWINGS_RAD_S),
    }


def _undeclared(scenario: Scenario, share: float, draws: np.random.Generator) -> Document:
    """An error of every moment coefficient by this share, with a random sign."""
    shares = {term.name: share for term in scenario.airframe.moments}
    ratios = signed(shares, usual=1.0, limits=FACTOR_LIMITS, times=1.0, draws=draws) if share else {}
    return {"uncertainty.coefficients": ratios}


def _bandwidth(flight: Flight, system: str) -> Changes:
    """The keys that give the law of a system its bandwidth. Ki = Kp^2 / 4 has two equal poles of the
    error."""
    Kp, margin_db = BANDWIDTHS[flight.bandwidth]
    if system == PAPER:
        return {"control.proportional_per_s": Kp, "control.integral_per_s2": Kp**2 / 4.0}
    return {"control.gain_margin_db": margin_db}


def without_mechanism(scenario: Scenario, mechanism: Mechanism) -> Scenario:
    """The scenario without a mechanism. A mechanism that is withheld from the law changes no key.

    Adaptive thresholds are replaced by the smallest constant threshold with the same guarantee: the largest
    value, over all axes, of the adaptive threshold in the same flight without fault and undeclared errors.
    """
    changed = scenario.with_(mechanism.without)
    if "fdi.options.adaptive_threshold" not in mechanism.without:
        return changed
    names = [f"{axis}_threshold_rad_s" for axis in AXES]
    log = Columns(*names)
    fly(scenario.with_({"faults": [], "uncertainty.coefficients": {}}), log)
    return changed.with_({CONSTANT: max(float(log[name].max()) for name in names)})


def fly_one(seed: int, flight: Flight) -> Document:
    """The outcomes of a draw, by key: of each system, with and without each of its mechanisms. Equal flights
    are flown once."""
    outcomes = {}
    for system in SYSTEMS:
        scenario = scenario_of(flight, seed, system)
        outcomes[system] = outcome_of(scenario)
        for mechanism in (candidate for candidate in MECHANISMS if candidate.system == system):
            if mechanism.with_key not in outcomes:
                outcomes[mechanism.with_key] = outcome_of(scenario.with_(mechanism.present))
            if mechanism.without_key not in outcomes:
                without = without_mechanism(scenario, mechanism)
                outcomes[mechanism.without_key] = outcome_of(without, mechanism.withheld)
    return outcomes


def margins_row(cell: tuple[str, str, str]) -> Document:
    """The smallest margins of the healthy loop of a system over surfaces and airspeeds. cell: system,
    bandwidth, instruments."""
    system, bandwidth, instruments = cell
    flight = Flight(FACTORS["fault"][0], bandwidth, FACTORS["error"][0], instruments, 0)
    gain_db, phase_deg = least_margins(margins_of(scenario_of(flight, 0, system)))
    return {
        "system": system,
        "bandwidth": bandwidth,
        "instruments": instruments,
        "gain_margin_db": finite(gain_db),
        "phase_margin_deg": finite(phase_deg),
    }


def margin_cells() -> Iterable[tuple[str, str, str]]:
    """System, bandwidth and instruments of each row of margins. Turbulence does not change a loop, so that
    only instruments without it are used."""
    instruments = [name for name, (_, air, *_) in INSTRUMENTS.items() if air == "none"]
    return product(SYSTEMS, BANDWIDTHS, instruments)
