"""Flights in gusts that a law answers: a gain is right only where the noise has its own colour."""

from dataclasses import replace

import numpy as np
import pytest

from beaver_ftc.documents.errors import BadInput
from beaver_ftc_logs import diagnose, fitting, gyro_noise, identification, samples, trust
from beaver_ftc_logs.bank import build_bank, build_noise
from beaver_ftc_logs.filtering import _update, bank_posterior
from beaver_ftc_logs.model import FittedRanges, NoiseModel, load_model, model_file_text
from beaver_ftc_logs.regression import unexplained_rates, whitened_rates
from beaver_ftc_logs.samples import whiten_samples
from products.logs import small
from telling import numbers

AVERAGE = (1.0, -1.4, 0.49)


def test_a_whitened_flight_averages_to_what_it_was():
    """C(z) of the filtered is C(1) times what was measured, sample by sample; a gap begins anew."""
    flight = small.flight(small.model(small.TAIL), 80)
    flight.rates[50] = np.nan
    gap = replace(flight, stretch_number=(np.arange(80) >= 30).astype(np.int64))
    found = whiten_samples(gap, AVERAGE, 1.7)
    assert (found.noise_ma_coefficients, found.fit_weight) == (AVERAGE, 1.7)
    assert whiten_samples(gap, list(AVERAGE)).fit_weight == 1.0
    columns = ("rates", "commands", "signals")
    for now, was in ((getattr(found, name), getattr(flight, name)) for name in columns):
        again = now[2:] + AVERAGE[1] * now[1:-1] + AVERAGE[2] * now[:-2]
        inside = np.setdiff1d(np.arange(2, 80), [30, 31, 50, 51, 52])
        np.testing.assert_allclose(again[inside - 2], sum(AVERAGE) * was[inside], atol=1e-12)
        np.testing.assert_array_equal(now[[0, 30, 51]], was[[0, 30, 51]])
    assert np.isnan(found.rates[50]).all()
    assert np.isfinite(found.rates[51:]).all()


def flown(colour, answers, n, seed):
    """Rates that a law answers, with noise of a colour: p' = 0.9 p + 0.5 u + noise."""
    rng = np.random.default_rng(seed)
    white, wanted = 0.02 * rng.standard_normal((n + 2, 3)), 0.01 * rng.standard_normal((n, 2))
    noise = sum(c * white[2 - j : n + 2 - j] for j, c in enumerate(colour))
    rates, commands = np.zeros((n, 3)), np.zeros((n, 2))
    for k in range(n):
        if k:
            moved = np.array([commands[k - 1, 0], commands[k - 1, 1], 0.3 * commands[k - 1, 0]])
            rates[k] = 0.9 * rates[k - 1] + 0.5 * moved + noise[k]
        commands[k] = wanted[k] - answers * rates[k, :2]
    like = small.flight(small.model(), n, name=f"flight-{seed}")
    nothing = np.full((n, 2), np.nan)
    return replace(like, rates=rates, commands=commands, labels=nothing, signals=np.empty((n, 0)), dt_s=0.01)


VEHICLE = small.vehicle(
    surfaces={"right": {"roll": 1.0}, "left": {"pitch": 1.0}}, labels={}, other_laws=True, moving_air=True
)


def first_response(flights):
    """Of the roll rate to its own command, by the order that the criterion takes."""
    model = fitting.fit_model(fitting.fit_parts(flights), VEHICLE)
    return model.command_response[0][0][0]


def test_a_fit_finds_the_colours_that_a_law_answers():
    """The response is 0.5. A fit that takes coloured noise for white is farther off."""
    flights = [flown(AVERAGE if i % 2 else (1.0,), 0.5 + 0.1 * i, 4000, i) for i in range(4)]
    white = identification.whiten_flights(flights, VEHICLE)
    colours = [one.noise_ma_coefficients for one in white]
    assert colours == colours[:2] * 2
    assert len(set(colours)) == 2
    assert abs(first_response(white) - 0.5) < 0.5 * abs(first_response(flights) - 0.5)


