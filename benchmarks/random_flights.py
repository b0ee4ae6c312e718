"""Random flights inside what they declare: is anything alarmed falsely, named wrongly, or excluded?

    python benchmarks/random_flights.py [--flights N] [--seed S] [--first I] [--only CLASS] [--keep FOLDER]
        [--false-alarms-per-h RATE]

A flight draws its rate (20 to 500 Hz), substeps, airspeed, references, actuators, the errors it declares and
has, the detector in authority, the fault class, and in three of five flights a fault of any type, surface,
size and course. Flight I of a seed is the same whatever else is flown. Prints a row for each class of
declared errors and detector; every counterexample is written to FOLDER as a scenario for `beaver-ftc run`.
Last comes the rate of false alarms with its 95 % bound, beside the declared one: so many hours cannot show a
rate of one in a thousand of them, but that of RATE, declared instead.
"""

import argparse
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

import beaver_ftc as bf
from beaver_ftc.aircraft import load
from beaver_ftc.scenario.diagnosis import Statistical
from beaver_ftc.scenario.dump import to_yaml
from beaver_ftc.studies.engine.statistics import poisson

AXES, SURFACES = ("p", "q", "r"), ("aileron", "elevator", "rudder", "flap")
ERRORS = ("perfect", "published", "sensors", "coefficients", "turbulence", "everything")
DETECTORS = ("worst-case", "statistical", "either")
HEALTHY_SHARE, LARGE_REFERENCES, COARSE, AT_THE_BOUND = 0.4, 0.15, 0.5, 0.3
DIVES, GUSTS, SLOWEST_MPS = 0.1, 0.15, 35.0
SLOWEST_DEG_S, UNLIMITED_DEG_S = 0.5, 60.0  # rate of a slow surface, as declared; of one without a limit
FASTEST_DAMPING_PER_S = 10.0  # of a body rate
FASTEST_RAD_S = {"worst-case": 60.0, "statistical": 15.0, "either": 15.0}  # of the unstructured uncertainty
ZERO = dict.fromkeys(AXES, 0.0)
WRONG = ("false alarm", "wrong surface", "surface excluded", "wrong type", "type excluded")

Keys = dict[str, Any]
Random = np.random.Generator


