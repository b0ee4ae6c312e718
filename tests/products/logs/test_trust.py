"""A model is believed where it was fitted, and silent elsewhere."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from beaver_ftc.documents.errors import BadInput
from beaver_ftc_logs import fitting, identification, trust
from beaver_ftc_logs.bank import build_states
from beaver_ftc_logs.column_mistakes import CorrectedLog
from beaver_ftc_logs.diagnose import diagnose, finish_rows
from beaver_ftc_logs.findings import as_text, isolability_document, verdict_document
from beaver_ftc_logs.model import FittedRanges, NoiseModel
from products.logs import small
from telling import apart

HEALTHY = small.flight(small.model(), n=1200, seed=2)


def trusted(flown=HEALTHY, **changes):
    """A model by hand that knows what it was fitted on."""
    model = small.model(**changes)
    usable_flights = fitting.fit_parts([flown])
    return fitting.add_ranges_and_threshold(usable_flights, model)


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


def test_a_flight_like_those_fitted_is_credible(model):
    rows = diagnose(small.flight(model, n=600, lost=((1, 300, 600, 0.3),), seed=8), model)
    assert rows.credible.mean() == 1.0
    assert rows.doubtful_rows == {}
    assert "left" in set(rows.isolated_surfaces[450:])


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


def test_a_residual_that_is_larger_than_any_fitted_does_not_make_a_row_incredible(model):
    """Noise of 2.5 times the standard deviation: the rows are credible, and a large loss is still named."""
    noise = (6.25 * np.array(small.model().residual_covariance)).tolist()
    noisy = model.model_copy(update={"residual_covariance": noise})
    flown = small.flight(noisy, n=1500, lost=((1, 600, 1500, 0.0),), seed=21)
    rows = diagnose(flown, model)
    assert rows.credible.mean() > 0.9
    assert (rows.isolated_surfaces[900:] == "left").mean() > 0.9
    assert rows.faulty[:600].sum() == 0


def test_a_signal_that_stands_still_is_named_and_not_learnt_from(model):
    still = np.zeros(600)
    still[300:400] = 0.1 * np.arange(100)
    flown = small.flight(model, n=600, seed=4, unchanged_s={"q_rad_s": still})
    rows = diagnose(flown, model)
    assert (rows.credible == 0).tolist() == (still > 1.5).tolist()
    assert list(rows.doubtful_rows) == ["q_rad_s stands still, for longer than 1.5 s"]


@pytest.mark.parametrize(("usual", "most"), [(0.0, 0.5), (0.25, 0.75)])
def test_a_rate_that_never_stood_still_may_for_half_a_second(model, usual, most):
    """A filter that follows a dead gyro for longer finds a fault of it."""
    known = model.model_copy(
        update={
            "fitted_ranges": model.fitted_ranges.model_copy(update={"longest_still_s": {"q_rad_s": usual}})
        }
    )
    still = np.zeros(600)
    still[300:320] = 0.1 * np.arange(20)
    flown = small.flight(model, n=600, seed=4, unchanged_s={"q_rad_s": still})
    assert (diagnose(flown, known).credible == 0).tolist() == (still > most).tolist()


def test_a_command_may_stand_still_thrice_as_long_as_it_did(model):
    trained = model.fitted_ranges.model_copy(update={"longest_still_s": {"roll": 4.0}})
    known = model.model_copy(update={"fitted_ranges": trained})
    for longest, share in ((11.9, 1.0), (12.5, 0.98)):
        flown = small.flight(
            model,
            n=600,
            seed=4,
            unchanged_s={"roll": np.where(np.arange(600) < 12, longest, 0.0)},
        )
        assert diagnose(flown, known).credible.mean() == pytest.approx(share)


def test_rows_use_nothing_later(model):
    flown = small.flight(model, n=600, seed=4)
    flown.rates[300:] += 5.0
    whole = diagnose(flown, model)
    part = {
        name: getattr(flown, name)[:350]
        for name in ("t_s", "rates", "commands", "signals", "labels", "stretch_number", "log_stamps_s")
    }
    cut = diagnose(small.flight(model, n=600, seed=4, **part), model)
    np.testing.assert_array_equal(cut.credible, whole.credible[:350])
    np.testing.assert_array_equal(cut.effectiveness_low, whole.effectiveness_low[:350])


@pytest.mark.parametrize(("factor", "says"), [
    (57.29578, r"a factor of 0\.01745 \(`unit: deg/s`\) fits"),
    (1.0 / 57.29578, r"a factor of 57\.3 fits"),
    (3.0, None),
])  # fmt: skip
def test_rates_in_another_unit_than_the_models_own(model, factor, says):
    flown = small.flight(model, n=300, seed=4, rates=HEALTHY.rates[:300] * factor)
    if says is None:
        trust.refuse_rate_unit(flown, model.fitted_ranges)
        return
    with pytest.raises(BadInput, match=says):
        diagnose(flown, model)


def test_what_the_law_ties_together_is_not_claimed(model):
    """The right surface follows the rates of the sample, the left one moves by itself."""
    flown = small.flight(model, n=2000, seed=3)
    follows = np.vstack([np.zeros(3), flown.rates[:-1]]) @ [0.4, -0.3, 0.2]
    commands = np.column_stack([follows, flown.commands[:, 1]])
    share = trust.tied_shares(
        [(small.flight(model, n=2000, commands=commands, rates=flown.rates), np.ones(2000, bool))],
        small.model(history=4, lags=3),
    )
    assert share[0] > 0.98
    assert share[1] < 0.9
    loose = 1000.0 * (follows + 0.05 * follows.std() * np.random.default_rng(4).standard_normal(2000))
    commands[:, 0] = loose  # all but 1 of 400, of an effect that is a million times the noise
    far = small.flight(model, n=2000, commands=commands, rates=flown.rates)
    assert trust.tied_shares([(far, np.ones(2000, bool))], small.model(history=4, lags=3))[0] == 0.0


def test_a_surface_that_never_moved_is_not_claimed(model):
    still = small.flight(model, n=1200, seed=2)
    still.commands[:, 0] = 0.2
    known = trusted(still)
    assert trust.known_effects(known) == [False, True]
    rows = diagnose(small.flight(model, n=600, lost=((0, 200, 600, 0.0),), seed=8), known)
    assert (rows.effectiveness_low[:, 0] == 0.0).all()
    assert (rows.effectiveness_high[:, 0] == 1.0).all()
    assert set(rows.isolated_surfaces) <= {"", "unknown", "right+left"}
    assert not (rows.faulty & (rows.isolated_surfaces == "")).any()
    (line,) = trust.unknown_sentences(known)
    assert line.startswith("of what right does, 100.0%")
    with np.errstate(all="raise"):  # no median of nothing: none of its losses is asked for
        right, left = isolability_document(still, known)["groups"]
    assert set(right["smallest_loss"].values()) == {None}
    assert left["smallest_loss"]["60"] < 0.5


def test_few_minutes_mean_wide_bounds():
    """Standard errors of gains fall as the root of the time."""
    errors = []
    for n in (400, 6400):
        flights = fitting.fit_parts([small.flight(small.model(), n=n, seed=6)])
        fit = fitting.fit_order(flights, small.vehicle(), 2, 3)
        errors.append(fitting.group_gain_sd(fit, small.model()))
    assert (errors[0] / errors[1] > 2.0).all()
    assert (errors[0] / errors[1] < 8.0).all()


def test_under_other_laws_the_gain_is_known_as_a_factor_of_the_whole_response():
    """As of one regressor, the response to the commands, with what the others make up of it taken off."""
    flown = small.flight(small.model(), n=3000, seed=6)
    model = fitting.fit_model(fitting.fit_parts([flown]), small.vehicle(other_laws=True))
    usable_flights = fitting.fit_parts([flown])
    x, _, _ = fitting.stack_data(usable_flights, model.vehicle, model.n_rate_lags, model.n_command_lags)
    fit = fitting.fit_order(usable_flights, model.vehicle, model.n_rate_lags, model.n_command_lags)
    white = replace(fit, standard_errors=fit.standard_errors / fit.standard_error_inflation)
    sd = np.sqrt(np.diag(fit.residual_covariance))
    for g, found in enumerate(fitting.group_gain_sd(white, model)):
        first = x.shape[1] - (len(model.groups) - g) * model.n_command_lags
        place = np.arange(x.shape[1])
        own = (place >= first) & (place < first + model.n_command_lags)
        answer, others = x[:, own] @ fit.coefficients[own] / sd, x[:, ~own]
        left = answer - others @ np.linalg.lstsq(others, answer, rcond=None)[0]
        assert found == pytest.approx(1.0 / np.sqrt((left**2).sum()), rel=1e-6)


def test_a_model_that_explains_less_than_the_mean_is_refused():
    tests = [
        {"samples": 100, "explained": {"p": -71.0, "q": 0.5, "r": 0.1}},
        {"samples": 300, "explained": {"p": 0.5, "q": -0.1, "r": 0.1}},
    ]
    frozen = replace(HEALTHY, notes=("q_rad_s: stands still for 600 s", "pitch: another"))
    usable_flights = fitting.fit_parts([frozen])
    with pytest.raises(BadInput) as error:
        identification.check_explained(tests, usable_flights, small.model())
    said = str(error.value)
    assert "explains less of p than the mean does (p -17.375)" in said
    assert said.endswith("follows; q_rad_s: stands still for 600 s")
    assert "more than these 1.9 min" in said
    two = [tests[0], tests[1] | {"explained": {"p": 0.5, "q": -0.1, "r": -0.5}}]
    with pytest.raises(BadInput, match=r"less of p, r than the mean does \(p -17\.375, r -0\.350\)"):
        identification.check_explained(two, usable_flights, small.model())
    identification.check_explained(
        tests[1:] + [tests[1] | {"explained": {"p": 0.5, "q": 0.2, "r": 0.1}}] * 3,
        usable_flights,
        small.model(),
    )


def test_a_gain_known_worse_than_a_step_of_the_levels_is_free_by_as_much(model):
    def spread(*errors):
        known = model.fitted_ranges.model_copy(update={"group_gain_sd": list(errors)})
        given = model.model_copy(update={"fitted_ranges": known})
        return np.diag(build_states(given).initial_covariance)[4:]

    step, own = model.settings.effectiveness_level_step, model.settings.own_gain_spread
    assert spread(0.0, step) == pytest.approx([own**2, own**2])
    assert spread(0.3, 0.2) == pytest.approx([own**2 + 0.09 - step**2, own**2 + 0.04 - step**2])
    noise = {"average": [1.0, 0.5], "noise": model.residual_covariance, "misreads": [0.3, 0.1]}
    misread = model.model_copy(update={"noise_models": [NoiseModel(**noise)]})
    for average, more in (((1.0, 0.5), [0.09, 0.01]), ((1.0, 0.4), [0.0, 0.0])):
        found = build_states(misread, average)
        usual = build_states(model)
        variance, usual_variance = (np.diag(one.initial_covariance)[4:] for one in (found, usual))
        assert variance - usual_variance == pytest.approx(more)
        drift, usual_drift = (one.random_walk_variance[4:] for one in (found, usual))  # of a law: none
        assert drift == pytest.approx(usual_drift, rel=1e-3)


def test_a_model_that_was_fitted_on_little_says_little(model):
    """A weak surface from the start, or a gain less than the fit says? Bounds hold both."""
    flown = small.flight(model, n=600, lost=((1, 0, 600, 0.5),), seed=8)
    widths = []
    for error in (0.0, 0.3):
        known = model.fitted_ranges.model_copy(update={"group_gain_sd": [error, error]})
        rows = diagnose(flown, model.model_copy(update={"fitted_ranges": known}))
        widths.append((rows.effectiveness_high - rows.effectiveness_low)[100:].mean())
    assert widths[1] > 1.5 * widths[0]


def test_commands_that_nothing_follows_are_not_credible(model):
    flown = small.flight(model, n=600, seed=4)
    still = np.arange(600) >= 400
    rows = finish_rows(flown, model, diagnose(flown, model), silent=still)
    assert (rows.credible == 0).tolist() == still.tolist()
    assert silent(rows)[still].all()
    assert [reason.split(":")[0] for reason in rows.doubtful_rows] == ["nothing answers the commands"]


def test_after_a_clipped_rate_nothing_is_said_for_half_a_minute(model):
    clipped = np.arange(600) == 100
    rows = diagnose(small.flight(model, n=600, seed=4, is_rate_clipped=clipped), model)
    assert np.flatnonzero(rows.credible == 0).tolist() == list(range(100, 401))
    assert list(rows.doubtful_rows) == ["a rate was clipped in the last 30 s"]


def test_a_model_that_claims_nothing_says_nothing(model):
    """Neither a name nor an alarm in a flight whose surfaces' effects are all made up by the rates."""
    fitted = model.fitted_ranges.model_copy(update={"tied_shares": [0.99, 1.0]})
    known = model.model_copy(update={"fitted_ranges": fitted})
    rows = diagnose(small.flight(model, n=600, lost=((1, 200, 600, 0.0),), seed=8), known)
    assert silent(rows).all()
    assert not rows.credible.any()
    assert list(rows.doubtful_rows) == ["of no surface is the effect known from the flights fitted"]


