"""The declared rate of false alarms against tails whose rate is known in closed form."""

import numpy as np
import pytest

from beaver_ftc.documents.errors import BadInput
from beaver_ftc_logs import extremes, fitting
from beaver_ftc_logs.bank import build_bank
from beaver_ftc_logs.filtering import fault_evidence, page_cusum
from beaver_ftc_logs.vehicle import with_alarm_rate
from products.logs import small

PER_HOUR = 300.0
TAILS = {
    "exponential": (lambda u: -2.0 * np.log(u), lambda x: np.exp(-x / 2.0)),
    "heavy": (lambda u: 10.0 * (u**-0.2 - 1.0), lambda x: (1.0 + 0.1 * x) ** -5.0),
    "bounded": (lambda u: 10.0 * (1.0 - u**0.2), lambda x: max(1.0 - 0.1 * x, 0.0) ** 5.0),
}


def parts_of(quantile, rng, hours, flights=5):
    """Peaks of flights alike."""
    counts = rng.poisson(PER_HOUR * hours / flights, flights)
    return [(quantile(rng.uniform(size=n)), hours / flights) for n in counts]


@pytest.mark.parametrize("tail", TAILS)
@pytest.mark.parametrize(("hours", "asked"), [(0.1, 1.0), (1.0, 0.1)])
def test_the_interval_holds_the_true_rate(tail, hours, asked):
    quantile, survival = TAILS[tail]
    rng, held, rates = np.random.default_rng(7), 0, []
    for _ in range(20):
        found = extremes.fit_peak_tail(parts_of(quantile, rng, hours))
        threshold = extremes.threshold_for_rate(found, asked)
        rate = extremes.false_alarm_rate(found, threshold)
        true = PER_HOUR * survival(threshold)
        held += rate.low <= true <= rate.high
        rates.append(true)
        assert rate.value == pytest.approx(asked, rel=1e-6)
    assert held >= 16
    assert np.mean(rates) < 2.5 * asked


def test_more_flight_gives_the_threshold_of_the_closed_form():
    found = extremes.fit_peak_tail(parts_of(TAILS["exponential"][0], np.random.default_rng(3), 100.0))
    assert extremes.threshold_for_rate(found, 1.0) == pytest.approx(2.0 * np.log(PER_HOUR), rel=0.05)


def test_flights_that_differ_count_for_less():
    """One flight with all the high peaks: they are one thing that happened, not many."""
    rng = np.random.default_rng(1)
    alike = parts_of(TAILS["exponential"][0], rng, 1.0)
    apart = [(3.0 * alike[0][0], alike[0][1]), *((0.3 * one, hours) for one, hours in alike[1:])]
    calm, wild = extremes.fit_peak_tail(alike), extremes.fit_peak_tail(apart)
    assert calm.overdispersion < 2.0 < wild.overdispersion
    rates = [
        extremes.false_alarm_rate(wild.model_copy(update={"overdispersion": d}), 20.0)
        for d in (1.0, wild.overdispersion)
    ]
    assert rates[1].high / max(rates[1].low, 1e-12) > 3.0 * rates[0].high / max(rates[0].low, 1e-12)


def test_too_little_flight_says_what_is_missing():
    found = extremes.fit_peak_tail(parts_of(TAILS["exponential"][0], np.random.default_rng(3), 0.5))
    assert extremes.missing_healthy_minutes(found, 1.0) == pytest.approx(180.0 - 30.0)
    assert extremes.missing_healthy_minutes(found, 10.0) == 0.0
    assert extremes.fit_peak_tail([(np.ones(5), 0.1)]) is None
    assert extremes.fit_peak_tail([]) is None


def test_peaks_are_of_stretches_above_zero():
    values = np.array([0.0, 1.0, 3.0, 0.0, 0.0, 2.0, 0.0, 4.0, 5.0])
    assert extremes.peaks_between_zeros(values).tolist() == [3.0, 2.0, 5.0]
    assert page_cusum(np.array([1.0, 2.0, -4.0, -1.0, 2.0, 9.0]), 6.0).tolist() == [1, 3, 0, 0, 2, 6]


