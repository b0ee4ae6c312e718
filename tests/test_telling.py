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
    apart(power=[float(record["power"][name]) for name in ("least", "greatest", "trim", "low")])
    apart(whole=[int(record["power"]["frames"]), int(record["probe"]["probed"]), int(record["law"])])
    apart(G=record["allocation"]["G"])
    other = fill(np.zeros(1, control_dtype(4))[0], seed=4)
    assert not np.isin(record["reference"]["model_rate"], other["reference"]["model_rate"]).any()
