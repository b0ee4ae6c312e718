"""What of a flight is adapted: its delay, its trim, its gain; bounded, and never by looking ahead."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from beaver_ftc_logs import filtering
from beaver_ftc_logs.bank import ResidualNoise, build_bank, build_states
from beaver_ftc_logs.filtering import (
    _model_weights,
    _update,
    _with_command_delay,
    bank_posterior,
)
from beaver_ftc_logs.model import NoiseModel
from beaver_ftc_logs.samples import load_flights_for_fit
from products.logs import small, synthetic
from telling import apart


@pytest.fixture(scope="module")
def healthy(wing, wing_folder):
    columns = synthetic.fly(200.0, seed=31)
    return load_flights_for_fit([synthetic.write_csv(wing_folder / "healthy.csv", columns)], wing)[0]


def delays_of(samples, model):
    """Which delay explains a flight best, by running each alone."""
    bank = build_bank(model)
    from beaver_ftc_logs.filtering import _run_flight

    evidence = [
        _run_flight(_with_command_delay(samples, d), model, bank)[3] for d in model.settings.command_delays_s
    ]
    return _model_weights(evidence, model.rate_hz)


@pytest.mark.parametrize(("command_delay_s", "which"), [(-0.04, 0), (0.0, 1), (0.04, 2)])
def test_the_delay_of_a_flight_is_found(healthy, wing_model, command_delay_s, which):
    at = np.arange(len(healthy.t_s)) + command_delay_s * wing_model.rate_hz
    columns = [np.interp(at, np.arange(len(at)), column) for column in healthy.commands.T]
    weights = delays_of(replace(healthy, commands=np.column_stack(columns)), wing_model)
    assert weights[:, -1].argmax() == which
    assert weights[which, -1] > 0.9


def test_a_delayed_flight_takes_nothing_from_later(healthy, wing_model):
    """Changing a command changes no row before it, with every delay tried."""
    k = 700
    commands = healthy.commands.copy()
    commands[k + 1 :] += 0.3
    bank = build_bank(wing_model)
    one = bank_posterior(healthy, wing_model, bank)[0]
    other = bank_posterior(replace(healthy, commands=commands), wing_model, bank)[0]
    assert np.array_equal(one[: k + 1], other[: k + 1])
    assert not np.array_equal(one[k + 2], other[k + 2])


def test_a_shift_of_a_command_is_within_the_spread_of_the_trim(wing_model):
    """The covariance of the trim is that of many drawn shifts, through the model's own responses."""
    settings = wing_model.settings
    _, _, response, noise = wing_model.as_arrays()
    rng = np.random.default_rng(4)
    shifts = settings.trim_command_shift_sd * rng.standard_normal((200_000, len(response)))
    free = settings.trim_sd * np.sqrt(np.diag(noise)) * rng.standard_normal((200_000, 3))
    drawn = np.cov((shifts @ response.sum(axis=1) + free).T)
    np.testing.assert_allclose(
        build_states(wing_model).initial_covariance[:3, :3], drawn, atol=2e-2 * drawn.max()
    )


def test_gains_return_in_their_time(wing_model):
    """After a long time the spread of each gain is that of the settings, whatever it was."""
    own = build_states(wing_model)
    variance = np.zeros(len(own.initial_mean))
    for _ in range(200_000):
        variance = own.deviation_retention**2 * variance + own.random_walk_variance
    assert np.sqrt(variance[3]) == pytest.approx(wing_model.settings.gain_sd, rel=1e-3)
    assert np.sqrt(variance[4]) == pytest.approx(wing_model.settings.own_gain_spread, rel=1e-3)


def test_a_fault_from_the_start_is_not_learnt_away(wing, wing_folder, wing_model):
    """Weak from the first sample on, for five minutes: neither gain nor trim takes it over."""
    from beaver_ftc_logs.diagnose import diagnose

    columns = synthetic.fly(300.0, parts=((0, 300, 1.0, 0.5),), seed=33)
    samples = load_flights_for_fit([synthetic.write_csv(wing_folder / "weak.csv", columns)], wing)[0]
    rows = diagnose(samples, wing_model)
    late = rows.t_s > 60.0
    assert rows.faulty[late].mean() > 0.95
    assert np.median(rows.effectiveness[late, 1]) == pytest.approx(0.5, abs=0.101)


def with_settings(model, **changes):
    return model.model_copy(update={"settings": model.settings.model_copy(update=changes)})


