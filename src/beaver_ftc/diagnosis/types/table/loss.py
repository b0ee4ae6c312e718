"""Loss of effectiveness: p = (1 + theta) u, one 1 + theta in [0, 1], or any in every frame (incipient)."""

import numpy as np

from beaver_ftc.compiled import kernel
from beaver_ftc.diagnosis.isolation import membership
from beaver_ftc.diagnosis.types.contract import FaultType, intersect, middle_of, set_of


@kernel
def effectiveness(surface):
    """The interval of 1 + theta in [0, 1] that agrees with the judged frame; low > high if none."""
    low, high = surface.low_then, surface.high_then
    return membership.solve(0.5 * (low + high), 0.5 * (high - low), surface.command_then, 0.0, 1.0)


@kernel
def begin(surface, kind):
    """Anything between all and nothing may be left."""
    surface.set_low[kind], surface.set_high[kind] = 0.0, 1.0


@kernel
def judge(config, surface, kind, k):
    """Keep what also explains this frame."""
    low, high = effectiveness(surface)
    intersect(surface, kind, low, high)


@kernel
def deflection(config, surface, kind, k):
    """The command times what can be left."""
    low, high, u = surface.set_low[kind], surface.set_high[kind], surface.command
    return min(low * u, high * u), max(low * u, high * u)


@kernel
def judge_varying(config, surface, kind, k):
    """Some effectiveness explains this frame; over a block in which the command changes sign, any mean."""
    low, high = effectiveness(surface)
    swung = config.length > 1 and surface.orders.least[1] < 0.0 < surface.orders.greatest[1]
    if low > high and not swung:
        surface.type_excluded[kind] = 1


def estimate(fdi: np.void, s: int, kind: int) -> float | None:
    """theta; beside another fault the estimator, which fits all axes of its surface, is not asked."""
    return middle_of(fdi, s, kind) - 1.0 if fdi["types"]["pair"]["enabled"] else fitted(fdi, s, kind)


def fitted(fdi: np.void, s: int, kind: int) -> float:
    """theta as the estimator of a loss has it."""
    estimator = fdi["isolation"]["estimator"][int(fdi["layout"]["loss_of"][s])]
    return float(estimator["theta"][int(fdi["layout"]["dominant_axis"][s])])


def interval(fdi: np.void, s: int, kind: int) -> tuple[float, float] | None:
    """Of theta."""
    low, high = set_of(fdi, s, kind)
    return low - 1.0, high - 1.0


CONSTANT = FaultType(
    name="loss_of_effectiveness", constant=True, rank=1, begin=begin, judge=judge, deflection=deflection,
    estimate=estimate, interval=interval,
)  # fmt: skip
VARYING = FaultType(
    name="loss_of_effectiveness", constant=False, rank=1, judge=judge_varying, estimate=fitted
)
TYPES = CONSTANT, VARYING
