"""What is fitted, of which order, and how it is tested elsewhere: on flights of models that are known."""

from types import SimpleNamespace

import numpy as np
import pytest

from beaver_ftc.documents.errors import BadInput
from beaver_ftc_logs import fitting, regression
from beaver_ftc_logs.fitting import FitPart
from beaver_ftc_logs.recording import LoggedFailure
from beaver_ftc_logs.samples import Samples
from kept import in_short
from products.logs import small

MODEL = small.model()
TAIL = small.model(small.TAIL)
LOST = ((1, 300, 400, 0.5), (0, 600, 700, 0.4))


def changed(samples, **changes):
    return Samples(**(vars(samples) | changes))


def labelled(parts, dt_s=0.5, **changes):
    """Samples whose labels are these: (count, right, left)."""
    labels = np.array([left for count, *left in parts for _ in range(count)], dtype=float)
    n = len(labels)
    given = {
        "labels": labels,
        "dt_s": dt_s,
        "t_s": dt_s * np.arange(n),
        "stretch_number": np.zeros(n, dtype=int),
    }
    return changed(small.flight(MODEL, n), **given, **changes)


NAN = np.nan
USED = {  # at 2 Hz: three samples at either edge of a label, all of what lasts less than six
    "a level for six samples": ([(10, 1, 1), (6, 1, 0.5), (9, 1, 1)], [3, 4, 5, 6, 19, 20, 21]),
    "for seven": ([(10, 1, 1), (7, 0.4, 1), (8, 1, 1)], [3, 4, 5, 6, 13, 20, 21]),
    "for five": ([(10, 1, 1), (5, 1, 0.5), (10, 1, 1)], [3, 4, 5, 6, 18, 19, 20, 21]),
    "one label is none": ([(8, 1, 1), (8, 1, NAN), (8, NAN, 1), (7, 1, 1)], [3, 4, 27]),
    "one surface has labels": ([(8, 1, NAN), (8, 0.5, NAN)], [3, 4, 11, 12]),
    "nothing is said": ([(4, NAN, NAN)], [0, 1, 2, 3]),
}


@pytest.mark.parametrize("name", USED)
def test_which_samples_are_known(name):
    parts, used = USED[name]
    assert np.flatnonzero(fitting.usable_mask(labelled(parts))).tolist() == used


def test_what_follows_a_failure_is_not_fitted():
    """From a second before the first failure on."""
    samples = labelled(
        [(20, NAN, NAN)], logged_failures=(LoggedFailure(6.0, "rudder"), LoggedFailure(5.0, "elevator"))
    )
    assert np.flatnonzero(fitting.usable_mask(samples)).tolist() == list(range(8))


def by_hand(samples, vehicle, history, lags):
    """Regressors and rates of one flight, row by row, where there is past enough for the largest order."""
    groups = regression.group_surfaces(vehicle)
    left = np.where(np.isfinite(samples.labels), samples.labels, 1.0)
    rows, rates = [], []
    for k in np.flatnonzero(fitting.usable_mask(samples)):
        reach = max(history, lags)
        if k < 6 or samples.stretch_number[k - reach] != samples.stretch_number[k]:
            continue
        past = [samples.rates[k - j] for j in range(1, history + 1)]
        moved = [
            sum(samples.commands[k - j, i] * left[k - j, i] for i in group)
            for group in groups
            for j in range(1, lags + 1)
        ]
        rows.append(np.concatenate([[1.0], *past, samples.signals[k - 1], moved]))
        rates.append(samples.rates[k])
    return np.array(rows), np.array(rates)


@pytest.mark.parametrize(("model", "history", "lags"), [(MODEL, 2, 3), (TAIL, 3, 2), (MODEL, 1, 6)])
def test_regressors_of_several_flights_stand_in_a_row(model, history, lags):
    flights = [
        small.flight(model, 180, gap=110, lost=((0, 50, 90, 0.3),)),
        small.flight(model, 120, seed=2, lost=((1, 40, 80, 0.6),)),
    ]
    x, y, run = fitting.stack_data(fitting.fit_parts(flights), model.vehicle, history, lags)
    parts = [by_hand(flight, model.vehicle, history, lags) for flight in flights]
    np.testing.assert_allclose(x, np.vstack([part[0] for part in parts]), atol=1e-14)
    np.testing.assert_allclose(y, np.vstack([part[1] for part in parts]), atol=0)
    assert run[len(parts[0][0]) - 1] < run[len(parts[0][0])]
    assert (np.diff(run) >= 0).all()


