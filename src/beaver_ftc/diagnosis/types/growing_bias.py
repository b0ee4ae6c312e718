"""An incipient offset: p = u + b, b of one sign and never smaller than it was.

At a stop it shows nothing that a runaway does not. How fast they came there tells them apart: what runs
almost as fast as a runaway counts as one.
"""

import numpy as np

from beaver_ftc.compiled import kernel
from beaver_ftc.diagnosis.types import sets

NAME = "bias"
CONSTANT = False
AS_FAST = 1.8  # times the least pace of a runaway, half of the rate limit at which it runs
MEMORY = (
    ("up", "f8"), ("down", "f8"),  # how far it has certainly grown, rad
    # between what a slower one lies, rad; whether it has certainly run as fast as a runaway, down and up
    ("least", "f8"), ("greatest", "f8"), ("ran", "i8", (2,)),
)  # fmt: skip


@kernel
def begin(surface, kind):
    """It has not grown yet."""
    grown = surface.growing_bias
    grown.up = grown.down = 0.0
    grown.ran[:] = 0
    forget_pace(grown)


@kernel
def forget_pace(grown):
    """Where it is is not known."""
    grown.least, grown.greatest = -np.inf, np.inf


@kernel
def pace(fdi, surface):
    """How far one that is slower than a runaway moves from one judged frame to the next, rad at most."""
    return AS_FAST * surface.least_runaway_rate * fdi.types.config.span_s


@kernel
def watch(fdi, surface, kind):
    """A slower one has moved on."""
    way = pace(fdi, surface)
    surface.growing_bias.least -= way
    surface.growing_bias.greatest += way


@kernel
def pass_over(fdi, surface, kind):
    """It may have gone, and begin anew."""
    forget_pace(surface.growing_bias)


@kernel
def note_pace(fdi, surface, least, greatest):
    """Hold an offset between least and greatest (rad) against what a slower one can be. A mean over several
    instants may be that of the last of them."""
    grown = surface.growing_bias
    if greatest < grown.least:
        grown.ran[0] = 1
    if least > grown.greatest:
        grown.ran[1] = 1
    spare = 0.0 if fdi.types.config.whole else pace(fdi, surface)
    grown.least, grown.greatest = max(grown.least, least - spare), min(grown.greatest, greatest + spare)


@kernel
def judge(fdi, surface, kind, frame):
    """It keeps its sign and does not shrink; at a stop it may be larger than it shows."""
    least, greatest = sets.offset(fdi, surface)
    if least <= greatest:
        note_pace(fdi, surface, least, greatest)
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
    surface = fdi["types"]["surface"][s]
    return float(0.5 * (surface["low"] + surface["high"]) - surface["command"])
