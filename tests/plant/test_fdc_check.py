"""The truth reproduces the FDC equations."""

from pathlib import Path

import pytest
from tools.fdc_check import (
    DERIVATIVE_BAR,
    RESPONSE_BAR,
    derivative_agreement,
    response_agreement,
)

DATA = Path(__file__).parents[1] / "data"


def test_state_derivatives():
    agreement = derivative_agreement(DATA)
    assert [each.signal for each in agreement] == [*DERIVATIVE_BAR]
    assert [each for each in agreement if not each.met] == []


@pytest.mark.parametrize("surface", ["aileron", "elevator"])
@pytest.mark.parametrize("rate_hz", RESPONSE_BAR)
def test_doublet_response(surface, rate_hz):
    agreement = response_agreement(DATA, surface, rate_hz)
    assert len(agreement) == 12
    assert [each for each in agreement if not each.met] == []
