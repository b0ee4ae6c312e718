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
