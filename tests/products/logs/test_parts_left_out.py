"""What the parts that a fit leaves out say of a model: by closed forms, by hand, and by another road."""

from dataclasses import replace
from itertools import pairwise, product
from types import SimpleNamespace

import numpy as np
import pytest

from beaver_ftc_logs import fitting, trust
from beaver_ftc_logs.fitting import FitPart
from beaver_ftc_logs.regression import Regression, fit_ols, unexplained_rates
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


def test_gains_between_laws_are_the_mean_over_flights_and_the_prior():
    left_out = [np.array([0.04, np.nan]), np.array([0.09, 0.012])]
    found = fitting._gain_variance_between_laws(np.array([0.1, 0.2]), left_out)
    np.testing.assert_allclose(found, [(0.01 + 0.04 + 0.09) / 3.0, (0.04 + 0.012) / 2.0])
    np.testing.assert_allclose(fitting._gain_variance_between_laws(np.array([0.1, 0.2]), []), [0.01, 0.04])


def test_a_gain_is_misread_by_as_much_as_the_past_of_the_residual_explains(monkeypatch):
    """The larger of two colours: of each the share of its volume, less what chance explains by 60 numbers an
    axis; none of chance where nothing is foretold."""
    flights = [
        flown(n=200, seed=1), flown(n=150, seed=2),
        replace(flown(n=120, seed=3), samples=replace(flown(n=120, seed=3).samples,
                                                      noise_ma_coefficients=(1.0, 0.3))),
    ]  # fmt: skip
    asked = []
    monkeypatch.setattr(
        trust,
        "untied_power",
        lambda used, model: asked.append(used) or np.array([2.5, 60.0]),
    )
    apart_by_colour = {}
    for colour in (COLOUR, (1.0, 0.3)):
        rest = []
        for one in flights:
            if one.samples.noise_ma_coefficients == colour:
                ok, left, answers = unexplained_rates(one.samples, MODEL, True)
                rest += list((left - MODEL.intercept - answers.sum(axis=1))[one.is_usable & ok])
        apart_by_colour[colour] = np.cov(np.array(rest).T), len(rest)
    for share_by_colour in ((0.6, 0.2), (0.2, 0.25), (0.1, 0.05)):
        colours = []
        for (colour, (all_of, _)), share, before in zip(
            apart_by_colour.items(), share_by_colour, (BEFORE.reshape(6, 3).tolist(), []), strict=True
        ):
            noise = ((1.0 - share) * all_of).tolist()
            colours.append({"average": list(colour), "noise": noise, "before": before})
        model = small.model(noise=NOISE.tolist(), colours=colours)
        n = apart_by_colour[COLOUR][1]
        share = max(share_by_colour[0] - 60.0 / n, share_by_colour[1], 0.0)
        expected = np.minimum(np.sqrt(3.0 * share / np.array([2.5, 60.0])), 0.33)
        np.testing.assert_allclose(fitting._max_gain_bias(flights, model), expected)
    assert [[one.samples for one in flights]] * 3 == [[samples for samples, _ in used] for used in asked]
    bare = small.model()
    assert fitting._max_gain_bias(flights, bare).tolist() == [0.0, 0.0]
    assert len(asked) == 3


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


@pytest.fixture
def two_folds(monkeypatch):
    """Three flights left out by the first model, of one of which nothing is in use; one by the second, which
    knows the effect of one group."""
    one, idle, other, last = (flown(seed=seed, n=n) for seed, n in ((1, 150), (2, 90), (3, 207), (4, 260)))
    idle = replace(idle, is_usable=np.zeros(90, dtype=bool))
    folds = [(known(MODEL, 0.3, 0.4), [one, idle, other]), (known(MODEL, 0.99, 0.4), [last])]
    asked = []
    monkeypatch.setattr(fitting, "_folds", lambda *of: asked.append(of[2]) or folds)
    monkeypatch.setattr(trust, "tied_shares", lambda used, model: np.array([0.31, 0.42]))
    return folds, asked


