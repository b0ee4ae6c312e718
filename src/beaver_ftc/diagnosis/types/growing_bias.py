"""An incipient offset: p = u + b, b of one sign and never smaller than it was."""

import numpy as np

from beaver_ftc.compiled import kernel
from beaver_ftc.diagnosis.types import sets

NAME = "bias"
CONSTANT = False
MEMORY = (("up", "f8"), ("down", "f8"))  # how far it has certainly grown, rad


@kernel
def begin(surface, kind):
    """It has not grown yet."""
    surface.growing_bias.up = surface.growing_bias.down = 0.0


@kernel
def judge(fdi, surface, kind, frame):
    """It keeps its sign and does not shrink; at a stop it may be larger than it shows."""
    least, greatest = sets.offset(fdi, surface)
    if np.isinf(least) or np.isinf(greatest):
        return
    grown = surface.growing_bias
    grown.up, grown.down = max(grown.up, least), min(grown.down, greatest)
    above, below = grown.up > 0.0, grown.down < 0.0
    if (
        least > greatest
        or (above and below)
        or (above and greatest < grown.up)
        or (below and least > grown.down)
    ):
        surface.type_excluded[kind] = 1


def estimate(fdi: np.void, s: int, kind: int) -> float | None:
    """Offset in the last frame, rad."""
    surface = fdi["surface"][s]
    return float(0.5 * (surface["low"] + surface["high"]) - surface["command"])
