"""The table of thrust of an aircraft whose force is its setting, newton for newton."""

import pytest

from beaver_ftc.aircraft import load
from beaver_ftc.plant.adapter import Plant
from beaver_ftc.plant.trim import trim
from beaver_ftc_aircraft.derive.thrust import thrust_of

from .known import TRAINER


@pytest.fixture(scope="module")
def measured():
    aircraft = load("./trainer", TRAINER.parent)
    plant = Plant(100, aircraft=aircraft)
    point = trim(50.0, 1500.0, plant=plant)
    return aircraft, thrust_of(plant, point), plant, point


def test_each_force_is_its_setting_at_every_airspeed(measured):
    aircraft, found, _, _ = measured
    assert found["airspeed_mps"][0] == aircraft.envelope.airspeed_mps[0]
    assert found["airspeed_mps"][-1] == aircraft.envelope.airspeed_mps[1]
    assert found["setting"] == pytest.approx([0, 600, 1200, 1800, 2400, 3000])
    for row in found["force_n"]:
        assert row == pytest.approx(found["setting"], rel=5e-3, abs=1.0)  # it flies 0.1 s meanwhile
    assert found["lag_s"] <= 0.1
