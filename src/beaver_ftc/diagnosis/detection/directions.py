"""Projections on a direction, and the parity direction of each isolation estimator.

m (3,)      direction of length 1 in roll, pitch and yaw; other files project on directions of other sizes
v           vector; its `size`: bounds on the components of a vector
G (3, n)    effect of each surface, rad/s2 per rad
"""

import numpy as np

from beaver_ftc.compiled import kernel

ROUNDING_SHARE = 1e-9  # of the size of a projection, below which it is rounding


@kernel
def project(m, v):
    """m' v; m gives the number of components."""
    total = 0.0
    for j in range(m.size):
        total += m[j] * v[j]
    return total


@kernel
def project_size(m, size):
    """|m|' size: the bound on m' v."""
    total = 0.0
    for j in range(m.size):
        total += abs(m[j]) * size[j]
    return total


@kernel
def project_beyond_rounding(m, v):
    """m' v; 0 if v is orthogonal to m but for rounding: |m' v| <= ROUNDING_SHARE |m|' |v|."""
    total = size = 0.0
    for j in range(m.size):
        total += m[j] * v[j]
        size += abs(m[j] * v[j])
    return total if abs(total) > ROUNDING_SHARE * size else 0.0


@kernel
def set_directions(isolation, G):
    """Fix, once, the direction m = (G_r, 0, -G_p) / |.| along which the fault of each estimator has no effect
    at this G. m stays 0, and its test then excludes nothing, if the surface moves neither roll nor yaw.

    G (3, n) rad/s2 per rad: at the start of the flight; p: roll; r: yaw. m has unit length, in the roll-yaw
    plane, whose two axes are the only ones that one surface moves together. The bound is exact for any fixed
    direction; this one has power while G keeps its direction, which in the Beaver depends on alpha alone, and
    weakly.
    """
    for fie in isolation.estimator[: isolation.config.n_estimators]:
        Gp = G[0, fie.surface]
        Gr = G[2, fie.surface]
        norm = np.hypot(Gp, Gr)
        if norm > 0.0:
            fie.parity_direction[0] = Gr / norm
            fie.parity_direction[2] = -Gp / norm