@pytest.mark.parametrize(
    ("factor", "turned", "refused"),
    [(57.3, 1.0, True), (0.01, 1.0, True), (8.0, 1.0, False), (57.3, 5.0, False), (57.3, 4.0, True),
     (57.3, 0.1, True), (0.01, 0.1, False), (0.0, 1.0, False)],
)  # fmt: skip
def test_a_command_in_another_unit_is_refused_where_rates_move_alike_or_far_less(factor, turned, refused):
    n = np.arange(2000)
    rates = np.column_stack([np.sin(0.01 * (k + 1) * n) for k in range(3)])
    commands = np.column_stack([np.sin(0.03 * n), np.cos(0.02 * n)])
    fitted = FittedRanges(commands=trust.central_ranges(commands), rates=trust.central_ranges(rates))
    flown = commands * [1.0, factor], rates * [1.0, turned, 1.0]
    if refused:
        with pytest.raises(BadInput, match=rf"log: the command of elevator moves {factor:g} times"):
            trust.refuse_command_unit("log", *flown, fitted, ["aileron", "elevator"])
    else:
        trust.refuse_command_unit("log", *flown, fitted, ["aileron", "elevator"])


SPANS = {"commands": [[2.0, 3.0], [-7.0, -6.5]], "rates": [[0.5, 1.1], [-2.2, 0.8], [4.0, 4.4]]}


