"""Fuel that a sampled flight has burnt: as its engines burn it, and never more than there is."""

import math
from types import SimpleNamespace

import pytest

from beaver_ftc.plant.adapter import FlightState
from beaver_ftc_aircraft.derive.sample import Tanks

FULL_LBS = {"propulsion/tank[0]/contents-lbs": 300.0, "propulsion/tank[1]/contents-lbs": 100.0}
SETTINGS = {"throttle": SimpleNamespace(range=(0.0, 1.0))}


class Bench:
    """Two tanks and two engines that burn so many pounds a second together at full throttle."""

    n_engines = 2

    def __init__(self, flow_pps):
        self.aircraft = SimpleNamespace(engine=SimpleNamespace(settings=SETTINGS))
        self.tanks_lbs, self.state = FULL_LBS, {name: 0.9 * of for name, of in FULL_LBS.items()}
        self._flow_pps, self._throttle = flow_pps, 0.0

    def has(self, name):
        return name in self.state or name.startswith("propulsion/engine")

    def read(self, name):
        return self.state.get(name, 0.5 * self._flow_pps * self._throttle)

    def write(self, name, value):
        self.state[name] = value

    def start(self, state):
        self._throttle = state.settings["throttle"]


def left(flow_pps, age_s):
    """Pounds in each tank after a flight at full throttle; trim is at half of it."""
    bench = Bench(flow_pps)
    Tanks(bench, FlightState(45.0, 1000.0, settings={"throttle": 0.5})).fill(bench, age_s)
    return [bench.state[name] for name in FULL_LBS]


def test_what_is_burnt_comes_from_all_tanks_alike():
    """0.02 lbs/s for 1000 s are 20 of 400 lbs."""
    assert left(0.02, 1000.0) == pytest.approx([285.0, 95.0])
    assert left(0.02, 0.0) == list(FULL_LBS.values())


@pytest.mark.parametrize("age_s", [500.0, 7200.0, 1e9])
def test_no_tank_is_emptied(age_s):
    """A thirsty engine burns 400 lbs in 400 s: sampled is at least a tenth, never less than nothing."""
    assert left(1.0, age_s) == pytest.approx([30.0, 10.0])


@pytest.mark.parametrize("flow_pps", [0.0, math.nan])
def test_an_engine_whose_flow_is_not_known_burns_nothing(flow_pps):
    assert left(flow_pps, 7200.0) == list(FULL_LBS.values())