def test_air_that_stands_still_is_left_alone():
    flights = [flown((1.0,), 0.5, 200, 1)]
    assert identification.whiten_flights(flights, VEHICLE.model_copy(update={"moving_air": False})) == flights


def test_a_model_of_two_colours_takes_the_likelier():
    """Each flight through the noise it has, picked at once, is as if the other had never been seen."""
    flights = [flown(AVERAGE if i % 2 else (1.0,), 0.5, 3000, i) for i in range(4)]
    white = identification.whiten_flights(flights, VEHICLE)
    model = fitting.fit_model(fitting.fit_parts(white), VEHICLE)
    assert len(model.noise_models) == 2
    assert all(one.covariance_inflation >= 1.0 for one in model.noise_models)
    for i in (0, 1):
        new = flown(AVERAGE if i else (1.0,), 0.5, 1500, 9 + i)
        own = [
            one for one in model.noise_models if tuple(one.ma_coefficients) == white[i].noise_ma_coefficients
        ]
        alone = model.model_copy(update={"noise_models": own})
        both = bank_posterior(new, model, build_bank(model))[0][300:]
        np.testing.assert_allclose(
            both,
            bank_posterior(new, alone, build_bank(model))[0][300:],
            atol=1e-6,
        )


def test_bounds_lean_on_no_prior_where_laws_differ():
    """With nothing known but how rare faults are, each of eleven levels is as likely: 90 % are ten."""
    model = small.model(small.WING | {"other_laws": True})
    bank, samples = build_bank(model), small.flight(model, 50)
    nothing = np.tile(bank.prior_probability, (50, 1))
    rows = diagnose.rows_of_posterior(samples, model, bank, nothing)
    assert (rows.effectiveness_high - rows.effectiveness_low >= 0.9).all()
    plain = small.model()
    rows = diagnose.rows_of_posterior(
        samples,
        plain,
        build_bank(plain),
        np.tile(build_bank(plain).prior_probability, (50, 1)),
    )
    assert (rows.effectiveness_low > 0.9).all()


def test_the_predictor_of_a_residual_is_found():
    """Drawn: e[k] = 0.8 e[k-1] + w[k]. The remaining noise is that of w; few samples give no predictor."""
    rng, size = np.random.default_rng(3), np.array([0.1, 0.2, 0.05])
    e = np.zeros((20_000, 3))
    w = size * rng.standard_normal(e.shape)
    for k in range(1, len(e)):
        e[k] = 0.8 * e[k - 1] + w[k]
    rows = np.concatenate([np.arange(9_000), np.arange(9_500, 20_500)])
    found = fitting._fit_noise_model([1.0], [(rows, e)])
    before = np.reshape(found.ar_coefficients, (-1, 3, 3))
    np.testing.assert_allclose(before[0], 0.8 * np.eye(3), atol=0.1)
    np.testing.assert_allclose(np.diag(found.residual_covariance), size**2, rtol=0.05)
    np.testing.assert_allclose(before[1:].sum(axis=0), 0.0, atol=0.15)
    few = fitting._fit_noise_model([1.0], [(np.arange(100), e[:100])])
    assert few.ar_coefficients == []
    np.testing.assert_allclose(few.residual_covariance, np.cov(e[:100].T))


def in_colour(before):
    """A model that has heard one colour, and a flight of it."""
    plain = small.model()
    colour = NoiseModel(
        average=[1.0], noise=plain.residual_covariance, before=np.reshape(before, (-1, 3)).tolist()
    )
    model = plain.model_copy(update={"noise_models": [colour]})
    return model, replace(small.flight(model, 60), noise_ma_coefficients=(1.0,))


