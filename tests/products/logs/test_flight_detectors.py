"""Least squares on small flights, by one batch; which detectors a flight may have."""

import numpy as np
import pytest

from beaver_ftc.documents.errors import BadInput
from beaver_ftc_logs import detectors
from beaver_ftc_logs.regression import innovations
from products.logs import small

WING = small.model(settings={"levels": {"left": [0.4, 0.8]}, "level_step": 0.25, "trim_sd": 0.3})
BARE = small.model()
LOST = ((1, 150, 400, 0.4),)
METHODS = {"sliding": "sliding-least-squares", "forgetting": "forgetting-least-squares"}


def batch(samples, model, k, forget):
    """Least squares of trim and lost effectiveness up to sample k, every one of them at once."""
    flight = innovations(samples, model)
    sd = np.sqrt(np.diag(model.noise))
    whiten = np.linalg.inv(np.linalg.cholesky(np.array(model.noise)))
    information, score = np.diag([1.0 / 0.3**2] * 3 + [4.0, 4.0]), np.zeros(5)
    for i in range(k + 1):
        age_s = (k - i) * samples.dt_s
        if not flight.is_known[i] or (not forget and age_s > 19.95):
            continue
        weight = np.exp(-age_s / 20.0) if forget else 1.0
        x = whiten @ np.column_stack([np.diag(sd), flight.F[i].T])
        y = whiten @ (flight.y[i] - np.array(model.intercept) - flight.F[i].sum(axis=0))
        information = information + weight * x.T @ x
        score = score + weight * x.T @ y
    covariance = np.linalg.inv(information)
    return 1.0 + (covariance @ score)[3:], np.sqrt(np.diag(covariance))[3:]


@pytest.mark.parametrize("name", METHODS)
def test_least_squares_by_one_batch(name):
    """Levels of a flight are those seen, or the nearest of the grid; bounds 1.645 sd away and around them."""
    samples = small.flight(WING, 400, lost=LOST, gap=250)
    rows = detectors.diagnose_with_detector(METHODS[name], samples, WING)
    for k in (60, 199, 200, 230, 399):
        value, sd = batch(samples, WING, k, name == "forgetting")
        levels = ([0.0, 0.25, 0.5, 0.75, 1.0], [0.4, 0.8, 1.0])
        nearest = [
            min(of, key=lambda level, v=v: abs(level - np.clip(v, 0, 1)))
            for v, of in zip(value, levels, strict=True)
        ]
        assert rows.effectiveness[k].tolist() == nearest
        low, high = (np.clip(value + side * 1.645 * sd, 0.0, 1.0) for side in (-1, 1))
        np.testing.assert_allclose(rows.effectiveness_low[k], np.minimum(low, nearest), atol=1e-9)
        np.testing.assert_allclose(rows.effectiveness_high[k], np.maximum(high, nearest), atol=1e-9)
        named = "+".join(side for side, level in zip(("right", "left"), nearest, strict=True) if level < 1.0)
        assert (rows.isolated_surfaces[k], rows.faulty[k], rows.fault_probability[k]) == (
            named,
            bool(named),
            bool(named),
        )
    assert rows.isolated_surfaces[399] == "left"


def test_detectors_of_flights_come_first_and_others_are_refused():
    names = detectors.detector_names()
    assert names[:3] == ["bank-of-filters", "sliding-least-squares", "forgetting-least-squares"]
    assert len(names) > 3
    with pytest.raises(BadInput, match="--detector banc: is not known"):
        detectors.check_detector_name("banc")
    slow = small.flight(BARE, 60, dt_s=0.2)
    with pytest.raises(BadInput, match="allowed: within 25% of the 10 Hz"):
        detectors.diagnose_with_detector(names[1], slow, BARE)
