"""Standard air against its tables, and turbulence against its spectra [MIL-F-8785C; Yeager1998]."""

import numpy as np
import pytest
from scipy.integrate import quad

from beaver_ftc.design.atmosphere import altitude_of, standard_air, standard_density
from beaver_ftc.design.turbulence import SCALE_M, Dryden, rotation_lengths


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


@pytest.mark.parametrize(
    ("altitude_m", "hpa", "celsius", "kg_m3"),
    [(-500.0, 1074.78, 18.25, 1.28489), (0.0, 1013.25, 15.0, 1.225), (5000.0, 540.20, -17.5, 0.73612),
     (11000.0, 226.32, -56.5, 0.36392), (15000.0, 120.45, -56.5, 0.19367), (20000.0, 54.75, -56.5, 0.08803)],
)  # fmt: skip
def test_standard_air_is_that_of_the_tables_up_to_20_km(altitude_m, hpa, celsius, kg_m3):
    """[ISA] has pressure, temperature and density by altitude."""
    assert standard_air(altitude_m) == (pytest.approx(hpa, rel=2e-4), pytest.approx(celsius))
    assert standard_density(altitude_m) == pytest.approx(kg_m3, rel=2e-4)
    assert altitude_of(standard_density(altitude_m)) == pytest.approx(altitude_m, abs=1e-6)
