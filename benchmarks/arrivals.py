"""Does the autopilot hold its profile after a fault, in the air it is flown in? And without the fault?

    python benchmarks/arrivals.py losses|jams|missions [--seeds N] [--first I]

losses    the elevator loses 40 to 100 %, level at 45 m/s in light turbulence: 15 m, 3 m/s, 5 deg
jams      it jams within 5 deg of its trim: the same
missions  one of the built-in missions, in place of its faults a loss of 10 to 100 % of any one surface at any
          time of it: 40 m, 4 m/s, 15 deg

A seed draws the fault and the air. Counted are flights that arrive: on course, at their airspeed and in the
envelope, by these limits, in the mean over their last 10 s; and at their altitude too. Then those that held
what was commanded all the way; that held it with the airspeed as protection has limited it to what can
still be held; and that hold it in the same air without the fault: what is missed there as well, the fault
has not caused. Those that miss something are listed.
"""

import argparse

import numpy as np
from rich.console import Console
from rich.table import Table

import beaver_ftc as bf

CLOSE = {"altitude_m": 15.0, "airspeed_mps": 3.0, "heading_deg": 5.0}
ARRIVED = {"altitude_m": 40.0, "airspeed_mps": 4.0, "heading_deg": 15.0}
SURFACES = ("aileron", "elevator", "rudder", "flap")
JAM_DEG = (-7.4, 2.6)  # within 5 deg of the trim at 45 m/s
HELD = [{"hold": True}]
LEVEL = {
    "name": "level", "duration_s": 120, "sensors": "tactical-grade", "actuators": "servo",
    "autopilot": {"altitude_m": HELD, "airspeed_mps": HELD, "heading_deg": HELD},
    "environment": {"turbulence": "dryden", "severity": "light"},
    "fdi": {"bounds": {"sensors": "tactical-grade", "turbulence": "light"}},
}  # fmt: skip

COLUMNS = ("at the end", "its altitude too", "all the way", "airspeed as limited", "without the fault")
COUNTED = (
    "arrived on course, at the airspeed and in the envelope", "at the altitude too", "held it all the way",
    "held it with the airspeed as limited", "held it without the fault",
)  # fmt: skip

Keys = dict[str, object]


def losses(rng: np.random.Generator) -> tuple[bf.Scenario, Keys]:
    """Level flight, and a loss of the elevator."""
    kind = {"type": "loss_of_effectiveness", "magnitude": float(rng.uniform(0.4, 1.0))}
    return bf.load(LEVEL), {"actuator": "elevator", "at_s": 40.0, **kind}


def jams(rng: np.random.Generator) -> tuple[bf.Scenario, Keys]:
    """Level flight, and a jam of the elevator."""
    kind = {"type": "stuck", "position_deg": float(rng.uniform(*JAM_DEG))}
    level = bf.load(LEVEL).with_({"fdi.fault_class": "all"})
    return level, {"actuator": "elevator", "at_s": 40.0, **kind}


def missions(rng: np.random.Generator) -> tuple[bf.Scenario, Keys]:
    """A built-in mission, its expectations dropped, and a loss of any surface."""
    names = sorted(name for name in bf.scenarios() if name.startswith("mission-"))
    mission = bf.load(names[rng.integers(len(names))])
    fault = {
        "actuator": SURFACES[rng.integers(len(SURFACES))],
        "type": "loss_of_effectiveness",
        "magnitude": float(rng.uniform(0.1, 1.0)),
        "at_s": float(rng.uniform(0.05, 0.95) * mission.duration_s),
    }
    return mission.with_({"expect": {}}), fault


CAMPAIGNS = {"losses": (losses, CLOSE), "jams": (jams, CLOSE), "missions": (missions, ARRIVED)}


def missed(flight: bf.Flight, limits: dict[str, float], limited: bool = False) -> str:
    """What it missed, in words; nothing if it held the profile. limited: the airspeed as limited."""
    if flight.metrics["departure"]:
        return f"lost: {flight.metrics['departure']['signal']}"
    off = dict(flight.metrics["profile"])
    if limited:
        off["airspeed_mps"] = off["airspeed_limited_mps"]
    return ", ".join(f"{key} {off[key]:.1f}" for key, most in limits.items() if off[key] > most)


def missed_at_the_end(flight: bf.Flight, limits: dict[str, float]) -> str:
    """Where it has not arrived, in words; nothing if it has."""
    arrival = flight.metrics["arrival"]
    if arrival is None:
        return "lost"
    words = [f"{key} {arrival[key]:.1f}" for key, most in limits.items() if abs(arrival[key]) > most]
    return ", ".join([*words, *([] if arrival["in_envelope"] else ["outside the envelope"])])


def said(fault: Keys) -> str:
    """A fault in words."""
    if fault["type"] == "stuck":
        return f"at {fault['position_deg']:.1f} deg"
    return f"{100 * fault['magnitude']:.0f} % {fault['actuator']} at {fault['at_s']:.0f} s"


def fly_seed(campaign: str, seed: int) -> tuple[str, str, tuple[str, ...]]:
    """A flight of a campaign and its twin without the fault: scenario, fault, and what is missed of each of
    COUNTED."""
    draw, limits = CAMPAIGNS[campaign]
    scenario, fault = draw(np.random.default_rng(seed))
    scenario = scenario.with_({"seed": seed})
    flight = bf.fly(scenario.with_({"faults": [fault]}), log=False)
    healthy = bf.fly(scenario.with_({"faults": []}), log=False)
    return scenario.name, said(fault), (
        missed_at_the_end(flight, {key: most for key, most in limits.items() if key != "altitude_m"}),
        missed_at_the_end(flight, limits),
        missed(flight, limits),
        missed(flight, limits, limited=True),
        missed(healthy, limits),
    )  # fmt: skip


def main() -> None:
    """Fly and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("campaign", choices=CAMPAIGNS)
    parser.add_argument("--seeds", type=int, default=100)
    parser.add_argument("--first", type=int, default=1)
    args = parser.parse_args()
    table = Table("seed", "flight", "fault", *COLUMNS)
    held = np.zeros(len(COUNTED), int)
    for seed in range(args.first, args.first + args.seeds):
        flight, fault, words = fly_seed(args.campaign, seed)
        held += [not each for each in words]
        if any(words):
            table.add_row(str(seed), flight, fault, *(each or "held" for each in words))
    Console(width=180).print(table)
    counts = ", ".join(f"{count} {how}" for count, how in zip(held, COUNTED, strict=True))
    print(f"{args.campaign}, of {args.seeds}: {counts}")


if __name__ == "__main__":
    main()
