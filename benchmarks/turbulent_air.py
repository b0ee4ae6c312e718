"""False alarms of healthy flights in declared turbulence, also near the ground, test by test.

    python benchmarks/turbulent_air.py --hours 50 --seed 1 [--aircraft beaver T38 ...] [--severity severe ...]
        [--fault-class all] [--declared 0.001] [--jobs 1]

Each flight draws aircraft, severity, airspeed, frame rate, sensors (exact or tactical-grade), and a course:
at height, from height down to the ground, or from the ground up. The autopilot flies it where the aircraft
can hold an altitude; other aircraft follow references at height. Turbulence and sensors are declared as they
are, and nothing else is wrong. `--declared` sets `fdi.statistical.false_alarms_per_h`: a high rate, 100 say,
lets each test show a rate of its own in little time.

The first table has a row for each severity and course: hours, flights, flights with an alarm of any kind,
and these per hour with their exact 95 % interval. Flights with an alarm are printed with the number that
flies them again (`--first N --flights 1`). `--tests` follows the tests frame by frame, which takes ten times
as long, and prints a second table: for each kind of test the flights in which it passed the alarm level, per
hour, and the largest share of the level that it reached. Ctrl-C prints the tables of what has been flown.
"""

import argparse
from multiprocessing import Pool
from typing import Any, NamedTuple

import numpy as np

from beaver_ftc.diagnosis.detection.parity import AXIS_VIEW, uses_force
from beaver_ftc.diagnosis.state import LOSS
from beaver_ftc.documents.errors import BadInput, SimulationFailed
from beaver_ftc.loop.loop import Loop
from beaver_ftc.scenario.schema import Scenario, load
from beaver_ftc.scenario.signals import channels_of
from beaver_ftc.studies.engine.statistics import poisson
from beaver_ftc.studies.present.tables import markdown_table

SEVERITIES, COURSES = ("light", "moderate", "severe"), ("level", "descent", "climb")
LEVEL_S, DOWN_S, UP_S = 180.0, 150.0, 120.0
TESTS = ("loss", "step", "tone of an axis", "force")


class Flown(NamedTuple):
    """A flight: what was drawn, hours, kinds of alarm, and the largest share of the level by test."""

    index: int
    severity: str
    course: str
    aircraft: str
    hours: float
    alarms: tuple[str, ...]
    largest: dict[str, float]


def drawn(index: int, asked: argparse.Namespace) -> tuple[Scenario, str]:
    """Flight number `index`, and its course."""
    rng = np.random.default_rng(np.random.SeedSequence(asked.seed, spawn_key=(index,)))
    name, severity = str(rng.choice(asked.aircraft)), str(rng.choice(asked.severity))
    reference = name if name == "beaver" or name.startswith("./") else f"jsbsim:{name}"
    plain = load({"name": f"turbulent-{index}", "aircraft": reference})
    low, high = plain.airframe.envelope.airspeed_mps
    V = plain.initial.airspeed_mps + 0.5 * (rng.uniform(low, high) - plain.initial.airspeed_mps)
    holds = "altitude_m" in channels_of(plain.airframe)
    course = str(rng.choice(COURSES)) if holds else "level"
    sensors = str(rng.choice(("ideal", "tactical-grade")))
    changes: dict[str, Any] = {
        "aircraft": reference, "name": plain.name, "seed": index, "rate_hz": float(rng.choice((50, 100))),
        "environment": {"turbulence": "dryden", "severity": severity}, "sensors": sensors,
        "fdi": {
            "fault_class": asked.fault_class, "bounds": {"turbulence": severity, "sensors": sensors},
            "statistical": {"false_alarms_per_h": asked.declared},
        },
        **flown_by(rng, course, float(V), plain, holds),
    }  # fmt: skip
    return load(changes), course


def flown_by(rng: np.random.Generator, course: str, V: float, plain: Scenario, holds: bool) -> dict[str, Any]:
    """Start, duration, and autopilot or references of a course."""
    altitude_m = plain.initial.altitude_m + float(rng.uniform(-600.0, 600.0))
    legs: list[dict[str, Any]] = [{"hold": True}]
    duration_s, slope = LEVEL_S, 0.05 * V  # of the path, as of an approach
    if course == "descent":
        altitude_m, duration_s = float(rng.uniform(200.0, 400.0)), DOWN_S
        legs = [
            {"value": altitude_m},
            {"at_s": 1.0, "value": float(rng.uniform(8.0, 40.0)), "climb_mps": slope},
        ]
    elif course == "climb":
        altitude_m, duration_s = float(rng.uniform(15.0, 50.0)), UP_S
        legs = [
            {"value": altitude_m},
            {"at_s": 5.0, "value": float(rng.uniform(150.0, 400.0)), "climb_mps": slope},
        ]
    flown: dict[str, Any] = {
        "initial": {"airspeed_mps": V, "altitude_m": altitude_m},
        "duration_s": duration_s,
    }
    if holds:
        known = channels_of(plain.airframe)
        every = {"altitude_m": legs, "airspeed_mps": [{"value": V}], "heading_deg": [{"hold": True}]}
        return flown | {"autopilot": {name: of_it for name, of_it in every.items() if name in known}}
    sine = [{"sine": {"amplitude_deg_s": float(rng.uniform(0.5, 2.0)), "frequency_hz": 0.3}}]
    return flown | {"reference": dict.fromkeys("pqr", sine)}


