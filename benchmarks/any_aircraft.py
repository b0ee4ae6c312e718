"""Whether the promises hold for aircraft nobody wrote by hand: no false alarm, no fault named wrongly.

    python benchmarks/any_aircraft.py [NAMES] --flights N --seed S [--first K] [--healthy-s T] [--hours H]

Each aircraft is derived if it has not been. Then N healthy flights, and N losses of effectiveness of 40 % and
more of each surface, at random speeds, frame rates, references, magnitudes, times and profiles, with the
published bound declared and no error but the aircraft's own. There is no autopilot, so that some flights end
early, out of the altitudes that are simulated: `--hours` flies further healthy ones, with the numbers that
follow, until so many hours are full. `--flights 0 --first 200 --hours 2.5` flies these alone.
A name may be a folder, `./aircraft/737`: of `derive --engines`, say, whose engines fail besides. These have
a row of their own, where only `unanticipated` is a name that is not wrong.
A row an aircraft: hours flown in health and their false alarms; of each fault how many were detected, named,
named wrongly, and how often the true surface was left out of what is still possible; how many the theory of
`detectability` is certain to detect within 0.5 s, weighed along the same flight in health, and how many of
these were not (`late`).
"""

import argparse
import time
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from beaver_ftc import load
from beaver_ftc.documents.errors import BadInput
from beaver_ftc.loop.loop import fly
from beaver_ftc.results.metrics import fault_free_s
from beaver_ftc.scenario.airframe import find_aircraft
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
COLUMNS = (
    "aircraft",
    "healthy",
    "false",
    "losses",
    "detected",
    "named",
    "wrong",
    "left out",
    "certain",
    "late",
    "departed",
    "s",
)


def signal(rng: np.random.Generator) -> dict[str, Any]:
    """One reference: amplitudes as in the built-in scenarios, up to twice that."""
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


def reference_of(name: str) -> str:
    """What a scenario calls it."""
    return name if name.startswith("./") else f"jsbsim:{name}"


def plain_of(name: str) -> Scenario:
    """A flight with nothing in it."""
    find_aircraft(reference_of(name), Path())
    return load({"name": "plain", "aircraft": reference_of(name)})


def scenario(
    name: str, surface: str | None, seed: int, index: int, healthy_s: float, fault_class: str
) -> Scenario:
    """Flight number `index` of an aircraft: healthy, or with a loss of `surface`."""
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(index, len(surface or ""))))
    reference, plain = reference_of(name), plain_of(name)
    low, high = plain.airframe.envelope.airspeed_mps
    middle = plain.initial.airspeed_mps
    rate_hz = int(np.exp(rng.uniform(np.log(25), np.log(200))))
    fault = {
        "actuator": surface, "type": "loss_of_effectiveness", "magnitude": float(rng.uniform(0.4, 1.0)),
        "at_s": float(rng.uniform(3.0, 10.0)),
    }  # fmt: skip
    if surface in plain.airframe.damage:
        fault = {"type": "damage", "case": surface, "at_s": fault["at_s"]}
    elif rng.random() < 0.3:
        fault |= {"profile": "incipient", "kappa_per_s": float(np.exp(rng.uniform(-1.0, 2.0)))}
    speed_mps = middle + 0.6 * (rng.uniform(low, high) - middle)
    return load({
        "name": f"{surface or 'healthy'}-{index}", "aircraft": reference, "rate_hz": rate_hz,
        "substeps": int(rng.integers(1, 4)) if rng.random() < 0.2 else 1,
        "duration_s": FAULTY_S if surface else healthy_s,
        "initial": {"airspeed_mps": float(speed_mps)},
        "reference": {axis: [signal(rng) for _ in range(rng.integers(1, 3))] for axis in "pqr"},
        "faults": [fault] if surface else [], "fdi": {"fault_class": fault_class}, "seed": index,
    })  # fmt: skip


def flown(
    name: str, faulty: Iterable[str | None], args: argparse.Namespace
) -> Iterator[tuple[str | None, Any]]:
    """What is faulty, or None in health, and what came of the flight; None where it has no trim."""
    for surface in faulty:
        index, flown_s, refused = args.first, 0.0, 0
        wanted_s = 3600.0 * args.hours if surface is None else 0.0
        while index < args.first + args.flights or (flown_s < wanted_s and refused < MOST_REFUSED):
            flight = scenario(name, surface, args.seed, index, args.healthy_s, args.fault_class)
            index += 1
            try:
                done = fly(flight)
            except BadInput as error:  # a speed at which it does not trim
                print(f"   {name} {flight.name}: {error}")
                refused += 1
                continue
            flown_s += seconds_of(done)
            yield surface, done


