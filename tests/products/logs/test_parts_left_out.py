"""What the parts that a fit leaves out say of a model: by closed forms, by hand, and by another road."""

from dataclasses import replace
from itertools import pairwise, product
from types import SimpleNamespace

import numpy as np
import pytest

from beaver_ftc_logs import fitting, trust
from beaver_ftc_logs.fitting import FitPart
from beaver_ftc_logs.regression import fit_ols, unexplained_rates
from products.logs import small
from telling import apart

NOISE = np.array([[0.0025, 0.0009, -0.0004], [0.0009, 0.0016, 0.0003], [-0.0004, 0.0003, 0.0005]])
HEARD = np.array([[0.0031, -0.0007, 0.0006], [-0.0007, 0.0019, 0.0002], [0.0006, 0.0002, 0.0008]])
BEFORE = np.array([
    [[0.4, 0.05, -0.03], [0.02, 0.3, 0.07], [-0.06, 0.01, 0.2]],
    [[0.1, -0.04, 0.08], [0.09, -0.15, 0.11], [0.12, 0.13, 0.17]],
])  # fmt: skip
COLOUR, WIDER = (1.0, -0.4), 1.7
COLOURS = [
    {"average": [1.0, 0.3], "noise": (3.0 * NOISE).tolist(), "wider": 2.9},
    {"average": list(COLOUR), "noise": HEARD.tolist(), "before": BEFORE.reshape(6, 3).tolist(),
     "wider": WIDER},
]  # fmt: skip
MODEL = small.model(noise=NOISE.tolist(), colours=COLOURS, settings={"own_gain_sd": 0.07, "gain_sd": 0.12})
apart(noise=NOISE[np.triu_indices(3)], heard=HEARD[np.triu_indices(3)], before=BEFORE)


def known(model, *tied):
    """The model that knows how far the effect of each group is made up by others."""
    return model.model_copy(update={"fitted_ranges": trust.FittedRanges(commands=[], rates=[], tied=[*tied])})


def flown(gains=(0.8, 1.25), loud=1.0, n=150, seed=5, **changes):
    """A flight of the colour that is known, in which surfaces do so much of what the model says."""
    lost = ((0, 15, 35, 0.6), (1, 70, 100, 0.3))
    flight = small.flight(small.model(noise=(loud * NOISE).tolist()), n, lost, seed=seed, gap=60)
    use = ~np.isin(np.arange(n), [3, 40, 41, n - 1])
    commands = flight.commands / np.array(gains)
    return FitPart(replace(flight, commands=commands, noise_ma_coefficients=COLOUR, **changes), use)


def in_white(of, model=MODEL):
    """Places, residual and answers of a flight, less what those of the two samples before foretell, in sd of
    the noise: by its symmetric root."""
    ok, left, answers = unexplained_rates(of.samples, model, labelled=True)
    rest = left - np.array(model.intercept) - answers.sum(axis=1)
    places = [k for k in np.flatnonzero(of.is_usable) if k > 1 and ok[k - 2 : k + 1].all()]
    size, turn = np.linalg.eigh(WIDER * HEARD)
    root = turn @ np.diag(size**-0.5) @ turn.T
    shown = [
        np.array([(one[k] - one[k - 1] @ BEFORE[0] - one[k - 2] @ BEFORE[1]) @ root for k in places])
        for one in (rest, answers)
    ]
    return places, *shown


def gains_and_covariance(rest, answers):
    """Of least squares on trims of three axes and answers (n, K, 3), trims aside."""
    n = len(rest)
    design = np.hstack([np.tile(np.eye(3), (n, 1)), answers.transpose(0, 2, 1).reshape(3 * n, -1)])
    covariance = np.linalg.inv(design.T @ design)
    return (covariance @ design.T @ rest.ravel())[3:], covariance[3:, 3:]


