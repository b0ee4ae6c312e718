"""The check of fixtures finds what would hide a mistake, and what is made for fixtures passes it."""

import numpy as np
import pytest

from beaver_ftc.control.state import control_dtype
from telling import alike, apart, fill, numbers


@pytest.mark.parametrize(
    ("values", "says"),
    [
        ([1.0, -2.0, 0.5], []), ([0.0, 1.0], ["[0] is 0"]), ([-0.3, 0.3], ["[0] and [1] are of one size"]),
        ([[1.0, 2.0], [3.0, 2.0]], ["[0, 1] and [1, 1] are of one size"]), (0.0, ["[] is 0"]), (4.0, []),
    ],
)  # fmt: skip
def test_zeros_and_pairs_of_one_size_are_said(values, says):
    assert alike(values) == says


def test_a_fixture_that_hides_is_refused_by_name():
    with pytest.raises(AssertionError, match=r"^travel\[0\] and \[1\] are of one size$"):
        apart(travel=[-0.5, 0.5], gains=[1.0, 2.0], zeros=("noise",), noise=[0.0, 1.0])


@pytest.mark.parametrize("shape", [(1,), (4,), (3, 4), (200,)])
def test_numbers_tell_apart(shape):
    made = numbers(*shape, seed=len(shape), size=0.1)
    assert made.shape == shape
    apart(made=made)
    assert (np.abs(made) >= 0.1).all()
    assert (np.abs(made) <= 0.3).all()


def test_a_filled_record_has_no_number_twice():
    record = fill(np.zeros(1, control_dtype(4))[0], seed=3)
    power = record["power"]
    set_points = [power["output"]["least"], power["output"]["greatest"]]
    apart(power=[float(number) for number in (*set_points, power["config"]["trim"], power["config"]["low"])])
    numbers_of = power["output"]["frames"], record["probe"]["memory"]["probed"], record["config"]["law"]
    apart(whole=[int(number) for number in numbers_of])
    apart(G=record["axes"]["G"])
    other = fill(np.zeros(1, control_dtype(4))[0], seed=4)
    assert not np.isin(
        record["reference"]["output"]["model_rate"], other["reference"]["output"]["model_rate"]
    ).any()
