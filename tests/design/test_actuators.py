"""A surface's way to its command, one JSBSim frame at a time, against the same in arrays."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from beaver_ftc.design.model import actuators_dtype, move, nearer

LOW, HIGH = np.array([-0.5, -0.4, -0.3, -0.1]), np.array([0.5, 0.4, 0.3, 1.0])
anywhere = st.lists(st.floats(-1.5, 1.5), min_size=4, max_size=4).map(np.array)


def actuators(real=1):
    record = np.zeros(1, actuators_dtype(4))[0]
    record["real"], record["low"], record["high"] = real, LOW, HIGH
    record["approach"], record["step"] = [0.2, 1.0, 0.5, 0.1], [0.01, 0.02, np.inf, 0.005]
    return record


@given(anywhere, anywhere)
def test_lag_then_rate_then_stops(command, u):
    record, there = actuators(), np.clip(u, LOW, HIGH)
    way = (np.clip(command, LOW, HIGH) - there) * record["approach"]
    expected = np.clip(there + np.clip(way, -record["step"], record["step"]), LOW, HIGH)
    move(record, command, there)
    assert there == pytest.approx(expected, abs=1e-15)


def test_an_ideal_surface_is_where_it_is_told_to_be():
    u = np.zeros(4)
    move(actuators(real=0), np.array([2.0, -2.0, 0.1, 0.2]), u)
    assert list(u) == [2.0, -2.0, 0.1, 0.2]


@given(st.floats(-1, 1), st.floats(-1, 1), st.floats(-1, 1), st.floats(0, 1), st.floats(0, 0.5))
def test_it_rises_with_where_it_was_and_never_passes_what_is_wanted(one, other, wanted, approach, step):
    low, high = sorted((one, other))
    assert nearer(low, wanted, approach, step) <= nearer(high, wanted, approach, step) + 1e-15
    there = nearer(one, wanted, approach, step)
    assert min(one, wanted) - 1e-15 <= there <= max(one, wanted) + 1e-15
    assert abs(there - one) <= step + 1e-15
