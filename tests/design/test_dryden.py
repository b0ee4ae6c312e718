"""The rotation of turbulent air against the integrals of its spectra [MIL-F-8785C; Yeager1998]."""

import numpy as np
import pytest
from scipy.integrate import quad

from beaver_ftc.design import SCALE_M, Dryden, rotation_lengths


@pytest.mark.parametrize("span_m", [2.09, 14.63])
def test_the_air_turns_as_the_slope_of_its_gusts_along_the_path(span_m):
    """Vertical and lateral gusts by Dryden's spectrum, each slope through a lag that the span sets."""
    air, V = Dryden("moderate"), 37.0
    sigma, lengths = air.sigma_mps, rotation_lengths(span_m)
    found, time_s = air.rotation(V, span_m)

    def spectrum(per_m, length):
        """Of the slope, (rad/m)^2 m; that of the gust holds sigma^2 over all wave numbers from 0 on."""
        x = (SCALE_M * per_m) ** 2
        gust = sigma**2 * SCALE_M / np.pi * (1.0 + 3.0 * x) / (1.0 + x) ** 2
        return gust * per_m**2 / (1.0 + (length * per_m) ** 2)

    for axis in (1, 2):
        variance = quad(spectrum, 0.0, np.inf, args=(lengths[axis],), limit=500)[0]
        assert found[axis] == pytest.approx(np.sqrt(variance), rel=1e-4)
    assert found[0] == pytest.approx(1.9 * sigma / np.sqrt(SCALE_M * span_m), rel=0.01)
    assert time_s * V == pytest.approx(lengths)