def test_a_stretch_ends_where_a_sample_is_left_out():
    samples = small.flight(MODEL, 60)
    use = np.ones(60, dtype=bool)
    use[[20, 40, 41]] = False
    _, y, run = fitting.stack_data([FitPart(samples, use)], MODEL.vehicle, 2, 3)
    assert np.unique(run, return_counts=True)[1].tolist() == [14, 19, 18]
    assert len(y) == 51


def score(usable_flights, vehicle, order):
    """The Bayesian information criterion of an order, of its own fit."""
    x, y, _ = fitting.stack_data(usable_flights, vehicle, *order)
    rest = y - x @ np.linalg.lstsq(x, y, rcond=None)[0]
    return len(y) * np.linalg.slogdet(rest.T @ rest / len(y))[1] + 3 * x.shape[1] * np.log(len(y))


ORDERS = [(history, lags) for history in (1, 2, 3, 4) for lags in (2, 3, 4, 6)]


@pytest.mark.parametrize("true", [(1, 2), (2, 3), (3, 4), (4, 6)])
@pytest.mark.parametrize("of", [small.WING, small.TAIL], ids=["wing", "tail"])
def test_the_order_is_the_one_of_the_least_criterion(of, true):
    model = small.model(of, history=true[0], lags=true[1])
    usable_flights = fitting.fit_parts([small.flight(model, 400), small.flight(model, 300, seed=3)])
    found = fitting.choose_order(usable_flights, model.vehicle)
    assert found == min(ORDERS, key=lambda order: score(usable_flights, model.vehicle, order))
    if of is small.WING:
        assert found == true


@pytest.mark.parametrize("seed", range(8))
def test_the_order_of_a_flight_too_short_to_tell(seed):
    """Where terms are about as large as their errors any mistake in the criterion shows."""
    rng = np.random.default_rng(seed)
    response = (small.RESPONSE * [[[1.0]], [[1.0]]])[:, :1].repeat(3, axis=1) * rng.uniform(-1, 1, (2, 3, 3))
    model = small.model(response=(3.0 * response).tolist())
    usable_flights = fitting.fit_parts([small.flight(model, 120 + 10 * seed, seed=seed)])
    least = min(ORDERS, key=lambda order: score(usable_flights, model.vehicle, order))
    assert fitting.choose_order(usable_flights, model.vehicle) == least


def test_columns_of_an_order():
    """One, the past, the signal, then the lags of each group, of 1 + 12 + 1 + 6 + 6."""
    assert fitting._order_columns(TAIL.vehicle, 4, 6) == list(range(26))
    assert fitting._order_columns(TAIL.vehicle, 1, 2) == [0, 1, 2, 3, 13, 14, 15, 20, 21]
    moving = small.vehicle(
        small.TAIL | {"moving_air": True}
    )  # as many lags of the signal: 1 + 12 + 4 + 6 + 6
    assert fitting._order_columns(moving, 4, 6) == list(range(29))
    assert fitting._order_columns(moving, 2, 3) == [
        *range(7), 13, 14, 17, 18, 19, 23, 24, 25,
    ]  # fmt: skip
    assert fitting._order_columns(MODEL.vehicle, 3, 3) == [*range(10), 13, 14, 15, 19, 20, 21]