@pytest.mark.parametrize(
    ("kind", "column", "low", "high", "name"),
    [
        ("commands", 0, 1.5, 3.5, "command of right"), ("commands", 1, -7.25, -6.25, "command of left"),
        ("rates", 0, 0.2, 1.4, "p_rad_s"), ("rates", 1, -3.7, 2.3, "q_rad_s"),
        ("rates", 2, 3.8, 4.6, "r_rad_s"),
    ],
)  # fmt: skip
def test_a_range_is_passed_by_half_its_span_at_either_end(model, kind, column, low, high, name):
    apart(**SPANS)
    fitted = model.fitted_ranges.model_copy(
        update={"command_ranges": SPANS["commands"], "rate_ranges_rad_s": SPANS["rates"]}
    )
    known = model.model_copy(update={"fitted_ranges": fitted})
    middle = {of: np.mean(spans, axis=1) for of, spans in SPANS.items()}
    for value in (low - 0.02, low + 0.02, high - 0.02, high + 0.02):
        flown = {of: np.tile(values, (300, 1)) for of, values in middle.items()}
        flown[kind][:, column] = value
        found = trust.untrusted_rows(small.flight(model, **flown), known)
        first, last = SPANS[kind][column]
        says = f"{name} is outside {first:.3g} to {last:.3g}, where the model was fitted"
        assert list(found) == ([] if low < value < high else [says])


