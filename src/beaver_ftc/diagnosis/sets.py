"""Sets of a parameter that agree with what is observed: intervals (lo, hi), empty where lo > hi.

The parameter is an effectiveness, a position or an offset: isolation.py and types/ intersect its sets over
axes and frames, and exclude a fault once nothing is left.
"""

import numpy as np

from beaver_ftc.compiled import kernel

UNLIMITED_SET, EMPTY_SET = (-np.inf, np.inf), (np.inf, -np.inf)
NO_THETA = (1.0, -1.0)  # an empty set, too, but with ends to which an estimate can be limited


@kernel
def explain(nu, e, Z, lo, hi):
    """The theta of [lo, hi] with |nu - theta Z| <= e:

        [lo, hi] and [(nu -+ e) / Z] intersected      Z = 0: [lo, hi] if |nu| <= e, else NO_THETA

    nu, e rad/s2, or rad/s of a filtered residual; Z the same per unit of theta. lo > hi in the result: none.
    """
    if Z == 0.0:
        return (lo, hi) if abs(nu) <= e else NO_THETA
    a = (nu - e) / Z
    b = (nu + e) / Z
    return max(lo, min(a, b)), min(hi, max(a, b))


@kernel
def intersect(a, b):
    """What two sets a, b = (lo, hi) have in common: (max lo, min hi)."""
    return max(a[0], b[0]), min(a[1], b[1])
