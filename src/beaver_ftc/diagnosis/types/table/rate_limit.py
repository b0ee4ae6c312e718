"""A slow surface: p moves towards its command only, at any rate down to the slowest declared.

Slower than that it is a jam: the two are one another's limit, and only a least rate tells them apart.
"""

from beaver_ftc.compiled import kernel, record
from beaver_ftc.diagnosis.types.contract import ANYTHING, LAGS, NOTHING, UNSEEN, FaultType


@kernel
def begin(surface, kind):
    """No frame has been seen, and none before it."""
    surface.rate_limit.at = -2


@kernel
def judge(config, surface, kind, k):
    """It never moves away from its command, so while it stands on one side it comes nearer.

    Of several JSBSim frames in one of ours the first is the old command's.
    """
    low, high, run = surface.judged.low, surface.judged.high, surface.rate_limit
    sign, retreats = side(config, surface), False
    if sign == 0 or sign != run.sign or k != run.at + 1:
        run.low, run.high = low, high
    else:
        retreats = (sign > 0 and low > run.high) or (sign < 0 and high < run.low)
        come_nearer(config, surface, run, sign)
    run.low, run.high = max(run.low, low), min(run.high, high)
    run.sign, run.at = sign, k
    return NOTHING if retreats else ANYTHING


@kernel
def come_nearer(config, surface, run, sign):
    """Take off what the slowest one comes nearer by within the judged frame: a least step an instant, until
    its lag makes the steps smaller. Where it was at an instant bounds where it is a frame later."""
    least = config.instants * config.length * surface.actuator.slowest_step
    close = surface.actuator.slowest_step / surface.actuator.approach
    lowest, highest = ordered(config, surface)
    if sign > 0:
        run.high = min(run.high, max(run.high - least, highest + close))
    elif sign < 0:
        run.low = max(run.low, min(run.low + least, lowest - close))


@kernel
def ordered(config, surface):
    """The least and greatest order that moved it towards and within the judged frame, rad."""
    orders = surface.orders
    newest = 2 if config.whole else 1
    return min(orders.low[2], orders.low[newest]), max(orders.high[2], orders.high[newest])


@kernel
def side(config, surface):
    """1 for a surface certainly above all it was ordered to, -1 below, 0 otherwise."""
    lowest, highest = ordered(config, surface)
    return 1 if surface.judged.low > highest else (-1 if surface.judged.high < lowest else 0)


RATE_LIMIT = FaultType(
    name="rate_limit", constant=False, rank=3,
    begin=begin, judge=judge, record="rate_limit",
    memory=record(
        low=float, high=float,  # where it can be while it stands on one side of its command, rad
        sign=int, at=int,  # which side, and the last frame of which that is known
    ),
    # a slow surface that has not been seen to creep looks as if it stood still
    at_rest=UNSEEN, mistaken_for=("stuck", "float", "hardover"), accommodation=LAGS,
)  # fmt: skip
TYPES = (RATE_LIMIT,)