def test_a_fit_wants_ten_samples_a_coefficient():
    """13 coefficients an axis: 130 samples will do, 129 will not."""
    samples = small.flight(MODEL, 146)
    use = np.ones(146, dtype=bool)
    use[136:] = False
    assert fitting.fit_order([FitPart(samples, use)], MODEL.vehicle, 2, 3).coefficients.shape == (13, 3)
    use[135] = False
    says = "129 samples known to be healthy, allowed: at least 130 to fit 13 coefficients an axis"
    with pytest.raises(BadInput, match=says):
        fitting.fit_order([FitPart(samples, use)], MODEL.vehicle, 2, 3)


@pytest.mark.parametrize(("size", "moves"), [(0.9e-6, False), (1.1e-6, True)])
def test_a_rate_that_stands_still_is_refused(size, moves):
    samples = small.flight(MODEL, 200)
    rates = samples.rates.copy()
    rates[6:, 1] = 0.3 + size * np.where(np.arange(194) % 2, 1.0, -1.0)
    usable_flights = [FitPart(changed(samples, rates=rates), np.ones(200, dtype=bool))]
    if moves:
        assert fitting.fit_order(usable_flights, MODEL.vehicle, 2, 3) is not None
        return
    with pytest.raises(BadInput, match="rate q does not move, allowed: flights in which every rate does"):
        fitting.fit_order(usable_flights, MODEL.vehicle, 2, 3)


def test_standard_errors_hold_for_colour_of_two_seconds():
    usable_flights = fitting.fit_parts([small.flight(MODEL, 400)])
    x, y, run = fitting.stack_data(usable_flights, MODEL.vehicle, 2, 3)
    found = fitting.fit_order(usable_flights, MODEL.vehicle, 2, 3)
    expected = regression.fit_ols(x, y, run, 20)
    np.testing.assert_array_equal(found.standard_errors, expected.standard_errors)


@pytest.fixture(scope="module")
def usable_flights():
    return fitting.fit_parts([small.flight(MODEL, 1000, lost=LOST)])


@pytest.fixture(scope="module")
def fitted(usable_flights):
    return fitting.fit_model(usable_flights, MODEL.vehicle)


def in_numbers(model):
    """A model with its arrays in short."""
    found = model.model_dump(exclude={"vehicle", "settings", "identification_results"}, by_alias=True)
    return {key: in_short(value) if key in ARRAYS else value for key, value in found.items()}


ARRAYS = ("intercept", "past", "response", "response_sd", "noise")


def test_a_model_is_what_was_fitted(changed, fitted, usable_flights):
    assert not changed(in_numbers(fitted))
    fit = fitting.fit_order(usable_flights, MODEL.vehicle, fitted.n_rate_lags, fitted.n_command_lags)
    past = 1 + 3 * fitted.n_rate_lags
    assert fitted.intercept == fit.coefficients[0].tolist()
    assert fitted.past_coefficients == fit.coefficients[1:past].tolist()
    for field, values in (
        ("command_response", fit.coefficients),
        ("response_error", fit.standard_errors),
    ):
        for group in range(2):
            begin = past + group * fitted.n_command_lags
            assert getattr(fitted, field)[group] == values[begin : begin + fitted.n_command_lags].tolist()
    assert fitted.residual_covariance == fit.residual_covariance.tolist()
    assert fitted.rate_hz == pytest.approx(10.0)
    np.testing.assert_allclose(fitted.command_response, MODEL.command_response, atol=0.06)


def test_settings_are_what_the_flights_say(changed, fitted):
    assert not changed(fitted.settings.model_dump(by_alias=True))


def test_settings_by_hand(fitted):
    """Two changes to a fault, two repairs, over the time in use; three surfaces of which two move as one."""
    use = sum(fitting.usable_mask(small.flight(MODEL, 1000, lost=LOST)))
    settings = fitted.settings
    assert settings.likely_levels == {"right": [0.4], "left": [0.5]}
    assert settings.effectiveness_changes_per_hour == pytest.approx(np.sqrt((4 + 1) / (use / 36000.0) * 12.0))
    assert settings.repair_share == pytest.approx((2 + 10) / (4 + 20))
    assert settings.command_delays_s == pytest.approx([-0.04, 0.0, 0.04])
    stuck = fitting.estimate_filter_settings(fitting.fit_parts([small.flight(TAIL, 400)]), TAIL)
    assert stuck.likely_levels == {}
    assert 0.0 < stuck.effective_sample_share <= 0.9
    given = settings.model_copy(update={"alarm_probability": 0.7})
    usable_flights = fitting.fit_parts([small.flight(MODEL, 300)])
    assert fitting.fit_model(usable_flights, MODEL.vehicle, given).settings == given
    assert fitting.refit(usable_flights, fitted).settings == settings


