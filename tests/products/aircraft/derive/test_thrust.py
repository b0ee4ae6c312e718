"""The table of thrust of an aircraft whose force is its setting, newton for newton."""

from types import SimpleNamespace

import pytest

from beaver_ftc.aircraft import load
from beaver_ftc.plant.adapter import Plant
from beaver_ftc.plant.trim import trim
from beaver_ftc_aircraft.derive import thrust
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


class Turbine:
    """An engine that takes its time, and more of it the higher its setting; what else a plant does is not
    asked."""

    dt_s = 0.01
    aircraft = SimpleNamespace(trim=SimpleNamespace(throttle="throttle"))

    def __init__(self):
        self.wanted, self.force = 0.0, 0.0
        self.written = []

    def has(self, name):
        return name == thrust.OF_ENGINES

    def start(self, state):
        self.force = self.wanted = 0.0

    def hold(self, state):
        assert state == "trim"

    def write(self, name, value):
        assert name == "throttle"
        self.wanted = value
        self.written.append(value)

    def run(self):
        self.force += self.dt_s * (self.wanted - self.force) / (self.wanted / 3000.0)

    def read(self, name):
        return 2.0 * self.force + 7.0


def test_the_lag_is_that_of_a_step_within_the_range_of_the_settings():
    """From 0.4 to 0.7 of 1000 to 3000: the lag at the latter setting, 2400, is 0.8 s."""
    plant = Turbine()
    assert thrust._lag_s(plant, "trim", 1000.0, 3000.0) == pytest.approx(0.8, abs=0.11)
    assert list(dict.fromkeys(plant.written)) == [1800.0, 2400.0]