def test_the_evidence_is_what_changes_alone_do_not_bring():
    """Where the probability of a fault is what the changes of a sample make of the last, there is none; where
    its odds are tenfold that, log 10."""
    bank = build_bank(small.model(small.TAIL))
    first = float(bank.prior_probability[bank.is_fault_hypothesis].sum())
    change = bank.change_probability_per_sample * float(
        bank.transition_share[bank.is_fault_hypothesis].sum() / bank.transition_share.sum()
    )
    second = (1.0 - bank.change_probability_per_sample) * first + change
    odds = (
        10.0
        * ((1.0 - bank.change_probability_per_sample) * second + change)
        / (1.0 - ((1.0 - bank.change_probability_per_sample) * second + change))
    )
    posterior = np.zeros((3, len(bank.transition_share)))
    place = int(np.flatnonzero(bank.is_fault_hypothesis)[0])
    posterior[:, place] = first, second, odds / (1.0 + odds)
    posterior[:, 0] = 1.0 - posterior[:, place]
    np.testing.assert_allclose(fault_evidence(posterior, bank), [0.0, 0.0, np.log(10.0)], atol=1e-12)


def test_a_drift_of_the_trim_is_told_from_noise(monkeypatch):
    """White noise, coloured noise and a random walk by its step, each in sd of the residual."""
    model, rng, n = small.model(small.TAIL), np.random.default_rng(2), 40_000
    white = rng.standard_normal((n, 3))
    coloured = np.array([white[max(k - 3, 0) : k + 1].sum(axis=0) for k in range(n)])
    walk = np.cumsum(rng.standard_normal((n, 3)), axis=0)
    series = np.column_stack([white[:, 0], coloured[:, 1], white[:, 2] + 0.05 * walk[:, 2]])
    series = series * np.sqrt(np.diag(np.array(model.residual_covariance)))
    monkeypatch.setattr(fitting, "refit", lambda fitted, like: like)
    monkeypatch.setattr(fitting, "whitened_residual", lambda like, kept: (np.arange(n), series, None))
    usable_flights = fitting.fit_parts([small.flight(model, 60)])
    found = fitting._estimate_trim_walk(usable_flights, model)
    assert max(found[:2]) < 0.01
    assert found[2] == pytest.approx(0.05, rel=0.15)


@pytest.mark.parametrize("rate", [0.0, -1.0, 1001.0, float("nan")])
def test_a_rate_that_is_none_is_refused(rate):
    with pytest.raises(BadInput, match="allowed: more than 0, up to 1000 an hour"):
        with_alarm_rate(small.vehicle(), rate)


@pytest.mark.parametrize("threshold", [2.0, 3.0])
def test_a_true_likelihood_ratio_alarms_once_in_exp_h_samples_or_less_often(threshold):
    """Page's sum of normal evidence, drawn: the theorem's bound holds, and the rate asked gives it back."""
    rng, shift, runs = np.random.default_rng(8), 1.0, 4000
    total, alive, waited = np.zeros(runs), np.ones(runs, dtype=bool), np.zeros(runs)
    while alive.any():
        x = rng.standard_normal(runs)
        total = np.maximum(total + shift * x - 0.5 * shift**2, 0.0)
        waited[alive] += 1
        alive &= total < threshold
    assert waited.mean() > np.exp(threshold)
    rate_hz = 20.0
    per_hour = 3600.0 * rate_hz / np.exp(threshold)
    assert extremes.lorden_threshold(rate_hz, per_hour) == pytest.approx(threshold)
    assert extremes.lorden_threshold(rate_hz, 1e9) == 0.0


