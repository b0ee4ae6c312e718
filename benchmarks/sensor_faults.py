"""Random faults of instruments, flown: what the diagnosis makes of each, by sensor and by type of fault.

    python benchmarks/sensor_faults.py --at-start --flights 2000 --seed 1
    python benchmarks/sensor_faults.py --later --flights 2000 --seed 1

With --at-start the instrument is broken before the diagnosis first reads it: at 0 s, or while an earlier
diagnosis runs, which a change then replaces. Aircraft, instrument, type, size, declared errors and turbulence
are drawn. Nothing anchors the reading then, so that some stay open; each flight in which a sound instrument
or a surface is the last name is printed as a scenario. --later flies the same with the fault in mid-flight.
"""

import argparse
import json
from collections import Counter
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from beaver_ftc.diagnosis.monitors.redundancy import sensor_monitor_finding
from beaver_ftc.documents.errors import BadInput
from beaver_ftc.loop.loop import Loop
from beaver_ftc.scenario.schema import load
from beaver_ftc.scenario.sensors import ENGINE, PRESETS, Sensors

TYPES = ("bias", "freeze", "noise", "scale", "lost")
SIZES = {
    **dict.fromkeys("pqr", (0.3, 10.0)),
    **dict.fromkeys(("alpha", "beta", "phi", "theta", "psi"), (0.5, 10.0)),
    "V": (1.0, 10.0), "qdyn": (20.0, 300.0), "altitude": (5.0, 100.0), "engine_rpm": (20.0, 300.0),
    "manifold_pressure": (0.3, 5.0), **dict.fromkeys(("ax", "ay", "az"), (0.3, 10.0)),
}  # fmt: skip
OUTCOMES = ("named", "unanticipated", "other sensor", "surface", "no alarm")


def fault(rng: np.random.Generator, names: Sequence[str] = tuple(SIZES)) -> dict[str, Any]:
    """The fault of one of the instruments `names`."""
    sensor, kind = str(rng.choice(list(names))), str(rng.choice(TYPES))
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


def fly(words: dict[str, Any]) -> str:
    """What became of a flight, by its last name."""
    loop = Loop(load(words))
    for _ in loop.chunks():
        pass
    verdict = loop.frames[0]["fdi"]["verdict"]
    if verdict["isolated_estimator"] >= 0:
        return "surface"
    said = sensor_monitor_finding(loop.frames[0]["fdi"]["sensor_monitor"], float(loop.frames[0]["t"]))
    if said is None:
        return "unanticipated" if verdict["detected"] else "no alarm"
    if said["isolated"] in (None, "unanticipated"):
        return "unanticipated"
    return "named" if said["isolated"] == f"sensor {words['faults'][0]['sensor']}" else "other sensor"


def errors(rng: np.random.Generator) -> Any:
    """Errors of instruments, of any keys that can be declared; or a preset."""
    if rng.random() < 0.3:
        return str(rng.choice(list(PRESETS)))
    fields = Sensors.model_fields.items()
    return {name: _errors_of(rng, name, field.annotation) for name, field in fields if rng.random() < 0.4}