def test_a_condition_counts_where_it_holds_in_more_than_half_of_the_last_five_seconds():
    rows = np.array([1, 0, 1, 1, 0, 0, 0, 0, 1, 1, 1], dtype=bool)
    found = trust._mostly_recently(rows, small.flight(small.model(), 20, dt_s=1.0))
    assert found.astype(int).tolist() == [1, 0, 1, 1, 1, 0, 0, 0, 0, 0, 1]


def test_what_was_clipped_is_remembered_for_half_a_minute():
    for at, found in ((2, [2, 3, 4, 5]), (9, [])):
        assert np.flatnonzero(trust._clipped_recently(np.arange(8) == at, 10.0)).tolist() == found


def test_for_how_long_each_column_may_stand_still():
    """A rate for a third of 1.5 s where it is known, any column thrice as long as it did; others for ever."""
    names = ["p_rad_s", "q_rad_s", "r_rad_s", "roll", "pitch", "air"]
    samples = small.flight(small.model(), 20, unchanged_s=dict.fromkeys(names, np.zeros(20)))
    known = {"p_rad_s": 0.4, "r_rad_s": 0.1, "roll": 2.0, "pitch": 0.3, "other": 9.0}
    model = small.model(fitted={"commands": [], "rates": [], "still_s": known})
    most = dict(zip(names, [pytest.approx(1.2), 1.5, 0.5, 6.0, 1.5, np.inf], strict=True))
    assert trust._max_still_s(samples, model) == most
    assert trust._max_still_s(samples, small.model()) == dict(
        zip(names, [1.5] * 3 + [np.inf] * 3, strict=True)
    )
    still_s = {"q_rad_s": np.array([1.5, 1.51, 0.0]), "air": np.full(3, 99.0)}
    short = replace(samples, t_s=np.arange(3.0), unchanged_s=still_s)
    assert trust.dead_rows(short, model).tolist() == [False, True, False]
    clipped = replace(short, is_rate_clipped=np.array([False, False, True]))
    assert trust.dead_rows(clipped, model).tolist() == [False, True, True]


def test_a_group_that_is_tied_to_98_of_a_hundred_is_not_claimed():
    model = small.model(fitted={"commands": [], "rates": [], "tied": [0.98, 0.979]})
    assert (trust.known_effects(model), trust.unknown_surfaces(model)) == (
        [False, True],
        {"right"},
    )
    says = (
        "of what right does, 98.0% follows from the rates, signals and other surfaces of the flights fitted"
    )
    assert trust.unknown_sentences(model) == [f"{says}: its effect cannot be told, nothing is said of it"]
    for unknown in (small.model(), small.model(fitted={"commands": [], "rates": []})):
        assert (trust.known_effects(unknown), trust.unknown_sentences(unknown)) == (
            [True, True],
            [],
        )


def test_what_is_kept_of_the_flights_fitted():
    """Of each column the longest stand; of the energy height the lowest 15 of a hundred; of commands their
    reach over that of the fit."""
    climbs = np.append(np.arange(22.0), np.nan)  # 0 to 20 are used, and what is no number
    use = np.arange(23) != 21
    one = small.flight(
        small.model(),
        23,
        energy_height_rate_mps=climbs,
        unchanged_s={"roll": np.array([0.3, 0.2])},
    )
    other = small.flight(small.model(), 23, unchanged_s={"roll": np.array([0.4]), "air": np.array([0.7])})
    flights = [(other, use), (one, use)]
    assert trust._unpowered_climb(flights) == pytest.approx(3.0)
    assert trust._unpowered_climb(flights[:1]) is None
    assert trust._longest_still(flights) == {"roll": 0.4, "air": 0.7}
    model = small.model(fitted={"commands": [[0.0, 1.0], [1.0, 3.0]], "rates": []})
    commands = np.linspace([-1.0, 0.0], [3.0, 3.0], 1001)
    flown = replace(other, commands=commands)
    assert trust._relative_motion(flown, model, ["left"]) == pytest.approx(2.994 / 2.0)
    assert trust._relative_motion(flown, model, ["left", "right"]) == pytest.approx(3.992)
    assert trust._relative_motion(flown, small.model(), ["left"]) == 0.0
    assert trust.central_ranges(np.array([[np.nan, 2.0], [np.nan, 2.0]])) == [[0.0, 0.0], [2.0, 2.0]]
    assert trust.central_ranges(np.empty((3, 0))) == []