def test_the_trim_wanders_as_far_as_the_settings_say(wing_model):
    """A walk of so many residual sd a sample has gone 30 times that after 900 samples."""
    walk = [2e-3, 1e-3, 4e-3]
    own = build_states(with_settings(wing_model, trim_step_sd=walk))
    noise_sd = np.sqrt(np.diag(np.array(wing_model.residual_covariance)))
    drawn = np.random.default_rng(6).standard_normal((4000, 900, 3)).sum(axis=1) * np.array(walk) * noise_sd
    np.testing.assert_allclose(np.sqrt(900 * own.random_walk_variance[:3]), drawn.std(axis=0), rtol=0.05)


def test_a_trim_that_drifts_is_followed_if_it_may(healthy, wing_model):
    """A pitching moment that grows: where the settings let the trim wander it is found there."""
    sd, past = (
        np.sqrt(np.diag(np.array(wing_model.residual_covariance)))[1],
        np.array(wing_model.past_coefficients),
    )
    moment = np.clip((healthy.t_s - 60.0) / 100.0, 0.0, 1.0) * 0.8 * sd
    answer = np.zeros((len(moment) + wing_model.n_rate_lags, 3))  # of the rates, by the model's own past
    for k, off in enumerate(moment, wing_model.n_rate_lags):
        before = np.concatenate([answer[k - lag] for lag in range(1, wing_model.n_rate_lags + 1)])
        answer[k] = before @ past + [0.0, off, 0.0]
    drifting = replace(healthy, rates=healthy.rates + answer[wing_model.n_rate_lags :])
    found = {}
    for walk in (1e-6, 2e-2):
        model = with_settings(
            wing_model,
            trim_step_sd=[walk] * 3,
            max_trim_sd=40.0,
            command_delays_s=[0.0],
        )
        one, other = (
            bank_posterior(flight, model, build_bank(model))[1][-1, 1] for flight in (drifting, healthy)
        )
        found[walk] = one - other
    assert found[2e-2] == pytest.approx(moment[-1], rel=0.15)
    assert found[1e-6] < 0.8 * moment[-1]


@pytest.mark.parametrize("memory_s", [20.0, 60.0])
def test_the_scale_of_the_noise_has_the_memory_of_the_settings(healthy, wing_model, memory_s):
    """Residuals far beyond what is clipped, at 3 times what is expected: the scale grows by e in
    memory / (3 - 0.93), whatever they are."""
    rng = np.random.default_rng(8)
    rates = healthy.rates.copy()
    rates[600:] += 5.0 * rng.choice([-1.0, 1.0], (len(rates) - 600, 3))
    model = with_settings(wing_model, noise_scale_memory_s=memory_s, command_delays_s=[0.0])
    bank = build_bank(model)
    posterior, _, scale = bank_posterior(replace(healthy, rates=rates), model, bank)
    begin, end = 620, 620 + round(0.4 * memory_s * wing_model.rate_hz)
    answering = 1.0 - posterior[begin + 1 : end + 1, bank.no_response_hypothesis_index].mean()
    grown = np.log(scale[end] / scale[begin])
    assert scale[end] < 6.0
    assert grown == pytest.approx(0.4 * (3.0 - 0.93) * answering, rel=0.02)


def test_a_covariance_stays_symmetric_to_the_bit():
    """As (P^-1 + H' R^-1 H)^-1; rounding that leaves it unsymmetric grows over a flight until it is none."""
    rng = np.random.default_rng(4)
    root, seen, noise = rng.standard_normal((5, 5)), rng.standard_normal((5, 3)), np.diag([0.2, 0.3, 0.1])
    p = root @ root.T + 0.1 * np.eye(5)
    expected = np.linalg.inv(np.linalg.inv(p) + seen @ np.linalg.inv(noise) @ seen.T)
    normal = ResidualNoise(np.zeros(3), noise, 1.0, 1e9, 1.0, 1.0, 1.0, np.inf, 1.0)
    _update(np.zeros(5), p, np.zeros(3), seen, noise, normal)
    assert (p == p.T).all()
    assert p == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("average", [(1.0, 0.6, -0.2), (1.0, -0.35)])