def test_answers_and_constant_are_whitened_as_the_residual_is():
    """Of a steady flight by hand: what is foretold of a constant is its share; without a past nothing is."""
    by = np.diag([0.5, 0.2, 0.0])
    model, flight = in_colour([by, 0.1 * np.eye(3)])
    ok, left, answers = whitened_rates(flight, model)
    known, plain, heard = unexplained_rates(flight, model)
    np.testing.assert_allclose(left[7], plain[7] - plain[6] @ by - 0.1 * plain[5])
    np.testing.assert_allclose(answers[7], heard[7] - heard[6] @ by - 0.1 * heard[5])
    assert ok.sum() == known.sum() - 2
    np.testing.assert_allclose(model.whitened_intercept((1.0,)), np.array(model.intercept) * [0.4, 0.7, 0.9])
    np.testing.assert_array_equal(model.whitened_intercept(()), model.intercept)


@pytest.mark.parametrize(("size", "learns"), [(3.0, True), (50.0, False)])
def test_a_sample_that_nothing_explains_teaches_nothing(size, learns):
    """As just after a fault, which is whitened as if it had been there before."""
    model, _ = in_colour([0.5 * np.eye(3)])
    noise = build_noise(model, (1.0,))
    m, p = np.zeros(3), 0.01 * noise.covariance
    y = size * np.sqrt(np.diag(noise.covariance)) * [1.0, 0.0, 0.0]
    _update(m, p, y, np.eye(3), noise.covariance, noise)
    assert (m[0] > 0.0) == learns
    assert build_noise(model).max_squared_residual == np.inf


@pytest.mark.parametrize("wider", [1.0, 4.0])
def test_the_scale_of_the_noise_is_of_residuals_however_wide_it_is_taken(wider):
    """Five memories long: else the scale takes back what was taken wider."""
    model, _ = in_colour(np.zeros((1, 3, 3)))
    model = model.model_copy(
        update={"noise_models": [model.noise_models[0].model_copy(update={"covariance_inflation": wider})]}
    )
    flight = replace(small.flight(model, 3000, seed=3), noise_ma_coefficients=(1.0,))
    scale = bank_posterior(flight, model, build_bank(model))[2]
    assert scale[-1] == pytest.approx(1.0, abs=0.15)
    assert build_noise(model.with_noise_of((1.0,)), (1.0,)).covariance == pytest.approx(
        wider * np.array(model.residual_covariance)
    )


@pytest.mark.parametrize(("average", "factor"), [((1.0, -0.8, 0.16), 1.7), ((1.0, 0.5), 2.5), ((1.0,), 2.5)])
def test_of_another_law_the_noise_is_taken_wider(monkeypatch, average, factor):
    """By what was seen to be asked for after gyros and after gusts; of the laws seen not at all."""
    plain = small.model(small.WING | {"moving_air": True})
    colour = NoiseModel(average=list(average), noise=plain.residual_covariance)
    monkeypatch.setattr(fitting, "_folds", lambda *_: [(model, usable_flights)])
    found = []
    for laws in (False, True):
        vehicle = plain.vehicle.model_copy(update={"other_laws": laws})
        model = plain.model_copy(update={"noise_models": [colour], "vehicle": vehicle})
        flight = replace(small.flight(model, 400, seed=5), noise_ma_coefficients=average)
        usable_flights = [fitting.FitPart(flight, np.ones(400, dtype=bool))]
        found.append(fitting._with_inflated_noise(usable_flights, model).inflation_of(average))
    assert found[0] >= 1.0
    assert found[1] == pytest.approx(factor * found[0])
    monkeypatch.setattr(fitting, "_error_and_rank", lambda *_: (1e6, 1))
    assert fitting._with_inflated_noise(usable_flights, model).inflation_of(average) == pytest.approx(
        200.0 * factor
    )


@pytest.fixture(scope="module")
def moving():
    """A model of two colours, identified from flights of a law that answers rates."""
    flights = [flown(AVERAGE if i % 2 else (1.0,), 0.5 + 0.2 * i, 4000, i) for i in range(4)]
    white = identification.whiten_flights(flights, VEHICLE)
    return fitting.fit_model(fitting.fit_parts(white), VEHICLE)


