"""Each rival detector on its own ground: a plant for which what it assumes is true."""

import numpy as np
import pytest

from beaver_ftc.design.context import Context, DeclaredErrors
from beaver_ftc.diagnosis import Measured
from beaver_ftc.diagnosis.rivals.rls import InputOutputPredictionTest
from beaver_ftc.plugins import DETECTORS, plugin_class

DT, AT_S = 0.01, 5.0
BOUND = np.full(3, 0.02)
FILTERS = ("augmented-ekf", "augmented-ukf", "multiple-models", "observer-constant")


class Still:
    """A design model of an aircraft without dynamics of its own: xdot = G u + noise."""

    def f(self, x, y):
        return np.zeros_like(x)

    def G(self, y):
        return np.zeros((3, 4))


class Damped(Still):
    """The same with rate damping and couplings: xdot = D x + G u."""

    D = np.array([[-8.0, 0.0, 2.0], [0.0, -4.0, 0.0], [-0.3, 0.5, -1.0]])

    def f(self, x, y):
        return x @ self.D.T


def context(declared=None, model=None, **options):
    limits = np.array([[-1.0] * 4, [1.0] * 4])
    return Context(DT, 1, model or Still(), np.zeros(3), np.zeros(5), np.zeros(4), limits, BOUND, np.zeros(3),
                   options=options, declared=declared or DeclaredErrors())  # fmt: skip


GUSTY = DeclaredErrors(
    noise=np.array([3e-4] * 3 + [0.0] * 4),
    gust_rad_s=np.array([0.05, 0.03, 0.03]),
    gust_time_s=np.array([0.8, 0.4, 0.3]),
    gust_effect=np.array([[5.0, 0.0, -2.0], [0.0, 3.0, 0.3], [0.9, -0.2, 0.5]]),
)


def flight(theta=(0.0, 0.0, 0.0), at_s=AT_S, noise=0.02, extra=0.0, duration_s=10.0, seed=1, air=None):
    """Yield what a detector sees of a plant with white acceleration noise and lost effectiveness from at_s
    on.

    theta: per surface; the surfaces swing at different rates, so that they can be told apart. air: gyro
    noise and gusts, as declared.
    """
    rng = np.random.default_rng(seed)
    x = np.zeros(3)
    air = air or DeclaredErrors(gust_time_s=np.ones(3))
    gust, keep = air.gust_rad_s * rng.normal(size=3), np.exp(-DT / air.gust_time_s)
    moments, acceleration, contribution = np.zeros(3), np.zeros(3), np.zeros((3, 4))
    for k in range(round(duration_s / DT)):
        t = k * DT
        seen = x + air.noise[:3] * rng.normal(size=3)
        yield Measured(t, seen, np.zeros(5), acceleration, contribution, BOUND)
        moments = np.sin(2.0 * np.pi * np.array([0.3, 0.4, 0.5]) * t + 1.0)
        contribution = np.zeros((3, 4))
        contribution[range(3), range(3)] = moments
        acceleration = moments.copy()
        fault = (
            np.array(theta) * moments + extra * np.array([0.0, np.cos(7.0 * t), 0.0]) if t >= at_s else 0.0
        )
        x = x + DT * (acceleration + air.gust_effect @ gust + fault + noise * rng.normal(size=3))
        gust = keep * gust + np.sqrt(1.0 - keep**2) * air.gust_rad_s * rng.normal(size=3)


def watch(name, seen, declared=None, **options):
    """As the source has it, not as it was tuned."""
    detector = plugin_class(DETECTORS, name)()
    detector.reset(context(declared, **{**detector.defaults, **options}))
    verdicts, alarm_s = [], None
    for measured in seen:
        verdicts.append(detector.step(measured, np.zeros(4)))
        if verdicts[-1].detected and alarm_s is None:
            alarm_s = measured.t_s
    return detector, verdicts, alarm_s


@pytest.mark.parametrize("name", FILTERS)
@pytest.mark.parametrize(("surface", "place"), [("aileron", 0), ("elevator", 1), ("rudder", 2)])
def test_a_lost_surface_is_seen_and_named(name, surface, place):
    theta = np.zeros(3)
    theta[place] = -0.5
    _, verdicts, alarm_s = watch(name, flight(theta))
    assert alarm_s is not None
    assert AT_S <= alarm_s < AT_S + 1.5
    assert verdicts[-1].isolated == surface
    if name == "observer-constant":  # not for a frame either
        assert {v.isolated for v in verdicts} <= {None, surface}
    assert verdicts[-1].axis == "pqr"[place]
    assert verdicts[-1].estimate == pytest.approx(-0.5, abs=0.1)


