"""A model is believed where it was fitted, and silent elsewhere."""

from dataclasses import replace

import numpy as np
import pytest

from beaver_ftc.documents.errors import BadInput
from beaver_ftc_logs import identification, motion_units, validation
from beaver_ftc_logs.diagnose import diagnose
from beaver_ftc_logs.effect_errors import tied_shares
from beaver_ftc_logs.findings import as_text, verdict_document
from beaver_ftc_logs.fit_parts import fit_parts
from products.logs import small

HEALTHY = small.flight(small.model(), n=1200, seed=2)


def trusted(flown=HEALTHY, **changes):
    """A model by hand that knows what it was fitted on."""
    model = small.model(**changes)
    usable_flights = fit_parts([flown])
    return validation.add_ranges_and_threshold(usable_flights, model)


@pytest.fixture(scope="module")
def model():
    return trusted()


def silent(rows):
    """Rows that say nothing at all."""
    return (
        (rows.isolated_surfaces == "")
        & (rows.faulty == 0)
        & (rows.effectiveness_low == 0.0).all(axis=1)
        & (rows.effectiveness_high == 1.0).all(axis=1)
    )


@pytest.mark.parametrize(("change", "says"), [
    (lambda f: f.commands.__setitem__((slice(300, None), 0), f.commands[300:, 0] * 8.0),
     "command of right is outside"),
    (lambda f: f.rates.__setitem__((slice(300, None), 1), f.rates[300:, 1] + 9.0), "q_rad_s is outside"),
])  # fmt: skip
def test_where_it_was_not_fitted_it_says_nothing(model, change, says):
    flown = small.flight(model, n=600, seed=4)
    change(flown)
    rows = diagnose(flown, model)
    assert rows.credible[:300].all()
    out = rows.credible == 0
    assert out[-50:].all()
    assert silent(rows)[out].all()
    assert any(says in reason for reason in rows.doubtful_rows)
    verdict = verdict_document(flown, model, rows) | {"score": {}}
    assert verdict["credible"]["share"] == pytest.approx(1.0 - out.mean())
    assert says in as_text(verdict)


def test_a_rate_that_is_frozen_throughout_is_not_taken_for_one_in_another_unit(model):
    flown = small.flight(model, n=600, seed=4)
    flown.rates[:, 0] = 0.05
    rows = diagnose(replace(flown, unchanged_s={"p_rad_s": flown.t_s}), model)
    assert not rows.credible[30:].any()


def test_a_residual_that_is_larger_than_any_fitted_does_not_make_a_row_incredible(model):
    """Noise of 2.5 times the standard deviation: the rows are credible, and a large loss is still named."""
    noise = (6.25 * np.array(small.model().noise)).tolist()
    noisy = model.model_copy(update={"noise": noise})
    flown = small.flight(noisy, n=1500, lost=((1, 600, 1500, 0.0),), seed=21)
    rows = diagnose(flown, model)
    assert rows.credible.mean() > 0.9
    assert (rows.isolated_surfaces[900:] == "left").mean() > 0.9
    assert rows.faulty[:600].sum() == 0


@pytest.mark.parametrize(("usual", "most"), [(0.0, 0.5), (0.25, 0.75)])
def test_a_rate_that_never_stood_still_may_for_half_a_second(model, usual, most):
    """A filter that follows a dead gyro for longer finds a fault of it."""
    known = model.model_copy(
        update={"fitted": model.fitted.model_copy(update={"still_s": {"q_rad_s": usual}})}
    )
    still = np.zeros(600)
    still[300:320] = 0.1 * np.arange(20)
    flown = small.flight(model, n=600, seed=4, unchanged_s={"q_rad_s": still})
    assert (diagnose(flown, known).credible == 0).tolist() == (still > most).tolist()


