"""Identification of a vehicle whose coefficients are known."""

import numpy as np

from products.logs import synthetic


def test_the_responses_are_those_of_the_vehicle(wing_model):
    true = np.array([synthetic.RIGHT, synthetic.LEFT])
    found = np.array(wing_model.response)[:, :3]
    error = np.abs(found - true) / np.array(wing_model.response_sd)[:, :3]
    assert error.max() < 4.5
    assert np.abs(found - true).max() < 0.06


def test_what_the_labels_say_becomes_the_prior(wing_model):
    assert wing_model.settings.levels == {"right": [0.4], "left": [0.5]}
