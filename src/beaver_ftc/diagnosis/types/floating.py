"""A surface that trails freely: p = 0, or the stop that is nearest to it."""

import numpy as np

from beaver_ftc.compiled import kernel
from beaver_ftc.diagnosis.types import release, sets

NAME = "float"
CONSTANT = True


@kernel
def begin(surface, kind):
    """Nothing is known yet."""
    release.start(surface, kind)


@kernel
def judge(fdi, surface, kind, frame):
    """It is at neutral."""
    neutral = sets.within_travel(surface, 0.0)
    release.holds(fdi, surface, kind, neutral, neutral)


@kernel
def let_go(fdi, surface, kind):
    """It may be let go at neutral."""
    low, high, _ = release.beginning(fdi, surface)
    neutral = sets.within_travel(surface, 0.0)
    release.let_go(surface, kind, max(low, neutral), min(high, neutral))


@kernel
def bring_back(fdi, surface, kind):
    """From neutral."""
    release.bring_back(fdi, surface, kind)


@kernel
def deflection(fdi, surface, kind):
    """At neutral."""
    neutral = sets.within_travel(surface, 0.0)
    return neutral, neutral


def estimate(fdi: np.void, s: int, kind: int) -> float | None:
    """Deflection, rad."""
    surface = fdi["types"]["surface"][s]
    return float(min(max(0.0, surface["travel_low"]), surface["travel_high"]))
