"""Operations on the sets that the fault types keep."""

import numpy as np

from beaver_ftc.compiled import kernel
from beaver_ftc.diagnosis import membership


@kernel
def intersect(surface, kind, low, high):
    """Keep of a type's set what is also in [low, high]; exclude the type when nothing is left."""
    surface.set_low[kind] = max(surface.set_low[kind], low)
    surface.set_high[kind] = min(surface.set_high[kind], high)
    if surface.set_low[kind] > surface.set_high[kind]:
        surface.type_excluded[kind] = 1


@kernel
def within_travel(surface, deflection):
    """A deflection (rad), cut off by the stops."""
    return min(max(deflection, surface.travel_low), surface.travel_high)


@kernel
def middle(surface, kind):
    """The middle of a type's set."""
    return 0.5 * (surface.set_low[kind] + surface.set_high[kind])


@kernel
def effectiveness(surface):
    """The interval of 1 + theta in [0, 1] that agrees with the judged frame; low > high if none."""
    low, high = surface.low_then, surface.high_then
    return membership.solve(0.5 * (low + high), 0.5 * (high - low), surface.command_then, 0.0, 1.0)


@kernel
def offset(fdi, surface):
    """How far off its command the surface was in the judged frame, (low, high) rad: unlimited at a stop.

    A surface at its stop may be off by more than it shows; so may one that was there at an instant of it.
    Nothing but a loss takes it beyond.
    """
    low, high, u, orders = surface.low_then, surface.high_then, surface.command_then, surface.orders
    if high < surface.travel_low or low > surface.travel_high:
        return membership.NOTHING
    least, greatest = low - max(u - orders.least[1], 0.0), high + max(orders.greatest[1] - u, 0.0)
    return (
        low - u if least > surface.travel_low else -np.inf,
        high - u if greatest < surface.travel_high else np.inf,
    )


def set_of(fdi: np.void, s: int, kind: int) -> tuple[float, float]:
    """The set of a type's parameter on surface s."""
    surface = fdi["types"]["surface"][s]
    return float(surface["set_low"][kind]), float(surface["set_high"][kind])


def middle_of(fdi: np.void, s: int, kind: int) -> float:
    """The middle of that set."""
    surface = fdi["types"]["surface"][s]
    return float(0.5 * (surface["set_low"][kind] + surface["set_high"][kind]))