def test_reasons_come_with_their_shares_the_largest_first():
    found = {"one": np.array([1, 0, 0, 0], bool), "other": np.array([1, 1, 0, 1], bool)}
    assert trust.credibility_entry(found, np.array([0, 0, 1, 0])) == {
        "share": 0.25, "reasons": [{"says": "other", "share": 0.75}, {"says": "one", "share": 0.25}],
    }  # fmt: skip
    assert trust.credibility_entry({}, np.array([])) == {"share": 0.0, "reasons": []}


@pytest.mark.parametrize(("counted", "misread", "says"), [
    (19.0, 0.0, None), (19.01, 0.0, 3), (100.0, 0.0, 17), (38.0, 0.1, None), (38.1, 0.1, 7),
])  # fmt: skip
def test_a_mistake_is_told_where_it_explains_every_part_more_than_chance(monkeypatch, counted, misread, says):
    """Of two readings by more than 2000 times: in the part that gains least 0.3, and 0.1 by its unit; and by
    twice of what flights gained that were read as they are."""
    likely = np.array([0.9, 0.3, 0.5, 0.7])
    parts = {"as it is": (np.zeros(4), counted), "short": None, "other": (likely, counted)}
    read = [CorrectedLog(*one) for one in (("A", "short"), ("B", "other", 0.1))]
    monkeypatch.setattr(trust, "_likelihoods_and_size", lambda samples, _: parts[samples])
    monkeypatch.setattr(trust, "corrected_logs", lambda *_: read)
    told = None if says is None else f"each part of the flight is at least 10^{says} times as likely with B"
    model = (
        small.model(fitted={"commands": [], "rates": [], "misread": misread}) if misread else small.model()
    )
    assert trust._likelier_mistake("as it is", model) == told
    parts["as it is"] = None
    assert trust._likelier_mistake("as it is", small.model()) is None


@pytest.mark.parametrize(("logged", "share", "factor", "likelier"), [
    (-1.0, 1.0, "-1", True), (1000.0, 1.0, "0.001", True),
    (1.0, -0.3, "-1", False), (1.0, 0.05, "0.001", False),
])  # fmt: skip
def test_a_mended_signal_must_be_likelier_than_none(logged, share, factor, likelier):
    """logged: by how much the log has a signal multiplied; share: of the modelled effect that the signal has.
    Where the model errs, the mend is nearer to the truth than the model, and no effect at all is nearest."""
    past = np.array(small.model(small.TAIL).past_coefficients)
    past[-1] = 0.2, 0.15, -0.1
    model = small.model(small.TAIL, past=past.tolist())
    past[-1] *= share
    flown = small.flight(small.model(small.TAIL, past=past.tolist()), 800)
    flown = replace(flown, signals=logged * flown.signals)
    gains, _ = trust.mistake_gains(flown, model)
    assert (gains[f"`scale: {factor}` on airspeed_m_s"] > 0.05) == likelier


@pytest.mark.parametrize(("without", "gain"), [
    ([0.2, 0.2, 0.6, 0.4], 0.3), ([0.4, 0.3, 0.5, 0.7], 0.1), ([0.5, 0.4, 0.5, 0.8], -0.2),
])  # fmt: skip
def test_with_no_signal_the_whole_flight_is_compared(monkeypatch, without, gain):
    """The mend gains 0.3 in the part where it gains least. Of no signal all parts count together: a part in
    which the signal hardly moves may be likelier without it."""
    parts = {"as it is": [0.0, 0.0, 0.0, 0.0], "mended": [0.5, 0.3, 0.5, 0.7], "without": without}
    monkeypatch.setattr(trust, "_likelihoods_and_size", lambda samples, _: (np.array(parts[samples]), 9.0))
    mended = CorrectedLog("mended", "mended", scaled_signal="airspeed_m_s")
    monkeypatch.setattr(trust, "corrected_logs", lambda *_: [mended])
    monkeypatch.setattr(trust, "log_without_signal", lambda *_: "without")
    found, _ = trust.mistake_gains("as it is", small.model(small.TAIL))
    assert found["mended"] == pytest.approx(gain)


