"""Means over a frame: what of them knows the readings of that frame."""

import numpy as np
import pytest

from beaver_ftc.diagnosis import belief as beliefs
from beaver_ftc.diagnosis.bounds.worst_case import bound_dtype


@pytest.mark.parametrize("instants", [1, 3])
def test_what_is_foreseen_has_the_effectiveness_of_the_frame_before(instants):
    """A reading that is off changes the moment of a command now, and what is foreseen of it a frame later."""
    rng, n = np.random.default_rng(instants), 4
    belief = np.zeros(1, beliefs.belief_dtype(n))[0]
    bound = np.zeros(1, bound_dtype(n))[0]
    belief["share"] = 1.0 / instants
    G, u = rng.uniform(0.5, 2.0, (5, 3, n)), rng.uniform(-0.3, 0.3, (5, n))
    for k in range(5):
        belief["sums"]["G"], belief["sums"]["Gu"] = instants * G[k], instants * G[k] * u[k]
        beliefs.elapse(belief, bound)
        beliefs.foresee(belief["means"])
        assert belief["means"]["Gu"] == pytest.approx(G[k] * u[k])
        if k > 0:
            assert belief["means"]["G_foreseen"] == pytest.approx(G[k - 1])
            assert belief["means"]["Gu_foreseen"] == pytest.approx(G[k - 1] * u[k])


def test_of_the_first_frame_nothing_is_foreseen():
    belief = np.zeros(1, beliefs.belief_dtype(2))[0]
    belief["share"] = 1.0
    belief["sums"]["G"][:, 0] = belief["sums"]["Gu"][:, 0] = 1.0
    beliefs.elapse(belief, np.zeros(1, bound_dtype(2))[0])
    beliefs.foresee(belief["means"])
    assert not belief["means"]["Gu_foreseen"].any()
