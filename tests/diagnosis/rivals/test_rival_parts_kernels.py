"""Parts of the rivals a step at a time: what an effectiveness filter starts with, averages and names."""

from dataclasses import replace
from math import exp, sqrt

import numpy as np
import pytest

from beaver_ftc.design.context import Context, Declared
from beaver_ftc.diagnosis import Measured, rivals
from beaver_ftc.diagnosis.rivals.effectiveness import (
    N_STATES_WITHOUT_GUSTS,
    AugmentedEkf,
    AugmentedUkf,
    EffectivenessFilter,
)
from beaver_ftc.diagnosis.rivals.imm import (
    N_MODES,
    InteractingMultipleModels,
    transition_matrix,
)
from beaver_ftc.diagnosis.rivals.kalman import (
    TurbulenceModel,
    unexplained_acceleration_size,
    update_state_and_covariance,
)
from beaver_ftc.diagnosis.rivals.observer import ConstantThresholdObserver, healthy_residual_std
from beaver_ftc.diagnosis.rivals.rls import InputOutputPredictionTest, RecursiveLeastSquaresFit, RlsMonitor
from beaver_ftc.documents.errors import BadInput

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


def seen(x=(0.0, 0.0, 0.0), t_s=9.0, eta_bar=BOUND):
    return Measured(t_s, np.array(x), np.zeros(5), np.zeros(3), np.zeros((3, 4)), np.array(eta_bar))


class Plain(EffectivenessFilter):
    """A filter that predicts what it has."""

    name = "plain"

    def propagate(self, measured):
        pass

    def update_statistic(self, square):
        return square / 10.0


def started(declared=None, **options):
    detector = Plain()
    detector.reset(context(declared, **options))
    return detector


def test_the_air_is_a_first_order_process_of_each_axis():
    air, none = TurbulenceModel(context(GUSTY)), TurbulenceModel(context())
    keep = np.exp(-DT / GUSTY.gust_time_s)
    assert (air.n_states, none.n_states, none.a.size, none.rate_effect.shape) == (3, 0, 0, (3, 0))
    assert air.a == pytest.approx(keep)
    assert air.initial_variance == pytest.approx(GUSTY.gust_rad_s**2)
    # In the long run as large as it was at the start.
    assert keep**2 * air.initial_variance + air.process_noise_variance == pytest.approx(air.initial_variance)
    assert air.rate_effect == pytest.approx(DT * GUSTY.gust_effect)


def test_what_is_declared_adds_by_squares():
    gyro = np.hypot(GUSTY.noise[:3], 0.01 / sqrt(12.0))
    assert np.sqrt(GUSTY.rate_variance(0.004)) == pytest.approx(np.hypot(0.004, gyro))
    assert unexplained_acceleration_size(context(GUSTY), 9.0 * BOUND) == pytest.approx(
        np.hypot(BOUND, [0.04, 0.0, 0.1])
    )
    assert unexplained_acceleration_size(context(), 9.0 * BOUND).tolist() == (9.0 * BOUND).tolist()


def test_a_filter_starts_healthy_with_theta_known_to_a_tenth():
    detector = started(GUSTY, misfit_s=0.25, measurement_rad_s=0.004, drift_per_s=0.3)
    rates = GUSTY.rate_variance(0.004)
    assert (detector.n_states, detector.z.tolist()) == (N_STATES_WITHOUT_GUSTS + 3, [0.0] * 9)
    assert np.diag(detector.P) == pytest.approx([*rates, 0.01, 0.01, 0.01, *GUSTY.gust_rad_s**2])
    assert np.count_nonzero(detector.P) == 9
    assert pytest.approx(np.diag(rates)) == detector.R
    assert detector.theta_walk_variance == pytest.approx(0.3**2 * DT)
    assert detector.averaging_decay == pytest.approx(exp(-DT / 0.25))
    assert (detector.mean_normalised_innovation_square, detector.detected) == (3.0, False)
    assert started().n_states == N_STATES_WITHOUT_GUSTS


def test_its_noise_is_the_bounds_the_walks_and_the_airs():
    detector = started(GUSTY, noise=2.0, drift_per_s=0.3)
    size = unexplained_acceleration_size(detector.context, BOUND)
    expected = [
        *(DT * 2.0 * size) ** 2,
        *[0.3**2 * DT] * 3,
        *detector.turbulence_model.process_noise_variance,
    ]
    assert detector.process_noise_variances(seen()) == pytest.approx(expected)