def seconds_of(flight: Any) -> float:
    """How long it flew."""
    return float(flight.scenario.duration_s if flight.departure is None else flight.departure[0])


def is_certain(faulty: Scenario) -> bool:
    """Whether theory is certain to detect the loss of a flight in time, wherever its uncertainty is."""
    fault = faulty.faults[0]
    end_s = fault.at_s + DETECT_WITHIN_S
    healthy = faulty.with_({"duration_s": max(end_s + 0.1, SETTLED_S + 1.0)})
    seen = excitation(healthy)
    needed = detection_magnitude(seen.moment[fault.actuator], seen.bound)
    since_s = SETTLED_S + seen.dt * np.arange(len(needed)) - fault.at_s
    there = (since_s >= 0.0) & (since_s + seen.dt <= DETECT_WITHIN_S)
    grown = 1.0 - np.exp(-fault.kappa_per_s * since_s[there]) if fault.profile == "incipient" else 1.0
    return bool((fault.magnitude * grown > needed[there]).any())


def rows_of(name: str, args: argparse.Namespace) -> Iterator[tuple[list[str], list[str]]]:
    """The rows of an aircraft: of its surfaces, and of engines that may fail."""
    yield row_of(name, args)
    aircraft = plain_of(name).airframe
    if aircraft.effectors:
        yield row_of(name, args, tuple(aircraft.damage))


def row_of(name: str, args: argparse.Namespace, damage: tuple[str, ...] = ()) -> tuple[list[str], list[str]]:
    """A row of the table, of health and surfaces, or of damage; and a line on each broken promise."""
    faulty = damage or (None, *plain_of(name).airframe.surfaces)
    start, count, said = time.perf_counter(), dict.fromkeys(COLUMNS, 0), []
    for surface, flight in flown(name, faulty, args):
        detected = flight.detection_time_s is not None
        label = f"{name} {flight.scenario.name}"
        if flight.departure is not None:
            count["departed"] += 1
            said.append(f"{label}: departed, {flight.departure}")
        if surface is None:
            count["healthy"] += fault_free_s(flight)
            if detected:
                count["false"] += 1
                said.append(f"{label}: alarm at {flight.detection_time_s:.2f} s in health")
            continue
        fault = flight.scenario.faults[0]
        early = detected and flight.detection_time_s < fault.at_s
        unknown = fault.type == "damage"
        name_of_it = "unanticipated" if unknown else surface
        wrong = flight.isolated is not None and flight.isolated != name_of_it
        left = {candidate.partition(":")[0] for candidate in flight.candidates}
        left_out = detected and not unknown and flight.isolated is None and surface not in left
        certain = not unknown and is_certain(flight.scenario)
        in_time = detected and flight.detection_time_s <= fault.at_s + DETECT_WITHIN_S
        count["losses"] += 1
        count["certain"] += certain
        count["late"] += certain and not in_time
        count["detected"] += detected
        count["named"] += flight.isolated == name_of_it
        count["wrong"] += wrong
        count["left out"] += left_out
        count["false"] += early
        if wrong or early or left_out:
            said.append(f"{label}: {'early' if early else flight.isolated}, of {flight.candidates}")
        if certain and not in_time:
            said.append(f"{label}: certain from {fault.at_s:.2f} s, detected {flight.detection_time_s}")
    values = [f"{count['healthy'] / 3600.0:.2f} h", *(str(count[c]) for c in COLUMNS[2:-1])]
    return [name, *values, f"{time.perf_counter() - start:.0f}"], said


def main() -> None:
    """Fly them all and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("names", nargs="*", default=TWELVE, metavar="NAME")
    parser.add_argument("--flights", type=int, default=20, help="in health, and with each surface")
    parser.add_argument("--first", type=int, default=0, help="the number of the first flight of each")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--healthy-s", type=float, default=HEALTHY_S)
    parser.add_argument("--hours", type=float, default=0.0, help="fly at least so long in health")
    parser.add_argument("--class", dest="fault_class", choices=("published", "all"), default="published")
    args = parser.parse_args()
    table, broken = Table(*COLUMNS), []
    for name in args.names:
        find_aircraft(reference_of(name), Path())
        for row, said in rows_of(name, args):
            table.add_row(*row)
            broken += said
            print("  ".join(row), *said, sep="\n   ", flush=True)
    Console(width=120).print(table)
    print("\n".join(broken) or "every promise held")


if __name__ == "__main__":
    main()
