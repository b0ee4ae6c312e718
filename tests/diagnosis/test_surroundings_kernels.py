"""Air, error map, thresholds, the detector's noise of the moment and the scheme, a kernel at a time."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from kernels import new_fdi

from beaver_ftc.design.model import design_record
from beaver_ftc.diagnosis import bounds
from beaver_ftc.diagnosis.error_map import share_used

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


@pytest.mark.parametrize(
    ("where", "before", "instants", "share"),
    [
        ((-0.1, 0.1), 0.9, 1, 0.5), ((-0.05, 0.1), 0.9, 1, 0.25), ((0.1, 0.2), 0.0, 1, 0.5),
        ((-9.0, 0.0), 0.0, 1, 1.0), ((-0.1, 0.1), 0.5, 2, 1.0), ((-0.02, 0.02), 0.5, 11, 0.5),
        ((0.0, 0.1), 0.0, 11, 0.275), ((-0.1, 0.1), 0.0, 3, 0.75),
    ],
)  # fmt: skip
def test_the_share_of_its_travel_is_the_farthest_at_any_instant(where, before, instants, share):
    """Of n instants the first may be as before, p0; the others make up the mean: (n p - p0) / (n - 1)."""
    error_map = new_fdi()["bound"]["error_map"]
    error_map["stop_lo"][1], error_map["stop_hi"][1] = -0.2, 0.4
    assert share_used(error_map, 1, where, before, instants) == pytest.approx(share)
    error_map["stop_lo"][1], error_map["stop_hi"][1] = 0.0, 0.0  # a travel that ends at neutral
    beyond = float(where[0] < 0.0 or where[1] > 0.0)
    assert share_used(error_map, 1, where, 0.0, 1) == beyond
