"""Each rival law on its own ground: what its theory promises of a plant it was made for."""

import numpy as np
import pytest

from beaver_ftc.control import Reference
from beaver_ftc.control.rivals.indi import IncrementalInversion
from beaver_ftc.control.rivals.l1 import Predictor
from beaver_ftc.control.rivals.lqr import gains
from beaver_ftc.design.context import Context
from beaver_ftc.diagnosis import Measured, Verdict
from beaver_ftc.loop.loop import fly
from beaver_ftc.plugins import LAWS, plugin_class
from flying import Memory, scenario

DT = 0.01
A = np.array([[-4.0, 0.0, 1.0], [0.0, -3.0, 0.0], [-0.2, 0.0, -0.8]])
G = np.array([[-9.0, 0.0, 0.5, 0.0], [0.0, -12.0, 0.0, 3.0], [-0.4, 0.0, -4.0, 0.0]])
LAW_NAMES = ("indi", "l1-adaptive", "lqr")


class Linear:
    """A design model xdot = A x + G u; order: which surface stands in each place."""

    def __init__(self, order=(0, 1, 2, 3)):
        self.order = list(order)

    def f(self, x, y):
        return A @ x

    def G(self, y):
        return G[:, self.order]


def context(order=(0, 1, 2, 3), trim_rad=(0.0, 0.0, 0.0, 0.0), **options):
    travel = np.array([[-0.5] * 4, [0.5] * 4])
    return Context(DT, 1, Linear(order), np.zeros(3), np.zeros(5), np.array(trim_rad)[list(order)], travel,
                   np.zeros(3), np.zeros(3), options=options,
                   leading=tuple(order.index(s) for s in range(3)))  # fmt: skip


def loop(name, effectiveness=1.0, disturbance=0.0, duration_s=20.0, **options):
    """Fly a law on the linear plant with the simulator's frame of delay; the error of each frame (n, 3)
    rad/s."""
    law = plugin_class(LAWS, name)()
    law.reset(context(**{**law.defaults, **options}))  # as the source has it, not as it was tuned
    x, u, acceleration, given, errors = np.zeros(3), np.zeros(4), np.zeros(3), np.zeros((3, 4)), []
    for k in range(round(duration_s / DT)):
        rate = np.full(3, 0.02)
        measured = Measured(k * DT, x.copy(), np.zeros(5), acceleration, given, np.zeros(3))
        command = law.step(measured, Reference(rate, rate, np.zeros(3)), Verdict())
        errors.append(rate - x)
        acceleration, given = A @ x + G @ u, G * u
        x = x + DT * (A @ x + effectiveness * (G @ u) + disturbance)
        u = command
    return np.array(errors)


@pytest.mark.parametrize("name", LAW_NAMES)
@pytest.mark.parametrize(("effectiveness", "disturbance"), [(1.0, 0.0), (1.0, 0.3), (0.5, 0.0), (0.6, -0.3)])
def test_a_constant_reference_is_reached_whatever_stands_in_the_way(name, effectiveness, disturbance):
    errors = loop(name, effectiveness, disturbance)
    assert np.abs(errors[-1]).max() < 2e-4
    assert np.abs(errors).max() < 1.0


def test_gains_minimise_the_cost():
    """Any other gain costs more, summed over a long run."""
    rng = np.random.default_rng(4)
    a, b, Q, R = np.array([[1.0, 0.1], [0.0, 0.9]]), np.array([[0.0], [0.1]]), np.eye(2), np.eye(1)
    best = gains(a, b, Q, R)

    def cost(K):
        z, total = np.array([1.0, -0.5]), 0.0
        for _ in range(2000):
            u = -K @ z
            total += z @ Q @ z + u @ R @ u
            z = a @ z + b @ u
        return total

    for _ in range(20):
        assert cost(best + 0.05 * rng.normal(size=best.shape)) > cost(best)


def test_the_predictor_finds_a_constant_disturbance_within_frames():
    """In one frame, to its e^{-a dt} dt / Phi: what piecewise-constant adaptation leaves [Hovakimyan2010]."""
    pole, d = 10.0, np.array([0.4, -0.2, 0.1])
    predictor = Predictor(pole, DT)
    first = predictor.step(DT * d, np.zeros(3))
    a = np.exp(-pole * DT)
    assert first == pytest.approx(a * DT * pole / (1.0 - a) * d)
    for _ in range(20):
        assert predictor.step(DT * d, np.zeros(3)) == pytest.approx(first)


@pytest.mark.parametrize("reach", [1.0, 0.2])
def test_incremental_inversion_sets_what_was_measured_against_the_positions_that_gave_it(reach):
    """Of an actuator that goes a share of its way in a frame, too: what is left is the disturbance alone."""
    law, d = IncrementalInversion(), np.array([0.3, -0.2, 0.1])
    law.reset(context(**law.defaults))
    rng = np.random.default_rng(5)
    Kp, Ki, pole = (law.defaults[key] for key in ("proportional_per_s", "integral_per_s2", "filter_per_s"))
    x, integral, position = np.zeros(3), np.zeros(3), np.zeros(4)
    keep = np.exp(-pole * DT)
    for k in range(30):
        x = x + (DT * (G @ position + d) if k else 0.0)
        rate, acceleration = rng.normal(size=(2, 3)) * 0.01
        seen = Measured(k * DT, x.copy(), np.zeros(5), np.zeros(3), G * position, np.zeros(3))
        command = law.step(seen, Reference(rate, rate, acceleration), Verdict())
        integral = integral + DT * (rate - x)
        nu = acceleration + Kp * (rate - x) + Ki * integral
        behind_both_filters = 1.0 - (1.0 + k * (1.0 - keep)) * keep**k  # of a step of 1
        assert G @ command == pytest.approx(nu - behind_both_filters * d, abs=1e-9)
        position = position + reach * (command - position)


@pytest.mark.parametrize("name", LAW_NAMES)
def test_the_beaver_follows_and_survives_half_an_elevator(name):
    fault = {"actuator": "elevator", "type": "loss_of_effectiveness", "magnitude": 0.5, "at_s": 6}
    log = Memory()
    flight = fly(scenario(duration_s=14, faults=[fault], control={"law": name}), log)
    assert flight.departure is None
    assert max(log.rms_deg_s(axis, 2, 6) for axis in "pqr") < 0.8
    assert log.rms_deg_s("q", 8) < 1.2
    assert [mode for _, mode in flight.supervisor] == ["nominal"]  # these laws do not use the verdict
