"""What the log and the figures hold of the likelihood ratio tests."""

import numpy as np

from beaver_ftc.aircraft import load
from beaver_ftc.plant.channels import likelihoods
from flying import flown, loss

TACTICAL = {"sensors": "tactical-grade", "fdi": {"statistical": {}, "bounds": {"sensors": "tactical-grade"}}}


def test_the_elevator_leaves_the_alarm_level_and_nothing_else_did_before():
    flight, log = flown(duration_s=4, faults=[loss(magnitude=0.6, at_s=3.0)], **TACTICAL)
    assert log.columns[-6:] == list(likelihoods(load()))
    before = log["t_s"] < 3.0
    shares = log.rows[:, -6:]
    assert 0.2 < shares[before].max() < 1.0
    assert log["elevator_loss_likelihood_share"][-1] > 1.0
    assert np.flatnonzero(shares.max(axis=1) > 1.0)[0] == round(100 * flight.statistical["time_s"])
    assert flight.statistical["closest_approach"] >= shares[before].max()
