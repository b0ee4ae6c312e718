"""Damage of the GTM in random flights: does the diagnosis detect it, and does it name an intact surface?

`python -m tools.docs table gtm-damage` prints the table. The flights have each case of damage in turn, 70 to
110 kt, a bank of up to 45 deg to either side, light turbulence, tactical-grade sensors, servos, and sines as
references of the rates that the autopilot does not use. The instant of the damage is random. The calm flights
are the same in still air with exact sensors. A row for each case counts: flights; alarms before the damage;
damage detected within 1 s, later, never; flights that end with the name `unanticipated`, with a lost surface
named, undecided with a lost surface among the candidates, undecided without; flights in which an intact
surface was named at any time. Rows that the file has are not flown again. The aircraft `gtm` must be there
(`beaver-ftc import gtm`).
"""

import json
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

import beaver_ftc as bf
from beaver_ftc.aircraft import load
from beaver_ftc.scenario.schema import load_text

M_S_PER_KT = 0.514444
ALTITUDE_M = 1000.0  # below 2000 ft the turbulence declared is another
DURATION_S = 14.0
SEEDS = (2,)  # of the printed flights; flights of seed 1 chose what docs/results/choices.md says
REAL = ("sensors", "actuators", "environment", "fdi")
HEAD = (
    "case", "flights", "false alarms", "within 1 s", "later", "not found", "unanticipated", "lost named",
    "lost a candidate", "lost excluded", "wrong",
)  # fmt: skip
Document = dict[str, Any]


def scenario(k: int, calm: bool = False, seed: int = SEEDS[0]) -> Document:
    """The scenario of flight number k."""
    cases, rng = list(load("gtm").damage), np.random.default_rng([seed, k])

    def drawn(low: float, high: float, digits: int = 2) -> float:
        return round(float(rng.uniform(low, high)), digits)

    airspeed_mps, bank_deg = round(drawn(70, 110, 4) * M_S_PER_KT, 2), drawn(-45, 45, 1)
    sines = {
        axis: [{"sine": {"amplitude_deg_s": drawn(1, 5), "frequency_hz": drawn(0.1, 0.5)}}] for axis in "pqr"
    }
    hold = [{"hold": True}]
    given = {
        "name": f"damaged-{k}",
        "aircraft": "gtm",
        "duration_s": DURATION_S,
        "seed": 1000 * seed + k,
        "initial": {"airspeed_mps": airspeed_mps, "altitude_m": ALTITUDE_M},
        "autopilot": {"airspeed_mps": hold, "altitude_m": hold, "bank_deg": [{"value": bank_deg}]},
        "reference": sines,
        "sensors": "tactical-grade",
        "actuators": "servo",
        "environment": {"turbulence": "dryden", "severity": "light"},
        "fdi": {"bounds": {"sensors": "tactical-grade", "turbulence": "light"}, "statistical": {}},
        "faults": [{"type": "damage", "case": cases[k % len(cases)], "at_s": drawn(6, 9)}],
    }
    return {key: of for key, of in given.items() if not (calm and key in REAL)}


def flown(k: int, calm: bool) -> Document:
    """The row of flight number k."""
    given = scenario(k, calm)
    metrics = bf.fly(load_text(json.dumps(given)), log=False).metrics
    found, isolation, case = metrics["detection"], metrics["isolation"], given["faults"][0]["case"]
    lost = list(load("gtm").damage[case].takes)
    withdrawn = [each["fault"] for each in isolation["withdrawn"]]
    named = [name for name in (isolation["fault"], *withdrawn) if name not in (None, "unanticipated")]
    return {
        "k": k, "case": case,
        "false_alarm": found["detected"] and (found["delay_s"] is None or found["delay_s"] < 0),
        "delay_s": found["delay_s"], "fault": isolation["fault"],
        "candidates": isolation["candidates"], "withdrawn": withdrawn, "lost": lost,
        "wrong": [name for name in named if name not in lost],
    }  # fmt: skip


def rows(of: list[Document]) -> Iterator[list[Any]]:
    """Yield a row for each case, and one for all."""
    for case in (*dict.fromkeys(each["case"] for each in of), "all"):
        there = [each for each in of if case in (each["case"], "all")]
        delays = [each["delay_s"] for each in there if each["delay_s"] is not None]
        undecided = [each for each in there if each["fault"] is None and each["delay_s"] is not None]
        left = [bool(set(each["lost"]) & set(each["candidates"])) for each in undecided]
        yield [
            case, len(there), sum(each["false_alarm"] for each in there), sum(d <= 1.0 for d in delays),
            sum(d > 1.0 for d in delays), len(there) - len(delays),
            sum(each["fault"] == "unanticipated" for each in there),
            sum(each["fault"] in each["lost"] for each in there), sum(left), len(left) - sum(left),
            sum(bool(each["wrong"]) for each in there),
        ]  # fmt: skip


def fly_all(flights: int, calm: bool, out: Path) -> list[Document]:
    """The rows of this number of flights."""
    return list(rows_in(out, range(flights), lambda k: flown(k, calm)).values())


def rows_in(out: Path, wanted: Iterable[int], made: Callable[[int], Document]) -> dict[int, Document]:
    """The wanted rows by number `k`: rows that the file has, and new ones, which are added to the file."""
    done = map(json.loads, out.read_text().splitlines()) if out.is_file() else ()
    of = {each["k"]: each for each in done}
    with out.open("a", encoding="utf-8") as file:
        for k in sorted(set(wanted) - of.keys()):
            of[k] = made(k)
            print(json.dumps(of[k]), file=file, flush=True)
    return {k: of[k] for k in sorted(wanted)}
