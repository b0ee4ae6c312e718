"""Air, error map, thresholds, the detector's noise of the moment and the scheme, a kernel at a time."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from beaver_ftc.design.model import design_record
from beaver_ftc.diagnosis import bounds

COUPLINGS = ("Ppq", "Pqr", "Qpp", "Qpr", "Qrr", "Rpq", "Rqr")
COMPONENT = st.floats(-1.0, 1.0)


@given(
    constants=st.lists(st.floats(-4.0, 4.0), min_size=7, max_size=7),
    x=st.tuples(COMPONENT, COMPONENT, COMPONENT),
    axis=st.tuples(COMPONENT, COMPONENT, COMPONENT).filter(lambda a: np.hypot(np.hypot(*a[:2]), a[2]) > 0.1),
)
def test_the_turning_earth_moves_no_aircraft_more_whatever_its_inertia(constants, x, axis):
    """The coupling is quadratic: of x + e it is that of x, and what both make together; e turns with x."""
    design, out, earth = design_record().view(np.recarray)[0], np.zeros(3), 7e-5
    for name, value in zip(COUPLINGS, constants, strict=True):
        design[name] = value
    Ppq, Pqr, Qpp, Qpr, Qrr, Rpq, Rqr = constants

    def coupling(p, q, r):
        return np.array(
            [Ppq * p * q + Pqr * q * r, Qpp * p * p + Qpr * p * r + Qrr * r * r, Rpq * p * q + Rqr * q * r]
        )

    e = earth * np.array(axis) / np.linalg.norm(axis)
    moved = coupling(*(np.array(x) + e)) - coupling(*x) + np.cross(e, x)
    bounds.add_published_bound(np.array(x), design, np.zeros(3), np.zeros(3), earth, out)
    assert (np.abs(moved) <= out).all()