def test_a_step_is_an_update_with_theta_kept_within_what_a_surface_can_be():
    """First it takes over what is measured; the square of the innovation is averaged, a wild one cut."""
    detector = started(misfit_s=0.1, measurement_rad_s=0.05)
    first = detector.step(seen((0.1, -0.2, 0.3)), np.zeros(4))
    assert (first.statistic, first.detected) == (0.0, False)
    assert detector.z.tolist() == [0.1, -0.2, 0.3, 0.0, 0.0, 0.0]
    detector.P[:3, 3:6] = detector.P[3:6, :3] = np.diag([0.01, -0.01, 0.002])
    z, P, square = detector.z.copy(), detector.P.copy(), 3.0
    for x in ((0.3, 0.4, 0.1), (0.2, 0.3, 0.2), (900.0, 0.0, 0.0)):
        nu = np.array(x) - z[:3]
        z, P, S = update_state_and_covariance(z, P, nu, detector.R)
        z[3:6] = np.clip(z[3:6], -1.0, 1.0)
        of_it = nu @ np.linalg.inv(S) @ nu
        square = exp(-DT / 0.1) * square + (1.0 - exp(-DT / 0.1)) * min(of_it, 1e6)
        detector.detected = False
        verdict = detector.step(seen(x), np.zeros(4))
        assert verdict.statistic == pytest.approx(of_it / 10.0)
        assert detector.z == pytest.approx(z)
        assert detector.mean_normalised_innovation_square == pytest.approx(square)
    assert np.abs(z[3:6]).max() == 1.0
    assert of_it > 1e6


def named(theta, variance=(0.01, 0.01, 0.01), square=3.0, statistic=2.0, **options):
    detector = started(**{"misfit": 3.0, **options})
    detector.z[3:6], detector.mean_normalised_innovation_square = theta, square
    detector.P[range(3, 6), range(3, 6)] = variance
    return detector, detector.latch_alarm_and_decide_verdict(seen(), statistic)


def test_the_surface_most_significantly_off_is_named():
    detector, verdict = named((-0.2, -0.5, -0.3), (0.01, 0.25, 0.01))
    assert detector.wald_statistics() == pytest.approx([4.0, 1.0, 9.0])
    assert (verdict.axis, verdict.isolated, verdict.type) == ("r", "rudder", "loss_of_effectiveness")
    assert verdict.estimate == pytest.approx(-0.3)
    assert verdict.effectiveness == pytest.approx([1.0, 0.7, 0.8, 0.5])
    assert verdict.statistic == 2.0
    quiet = named((-0.2, -0.5, -0.3), statistic=1.0)[1]
    assert (quiet.detected, quiet.isolated, quiet.statistic) == (False, None, 1.0)
    again = detector.latch_alarm_and_decide_verdict(seen(), 0.5)
    assert (again.detected, again.isolated) == (True, "rudder"), "an alarm is latched"


@pytest.mark.parametrize(
    ("theta", "square", "isolated"),
    [
        ((-0.5, 0.0, 0.0), 9.0, "aileron"), ((-0.5, 0.0, 0.0), 9.1, "unanticipated"),
        ((0.5, -0.1, 0.0), 3.0, "unanticipated"), ((0.1, -0.5, 0.2), 3.0, "elevator"),
    ],
)  # fmt: skip
def test_what_fits_no_surface_or_would_be_a_gain_is_outside_the_class(theta, square, isolated):
    verdict = named(theta, square=square)[1]
    assert verdict.isolated == isolated
    if isolated == "elevator":
        assert verdict.effectiveness == pytest.approx([1.0, 1.0, 1.0, 0.5]), "nothing has gained"


def test_a_pairs_score_is_of_errors_against_those_before():
    """The model of least_squares.py, and mean and variance of its errors, both fading."""
    rng, fade, floor = np.random.default_rng(5), 0.9, 0.01
    pair, model = InputOutputPredictionTest(0.98, fade, floor), RecursiveLeastSquaresFit(5, 0.98, 1e4)
    inputs, outputs = rng.normal(size=(2, 40))
    mean = variance = 0.0
    for k in range(40):
        past = [*(outputs[k - j] if k >= j else 0.0 for j in (1, 2)),
                *(inputs[k - j] if k >= j else 0.0 for j in (1, 2)), 1.0]  # fmt: skip
        error = model.step(np.array(past), outputs[k])
        assert pair.step(inputs[k], outputs[k]) == pytest.approx(
            abs(error - mean) / np.hypot(sqrt(variance), floor)
        )
        mean = fade * mean + (1.0 - fade) * error
        variance = fade * variance + (1.0 - fade) * (error - mean) ** 2
        assert (pair.error_mean, pair.error_variance) == pytest.approx((mean, variance))


