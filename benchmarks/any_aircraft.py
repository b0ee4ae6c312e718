"""Do the guarantees hold for derived aircraft: no false alarm, and no wrong name?

`python -m tools.docs table any-aircraft` prints a row for each aircraft of the jsbsim package: hours of
healthy flight, and false alarms in them; losses of effectiveness of 40 % or more, and how many of them were
detected, named, and named wrongly; how often the candidates lacked the true surface. The last columns count
the losses that are certain to be detected within 0.5 s by the theory of `detectability`, computed along the
same flight without the loss, and those of them that were not.

Speeds, frame rates, references, magnitudes, times and profiles are random. The published bound is declared,
and the only error is that of the derived model. There is no autopilot, so some flights leave the simulated
altitudes and end early; further healthy flights follow until the hours are reached.
"""

from collections import Counter
from collections.abc import Iterator
from typing import Any

import numpy as np

from beaver_ftc import load
from beaver_ftc.documents.errors import BadInput
from beaver_ftc.loop.loop import fly
from beaver_ftc.results.metrics import fault_free_s
from beaver_ftc.scenario.schema import Scenario
from beaver_ftc.studies.detectability.certain import (
    DETECT_WITHIN_S,
    SETTLED_S,
    detection_magnitude,
    excitation,
)

TWELVE = ("737", "A4", "B747", "MD11", "c172p", "c310", "J3Cub", "L410", "OV10", "T37", "pa28", "p51d")
HEALTHY_S, FAULTY_S = 60.0, 25.0
MOST_REFUSED = 100  # flights that do not trim, before the hours are given up
SHAPES = ("sine", "square", "doublet", "step")
COUNTED = ("false", "losses", "detected", "named", "wrong", "left out", "certain", "late")


def signal(rng: np.random.Generator) -> dict[str, Any]:
    """A random reference: its amplitude is up to twice that of the built-in scenarios."""
    size = float(rng.uniform(0.5, 4.0))
    shape = str(rng.choice(SHAPES))
    if shape in ("sine", "square"):
        return {shape: {"amplitude_deg_s": size, "frequency_hz": float(rng.uniform(0.1, 0.6))}}
    start_s = float(rng.uniform(1.0, 8.0))
    if shape == "doublet":
        return {
            "doublet": {"amplitude_deg_s": size, "start_s": start_s, "width_s": float(rng.uniform(0.5, 2.0))}
        }
    return {"step": {"amplitude_deg_s": 0.2 * size, "start_s": start_s, "end_s": start_s + 3.0}}


def scenario(name: str, surface: str | None, seed: int, index: int) -> Scenario:
    """Flight number `index` of an aircraft: healthy, or with a loss of `surface`."""
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(index, len(surface or ""))))
    plain = load({"name": "plain", "aircraft": f"jsbsim:{name}"})
    low, high = plain.airframe.envelope.airspeed_mps
    middle = plain.initial.airspeed_mps
    rate_hz = int(np.exp(rng.uniform(np.log(25), np.log(200))))
    fault = {
        "actuator": surface, "type": "loss_of_effectiveness", "magnitude": float(rng.uniform(0.4, 1.0)),
        "at_s": float(rng.uniform(3.0, 10.0)),
    }  # fmt: skip
    if rng.random() < 0.3:
        fault |= {"profile": "incipient", "kappa_per_s": float(np.exp(rng.uniform(-1.0, 2.0)))}
    speed_mps = middle + 0.6 * (rng.uniform(low, high) - middle)
    return load({
        "name": f"{surface or 'healthy'}-{index}", "aircraft": f"jsbsim:{name}", "rate_hz": rate_hz,
        "substeps": int(rng.integers(1, 4)) if rng.random() < 0.2 else 1,
        "duration_s": FAULTY_S if surface else HEALTHY_S,
        "initial": {"airspeed_mps": float(speed_mps)},
        "reference": {axis: [signal(rng) for _ in range(rng.integers(1, 3))] for axis in "pqr"},
        "faults": [fault] if surface else [], "fdi": {"fault_class": "published"}, "seed": index,
    })  # fmt: skip


def flown(name: str, surface: str | None, flights: int, hours: float, seed: int) -> Iterator[Any]:
    """Yield the landings of flights with a loss, or of hours of healthy flight; a flight without a trim is
    left out."""
    index, flown_s, refused = 0, 0.0, 0
    wanted_s = 3600.0 * hours if surface is None else 0.0
    while index < flights or (flown_s < wanted_s and refused < MOST_REFUSED):
        try:
            done = fly(scenario(name, surface, seed, index))
            flown_s += float(done.scenario.duration_s if done.departure is None else done.departure[0])
            yield done
        except BadInput:
            refused += 1
        index += 1


def is_certain(faulty: Scenario) -> bool:
    """Whether the theory guarantees that the loss of a flight is detected in time, for all declared
    errors."""
    fault = faulty.faults[0]
    end_s = fault.at_s + DETECT_WITHIN_S
    healthy = faulty.with_({"duration_s": max(end_s + 0.1, SETTLED_S + 1.0)})
    seen = excitation(healthy)
    needed = detection_magnitude(seen.moment[fault.actuator], seen.bound)
    since_s = SETTLED_S + seen.dt * np.arange(len(needed)) - fault.at_s
    there = (since_s >= 0.0) & (since_s + seen.dt <= DETECT_WITHIN_S)
    grown = 1.0 - np.exp(-fault.kappa_per_s * since_s[there]) if fault.profile == "incipient" else 1.0
    return bool((fault.magnitude * grown > needed[there]).any())


def row_of(name: str, flights: int, hours: float, seed: int) -> list[str]:
    """The row of an aircraft: its name, hours in health, COUNTED."""
    count, healthy_s = Counter[str](), 0.0
    for surface in (None, *load({"name": "plain", "aircraft": f"jsbsim:{name}"}).airframe.surfaces):
        for flight in flown(name, surface, flights, hours, seed):
            if surface is None:
                healthy_s += fault_free_s(flight)
                count["false"] += flight.detection_time_s is not None
            else:
                count.update(outcome(surface, flight))
    return [name, f"{healthy_s / 3600.0:.2f} h", *(str(count[column]) for column in COUNTED)]


def outcome(surface: str, flight: Any) -> dict[str, bool]:
    """Which columns a flight with a loss counts in."""
    detected, at_s = flight.detection_time_s is not None, flight.scenario.faults[0].at_s
    left = {candidate.partition(":")[0] for candidate in flight.candidates}
    certain = is_certain(flight.scenario)
    return {
        "false": detected and flight.detection_time_s < at_s,
        "losses": True,
        "detected": detected,
        "named": flight.isolated == surface,
        "wrong": flight.isolated not in (None, surface),
        "left out": detected and flight.isolated is None and surface not in left,
        "certain": certain,
        "late": certain and not (detected and flight.detection_time_s <= at_s + DETECT_WITHIN_S),
    }
