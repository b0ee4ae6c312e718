"""The contract of a fault type: a row of the table, the feasible sets, and the observations of a surface.

A file under `table/` describes fault types; its `TYPES` are the rows. The readers of the rows (verdict.py,
pairs.py) name no type. `kind` is the number of a type, the same in every array over types. config:
TYPES_CONFIG of registry.py; surface: a record of its `surface_dtype`. k: number of the judged frame, which is
the frame before the elapsed one.

Feasible sets: the set (low, high) of each type's parameter on one surface; low > high is the empty set. A
type is excluded once its set is empty, and stays excluded until the surface's diagnosis restarts. No other
file writes the sets.

Observations: where one surface was, if it alone is at fault, in three frames or blocks: `elapsed` is the last
frame, `judged` the one before it, `earlier` the one before that. Positions in rad. No other file writes them.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from beaver_ftc.compiled import kernel, record
from beaver_ftc.diagnosis import isolation

Kernel = Callable[..., Any]

# Accommodation modes, what the law does about a surface at fault: scale its command, give the surface up,
# subtract its offset, or wait for it at the pace that it has.
SCALE_COMMAND, GIVE_UP, SUBTRACT_OFFSET, WAIT_FOR_SURFACE = range(4)

UNLIMITED_SET, EMPTY_SET = (-np.inf, np.inf), (np.inf, -np.inf)  # an unlimited set, and an empty one

# `at_rest`: what a surface says of a type that was given up, stays where it was and shows nothing wrong.
REST_TELLS_NOTHING, REST_EXCLUDES, REST_HIDES, REST_AGREES = range(4)


@kernel
def within_reach(config, surface, kind, k):
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
    propagate_release(config, surface, kind)    advance such a release by a frame (held_surface.py)
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

    Words, Python functions (verdict.py):

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
    deflection: Kernel = within_reach
    has_shown: Kernel | None = None
    shows_within: int = 0
    at_rest: int = REST_TELLS_NOTHING
    half_cycles: int = 1
    follows_command: bool = True
    mistaken_for: tuple[str, ...] = ()
    differs: Kernel | None = None
    direction: int = 0
    accommodation: int = SUBTRACT_OFFSET
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
def set_middle(surface, kind):
    """The middle of a type's set."""
    return 0.5 * (surface.feasible.low[kind] + surface.feasible.high[kind])


def feasible_set(fdi: np.void, s: int, kind: int) -> tuple[float, float]:
    """The set of a type's parameter on surface s."""
    surface = fdi["types"]["surface"][s]
    return float(surface["feasible"]["low"][kind]), float(surface["feasible"]["high"][kind])


def set_middle_of(fdi: np.void, s: int, kind: int) -> float:
    """The middle of that set."""
    low, high = feasible_set(fdi, s, kind)
    return 0.5 * (low + high)


@kernel
def begin_sets(surface):
    """Allow every type with any parameter."""
    surface.feasible.low[:], surface.feasible.high[:] = -np.inf, np.inf
    surface.feasible.excluded[:] = 0


@kernel
def replace_set(surface, kind, interval):
    """Put an interval in place of the set of a type."""
    surface.feasible.low[kind], surface.feasible.high[kind] = interval


@kernel
def intersect_set(surface, kind, interval):
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
def exclude_type(surface, kind):
    """Exclude a type."""
    surface.feasible.excluded[kind] = 1


@kernel
def restore_known_sets(surface):
    """Return to the sets that were kept when the surface was named (pairs.py)."""
    surface.feasible.low[:], surface.feasible.high[:] = surface.known.low, surface.known.high
    surface.feasible.excluded[:] = surface.known.excluded


# command: where a healthy surface was; low, high: where this one can have been; wrong: whether more than the
# declared uncertainty was at work; effectiveness_variation: a quarter of its change, in means; stop_hides:
# whether the lower and the upper stop can cut a deflection off unseen.
OBSERVATION = record(
    command=float, low=float, high=float, anomalous=int, effectiveness_variation=float, stop_hides=(int, 2)
)


@kernel
def begin_observation(surface):
    """The surface may have been anywhere within reach."""
    surface.elapsed.low, surface.elapsed.high = surface.actuator.reach_low, surface.actuator.reach_high


@kernel
def shift_observations(surface):
    """Make room for the elapsed frame."""
    copy_observation(surface.earlier, surface.judged)
    copy_observation(surface.judged, surface.elapsed)


@kernel
def copy_observation(to, of):
    """Copy one observation to another."""
    to.command, to.low, to.high, to.anomalous, to.effectiveness_variation = (
        of.command,
        of.low,
        of.high,
        of.anomalous,
        of.effectiveness_variation,
    )
    to.stop_hides[:] = of.stop_hides


@kernel
def locate_surface(config, surface, fie, axis, innovation, bound, effect):
    """Find where a surface can have been: what agrees with the innovation (3,) within its bound (3,).

    fie: its estimator of a position; axis: on which it has most effect; effect: what that supposes of the
    same frame or block, dtype EFFECT.
    """
    seen, commands = surface.elapsed, surface.commands
    seen.command = -effect.offset[axis] / effect.Z[axis]
    seen.effectiveness_variation = 0.25 * (commands.G_most - commands.G_least) / abs(effect.Z[axis])
    seen.low, seen.high = fie.low, fie.high
    for i in range(3):
        if config.length > 1 and i != axis and effect.Z[i] != 0.0:
            continue  # over a block the axes weigh what varies differently
        low, high = isolation.consistent_on_axis(innovation, bound, fie, effect, i)
        seen.low, seen.high = max(seen.low, low), min(seen.high, high)
    record_hiding_stops(surface, 2.0 * (bound[axis] + effect.spread[axis]) / abs(effect.Z[axis]))


@kernel
def record_hiding_stops(surface, width):
    """Which stops can cut a deflection off unseen: those nearer to a healthy surface than `width` (rad), that
    of the interval which holds the true deflection."""
    surface.elapsed.stop_hides[0] = surface.commands.least[0] - surface.actuator.travel_low < width
    surface.elapsed.stop_hides[1] = surface.actuator.travel_high - surface.commands.greatest[0] < width


@kernel
def set_deflection(surface, middle, slack):
    """A surface was off its command by middle +- slack (rad). False: nowhere within its reach."""
    seen, actuator = surface.elapsed, surface.actuator
    seen.low = max(actuator.reach_low, seen.command + middle - slack)
    seen.high = min(actuator.reach_high, seen.command + middle + slack)
    seen.anomalous = abs(middle) > slack
    record_hiding_stops(surface, 2.0 * slack)
    return seen.low <= seen.high


@kernel
def set_known_deflection(surface, low, high):
    """A surface whose fault is known was between low and high (rad): that explains what was wrong."""
    surface.elapsed.low, surface.elapsed.high, surface.elapsed.anomalous = low, high, 0


@kernel
def set_anomalous(surface, anomalous):
    """Replace whether something was wrong in the elapsed frame."""
    surface.elapsed.anomalous = anomalous


@kernel
def clear_anomalies(surface):
    """Nothing has been wrong so far."""
    surface.elapsed.anomalous = surface.judged.anomalous = surface.earlier.anomalous = 0


@kernel
def observed_error(surface):
    """How far off its command the surface was in the elapsed frame, rad: the middle of where it can have
    been."""
    return 0.5 * (surface.elapsed.low + surface.elapsed.high) - surface.elapsed.command


def observed_error_of(surface: np.void) -> float:
    """The same of a record outside compiled code, rad."""
    seen = surface["elapsed"]
    return float(0.5 * (seen["low"] + seen["high"]) - seen["command"])
