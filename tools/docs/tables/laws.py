"""Tables of docs/laws.md."""

from benchmarks.arrivals import COLUMNS, fly_seed

from beaver_ftc.scenario.loader import load
from beaver_ftc.studies.margins import study
from tools.docs.compact import compact_table

SEEDS = {"losses": 40, "jams": 40, "missions": 30}
DECLARED = {
    "nothing": {"name": "level"},
    "servos, tactical-grade sensors": {"name": "level", "actuators": "servo", "sensors": "tactical-grade"},
}


def least_margins() -> str:
    """The least margins that `beaver-ftc linearise` finds, over airspeeds, faults and surfaces."""
    rows = []
    for declared, keys in DECLARED.items():
        found = study(load(keys))
        gain = min(min(one.up_db, one.down_db) for one in found)
        phase = min(one.phase_deg for one in found)
        rows.append((declared, str(len(found)), f"{gain:.1f}", f"{phase:.0f}"))
    return compact_table(("declared", "loops", "least gain margin, dB", "phase margin, deg"), rows)


def arrivals() -> str:
    """Of each campaign of benchmarks/arrivals.py, how many flights held what."""
    rows = []
    for campaign, seeds in SEEDS.items():
        words = [fly_seed(campaign, seed)[2] for seed in range(1, seeds + 1)]
        counts = [sum(not flight[i] for flight in words) for i in range(len(COLUMNS))]
        rows.append((campaign, str(seeds), *map(str, counts)))
    return compact_table(("campaign", "flights", "arrived", *COLUMNS[1:]), rows)