def log_uniform(rng: Random, low: float, high: float) -> float:
    """Equally likely on a logarithmic scale."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def within(rng: Random, bound: float) -> float:
    """Anywhere within a bound of either sign, and often right at it."""
    size = bound if rng.random() < AT_THE_BOUND else rng.uniform(0.0, bound)
    return float(size * rng.choice([-1.0, 1.0]))


def reference(rng: Random) -> Keys:
    """One signal an axis, sometimes far beyond what an aircraft can follow; or a dive past the vertical."""
    if rng.random() < DIVES:
        away = {"amplitude_deg_s": -rng.uniform(15, 80), "start_s": rng.uniform(0, 1)}
        return {"q": [{"step": away}]}
    largest = 140.0 if rng.random() < LARGE_REFERENCES else 5.0
    kinds = rng.choice(["sine", "square", "none"], size=3, p=[0.5, 0.3, 0.2])
    return {
        axis: [{str(kind): {
            "amplitude_deg_s": rng.uniform(0.1, largest), "frequency_hz": log_uniform(rng, 0.1, 1.0),
            "phase_deg": rng.uniform(0, 360),
        }}]
        for axis, kind in zip(AXES, kinds, strict=True)
        if kind != "none"
    }  # fmt: skip


def actuators(rng: Random, errors: str) -> Any:
    """Ideal ones, the preset, or any lag and limit; all errors together are those of servos."""
    if errors == "everything" or rng.random() < 0.3:
        return "servo"
    if rng.random() < 0.5:
        return "ideal"
    bandwidth, rate = log_uniform(rng, 3, 100), log_uniform(rng, 5, 500)
    lags, limited = rng.random(2) < 0.7
    return {"bandwidth_rad_s": bandwidth if lags else 0.0, "rate_limit_deg_s": rate if limited else 0.0}


def unstructured(rng: Random, errors: str, detector: str) -> Keys:
    """What the published bounds admit, at least on some axes."""
    if errors == "perfect":
        return {}
    waves = {
        axis: {
            "amplitude_rad_s2": abs(within(rng, 0.02)),
            "frequency_rad_s": log_uniform(rng, 0.1, FASTEST_RAD_S[detector]),
        }
        for axis in AXES
        if rng.random() < 0.7
    }
    return {"inertia_coupling": {axis: within(rng, 0.25) for axis in AXES}, "sinusoid": waves}


def declared(rng: Random, errors: str, detector: str) -> tuple[Keys, Keys]:
    """What is wrong with the truth, as keys of the scenario, and the bounds that declare it."""
    truth, bounds = {"uncertainty": unstructured(rng, errors, detector)}, {}
    if errors == "perfect":
        bounds = {"inertia_coupling": ZERO, "constant_rad_s2": ZERO}
    if errors in ("sensors", "everything"):
        grade = str(rng.choice(["tactical-grade", "tactical-grade", "consumer-grade"]))
        truth["sensors"] = bounds["sensors"] = grade
    if errors in ("coefficients", "everything"):
        share = float(rng.choice([0.02, 0.05, 0.1]))
        names = [term.name for term in load("beaver").moments]
        truth["uncertainty"]["coefficients"] = {name: 1.0 + within(rng, share) for name in names}
        bounds["coefficients"] = share
    if errors in ("turbulence", "everything"):
        severity = str(rng.choice(["light", "moderate", "severe"]))
        truth["environment"] = {"turbulence": "dryden", "severity": severity}
        bounds["turbulence"] = severity
    if rng.random() < GUSTS:
        gust, steepest = drawn_gust(rng)
        truth["environment"] = truth.get("environment", {}) | {"gust": gust}
        if "turbulence" in bounds:
            bounds["constant_rad_s2"] = dict.fromkeys(
                AXES, 0.02 + FASTEST_DAMPING_PER_S * steepest / SLOWEST_MPS
            )
    return truth, bounds


def drawn_gust(rng: Random) -> tuple[Keys, float]:
    """A gust and its steepest slope, m/s2. JSBSim's does not turn the air: the vanes see it and nothing else.

    Who reckons with turbulence takes its slope for a rotation of the air, so that must be declared, too.
    """
    height, rise_s, fade_s = rng.uniform(0.5, 6.0), log_uniform(rng, 0.3, 3.0), log_uniform(rng, 0.3, 3.0)
    way = rng.normal(size=3)
    velocity = (height * way / np.linalg.norm(way)).tolist()
    gust = {"at_s": rng.uniform(0.2, 3.0), "velocity_mps": velocity, "rise_s": rise_s, "fade_s": fade_s}
    return gust, 0.5 * np.pi * height / min(rise_s, fade_s)


def kind_of_fault(rng: Random, fault_class: str) -> Keys:
    """A type with its size; the published class knows losses of three surfaces."""
    kinds: list[Keys] = [
        {"type": "loss_of_effectiveness", "magnitude": float(rng.choice([1.0, rng.uniform(0.1, 1)]))},
        {"type": "stuck", **({"position_deg": rng.uniform(-5, 15)} if rng.random() < 0.7 else {})},
        {"type": "hardover", "direction": int(rng.choice([-1, 1]))},
        {"type": "float"},
        {"type": "bias", "bias_deg": rng.uniform(-6, 6)},
        {"type": "rate_limit", "scale": log_uniform(rng, 0.001, 0.3)},
        {"type": "oscillatory", "amplitude_deg": log_uniform(rng, 0.2, 5),
         "frequency_rad_s": log_uniform(rng, 1.01, 20)},
    ]  # fmt: skip
    if fault_class == "published":
        return {"actuator": str(rng.choice(SURFACES[:3])), **kinds[0]}
    return {"actuator": str(rng.choice(SURFACES)), **kinds[rng.integers(len(kinds))]}


def fault(rng: Random, fault_class: str) -> Keys:
    """Constant, growing or intermittent."""
    drawn = {**kind_of_fault(rng, fault_class), "at_s": rng.uniform(0.5, 3.0)}
    gradual = drawn["type"] not in ("stuck", "hardover", "float")
    if gradual and rng.random() < 0.4:
        drawn |= {"profile": "incipient", "kappa_per_s": log_uniform(rng, 0.2, 20)}
    if rng.random() < 0.3:
        drawn["end_s"] = drawn["at_s"] + log_uniform(rng, 0.05, 3.0)
    return drawn


def drawn(seed: int, index: int, only: tuple[str, ...] = ERRORS) -> tuple[str, str, bf.Scenario]:
    """Class of declared errors, detector and scenario of a flight."""
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(index,)))
    errors, detector = only[index % len(only)], str(rng.choice(DETECTORS))
    fault_class = str(rng.choice(["published", "all"]))
    truth, bounds = declared(rng, errors, detector)
    faults = [] if rng.random() < HEALTHY_SHARE else [fault(rng, fault_class)]
    fdi: Keys = {"fault_class": fault_class, "bounds": bounds}
    if detector != "worst-case":
        fdi |= {"statistical": {}, "authority": detector}
    constant = faults and "profile" not in faults[0] and "end_s" not in faults[0]
    if constant and rng.random() < 0.3:
        fdi["fault_profile"] = "abrupt"
    words: Keys = {
        "name": f"random-{seed}-{index}", "seed": index, "duration_s": rng.uniform(4.0, 8.0),
        "rate_hz": round(log_uniform(rng, 20, 500)),
        "substeps": int(rng.integers(2, 11)) if rng.random() < COARSE else 1,
        "initial": {"airspeed_mps": rng.uniform(SLOWEST_MPS, 55), "altitude_m": rng.uniform(700, 3000)},
        "reference": reference(rng), "actuators": actuators(rng, errors),
        "control": {"law": str(rng.choice(["fault-tolerant", "adaptive", "nominal"]))},
        "faults": faults, "fdi": fdi, **truth,
    }  # fmt: skip
    declare_slowest(words)
    return errors, detector, bf.Scenario.model_validate(words)


def declare_slowest(words: Keys) -> None:
    """A servo slower than what is declared counts as a jam: declare one that is slower still."""
    for struck in words["faults"]:
        if struck["type"] == "rate_limit":
            limit = (
                words["actuators"].get("rate_limit_deg_s") if isinstance(words["actuators"], dict) else None
            )
            rate = struck["scale"] * (limit or UNLIMITED_DEG_S)
            words["fdi"]["slowest_rate_deg_s"] = min(SLOWEST_DEG_S, 0.9 * rate)


def what_is_wrong(flight: bf.Flight) -> str | None:
    """What of WRONG a flight is a case of, if any."""
    if flight.false_alarm:
        return "false alarm"
    said = flight.isolation
    if not flight.detection.detected:
        return None
    surface, kind = flight.scenario.faults[0].actuator, flight.scenario.faults[0].type
    if said.fault not in (None, surface):
        return "surface excluded" if said.fault == "unanticipated" else "wrong surface"
    if said.fault is None:
        return left_out(flight, surface, kind)
    if said.type is not None:
        return None if said.type == kind else "wrong type"
    return None if kind in said.candidates else "type excluded"


def left_out(flight: bf.Flight, surface: str, kind: str) -> str | None:
    """Whether the candidates of a flight in which nothing is named lack the true one."""
    left = flight.isolation.candidates
    if surface not in {candidate.split(":")[0] for candidate in left}:
        return "surface excluded"
    possible = surface in left or f"{surface}:{kind}" in left
    return None if possible or flight.scenario.fdi.fault_class == "published" else "type excluded"


def watched_s(flight: bf.Flight) -> float:
    """Time without a fault in which an alarm would have been a false one."""
    end_s = flight.metrics["frames"] / flight.scenario.rate_hz
    faults = flight.scenario.faults
    return min(end_s, *(fault.at_s for fault in faults)) if faults else end_s


def flown(args: argparse.Namespace) -> Iterator[tuple[str, str, bf.Flight]]:
    """The flights, one after the other; a draw that has no trim or is refused is said."""
    for index in range(args.first, args.first + args.flights):
        try:
            errors, detector, scenario = drawn(args.seed, index, tuple(args.only))
            if detector != "worst-case":
                scenario = scenario.with_({"fdi.statistical.false_alarms_per_h": args.false_alarms_per_h})
            yield errors, detector, bf.fly(scenario, log=False)
        except (bf.BadInput, bf.SimulationFailed) as refused:
            print(f"flight {index} not flown: {refused}")


def summary(counts: dict[tuple[str, str], Counter]) -> Table:
    """A row for each class of declared errors and detector."""
    table = Table("declared", "detector", "flights", "healthy h", "seen", "surface", "type", *WRONG)
    for (errors, detector), count in sorted(counts.items(), key=lambda item: ERRORS.index(item[0][0])):
        numbers = [str(count[key]) for key in ("seen", "surface named", "type named", *WRONG)]
        table.add_row(errors, detector, str(count["flights"]), f"{count['ms'] / 3.6e6:.3f}", *numbers)
    return table


def tally(count: Counter, flight: bf.Flight, wrong: str | None) -> None:
    """Count one flight."""
    count["flights"] += 1
    count["ms"] += round(1000 * watched_s(flight))
    named = wrong is None and flight.isolation.isolated
    count["seen"] += flight.detection.detected and wrong != "false alarm"
    count["surface named"] += named
    count["type named"] += named and flight.isolation.type is not None
    if wrong:
        count[wrong] += 1


def keep(folder: Path, flight: bf.Flight, wrong: str) -> str:
    """Write a counterexample where it can be flown again; returns a line about it."""
    folder.mkdir(parents=True, exist_ok=True)
    scenario = flight.scenario
    path = folder / f"{scenario.name}.yaml"
    path.write_text(to_yaml(scenario), encoding="utf-8")
    at_s = flight.detection.time_s or 0.0
    struck = scenario.faults[0].model_dump(exclude_none=True) if scenario.faults else "no fault"
    said = flight.isolation
    named = f"{said.fault} {said.type or said.candidates}" if said.fault else said.candidates
    frames = f"{scenario.rate_hz:g} Hz x {scenario.substeps}, class {scenario.fdi.fault_class}"
    return f"{path}: {wrong}; alarm {at_s:.3f} s, {frames}; {struck}; {str(named)[:90]}"


def said_of_rates(counts: dict[tuple[str, str], Counter], declared_per_h: float) -> Iterator[str]:
    """A line a kind of detector: false alarms, hours, the 95 % bound on their rate, and what is declared."""
    for name, detectors, declared in (
        ("statistics at work", DETECTORS[1:], declared_per_h),
        ("worst case alone", DETECTORS[:1], 0.0),
    ):
        of_it = [count for (_, detector), count in counts.items() if detector in detectors]
        hours = sum(count["ms"] for count in of_it) / 3.6e6
        if hours:
            alarms = sum(count["false alarm"] for count in of_it)
            rate = poisson(alarms, hours)
            shown = "shown" if rate.high <= declared else "refuted" if rate.low > declared else "not refuted"
            yield (
                f"{name}: {alarms} false alarms in {hours:.2f} h, {rate.low:.3g} to {rate.high:.3g} an hour "
                f"(95 %); declared {declared:g}: {shown}"
            )


def main() -> None:
    """Fly, count, keep what is wrong."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--flights", type=int, default=600)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--only", nargs="+", choices=ERRORS, default=list(ERRORS))
    parser.add_argument("--keep", type=Path, default=Path("runs/random-flights"))
    parser.add_argument(
        "--false-alarms-per-h", type=float, default=Statistical().false_alarms_per_h, metavar="RATE"
    )
    args = parser.parse_args()
    counts: dict[tuple[str, str], Counter] = {}
    began = time.monotonic()
    for errors, detector, flight in flown(args):
        wrong = what_is_wrong(flight)
        tally(counts.setdefault((errors, detector), Counter()), flight, wrong)
        if wrong:
            print(f"{errors}, {detector}: {keep(args.keep, flight, wrong)}", flush=True)
    Console(width=200).print(summary(counts))
    print(*said_of_rates(counts, args.false_alarms_per_h), sep="\n")
    print(f"{time.monotonic() - began:.0f} s")


if __name__ == "__main__":
    main()
