"""Parts of the rivals a step at a time: what an effectiveness filter starts with, averages and names."""

from dataclasses import replace

import numpy as np
import pytest

from beaver_ftc.design.context import Context, Declared
from beaver_ftc.diagnosis import Measured
from beaver_ftc.diagnosis.rivals.effectiveness import (
    AugmentedEkf,
)
from beaver_ftc.diagnosis.rivals.observer import healthy_residual_std

DT, BOUND = 0.02, np.array([0.02, 0.03, 0.05])
GUSTY = Declared(
    noise=np.array([3e-3, 2e-3, 1e-3, 0.0, 0.0, 0.0, 0.0]), resolution=np.full(7, 0.01),
    gust_rad_s=np.array([0.05, 0.03, 0.02]), gust_time_s=np.array([0.8, 0.4, 0.3]),
    gust_effect=np.arange(9.0).reshape(3, 3), model_rad_s2=np.array([0.04, 0.0, 0.1]),
)  # fmt: skip
# In no order of the axes: a place among the surfaces is none among the axes.
SURFACES, LEADING = ("flap", "rudder", "aileron", "elevator"), (2, 3, 1)


def context(declared=None, **options):
    travel = np.array([[-1.0] * 4, [1.0] * 4])
    return Context(DT, 1, None, np.zeros(3), np.zeros(5), np.zeros(4), travel, BOUND, np.zeros(3),
                   options=options, declared=declared or Declared(), surfaces=SURFACES,
                   leading=LEADING)  # fmt: skip


class Curved:
    """A design model with slopes and squares of every rate."""

    A = np.array([[-2.0, 0.3, 0.1], [0.2, -3.0, 0.4], [-0.5, 0.6, -1.0]])

    def f(self, x, y):
        return x @ self.A.T + 0.5 * x**2 + y[0]


def moving():
    """What is measured of a flight in which everything moves, and a context in which the air does."""
    x, contribution = np.array([0.3, -0.2, 0.1]), np.random.default_rng(4).normal(size=(3, 4))
    measured = Measured(1.0, x, np.array([0.7, 0, 0, 0, 0]), np.array([0.5, 0.6, -0.7]), contribution, BOUND)
    return measured, replace(context(GUSTY), model=Curved())


def test_the_extended_filters_transition_is_its_models_slopes():
    """[[1 + dt df/dx, dt G_s u_s, dt B], [0, 1, 0], [0, 0, decay]]."""
    measured, detector = moving()[0], AugmentedEkf()
    detector.reset(moving()[1])
    expected = np.eye(9)
    expected[:3, :3] += DT * (Curved.A + np.diag(measured.x))
    expected[:3, 3:6] = DT * measured.contribution[:, LEADING]
    expected[:3, 6:] = DT * GUSTY.gust_effect
    expected[6:, 6:] = np.diag(np.exp(-DT / GUSTY.gust_time_s))
    assert detector.jacobian(measured) == pytest.approx(expected, abs=1e-9)


def test_the_deviation_of_a_residual_has_that_of_the_model_the_gyro_and_the_air():
    """A steady error of the model is kept by dt / (1 - a); of gusts the variance is summed frame by frame."""
    a, n = 0.8, 400
    found = healthy_residual_std(replace(context(GUSTY), constant_rad_s2=np.array([0.0, 0.03, 0.05])), a)
    model = np.hypot([1e-4, 0.03, 0.05], GUSTY.model_rad_s2) * DT / (1.0 - a)
    lag = np.abs(np.subtract.outer(np.arange(n), np.arange(n)))
    weight = a ** np.arange(n)
    air = [
        DT * sigma * np.sqrt(weight @ np.exp(-DT * lag / tau) @ weight)
        for sigma, tau in zip(GUSTY.turbulence_rad_s2, GUSTY.turbulence_time_s, strict=True)
    ]
    noise = np.convolve(weight, [1.0, -1.0])[:n]  # of n[k] - n[k-1] through the filter
    gyro = GUSTY.gyro_rad_s * np.sqrt(noise @ noise)
    assert found == pytest.approx(np.sqrt(model**2 + np.square(air) + gyro**2), rel=1e-9)
