"""Actuators and their failures, surface by surface, against closed forms."""

from math import exp

import numpy as np
import pytest

from beaver_ftc.design.fdc import SURFACES, TRAVEL
from beaver_ftc.plant.adapter import Plant

DT = 0.01
RUNAWAY_RATE = 1.0472  # rad/s, 60 deg/s


class Surface:
    """One surface of a trimmed Beaver, by short names."""

    def __init__(self, plant, name):
        self.plant, self.name = plant, name

    def command(self, rad, norm=0.0):
        self.plant.write(f"fcs/{self.name}-cmd-rad", rad)
        self.plant.write(f"fcs/{self.name}-cmd-norm", norm)

    def fail(self, **properties):
        for name, value in properties.items():
            self.plant.write(f"failures/{self.name}/{name.replace('__', '-')}", value)

    def actuator(self, bandwidth=0.0, rate_limit=0.0, dead_band=0.0):
        self.plant.write(f"actuators/{self.name}/bandwidth-rad_sec", bandwidth)
        self.plant.write(f"actuators/{self.name}/rate-limit-rad_sec", rate_limit)
        self.plant.write(f"actuators/{self.name}/dead-band-rad", dead_band)

    def run(self, frames=1):
        """Positions after each of so many frames."""
        positions = []
        for _ in range(frames):
            self.plant.run()
            positions.append(self.position)
        return np.array(positions)

    @property
    def position(self):
        return self.plant.read(f"fcs/{self.name}-pos-rad")

    @property
    def effective(self):
        return self.plant.read(f"fcs/{self.name}-effective-rad")


@pytest.fixture(params=SURFACES)
def surface(request, beaver):
    """Each surface in turn, at zero and ideal."""
    each = Surface(beaver, request.param)
    each.command(0.0)
    each.run()
    return each


@pytest.fixture
def travel(surface):
    return TRAVEL[surface.name]


def test_an_ideal_actuator_passes_the_command_in_the_same_frame_to_the_bit(surface, travel):
    for command in np.random.default_rng(1).uniform(travel.min_rad, travel.max_rad, 50):
        surface.command(command)
        assert surface.run() == [command]
        assert surface.effective == command


def test_position_stops(surface, travel):
    surface.command(5.0)
    assert surface.run() == [travel.max_rad]
    surface.command(-5.0)
    assert surface.run() == [travel.min_rad]


@pytest.mark.parametrize("norm", [-1.0, -0.3, 0.4, 1.0])
def test_normalised_command_adds_scaled_to_the_travel_on_its_side(surface, travel, norm):
    side = travel.max_rad if norm > 0 else -travel.min_rad
    surface.command(0.0, norm)
    assert surface.run() == pytest.approx([norm * side], abs=1e-15)
    surface.command(-0.01 * np.sign(norm), norm)
    assert surface.run() == pytest.approx([norm * side - 0.01 * np.sign(norm)], abs=1e-15)


@pytest.mark.parametrize("rate_hz", [100, 1000])
def test_lag_is_the_exact_exponential(trim_point, rate_hz):
    plant = Plant(rate_hz=rate_hz)
    plant.start(trim_point)
    elevator = Surface(plant, "elevator")
    start = elevator.position
    elevator.actuator(bandwidth=20.0)
    elevator.command(0.1)
    t = np.arange(1, 31) / rate_hz
    assert elevator.run(30) == pytest.approx(0.1 + (start - 0.1) * np.exp(-20 * t), abs=1e-14)


def test_rate_limit(surface):
    surface.actuator(rate_limit=0.5)
    surface.command(-0.06)
    assert surface.run(14) == pytest.approx(-np.minimum(0.005 * np.arange(1, 15), 0.06), abs=1e-15)


def test_lag_within_the_rate_limit(surface):
    surface.actuator(bandwidth=20.0, rate_limit=0.5)
    surface.command(0.09)
    steps = np.diff(surface.run(60), prepend=0.0)
    assert 0.09 * (1 - exp(-20 * DT)) > 0.5 * DT, "the case must reach the limit"
    assert steps.max() == pytest.approx(0.5 * DT, abs=1e-15)
    assert steps[-1] / steps[-2] == pytest.approx(exp(-20 * DT), rel=1e-6)


@pytest.mark.parametrize("failure", [{"stuck": 1, "stuck__at__rad": -0.09}, {"hardover": 1}, {"float": 1}])
@pytest.mark.parametrize(("bandwidth", "rate_limit"), [(20.0, 0.0), (0.0, 0.3), (15.0, 0.5)])
def test_a_repaired_surface_returns_by_its_own_dynamics(surface, failure, bandwidth, rate_limit):
    """After repair the position is that of a fresh actuator started where the failure left the surface."""
    surface.actuator(bandwidth, rate_limit)
    surface.fail(**failure)
    surface.command(0.02)
    x = surface.run(7)[-1]
    surface.fail(**dict.fromkeys(failure, 0))
    for position in surface.run(40):
        step = (0.02 - x) * (1 - exp(-bandwidth * DT) if bandwidth else 1)
        x += np.clip(step, -rate_limit * DT, rate_limit * DT) if rate_limit else step
        assert position == pytest.approx(x, abs=1e-13)


def test_rate_scale_slows_the_actuator(surface):
    surface.actuator(rate_limit=0.5)
    surface.fail(rate__scale=0.2)
    surface.command(0.09)
    assert surface.run(20) == pytest.approx(0.5 * 0.2 * DT * np.arange(1, 21), abs=1e-15)


def test_a_slow_actuator_with_no_declared_limit_has_a_share_of_the_runaway_rate(surface):
    surface.fail(rate__scale=0.1)
    surface.command(0.09)
    assert surface.run(20) == pytest.approx(0.1 * RUNAWAY_RATE * DT * np.arange(1, 21), abs=1e-15)
    surface.fail(rate__scale=0.0)
    surface.command(-0.09)
    where = surface.position
    assert (surface.run(20) == where).all()


@pytest.mark.parametrize("bandwidth", [0.0, 10.0])
def test_a_dead_band_is_left_between_command_and_surface(surface, bandwidth):
    """Within it nothing moves; beyond it the surface goes to where it begins, by its lag."""
    surface.actuator(bandwidth, dead_band=0.02)
    surface.command(0.015)
    assert surface.run(20) == pytest.approx(np.zeros(20), abs=0.0)
    surface.command(0.05)
    share = 1.0 - exp(-bandwidth * DT) if bandwidth else 1.0
    expected = 0.03 * (1.0 - (1.0 - share) ** np.arange(1, 21))
    assert surface.run(20) == pytest.approx(expected, abs=1e-12)
    surface.command(0.05 - 0.03)
    assert surface.run(3) == pytest.approx(expected[-1] * np.ones(3), abs=1e-12)
    surface.fail(hardover=1)
    assert surface.run(200)[-1] == TRAVEL[surface.name].max_rad