@pytest.mark.parametrize("usual", [np.inf, 0.4])
def test_a_colour_is_no_likelier_by_the_size_that_filtering_gives_a_sample(monkeypatch, average, usual):
    """Filtered by C(1) / C(z) a white residual is C(1) times as large, and so are its noise and the answers:
    the density by each is the same once the volume is."""
    rng, gain = np.random.default_rng(5), sum(average)
    white = rng.normal(0.0, (0.05, 0.02, 0.09), (40, 3))
    noise = np.array([[0.0025, 0.0003, -0.0007], [0.0003, 0.0004, 0.0001], [-0.0007, 0.0001, 0.0081]])
    constant, known = np.array([0.3, -0.2, 0.1]), np.arange(40) != 7
    apart(noise=noise[np.triu_indices(3)], constant=constant, average=average)
    settings = SimpleNamespace(t_degrees_of_freedom=7.0, effective_sample_share=0.4, quick_error_share=0.6)
    model = SimpleNamespace(
        settings=settings,
        whitened_intercept=lambda average: sum(average) * constant,
        usual_quick_power=lambda average: usual,
        covariance_of_noise=lambda average: sum(average) ** 2 * noise,
        rate_hz=8.0,
    )
    found, answers_by_hand = [], rng.normal(0.0, 0.05, (40, 2, 3))
    for of, size in ((average, gain), ((1.0,), 1.0)):
        answers = size * answers_by_hand
        unexplained = size * (white + constant) + answers.sum(axis=1)
        answers = np.where(known[:, None, None], answers, np.nan)
        monkeypatch.setattr(filtering, "whitened_rates", lambda *_, made=(known, unexplained, answers): made)
        colour = SimpleNamespace(ma_coefficients=of, residual_covariance=(size**2 * noise).tolist())
        found.append(filtering._noise_likelihood(None, model, colour))
    np.testing.assert_allclose(found[0], found[1], atol=1e-12)
    square = np.einsum("na,ab,nb->n", white, np.linalg.inv(noise), white)
    answers_by_hand[7] = 0.0  # unknown
    wider = _quick_by_hand(answers_by_hand, noise, 4, usual, 0.6)
    volume = np.log(np.linalg.det(noise)) + 3.0 * np.log(wider)
    student = -0.5 * ((7.0 + 3.0) * np.log1p(square / wider / 7.0) + volume)
    np.testing.assert_allclose(found[1], np.where(known, 0.4 * student, 0.0))


def test_evidence_is_the_log_of_a_likelihood_ratio():
    """Two of three levels are faults; what a change at random brings is no evidence."""
    bank = SimpleNamespace(
        is_fault_hypothesis=np.array([False, True, True]), change_probability_per_sample=0.1,
        prior_probability=np.array([0.8, 0.15, 0.05]), transition_share=np.array([3.0, 1.0, 2.0]),
    )  # fmt: skip
    fault = np.array([0.3, 0.6, 0.45])
    posterior = np.column_stack([1 - fault, 0.25 * fault, 0.75 * fault])
    before = [0.2, 0.9 * 0.3 + 0.1 * 0.5, 0.9 * 0.6 + 0.1 * 0.5]
    expected = [np.log(p / (1 - p)) - np.log(q / (1 - q)) for p, q in zip(fault, before, strict=True)]
    assert filtering.fault_evidence(posterior, bank) == pytest.approx(expected)
    assert np.isfinite(filtering.fault_evidence(np.array([[0.0, 0.5, 0.5], [1.0, 0.0, 0.0]]), bank)).all()


def test_the_scale_of_the_last_two_seconds_is_of_samples_or_of_their_sums():
    """At 20 Hz: squares of one sample and of sums of two, an axis and a sample that is known, over 40 rows;
    the larger. What is unknown is no residual."""
    rng = np.random.default_rng(6)
    noise = np.array([[0.0025, 0.0009, -0.0004], [0.0009, 0.0016, 0.0003], [-0.0004, 0.0003, 0.0005]])
    known = ~np.isin(np.arange(90), [0, 1, 30, 31, 32])
    white = rng.standard_normal((90, 3)) * np.where(np.arange(90) < 45, 1.0, 2.0)[:, None]
    white[60:] = np.cumsum(white[60:], axis=0)
    residual = np.where(known[:, None], white * [0.05, 0.04, 0.02], 0.0)
    inverse = np.linalg.inv(noise)
    squares = {1: [], 2: []}
    for k in range(90):
        for span, found in squares.items():
            rows = [*range(max(k + 1 - span, 0), k + 1)]
            total = residual[rows].sum(axis=0)
            found.append(total @ inverse @ total / (3.0 * max(known[rows].sum(), 1)))
    means = [[np.mean(of[max(k - 39, 0) : k + 1]) for k in range(90)] for of in squares.values()]
    assert {int(place) for place in np.argmax(means, axis=0)} == {0, 1}
    found = filtering.recent_scale(residual, known, noise, 20.0)
    np.testing.assert_allclose(found, np.max(means, axis=0), rtol=1e-9)


def _quick_by_hand(responses, covariance, rows, usual, share):
    """What differs from the mean of so many rows is quick: above the usual power a share may be wrong."""
    found = []
    for k in range(len(responses)):
        quick = responses[k] - responses[max(k + 1 - rows, 0) : k + 1].mean(axis=0)
        power = sum(each @ np.linalg.inv(covariance) @ each for each in quick) / 3.0
        found.append(1.0 + share**2 * max(power - usual, 0.0))
    return np.array(found)


