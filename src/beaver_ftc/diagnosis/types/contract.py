"""What a fault type is: the parts its module may have, and what stands in for those it leaves out.

A module under `types/` describes one type of fault; a line in registry.py makes it known. It must have

    NAME        the type's name in scenarios, reports and metrics
    CONSTANT    whether its parameter is constant: what it says of one frame, the next can refute
    judge(fdi, surface, kind, frame)
                hold the type against the frame before the elapsed one, in which something was wrong: narrow
                surface.set_low[kind] to surface.set_high[kind], or set surface.type_excluded[kind]

and may have, all of them kernels but the last three,

    MEMORY      fields of a record of its own, found at `surface.<the module's name>`
    begin(surface, kind)                 nothing is known yet; its set is unlimited
    watch(fdi, surface, kind)            called for every frame, before it is judged
    pass_over(fdi, surface, kind)        called for a frame that is not judged
    let_go(fdi, surface, kind)           a repair may have released the surface as the judged frame began
    bring_back(fdi, surface, kind)       carry such a release on to the next frame (release.py)
    shown(surface)                       whether the type has shown itself, so that it can explain a flight
    deflection(fdi, surface, kind)       least and greatest deflection under it, rad; of a CONSTANT type
    estimate(fdi, s, kind)               its parameter: see findings.py; None without one
    interval(fdi, s, kind)               the set that parameter is certain to lie in, or None
    frequency_rad_s(fdi, s)              of what repeats itself, or None

`kind` is the type's number, the same in every array over types. surface: a record of dtype memory.surface.
"""

import numpy as np

from beaver_ftc.compiled import kernel

MEMORY: tuple[tuple, ...] = ()


@kernel
def begin(surface, kind):
    """Any parameter is possible."""


@kernel
def watch(fdi, surface, kind):
    """Nothing to keep."""


@kernel
def pass_over(fdi, surface, kind):
    """Nothing to keep."""


@kernel
def let_go(fdi, surface, kind):
    """The type does not hold the surface."""


@kernel
def bring_back(fdi, surface, kind):
    """The type does not hold the surface."""


@kernel
def shown(surface):
    """It explains a flight from the first frame on."""
    return True


@kernel
def deflection(fdi, surface, kind):
    """Anywhere within reach."""
    return surface.reach_low, surface.reach_high


def estimate(fdi: np.void, s: int, kind: int) -> float | None:
    """The type has no parameter to estimate."""
    return None


def interval(fdi: np.void, s: int, kind: int) -> tuple[float, float] | None:
    """The type has no parameter to estimate."""
    return None


def frequency_rad_s(fdi: np.void, s: int) -> float | None:
    """The type does not repeat itself."""
    return None
