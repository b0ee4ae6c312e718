"""The fit in steps: coefficients from accelerations, errors in boxes."""

import numpy as np
import pytest

from beaver_ftc_aircraft.derive import fit

from .known import aircraft, moving, states


@pytest.fixture(scope="module")
def trainer():
    return aircraft("mach", "engines_m")


@pytest.fixture(scope="module")
def samples(trainer):
    return states(trainer)


def test_coefficients_follow_from_the_accelerations_and_errors_from_the_coefficients(trainer, samples):
    """The error of the aircraft on its own accelerations is none; 0.001 more of a coefficient shows."""
    assert fit.errors_of(trainer, samples) == pytest.approx(np.zeros((400, 3)), abs=1e-12)
    beside = np.array([0.001, -0.002, 0.003])
    other = moving(trainer, samples, beside)
    change = [fit.moment_coefficients(of, trainer.mass, trainer) for of in (samples, other)]
    assert change[1] - change[0] == pytest.approx(np.tile(beside, (400, 1)), abs=1e-12)
    assert fit.errors_of(trainer, other) == pytest.approx(np.abs(other.rate - samples.rate), abs=1e-12)
    one = fit._accelerations(samples, trainer)
    size = samples.y[:, 3].mean() * 15.1
    assert one == pytest.approx([size * 10.4 / 1310.0, size * 1.48 / 1890.0, size * 10.4 / 2870.0])