def test_gains_of_parts_left_out_are_counted_over_all_of_them(monkeypatch, two_folds):
    """As many squares as gains from the start; each axis of a known answer shows the gain of its group."""
    folds, asked = two_folds
    given, told = [], iter([(5.0, 2), (7.0, 1), (11.0, 1)])
    monkeypatch.setattr(
        fitting,
        "_error_and_rank",
        lambda *of: given.append(of) or next(told),
    )
    found = fitting.gain_overdispersion(folds[0][1], MODEL)
    assert found == pytest.approx((2.0 + 5.0 + 7.0 + 11.0) / (2.0 + 2.0 + 1.0 + 1.0))
    assert asked == [[0.31, 0.42]]
    flights = [(model, one) for model, several in folds for one in several if one.is_usable.any()]
    for (model, one), (responses, residual, between) in zip(flights, given, strict=True):
        _, rest, answers = in_white(one)
        groups = [0, 1] if model is folds[0][0] else [1]
        rest, answers = rest - rest.mean(axis=0), (answers - answers.mean(axis=0))[:, groups]
        turned = answers.transpose(0, 2, 1).reshape(-1, len(groups))
        np.testing.assert_allclose(responses.T @ residual, turned.T @ rest.ravel(), rtol=1e-7)
        np.testing.assert_allclose(responses.T @ responses, turned.T @ turned, rtol=1e-7)
        assert residual @ residual == pytest.approx((rest**2).sum())
        all_of = np.full((2, 2), 0.12**2) + 0.07**2 * np.eye(2)
        np.testing.assert_allclose(between, all_of[np.ix_(groups, groups)])


