"""Loss of effectiveness: p = (1 + theta) u, one 1 + theta in [0, 1], or any in every frame (incipient)."""

import numpy as np

from beaver_ftc.compiled import kernel
from beaver_ftc.diagnosis.isolation import membership
from beaver_ftc.diagnosis.types.contract import ANYTHING, LOSES, NOTHING, FaultType, middle_of, set_of


@kernel
def effectiveness(surface):
    """The interval of 1 + theta in [0, 1] that agrees with the judged frame; low > high if none."""
    low, high = surface.judged.low, surface.judged.high
    return membership.solve(0.5 * (low + high), 0.5 * (high - low), surface.judged.command, 0.0, 1.0)


@kernel
def whole_range(surface):
    """Of 1 + theta: between nothing and all may be left."""
    return 0.0, 1.0


@kernel
def judge(config, surface, kind, k):
    """The effectiveness that explains this frame."""
    return effectiveness(surface)


@kernel
def deflection(config, surface, kind, k):
    """The command times what can be left."""
    low, high, u = surface.feasible.low[kind], surface.feasible.high[kind], surface.elapsed.command
    return min(low * u, high * u), max(low * u, high * u)


@kernel
def judge_varying(config, surface, kind, k):
    """Some effectiveness explains this frame; over a block in which the command changes sign, any mean."""
    low, high = effectiveness(surface)
    swung = config.length > 1 and surface.orders.least[1] < 0.0 < surface.orders.greatest[1]
    return NOTHING if low > high and not swung else ANYTHING


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
    name="loss_of_effectiveness", constant=True, rank=1,
    whole_range=whole_range, judge=judge, deflection=deflection,
    accommodation=LOSES, limit="float", estimate=estimate, interval=interval,
)  # fmt: skip
VARYING = FaultType(
    name="loss_of_effectiveness", words="loss_of_effectiveness that varies", constant=False, rank=1,
    judge=judge_varying, half_cycles=2, accommodation=LOSES, estimate=fitted,
)  # fmt: skip
TYPES = CONSTANT, VARYING