@pytest.mark.parametrize("loud", [9.0, 0.02])
def test_how_far_gains_are_from_one_beyond_what_the_noise_allows(loud):
    """Noise is what the residual about its mean is, and that of the model at least."""
    one = flown((0.8, 1.01), loud)
    _, rest, answers = in_white(one)
    assert (rest.var(axis=0).mean() > 1.0) == (loud > 1.0)
    size = max(rest.var(axis=0).mean(), 1.0)
    gains, covariance = gains_and_covariance(rest, answers)
    both = np.maximum(gains**2 - size * np.diag(covariance), 0.0)
    found = fitting._squared_deviations(known(MODEL, 0.3, 0.4), one)
    np.testing.assert_allclose(found, both, rtol=1e-7)
    assert both[0] > 0.01 > both[1] == 0.0
    gains, covariance = gains_and_covariance(rest, answers[:, 1:])
    found = fitting._squared_deviations(known(MODEL, 0.99, 0.4), one)
    assert np.isnan(found[0])
    assert found[1] == pytest.approx(max(gains[0] ** 2 - size * covariance[0, 0], 0.0), abs=1e-12)
    still = replace(one.samples, commands=one.samples.commands * [0.0, 1.0])
    found = fitting._squared_deviations(MODEL, replace(one, samples=still))
    assert np.isnan(found).tolist() == [True, False]
    nothing = replace(one, is_usable=np.zeros(150, dtype=bool))
    found = fitting._squared_deviations(MODEL, nothing)
    assert np.isnan(found).tolist() == [True, True]


def test_the_squares_of_gains_are_in_their_covariance_and_what_lies_between_flights():
    """g' ((F' F)^-1 + S)^-1 g; what nothing tells, or two say alike, is no gain more."""
    rng = np.random.default_rng(2)
    responses, residual = rng.standard_normal((90, 3)) * [1.0, 0.4, 2.0], rng.standard_normal(90)
    residual += responses @ [0.3, -0.5, 0.2]
    root = np.array([[0.3, 0.0, 0.0], [0.2, 0.1, 0.0], [-0.1, 0.05, 0.25]])
    between = root @ root.T
    gains = np.linalg.lstsq(responses, residual, rcond=None)[0]
    spread = np.linalg.inv(responses.T @ responses) + between
    found, n = fitting._error_and_rank(responses, residual, between)
    assert (found, n) == (pytest.approx(gains @ np.linalg.solve(spread, gains)), 3)
    some, n = fitting._error_and_rank(responses[:, :2], residual, between[:2, :2])
    idle = responses * [1.0, 1.0, 0.0]
    assert fitting._error_and_rank(idle, residual, between) == (
        pytest.approx(some), n,
    )  # fmt: skip
    assert n == 2
    twice = np.column_stack([responses[:, 0], responses[:, 0]])
    assert fitting._error_and_rank(twice, residual, between[:2, :2])[1] == 1


def test_the_drift_of_a_trim_from_means_that_follow_one_another(monkeypatch):
    """Runs of 250 and 170 samples at 10 Hz have three and two means of 80, twelve and eight of 20; a jump
    between runs is none of a trim. In sd of the noise of the flight's colour, the usual at least."""
    rng = np.random.default_rng(3)
    rows = np.concatenate([np.arange(250), 400 + np.arange(170)])
    series = [
        np.cumsum(rng.standard_normal((420, 3)), axis=0) * [0.004, 0.0, 0.002] + 5.0 * (rows > 300)[:, None]
        for _ in range(2)
    ]
    sd = np.sqrt(WIDER * np.diag(HEARD))
    flights = [FitPart(flown(n=9 + i).samples, np.ones(9 + i, dtype=bool)) for i in range(2)]
    monkeypatch.setattr(
        fitting,
        "_splits",
        lambda of: [([flights[1]], [flights[0]]), ([flights[0]], [flights[1]])],
    )
    monkeypatch.setattr(fitting, "refit", lambda fitted, like: like)
    monkeypatch.setattr(
        fitting,
        "whitened_residual",
        lambda like, held: (rows, series[0 if held is flights[0] else 1], None),
    )
    variance = {}
    for span in (20, 80):
        squares = []
        for one in series:
            for begin, end in ((0, 250), (250, 420)):
                means = [(one[k : k + span] / sd).mean(axis=0) for k in range(begin, end - span + 1, span)]
                squares += [(b - a) ** 2 for a, b in pairwise(means)]
        assert len(squares) == {20: 2 * (11 + 7), 80: 2 * (2 + 1)}[span]
        variance[span] = np.mean(squares, axis=0)
    # 2 c / n + 2 n w / 3 of both, less one another
    walk = 1.5 * (80 * variance[80] - 20 * variance[20]) / (80**2 - 20**2)
    usual = [1e-4, 3e-4, 2e-4]
    monkeypatch.setattr(fitting, "FilterSettings", lambda: SimpleNamespace(trim_step_sd=usual))
    expected = np.maximum(np.sqrt(np.maximum(walk, 0.0)), usual)
    assert (expected[[0, 2]] > [1e-2, 1e-2]).all()
    assert expected[1] == 3e-4
    np.testing.assert_allclose(fitting._estimate_trim_walk(flights, MODEL), expected)
    rows, series = rows[:100], [one[:100] for one in series]  # no mean of 80 follows another
    assert fitting._estimate_trim_walk(flights, MODEL) == usual


