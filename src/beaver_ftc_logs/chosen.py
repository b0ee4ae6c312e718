"""The constants that flights chose, and which flights: no claim may be measured on these.

The others are derived where they stand, or are physical. `benchmarks/own_logs.py --seed SEED` flies a seed.
"""

from typing import NamedTuple


class Chosen(NamedTuple):
    """A constant of a module, and the seeds of simulated flights or the recorded ones it was chosen on."""

    module: str
    constant: str
    seeds: tuple[int, ...] = ()
    flights: str = ""


CHOSEN = (
    Chosen("fitting", "_OTHER_DAYS", flights="days drawn from flight-21 (`--other-days`)"),
    Chosen("fitting", "_OTHER_LAWS", seeds=(1, 2, 3, 4, 5, 6)),
    Chosen("fitting", "_MOVING_AIR", seeds=(11, 12, 5002, 5004)),
    Chosen("fitting", "_WINDOW_S", seeds=(11, 12)),
    Chosen("fitting", "_POWER_OTHER_LAWS", seeds=(1,)),
    Chosen("fitting", "_THEORIES", seeds=(1,)),
    Chosen("fitting", "_AFTER_GYROS", seeds=(71, 73, *range(101, 107))),
    Chosen("fitting", "_AFTER_GUSTS", seeds=(71, 73, *range(101, 107))),
    Chosen("fitting", "_MOST_WIDER", seeds=(205,)),
    Chosen("fitting", "_POWER", flights="halves of flight-21"),
    Chosen("fitting", "_WANTED", flights="halves of flight-21"),
    Chosen("fitting", "_POWER_ALONE", flights="the flights of alfa given"),
    Chosen("filtering", "_SPANS_S", seeds=(5002, 5004)),
    Chosen("filtering", "_LATELY_S", seeds=(5002, 5004)),
    Chosen("trust", "REVERSED", seeds=(*range(31, 43), *range(71, 202))),
    Chosen("trust", "_LITTLE", seeds=(*range(31, 43), *range(71, 202))),
    Chosen("trust", "_FAINT", seeds=(*range(31, 43), *range(71, 202))),
)