@pytest.mark.parametrize(
    ("most", "least", "moved", "says"),
    [
        (-0.31, -0.5, 1.0, "sign"), (-0.3, -0.5, 1.0, ""), (0.19, 0.0, 3.1, "at most 0.19"),
        (0.19, 0.0, 3.0, ""), (0.2, 0.0, 3.1, ""), (9.0, 5.1, 0.3, "at least 5.1"), (9.0, 5.0, 0.3, ""),
        (9.0, 5.1, 0.34, ""), (9.0, 5.1, 0.0, ""),  # how far it moves in the model's flights is not known
    ],
)  # fmt: skip
def test_an_answer_is_wrong_in_its_sign_or_by_its_unit(monkeypatch, most, least, moved, says):
    """A unit shows where the command moves otherwise by as much as the rates answer otherwise."""
    monkeypatch.setattr(trust, "_relative_motion", lambda samples, model, group: moved)
    model = SimpleNamespace(groups=[["right", "left"]], fitted_ranges=None)
    found = trust._GainBounds([most], [least], np.zeros(4))
    wrong = trust._mistake_texts(None, model, found)
    if not says:
        assert wrong == {}
        return
    ((what, line),) = wrong.items()
    assert what == ("sign right+left" if says == "sign" else "unit right+left")
    assert says == "sign" or (says in line and f"moves {moved:.3g} times" in line)


@pytest.mark.parametrize(("sd", "refused"), [(0.1, ["sign wing", "unit wing"]), (0.25, ["sign wing"])])
def test_a_gain_that_the_model_may_have_wrong_by_all_of_it_refuses_no_log(monkeypatch, sd, refused):
    """Four standard errors of a quarter: by such a model a sound log answers with a gain of 0.19, too."""
    monkeypatch.setattr(trust, "_relative_motion", lambda samples, model, group: 3.1)
    known = SimpleNamespace(
        tied_shares=[0.9],
        group_gain_sd=[sd],
    )
    model = SimpleNamespace(groups=[["wing"]], fitted_ranges=known, vehicle=SimpleNamespace(other_laws=True))
    found: dict[str, str] = {}
    for most in (-0.31, 0.19):
        found |= trust._mistake_texts(None, model, trust._GainBounds([most], [0.0], np.zeros(4)))
    assert list(found) == refused


def test_of_a_rate_without_a_number_no_unit_is_judged():
    """Were the other axes' spread judged alone, 57.3 times as wide would be deg/s."""
    known = small.model(fitted={"commands": [], "rates": [], "spread": [1.0, 1.0, 1.0]})
    rates = np.random.default_rng(1).normal(0.0, 57.3, (200, 3))
    with pytest.raises(BadInput, match="deg/s"):
        trust.refuse_rate_unit(small.flight(known, 200, rates=rates), known.fitted_ranges)
    rates[:, 2] = np.nan
    trust.refuse_rate_unit(small.flight(known, 200, rates=rates), known.fitted_ranges)


def test_the_power_of_a_group_s_effect_is_in_variances_of_correlated_noise(model):
    """Commands that nothing else makes up: e = B u of each lag, and the mean of e' N^-1 e about its mean."""
    root = np.array([[0.05, 0.0, 0.0], [0.03, 0.03, 0.0], [-0.01, 0.01, 0.015]])
    correlated = small.model(noise=(root @ root.T).tolist())
    flights = [small.flight(correlated, n=n, seed=n, lost=((0, 50, 90, 0.4),)) for n in (300, 400)]
    used = [np.arange(len(flown.t_s)) % 50 > 7 for flown in flights]
    power, unexplained = trust._effect_powers(list(zip(flights, used, strict=True)), correlated)
    rows = [(f, k) for f, use in enumerate(used) for k in np.flatnonzero(use) if k >= 3]
    moved = [flown.commands * flown.labels for flown in flights]
    lagged = np.array([[moved[f][k - j] for j in (1, 2, 3)] for f, k in rows])
    past = np.array([[*flights[f].rates[k - 1], *flights[f].rates[k - 2]] for f, k in rows])
    inverse = np.linalg.inv(correlated.residual_covariance)
    for g in range(2):
        effect = lagged[:, :, g] @ np.array(correlated.command_response[g])
        effect -= effect.mean(axis=0)
        others = np.column_stack([np.ones(len(rows)), past, lagged[:, :, 1 - g]])
        left = effect - others @ np.linalg.lstsq(others, effect, rcond=None)[0]
        for found, shown in ((power, effect), (unexplained, left)):
            weighted = np.einsum("ki,ij,kj->k", shown, inverse, shown)
            assert found[g] == pytest.approx(weighted.mean(), rel=1e-9)
    both = list(zip(flights, used, strict=True))
    np.testing.assert_array_equal(trust.untied_power(both, correlated), unexplained)


def test_of_a_strong_effect_a_fiftieth_that_is_left_counts_as_that_of_one_of_12_variances(monkeypatch):
    """Powers of an effect, and of what is left; one that is left whole, one that did not move."""
    powers = np.array([30.0, 5.0, 30.0, 1e-7, 1.1e-6]), np.array([0.25, 0.05, 20.0, 0.0, 0.88e-6])
    monkeypatch.setattr(trust, "_effect_powers", lambda of, model: powers)
    found = trust.tied_shares([], None)
    np.testing.assert_allclose(found, [0.98, 0.99, 0.0, 1.0, 0.2])