class Scores:
    def __init__(self, *scores):
        self.scores, self.seen = list(scores), []

    def step(self, u, y):
        self.seen.append((u, y))
        return self.scores.pop(0)


def monitored(*scores, t_s=9.0, **options):
    """A monitor whose pairs (roll, pitch, yaw) score so."""
    monitor = RlsMonitor()
    monitor.reset(context(alarm=4.0, warm_up_s=4.0, **options))
    monitor.prediction_tests = [Scores(*of) for of in scores]
    return monitor, [monitor.step(seen(t_s=t_s), np.zeros(4)) for _ in scores[0]]


def test_the_first_pair_beyond_the_limit_is_the_fault():
    _, (quiet, at, alarm, later) = monitored((1.0, 4.0, 5.0, 0.1), (2.0, 1.0, 6.0, 0.2), (0.5, 1.0, 1.0, 9.0))
    assert (quiet.statistic, quiet.detected, at.statistic, at.detected) == (0.5, False, 1.0, False)
    assert (alarm.axis, alarm.isolated, alarm.candidates) == ("q", "elevator", ("elevator",))
    assert (later.isolated, later.statistic) == ("elevator", 2.25)
    _, (early,) = monitored((9.0,), (9.0,), (9.0,), t_s=3.9)
    assert (early.statistic, early.detected) == (0.0, False)
    _, (warm,) = monitored((9.0,), (5.0,), (5.0,), t_s=4.0)
    assert (warm.statistic, warm.isolated) == (2.25, "aileron")


def test_a_pair_is_the_command_of_the_surface_that_leads_an_axis_and_its_rate():
    monitor, _ = monitored((1.0, 0.2), (0.0, 0.2), (0.0, 0.2))
    for pair in monitor.prediction_tests:
        pair.seen.clear()
        pair.scores = [0.0]
    monitor.step(seen((0.1, -0.2, 0.3)), np.array([1.0, 2.0, 3.0, 4.0]))
    assert [pair.seen for pair in monitor.prediction_tests] == [[(3.0, 0.1)], [(4.0, -0.2)], [(2.0, 0.3)]]


def test_a_monitor_forgets_and_averages_over_its_times_and_doubts_a_gyro():
    monitor = RlsMonitor()
    monitor.reset(context(GUSTY, forgetting_s=2.0, score_s=0.5, floor_rad_s=0.004))
    floors = np.hypot(0.004, GUSTY.gyro_rad_s)
    assert [pair._min_error_std for pair in monitor.prediction_tests] == pytest.approx(list(floors))
    for pair in monitor.prediction_tests:
        assert pair._averaging_decay == pytest.approx(exp(-DT / 0.5))
        assert pair._model._forgetting_factor == pytest.approx(exp(-DT / 2.0))


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


def test_each_sigma_point_moves_by_the_model_its_losses_and_its_air():
    measured, detector = moving()[0], AugmentedUkf()
    detector.reset(moving()[1])
    points, model = np.random.default_rng(5).normal(0.0, 0.3, (19, 9)), Curved()
    expected = points.copy()
    for point, after in zip(points, expected, strict=True):
        turning = measured.acceleration + model.f(point[:3], measured.y) - model.f(measured.x, measured.y)
        turning = turning + measured.contribution[:, LEADING] @ point[3:6] + GUSTY.gust_effect @ point[6:]
        after[:3] += DT * turning
        after[6:] = np.exp(-DT / GUSTY.gust_time_s) * point[6:]
    assert detector.propagate_points(points, measured) == pytest.approx(expected)


def test_the_unscented_filters_statistic_sums_what_is_more_than_expected():
    detector = AugmentedUkf()
    detector.reset(context(allowance=2.0, alarm=4.0))
    assert [detector.update_statistic(square) for square in (10.0, 7.0, 1.0, 9.0)] == [1.0, 1.25, 0.0, 0.75]
    assert detector.update_statistic(9e9) == pytest.approx((3.0 + 1e6 - 6.0) / 4.0)