class Watched:
    """The largest share of the alarm level that each kind of test reaches before any alarm is over."""

    def __init__(self, loop: Loop) -> None:
        self._statistical = loop.frames["fdi"]["statistical"][0]
        self._level = float(self._statistical["test"]["alarm_level"])
        self._views = self._statistical["views"][: int(self._statistical["n_views"])]
        self.largest = dict.fromkeys(TESTS, 0.0)

    def look(self) -> None:
        """Take in the frame just flown."""
        if self._statistical["alarm"]["detected_at_s"] >= 0.0 and max(self.largest.values()) > 1.0:
            return
        for block in self._statistical["block"]:
            tried = block["hypothesis"][: int(block["n_h"])]
            tried = tried[tried["alarms"] == 1]
            losses = tried["kind"] == LOSS
            for test, of_it in (("loss", tried["score"][losses]), ("step", tried["score"][~losses])):
                self._note(test, of_it.max(initial=0.0))
        own = (self._views["nulled"] == AXIS_VIEW) & (self._views["by_inertia"] == 0)
        self._note("tone of an axis", self._views["tones"]["score"][own].max(initial=0.0))
        self._note("force", self._forces())

    def _forces(self) -> float:
        """What the views that may raise an alarm by a force show, whatever clears them of a vane's error."""
        held = [view["peak"] for view in self._views if view["nulled"] >= 0 and uses_force(view)]
        return float(max(held, default=0.0))

    def _note(self, test: str, score: float) -> None:
        self.largest[test] = max(self.largest[test], float(score) / self._level)


def fly_one(given: tuple[int, argparse.Namespace]) -> Flown | None:
    """One flight; None where it has no trim or cannot go on."""
    index, asked = given
    try:
        scenario, course = drawn(index, asked)
        loop = Loop(scenario)
    except BadInput:
        return None
    try:
        watched = Watched(loop)
        loop.after_frame = watched.look if asked.tests else None
        for _ in loop.chunks():
            pass
    except SimulationFailed:
        return None
    finally:
        frame = loop.frames[0]
        flown_s, fdi = float(frame["t"]), frame["fdi"]
        alarms = tuple(
            kind for kind, raised in (
                ("statistical", fdi["statistical"]["alarm"]["detected_at_s"] >= 0.0),
                ("verdict", bool(fdi["verdict"]["detected"])),
                ("instrument", bool(fdi["sensor_monitor"]["output"]["alarmed"])),
            ) if raised
        )  # fmt: skip
        largest = watched.largest
        loop.release()
    name = scenario.airframe.name
    return Flown(index, str(scenario.environment.severity), course, name, flown_s / 3600.0, alarms, largest)


def rate(count: int, hours: float) -> str:
    """Events per hour with their interval."""
    found = poisson(count, hours)
    return f"{found.value:.3g} ({found.low:.3g} to {found.high:.3g})"


def by_course(flights: list[Flown]) -> str:
    """The first table."""
    rows = []
    for severity in SEVERITIES:
        for course in (*COURSES, None):
            some = [one for one in flights if one.severity == severity and course in (None, one.course)]
            hours, alarms = sum(one.hours for one in some), sum(bool(one.alarms) for one in some)
            if some:
                words = [severity, course or "all", f"{hours:.2f}", str(len(some)), str(alarms)]
                rows.append([*words, rate(alarms, hours)])
    head = ["turbulence", "course", "hours", "flights", "with an alarm", "per hour (95 %)"]
    return markdown_table(head, rows)


def by_test(flights: list[Flown]) -> str:
    """The second table."""
    rows = []
    for severity in SEVERITIES:
        some = [one for one in flights if one.severity == severity]
        hours = sum(one.hours for one in some)
        for test in TESTS if some else ():
            shares = [one.largest[test] for one in some]
            beyond = sum(share > 1.0 for share in shares)
            rows.append([severity, test, str(beyond), rate(beyond, hours), f"{max(shares):.2f}"])
    head = ["turbulence", "test", "flights beyond the level", "per hour (95 %)", "largest share"]
    return markdown_table(head, rows)


def main() -> None:
    """Fly until the hours are full, and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--hours", type=float, default=1.0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--first", type=int, default=0, help="number of the first flight")
    parser.add_argument("--flights", type=int, default=10**9, help="at most so many")
    parser.add_argument("--aircraft", nargs="+", default=["beaver"])
    parser.add_argument("--severity", nargs="+", default=list(SEVERITIES), choices=SEVERITIES)
    parser.add_argument("--fault-class", default="all", choices=("all", "published"))
    parser.add_argument("--declared", type=float, default=1e-3, help="false alarms per hour")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--tests", action="store_true", help="follow each test: slower")
    asked = parser.parse_args()
    flights: list[Flown] = []
    refused = 0
    with Pool(asked.jobs) as pool:
        numbers = range(asked.first, asked.first + asked.flights)
        try:
            for one in pool.imap_unordered(fly_one, ((i, asked) for i in numbers)):
                if one is None:
                    refused += 1
                    continue
                flights.append(one)
                if one.alarms:
                    alarms = ", ".join(one.alarms)
                    print(f"{one.index}: {one.aircraft}, {one.severity}, {one.course}: {alarms}", flush=True)
                if sum(each.hours for each in flights) >= asked.hours:
                    break
        except KeyboardInterrupt:
            print("interrupted: the tables are of what has been flown")
        pool.terminate()
    print(
        f"\ndeclared: {asked.declared:g} per hour; class {asked.fault_class}; seed {asked.seed}; "
        f"{refused} flights could not be flown\n"
    )
    print(by_course(flights))
    if asked.tests:
        print(f"\n{by_test(flights)}")
    names = sorted({one.aircraft for one in flights})
    alone = {name: sum(one.hours for one in flights if one.aircraft == name) for name in names}
    print("\nhours: " + ", ".join(f"{name} {hours:.2f}" for name, hours in alone.items()))


if __name__ == "__main__":
    main()
