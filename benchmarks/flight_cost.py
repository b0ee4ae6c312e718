"""What a flight costs beside flying: taken apart, in four kinds of flight, in units of JSBSim's plain frame.

    python benchmarks/flight_cost.py [--rounds N] [--check FILE | --record FILE]

Each round flies every kind once and then lets JSBSim alone fly as many frames of the same aircraft, in the
same air, surfaces held; ratios are formed within a round, medians over the rounds. A flight in a sweep is all
that `sweep` does for one: scenario, aircraft, trim, record, frames, metrics, row. The trim is a new one each
time. `--check benchmarks/ratios.json` ends with status 1 if a ratio is over a tenth above the recorded one,
and still is when all is measured again.
"""

import argparse
import json
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

from aircraft_cost import Variant, jsbsim_alone, write_variant
from beaver_ftc.plant.conditions import trim
from beaver_ftc.studies.bench.flights import by_kind

ALLOWED_RISE = 0.10
PLAIN_FRAMES = 1000


def measure(rounds: int) -> dict[str, Any]:
    """The unit, us, and what `by_kind` gives, the loop's own part in units."""
    plain: list[float] = []
    with tempfile.TemporaryDirectory() as folder:
        unit = Variant(write_variant(Path(folder) / "plain", jsbsim_alone), trim())

        def fly_plain() -> None:
            unit.prepare()
            began = time.process_time()
            unit.fly(PLAIN_FRAMES)
            plain.append((time.process_time() - began) / PLAIN_FRAMES)

        kinds = by_kind(rounds, fly_plain)
    unit_us = 1e6 * float(np.median(plain[1:]))
    for of in kinds.values():
        of["own_part_units"] = round(of.pop("own_part_us") / unit_us, 3)
    return {"unit_us": unit_us, "kinds": kinds}


def risen(now: dict[str, Any], recorded: dict[str, Any]) -> list[str]:
    """Which ratios are more than a tenth above the recorded ones."""
    return [
        f"{kind}: {name} is {now['kinds'][kind][name]:.3f}, recorded {was[name]:.3f}"
        for kind, was in recorded["kinds"].items()
        for name in ("frames_ratio", "flight_ratio")
        if now["kinds"][kind][name] > (1.0 + ALLOWED_RISE) * was[name]
    ]


def main() -> int:
    """Print the table; record or check."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--rounds", type=int, default=40)
    parser.add_argument("--check", type=Path)
    parser.add_argument("--record", type=Path)
    given = parser.parse_args()
    now = measure(given.rounds)
    print(f"unit, JSBSim's plain frame: {now['unit_us']:.2f} us; medians of {given.rounds} rounds, ms")
    for kind, of in now["kinds"].items():
        parts = ", ".join(f"{name} {ms:.2f}" for name, ms in of["parts_ms"].items())
        print(f"{kind}: {parts}; bare frames {of['bare_ms']:.2f}")
        print(
            f"    frames / bare {of['frames_ratio']:.3f}, flight / bare {of['flight_ratio']:.3f}, "
            f"the loop's own part {of['own_part_units']:.2f} units a JSBSim frame"
        )
    if given.record:
        given.record.write_text(json.dumps(now, indent=1) + "\n", encoding="utf-8")
    if given.check is None:
        return 0
    recorded = json.loads(given.check.read_text(encoding="utf-8"))
    found = risen(now, recorded) and risen(measure(given.rounds), recorded)
    print(*found, sep="\n", end="\n" if found else "")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