def test_what_turbulence_turns_adds_by_squares():
    swing = [sum((GUSTY.gust_effect[i, g] * GUSTY.gust_rad_s[g]) ** 2 for g in range(3)) for i in range(3)]
    assert pytest.approx(np.sqrt(swing)) == GUSTY.turbulence_rad_s2
    assert (GUSTY.errors, GUSTY.air, Declared().errors, Declared().air) == (True, True, False, False)


def test_a_step_of_the_multiple_models_is_each_filter_by_itself_between_mixing_and_bayes_rule():
    """Moments of the mixture, one prediction and one update a mode, in loops; two steps in gusts."""
    models = InteractingMultipleModels()
    models.reset(context(GUSTY, noise=2.0, unknown_noise=40.0, stay=0.97, measurement_rad_s=0.004))
    rates, n = GUSTY.rate_variance(0.004), N_MODES
    first = models.step(seen((0.1, -0.2, 0.3)), np.zeros(4))
    assert (first.statistic, first.detected) == (0.0, False)
    x, probability = np.tile([0.1, -0.2, 0.3, 0.0, 0.0, 0.0], (n, 1)), np.full(n, 1e-12)
    P, probability[0] = np.tile(np.diag([*rates, *GUSTY.gust_rad_s**2]), (n, 1, 1)), 1.0 - (n - 1) * 1e-12
    chain, keep = transition_matrix(0.97, n), np.exp(-DT / GUSTY.gust_time_s)
    F = np.block([[np.eye(3), DT * GUSTY.gust_effect], [np.zeros((3, 3)), np.diag(keep)]])
    bound = np.hypot(BOUND, GUSTY.model_rad_s2)
    rng = np.random.default_rng(8)
    for _ in range(2):
        contribution, acceleration = rng.normal(size=(3, 4)), rng.normal(size=3)
        now = probability @ x[:, :3] + DT * (acceleration - 0.3 * contribution[:, LEADING[0]])
        predicted, likely = probability @ chain, np.empty(n)
        after_x, after_P = np.empty_like(x), np.empty_like(P)
        for m in range(n):
            weight = chain[:, m] * probability / predicted[m]
            mean = weight @ x
            off = x - mean
            spread = sum(weight[i] * (P[i] + np.outer(off[i], off[i])) for i in range(n))
            ahead, Q = F @ mean, np.zeros(6)
            ahead[:3] += DT * acceleration
            if 0 < m < n - 1:
                axis, theta = divmod(m - 1, 3)
                loss = (-0.25, -0.5, -0.9)[theta]
                ahead[:3] += DT * loss * contribution[:, LEADING[axis]]
            Q[:3] = (DT * (40.0 if m == n - 1 else 2.0) * bound) ** 2
            Q[3:] = (1.0 - keep**2) * GUSTY.gust_rad_s**2
            wide = F @ spread @ F.T + np.diag(Q)
            S = wide[:3, :3] + np.diag(rates)
            nu, K = now - ahead[:3], wide[:, :3] @ np.linalg.inv(S)
            after_x[m], after_P[m] = ahead + K @ nu, wide - K @ wide[:3]
            likely[m] = np.exp(-0.5 * nu @ np.linalg.inv(S) @ nu) / np.sqrt(np.linalg.det(2.0 * np.pi * S))
        x, P, probability = after_x, after_P, predicted * likely / (predicted @ likely)
        models.step(Measured(1.0, now, np.zeros(5), acceleration, contribution, 9.0 * BOUND), np.zeros(4))
        assert models.x == pytest.approx(x, rel=1e-6)
        assert pytest.approx(P, rel=1e-6, abs=1e-15) == models.P
        assert models.mode_probabilities == pytest.approx(probability, rel=1e-6, abs=2e-12)
    assert np.sort(probability)[-3] > 1e-3, "several modes count"


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


