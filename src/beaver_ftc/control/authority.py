"""Authority: the angular accelerations that the surfaces can give, and the part of a demand that they do not.

The attainable moment set is the image of the travels under G [Durham1993]. Here it is the interval that it
spans on each axis (`attainable`), with the effectiveness of each surface in G. No law can meet a demand
outside of it.

    i             axis
    G             (3, n) rad/s2 per rad, with the effectiveness of each surface in it
    layout        record of `allocation.layout_dtype`
    by_engines    (2, 3) rad/s2, what engines give at least and at most about each axis
"""

import numpy as np

from beaver_ftc.aircraft import PITCH
from beaver_ftc.compiled import kernel
from beaver_ftc.scenario.declared import Declared


def authority_shares(declared: Declared, layout: np.void) -> np.ndarray:
    """Share (3, n) of each surface s in the authority about each axis i:

        |G_is| travel_s / their sum        over the surfaces whose largest effect is about this axis

    The surface that leads the axis has the share 1 if the aircraft is not general, or if no surface has its
    largest effect about the axis. Backups have none in pitch.
    """
    aircraft = declared.aircraft
    main = layout["main"]
    shares = np.zeros((3, aircraft.n))
    if layout["general"]:
        effects = aircraft.effects(declared.scale)
        for s, (surface, axis) in enumerate(zip(aircraft.surfaces, aircraft.dominant_axis, strict=True)):
            if axis != PITCH or not layout["is_backup"][s]:
                travel = aircraft.travel[surface]
                shares[axis, s] = abs(effects[surface][axis]) * (travel.max_rad - travel.min_rad)
    for i in np.flatnonzero(~shares.any(axis=1)):
        shares[i, main[i]] = 1.0
    return shares / shares.sum(axis=1, keepdims=True)


@kernel
def remaining(layout, effectiveness, i):
    """Remaining share of the authority about axis i, 0 to 1: sum_s authority_is effectiveness_s."""
    share = 0.0
    for s in range(effectiveness.size):
        share += layout.authority[i, s] * effectiveness[s]
    return share


@kernel
def attainable(G, layout, by_engines, i):
    """Least and greatest acceleration of axis i, rad/s2, within the travel [Durham1993]:

    sum_s min(G_is low_s, G_is high_s),    sum_s max(G_is low_s, G_is high_s)        by_engines added to both
    """
    least, greatest = by_engines[0, i], by_engines[1, i]
    for s in range(layout.low.size):
        at_low = G[i, s] * layout.low[s]
        at_high = G[i, s] * layout.high[s]
        least += min(at_low, at_high)
        greatest += max(at_low, at_high)
    return least, greatest


@kernel
def note_shortfall(axes, u, layout, lag, by_engines):
    """Fill the shortfall of the command u (n,) rad, and `beyond`, whether `hold` is not attainable:

        shortfall = demand - G (u + lag),    rad/s2

    axes: record of `allocation.axes_dtype`; lag (n,) rad: position of a slow surface less that of a healthy
    one.
    """
    for i in range(3):
        acceleration = 0.0
        for s in range(u.size):
            acceleration += axes.G[i, s] * (u[s] + lag[s])
        axes.shortfall[i] = axes.demand[i] - acceleration
        least, greatest = attainable(axes.G, layout, by_engines, i)
        axes.beyond[i] = not least <= axes.hold[i] <= greatest