@pytest.mark.parametrize("colour", [AVERAGE, (1.0,)])
def test_columns_are_compared_in_white(moving, colour):
    """A command of the other sign is told; one that a law moves by the noise itself is not taken for it."""
    flight = flown(colour, 1.1, 4000, 21)
    trust.refuse_columns(flight, moving)
    found = [
        trust._bound_gains(whiten_samples(flight, one.ma_coefficients), moving) for one in moving.noise_models
    ]
    likeliest = max(
        zip(found, moving.noise_models, strict=True),
        key=lambda pair: pair[0].part_likelihoods.mean(),
    )
    assert all(1.0 < gain < 1.6 for gain in likeliest[0].upper_gains)
    plain = trust._bound_gains(flight, moving.model_copy(update={"noise_models": []}))
    assert colour == (1.0,) or min(plain.upper_gains) > 1.9  # what coloured noise does to the fit
    with pytest.raises(BadInput, match="answer the command of right the other way round"):
        trust.refuse_columns(replace(flight, commands=flight.commands * [-1.0, 1.0]), moving)


def test_a_signal_of_other_size_is_told_in_moving_air_too(moving):
    flight = flown((1.0,), 0.5, 4000, 22)
    known = FittedRanges(
        commands=trust.central_ranges(flight.commands), rates=trust.central_ranges(flight.rates)
    )
    moving = moving.model_copy(update={"fitted_ranges": known})
    trust.refuse_columns(flight, moving)
    with pytest.raises(BadInput, match=r"likely with `scale: 0.01745` on p_rad_s"):
        trust.refuse_columns(replace(flight, rates=flight.rates * [20.0, 1.0, 1.0]), moving)


@pytest.mark.parametrize(("keys", "rate_hz"), [
    ({}, 20.0), ({"max_rate_hz": 40}, 40.0), ({"moving_air": True}, 100.0),
    ({"moving_air": True, "max_rate_hz": 50}, 50.0),
])  # fmt: skip
def test_a_model_that_is_read_again_samples_as_it_did(tmp_path, keys, rate_hz):
    """In memory a key that was left out is known to be; a file has every key."""
    model = small.model(small.WING | keys)
    assert model.vehicle.max_sample_rate_hz == rate_hz
    (tmp_path / "model.json").write_text(model_file_text(model))
    assert load_model(tmp_path / "model.json").vehicle.max_sample_rate_hz == rate_hz


def test_a_flight_is_tried_with_noise_that_no_fitted_flight_had(moving):
    """The fitted colours stay as they were; the noise of another gust is what it leaves of the flights, and
    that of noisier gyros grows with them."""
    flights = [flown((1.0,), 0.5, 2000, 31)]
    model = moving.model_copy(update={"noise_models": moving.noise_models[:1]})
    found = identification.add_unseen_noise(model, flights)
    gyros = found.noise_models[-len(samples.UNFITTED_GYROS_RAD_S) :]
    others = found.noise_models[1:]
    others = others[: -len(gyros)]
    assert found.noise_models[0] == model.noise_models[0]
    assert {tuple(one.ma_coefficients) for one in others} == {*samples.UNFITTED_MA} - {
        tuple(model.noise_models[0].ma_coefficients)
    }
    for one in others:
        white = fitting.fit_parts([whiten_samples(flights[0], one.ma_coefficients)])[0]
        assert np.allclose(one.residual_covariance, np.cov(fitting.one_step_residual(model, white)[1].T))
    assert (np.diff([np.linalg.det(one.residual_covariance) for one in gyros]) > 0.0).all()
    assert {one.covariance_inflation for one in gyros} == {model.noise_models[0].covariance_inflation}
    assert {one.usual_quick_power for one in found.noise_models[1:]} == {
        model.noise_models[0].usual_quick_power
    }
    assert identification.add_unseen_noise(small.model(), flights).noise_models == []


