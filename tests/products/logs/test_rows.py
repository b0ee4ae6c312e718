"""From probabilities of hypotheses to rows: when a name stands, and which bounds hold."""

import numpy as np
import pytest

from beaver_ftc.documents.errors import BadInput
from beaver_ftc_logs import diagnose
from products.logs import small

SETTINGS = {"level_step": 0.25, "alarm": 0.5, "bounds": 0.8}
WING = small.model(settings=SETTINGS)


@pytest.mark.parametrize(("at_hz", "of_hz", "taken"), [
    (10.0, 8.0, True), (10.001, 8.0, False), (6.0, 8.0, True), (5.999, 8.0, False),
])  # fmt: skip
def test_a_log_may_be_a_quarter_off_the_rate(at_hz, of_hz, taken):
    samples, model = small.flight(WING, 20, dt_s=1.0 / at_hz), small.model(rate_hz=of_hz)
    if taken:
        assert diagnose.check_log_fits_model(samples, model) is None
        return
    with pytest.raises(BadInput, match=r"allowed: within 25% of the 8 Hz the model was identified at"):
        diagnose.check_log_fits_model(samples, model)


@pytest.mark.parametrize(("hold_s", "stands"), [
    (0.0, [0, 1, 1, 1, 1, 0, 1, 0]), (0.1, [0, 0, 1, 1, 1, 0, 0, 0]), (0.2, [0, 0, 0, 1, 1, 0, 0, 0]),
    (0.26, [0, 0, 0, 0, 1, 0, 0, 0]), (0.4, [0, 0, 0, 0, 0, 0, 0, 0]),
])  # fmt: skip
def test_a_condition_stands_once_it_has_held(hold_s, stands):
    model = small.model(settings={"hold_s": hold_s})
    raised = np.array([0, 1, 1, 1, 1, 0, 1, 0], dtype=bool)
    assert diagnose._held_long_enough(raised, model).astype(int).tolist() == stands
    assert diagnose._held_long_enough(raised[1:], model).astype(int).tolist() == stands[1:]


LEVELS = np.array([0.0, 0.25, 0.5, 1.0])


@pytest.mark.parametrize(("mass", "bounds"), [
    ([0.0, 0.9, 0.1, 0.0], (0.125, 0.375)),
    ([0.1, 0.5, 0.4, 0.0], (0.125, 0.75)),  # two hold it: half a step more each way
    ([0.8, 0.1, 0.1, 0.0], (0.0, 0.125)),  # just so much is enough
    ([0.79, 0.01, 0.0, 0.2], (0.0, 1.0)),
    ([0.1, 0.0, 0.0, 0.9], (0.75, 1.0)),
    ([0.3, 0.3, 0.3, 0.1], (0.0, 0.75)),
    ([0.4, 0.0, 0.5, 0.1], (0.0, 0.75)),  # what lies between is inside
])  # fmt: skip
def test_bounds_are_of_the_fewest_levels_that_hold_the_share(mass, bounds):
    low, high = diagnose._credible_bounds(LEVELS, np.array([mass]), 0.8)
    assert (low[0], high[0]) == bounds
