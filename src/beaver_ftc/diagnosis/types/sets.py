"""The feasible set of each type's parameter on one surface: the only writer of these sets.

A type is excluded once its set is empty, and stays excluded until the surface's diagnosis restarts.
interval: (low, high) of a parameter; low > high is the empty set.
"""

import numpy as np

from beaver_ftc.compiled import kernel


@kernel
def begin(surface):
    """Allow every type with any parameter."""
    surface.feasible.low[:], surface.feasible.high[:] = -np.inf, np.inf
    surface.feasible.excluded[:] = 0


@kernel
def replace(surface, kind, interval):
    """Put an interval in place of the set of a type."""
    surface.feasible.low[kind], surface.feasible.high[kind] = interval


@kernel
def intersect(surface, kind, interval):
    """Keep of the set of a type what is also in an interval; exclude the type when nothing is left. The set
    then holds the two bounds that contradict each other. NOTHING of contract.py has no such bounds: a type
    that it excludes keeps its set."""
    low, high = interval
    if low == np.inf:
        surface.feasible.excluded[kind] = 1
        return
    surface.feasible.low[kind] = max(surface.feasible.low[kind], low)
    surface.feasible.high[kind] = min(surface.feasible.high[kind], high)
    if surface.feasible.low[kind] > surface.feasible.high[kind]:
        surface.feasible.excluded[kind] = 1


@kernel
def exclude(surface, kind):
    """Exclude a type."""
    surface.feasible.excluded[kind] = 1


@kernel
def recall(surface):
    """Return to the sets that were kept when the surface was named (pairs.py)."""
    surface.feasible.low[:], surface.feasible.high[:] = surface.known.low, surface.known.high
    surface.feasible.excluded[:] = surface.known.excluded