def draw_at_start(rng: np.random.Generator, aircraft: str, later: bool) -> dict[str, Any]:
    """A flight in which an instrument is broken before the diagnosis first reads it; later: afterwards."""
    known = load({"aircraft": aircraft}).airframe
    turbulent = str(rng.choice(["none", "none", "none", "light", "moderate"]))
    sensors = errors(rng) if rng.random() < 0.6 else "ideal"
    trimmed = load({"aircraft": aircraft}).initial
    broken = fault(rng, tuple(name for name in SIZES if known.has_engine_instruments or name not in ENGINE))
    duration_s, anew_s = float(rng.uniform(4, 15)), float(rng.uniform(0.5, 3))
    anew = rng.random() < 0.4
    broken["at_s"] = float(rng.choice([0.0, rng.uniform(0, anew_s), anew_s])) if anew else 0.0
    if later:
        broken["at_s"] = rng.uniform(0.3, 0.8) * duration_s + (anew_s if anew else 0.0)
    words: dict[str, Any] = {
        "name": "broken-at-start",
        "aircraft": aircraft,
        "duration_s": duration_s + (anew_s if anew else 0.0),
        "rate_hz": float(rng.choice([20, 50, 100, 200])),
        "substeps": int(rng.choice([1, 1, 2, 5])),
        "seed": int(rng.integers(2**31)),
        "initial": {"airspeed_mps": trimmed.airspeed_mps * rng.uniform(0.9, 1.15)},
        "reference": _gentle(rng) if rng.random() < 0.8 else {},
        "faults": [broken],
        "changes": [{"at_s": anew_s, "scheme": "adaptive-estimators"}] if anew else [],
        "sensors": sensors,
        "environment": {"turbulence": "dryden", "severity": turbulent} if turbulent != "none" else {},
        "fdi": {
            "fault_class": str(rng.choice(["published", "all"])),
            "sensor_monitor": "always",
            "bounds": {"sensors": sizes_of(sensors), "turbulence": turbulent},
        },
        "control": {"law": str(rng.choice(["fault-tolerant", "nominal", "lqr"]))},
    }
    words["fdi"] |= {"statistical": {}} if rng.random() < 0.5 else {}
    return words


def _gentle(rng: np.random.Generator) -> dict[str, Any]:
    """Sines about each axis, some from later on."""

    def sine() -> dict[str, Any]:
        size, frequency_hz = float(rng.uniform(1, 8)), float(rng.uniform(0.1, 0.6))
        start_s = float(rng.choice([0.0, 0.0, rng.uniform(0, 4)]))
        phase_deg = float(rng.uniform(0, 360))
        words = {"amplitude_deg_s": size, "frequency_hz": frequency_hz, "phase_deg": phase_deg}
        return {"sine": words | {"start_s": start_s}}

    return {axis: [sine()] for axis in "pqr" if rng.random() < 0.8}


def fly_at_start(count: int, first: int, seed: int, aircraft: list[str], later: bool) -> None:
    """Fly so many with an instrument broken at the start; print those whose last name is of a sound part."""
    found: dict[tuple[str, str], Counter[str]] = {}
    for i in range(first, first + count):
        rng = np.random.default_rng([seed, i])
        words = draw_at_start(rng, aircraft[i % len(aircraft)], later)
        try:
            outcome = fly(words)
        except BadInput as refused:  # this draw cannot be flown
            print(f"{i}: {refused}", flush=True)
            continue
        broken = words["faults"][0]
        found.setdefault((broken["sensor"], broken["type"]), Counter())[outcome] += 1
        if outcome in ("other sensor", "surface"):
            print(i, outcome, json.dumps(words), flush=True)
    print("\n".join(table(found)))


def _errors_of(rng: np.random.Generator, name: str, kind: Any) -> dict[str, float]:
    noise, bias, quantum, _ = kind.si
    size = SIZES[name][0]
    sizes = {noise: 0.2 * size, bias: 2.0 * size, quantum: 0.5 * size, "scale_error": 0.05}
    sizes |= {"drift_deg_h": 1000.0} if "drift_deg_h" in kind.model_fields else {}
    drawn = {
        key: most * float(10.0 ** rng.uniform(-2, 0)) for key, most in sizes.items() if rng.random() < 0.5
    }
    signed = (bias, "scale_error", "drift_deg_h")
    return {
        key: value * float(rng.choice([-1, 1])) if key in signed else value for key, value in drawn.items()
    }


def sizes_of(sensors: Any) -> Any:
    """The same errors as bounds: a drift or a slope of either sign is declared by its size."""
    if isinstance(sensors, str):
        return sensors
    return {name: {key: abs(value) for key, value in of.items()} for name, of in sensors.items()}


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
    when = parser.add_mutually_exclusive_group(required=True)
    when.add_argument("--at-start", action="store_true", help="broken before the diagnosis first reads it")
    when.add_argument("--later", action="store_true", help="the same flights, broken in mid-flight")
    parser.add_argument("--first", type=int, default=0, help="number of the first flight")
    parser.add_argument("--aircraft", nargs="+", default=["beaver"], help="in turn")
    given = parser.parse_args()
    fly_at_start(given.flights, given.first, given.seed, given.aircraft, given.later)


if __name__ == "__main__":
    main()