def test_a_value_that_is_missing_is_not_outside():
    values = np.array([1.9, 2.0, 3.0, 5.0, 5.1, np.nan])
    within = trust._in_range(values, 2.0, 5.0)
    assert within.tolist() == [False, True, True, True, False, True]


def test_what_a_model_was_fitted_on_is_of_the_rows_in_use(monkeypatch):
    """Two flights at other rates, of which one has an airspeed; every figure by numpy's own functions."""
    model, rng = small.model(small.TAIL), np.random.default_rng(9)
    one, other = (small.flight(model, n=n, seed=n) for n in (300, 200))
    commands = one.commands + rng.uniform(-0.3, 0.5, (300, 3))
    rates = np.where(rng.uniform(size=(300, 3)) < 0.1, np.nan, one.rates + np.arange(1.0, 4.0))
    speeds = np.where(np.arange(300) % 7 == 3, np.nan, 20.0 + 0.01 * np.arange(300))
    climbs = np.linspace(-4.0, 7.0, 200) ** 3
    one = replace(one, commands=commands, rates=rates, airspeed=speeds)
    still = {"roll": np.array([0.3, 0.7])}
    other = replace(other, dt_s=0.25, energy_height_rate_mps=climbs, unchanged_s=still)
    used = [np.arange(300) > 40, np.arange(200) % 3 > 0]
    monkeypatch.setattr(trust, "tied_shares", lambda of, its: np.array([0.31, 0.42]))
    flights = list(zip((one, other), used, strict=True))
    found = trust.compute_fitted_ranges(flights, model, np.array([0.05, 0.06]))
    rates, commands = (
        np.vstack([getattr(flight, what)[use] for flight, use in flights]) for what in ("rates", "commands")
    )

    def reach(values):
        known = values[np.isfinite(values)]
        return pytest.approx(np.quantile(known, [0.001, 0.999]))

    assert found.command_ranges == [reach(column) for column in commands.T]
    assert found.rate_ranges_rad_s == [reach(column) for column in rates.T]
    assert found.airspeed_range_mps == reach(speeds[used[0]])
    known = [column[np.isfinite(column)] for column in rates.T]
    assert found.rate_sd_rad_s == pytest.approx([column.std() for column in known])
    assert (found.tied_shares, found.group_gain_sd) == (
        [0.31, 0.42], [0.05, 0.06],
    )  # fmt: skip
    assert found.longest_still_s == {"roll": 0.7}
    assert found.unpowered_climb_mps == pytest.approx(np.quantile(climbs[used[1]], 0.15))
    assert trust.compute_fitted_ranges(flights[1:], model, np.ones(2)).airspeed_range_mps is None


SD = np.array([0.7, 1.3, 0.4])


@pytest.mark.parametrize(("factors", "says"), [
    ([57.3 * 2.5] * 3, r"143 times .* rad/s; a factor of 0\.01745 \(`unit: deg/s`\) fits"),
    ([57.3 * 2.6] * 3, None), ([57.3 / 2.6] * 3, None),
    ([57.3 / 2.5] * 3, r"22\.9 times .* a factor of 0\.01745 \(`unit: deg/s`\) fits"),
    ([5730.0] * 3, r"5\.73e\+03 times .* a factor of 0\.0001745 \(`unit: cdeg/s`\) fits"),
    ([1000.0] * 3, r"1e\+03 times .* a factor of 0\.001 \(`unit: mrad/s`\) fits"),
    ([2.5 / 57.3] * 3, r"0\.0436 times .* a factor of 57\.3 fits: the model's own were in deg/s\?"),
    ([2.6 / 57.3] * 3, None),
    ([1.0 / 5730.0] * 3, r"a factor of 5730 fits: the model's own were in cdeg/s\?"),
    ([0.0009] * 3, r"a factor of 1000 fits: the model's own were in mrad/s\?"),
    ([57.3, 9.9 * 57.3, 57.3], r"123 times .*deg/s`\) fits"), ([57.3, 10.1 * 57.3, 57.3], None),
    ([0.1 / 57.3, 1.0 / 57.3, 1.1 / 57.3], None), ([0.12 / 57.3, 1.1 / 57.3, 1.1 / 57.3], "in deg/s"),
])  # fmt: skip
def test_rates_are_in_another_unit_where_all_axes_spread_by_about_its_factor(factors, says):
    """Within 2.56 of it, in the geometric mean of the axes, which are within ten of one another."""
    rates = np.random.default_rng(3).standard_normal((300, 3))
    rates = (rates - rates.mean(axis=0)) / rates.std(axis=0) * SD * factors + 5.0
    fitted = FittedRanges(commands=[], rates=[], spread=SD.tolist())
    flight = small.flight(small.model(), 300, rates=rates)
    if says is None:
        trust.refuse_rate_unit(flight, fitted)
        return
    with pytest.raises(BadInput, match=f"^small: rates spread .*{says}"):
        trust.refuse_rate_unit(flight, fitted)