@pytest.mark.parametrize("laws", [False, True])
def test_under_other_laws_the_noise_is_as_wide_as_the_last_seconds_show(monkeypatch, laws):
    """By what the flight leaves if it is healthy, less the constant; else by the filter's own scale."""
    model = small.model(small.WING | {"other_laws": laws})
    flight = small.flight(model, 40, gap=20)
    ok, left, answers = filtering.whitened_rates(flight, model)
    given = []
    monkeypatch.setattr(filtering, "run_bank", lambda *of: given.append(of) or "run")
    monkeypatch.setattr(
        filtering,
        "recent_scale",
        lambda *of: given.append(of) or np.arange(40.0),
    )
    assert filtering._run_flight(flight, model, "bank") == "run"
    rates, responses, usable, bank, _, noise, least, quick = given[-1]
    np.testing.assert_array_equal(rates, np.nan_to_num(left))
    np.testing.assert_array_equal(responses, np.nan_to_num(answers))
    np.testing.assert_array_equal(usable, ok)
    assert (bank, len(given)) == ("bank", 1 + laws)
    assert least.tolist() == (list(range(40)) if laws else [0.0] * 40)
    np.testing.assert_allclose(quick, 1.0)  # no noise of the model says what is usual
    colour = {"average": [1.0], "noise": model.residual_covariance, "wider": 2.0, "quick": 0.4}
    model = model.model_copy(update={"noise_models": [NoiseModel(**colour)]})
    white = replace(flight, noise_ma_coefficients=(1.0,))
    filtering._run_flight(white, model.with_noise_of((1.0,)), "bank")
    wider = _quick_by_hand(responses, np.array(colour["noise"]), 5, 0.4, 1.0)
    assert wider.max() > 2.0
    np.testing.assert_allclose(given[-1][-1], wider)
    del given[1 + laws :]
    if laws:
        residual, known, covariance, rate_hz = given[0]
        expected = np.where(ok[:, None], left - np.array(model.intercept) - answers.sum(axis=1), 0.0)
        np.testing.assert_allclose(residual, expected / np.sqrt(quick)[:, None], atol=1e-15)
        assert (known.tolist(), rate_hz) == (ok.tolist(), 10.0)
        np.testing.assert_array_equal(covariance, noise.covariance)


def test_a_noise_that_is_unlikely_is_left_out_and_filtered_no_longer_than_it_counts(monkeypatch):
    """Three colours of three rows: the second counts to the second row, the third nowhere. Means by what is
    left of the probabilities, each of the flight and the model of its own colour, taken wider."""
    colours = [
        {"average": [1.0, c], "noise": (s * np.eye(3)).tolist(), "wider": w}
        for c, s, w in ((0.1, 2.0, 1.5), (0.2, 3.0, 2.5), (0.3, 4.0, 3.5))
    ]
    model = small.model(colours=colours)
    chances = np.array([[0.6, 0.7, 0.9991], [0.3995, 0.2998, 0.0005], [0.0005, 0.0002, 0.0004]])
    monkeypatch.setattr(
        filtering,
        "whiten_samples",
        lambda of, by: SimpleNamespace(noise_ma_coefficients=tuple(by), rows=3),
    )
    monkeypatch.setattr(filtering, "first_samples", lambda of, n: SimpleNamespace(**(vars(of) | {"rows": n})))
    monkeypatch.setattr(
        filtering, "_noise_likelihood", lambda of, by, colour: (of.noise_ma_coefficients, colour)
    )
    asked = []
    monkeypatch.setattr(
        filtering,
        "_model_weights",
        lambda likelihoods, rate_hz: asked.append((likelihoods, rate_hz)) or chances,
    )

    def run(flight, by, bank):
        asked.append((flight.rows, len(by.noise_models), bank))
        size = by.residual_covariance[0][0]
        rows = np.arange(1.0, flight.rows + 1.0)
        return np.outer(rows, [size, 2.0]), np.outer(rows, [0.1, size]), size + rows, None

    monkeypatch.setattr(filtering, "_run_flight", run)
    posterior, states, scales = bank_posterior(small.flight(model, 3), model, "bank")
    likelihoods, rate_hz = asked[0]
    assert (likelihoods, rate_hz) == (
        [(tuple(one.ma_coefficients), one) for one in model.noise_models], model.rate_hz,
    )  # fmt: skip
    assert asked[1:] == [(3, 1, "bank"), (2, 1, "bank")]
    first = np.array([0.6 / 0.9995, 0.7 / 0.9998, 1.0])
    size = 3.0 * first + 7.5 * (1.0 - first)
    rows = np.array([1.0, 2.0, 3.0])
    np.testing.assert_allclose(posterior, np.column_stack([rows * size, 2.0 * rows]))
    np.testing.assert_allclose(states, np.column_stack([0.1 * rows, rows * size]))
    np.testing.assert_allclose(scales, size + rows)