def test_under_other_laws_the_threshold_is_not_below_twice_the_theorem():
    tail = extremes.PeakTail(level=0.1, excess=[0.1] * 20, minutes=30.0)
    same = small.model(rate_hz=20.0)
    other = same.model_copy(update={"vehicle": same.vehicle.model_copy(update={"other_laws": True})})
    assert fitting._choose_threshold(tail, 1.0, same) == extremes.threshold_for_rate(tail, 1.0) < 3.0
    assert fitting._choose_threshold(tail, 1.0, other) == pytest.approx(2.0 * np.log(72_000.0))
    moving = other.model_copy(update={"vehicle": other.vehicle.model_copy(update={"moving_air": True})})
    assert fitting._choose_threshold(tail, 1.0, moving) == pytest.approx(np.log(72_000.0))
    for without_tail in (moving, same):
        assert fitting._choose_threshold(None, 2.0, without_tail) == pytest.approx(np.log(36_000.0))
    high = tail.model_copy(update={"tail_start_level": 50.0})
    assert fitting._choose_threshold(high, 1.0, other) == extremes.threshold_for_rate(high, 1.0) > 50.0


@pytest.mark.parametrize("n", [100, 400])
def test_the_interval_holds_nine_tenths_of_a_posterior_that_is_known(n):
    """Exponential excess x over a scale of 2, at a level above by that: by the information of rate, shape and
    scale [Coles2001, section 4.3], a logarithm of the rate of variance (1 + 1/4 + 2 - 1) / n."""
    excess = TAILS["exponential"][0]((np.arange(n) + 0.5) / n)
    tail = extremes.PeakTail(level=5.0, excess=excess.tolist(), minutes=30.0)
    found = extremes.false_alarm_rate(tail, 7.0)
    assert np.log(found.high / found.low) == pytest.approx(2.0 * 1.645 * 1.5 / np.sqrt(n), rel=0.05)
    assert np.sqrt(found.high * found.low) == pytest.approx(2.0 * n / np.e, rel=0.02)


def test_few_peaks_move_shape_and_scale_from_the_prior_by_their_likelihood():
    """Generalised Pareto in closed form, a normal prior of the shape with a standard deviation of 0.2, over
    shapes from -0.5 to 0.5 and scales from a fifth to five times the mean; each peak counts for 1 / 2.5."""
    excess = np.array([0.3, 1.1, 7.2])
    tail = extremes.PeakTail(level=5.0, excess=excess.tolist(), minutes=30.0, dispersion=2.5)
    shape, scale, weight = extremes._pareto_posterior(tail)
    assert (shape.min(), shape.max()) == pytest.approx((-0.5, 0.5))
    assert (scale.min(), scale.max()) == pytest.approx((excess.mean() / 5.0, 5.0 * excess.mean()))
    expected = np.zeros(len(shape))
    for i, (xi, sigma) in enumerate(zip(shape, scale, strict=True)):
        base = 1.0 + xi * excess / sigma
        if (base <= 0.0).any():
            continue
        density = np.exp(-excess / sigma) if abs(xi) < 1e-9 else base ** (-1.0 / xi - 1.0)
        expected[i] = np.prod(density / sigma) ** (1.0 / 2.5) * np.exp(-0.5 * (xi / 0.2) ** 2)
    np.testing.assert_allclose(weight, expected / expected.sum(), rtol=1e-6, atol=1e-12)


