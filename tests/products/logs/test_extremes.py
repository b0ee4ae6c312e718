"""The declared rate of false alarms against tails whose rate is known in closed form."""

import numpy as np
import pytest

from beaver_ftc.documents.errors import BadInput
from beaver_ftc_logs import extremes
from beaver_ftc_logs.evidence import page_cusum
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
        held += rate["low"] <= true <= rate["high"]
        rates.append(true)
        assert rate["value"] == pytest.approx(asked, rel=1e-6)
    assert held >= 16
    assert np.mean(rates) < 2.5 * asked


def test_flights_that_differ_count_for_less():
    """One flight with all the high peaks: they are one thing that happened, not many."""
    rng = np.random.default_rng(1)
    alike = parts_of(TAILS["exponential"][0], rng, 1.0)
    apart = [(3.0 * alike[0][0], alike[0][1]), *((0.3 * one, hours) for one, hours in alike[1:])]
    calm, wild = extremes.fit_peak_tail(alike), extremes.fit_peak_tail(apart)
    assert calm.dispersion < 2.0 < wild.dispersion
    rates = [
        extremes.false_alarm_rate(wild.model_copy(update={"dispersion": d}), 20.0)
        for d in (1.0, wild.dispersion)
    ]
    alike_ratio, apart_ratio = (rate["high"] / max(rate["low"], 1e-12) for rate in rates)
    assert apart_ratio > 3.0 * alike_ratio


def test_peaks_are_of_stretches_above_zero():
    values = np.array([0.0, 1.0, 3.0, 0.0, 0.0, 2.0, 0.0, 4.0, 5.0])
    assert extremes.peaks_between_zeros(values).tolist() == [3.0, 2.0, 5.0]
    assert page_cusum(np.array([1.0, 2.0, -4.0, -1.0, 2.0, 9.0]), 6.0).tolist() == [1, 3, 0, 0, 2, 6]


@pytest.mark.parametrize("rate", [0.0, -1.0, 1001.0, float("nan")])
def test_a_rate_that_is_none_is_refused(rate):
    with pytest.raises(BadInput, match="allowed: more than 0, up to 1000 an hour"):
        with_alarm_rate(small.vehicle(), rate)


def test_a_true_likelihood_ratio_alarms_once_in_exp_h_samples():
    """The threshold of Lorden's theorem, which holds for any tail."""
    assert extremes.lorden_threshold(20.0, 3600.0 * 20.0 / np.exp(3.0)) == pytest.approx(3.0)
    assert extremes.lorden_threshold(20.0, 1e9) == 0.0