def test_noise_is_as_much_wider_as_the_gains_of_ten_seconds_are_farther_off(monkeypatch, two_folds):
    """By the mean over windows of a colour, of each at most 200 a gain; each axis has a gain of its own."""
    folds, asked = two_folds
    given = []
    told = iter([(90.0, 6), (8000.0, 4), (30.0, 5), (12.0, 0), (2.0, 1)])
    monkeypatch.setattr(
        fitting,
        "_error_and_rank",
        lambda *of: given.append(of) or next(told),
    )
    model = fitting._with_inflated_noise([one for _, of in folds for one in of], MODEL)
    sizes = [15.0, 200.0, 6.0, 12.0, 2.0]
    assert model.inflation_of(COLOUR) == pytest.approx(np.mean(sizes))
    assert model.inflation_of((1.0, 0.3)) == 1.0
    assert asked == [[0.31, 0.42]]
    windows = []
    for fold, several in folds:
        groups = [0, 1] if fold is folds[0][0] else [1]
        for one in several:
            if not one.is_usable.any():
                continue
            _, rest, answers = in_white(one)
            for rows in np.array_split(np.arange(len(rest)), round(len(rest) / 100)):
                windows.append((rest[rows], answers[rows][:, groups]))
    assert [len(rest) for rest, _ in windows] == [len(residual) // 3 for _, residual, _ in given]
    for (rest, answers), (responses, residual, between) in zip(windows, given, strict=True):
        groups = answers.shape[1]
        assert responses.shape == (3 * len(rest), 3 * groups)
        assert residual @ residual == pytest.approx(((rest - rest.mean(axis=0)) ** 2).sum())
        np.testing.assert_allclose(residual.reshape(-1, 3).sum(axis=0), 0.0, atol=1e-9)
        np.testing.assert_allclose(responses.reshape(-1, 3, 3 * groups).sum(axis=0), 0.0, atol=1e-9)
        shares = np.repeat(np.eye(2)[:groups, :groups], 3, axis=0).repeat(3, axis=1)
        np.testing.assert_allclose(between, 0.12**2 + 0.07**2 * shares)


def test_each_flight_is_left_out_once_of_many_every_twelfth():
    flights = [FitPart(small.flight(MODEL, 9), np.ones(9, dtype=bool)) for _ in range(14)]
    name = {id(one): i for i, one in enumerate(flights)}
    found = [
        ([name[id(one)] for one in fitted], [name[id(one)] for one in left_out])
        for fitted, left_out in fitting._splits(flights)
    ]
    lots = [[0, 12], [1, 13], *([i] for i in range(2, 12))]
    assert found == [([i for i in range(14) if i not in lot], lot) for lot in lots]
    few = fitting._splits(flights[:2])
    assert [[name[id(one)] for one in part] for split in few for part in split] == [[1], [0], [0], [1]]
    (half, (other,)), (again, (first,)) = fitting._splits(flights[:1])
    assert (half, again) == ([first], [other])
    assert np.flatnonzero(first.is_usable).tolist() == [0, 1, 2, 3]


def regression_by_hand(rows):
    """A fit whose numbers all differ: coefficients, their errors by axis and how these hang together."""
    rng = np.random.default_rng(rows)
    root = rng.uniform(-1.0, 1.0, (rows, rows)) + 2.0 * np.eye(rows)
    covariance = root @ root.T
    size = np.sqrt(np.diag(covariance))
    return Regression(
        coefficients=rng.uniform(0.2, 0.9, (rows, 3)) * rng.choice([-1.0, 1.0], (rows, 3)),
        residual_covariance=NOISE,
        standard_errors=rng.uniform(0.02, 0.06, (rows, 3)),
        standard_error_inflation=np.ones((rows, 3)),
        coefficient_error_correlation=covariance / np.outer(size, size),
    )


@pytest.mark.parametrize("other_laws", [False, True])
@pytest.mark.parametrize("of", [small.WING, small.TAIL], ids=["wing", "tail"])
def test_the_error_of_a_gain_follows_from_those_of_its_response(of, other_laws):
    """Of its sum over lags along itself, in sd of the noise; of laws unlike those seen the factor of the
    whole response, by the information of every axis."""
    model = small.model(of | {"other_laws": other_laws})
    first = 1 + len(model.past_coefficients)
    fit = regression_by_hand(first + 6)
    sd, errors = np.sqrt(np.diag(NOISE)), []
    for group in range(2):
        rows = range(first + 3 * group, first + 3 * group + 3)
        variance, information = 0.0, 0.0
        total = np.array([sum(fit.coefficients[row, a] for row in rows) / sd[a] for a in range(3)])
        for a in range(3):
            covariance = np.array([
                [fit.standard_errors[i, a] * fit.coefficient_error_correlation[i, j]
                 * fit.standard_errors[j, a] for j in rows] for i in rows
            ])  # fmt: skip
            variance += total[a] ** 2 * covariance.sum() / sd[a] ** 2
            answer = fit.coefficients[list(rows), a]
            information += answer @ np.linalg.solve(covariance, answer)
        errors.append(information**-0.5 if other_laws else np.sqrt(variance) / (total @ total))
    assert max(errors) < 0.33
    np.testing.assert_allclose(fitting.group_gain_sd(fit, model), errors, rtol=1e-7)
    loose = replace(fit, standard_errors=100.0 * fit.standard_errors)
    assert fitting.group_gain_sd(loose, model).tolist() == [0.33, 0.33]


def test_a_fold_has_the_errors_of_its_own_fit_and_what_is_tied_in_all_flights():
    flights = fitting.fit_parts([small.flight(MODEL, 300, seed=seed) for seed in (1, 2)])
    model = small.model()
    folds = [*fitting._folds(flights, model, [0.31, 0.42])]
    for (fold, left_out), fitted, held in zip(folds, flights[::-1], flights, strict=True):
        assert left_out == [held]
        fit = fitting.fit_order([fitted], model.vehicle, 2, 3)
        errors = fitting.group_gain_sd(fit, model)
        assert fold.fitted_ranges.group_gain_sd == errors.tolist()
        assert fold.fitted_ranges.tied_shares == [0.31, 0.42]
        assert fold.intercept == fit.coefficients[0].tolist()
        assert fold.settings == model.settings


def test_a_model_fitted_again_keeps_how_much_wider_each_colour_is():
    """That of the same colour; one is of a colour that was not there."""
    flights = []
    for seed, colour in ((1, COLOUR), (2, (1.0, 0.5))):
        flight = replace(small.flight(MODEL, 400, seed=seed), noise_ma_coefficients=colour)
        flights.append(FitPart(flight, np.arange(400) % 97 != 50))
    again = fitting.refit(flights, MODEL)
    by_colour = {tuple(one.ma_coefficients): one for one in again.noise_models}
    assert {colour: one.covariance_inflation for colour, one in by_colour.items()} == {
        COLOUR: WIDER, (1.0, 0.5): 1.0,
    }  # fmt: skip
    for one in flights:
        _, rest = fitting.one_step_residual(again, one)
        found = np.array(by_colour[one.samples.noise_ma_coefficients].residual_covariance)
        np.testing.assert_allclose(found, np.cov(rest.T), rtol=1e-9)


def test_a_predictor_is_fitted_where_twenty_samples_and_the_next_follow_one_another():
    """600 of them over several runs, row by row; of 599 there is none."""
    rng = np.random.default_rng(7)
    lengths = [20, 321, 5, 340]
    rest = np.cumsum(rng.standard_normal((sum(lengths), 3)), axis=0) * [0.1, 0.3, 0.2]
    edges = np.cumsum([0, *lengths])
    rows = np.concatenate([np.arange(a, b) + 9 * i for i, (a, b) in enumerate(pairwise(edges))])
    given = [(rows[:341], rest[:341]), (rows[341:], rest[341:])]
    short = fitting._fit_noise_model([1.0, 0.2], [given[0], (rows[341:-22], rest[341:-22])])
    assert short.ar_coefficients == []
    np.testing.assert_allclose(short.residual_covariance, np.cov(rest[:-22].T))
    given[1] = (rows[341:-21], rest[341:-21])
    found = fitting._fit_noise_model([1.0, 0.2], given)
    before, after = [], []
    for begin, end in ((20, 341), (346, len(rest) - 21)):
        for k in range(begin + 20, end):
            before.append(np.concatenate([rest[k - lag] for lag in range(1, 21)]))
            after.append(rest[k])
    assert len(after) == 600
    by = np.linalg.lstsq(np.array(before), np.array(after), rcond=None)[0]
    np.testing.assert_allclose(found.ar_coefficients, by, atol=1e-9)
    np.testing.assert_allclose(found.residual_covariance, np.cov((np.array(after) - before @ by).T))
    assert found.ma_coefficients == [1.0, 0.2]


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


def test_a_part_left_out_is_read_wrongly_by_its_rows_in_use(monkeypatch):
    """At most of all mistakes, none at least."""
    one, given = flown(), []
    told = iter([{"a": -0.2, "b": 0.4, "c": 0.3}, {"a": -0.2}, {}])
    monkeypatch.setattr(
        trust,
        "mistake_gains",
        lambda samples, model: given.append((samples, model)) or (next(told), 7.0),
    )
    found = [fitting._misread_gain(MODEL, one) for _ in range(3)]
    assert found == [0.4, 0.0, 0.0]
    samples, model = given[0]
    np.testing.assert_array_equal(samples.rates, np.where(one.is_usable[:, None], one.samples.rates, np.nan))
    assert model is MODEL


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


def test_what_is_computed_once_is_of_these_flights_and_this_question():
    first, second, third = flights = fitting.fit_parts(
        [small.flight(MODEL, 160, seed=seed) for seed in (1, 2, 3)]
    )
    its, bare = small.vehicle(), small.vehicle(labels={})
    asked = [
        (flights, its, 2, 3), ([first, second], its, 2, 3), ([first, third], its, 2, 3),
        (flights, bare, 2, 3), (flights, its, 1, 3), (flights, its, 2, 2),
    ]  # fmt: skip
    fits = [fitting.fit_order(*of) for of in asked]
    models = [fitting._model_of_order(*of) for of in asked]
    assert len({*map(id, fits)}) == len({*map(id, models)}) == 6
    for of, fit, model in zip(asked, fits, models, strict=True):
        assert fitting.fit_order(*of) is fit
        assert fitting._model_of_order(*of) is model
        assert model.intercept == fit.coefficients[0].tolist()
        assert (model.vehicle, model.n_rate_lags, model.n_command_lags) == of[1:]
    halves = fitting.validation_folds([first])
    assert fitting.validation_folds([first])[0][1] is halves[0][1]


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


LAWS = {
    "own_gain_sd": 0.05,
    "own_gain_time_s": 20.0,
    "name_evidence": 2.0,
    "rename_s": 1.0,
    "one_group": True,
    "bounds": 0.97,
}
AIR = {"own_gain_sd": 0.08, "own_gain_time_s": 100.0}
DAYS = {
    "trim_sd": 0.1, "trim_shift": 0.03, "trim_walk": [2.5e-3, 6e-4, 2e-3], "gain_sd": 0.1,
    "gain_time_s": 300.0, "own_gain_sd": 0.03, "power": 0.8,
}  # fmt: skip
TOGETHER = small.TAIL | {
    "signals": [], "labels": {"left_aileron": "a", "elevator": "b", "right_aileron": "c"},
}  # fmt: skip


@pytest.mark.parametrize(("laws", "air", "most"), [
    (False, False, 0.9), (False, True, 0.9), (True, False, 0.4), (True, True, 1.0),
])  # fmt: skip
def test_settings_are_by_law_and_air_and_by_what_labels_say(monkeypatch, laws, air, most):
    """Of surfaces that move together no label says which has lost: their levels count for nothing."""
    walk, asked = [1e-3, 2e-3, 3e-3], []
    monkeypatch.setattr(fitting, "_estimate_trim_walk", lambda of, model: walk)
    told = iter([1.0, 4.0])
    monkeypatch.setattr(
        fitting, "gain_overdispersion", lambda of, model: asked.append(model.settings) or next(told)
    )
    flags = {"other_laws": laws, "moving_air": air}
    model = small.model(TOGETHER | flags)
    more = (LAWS | (AIR if air else {})) if laws else {}
    delays = {"delays_s": [0.0] if air else pytest.approx([-0.04, 0.0, 0.04])}
    usual = fitting.FilterSettings().model_dump(by_alias=True)
    bare = fitting.fit_parts([small.flight(small.model(small.TAIL | {"signals": []}), 120)])
    for power in (most, 0.25):
        found = fitting.estimate_filter_settings(bare, model).model_dump(by_alias=True)
        assert found == usual | more | delays | {"trim_walk": walk, "power": power}
    assert [one.model_dump(by_alias=True) for one in asked] == [usual | more | {"trim_walk": walk}] * 2
    flight = small.flight(model, 300, lost=((0, 80, 140, 0.3), (1, 180, 240, 0.6)))
    labelled = fitting.fit_parts([flight])
    found = fitting.estimate_filter_settings(labelled, model).model_dump(by_alias=True)
    hours = labelled[0].is_usable.sum() / 36000.0
    assert found == usual | DAYS | more | delays | {
        "levels": {"elevator": [0.6]},
        "changes_per_hour": pytest.approx(np.sqrt(3.0 / hours * 12.0)),
        "repair_share": pytest.approx((1 + 10) / (2 + 20)),
    }
    assert len(asked) == 2


@pytest.mark.parametrize(("flights", "laws", "wide"), [
    (1, True, [0.01, 0.04]), (2, True, [0.0175, 0.04]), (2, False, [0.0, 0.0]),
])  # fmt: skip
@pytest.mark.parametrize(("asked", "levels", "tail", "aimed"), [
    (None, {}, None, 1.0), (None, {}, "tail", 1.0), (None, {"left": [0.5]}, "tail", None),
    (2.0, {"left": [0.5]}, "tail", 2.0), (3.0, {}, "tail", 3.0),
])  # fmt: skip
def test_what_is_known_of_other_laws_widens_gains_and_sets_the_alarm(
    monkeypatch, flights, laws, wide, asked, levels, tail, aimed
):
    """Flights differ in laws, halves of one do not; of a rate that is not asked for one an hour is aimed at,
    but where labels say how often things break."""
    used = [SimpleNamespace(samples=f"flight {i}", is_usable=f"rows {i}") for i in range(flights)]
    folds, given = [("one", [1, 2]), ("other", [3])], {}
    stubs = {
        "_folds": lambda of, model, tied: given.update(tied=tied) or folds,
        "_healthy_peaks": lambda model, one: (np.array([7.0 * one]), one / 60.0),
        "_misread_gain": lambda model, one: 0.1 * one,
        "_squared_deviations": lambda model, one: one * np.array([0.01, 0.02]),
        "_max_gain_bias": lambda of, model: np.array([0.1, 0.2]),
        "fit_order": lambda *of: of[2:],
        "group_gain_sd": lambda fit, model: np.array([0.05, 0.3]),
        "_choose_threshold": lambda tail, rate, model: (tail, rate),
        "_cross_validate": lambda parts, rate, model: {"parts": len(parts), "rate": rate},
    }  # fmt: skip
    for name, stub in stubs.items():
        monkeypatch.setattr(fitting, name, stub)
    monkeypatch.setattr(trust, "tied_shares", lambda of, model: np.array([0.3, 0.4]))
    bare = trust.FittedRanges(commands=[], rates=[])
    monkeypatch.setattr(
        trust,
        "compute_fitted_ranges",
        lambda of, model, errors: given.update(of=of, errors=errors) or bare,
    )
    monkeypatch.setattr(fitting.extremes, "fit_peak_tail", lambda parts: given.update(parts=parts) or tail)
    model = small.model(small.WING | {"other_laws": laws, "false_alarms_per_hour": asked})
    settings = model.settings.model_copy(update={"likely_levels": levels})
    model = model.model_copy(update={"settings": settings})
    found = fitting.add_ranges_and_threshold(used, model)
    expected = np.minimum(np.sqrt(np.array([0.0025, 0.09]) + wide), 0.33)
    np.testing.assert_allclose(given["errors"], expected)
    assert given["of"] == [(one.samples, one.is_usable) for one in used]
    assert given["tied"] == [0.3, 0.4]
    assert [(peaks.tolist(), hours) for peaks, hours in given["parts"]] == [
        ([7.0 * one], one / 60.0) for one in (1, 2, 3)
    ]
    ranges = found.fitted_ranges
    assert ranges.alarm_peak_tail == tail
    assert ranges.misread_gain == pytest.approx(0.3)
    threshold = (tail, aimed) if aimed else None
    assert found.settings == settings.model_copy(
        update={"false_alarms_per_hour": aimed, "alarm_threshold": threshold}
    )
    assert found.identification_results == {"parts": 3, "rate": aimed}


def test_a_fit_may_misread_an_effect_by_what_its_noise_model_foretells():
    """By hand: the root of the lacking power over that of the effect, axes weighed as least squares does."""
    one, other = flown(seed=5), flown(seed=6, gains=(0.4, 1.0))
    noise = next(one for one in MODEL.noise_models if one.ma_coefficients == list(COLOUR))
    rest = np.vstack([fitting.one_step_residual(MODEL, flight)[1] for flight in (one, other)])
    answers = [fitting.whitened_residual(MODEL, flight)[2] for flight in (one, other)]
    answers = np.vstack([each - each.mean(axis=0) for each in answers])
    lacking = [max(np.var(rest[:, axis]) / HEARD[axis, axis] - 1.0, 0.0) for axis in range(3)]
    for group, found in enumerate(fitting.hidden_errors([one, other], MODEL, noise)):
        power = [np.mean(answers[:, group, axis] ** 2) / HEARD[axis, axis] for axis in range(3)]
        by_hand = np.sqrt(sum(q * p for q, p in zip(lacking, power, strict=True))) / sum(power)
        assert found == pytest.approx(min(by_hand, 0.33) / np.sqrt(3.0))  # the sd of anything below


def test_responses_are_usually_as_quick_as_in_nine_tenths_of_the_samples_of_a_noise():
    """By hand: the power an axis of what differs from the mean of the last half second, in the noise."""
    one, other = flown(seed=5), flown(seed=6, n=90)
    noise = next(one for one in MODEL.noise_models if one.ma_coefficients == list(COLOUR))
    powers = []
    for flight in (one, other):
        answers = fitting.whitened_residual(MODEL, flight)[2]
        last = round(0.5 * MODEL.rate_hz)
        for k, now in enumerate(answers):
            quick = now - answers[max(k + 1 - last, 0) : k + 1].mean(axis=0)
            powers.append(sum(each @ np.linalg.inv(HEARD) @ each for each in quick) / 3.0)
    found = fitting.usual_quick_power([one, other], MODEL, noise)
    assert found == pytest.approx(np.quantile(powers, 0.9))


@pytest.mark.parametrize(("errors", "loud", "share"), [
    ([0.5], 1.0, 0.5), ([0.2, 0.5], 1.0, 0.5), ([0.8, 0.0], 3.0, 0.8 / 3.0), ([0.0], 1.0, 0.0),
    ([5.0], 1.0, 1.0), ([None], 1.0, 1.0), ([None, 0.5], 1.0, 0.5),
])  # fmt: skip
def test_the_error_of_quick_responses_is_that_of_the_worst_flight_left_out(monkeypatch, errors, loud, share):
    """A step in ten seconds, of which so much is missing while it is quick; in a loud flight that counts
    less. Without such a step nothing is known of it, and all of it may be missing."""
    rng, root, n = np.random.default_rng(4), np.linalg.cholesky(HEARD), 40_000
    usual = next(one for one in MODEL.noise_models if one.ma_coefficients == list(COLOUR))
    model = MODEL.model_copy(update={"noise_models": [usual.model_copy(update={"usual_quick_power": 4.0})]})
    steps = np.zeros((n, 2, 3))
    steps[:, 1, 2] = 20.0 * (np.arange(n) // 100 % 2)
    begin = np.maximum(np.arange(n) - round(0.5 * MODEL.rate_hz) + 1, 0)
    total = np.concatenate([np.zeros((1, 2, 3)), np.cumsum(steps, axis=0)])
    slow = (total[1:] - total[begin]) / (np.arange(n) + 1 - begin)[:, None, None]

    def rows_residual_answers(_, error):
        noise = loud * rng.standard_normal((n, 3))
        missing = 0.0 if error is None else error * (steps - slow).sum(axis=1)
        return None, (noise + missing) @ root.T, steps @ root.T * (error is not None)

    monkeypatch.setattr(
        fitting,
        "whitened_residual",
        lambda model, flight: rows_residual_answers(model, flight.error),
    )
    monkeypatch.setattr(fitting, "refit", lambda fitted, model: model)
    flights = [
        SimpleNamespace(error=error, samples=SimpleNamespace(noise_ma_coefficients=COLOUR))
        for error in errors
    ]
    monkeypatch.setattr(fitting, "_splits", lambda of: [([], [flight]) for flight in of])
    assert fitting.quick_error_share(flights, model) == pytest.approx(share, abs=0.02)


def test_a_flight_louder_than_all_that_were_fitted_widens_no_noise_under_other_laws():
    """The filter does so by itself. Under the same law it does not; nor if a fitted flight was as loud."""
    found = {}
    for laws, fitted in product((False, True), (1.0, 100.0)):
        model = MODEL.model_copy(update={"vehicle": MODEL.vehicle.model_copy(update={"other_laws": laws})})
        one, other = (flown((1.0, 1.0), loud, 600, seed) for loud, seed in ((100.0, 5), (fitted, 6)))
        found[laws, fitted] = np.mean(fitting._window_inflations(known(model, 0.3, 0.4), one, [other]))
    assert found[False, 1.0] == found[False, 100.0] == found[True, 100.0] > 20.0
    assert found[True, 1.0] < 3.0
