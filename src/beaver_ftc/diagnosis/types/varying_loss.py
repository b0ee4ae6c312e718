"""Loss of effectiveness that varies: p = (1 + theta) u, 1 + theta anywhere in [0, 1] in every frame.

An incipient loss is one; so is a constant one, which has a type of its own.
"""

import numpy as np

from beaver_ftc.compiled import kernel
from beaver_ftc.diagnosis.types import sets
from beaver_ftc.diagnosis.types.loss import fitted

NAME = "loss_of_effectiveness"
CONSTANT = False


@kernel
def judge(fdi, surface, kind, frame):
    """Some effectiveness explains this frame; over a block in which the command changes sign, any mean."""
    low, high = sets.effectiveness(surface)
    swung = fdi.types.config.length > 1 and surface.orders.least[1] < 0.0 < surface.orders.greatest[1]
    if low > high and not swung:
        surface.type_excluded[kind] = 1


def estimate(fdi: np.void, s: int, kind: int) -> float | None:
    """theta, as the estimator has it."""
    return fitted(fdi, s)
