"""What a fault type is: a row of the table, and the operations on the set of its one parameter.

A file under `table/` describes one type of fault, or the two of one name; its `TYPES` are all that is said of
them. `kind` is a type's number, the same in every array over types. config: TYPES_CONFIG of registry.py;
surface: a record of its `surface_dtype`. k: the number of the judged frame, the one before the elapsed.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from beaver_ftc.compiled import kernel

Kernel = Callable[..., Any]


@kernel
def anywhere(config, surface, kind, k):
    """Anywhere within reach."""
    return surface.reach_low, surface.reach_high


def _nothing(fdi: np.void, s: int, kind: int) -> None:
    """No parameter to estimate."""


@dataclass(frozen=True, kw_only=True)
class FaultType:
    """One type of fault. Parts left out, all of them kernels but the last three, have nothing to do.

    name                    in scenarios, reports and metrics
    constant                whether its parameter is: what it says of one frame, the next can refute
    judge(config, surface, kind, k)
                            hold the type against the judged frame, in which something was wrong: narrow
                            surface.set_low[kind] to .set_high[kind], or set surface.type_excluded[kind]
    rank                    place among the types of its sort, in numbers and in lists
    memory, record          a record of its own, found at `surface.<record>`
    begin(surface, kind)                        nothing is known yet; its set is unlimited
    watch(config, surface, kind)                called for every frame, before it is judged
    pass_over(config, surface, kind, k)         called for a frame that is not judged
    let_go(config, surface, kind, k)            a repair may have released the surface as the frame began
    bring_back(config, surface, kind)           carry such a release on to the next frame (release.py)
    shown(surface)                              whether it has shown itself, so that it can explain a flight
    deflection(config, surface, kind, k)        least and greatest deflection under it by the elapsed frame,
                                                rad; of a constant type
    estimate(fdi, s, kind)                      its parameter: see findings.py; None without one
    interval(fdi, s, kind)                      the set that parameter is certain to lie in, or None
    frequency_rad_s(fdi, s, kind)               of what repeats itself, or None
    """

    name: str
    constant: bool
    judge: Kernel
    rank: int = 100
    memory: np.dtype | None = None
    record: str = ""
    begin: Kernel | None = None
    watch: Kernel | None = None
    pass_over: Kernel | None = None
    let_go: Kernel | None = None
    bring_back: Kernel | None = None
    shown: Kernel | None = None
    deflection: Kernel = anywhere
    estimate: Callable[[np.void, int, int], float | None] = _nothing
    interval: Callable[[np.void, int, int], tuple[float, float] | None] = _nothing
    frequency_rad_s: Callable[[np.void, int, int], float | None] = _nothing


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


def set_of(fdi: np.void, s: int, kind: int) -> tuple[float, float]:
    """The set of a type's parameter on surface s."""
    surface = fdi["types"]["surface"][s]
    return float(surface["set_low"][kind]), float(surface["set_high"][kind])


def middle_of(fdi: np.void, s: int, kind: int) -> float:
    """The middle of that set."""
    low, high = set_of(fdi, s, kind)
    return 0.5 * (low + high)
