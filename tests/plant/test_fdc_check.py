"""The truth reproduces the FDC equations."""

from pathlib import Path

import numpy as np
import pytest
from tools.fdc_check import (
    DERIVATIVE_BAR,
    RESPONSE_BAR,
    derivative_agreement,
    derivatives,
    flight_state,
    read_table,
    response_agreement,
)

DATA = Path(__file__).parents[1] / "data"


def test_state_derivatives():
    agreement = derivative_agreement(DATA)
    assert {each.signal for each in agreement if each.bar is not None} == set(DERIVATIVE_BAR)
    assert [each for each in agreement if not each.met] == []


@pytest.mark.parametrize("surface", ["aileron", "elevator"])
@pytest.mark.parametrize("rate_hz", RESPONSE_BAR)
def test_doublet_response(surface, rate_hz):
    agreement = response_agreement(DATA, surface, rate_hz)
    assert len(agreement) == 12
    assert [each for each in agreement if not each.met] == []


def test_the_rate_of_sideslip_converges_to_the_FDC_one():
    """The implicit term: JSBSim's betadot and the force it makes agree with FDC's closed form."""
    found = {each.signal: each.error for each in derivative_agreement(DATA)}
    assert found["betadot_rad_s"] < 1e-3


def test_the_check_sees_a_wrong_sign(beaver):
    """The bars can fail: one derivative with its sign reversed is far beyond them."""
    table = read_table(DATA / "fdc_state_derivatives.csv")[:20]
    beaver.write("uncertainty/Cn_p-scale", -1.0)
    found = []
    for row in table:
        beaver.start(flight_state(row))
        found.append(derivatives(beaver)["rdot_rad_s2"])
    error = np.sqrt(
        np.mean((np.array(found) - table["rdot_rad_s2"]) ** 2) / np.mean(table["rdot_rad_s2"] ** 2)
    )
    assert error > 0.01