@pytest.mark.parametrize("declared", [None, GUSTY])
def test_an_observer_step_by_step(declared):
    """Residual, threshold and fit in plain sums; from the alarm on the residual that is fitted starts again,
    and a window later the name stands."""
    observer, constant = ConstantThresholdObserver(), np.array([0.02, 0.0, 0.05])
    options = {"alarm": 3.0, "pole_per_s": 4.0, "window_s": 0.1}
    observer.reset(replace(context(declared, **options), constant_rad_s2=constant))
    a = exp(-4.0 * DT)
    threshold = 3.0 * np.array([0.02, 1e-4, 0.05]) / 4.0
    if declared:
        threshold = 3.0 * healthy_residual_std(replace(context(GUSTY), constant_rad_s2=constant), a)
    assert observer.threshold == pytest.approx(threshold)
    rng, x, eps, alarm, said = np.random.default_rng(3), np.zeros(3), np.zeros(3), None, []
    fitted, effects, kept = np.zeros(3), np.zeros((3, 3)), []
    for k in range(25):
        contribution, acceleration = 30.0 * rng.normal(size=(3, 4)), rng.normal(size=3)
        lost = -0.6 * contribution[:, LEADING[1]] if k > 7 else 0.0  # of the elevator
        moved = DT * (acceleration + lost) if k else np.zeros(3)
        x = x + moved
        found = observer.step(
            Measured(k * DT, x, np.zeros(5), acceleration, contribution, BOUND), np.zeros(4)
        )
        if k:
            eps, fitted = a * eps + moved - DT * acceleration, a * fitted + moved - DT * acceleration
            effects = a * effects + DT * contribution[:, LEADING]
        ratio = np.abs(eps) / threshold
        assert found.statistic == pytest.approx(ratio.max(), abs=1e-9)
        if alarm is None and ratio.max() > 1.0:
            alarm, axis, fitted, effects = k, "pqr"[int(ratio.argmax())], np.zeros(3), np.zeros((3, 3))
        assert found.detected is (alarm is not None)
        if alarm is None:
            continue
        if k <= alarm + 5:  # a window of 0.1 s
            kept.append((fitted / threshold, effects / threshold[:, None]))
            weight = exp(-DT / 0.1) ** np.arange(len(kept))[::-1]
            each = []
            for s in range(3):
                cross = sum(w * (e @ of[:, s]) for w, (e, of) in zip(weight, kept, strict=True))
                square = sum(w * (of[:, s] @ of[:, s]) for w, (_, of) in zip(weight, kept, strict=True))
                theta = float(np.clip(cross / max(square, 1e-300), -1.0, 0.0))
                left = sum(
                    w * np.sum((e - theta * of[:, s]) ** 2) for w, (e, of) in zip(weight, kept, strict=True)
                )
                each.append((left / (3.0 * weight.sum()), s, theta))
            misfit, s, theta = min(each)
            name = ("aileron", "elevator", "rudder")[s] if misfit <= 1.0 else "unanticipated"
            said.append((name, theta if misfit <= 1.0 else None))
        assert (found.axis, found.isolated) == (axis, said[-1][0])
        assert found.estimate == (None if said[-1][1] is None else pytest.approx(said[-1][1]))
    assert said[-1] == ("elevator", pytest.approx(-0.6, abs=1e-6))


EXACT, LAGGING, RATED = (
    Declared(), Declared(bandwidth_rad_s=np.array([0.0, 9.0, 0.0, 0.0])),
    Declared(rate_limit_rad_s=np.array([0.0, 0.0, 1.0, 0.0])),
)  # fmt: skip
NOISY = Declared(noise=np.full(7, 1e-3), bandwidth_rad_s=np.array([0.0, 9.0, 0.0, 0.0]))


@pytest.mark.parametrize(
    ("declared", "alarm"), [(EXACT, 11.0), (LAGGING, 12.0), (RATED, 12.0), (NOISY, 13.0), (GUSTY, 13.0)]
)
def test_the_scenario_counts_before_what_was_tuned_and_that_before_the_defaults(monkeypatch, declared, alarm):
    """What was tuned is that of the flight's grade, of detectors as of laws, and of this method alone."""
    tuned = {
        grade: {"detectors": {"mine": {"alarm": level, "noise": 5.0}, "other": {"walk": 9.0}},
                "laws": {"theirs": {"walk": level}}}
        for grade, level in (("exact", 11.0), ("actuators", 12.0), ("errors", 13.0))
    }  # fmt: skip
    monkeypatch.setattr(rivals, "load_tuned_values", lambda: tuned)
    defaults = {"alarm": 1.0, "noise": 2.0, "walk": 3.0}
    found = rivals.rival_options("mine", defaults, context(declared, noise=7.0))
    assert found == {"alarm": alarm, "noise": 7.0, "walk": 3.0}
    of_a_law = rivals.rival_options("theirs", defaults, context(declared))
    assert of_a_law == {"alarm": 1.0, "noise": 2.0, "walk": alarm}
    with pytest.raises(BadInput) as refused:
        rivals.rival_options("mine", defaults, context(declared, alarn=7.0))
    assert (
        str(refused.value) == "mine: options.alarn: unknown option, did you mean alarm? "
        "allowed: alarm, noise, walk"
    )
