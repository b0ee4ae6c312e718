"""The truth reproduces the FDC equations."""

import pytest
from tools.fdc_check import DERIVATIVE_BAR, RESPONSE_BAR, derivative_agreement, response_agreement


def test_state_derivatives():
    agreement = derivative_agreement()
    assert [each.signal for each in agreement] == [*DERIVATIVE_BAR]
    assert [each for each in agreement if not each.met] == []


@pytest.mark.parametrize("surface", ["aileron", "elevator"])
@pytest.mark.parametrize("rate_hz", RESPONSE_BAR)
def test_doublet_response(surface, rate_hz):
    agreement = response_agreement(surface, rate_hz)
    assert len(agreement) == 12
    assert [each for each in agreement if not each.met] == []
