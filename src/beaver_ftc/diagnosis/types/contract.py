"""The contract of a fault type: a row of the table, and the operations on the feasible set of its parameter.

A file under `table/` describes one fault type, or the two types of one name; its `TYPES` are the rows. The
readers of the rows (verdict.py, findings.py, pairs.py) name no type. `kind` is the number of a type, the same
in every array over types. config: TYPES_CONFIG of registry.py; surface: a record of its
`surface_dtype`. k: number of the judged frame, which is the frame before the elapsed one.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from beaver_ftc.compiled import kernel

Kernel = Callable[..., Any]

# Accommodation modes, what the law does about a surface at fault: scale its command, give the surface up,
# subtract its offset, or wait for it at the pace that it has.
LOSES, FIXED, SHIFTED, LAGS = range(4)

ANYTHING, NOTHING = (-np.inf, np.inf), (np.inf, -np.inf)  # an unlimited set, and an empty one

# `at_rest`: what a surface says of a type that was given up, stays where it was and shows nothing wrong.
NOTHING_SAID, EXCLUDED, UNSEEN, STANDS = range(4)


@kernel
def anywhere(config, surface, kind, k):
    """Anywhere within reach."""
    return surface.actuator.reach_low, surface.actuator.reach_high


def _nothing(fdi: np.void, s: int, kind: int) -> None:
    """No parameter to estimate."""


@dataclass(frozen=True, kw_only=True)
class FaultType:
    """One fault type. A part that is left out has nothing to do.

    name                    in scenarios, reports and metrics
    words                   the type in words, where the name does not say which of two types it is
    constant                whether its parameter is constant: if so, a frame can refute what another frame
                            allows
    rank                    place among the types of its sort (constant or not), in numbers and in lists

    The feasible set; kernels:

    judge(config, surface, kind, k)
                            the parameters (low, high) that explain the judged frame, in which something was
                            wrong; ANYTHING if every one does, NOTHING (low > high) excludes the type
    whole_range(surface)    the parameters (low, high) that there are; unlimited if left out
    restored(surface, kind) the set (low, high) to go on with after a frame; the one there is if left out
    memory, record          a record of its own, found at `surface.<record>`
    begin(surface, kind)    its memory is reset: nothing is known yet
    on_frame(config, surface, kind)             called for every frame, before it is judged
    on_skipped_frame(config, surface, kind, k)  called for a frame that is not judged
    on_release(config, surface, kind, k)        a repair may have released the surface as the frame began
    propagate_release(config, surface, kind)    carry such a release on to the next frame (release.py)
    deflection(config, surface, kind, k)        least and greatest deflection under it by the elapsed frame,
                                                rad; of a constant type

    The evidence that a verdict needs:

    has_shown(surface)      kernel: whether the type has shown itself. A type with this part explains a flight
                            only once it has shown itself
    shows_within            half-cycles of the slowest oscillation within which such a type shows itself
    at_rest                 what a surface that was given up, and stays where it was, says of the type:
                            NOTHING_SAID, EXCLUDED, UNSEEN (it may be there all the same) or STANDS (its
                            parameter is the deflection at which the surface stands)
    half_cycles             half-cycles of evidence that a fault on another surface needs while this type is
                            left here
    follows_command         whether the deflection error depends on the command. While a type that does not
                            is left on one surface, no other surface is named in its place
    mistaken_for            names of types that this one can look like: they are not named while it is left
    differs(surface, direction)
                            kernel: whether the surface has moved as this type cannot, towards the stop
                            `direction` (0: of a type without one)
    direction               the stop that it runs to: 1 upper, -1 lower, 0 neither

    The accommodation:

    accommodation           mode: LOSES, FIXED, SHIFTED or LAGS
    also                    other modes that serve it
    limit                   name of the type that it becomes at the end of its range: where both are left, the
                            modes of that one serve this one too
    expected_error(surface, kind)
                            kernel: how far the surface is off its command, rad; not finite if not known
    error_rank              which of several types left says that: the least

    Words, Python functions (findings.py):

    estimate(fdi, s, kind)          its parameter, None without one
    interval(fdi, s, kind)          the set that the parameter is certain to lie in, or None
    frequency_rad_s(fdi, s, kind)   of a periodic type, or None
    """

    name: str
    constant: bool
    judge: Kernel
    words: str = ""
    rank: int = 100
    whole_range: Kernel | None = None
    restored: Kernel | None = None
    memory: np.dtype | None = None
    record: str = ""
    begin: Kernel | None = None
    on_frame: Kernel | None = None
    on_skipped_frame: Kernel | None = None
    on_release: Kernel | None = None
    propagate_release: Kernel | None = None
    deflection: Kernel = anywhere
    has_shown: Kernel | None = None
    shows_within: int = 0
    at_rest: int = NOTHING_SAID
    half_cycles: int = 1
    follows_command: bool = True
    mistaken_for: tuple[str, ...] = ()
    differs: Kernel | None = None
    direction: int = 0
    accommodation: int = SHIFTED
    also: tuple[int, ...] = ()
    limit: str = ""
    expected_error: Kernel | None = None
    error_rank: int = 100
    estimate: Callable[[np.void, int, int], float | None] = _nothing
    interval: Callable[[np.void, int, int], tuple[float, float] | None] = _nothing
    frequency_rad_s: Callable[[np.void, int, int], float | None] = _nothing


@kernel
def within_travel(surface, deflection):
    """A deflection (rad), cut off by the stops."""
    return min(max(deflection, surface.actuator.travel_low), surface.actuator.travel_high)


@kernel
def middle(surface, kind):
    """The middle of a type's set."""
    return 0.5 * (surface.feasible.low[kind] + surface.feasible.high[kind])


def set_of(fdi: np.void, s: int, kind: int) -> tuple[float, float]:
    """The set of a type's parameter on surface s."""
    surface = fdi["types"]["surface"][s]
    return float(surface["feasible"]["low"][kind]), float(surface["feasible"]["high"][kind])


def middle_of(fdi: np.void, s: int, kind: int) -> float:
    """The middle of that set."""
    low, high = set_of(fdi, s, kind)
    return 0.5 * (low + high)
