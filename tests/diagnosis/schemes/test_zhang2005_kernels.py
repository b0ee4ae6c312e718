"""The kernels of the published scheme, by other roads: its network, its alarm and its estimators."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from beaver_ftc.diagnosis.detection import state_network

TRAVEL = np.array([[-0.52, -0.49, -0.44], [0.52, 0.49, 0.44]])
MAIN = np.arange(3)


def network(gain=60.0, limit=20.0):
    new = np.zeros(1, state_network.STATE_NETWORK_RECORD).view(np.recarray)[0]
    state_network.configure_network(new, gain, limit, TRAVEL)
    return new


def at(new, alpha=0.1, beta=0.0, x=(0.0, 0.0, 0.0), u=(0.0, 0.0, 0.0, 0.0)):
    state_network.evaluate_state_network(
        new, MAIN, np.array(x), np.array([alpha, beta, 45.0, 1000.0, 0.3]), np.array(u)
    )
    return new


def gaussians(centres, value):
    value = np.clip(value, centres[0], centres[-1])
    found = np.exp(-0.5 * ((centres - value) / (centres[1] - centres[0])) ** 2)
    return found / np.linalg.norm(found)


@given(st.floats(-0.3, 0.8), st.floats(-1, 1), st.floats(-1, 1), st.floats(-0.7, 0.7))
def test_the_basis_is_a_product_of_gaussians_of_x_and_u(alpha, beta, rate, deflection):
    new = at(network(), alpha, beta, (rate, -rate, rate), (deflection, -deflection, deflection, 0.0))
    for i, (angle, sign) in enumerate(((beta, 1), (alpha, -1), (beta, 1))):
        centres = np.linspace(-0.1, 0.5, 9) if i == 1 else np.linspace(-0.4, 0.4, 9)
        shares = np.linspace(TRAVEL[0, i], TRAVEL[1, i], 3)
        along = gaussians(np.linspace(-0.3, 0.3, 3), sign * rate), gaussians(shares, sign * deflection)
        expected = np.einsum("a,b,c->abc", gaussians(centres, angle), *along).ravel()
        np.testing.assert_allclose(new.memory.basis[i], expected, atol=1e-12)
        assert np.linalg.norm(new.memory.basis[i]) == pytest.approx(1.0)
