"""Flights in gusts that a law answers: a gain is right only where the noise has its own colour."""

from dataclasses import replace

import numpy as np
import pytest

from beaver_ftc.documents.errors import BadInput
from beaver_ftc_logs import column_mistakes, fitting, gyro_noise, loading, noise_search
from beaver_ftc_logs.bank import build_bank
from beaver_ftc_logs.fit_parts import fit_parts
from beaver_ftc_logs.posterior import bank_posterior
from beaver_ftc_logs.whitening import whiten_samples
from products.logs import small

AVERAGE = (1.0, -1.4, 0.49)


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


def fitted(flights):
    return fitting.fit_model(fit_parts(flights), VEHICLE)


@pytest.fixture(scope="module")
def flights():
    """Flights of two colours in turn, as a law answers rates, and the same whitened."""
    colours = [flown(AVERAGE if i % 2 else (1.0,), 0.5 + 0.2 * i, 4000, i) for i in range(4)]
    return colours, noise_search.whiten_flights(colours, VEHICLE)


@pytest.fixture(scope="module")
def moving(flights):
    return fitted(flights[1])


def test_a_fit_finds_the_colours_that_a_law_answers(flights, moving):
    """The response is 0.5. A fit that takes coloured noise for white is farther off."""
    given, white = flights
    colours = [one.noise_ma_coefficients for one in white]
    assert colours == colours[:2] * 2
    assert len(set(colours)) == len(moving.colours) == 2
    assert all(one.wider >= 1.0 for one in moving.colours)
    off, off_without = (abs(one.response[0][0][0] - 0.5) for one in (moving, fitted(given)))
    assert off < 0.5 * off_without


def test_a_louder_flight_counts_less_even_if_no_colour_changes():
    """Everything three times as large: the same colour, found at once, and a third of the weight."""
    flight = flown((1.0,), 0.5, 4000, 2)
    louder = replace(flight, rates=3.0 * flight.rates, commands=3.0 * flight.commands)
    white = noise_search.whiten_flights([flight, louder], VEHICLE)
    assert white[0].noise_ma_coefficients == white[1].noise_ma_coefficients
    assert white[0].fit_weight == pytest.approx(3.0 * white[1].fit_weight)


@pytest.mark.parametrize("colour", [0, 1])
def test_a_model_of_two_colours_takes_the_likelier(flights, moving, colour):
    """A flight through the noise it has, picked at once, is as if the other had never been seen; and no row
    depends on a later sample by which noise is likely."""
    new = flown(AVERAGE if colour else (1.0,), 0.5, 1500, 9 + colour)
    its = flights[1][colour].noise_ma_coefficients
    own = [one for one in moving.colours if tuple(one.average) == its]
    bank = build_bank(moving)
    both = bank_posterior(new, moving, bank)
    alone = bank_posterior(new, moving.model_copy(update={"colours": own}), bank)
    np.testing.assert_allclose(both[300:], alone[300:], atol=1e-6)
    short = bank_posterior(loading.select_rows(new, slice(600)), moving, bank)
    np.testing.assert_array_equal(both[:600], short)


@pytest.mark.parametrize("colour", [AVERAGE, (1.0,)])
def test_columns_are_compared_in_white(moving, colour):
    """A command of the other sign is told; one that a law moves by the noise itself is not taken for it."""
    flight = flown(colour, 1.1, 4000, 21)
    column_mistakes.refuse_columns(flight, moving)
    found = [column_mistakes.answers(whiten_samples(flight, one.average), moving) for one in moving.colours]
    likeliest = max(found, key=lambda one: one.score.mean())
    assert all(1.0 < gain < 1.6 for gain in likeliest.upper.max(axis=0))
    plain = column_mistakes.answers(flight, moving.model_copy(update={"colours": []}))
    assert colour == (1.0,) or min(plain.upper.max(axis=0)) > 1.9  # what coloured noise does to the fit
    with pytest.raises(BadInput, match="answer the command of right the other way round"):
        column_mistakes.refuse_columns(replace(flight, commands=flight.commands * [-1.0, 1.0]), moving)


def test_gyro_noise_enters_through_the_whole_matrix_of_the_past():
    """Without process noise the residual is w[k] = v[k] - A v[k-1], with the variance s2 (1 + A A')."""
    A = np.array([[0.5, 0.2, 0.0], [0.0, 0.3, -0.1], [0.1, 0.0, 0.4]])
    model = small.model(history=1, past=A.T.tolist())
    before, noise = gyro_noise.yule_walker_predictor(model, np.zeros((3, 3)), 0.05, 40)
    np.testing.assert_allclose(noise, 0.05**2 * np.eye(3), atol=1e-12)
    np.testing.assert_allclose(before[:3].T, -A, atol=1e-9)


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
