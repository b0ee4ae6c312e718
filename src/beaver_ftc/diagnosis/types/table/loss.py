"""Loss of effectiveness: p = (1 + theta) u, with 1 + theta in [0, 1], the effectiveness.

Two types: 1 + theta is constant, or (incipient) any in every frame. The kernels of the second begin with
`varying`.

    c, srf, h, k    configuration of the types, record of a surface, number of a type, judged frame
    u, p            deflection, rad: of a healthy surface under the same command, of this one
"""

import numpy as np

from beaver_ftc.compiled import kernel
from beaver_ftc.diagnosis.sets import EMPTY_SET, UNLIMITED_SET, explain
from beaver_ftc.diagnosis.types import (
    SCALE_COMMAND,
    DeflectionRelation,
    FaultType,
    feasible_set,
    middle_estimate,
)


@kernel
def parameter_range(srf, h):
    """The range of 1 + theta: 0 to 1."""
    return 0.0, 1.0


@kernel
def consistent_interval(c, srf, h, k):
    """The 1 + theta in [0, 1] with p = (1 + theta) u in the judged frame; lo > hi if there is none."""
    lo, hi = srf.judged.lo, srf.judged.hi
    return explain(0.5 * (lo + hi), 0.5 * (hi - lo), srf.judged.u, 0.0, 1.0)


@kernel
def deflection_range(c, srf, h, k):
    """(1 + theta) u in the elapsed frame, least and greatest over the set of 1 + theta, rad."""
    lo, hi = srf.sets.low[h] * srf.last.u, srf.sets.high[h] * srf.last.u
    return min(lo, hi), max(lo, hi)


@kernel
def varying_interval(c, srf, h, k):
    """UNLIMITED_SET if some 1 + theta in [0, 1] explains the judged frame, else EMPTY_SET.

    Over a block of frames in which u changes its sign, the mean p is not tested: an effectiveness that varies
    within the block weighs both signs differently.
    """
    lo, hi = consistent_interval(c, srf, h, k)
    changed = c.frames_per_block > 1 and srf.commands.u_min[1] < 0.0 < srf.commands.u_max[1]
    return EMPTY_SET if lo > hi and not changed else UNLIMITED_SET


def estimate_parameter(fdi: np.void, s: int, h: int) -> float:
    """theta of the estimator. Where pairs are diagnosed, it is the middle of the set of theta, because the
    estimator fits axes that a second fault may move."""
    return middle_estimate(fdi, s, h) - 1.0 if fdi["types"]["pair"]["enabled"] else fitted_theta(fdi, s, h)


def fitted_theta(fdi: np.void, s: int, h: int) -> float:
    """theta of the isolation estimator of this loss."""
    estimator = fdi["isolation"]["estimator"][int(fdi["layout"]["loss"][s])]
    return float(estimator["theta"][int(fdi["layout"]["dominant_axis"][s])])


def estimate_interval(fdi: np.void, s: int, h: int) -> tuple[float, float]:
    """The interval of theta."""
    lo, hi = feasible_set(fdi, s, h)
    return lo - 1.0, hi - 1.0


RELATION = DeflectionRelation(command_gain=1.0, theta_is_share=True, theta_span=lambda low, high: (-1.0, 0.0))
TYPES = (
    FaultType(
        name="loss_of_effectiveness", has_constant_parameter=True, sort_rank=1,
        parameter_range=parameter_range, consistent_interval=consistent_interval,
        deflection_range=deflection_range, accommodation_mode=SCALE_COMMAND, end_type="float",
        deflection_relation=RELATION, estimate_parameter=estimate_parameter,
        estimate_parameter_interval=estimate_interval,
    ),
    FaultType(
        name="loss_of_effectiveness", description="loss_of_effectiveness that varies",
        has_constant_parameter=False, sort_rank=1, consistent_interval=varying_interval, wait_half_cycles=2,
        accommodation_mode=SCALE_COMMAND, deflection_relation=RELATION, estimate_parameter=fitted_theta,
    ),
)  # fmt: skip
