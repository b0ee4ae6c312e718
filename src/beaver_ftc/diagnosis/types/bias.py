"""A constant offset: p = u + b, cut off by the stops."""

import numpy as np

from beaver_ftc.compiled import kernel
from beaver_ftc.diagnosis.types import sets

NAME = "bias"
CONSTANT = True


@kernel
def judge(fdi, surface, kind, frame):
    """Keep the offsets that also explain this frame."""
    least, greatest = sets.offset(fdi, surface)
    sets.intersect(surface, kind, least, greatest)


@kernel
def deflection(fdi, surface, kind):
    """The command and the offset."""
    return surface.command + surface.set_low[kind], surface.command + surface.set_high[kind]


def estimate(fdi: np.void, s: int, kind: int) -> float | None:
    """Offset, rad."""
    return sets.middle_of(fdi, s, kind)


def interval(fdi: np.void, s: int, kind: int) -> tuple[float, float] | None:
    """Of the offset, rad; None while one end is open."""
    low, high = sets.set_of(fdi, s, kind)
    return (low, high) if np.isfinite(low) and np.isfinite(high) else None