@pytest.mark.parametrize("a", [0.9, 0.3])
def test_the_colour_of_gyro_noise_follows_from_the_model(a):
    """w[k] = e[k] + v[k] - a v[k-1] is MA(1): its innovations have the variance S = g0 - g1^2 / S, and the
    predictor of w[k] has the coefficients -(-g1 / S)^j."""
    model, gyro = small.model(history=1, past=(a * np.eye(3)).tolist()), 0.05
    process = np.diag([1.0, 4.0, 9.0]) * 1e-4
    before, noise = gyro_noise.yule_walker_predictor(model, process, gyro, 40)
    g0, g1 = np.diag(process) + gyro**2 * (1.0 + a**2), -a * gyro**2
    innovation = 0.5 * (g0 + np.sqrt(g0**2 - 4.0 * g1**2))
    np.testing.assert_allclose(noise, np.diag(innovation), rtol=1e-6, atol=1e-12)
    for j in (1, 2, 5):
        expected = -((-g1 / innovation) ** j)
        np.testing.assert_allclose(before.reshape(-1, 3, 3)[j - 1], np.diag(expected), atol=1e-6)


def test_of_coupled_axes_and_two_lags_the_colour_of_gyro_noise_is_that_of_its_covariance():
    """Against one large matrix: what the residuals of 6 samples are of the gyro's noise of 9 of them."""
    past = [numbers(3, 3, seed=seed, size=0.2) for seed in (1, 2)]
    model, gyro, lags = small.model(past=np.vstack(past).tolist()), 0.03, 5
    root = np.array([[0.02, 0.0, 0.0], [0.007, 0.03, 0.0], [-0.004, 0.011, 0.05]])
    process = root @ root.T
    of_noise = np.zeros((3 * (lags + 1), 3 * (lags + 3)))
    for k in range(lags + 1):  # the latest sample first, of rows w[k] = v[k] - v[k-1] A1 - v[k-2] A2
        rows = slice(3 * k, 3 * k + 3)
        of_noise[rows, rows] = np.eye(3)
        for lag, share in enumerate(past, 1):
            of_noise[rows, 3 * (k + lag) : 3 * (k + lag) + 3] = -share.T
    covariance = gyro**2 * of_noise @ of_noise.T + np.kron(np.eye(lags + 1), process)
    before, noise = gyro_noise.yule_walker_predictor(model, process, gyro, lags)
    expected = np.linalg.solve(covariance[3:, 3:], covariance[3:, :3])
    np.testing.assert_allclose(before, expected, atol=1e-9)
    np.testing.assert_allclose(noise, covariance[:3, :3] - covariance[:3, 3:] @ expected, atol=1e-12)
    assert np.abs(before).min() > 1e-5


def test_noisier_gyros_are_added_to_the_quietest_noise_and_as_wide_as_the_widest(moving):
    """Each with the predictor of as many lags as the fit has, by the covariance of least determinant."""
    quiet, loud = np.diag([1.0, 2.0, 3.0]) * 1e-6, np.diag([0.5, 9.0, 8.0]) * 1e-6
    known = [
        NoiseModel(average=[1.0], noise=loud.tolist(), wider=1.5, quick=7.0),
        NoiseModel(average=[1.0, 0.5], noise=quiet.tolist(), wider=2.5, quick=5.0),
        NoiseModel(average=list(AVERAGE), noise=loud.tolist(), wider=1.25),
    ]
    model = moving.model_copy(update={"noise_models": known})
    found = identification.add_unseen_noise(model, []).noise_models
    assert found[:3] == known
    assert len(found) == 3 + 7
    for one, gyro in zip(found[3:], np.geomspace(1e-5, 1e-2, 7), strict=True):
        before, noise = gyro_noise.yule_walker_predictor(model, quiet, gyro, 20)
        assert (one.ma_coefficients, one.covariance_inflation) == ([1.0], 2.5)
        assert one.usual_quick_power == 5.0  # of the noise whose responses are slowest
        np.testing.assert_allclose(one.ar_coefficients, before, atol=1e-12)
        np.testing.assert_allclose(one.residual_covariance, noise, atol=1e-15)


