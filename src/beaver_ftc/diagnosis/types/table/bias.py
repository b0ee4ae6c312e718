"""An offset, p = u + b, cut off by the stops: constant, or of one sign and never smaller than it was.

At a stop an offset that grows looks like a runaway. The speed on the way to the stop distinguishes them: an
offset that grows almost as fast as a runaway counts as one.
"""

import numpy as np

from beaver_ftc.compiled import kernel, record
from beaver_ftc.diagnosis.isolation import membership
from beaver_ftc.diagnosis.types.contract import (
    ANYTHING,
    NOTHING,
    SHIFTED,
    FaultType,
    middle,
    middle_of,
    set_of,
    within_travel,
)
from beaver_ftc.diagnosis.types.observation import middle_error_of

AS_FAST = 1.8  # times the least pace of a runaway, half of the rate limit at which it runs


@kernel
def offset(surface):
    """How far off its command the surface was in the judged frame, (low, high) rad: unlimited at a stop.

    A surface at its stop may be off by more than it shows; so may one that was there at an instant of it.
    Nothing but a loss takes it beyond.
    """
    low, high, u, orders = surface.judged.low, surface.judged.high, surface.judged.command, surface.orders
    if high < surface.actuator.travel_low or low > surface.actuator.travel_high:
        return membership.NOTHING
    least, greatest = low - max(u - orders.least[1], 0.0), high + max(orders.greatest[1] - u, 0.0)
    off_low = low - u if least > surface.actuator.travel_low else -np.inf
    return off_low, high - u if greatest < surface.actuator.travel_high else np.inf


@kernel
def judge(config, surface, kind, k):
    """The offsets that explain this frame."""
    return offset(surface)


@kernel
def error(surface, kind):
    """Off its command, rad, by the middle of its set; unlimited while an end of that is open."""
    low, high = surface.feasible.low[kind], surface.feasible.high[kind]
    return middle(surface, kind) if high - low < np.inf else np.inf


@kernel
def deflection(config, surface, kind, k):
    """The command and the offset, cut off by the stops."""
    low = cut_off(surface, surface.feasible.low[kind], surface.orders.least[0])
    return low, cut_off(surface, surface.feasible.high[kind], surface.orders.greatest[0])


@kernel
def cut_off(surface, off, extreme):
    """Where an offset (rad) takes a surface in the mean; if a stop is met at an instant, at the `extreme`."""
    orders, actuator, mean = surface.orders, surface.actuator, surface.elapsed.command + off
    met = orders.least[0] + off < actuator.travel_low or orders.greatest[0] + off > actuator.travel_high
    return within_travel(surface, extreme + off) if met else mean


def interval(fdi: np.void, s: int, kind: int) -> tuple[float, float] | None:
    """Of the offset, rad; None while one end is open."""
    low, high = set_of(fdi, s, kind)
    return (low, high) if np.isfinite(low) and np.isfinite(high) else None


@kernel
def begin_growing(surface, kind):
    """It has not grown yet."""
    grown = surface.growing_bias
    grown.up = grown.down = 0.0
    grown.ran[:] = 0
    forget_pace(grown)


@kernel
def forget_pace(grown):
    """Its offset is not known."""
    grown.least, grown.greatest = -np.inf, np.inf


@kernel
def pace(config, surface):
    """How far one that is slower than a runaway moves from one judged frame to the next, rad at most."""
    return AS_FAST * surface.actuator.least_runaway_rate * config.span_s


@kernel
def widen_growing(config, surface, kind):
    """Widen the interval of the offset by what one that is slower than a runaway moves in a frame."""
    way = pace(config, surface)
    surface.growing_bias.least -= way
    surface.growing_bias.greatest += way


@kernel
def skip_growing(config, surface, kind, k):
    """The fault may have gone, and begin again with any offset."""
    forget_pace(surface.growing_bias)


@kernel
def note_pace(config, surface, least, greatest):
    """Hold an offset between least and greatest (rad) against what a slower one can be. A mean over several
    instants may be that of the last of them."""
    grown = surface.growing_bias
    if greatest < grown.least:
        grown.ran[0] = 1
    if least > grown.greatest:
        grown.ran[1] = 1
    spare = 0.0 if config.whole else pace(config, surface)
    grown.least, grown.greatest = max(grown.least, least - spare), min(grown.greatest, greatest + spare)


@kernel
def judge_growing(config, surface, kind, k):
    """It keeps its sign and does not shrink; at a stop it may be larger than it shows."""
    least, greatest = offset(surface)
    if least <= greatest:
        note_pace(config, surface, least, greatest)
    if np.isinf(least) or np.isinf(greatest):
        return ANYTHING
    grown = surface.growing_bias
    grown.up, grown.down = max(grown.up, least), min(grown.down, greatest)
    above, below = grown.up > 0.0, grown.down < 0.0
    shrinks = (above and greatest < grown.up) or (below and least > grown.down)
    return NOTHING if least > greatest or (above and below) or shrinks else ANYTHING


@kernel
def ran(surface, direction):
    """Whether the surface has moved towards that stop as fast as only a runaway does."""
    if direction == 0:
        return False
    return surface.growing_bias.ran[1 if direction > 0 else 0] == 1


def last_offset(fdi: np.void, s: int, kind: int) -> float | None:
    """Offset in the last frame, rad."""
    return middle_error_of(fdi["types"]["surface"][s])


CONSTANT = FaultType(
    name="bias", constant=True, rank=6,
    judge=judge, deflection=deflection,
    accommodation=SHIFTED, expected_error=error, error_rank=2, estimate=middle_of, interval=interval,
)  # fmt: skip
GROWING = FaultType(
    name="bias", words="bias that grows", constant=False, rank=4,
    begin=begin_growing, on_frame=widen_growing, judge=judge_growing, on_skipped_frame=skip_growing,
    record="growing_bias",
    memory=record(
        up=float, down=float,  # how far it has certainly grown, rad
        # between what a slower one lies, rad; whether it has certainly run as fast as a runaway, down and up
        least=float, greatest=float, ran=(int, 2),
    ),
    # in the end an offset that grows is as good as a constant one, whatever the commands
    follows_command=False,
    # as the command happens to go it looks like a jam or a loss; come to the stop by and by, like a runaway
    mistaken_for=("loss_of_effectiveness", "stuck", "float", "hardover"), differs=ran,
    accommodation=SHIFTED, estimate=last_offset,
)  # fmt: skip
TYPES = CONSTANT, GROWING
