from dataclasses import replace

import pytest

from beaver_ftc.plant.adapter import Plant
from beaver_ftc.plant.trim import trim


@pytest.fixture(scope="session")
def trim_point():
    return trim(45.0, 1828.8)


@pytest.fixture
def beaver(trim_point):
    """A Beaver at 100 Hz, trimmed at 45 m/s and 1828.8 m."""
    plant = Plant(rate_hz=100)
    plant.start(trim_point)
    return plant


@pytest.fixture
def banked(trim_point):
    """The same in a state where nothing is zero: angles, rates, surfaces, rate of sideslip."""
    plant = Plant(rate_hz=100)
    plant.start(
        replace(
            trim_point,
            beta_rad=0.05,
            p_rad_s=0.3,
            q_rad_s=-0.2,
            r_rad_s=0.15,
            phi_rad=0.4,
            psi_rad=1.1,
            aileron_rad=0.06,
            elevator_rad=-0.08,
            rudder_rad=0.07,
            flap_rad=0.2,
        )
    )
    return plant