@pytest.mark.parametrize("name", FILTERS)
def test_noise_within_the_declared_size_is_no_fault(name):
    for seed in range(3):
        _, verdicts, alarm_s = watch(name, flight(seed=seed))
        assert alarm_s is None
        assert max(v.statistic for v in verdicts) < 1.0


@pytest.mark.parametrize("name", FILTERS)
def test_something_no_surface_explains_is_not_blamed_on_one(name):
    _, verdicts, alarm_s = watch(name, flight(extra=2.0))
    assert alarm_s is not None
    assert verdicts[-1].isolated == "unanticipated"


@pytest.mark.parametrize("name", ["augmented-ekf", "augmented-ukf"])
def test_the_motion_of_an_aircraft_that_is_as_its_model_is_predicted_without_error(name):
    detector, model, x = plugin_class(DETECTORS, name)(), Damped(), np.zeros(3)
    detector.reset(context(model=model, **detector.defaults))
    acceleration = np.zeros(3)
    for k in range(300):
        detector.step(Measured(k * DT, x, np.zeros(5), acceleration, np.ones((3, 4)), BOUND), np.zeros(4))
        acceleration = model.f(x, None) + 3.0 * np.sin(np.array([9.0, 7.0, 5.0]) * k * DT)
        x = x + DT * acceleration
    assert detector.z[:6] == pytest.approx([*(x - DT * acceleration), 0.0, 0.0, 0.0], abs=1e-9)
    assert detector.mean_square == pytest.approx(3.0 * detector.fade**299, rel=1e-6)


@pytest.mark.parametrize("name", ["augmented-ekf", "augmented-ukf"])
def test_in_declared_air_the_estimate_is_still_as_good_as_the_filter_says(name):
    """Gusts are states of the filter: neither the effectiveness nor the gusts are believed too well known."""
    shares, gusts = [], []
    for seed in range(8):
        theta = 0.1 * np.random.default_rng(100 + seed).normal(size=3)  # as known at the start
        seen = flight(theta, at_s=0.0, seed=seed, duration_s=4, air=GUSTY)
        detector, _, _ = watch(name, seen, GUSTY, noise=1.0, drift_per_s=1e-6)
        deviation = np.sqrt(np.diagonal(detector.P))
        shares.append((detector.z[3:6] - theta) / deviation[3:6])
        gusts.append(detector.z[6:] / np.sqrt(np.maximum(GUSTY.gust_rad_s**2 - deviation[6:] ** 2, 1e-12)))
    assert np.sqrt(np.mean(np.square(shares))) == pytest.approx(1.0, abs=0.35)
    assert np.sqrt(np.mean(np.square(gusts))) == pytest.approx(1.0, abs=0.35)


@pytest.mark.parametrize("name", FILTERS)
def test_declared_air_is_no_fault_and_hides_a_large_one_only_for_a_while(name):
    level = {"alarm": 4.0} if name == "observer-constant" else {}  # in deviations, once errors are declared
    for seed in range(2):
        _, _, alarm_s = watch(name, flight(seed=seed, air=GUSTY), GUSTY, **level)
        assert alarm_s is None
    _, _, alarm_s = watch(name, flight((0.0, -1.0, 0.0), air=GUSTY), GUSTY, **level)
    assert AT_S <= alarm_s < AT_S + 2.0


def test_the_observers_residual_has_its_closed_form():
    """A constant unexplained acceleration c gives eps = dt c (1 - a^n) / (1 - a) after n frames."""
    detector = plugin_class(DETECTORS, "observer-constant")()
    detector.reset(context(pole_per_s=10.0, alarm=1e9))
    for k in range(51):
        x = np.array([0.0, 0.3 * DT * k, 0.0])
        detector.step(Measured(k * DT, x, np.zeros(5), np.zeros(3), np.zeros((3, 4)), BOUND), np.zeros(4))
    a = np.exp(-10.0 * DT)
    assert detector.filtered[1, 0] == pytest.approx(DT * 0.3 * (1 - a**50) / (1 - a))


def test_the_monitor_learns_any_second_order_pair_and_sees_it_change():
    """y[k] = 1.6 y[k-1] - 0.7 y[k-2] + b u[k-1]: predicted once learnt, an alarm when b halves."""
    rng = np.random.default_rng(5)
    pair, y, scores = InputOutputPredictionTest(0.999, 0.995, 1e-4), [0.0, 0.0], []
    u = rng.normal(size=3000)
    for k in range(2, 3000):
        b = 0.5 if k < 2500 else 0.25
        y.append(1.6 * y[-1] - 0.7 * y[-2] + b * u[k - 1] + 1e-3 * rng.normal())
        scores.append(pair.step(u[k], y[-1]))
    assert pair._model.weights[:2] == pytest.approx([1.6, -0.7], abs=0.02)
    assert max(scores[1500:2497]) < 8.0
    assert max(scores[2497:2510]) > 20.0