def days(gains):
    """Flights of days on which the right surface acts so many times as the left one does."""
    flown = [small.flight(MODEL, 1500, seed=20 + i, name=f"day-{i}") for i in range(len(gains))]
    told = [changed(one, labels=np.full_like(one.labels, np.nan)) for one in flown]
    return fitting.fit_parts(
        [changed(one, commands=one.commands / [gain, 1.0]) for one, gain in zip(told, gains, strict=True)]
    )


def test_flights_that_are_alike_tell_all_that_their_noise_allows():
    """The squares of Gaussian gains are as many as these, on average: 12 of them, within three sd of that."""
    alike = fitting.gain_overdispersion(days([1.0] * 6), MODEL)
    assert alike == pytest.approx(1.0, abs=3.0 * np.sqrt(2.0 / 12.0))


def test_days_that_differ_let_a_sample_tell_less():
    """Differences far above what the noise allows: the larger they are, the less."""
    none, some, more = (
        fitting.gain_overdispersion(days(1.0 + size * np.tile([-1, 1], 3)), MODEL)
        for size in (0.0, 0.15, 0.3)
    )
    assert more > 1.5 * some > 5.0 * none
    assert fitting.estimate_filter_settings(days([0.7, 1.3] * 3), MODEL).effective_sample_share < 0.2


def test_levels_of_a_label_in_their_order():
    """To six digits, one that comes twice twice, edges left out."""
    values = np.repeat([1.0, 0.4000001, 1.0, np.nan, 0.7, 0.7000004], 3)
    samples = changed(small.flight(MODEL, 18), labels=np.column_stack([values, values]))
    use = np.ones(18, dtype=bool)
    assert fitting._label_levels(FitPart(samples, use), 1) == [
        1.0,
        0.4,
        1.0,
        0.7,
        0.7,
    ]
    use[:3] = False
    assert fitting._label_levels(FitPart(samples, use), 0) == [0.4, 1.0, 0.7, 0.7]


def test_settings_of_flights_that_change_in_every_way():
    """Three flights: none, weak from the start to the end, twice weak and once repaired."""
    rate = small.flight(MODEL, 400)
    weak = changed(rate, labels=np.tile([1.0, 0.5], (400, 1)))
    labels = np.ones((400, 2))
    labels[100:200, 0], labels[200:300, 0], labels[200:, 1] = 0.6, 0.2, 0.8
    usable_flights = fitting.fit_parts([rate, weak, changed(rate, labels=labels)])
    settings = fitting.estimate_filter_settings(usable_flights, MODEL)
    assert settings.likely_levels == {"right": [0.2, 0.6], "left": [0.5, 0.8]}
    hours = sum(usable_flight.is_usable.sum() for usable_flight in usable_flights) / 36000.0
    assert settings.effectiveness_changes_per_hour == pytest.approx(np.sqrt((3 + 1 + 1) / hours * 12.0))
    assert settings.repair_share == pytest.approx((1 + 10) / (4 + 20))


def test_several_flights_are_left_out_in_turn():
    one, two, three = usable_flights = fitting.fit_parts(
        [small.flight(MODEL, 60, name=name) for name in ("a", "b", "c")]
    )
    assert fitting.validation_folds(usable_flights) == [
        ([two, three], one, "a"),
        ([one, three], two, "b"),
        ([one, two], three, "c"),
    ]


