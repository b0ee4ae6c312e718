"""A surface that trails freely: p = 0."""

import numpy as np

from beaver_ftc.compiled import kernel
from beaver_ftc.diagnosis.types import release

NAME = "float"
CONSTANT = True


@kernel
def begin(surface, kind):
    """Nothing is known yet."""
    release.start(surface, kind)


@kernel
def judge(fdi, surface, kind, frame):
    """It is at neutral."""
    release.holds(fdi, surface, kind, 0.0, 0.0)


@kernel
def let_go(fdi, surface, kind):
    """It may be let go at neutral."""
    low, high, _ = release.beginning(fdi, surface)
    release.let_go(surface, kind, max(low, 0.0), min(high, 0.0))


@kernel
def bring_back(fdi, surface, kind):
    """From neutral."""
    release.bring_back(fdi, surface, kind)


@kernel
def deflection(fdi, surface, kind):
    """At neutral."""
    return 0.0, 0.0


def estimate(fdi: np.void, s: int, kind: int) -> float | None:
    """Deflection, rad."""
    return 0.0
