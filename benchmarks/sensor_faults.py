"""Random faults of instruments, flown: what the diagnosis makes of each, by sensor and by type of fault.

    python benchmarks/sensor_faults.py --flights 500 --seed 1
    python benchmarks/sensor_faults.py --flights 500 --seed 1 --sound
    python benchmarks/sensor_faults.py --flights 2000 --seed 1 --at-start

Every flight has one broken instrument, its own rate (20 to 200 Hz), JSBSim frames per frame, airspeed,
references, fault class and law, and every second one the statistical detector. `surface` counts a flight in
which a surface was named at any time, also for one frame; `healthy` flies the same without a fault, all
instruments watched.

With --sound no instrument breaks. Each has errors of its own, as large as declared, at 20 to 500 Hz and 1 to
10 JSBSim frames per frame, in hard manoeuvres, wind and turbulence, while law, diagnosis and sensors are
changed, in every third flight with a broken surface. Each scenario with an alarm between the instruments, or
with any but no fault, is printed: `beaver-ftc run` flies it.

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
            "sensor_monitor": "always",
            "bounds": {"sensors": bounds, "turbulence": "light" if turbulent else "none"},
        },
        "control": {"law": str(rng.choice(["fault-tolerant", "nominal", "fault-tolerant-published"]))},
    }
    words["fdi"] |= {"statistical": {}} if rng.random() < 0.5 else {}
    return words


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


def fly(words: dict[str, Any], last: bool = False) -> tuple[str, bool]:
    """What became of a flight: its outcome, and whether it was lost; last: by the last name only."""
    loop = Loop(load(words))
    for _ in loop.chunks():
        pass
    frame = loop.frames[0]
    said = sensor_monitor_finding(frame["fdi"]["sensor_monitor"], float(frame["t"]))
    lost = bool(frame["departed"])
    if frame["fdi"]["verdict"]["isolated_estimator"] >= 0 or (
        frame["fdi"]["sensor_monitor"]["output"]["had_surface"] and not last
    ):
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
            outcome, _ = fly(words, last=True)
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


def _manoeuvres(rng: np.random.Generator) -> dict[str, Any]:
    kinds = (
        lambda a: {
            "doublet": {"amplitude_deg_s": a, "start_s": rng.uniform(0, 3), "width_s": rng.uniform(0.3, 2)}
        },
        lambda a: {"sine": {"amplitude_deg_s": a, "frequency_hz": rng.uniform(0.1, 3)}},
        lambda a: {"step": {"amplitude_deg_s": a / 3, "start_s": rng.uniform(0, 4)}},
    )
    hardest = {"p": 40.0, "q": 12.0, "r": 15.0}
    return {
        axis: [kinds[int(rng.integers(3))](float(rng.uniform(-most, most)))]
        for axis, most in hardest.items()
        if rng.random() < 0.8
    }


def _changes(rng: np.random.Generator, duration_s: float, sensors: Any) -> Iterator[dict[str, Any]]:
    """Changes in flight; sensors: those it begins with. Other ones may come without another declaration."""
    for at_s in np.sort(rng.uniform(0.2, duration_s, int(rng.integers(0, 4)))):
        kind = int(rng.integers(4))
        if kind == 0:
            sensors = errors(rng)
        yield {
            "at_s": float(at_s),
            **(
                {"sensors": sensors, "declared_sensors": sizes_of(sensors)},
                {"sensors": _others(rng, sensors)},
                {"scheme": "adaptive-estimators"},
                {"law": str(rng.choice(["nominal", "lqr", "oracle"]))},
            )[kind],
        }


def _others(rng: np.random.Generator, sensors: Any) -> Any:
    """Other instruments within the same declaration."""
    if isinstance(sensors, str):
        return str(rng.choice(["ideal", sensors]))
    return {
        name: {
            key: rng.uniform(0, value) if value > 0 else -rng.uniform(0, -value) for key, value in of.items()
        }
        for name, of in sensors.items()
    }


def draw_sound(rng: np.random.Generator) -> dict[str, Any]:
    """A flight whose instruments are as declared."""
    sensors, severity = errors(rng), str(rng.choice(["none", "none", "light", "moderate"]))
    substeps, duration_s = int(rng.integers(1, 11)), float(rng.uniform(5, 20))
    rate_hz = float(20.0 * 25.0 ** rng.uniform() if substeps < 4 else rng.uniform(20, 200))
    words: dict[str, Any] = {
        "name": "sound",
        "duration_s": duration_s,
        "rate_hz": rate_hz,
        "substeps": substeps,
        "seed": int(rng.integers(2**31)),
        "initial": {"airspeed_mps": rng.uniform(35, 60), "altitude_m": rng.uniform(600, 4000)},
        "reference": _manoeuvres(rng),
        "sensors": sensors,
        "actuators": str(rng.choice(["ideal", "servo"])),
        "environment": {"wind_mps": [*rng.uniform(-20, 20, 2).tolist(), float(rng.choice([-1, 0, 1]))]},
        "fdi": {
            "sensor_monitor": "always",
            "fault_class": str(rng.choice(["published", "all"])),
            "bounds": {"sensors": sizes_of(sensors), "turbulence": severity},
        },
        "changes": list(_changes(rng, duration_s, sensors)),
    }
    words["environment"] |= {"turbulence": "dryden", "severity": severity} if severity != "none" else {}
    if rng.random() < 0.33:
        at_s = float(rng.choice([0.0, rng.uniform(0, duration_s)]))
        bias = {"type": "bias", "actuator": str(rng.choice(["elevator", "aileron", "rudder"])), "at_s": at_s}
        words["faults"] = [{**bias, "bias_deg": float(rng.uniform(-6, 6))}]
    return words


def speaks(words: dict[str, Any]) -> bool:
    """Whether a flight raises an alarm between the instruments, at any time, or any without a fault."""
    loop = Loop(load(words))
    alarmed = False
    for _ in loop.chunks():
        alarmed |= bool(loop.frames["fdi"]["sensor_monitor"]["output"]["alarmed"][0])
    landed = loop.land()
    found = [landed.detection_time_s, *(change.get("detection_time_s") for change in landed.changes)]
    return alarmed or (not words.get("faults") and any(time_s is not None for time_s in found))


def fly_sound(count: int, seed: int) -> None:
    """Fly so many with sound instruments; print those with an alarm, and how many they were."""
    alarms = 0
    for i in range(count):
        words = draw_sound(np.random.default_rng([seed, i]))
        if speaks(words):
            alarms += 1
            print(json.dumps(words), flush=True)
    print(f"alarms in {count} flights with sound instruments: {alarms}")


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
    parser.add_argument("--sound", action="store_true", help="no broken instrument: nothing may alarm")
    parser.add_argument("--at-start", action="store_true", help="broken before the diagnosis first reads it")
    parser.add_argument(
        "--later", action="store_true", help="the flights of --at-start, broken in mid-flight"
    )
    parser.add_argument("--first", type=int, default=0, help="number of the first flight, with --at-start")
    parser.add_argument("--aircraft", nargs="+", default=["beaver"], help="in turn, with --at-start")
    parser.add_argument("--verbose", action="store_true", help="every flight that is not `named`")
    given = parser.parse_args()
    if given.sound:
        fly_sound(given.flights, given.seed)
        return
    if given.at_start or given.later:
        fly_at_start(given.flights, given.first, given.seed, given.aircraft, given.later)
        return
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