def test_a_flight_alone_is_left_out_by_halves_of_what_is_known():
    use = np.zeros(20, dtype=bool)
    use[[3, 4, 9, 15, 18]] = True
    ((first,), second, late), ((other,), same, early) = fitting.validation_folds(
        [FitPart(small.flight(MODEL, 20), use)]
    )
    assert (late, early) == ("second half", "first half")
    assert np.flatnonzero(first.is_usable).tolist() == np.flatnonzero(same.is_usable).tolist() == [3, 4]
    assert (
        np.flatnonzero(second.is_usable).tolist() == np.flatnonzero(other.is_usable).tolist() == [9, 15, 18]
    )
    nothing = fitting.validation_folds([FitPart(small.flight(MODEL, 20), np.zeros(20, dtype=bool))])
    assert [kept.is_usable.any() for _, kept, _ in nothing] == [False, False]


def test_tests_on_what_was_not_fitted(changed, fitted, usable_flights):
    quick = fitted.settings.model_copy(update={"command_delays_s": [0.0]})
    entries, bounds = fitting.score_folds(usable_flights, fitted.model_copy(update={"settings": quick}))
    assert not changed({"entries": entries, "bounds": bounds})
    assert [entry["left_out"] for entry in entries] == ["second half", "first half"]
    assert all(0.8 < share < 1.0 for entry in entries for share in entry["explained"].values())
    assert all(entry["score"]["classes"] > 0.8 for entry in entries)


def test_without_labels_bounds_stay_as_they_are():
    flights = [small.flight(TAIL, 200, seed=seed) for seed in range(3)]
    settings = TAIL.settings.model_copy(update={"credible_mass": 0.77})
    model = TAIL.model_copy(update={"settings": settings})
    entries, bounds = fitting.score_folds(fitting.fit_parts(flights), model)
    assert bounds == 0.77
    assert [set(entry) for entry in entries] == [{"left_out", "samples", "explained", "residual_rad_s"}] * 3


def test_the_mass_of_the_bounds_is_the_one_that_holds_the_labels_best(monkeypatch, fitted, usable_flights):
    """Held by the bounds of each mass, as told here: nearest to 0.93 is taken."""
    for told, chosen in (
        ([0.5, 0.6, 0.92, 0.95, 0.96, 0.97], 0.7),
        ([0.5, 0.6, 0.7, 0.8, 0.9, 0.99], 0.9),
        ([0.5, 0.6, 0.7, 0.8, 0.85, 0.99], 0.95),
    ):
        by_mass = dict(zip((0.5, 0.6, 0.7, 0.8, 0.9, 0.95), told, strict=True))
        monkeypatch.setattr(fitting, "_rows_by_mass", lambda *given, by_mass=by_mass: by_mass)
        monkeypatch.setattr(fitting, "score_against_labels", lambda held, labels: {"held_by_bounds": held})
        assert fitting.score_folds(usable_flights, fitted)[1] == chosen


def test_what_one_step_prediction_explains(usable_flights):
    """By the residual of the model itself, written out from its file."""
    (usable_flight,) = usable_flights
    samples, use = usable_flight.samples, usable_flight.is_usable
    left = np.where(np.isfinite(samples.labels), samples.labels, 1.0)
    rows, residual = fitting.one_step_residual(MODEL, usable_flight)
    expected = [k for k in np.flatnonzero(use) if k >= 3]
    assert rows.tolist() == expected
    for i in (0, 100, len(expected) - 1):
        k = expected[i]
        past = np.concatenate([samples.rates[k - 1], samples.rates[k - 2]]) @ np.array(
            MODEL.past_coefficients
        )
        moved = sum(
            samples.commands[k - j, g] * left[k - j, g] * np.array(MODEL.command_response[g][j - 1])
            for g in (0, 1)
            for j in (1, 2, 3)
        )
        said = samples.rates[k] - np.array(MODEL.intercept) - past - moved
        np.testing.assert_allclose(residual[i], said, atol=1e-14)
    found = fitting.prediction_quality(MODEL, usable_flight)
    assert found["samples"] == len(expected)
    for axis, name in enumerate("pqr"):
        share = 1.0 - residual[:, axis].var() / samples.rates[expected, axis].var()
        assert found["explained"][name] == pytest.approx(share)
        assert found["residual_rad_s"][name] == pytest.approx(residual[:, axis].std())
    nothing = FitPart(samples, np.zeros(len(use), dtype=bool))
    assert fitting.prediction_quality(MODEL, nothing) == {"samples": 0}


