"""What vanes and airspeed know of the air's rotation, against the same flight in the Earth's axes."""

import numpy as np
import pytest
from kernels import fill
from scipy.spatial.transform import Rotation

from beaver_ftc.aircraft import load
from beaver_ftc.diagnosis import gusts
from beaver_ftc.diagnosis.gusts import GUST_RECORD

AIRCRAFT = load()
SPAN, SCALE, ROLLING, GRAVITY, DT = AIRCRAFT.geometry.span_m, 40.0, 30.0, 9.8, 0.02
DOWN = np.array([0.0, 0.0, GRAVITY])


def new_air():
    record = np.zeros(1, GUST_RECORD).view(np.recarray)[0]
    fill(record, span=SPAN, gravity=GRAVITY, L_gust=SCALE, L_roll=ROLLING)
    return fill(record, gusty=1, measured=1)


def to_earth(attitude):
    return Rotation.from_euler("ZYX", np.asarray(attitude)[::-1])


def vanes(velocity):
    """(alpha, beta, V, ...) of a velocity through the air in body axes."""
    V = np.linalg.norm(velocity)
    return np.array([np.arctan2(velocity[2], velocity[0]), np.arcsin(velocity[1] / V), V, 1000.0, 0, 0, 0, 0])


class Flight:
    """Velocity of the aircraft and of the air in axes that stay with the Earth, an instant at a time."""

    def __init__(self, seed):
        self.rng = np.random.default_rng(seed)
        self.attitude = self.rng.uniform(-0.3, 0.3, 3)
        self.attitude[2] = np.pi + self.rng.uniform(-0.01, 0.01)  # where the heading wraps
        self.steps = np.array([0.02, 0.02, 0.06])
        self.velocity = to_earth(self.attitude).apply([45.0, 1.0, 3.0])
        self.wind, self.before = self.rng.normal(size=3), None

    def reading(self):
        attitude = self.attitude.copy()
        attitude[2] = np.angle(np.exp(1j * attitude[2]))
        return vanes(to_earth(self.attitude).inv().apply(self.velocity - self.wind)), attitude

    def step(self):
        """The force, m/s2 in body axes, of the step to the next instant."""
        pulled = 10.0 * self.rng.normal(size=3)
        force = to_earth(self.attitude).inv().apply(pulled - DOWN)
        before = pulled if self.before is None else self.before
        self.velocity = self.velocity + DT * (1.5 * pulled - 0.5 * before)
        self.before = pulled
        self.attitude = self.attitude + self.steps * self.rng.uniform(-1.0, 1.0, 3)
        self.wind = self.wind + self.rng.normal(size=3)
        return force


@pytest.mark.parametrize("seed", range(4))
def test_the_gust_followed_is_the_airs_own_change(seed):
    """Whatever aircraft and heading do: each lag keeps its share, and the change of the air's velocity, seen
    from the level axes of now, is added."""
    flight, record = Flight(seed), new_air()
    gusts.start_gust(record, *flight.reading())
    pitching = yawing = 0.0
    for _ in range(6):
        wind, axes_then = flight.wind, record["output"]["C"].copy()
        psi_then = flight.attitude[2]
        record["memory"]["f"] = flight.step()
        y, attitude = flight.reading()
        gusts.advance_gust(record, y, attitude, DT)
        change = Rotation.from_euler("z", -flight.attitude[2]).apply(flight.wind - wind)
        tau_q, tau_r = 4.0 * SPAN / (np.pi * y[2]), 3.0 * SPAN / (np.pi * y[2])
        pitching = np.exp(-DT / tau_q) * pitching + change[2] / (y[2] * tau_q)
        yawing = np.exp(-DT / tau_r) * yawing + change[1] / (y[2] * tau_r)
        assert record["memory"]["w"] == pytest.approx([0.0, pitching, yawing])
        # The axes of the gusts: level, along the heading of the instant before.
        axes = (to_earth(flight.attitude).inv() * Rotation.from_euler("z", psi_then)).as_matrix()
        assert record["output"]["C"] == pytest.approx(axes)
        assert record["memory"]["C_dot"] == pytest.approx((axes - axes_then) / DT)
