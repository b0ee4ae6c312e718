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
    """The command and the offset, cut off by the stops."""
    low = cut_off(surface, surface.set_low[kind], surface.orders.least[0])
    return low, cut_off(surface, surface.set_high[kind], surface.orders.greatest[0])


@kernel
def cut_off(surface, offset, extreme):
    """Where an offset (rad) takes a surface in the mean; if a stop is met at an instant, at the `extreme`."""
    orders, mean = surface.orders, surface.command + offset
    met = orders.least[0] + offset < surface.travel_low or orders.greatest[0] + offset > surface.travel_high
    return sets.within_travel(surface, extreme + offset) if met else mean


def estimate(fdi: np.void, s: int, kind: int) -> float | None:
    """Offset, rad."""
    return sets.middle_of(fdi, s, kind)


def interval(fdi: np.void, s: int, kind: int) -> tuple[float, float] | None:
    """Of the offset, rad; None while one end is open."""
    low, high = sets.set_of(fdi, s, kind)
    return (low, high) if np.isfinite(low) and np.isfinite(high) else None