def test_each_part_left_out_is_held_against_what_the_others_ask_for(monkeypatch):
    """Thresholds by what is left: a peak as high as its threshold alarms."""
    parts = [
        (np.array(peaks), minutes) for peaks, minutes in (([1.0, 5.0], 3.0), ([2.0], 4.0), ([3.0, 9.0], 5.0))
    ]
    monkeypatch.setattr(fitting.extremes, "fit_peak_tail", lambda of: [peaks.max() for peaks, _ in of])
    monkeypatch.setattr(fitting, "_choose_threshold", lambda tail, per_hour, model: sum(tail) / per_hour)
    monkeypatch.setattr(fitting, "_healthy_minutes", lambda of: sum(minutes for _, minutes in of))
    # at two an hour: 2 + 9, 5 + 9, 5 + 2 over two
    found = fitting._cross_validate(parts, 2.0, None)
    assert found == {"parts": 3, "minutes": 12.0, "alarmed": 1, "alarms": 1}
    parts[0] = (np.array([5.5, 5.0]), 3.0)
    assert fitting._cross_validate(parts, 2.0, None)["alarmed"] == 2
    assert fitting._cross_validate(parts, None, None) == fitting._cross_validate(parts[:1], 2.0, None) == {}


def test_a_model_is_trusted_as_far_as_its_worst_parts_allow(monkeypatch):
    """Of the first four parts the one that is read wrongly most easily."""
    misread = {1: 0.2, 2: 0.6, 3: 0.1, 4: 0.3, 5: 9.0}
    left_out = [("half", [1, 2]), ("other", [3, 4, 5])]
    monkeypatch.setattr(fitting, "_folds", lambda *of: left_out)
    monkeypatch.setattr(
        fitting,
        "_healthy_peaks",
        lambda tested, one: (np.array([1.0]), one / 60),
    )
    monkeypatch.setattr(fitting, "_misread_gain", lambda tested, one: misread[one])
    monkeypatch.setattr(fitting, "_healthy_minutes", lambda parts: 60 * sum(hours for _, hours in parts))
    monkeypatch.setattr(fitting, "fit_order", lambda *of: "fit")
    monkeypatch.setattr(fitting, "group_gain_sd", lambda fit, model: 0.25)
    monkeypatch.setattr(fitting.trust, "tied_shares", lambda used, model: np.zeros(2))

    def copied(known):
        return SimpleNamespace(known=known, model_copy=lambda update: copied(known | update))

    def fitted_ranges(used, model, sd):
        return copied({"of": sd.tolist()})

    monkeypatch.setattr(fitting.trust, "compute_fitted_ranges", fitted_ranges)
    monkeypatch.setattr(fitting.extremes, "fit_peak_tail", lambda parts: None)
    vehicle = SimpleNamespace(false_alarms_per_hour=None, other_laws=False)
    settings = SimpleNamespace(likely_levels={"left": [0.5]}, model_copy=lambda update: update)
    model = SimpleNamespace(
        vehicle=vehicle,
        n_rate_lags=2,
        n_command_lags=3,
        settings=settings,
        groups=[["rudder"]],
        model_copy=lambda update: update,
    )
    found = fitting.add_ranges_and_threshold([], model)
    expected = {
        "alarm_peak_tail": None,
        "misread_gain": 0.6,
        "of": [0.25],
    }
    assert found["fitted_ranges"].known == expected
    assert found["settings"] == {"false_alarms_per_hour": None, "alarm_threshold": None}
    assert found["identification_results"] == {}
    vehicle.false_alarms_per_hour = 0.5
    more = fitting.extremes.RULED_OUT_COUNT * 120 - 15
    with pytest.raises(BadInput, match=f"_per_hour 0.5: 15.0 min .* allowed: {more:.0f} min more"):
        fitting.add_ranges_and_threshold([], model)
