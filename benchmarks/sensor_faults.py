"""Random faults of instruments, flown: what the diagnosis makes of each, by sensor and by type of fault.

    python benchmarks/sensor_faults.py --flights 500 --seed 1

Every flight has one broken instrument, its own rate (20 to 200 Hz), JSBSim frames per frame, airspeed,
references, fault class and law, and every second one the statistical detector. `surface` counts a flight in
which a surface was named at any time, also for one frame; `healthy` flies the same without a fault, all
instruments watched.
"""

import argparse
from collections import Counter
from collections.abc import Iterator
from typing import Any

import numpy as np

from beaver_ftc.diagnosis.instrument_words import instrument_found
from beaver_ftc.loop.loop import Loop
from beaver_ftc.scenario.given import load

TYPES = ("bias", "freeze", "noise", "scale", "lost")
SIZES = {
    **dict.fromkeys("pqr", (0.3, 10.0)),
    **dict.fromkeys(("alpha", "beta", "phi", "theta", "psi"), (0.5, 10.0)),
    "V": (1.0, 10.0), "qdyn": (20.0, 300.0), "altitude": (5.0, 100.0), "engine_rpm": (20.0, 300.0),
    "manifold_pressure": (0.3, 5.0), **dict.fromkeys(("ax", "ay", "az"), (0.3, 10.0)),
}  # fmt: skip
OUTCOMES = ("named", "unanticipated", "other sensor", "surface", "no alarm")


def draw(rng: np.random.Generator, bounds: str, turbulent: bool) -> dict[str, Any]:
    """A flight with one broken instrument."""
    reference = {
        axis: [{"sine": {"amplitude_deg_s": rng.uniform(1, 5), "frequency_hz": rng.uniform(0.1, 0.5)}}]
        for axis in "pqr"
    }
    words: dict[str, Any] = {
        "name": "sensor-fault",
        "duration_s": 20,
        "rate_hz": float(rng.choice([20, 50, 100, 200])),
        "substeps": int(rng.choice([1, 1, 2, 5])),
        "seed": int(rng.integers(2**31)),
        "initial": {"airspeed_mps": rng.uniform(35, 55)},
        "reference": reference,
        "faults": [fault(rng)],
        "sensors": bounds,
        "environment": {"turbulence": "dryden", "severity": "light"} if turbulent else {},
        "fdi": {
            "fault_class": str(rng.choice(["published", "all"])),
            "bounds": {"sensors": bounds, "turbulence": "light" if turbulent else "none"},
        },
        "control": {"law": str(rng.choice(["fault-tolerant", "nominal", "fault-tolerant-published"]))},
    }
    words["fdi"] |= {"statistical": {}} if rng.random() < 0.5 else {}
    return words


def fault(rng: np.random.Generator) -> dict[str, Any]:
    """One instrument's fault."""
    sensor, kind = str(rng.choice(list(SIZES))), str(rng.choice(TYPES))
    drawn: dict[str, Any] = {"sensor": sensor, "type": kind, "at_s": rng.uniform(4, 10)}
    low, high = np.log(SIZES[sensor])
    size = float(np.exp(rng.uniform(low, high)))
    sign = float(rng.choice([-1, 1]))
    if kind == "bias":
        drawn["magnitude"] = sign * size
    elif kind == "noise":
        drawn["magnitude"] = size
    elif kind == "scale":
        drawn["magnitude"] = sign * rng.uniform(0.1, 0.8)
    return drawn


def fly(words: dict[str, Any]) -> tuple[str, bool]:
    """What became of a flight: its outcome, and whether the aircraft was lost."""
    loop = Loop(load(words))
    for _ in loop.chunks():
        pass
    frame = loop.frames[0]
    said = instrument_found(frame["fdi"]["watch"], float(frame["t"]))
    lost = bool(frame["departed"])
    if frame["fdi"]["verdict"]["isolated"] >= 0 or frame["fdi"]["watch"]["misnamed"]:
        return "surface", lost
    if said is None:
        return ("unanticipated" if frame["fdi"]["verdict"]["detected"] else "no alarm"), lost
    if said["isolated"] is None or said["isolated"] == "unanticipated":
        return "unanticipated", lost
    broken = words["faults"][0]["sensor"] if words["faults"] else None
    return ("named" if said["isolated"] == f"sensor {broken}" else "other sensor"), lost


def flights(count: int, seed: int, bounds: str, turbulent: bool) -> Iterator[dict[str, Any]]:
    """The flights of a campaign."""
    for i in range(count):
        yield draw(np.random.default_rng([seed, i]), bounds, turbulent)


def table(found: dict[tuple[str, str], Counter[str]]) -> Iterator[str]:
    """The table by sensor and by type, line by line."""
    yield f"{'':18} {'flights':>8}" + "".join(f"{outcome:>15}" for outcome in OUTCOMES)
    groups = [(name, [key for key in found if key[0] == name]) for name in SIZES]
    groups += [(kind, [key for key in found if key[1] == kind]) for kind in TYPES]
    groups += [("gyros", [key for key in found if key[0] in "pqr"]), ("all", list(found))]
    for name, keys in groups:
        total = sum((found[key] for key in keys), Counter())
        yield f"{name:18} {total.total():8d}" + "".join(f"{total[outcome]:15d}" for outcome in OUTCOMES)


def main() -> None:
    """Fly the campaign and print its table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--flights", type=int, default=500)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--declared", default="ideal", help="errors of all instruments, had and declared")
    parser.add_argument("--turbulence", action="store_true", help="light turbulence, had and declared")
    parser.add_argument("--verbose", action="store_true", help="every flight that is not `named`")
    given = parser.parse_args()
    found: dict[tuple[str, str], Counter[str]] = {}
    losses = alarms = 0
    for i, words in enumerate(flights(given.flights, given.seed, given.declared, given.turbulence)):
        outcome, lost = fly(words)
        broken = words["faults"][0]
        found.setdefault((broken["sensor"], broken["type"]), Counter())[outcome] += 1
        losses += lost
        healthy = {**words, "faults": [], "fdi": {**words["fdi"], "sensor_monitor": "always"}}
        alarms += fly(healthy)[0] != "no alarm"
        if given.verbose and outcome != "named":
            what = {key: words[key] for key in ("rate_hz", "substeps", "faults", "control")}
            print(i, outcome, what, words["fdi"]["fault_class"], flush=True)
    print("\n".join(table(found)))
    print(f"aircraft lost: {losses}; alarms in as many healthy flights, watched: {alarms}")


if __name__ == "__main__":
    main()
