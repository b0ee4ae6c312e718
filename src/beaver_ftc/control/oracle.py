"""The oracle's knowledge: the true faults of this instant. The loop fills it; no other law reads it."""

from functools import lru_cache

import numpy as np

from beaver_ftc.compiled import kernel
from beaver_ftc.control.supervisor import MODE_ADAPTIVE, MODE_NOMINAL, MODE_REALLOCATED, MODE_UNANTICIPATED
from beaver_ftc.diagnosis.state import PITCH


@lru_cache
def true_faults_dtype(n: int) -> np.dtype:
    """present: 1 from the first fault on. effectiveness (n,): 1 healthy. immovable (n,): does not follow its
    command. effective (n,) rad: the deflection that acts. Cm_alpha3: the unanticipated pitching moment."""
    fields = [
        ("present", "i8"), ("Cm_alpha3", "f8"),
        ("effectiveness", "f8", (n,)), ("immovable", "i8", (n,)), ("effective", "f8", (n,)),
    ]  # fmt: skip
    return np.dtype(fields, align=True)


@kernel
def true_mode(control, faults):
    """The mode for a law that knows the true fault the moment it occurs."""
    if not faults.present:
        return MODE_NOMINAL
    if faults.Cm_alpha3 != 0.0:
        return MODE_UNANTICIPATED
    elevator = control.main[PITCH]
    if faults.effectiveness[elevator] < 1.0 or faults.immovable[elevator]:
        return MODE_REALLOCATED
    return MODE_ADAPTIVE


@kernel
def true_surface(control, faults, s, u):
    """Take the true effectiveness of surface s, none if it does not move, and what it is off besides.

    u rad: where it would be if healthy.
    """
    control.target[s] = 0.0 if faults.immovable[s] else faults.effectiveness[s]
    if faults.present:
        control.offset[s] = faults.effective[s] - control.target[s] * u