@pytest.mark.parametrize(("factor", "says"), [
    (57.29578, r"a factor of 0\.01745 \(`unit: deg/s`\) fits"),
    (1.0 / 57.29578, r"a factor of 57\.3 fits"),
    (3.0, None),
])  # fmt: skip
def test_rates_in_another_unit_than_the_models_own(model, factor, says):
    flown = small.flight(model, n=300, seed=4, rates=HEALTHY.rates[:300] * factor)
    if says is None:
        motion_units.refuse_rate_unit(flown, model.fitted)
        return
    with pytest.raises(BadInput, match=says):
        diagnose(flown, model)


def test_what_the_law_ties_together_is_not_claimed(model):
    """The right surface follows the rates of the sample, the left one moves by itself."""
    flown = small.flight(model, n=2000, seed=3)
    follows = np.vstack([np.zeros(3), flown.rates[:-1]]) @ [0.4, -0.3, 0.2]
    commands = np.column_stack([follows, flown.commands[:, 1]])
    share = tied_shares(
        fit_parts([small.flight(model, n=2000, commands=commands, rates=flown.rates)]),
        small.model(history=4, lags=3),
    )
    assert share[0] > 0.98
    assert share[1] < 0.9
    loose = 1000.0 * (follows + 0.05 * follows.std() * np.random.default_rng(4).standard_normal(2000))
    commands[:, 0] = loose  # all but 1 of 400, of an effect that is a million times the noise
    far = small.flight(model, n=2000, commands=commands, rates=flown.rates)
    assert tied_shares(fit_parts([far]), small.model(history=4, lags=3))[0] == 0.0


def test_a_model_that_explains_less_than_the_mean_is_refused():
    """By the mean over its tests, each with its samples; with what was noted of the rates."""
    frozen = replace(HEALTHY, notes=("q_rad_s: stands still for 600 s", "pitch: another"))
    flights, model = fit_parts([frozen]), small.model()

    def held_out(*of):
        return [{"samples": n, "explained": dict(zip("pqr", shares, strict=True))} for n, *shares in of]

    says = (
        r"explains less of p, r than the mean does \(p -17\.375, r -0\.350\).* than these 1\.9 min.*follows; "
    )
    with pytest.raises(BadInput, match=says + "q_rad_s: stands still for 600 s$"):
        identification.check_explained(held_out((100, -71, 0.5, 0.1), (300, 0.5, -0.1, -0.5)), flights, model)
    identification.check_explained(
        held_out((300, 0.5, -0.1, 0.1), *[(300, 0.5, 0.2, 0.1)] * 3), flights, model
    )


def test_after_a_clipped_rate_nothing_is_said_for_half_a_minute(model):
    clipped = np.arange(600) == 100
    rows = diagnose(small.flight(model, n=600, seed=4, is_rate_clipped=clipped), model)
    assert np.flatnonzero(rows.credible == 0).tolist() == list(range(100, 401))
    assert list(rows.doubtful_rows) == ["a rate was clipped in the last 30 s"]


@pytest.mark.parametrize(
    ("factor", "turned", "refused"),
    [(57.3, 1.0, True), (0.01, 1.0, True), (8.0, 1.0, False), (57.3, 5.0, False), (57.3, 4.0, True),
     (57.3, 0.1, True), (0.01, 0.1, False), (0.0, 1.0, False)],
)  # fmt: skip
def test_a_command_in_another_unit_is_refused_where_rates_move_alike_or_far_less(factor, turned, refused):
    n = np.arange(2000)
    rates = np.column_stack([np.sin(0.01 * (k + 1) * n) for k in range(3)])
    commands = np.column_stack([np.sin(0.03 * n), np.cos(0.02 * n)])
    first = small.flight(small.model(), n=2000, commands=commands, rates=rates, name="log")
    flown = replace(first, commands=commands * [1.0, factor], rates=rates * [1.0, turned, 1.0])
    if refused:
        with pytest.raises(BadInput, match=rf"log: the command of elevator moves {factor:g} times"):
            motion_units.refuse_command_unit(flown, first, ["aileron", "elevator"])
    else:
        motion_units.refuse_command_unit(flown, first, ["aileron", "elevator"])