def test_peaks_and_hours_are_of_rows_in_health_that_answer(monkeypatch):
    """A run ends where a row is not in use, faulty or idle; the sum starts anew behind it."""
    n = 12
    gained = np.array([1.0, 2.0, 4.0, 8.0, -9.0, 16.0, 32.0, 64.0, 128.0, 256.0, 512.0, 1024.0])
    labels = np.ones((n, 2))
    labels[2, 1], labels[11, 0] = 0.9, np.nan
    use = ~np.isin(np.arange(n), [0, 7])
    posterior = np.tile([0.6, 0.1, 0.3], (n, 1))
    posterior[9] = 0.3, 0.2, 0.5
    bank = SimpleNamespace(no_response_hypothesis_index=2)
    monkeypatch.setattr(fitting, "build_bank", lambda model: bank)
    monkeypatch.setattr(fitting, "bank_posterior", lambda *of: (posterior, None, None))
    monkeypatch.setattr(fitting, "fault_evidence", lambda of, by: gained)
    samples = SimpleNamespace(labels=labels, dt_s=1.5)
    peaks, hours = fitting._healthy_peaks(MODEL, SimpleNamespace(samples=samples, is_usable=use))
    # rows 1; 3, 4, 5, 6; 8; 10, 11
    assert peaks.tolist() == [2.0, 8.0, 48.0, 128.0, 1536.0]
    assert hours == pytest.approx(8 * 1.5 / 3600.0)


def test_a_flight_weighs_in_a_fit_by_its_weight_and_time_is_that_of_most_flights():
    one, other, slow = (small.flight(MODEL, n, seed=n) for n in (150, 170, 160))
    flights = fitting.fit_parts(
        [replace(one, fit_weight=0.3), replace(other, dt_s=0.125), replace(slow, dt_s=0.4)]
    )
    x, y, run = fitting.stack_data(flights, MODEL.vehicle, 2, 3)
    bare = fitting.fit_parts([one])
    plain, rates, _ = fitting.stack_data(bare, MODEL.vehicle, 2, 3)
    np.testing.assert_allclose(x[: len(plain)], 0.3 * plain)
    np.testing.assert_allclose(y[: len(plain)], 0.3 * rates)
    model = fitting._model_of_order(flights, MODEL.vehicle, 2, 3)
    assert model.rate_hz == 8.0
    errors = fit_ols(x, y, run, 16).standard_errors[7:]  # over two seconds of them
    assert model.response_error == errors.reshape(2, 3, 3).tolist()


@pytest.mark.parametrize("laws", [False, True])
def test_a_flight_that_fails_at_once_leaves_nothing_out(laws):
    """Of three flights one has no sample that is known: the settings are those of the other two."""
    vehicle = small.vehicle(small.TAIL | {"other_laws": laws})
    like = small.model(small.TAIL)
    flights = fitting.fit_parts([small.flight(like, 300, seed=seed) for seed in (1, 2)])
    idle = FitPart(small.flight(like, 200, seed=3), np.zeros(200, dtype=bool))
    found, expected = (
        fitting.gain_overdispersion(of, fitting._model_of_order(of, vehicle, 2, 3))
        for of in ([*flights, idle], flights)
    )
    assert found == pytest.approx(expected)


def test_a_flight_louder_than_all_that_were_fitted_widens_no_noise_under_other_laws():
    """The filter does so by itself. Under the same law it does not; nor if a fitted flight was as loud."""
    found = {}
    for laws, fitted in product((False, True), (1.0, 100.0)):
        model = MODEL.model_copy(update={"vehicle": MODEL.vehicle.model_copy(update={"other_laws": laws})})
        one, other = (flown((1.0, 1.0), loud, 600, seed) for loud, seed in ((100.0, 5), (fitted, 6)))
        found[laws, fitted] = np.mean(fitting._window_inflations(known(model, 0.3, 0.4), one, [other]))
    assert found[False, 1.0] == found[False, 100.0] == found[True, 100.0] > 20.0
    assert found[True, 1.0] < 3.0
