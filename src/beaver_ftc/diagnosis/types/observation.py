"""Observations of one surface: where it was, if it alone is at fault, in three frames or blocks.

`elapsed` is the last frame, `judged` the one before it, `earlier` the one before that. Positions in rad. No
other file writes these records.
"""

import numpy as np

from beaver_ftc.compiled import kernel, record
from beaver_ftc.diagnosis.isolation import membership

# command: where a healthy surface was; low, high: where this one can have been; wrong: whether more than the
# admitted uncertainty was at work; uneven: a quarter of what its effectiveness varied by, in means; hides:
# whether the lower and the upper stop can cut a deflection off unseen.
OBSERVATION = record(command=float, low=float, high=float, wrong=int, uneven=float, hides=(int, 2))


@kernel
def begin(surface):
    """The surface may have been anywhere within reach."""
    surface.elapsed.low, surface.elapsed.high = surface.actuator.reach_low, surface.actuator.reach_high


@kernel
def shift(surface):
    """Make room for the elapsed frame."""
    copy(surface.earlier, surface.judged)
    copy(surface.judged, surface.elapsed)


@kernel
def copy(to, of):
    """Copy one observation to another."""
    to.command, to.low, to.high, to.wrong, to.uneven = of.command, of.low, of.high, of.wrong, of.uneven
    to.hides[:] = of.hides


@kernel
def locate(config, surface, fie, axis, innovation, bound, effect):
    """Find where a surface can have been: what agrees with the innovation (3,) within its bound (3,).

    fie: its estimator of a position; axis: on which it has most effect; effect: what that supposes of the
    same frame or block, dtype EFFECT.
    """
    seen, orders = surface.elapsed, surface.orders
    seen.command = -effect.offset[axis] / effect.Z[axis]
    seen.uneven = 0.25 * (orders.G_most - orders.G_least) / abs(effect.Z[axis])
    seen.low, seen.high = fie.low, fie.high
    for i in range(3):
        if config.length > 1 and i != axis and effect.Z[i] != 0.0:
            continue  # over a block the axes weigh what varies differently
        low, high = membership.agreeing(innovation, bound, fie, effect, i)
        seen.low, seen.high = max(seen.low, low), min(seen.high, high)
    note_stops(surface, 2.0 * (bound[axis] + effect.spread[axis]) / abs(effect.Z[axis]))


@kernel
def note_stops(surface, width):
    """Which stops can cut a deflection off unseen: those nearer to a healthy surface than `width` (rad), that
    of the interval which holds the true deflection."""
    surface.elapsed.hides[0] = surface.orders.least[0] - surface.actuator.travel_low < width
    surface.elapsed.hides[1] = surface.actuator.travel_high - surface.orders.greatest[0] < width


@kernel
def place(surface, middle, slack):
    """A surface was off its command by middle +- slack (rad). False: nowhere within its reach."""
    seen, actuator = surface.elapsed, surface.actuator
    seen.low = max(actuator.reach_low, seen.command + middle - slack)
    seen.high = min(actuator.reach_high, seen.command + middle + slack)
    seen.wrong = abs(middle) > slack
    note_stops(surface, 2.0 * slack)
    return seen.low <= seen.high


@kernel
def place_known(surface, low, high):
    """A surface whose fault is known was between low and high (rad): that explains what was wrong."""
    surface.elapsed.low, surface.elapsed.high, surface.elapsed.wrong = low, high, 0


@kernel
def note_wrong(surface, wrong):
    """Replace whether something was wrong in the elapsed frame."""
    surface.elapsed.wrong = wrong


@kernel
def forget_wrong(surface):
    """Nothing has been wrong so far."""
    surface.elapsed.wrong = surface.judged.wrong = surface.earlier.wrong = 0


@kernel
def middle_error(surface):
    """How far off its command the surface was in the elapsed frame, rad: the middle of where it can have
    been."""
    return 0.5 * (surface.elapsed.low + surface.elapsed.high) - surface.elapsed.command


def middle_error_of(surface: np.void) -> float:
    """The same of a record outside compiled code, rad."""
    seen = surface["elapsed"]
    return float(0.5 * (seen["low"] + seen["high"]) - seen["command"])
