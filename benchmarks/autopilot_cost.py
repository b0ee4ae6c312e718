"""What the autopilot adds to a frame: the same flight with and without it, in turns.

    python benchmarks/autopilot_cost.py [rounds]

Two aircraft of the same scenario fly a block of frames each, one after the other, again and again; the
difference of a pair is free of what else the machine does for longer than a block. Prints the median of the
differences in us a frame of processor time, and the middle half of them.
"""

import sys
from time import process_time

import numpy as np

from beaver_ftc.loop.loop import Loop
from beaver_ftc.scenario.schema import load

FRAMES = 1000
PROFILE = {
    "altitude_m": [{"hold": True}], "airspeed_mps": [{"hold": True}], "heading_deg": [{"hold": True}],
}  # fmt: skip


class Flight:
    """A flight that goes on for as long as it is asked to."""

    def __init__(self, rounds: int, **given: object) -> None:
        duration_s = (rounds + 2) * FRAMES / 100.0
        self.loop = Loop(load({"name": "cost", "duration_s": duration_s, "reference": {}, **given}))
        self.flown = 0

    def block(self) -> float:
        """Fly the next frames; processor time of one, us."""
        self.loop.sample_references(self.flown, FRAMES)
        began = process_time()
        self.loop.fly_segment(self.flown, self.flown + FRAMES)
        self.flown += FRAMES
        return 1e6 * (process_time() - began) / FRAMES


def main(rounds: int) -> None:
    """Measure and print."""
    without, with_it = Flight(rounds), Flight(rounds, autopilot=PROFILE)
    added = []
    for k in range(rounds + 2):
        pair = (without, with_it) if k % 2 else (with_it, without)
        spent = {id(flight): flight.block() for flight in pair}
        if k >= 2:
            added.append(spent[id(with_it)] - spent[id(without)])
    low, middle, high = np.quantile(added, [0.25, 0.5, 0.75])
    print(
        f"autopilot: {middle:.2f} us a frame (middle half {low:.2f} to {high:.2f}), {rounds} pairs of blocks"
    )


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 200)
