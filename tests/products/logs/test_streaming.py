"""The loop's detectors on a recorded flight: what they are given is the identified model, in their words."""

import numpy as np
import pytest

from beaver_ftc_logs.loop_detectors import loop_detector_inputs


@pytest.fixture(scope="module")
def flown(sampled):
    return sampled(120.0, parts=((60, 120, 1.0, 0.3),), seed=21)


def by_hand(samples, model, k):
    """Residual of sample k and the groups' answers, from the coefficients of the model file."""
    past = samples.rates[k - model.history : k][::-1].ravel() @ np.array(model.past)
    u = samples.commands[k - model.lags : k][::-1]
    answers = [u[:, g] @ np.array(response) for g, response in enumerate(model.response)]
    return samples.rates[k] - model.intercept - past - sum(answers), answers


def test_the_innovation_is_the_residual_of_the_model(flown, wing_model):
    stream = loop_detector_inputs(flown, wing_model)
    dt_s = 1.0 / wing_model.rate_hz
    for k in (40, 333, 900):
        residual, answers = by_hand(flown, wing_model, k)
        now, before = stream[k][0], stream[k - 1][0]
        np.testing.assert_allclose(now.x - before.x - dt_s * now.acceleration, residual, atol=1e-12)
        for place, answer in enumerate(answers):
            np.testing.assert_allclose(dt_s * now.contribution[:, place], answer, atol=1e-12)
