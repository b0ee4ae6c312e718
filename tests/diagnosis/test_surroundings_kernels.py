"""Air, error map, thresholds, the detector's noise of the moment and the scheme, a kernel at a time."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from kernels import fill, new_fdi

from beaver_ftc.design.model import design_record
from beaver_ftc.diagnosis import bounds
from beaver_ftc.diagnosis.bounds import map_dtype

V = 45.0
Y = np.array([0.1, 0.03, V, 1036.0, 0.3, 0.0, 0.0, 0.0])


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


def new_map(**fields):
    record = np.zeros(1, map_dtype(4)).view(np.recarray)[0]
    record["n_boxes"], record["n_levels"], record["n_rows"] = 2, 3, 2
    record["outside"] = 7
    record["lo"], record["hi"] = -1e6, 1e6
    record["lo"][0, 0], record["hi"][0, 0] = -0.1, 0.1  # the inner box by roll rate
    record["lo"][1, 5], record["hi"][1, 5] = 30.0, 60.0  # the outer one by airspeed
    record["share"][:3], record["until_s"][:2] = (0.25, 0.5, 1.0), (10.0, 60.0)
    record["stop_lo"], record["stop_hi"] = (-0.4, -0.4, -0.2, -0.1), (0.2, 0.4, 0.4, 1.0)
    record["e"] = np.arange(record["e"].size).reshape(record["e"].shape) / 1000.0
    return fill(record, **fields)


@pytest.mark.parametrize(
    ("u", "level"),
    [
        ((0.0, 0, 0, 0), 0), ((0.05, 0, 0, 0), 0), ((0.0501, 0, 0, 0), 1), ((-0.1, 0, 0, 0), 0),
        ((-0.11, 0, 0, 0), 1), ((0, 0.2, 0, 0), 1), ((0, 0.21, 0, 0), 2), ((0, 0, -0.06, 0), 1),
        ((0, 0, 0, 0.25), 0), ((0, 0, 0, -0.1), 2),
    ],
)  # fmt: skip
def test_the_level_is_the_first_share_of_the_travel_that_covers_the_surfaces(u, level):
    exact, off = np.zeros(len(u)), np.full(len(u), 0.07)
    assert bounds.level_of_positions(new_map(), np.array(u), exact) == level
    assert bounds.level_of_positions(new_map(two_free=1), np.array(u), exact) == 2
    either = [bounds.level_of_positions(new_map(), np.array(u) + side * off, exact) for side in (-1, 0, 1)]
    assert bounds.level_of_positions(new_map(), np.array(u), off) == max(either)


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
    assert bounds.share_used(error_map, 1, where, before, instants) == pytest.approx(share)
    error_map["stop_lo"][1], error_map["stop_hi"][1] = 0.0, 0.0  # a travel that ends at neutral
    beyond = float(where[0] < 0.0 or where[1] > 0.0)
    assert bounds.share_used(error_map, 1, where, 0.0, 1) == beyond


@pytest.mark.parametrize(
    ("roll", "airspeed", "time_s", "box"),
    [
        (0.1, 45.0, 5.0, 0),
        (0.11, 45.0, 20.0, 1),
        (-0.1, 90.0, 5.0, 0),
        (0.11, 61.0, 5.0, None),
        (0.0, 45.0, 61.0, None),
    ],
)
def test_the_error_is_that_of_the_innermost_box_or_unknown(roll, airspeed, time_s, box):
    record = new_map(time_s=time_s)
    y = Y.copy()
    y[2] = airspeed
    bounds.look_up_map(record, np.array([roll, 0.0, 0.0]), y, np.array([0.1, 0, 0, 0]), np.zeros(4))
    age = 0 if time_s <= 10.0 else 1
    expected = record["e"][age, box, 1] if box is not None else bounds.UNMAPPED_ERROR_RAD_S2
    assert record["e_now"] == pytest.approx(np.full(3, expected))
    assert record["outside"] == (box is None)
    assert record["coordinates"][:7] == pytest.approx(
        [roll, 0, 0, 0.1, 0.03, airspeed, 2.0 * 1036.0 / airspeed**2]
    )
