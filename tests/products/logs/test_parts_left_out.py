"""What the parts that a fit leaves out say of a model: by closed forms, by hand, and by another road."""

from dataclasses import replace

import numpy as np
import pytest

from beaver_ftc_logs import fitting, trust
from beaver_ftc_logs.fitting import FitPart
from beaver_ftc_logs.regression import unexplained_rates
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
