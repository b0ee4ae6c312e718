"""A runaway to the lower stop: by each frame it has come at least as far as its least rate takes it."""

import numpy as np

from beaver_ftc.compiled import kernel
from beaver_ftc.diagnosis.types import release, runaway

NAME = "hardover"
CONSTANT = True


@kernel
def begin(surface, kind):
    """Nothing is known yet."""
    release.start(surface, kind)


@kernel
def judge(fdi, surface, kind, frame):
    """It is beyond where its least rate takes it, or at the stop."""
    greatest = runaway.downwards(fdi, surface, frame)
    release.holds(fdi, surface, kind, surface.travel_low, greatest)


@kernel
def let_go(fdi, surface, kind):
    """It may be let go on its way; within a frame of several instants, further on."""
    low, high, frame = release.beginning(fdi, surface)
    high = min(high, runaway.downwards(fdi, surface, frame))
    if not fdi.types.config.whole and low <= high:
        low = surface.travel_low
    release.let_go(surface, kind, low, high)


@kernel
def bring_back(fdi, surface, kind):
    """From where it was let go."""
    release.bring_back(fdi, surface, kind)


@kernel
def deflection(fdi, surface, kind):
    """Between its least way and the stop."""
    return surface.travel_low, runaway.downwards(fdi, surface, fdi.types.frame)


def estimate(fdi: np.void, s: int, kind: int) -> float | None:
    """Deflection, rad: the stop."""
    return float(fdi["types"]["surface"][s]["travel_low"])