def test_flights_weigh_by_what_their_own_colour_leaves_of_the_mean(monkeypatch):
    """A sixth of the log determinant is a size. Colours that are as they were before end the rounds."""
    flights = [replace(small.flight(small.model(), 30), name=name) for name in "abc"]
    first = {"a": (1.0,), "b": (1.0, 0.5), "c": AVERAGE}
    rounds = [
        {"a": (2.0, (1.0, 0.5)), "b": (5.0, (1.0, 0.5)), "c": (-1.0, AVERAGE)},
        {"a": (1.0, (1.0, 0.5)), "b": (4.0, (1.0, 0.5)), "c": (4.0, (1.0,))},
        {"a": (7.0, (1.0, 0.5)), "b": (8.0, (1.0, 0.5)), "c": (9.0, (1.0,))},
    ]
    asked = []

    def best(usable_flights, vehicle, lags, coefficients):
        (one,) = usable_flights
        asked.append(one.samples.name)
        assert one.samples.noise_ma_coefficients == ()  # of the flight as it was logged
        return rounds[(len(asked) - 1) // 3][one.samples.name]

    monkeypatch.setattr(identification, "_choose_ma", lambda one, *_: first[one.name])
    monkeypatch.setattr(identification, "_best_ma", best)
    found = identification.whiten_flights(flights, VEHICLE)
    assert asked == list("abcabcabc")
    mean = (1.0 + 4.0 + 4.0) / 3.0  # of the second round, whose colours the third confirms
    for one, flight in zip(found, flights, strict=True):
        left, colour = rounds[1][one.name]
        assert one.noise_ma_coefficients == colour
        assert one.fit_weight == pytest.approx(np.exp((mean - left) / 6.0))
        np.testing.assert_array_equal(one.rates, whiten_samples(flight, colour).rates)
    monkeypatch.setattr(identification, "_MAX_ROUNDS", 1)
    asked.clear()
    found = identification.whiten_flights(flights, VEHICLE)
    assert [one.fit_weight for one in found] == pytest.approx(
        np.exp([(2.0 - left) / 6.0 for left in (2, 5, -1)])
    )


@pytest.mark.parametrize("colour", [(1.0,), (1.0, 0.5), (1.0, -1.6, 0.64)])
def test_the_colour_of_a_residual_leaves_least_of_it_and_how_much_is_told_by_its_size(monkeypatch, colour):
    """Of white noise of known size through C(z) / C(1); the size is that of the noise."""
    rng, size, n = np.random.default_rng(6), np.array([0.1, 0.2, 0.3]), 1500
    white = size * rng.standard_normal((n + 2, 3))
    noise = sum(c * white[2 - lag : n + 2 - lag] for lag, c in enumerate(colour)) / sum(colour)
    regressors, coefficients = rng.standard_normal((n, 4)), numbers(4, 3, seed=3)
    answer = regressors, noise + regressors @ coefficients, None
    monkeypatch.setattr(fitting, "stack_data", lambda *_: answer)
    left, found = identification._best_ma([], VEHICLE, (1, 1), coefficients)
    assert found == pytest.approx(colour)
    assert left == pytest.approx(2.0 * np.log(size).sum(), abs=0.3)


def test_no_row_depends_on_a_later_sample_by_which_noise_is_likely(moving):
    """A colour is filtered up to where it counts last: which that is, the whole flight says."""
    new = flown(AVERAGE, 0.5, 1500, 9)
    whole = bank_posterior(new, moving, build_bank(moving))
    short = bank_posterior(samples.first_samples(new, 600), moving, build_bank(moving))
    for part, cut in zip(whole, short, strict=True):
        np.testing.assert_array_equal(part[:600], cut)


def test_noise_by_which_parts_are_compared_is_that_of_the_fit():
    """Not that taken wider, for which a sample counts as many times less; a filtered sample is C(1) times as
    large as what was measured."""
    noise = np.array([[0.0031, -0.0007, 0.0006], [-0.0007, 0.0019, 0.0002], [0.0006, 0.0002, 0.0008]])
    colour = {"average": [1.0, -0.4], "noise": noise.tolist(), "wider": 1.7}
    model = small.model(colours=[colour], settings={"power": 0.8})
    flight = replace(small.flight(model, 9), noise_ma_coefficients=(1.0, -0.4))
    white, share, size = trust._whitening(flight, model)
    np.testing.assert_allclose(white @ white.T, np.linalg.inv(noise))
    assert (share, size) == (
        pytest.approx(0.8 / 1.7), pytest.approx(0.5 * np.log(np.linalg.det(noise)) - 3.0 * np.log(0.6)),
    )  # fmt: skip
    white, share, size = trust._whitening(small.flight(model, 9), model)
    plain = np.array(model.residual_covariance)
    np.testing.assert_allclose(white @ white.T, np.linalg.inv(plain))
    assert (share, size) == (0.8, pytest.approx(0.5 * np.log(np.linalg.det(plain))))


BEFORE = np.array([[[0.4, 0.05, -0.03], [0.02, 0.3, 0.07], [-0.06, 0.01, 0.2]]])


def by_parts(model, flight, every=1):
    """Of each quarter of the flight: least squares on trims and answers, four errors either way, and the
    squares of what is left, by the symmetric root of the noise."""
    ok, left, shown = unexplained_rates(flight, model)
    rows = np.array([k for k in np.flatnonzero(ok) if k and ok[k - 1]])[::every]
    size, turn = np.linalg.eigh(np.array(model.noise_models[0].residual_covariance))
    root = turn @ np.diag(size**-0.5) @ turn.T
    for part in np.array_split(rows, 4):
        y = np.concatenate([(left[k] - left[k - 1] @ BEFORE[0]) @ root for k in part])
        x = np.vstack([
            np.column_stack([root, ((shown[k] - shown[k - 1] @ BEFORE[0]) @ root).T]) for k in part
        ])  # fmt: skip
        value = np.linalg.lstsq(x, y, rcond=None)[0]
        squares = (y - x @ value) ** 2
        share = model.settings.effective_sample_share / model.noise_models[0].covariance_inflation
        errors = np.sqrt(np.diag(np.linalg.inv(x.T @ x)) * squares.mean() / share)
        yield len(part), value[3:] - 4.0 * errors[3:], value[3:] + 4.0 * errors[3:], squares


def test_what_answers_in_every_part_of_a_flight_is_by_least_squares_of_each(monkeypatch):
    """The largest of upper and the least of lower bounds. A scale by the median of three squares, which is
    2.366 of a right one."""
    model, _ = in_colour(BEFORE)
    colours = [model.noise_models[0].model_copy(update={"covariance_inflation": 1.7})]
    settings = model.settings.model_copy(update={"effective_sample_share": 0.8})
    model = model.model_copy(update={"noise_models": colours, "settings": settings})
    flight = small.flight(model, 421, gap=130, lost=((0, 0, 420, 0.7), (1, 200, 300, 0.2)))
    flight = replace(flight, noise_ma_coefficients=(1.0,))
    bare = [*by_parts(model, flight)]
    found = trust._bound_gains(flight, model)
    lows, highs = (np.array([part[i] for part in bare]) for i in (1, 2))
    np.testing.assert_allclose(found.upper_gains, highs.max(axis=0), rtol=1e-6)
    np.testing.assert_allclose(found.lower_gains, lows.min(axis=0), rtol=1e-6)
    scales = [np.median(part[3].reshape(-1, 3).sum(axis=1)) / 2.366 for part in bare]
    noise = 0.5 * np.linalg.slogdet(colours[0].residual_covariance)[1]
    np.testing.assert_allclose(found.part_likelihoods, -noise - 1.5 * np.log(scales))
    likely, count = trust._likelihoods_and_size(flight, model)
    np.testing.assert_allclose(likely, found.part_likelihoods)
    least = min(part[0] for part in bare)
    assert (len({part[0] for part in bare}), count) == (2, pytest.approx(least * 0.8 / 1.7))
    monkeypatch.setattr(trust, "_MAX_COMPARED_SAMPLES", 130)  # of 413 every third
    monkeypatch.setattr("beaver_ftc_logs.regression._MIN_PART_ROWS", 34)
    likely, count = trust._likelihoods_and_size(flight, model)
    scales = [np.median(part[3].reshape(-1, 3).sum(axis=1)) / 2.366 for part in by_parts(model, flight, 3)]
    np.testing.assert_allclose(likely, -noise - 1.5 * np.log(scales))
    assert count == pytest.approx(34 * 0.8 / 1.7)
    monkeypatch.setattr("beaver_ftc_logs.regression._MIN_PART_ROWS", 35)
    assert trust._likelihoods_and_size(flight, model) is None


def test_the_colour_of_gyro_noise_by_every_pair_of_residuals():
    """Two lags whose coefficients are not alike across: the covariance of four residuals as a map of what
    moved the aircraft and what its gyros added, and the regression of the latest on the others."""
    rng = np.random.default_rng(8)
    a = 0.4 * rng.uniform(-1.0, 1.0, (2, 3, 3)) + [np.diag([0.5, 0.6, 0.7]), np.zeros((3, 3))]
    root = 0.01 * (np.eye(3) + np.tril(rng.uniform(0.2, 0.9, (3, 3))))
    model, gyro = small.model(past=a.reshape(6, 3).tolist()), 0.013
    moved, added = np.zeros((12, 12)), np.zeros((12, 18))
    for k in range(4):  # the latest is the first; w = e + v - before @ a, as rows
        moved[3 * k : 3 * k + 3, 3 * k : 3 * k + 3] = root
        added[3 * k : 3 * k + 3, 3 * k : 3 * k + 3] = np.eye(3)
        for j in (1, 2):
            added[3 * k : 3 * k + 3, 3 * (k + j) : 3 * (k + j) + 3] = -a[j - 1].T
    covariance = moved @ moved.T + gyro**2 * added @ added.T
    by = np.linalg.solve(covariance[3:, 3:], covariance[3:, :3])
    before, noise = gyro_noise.yule_walker_predictor(model, root @ root.T, gyro, 3)
    np.testing.assert_allclose(before, by, rtol=1e-9)
    np.testing.assert_allclose(noise, covariance[:3, :3] - covariance[:3, 3:] @ by, rtol=1e-9)
    one, rest = gyro_noise.yule_walker_predictor(model, root @ root.T, gyro, 1)
    by = np.linalg.solve(covariance[3:6, 3:6], covariance[3:6, :3])
    np.testing.assert_allclose(one, by, rtol=1e-9)
    np.testing.assert_allclose(rest, covariance[:3, :3] - covariance[:3, 3:6] @ by, rtol=1e-9)


@pytest.mark.parametrize(("odds", "low"), [(30.0, 0.05), (100.0, 0.95)])
def test_bounds_by_healthy_flights_of_other_laws_keep_health_and_a_loss_of_which_little_is_known(odds, low):
    """Health has odds of 30 against the level 0.1, which is half a step wide each way. The loss is within the
    bounds, for 30 / 31 is less than the mass. With odds of 100, 100 / 101 is more: health stands alone."""
    plain = small.model(small.WING | {"other_laws": True, "moving_air": True})
    quiet = fitting.fit_parts([small.flight(plain, 300)])
    settings = fitting.estimate_filter_settings(quiet, plain)
    model = plain.model_copy(update={"settings": settings})
    bank = build_bank(model)
    levels, prior = diagnose._group_levels(bank, bank.prior_probability[None, :-1], 0)
    health, lost = prior[0, np.isclose(levels, 1.0)], prior[0, np.isclose(levels, 0.1)]
    posterior = np.zeros((1, len(bank.hypothesis_kind)))
    posterior[0, 0] = odds * health[0]
    posterior[0, np.isclose(bank.effectiveness[:, 0], 0.1).argmax()] = lost[0]
    posterior /= posterior.sum()
    _, found, high = diagnose._group_bounds(bank, posterior[:, :-1], 0, model)
    assert (found, high) == (pytest.approx([low]), pytest.approx([1.0]))
