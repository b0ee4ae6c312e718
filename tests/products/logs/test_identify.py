"""Identification of a vehicle whose coefficients are known."""

import numpy as np

from beaver_ftc_logs.fitting import usable_mask
from beaver_ftc_logs.samples import load_flights_for_fit
from products.logs import synthetic


def test_the_responses_are_those_of_the_vehicle(wing_model):
    true = np.array([synthetic.RIGHT, synthetic.LEFT])
    found = np.array(wing_model.command_response)[:, :3]
    error = np.abs(found - true) / np.array(wing_model.response_error)[:, :3]
    assert error.max() < 4.5
    assert np.abs(found - true).max() < 0.06


def test_what_the_labels_say_becomes_the_prior(wing_model):
    assert wing_model.settings.likely_levels == {"right": [0.4], "left": [0.5]}


def test_edges_of_labels_are_not_fitted(wing, wing_folder):
    flown = synthetic.fly(60.0, parts=((30, 40, 1.0, 0.5),))
    flown["left_effectiveness"][:50] = np.nan
    samples = load_flights_for_fit([synthetic.write_csv(wing_folder / "edges.csv", flown)], wing)[0]
    use, t_s = usable_mask(samples), samples.t_s
    assert not use[t_s < 5.0].any()
    assert not use[np.abs(t_s - 30.0) < 1.4].any()
    assert use[(t_s > 32) & (t_s < 38)].all()