@pytest.mark.parametrize(("n", "over"), [(11, 10), (24, 10), (36, 12), (100, 20), (110, 20)])
def test_the_tail_is_of_the_highest_peaks_over_the_next_one(n, over):
    """Ten at least, else twice the root of their number; flights differ by the chi-square of their sums of
    excess, of which each has twice its mean times that of a peak as variance."""
    rng = np.random.default_rng(n)
    peaks = rng.permutation(np.linspace(1.0, 4.0, n) ** 3)
    parts = [(peaks[: n // 5], 0.2), (peaks[n // 5 : n // 2], 0.7), (peaks[n // 2 :], 0.35)]
    found = extremes.fit_peak_tail(parts)
    down = sorted(peaks, reverse=True)
    assert found.tail_start_level == pytest.approx(down[over])
    assert found.excess_over_level == pytest.approx([peak - down[over] for peak in down[:over]])
    assert found.healthy_minutes == pytest.approx(75.0)
    mean = np.mean(found.excess_over_level)
    square = 0.0
    for of, hours in parts:
        excess = sum(peak - down[over] for peak in of if peak > down[over])
        expected = over * mean * hours / 1.25
        square += (excess - expected) ** 2 / (2.0 * expected * mean)
    assert found.overdispersion == pytest.approx(max(square / 2.0, 1.0))
    alone = extremes.fit_peak_tail([(peaks, 0.5)])
    assert (alone.overdispersion, alone.healthy_minutes) == (1.0, 30.0)
    assert extremes.fit_peak_tail([(peaks[:10], 0.5)]) is None


def test_the_sums_of_flights_that_differ_are_as_many_times_wider():
    """Hours of 1 and 3, excess of 9 and 3 by four peaks of each: 3 and 9 expected, of peaks of 1.5."""
    parts = [(np.array([1.0, 2.0, 2.5, 3.5]), 1.0), (np.array([0.25, 0.5, 1.0, 1.25]), 3.0)]
    expected = (9.0 - 3.0) ** 2 / (2.0 * 3.0 * 1.5) + (3.0 - 9.0) ** 2 / (2.0 * 9.0 * 1.5)
    assert extremes._overdispersion(parts) == pytest.approx(expected)
    assert extremes._overdispersion([(np.empty(0), 1.0), (np.zeros(2), 3.0)]) == 1.0


@pytest.mark.parametrize(("hours", "permitted"), [(0.05, 0), (0.06, 1), (0.3, 1), (0.4, 2), (0.8, 2)])
def test_no_more_held_out_peaks_raise_an_alarm_than_the_rate_permits(hours, permitted):
    """Three flights are far from the others: a tail through all puts 1 an hour below them. By Poisson's law
    the rate raises no more than are permitted with a probability of 0.95, by hand: exp(-0.05) = 0.951,
    1.06 exp(-0.06) = 0.998, 1.3 exp(-0.3) = 0.963, and 1.4 exp(-0.4) = 0.938, (1.8 + 0.32) exp(-0.8) = 0.953.
    """
    excess = [0.01] * 40 + [116.0, 158.0, 132.0]
    tail = extremes.PeakTail(level=0.05, excess=excess, minutes=60.0 * hours, dispersion=15.0)
    expected = 0.05 + extremes._excess_for_rate(tail, 1.0)
    highest = 0.05 + [158.0, 132.0, 116.0][permitted]
    assert expected < highest
    assert extremes.threshold_for_rate(tail, 1.0) == highest


def test_where_hardly_any_peak_is_as_high_as_the_level_it_is_the_threshold():
    """Ten peaks in a hundred hours are fewer than one an hour already."""
    tail = extremes.PeakTail(level=2.5, excess=[0.1 * k for k in range(1, 11)], minutes=6000.0)
    assert extremes.threshold_for_rate(tail, 1.0) == 2.5
    low, high = (2.5 + extremes._excess_for_rate(tail, rate) for rate in (0.05, 0.01))
    assert 2.5 < low < high
    assert extremes.threshold_for_rate(tail, 0.05) == low
    for rate, threshold in ((0.05, low), (0.01, high)):
        assert extremes.false_alarm_rate(tail, threshold).value == pytest.approx(rate, rel=1e-6)
    at_level = extremes.false_alarm_rate(tail, 2.5)
    assert at_level.value == pytest.approx(10.5 / 100.0, rel=0.01)  # a gamma's mean of 10 and a half
    assert (at_level.low, at_level.high) == (pytest.approx(0.058, abs=0.01), pytest.approx(0.163, abs=0.01))