@pytest.mark.parametrize(("value", "credible"), [
    (16.9, False), (17.1, True), (34.4, True), (34.6, False), (np.nan, True),
])  # fmt: skip
def test_the_airspeed_may_be_15_percent_beyond_either_end(value, credible):
    model = small.model(fitted={"commands": [], "rates": [], "airspeed": [20.0, 30.0]})
    flight = small.flight(model, 20, airspeed=np.full(20, value))
    says = "airspeed is outside 20 to 30, where the model was fitted"
    assert list(trust.untrusted_rows(flight, model)) == ([] if credible else [says])
    assert trust.untrusted_rows(replace(flight, airspeed=None), model) == {}


def test_of_a_column_that_stands_still_the_rates_are_not_read():
    model = small.model()
    still = {"p_rad_s": np.where(np.arange(9) == 4, 1.6, 0.0)}
    flight = small.flight(model, 9, unchanged_s=still)
    found = trust.without_dead_rows(flight, model)
    assert np.flatnonzero(np.isnan(found.rates).all(axis=1)).tolist() == [4]
    np.testing.assert_array_equal(np.delete(found.rates, 4, axis=0), np.delete(flight.rates, 4, axis=0))
    moving = replace(flight, unchanged_s={})
    assert trust.without_dead_rows(moving, model) is moving


@pytest.mark.parametrize(("laws", "tied", "known"), [
    (True, [0.3, 0.4], [True, False]), (True, [0.99, 0.4], [False, False]),
    (False, [0.3, 0.99], [True, False]), (False, [0.3, 0.4], [True, True]),
])  # fmt: skip
def test_under_any_law_a_gain_is_known_where_four_errors_are_less_than_it(laws, tied, known):
    fitted = {"commands": [], "rates": [], "tied": tied, "gain_sd": [0.249, 0.25]}
    assert trust.known_gains(small.model(small.WING | {"other_laws": laws}, fitted=fitted)) == known
    del fitted["gain_sd"]
    bare = small.model(small.WING | {"other_laws": laws}, fitted=fitted)
    assert trust.known_gains(bare) == [share < 0.98 for share in tied]


def test_a_mistake_is_one_by_each_colour_that_is_likelier(monkeypatch):
    """The likelier of the model's two colours is asked; of the others those that are likelier still have a
    say, and what all of them find is told."""
    colours = [{"average": [1.0, c], "noise": (s * np.eye(3)).tolist()} for c, s in ((0.1, 2.0), (0.2, 3.0))]
    model = small.model(colours=colours)
    likely = {
        (1.0, 0.1): [1.0, 2.0, 3.0, 4.0], (1.0, 0.2): [2.0, 2.0, 2.0, 5.0], "another": [2.8] * 4,
        "likelier": [0.0, 0.0, 0.0, 11.2], "less": [9.0, 0.0, 0.0, 2.0], "too short": None,
    }  # fmt: skip
    wrong = {
        (1.0, 0.1): {}, (1.0, 0.2): {name: name.upper() for name in "abcd"}, "less": {},
        "likelier": dict.fromkeys("dce", "no"), "another": dict.fromkeys("bcd", "no"),
    }  # fmt: skip
    monkeypatch.setattr(trust, "NOISE_MA_CANDIDATES", ["too short", "likelier", "less", "another"])
    monkeypatch.setattr(
        trust,
        "whiten_samples",
        lambda of, by: SimpleNamespace(name="log", by=by if isinstance(by, str) else tuple(by)),
    )
    asked = []

    def bounds(flight, of):
        asked.append((flight.by, len(of.noise_models)))
        parts = likely[flight.by]
        return parts and trust._GainBounds(flight.by, [], np.array(parts))

    monkeypatch.setattr(trust, "_likelihoods_and_size", lambda flight, of: (np.array(likely[flight.by]), 9.0))
    monkeypatch.setattr(trust, "_bound_gains", bounds)
    monkeypatch.setattr(
        trust,
        "_mistake_texts",
        lambda flight, of, by: wrong[by.upper_gains],
    )
    told = []
    monkeypatch.setattr(
        trust,
        "_likelier_mistake",
        lambda flight, of: told.append((flight.by, of.noise_models[0].ma_coefficients)) or "exchanged",
    )
    log = small.flight(small.model(), 9, name="log")
    with pytest.raises(
        BadInput, match=r"^log: C, allowed: columns, signs and units as in the flights of the"
    ):
        trust.refuse_columns(log, model)
    assert asked == [((1.0, 0.2), 1), *((name, 2) for name in trust.NOISE_MA_CANDIDATES)]
    assert told == []
    wrong["another"] = {}
    with pytest.raises(BadInput, match=r"^log: exchanged, allowed: "):
        trust.refuse_columns(log, model)
    assert told == [((1.0, 0.2), [1.0, 0.2])]
    nothing = {"commands": [], "rates": [], "tied": [1.0, 0.99]}
    trust.refuse_columns(log, small.model(colours=colours, fitted=nothing))
