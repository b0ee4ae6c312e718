"""Loss of effectiveness, constant: p = (1 + theta) u with one 1 + theta in [0, 1]."""

import numpy as np

from beaver_ftc.compiled import kernel
from beaver_ftc.diagnosis.types import sets

NAME = "loss_of_effectiveness"
CONSTANT = True


@kernel
def begin(surface, kind):
    """Anything between all and nothing may be left."""
    surface.set_low[kind], surface.set_high[kind] = 0.0, 1.0


@kernel
def judge(fdi, surface, kind, frame):
    """Keep what also explains this frame."""
    low, high = sets.effectiveness(surface)
    sets.intersect(surface, kind, low, high)


@kernel
def deflection(fdi, surface, kind):
    """The command times what can be left."""
    low, high, u = surface.set_low[kind], surface.set_high[kind], surface.command
    return min(low * u, high * u), max(low * u, high * u)


def estimate(fdi: np.void, s: int, kind: int) -> float | None:
    """theta; beside another fault the estimator, which fits all axes of its surface, is not asked."""
    return sets.middle_of(fdi, s, kind) - 1.0 if fdi["types"]["pair"]["enabled"] else fitted(fdi, s)


def fitted(fdi: np.void, s: int) -> float:
    """theta as the estimator of a loss has it."""
    estimator = fdi["isolation"]["estimator"][int(fdi["layout"]["loss_of"][s])]
    return float(estimator["theta"][int(fdi["layout"]["dominant_axis"][s])])


def interval(fdi: np.void, s: int, kind: int) -> tuple[float, float] | None:
    """Of theta."""
    low, high = sets.set_of(fdi, s, kind)
    return low - 1.0, high - 1.0
