"""Sets of a parameter that agree with what is observed: intervals (lo, hi), empty where lo > hi.

The parameter is an effectiveness, a position or an offset: isolation.py and types/ intersect its sets over
axes and frames, and exclude a fault once nothing is left.
"""

import numpy as np

from beaver_ftc.compiled import kernel

UNLIMITED_SET, EMPTY_SET = (-np.inf, np.inf), (np.inf, -np.inf)
NO_THETA = (1.0, -1.0)  # an empty set with ends that an estimate can be limited to


@kernel
def explain(nu, e, Z, lo, hi):
    """The theta of [lo, hi] with |nu - theta Z| <= e."""
    if Z == 0.0:
        return (lo, hi) if abs(nu) <= e else NO_THETA
    a = (nu - e) / Z
    b = (nu + e) / Z
    return max(lo, min(a, b)), min(hi, max(a, b))


@kernel
def intersect(a, b):
    """What two sets have in common."""
    return max(a[0], b[0]), min(a[1], b[1])
