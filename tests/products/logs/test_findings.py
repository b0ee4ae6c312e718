"""What a verdict says, of rows and flights made by hand."""

import numpy as np
import pytest

from beaver_ftc_logs.findings import (
    fault_events,
    isolability_document,
    verdict_document,
)
from beaver_ftc_logs.regression import innovations
from given import given
from products.logs import small

GIVEN = given(__file__)

NAMES = ["right", "left"]
SOUND, HALF, LESS = ("", [1.0, 1.0]), ("left", [1.0, 0.5]), ("left", [1.0, 0.4])
PARTS = GIVEN["parts"]


@pytest.mark.parametrize("name", PARTS)
def test_rows_become_events(changed, name):
    assert not changed(fault_events(small.rows(PARTS[name]), NAMES))


@pytest.fixture(scope="module")
def flown():
    model = small.model(small.TAIL, settings={"alarm": 0.9})
    return model, small.flight(model, gap=150, notes=("a remark",), held_age_s={"roll": 0.123456})


def test_the_document_of_a_verdict(changed, flown):
    model, samples = flown
    rows = small.rows([(8, "", [1.0] * 3), (9, "elevator+right_aileron", [1.0, 0.5, 0.7])], 3)
    assert not changed(verdict_document(samples, model, rows))


def test_what_motion_alone_tells_is_what_is_left_of_the_regression(flown):
    """The Schur complement of the whole information matrix, trim of each axis and the other groups out."""
    model, samples = flown
    flight = innovations(samples, model)
    Z = flight.at(np.flatnonzero(flight.is_known)).columns().reshape(-1, 3 + len(model.groups))
    covariance = np.linalg.inv(Z.T @ Z)
    for group, entry in enumerate(isolability_document(samples, model)["groups"], 3):
        left = model.settings.power / covariance[group, group] / (len(Z) / 3) / samples.dt_s
        assert entry["information_per_s_of_its_motion"] == pytest.approx(left, rel=1e-9)
