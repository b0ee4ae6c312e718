"""What an identification says of itself: documents, lines for people, and the free runs by another road."""

import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from beaver_ftc.documents import BadInput
from beaver_ftc.results.metrics import as_json
from beaver_ftc_logs import fitting, identification
from beaver_ftc_logs.fitting import FitPart
from beaver_ftc_logs.identification import (
    density_ratios,
    fit_output_error,
    identification_text,
    identify,
    regressor_names,
    scale_if_better,
)
from beaver_ftc_logs.pages import load_template
from beaver_ftc_logs.samples import Samples, scale_by_airspeed
from products.logs import small

MODEL = small.model()
SAYS_LITTLE = {
    "flights": [], "tests": [], "another_day": {}, "colour": {}, "output_error": {}, "collinear": [],
}  # fmt: skip


@pytest.fixture(scope="module")
def identified():
    samples = small.flight(MODEL, 1100, lost=((1, 300, 400, 0.5), (0, 600, 700, 0.4)), notes=("a remark",))
    return identify([samples], MODEL.vehicle)


def pressed(flight, seed=3):
    """The flight as it would be at airspeeds of 15 to 25 m/s, if its commands stood at what they do."""
    speeds = 20.0 + 5.0 * np.sin(0.05 * np.arange(len(flight.t_s)) + seed)
    return replace(flight, airspeed=speeds, commands=flight.commands / ((speeds / 20.0) ** 2)[:, None])


def test_commands_count_with_the_dynamic_pressure_where_that_explains_more():
    flight, its = small.flight(MODEL, 1100), MODEL.vehicle.model_copy(update={"airspeed": "V"})
    (anew,), described = scale_if_better([pressed(flight)], its)
    assert described.reference_airspeed_mps == pytest.approx(20.0, rel=0.02)
    ratio = (20.0 / described.reference_airspeed_mps) ** 2
    assert anew.commands == pytest.approx(ratio * flight.commands)
    wind = replace(flight, airspeed=pressed(flight).airspeed)
    for plain in ([wind], [flight]):
        assert scale_if_better(plain, its) == (plain, its)
    told = its.model_copy(update={"reference_airspeed_mps": 20.0})
    assert scale_if_better([pressed(flight)], told)[1] == told


def test_under_other_laws_each_surface_has_its_own_power_of_the_airspeed():
    flight, its = small.flight(MODEL, 1100), MODEL.vehicle.model_copy(update={"airspeed": "V"})
    flown = pressed(flight)
    by_speed = (flown.airspeed / 20.0)[:, None] ** np.array([[1.0, 2.0]])
    mixed = replace(flown, commands=flight.commands / by_speed)
    told = its.model_copy(update={"other_laws": True})
    (anew,), described = scale_if_better([mixed], told)
    assert described.airspeed_powers == {"right": 1.0}
    ratio = 20.0 / described.reference_airspeed_mps
    assert anew.commands == pytest.approx(flight.commands * ratio ** np.array([1.0, 2.0]))
    assert scale_if_better([flown], told)[1].airspeed_powers == {}
    assert scale_if_better([mixed], its)[1].airspeed_powers == {}
    said = identification_text(
        MODEL.model_copy(update={"vehicle": described, "identification_results": SAYS_LITTLE})
    )
    assert "right with airspeed^1\n" in said
    with pytest.raises(ValueError, match="contradictory"):
        small.vehicle(airspeed_powers={"fin": 1})


def test_the_reference_is_the_median_of_all_airspeeds_that_are_known(monkeypatch):
    flights = [
        replace(small.flight(MODEL, 4), airspeed=np.array(speeds))
        for speeds in ([np.nan, 10.0, 12.0, 90.0], [11.0, np.nan, 13.0, 30.0])
    ]
    asked = []
    monkeypatch.setattr(
        identification,
        "scale_by_airspeed",
        lambda one, mps, powers: asked.append(mps) or one,
    )
    monkeypatch.setattr(identification, "_min_bic", lambda flown, of: 0.0)
    its = MODEL.vehicle.model_copy(update={"airspeed": "V"})
    assert scale_if_better(flights, its) == (flights, its)
    assert asked == [12.5, 12.5]


def test_where_the_airspeed_is_unknown_commands_count_as_they_are():
    flight = replace(small.flight(MODEL, 100), airspeed=np.where(np.arange(100) < 50, np.nan, 10.0))
    found = scale_by_airspeed(flight, 20.0)
    assert found.commands[:50] == pytest.approx(flight.commands[:50])
    assert found.commands[50:] == pytest.approx(flight.commands[50:] / 4.0)
    stopped = scale_by_airspeed(replace(flight, airspeed=np.zeros(100)), 20.0)
    assert stopped.commands == pytest.approx(0.1 * flight.commands)
    assert (found.signals[:50] == 0.0).all()
    assert found.signals[50:] == pytest.approx(-0.5 * flight.rates[50:])


def test_the_account_of_an_identification(changed, identified):
    assert not changed(
        {what: told for what, told in identified.identification_results.items() if what != "output_error"},
        part="found",
    )
    assert not changed(identified.settings.model_dump(by_alias=True), part="settings")
    assert not changed(identification_text(identified).splitlines(), part="summary")


DAY = {
    "classes": {"mean": 0.9, "worst": 0.8},
    "healthy_or_faulty": {"mean": 0.95, "worst": 0.9},
    "mean_error": {"mean": 0.01, "worst": 0.02},
    "held_by_bounds": {"mean": 0.9, "worst": 0.85},
    "false_alarms_per_hour": {"asked": 2.0, "value": 2.0, "low": 0.3, "high": 5.6},
    "minutes_left_out": 11.1,
    "minutes_missing": 78.9,
    "parts": 2,
    "alarmed": 1,
}
FOUND = {
    "another_day": DAY,
    "flights": [
        {"name": "one", "samples": 250, "of": 300, "notes": ["a remark", "another"]},
        {"name": "two", "samples": 30, "of": 300, "notes": []},
    ],
    "tests": [
        {"left_out": "one", "samples": 0},
        {"left_out": "two", "samples": 9, "explained": {"p": 0.91, "q": 0.92, "r": 0.93}},
        {
            "left_out": "three", "samples": 9, "explained": {"p": 0.81, "q": 0.82, "r": 0.83},
            "score": {
                "settings": [[1.0], [0.5]], "classes": 0.98, "healthy_or_faulty": 0.97, "side": 0.96,
                "mean_error": 0.012,
            },
        },
    ],
    "collinear": [
        {"regressor": "p[-1]", "inflation": 23.4}, {"regressor": "q[-1]", "inflation": 11.4},
    ],
    "colour": {"p": 1.1, "q": 1.2, "r": 1.3},
    "output_error": {"windows": 3, "says": "too few"},
}  # fmt: skip
RUN = {
    "servo_lag_s": 0.123, "servo_lag_sd_s": 0.004, "delay_s": 0.05, "delay_sd_s": 0.02,
    "shorter_than_can_be_told": False, "explained_of_windows_not_fitted": {"p": 0.7, "q": 0.6, "r": 0.5},
}  # fmt: skip


def test_an_account_in_lines(changed):
    cases = {
        "much": (small.TAIL, FOUND | {"output_error": RUN}),
        "short": (small.WING, FOUND | {"output_error": RUN | {"shorter_than_can_be_told": True}}),
        "little": (small.WING, FOUND | {"collinear": [], "tests": [], "flights": FOUND["flights"][1:]}),
        "made up": (
            small.WING,
            FOUND | {"collinear": [{"regressor": "still[-1]", "inflation": None}], "tests": []},
        ),
        "one": (small.WING, FOUND | {"collinear": FOUND["collinear"][1:], "tests": []}),
    }
    assert not changed(
        {
            name: identification_text(small.model(of, identified=found)).splitlines()
            for name, (of, found) in cases.items()
        }
    )


def test_names_of_the_regressors():
    assert regressor_names(small.model(small.TAIL)) == [
        "p[-1]", "q[-1]", "r[-1]", "p[-2]", "q[-2]", "r[-2]", "airspeed_m_s[-1]",
        *(f"command of left_aileron+right_aileron[-{k}]" for k in (1, 2, 3)),
        *(f"command of elevator[-{k}]" for k in (1, 2, 3)),
    ]  # fmt: skip


def test_collinear_is_more_than_tenfold_worst_first(monkeypatch):
    factors = np.array([10.0, 10.1, 1.0, 40.0, np.inf, *[2.0] * 7])
    monkeypatch.setattr(identification, "variance_inflation", lambda x: factors)
    found = identification.collinear_names(fitting.fit_parts([small.flight(MODEL, 200)]), MODEL)
    assert [(one["regressor"], one["inflation"]) for one in found] == [
        ("q[-2]", None), ("p[-2]", 40.0), ("q[-1]", 10.1),
    ]  # fmt: skip


def test_a_signal_that_stands_still_is_told_and_can_be_written():
    """As a document, whose numbers are finite, in words and on the page."""
    model = small.model(small.TAIL)
    samples = small.flight(model, 300)
    samples.signals[:] = 20.0
    usable_flights = fitting.fit_parts([samples])
    found = identification.collinear_names(usable_flights, model)
    assert found[0] == {"regressor": "airspeed_m_s[-1]", "inflation": None}
    assert json.loads(as_json(found)) == found
    told = model.model_copy(update={"identification_results": FOUND | {"collinear": found}})
    assert "most airspeed_m_s[-1] (made up by the others)" in identification_text(told)
    page = load_template("model.html.j2")
    said = {"mark": "", "used": 1, "coefficients": [], "fits": "", "spectrum": "", "correlation": ""}
    whole = FOUND | {"collinear": found, "spectrum": [], "tests": []}
    assert ">made up by the others</td>" in page.render(model=model, found=whole, **said)


def test_inflation_is_of_the_regressors_without_the_constant():
    usable_flights = fitting.fit_parts([small.flight(MODEL, 200)])
    x = fitting.stack_data(usable_flights, MODEL.vehicle, MODEL.n_rate_lags, MODEL.n_command_lags)[0]
    found = {
        one["regressor"]: one["inflation"] for one in identification.collinear_names(usable_flights, MODEL)
    }
    for i, name in enumerate(regressor_names(MODEL), 1):
        others = np.delete(x, i, axis=1)
        rest = x[:, i] - others @ np.linalg.lstsq(others, x[:, i], rcond=None)[0]
        factor = x[:, i].var() / rest.var()
        assert (name in found) == (factor > 10.0)
        assert found.get(name, factor) == pytest.approx(factor, rel=1e-6)
    assert found


def test_colour_is_the_median_over_the_responses():
    usable_flights = fitting.fit_parts([small.flight(MODEL, 300)])
    fit = fitting.fit_order(usable_flights, MODEL.vehicle, 2, 3)
    found = identification.median_inflation(usable_flights, MODEL)
    assert found == dict(zip("pqr", np.median(fit.standard_error_inflation[7:], axis=0), strict=True))


def test_a_spectrum_by_bands():
    """At 20 Hz, up to the 10 of its half: the band's mean density over that of white noise, of a residual
    that swings at 3 Hz."""
    model = small.model(rate_hz=20.0)
    samples = small.flight(model, 600)
    samples.rates[:, 1] += 0.5 * np.sin(2 * np.pi * 3.0 * samples.t_s)
    usable_flights = fitting.fit_parts([samples])
    bands = density_ratios(usable_flights, model)
    ends = [(band["from_hz"], band["to_hz"]) for band in bands]
    assert ends == [(0.0, 0.1), (0.1, 0.5), (0.5, 1.0), (1.0, 2.0), (2.0, 5.0), (5.0, 10.0)]
    from scipy import signal

    residual = fitting.one_step_residual(model, usable_flights[0])[1]
    frequency, density = signal.welch(residual, fs=20.0, nperseg=256, axis=0)
    for (low, high), band in zip(ends, bands, strict=True):
        inside = (frequency > low) & (frequency <= high)
        for axis, name in enumerate("pqr"):
            white = residual[:, axis].var() / 10.0
            assert band[name] == pytest.approx(density[inside, axis].mean() / white)
    assert max(bands, key=lambda band: band["q"])["from_hz"] == 2.0
    low = density_ratios(fitting.fit_parts([small.flight(MODEL, 300)]), MODEL)
    assert [band["to_hz"] for band in low] == [0.1, 0.5, 1.0, 2.0, 5.0]


def lagged(n=1200, lag_s=0.1, delay_s=0.13, seed=4, noise=0.002):
    """A flight whose rates answer commands late, through a servo; at 10 Hz, from its equations."""
    rng = np.random.default_rng(seed)
    samples = small.flight(MODEL, n, seed=seed)
    keep, share = np.exp(-0.1 / lag_s), delay_s / 0.1 % 1.0
    whole = int(delay_s / 0.1)
    a, b = np.diag([0.6, 0.7, 0.8]), np.array([[0.3, 0.1, 0.02], [0.2, -0.15, 0.04]])
    rates, servo = np.zeros((n, 3)), samples.commands[0].copy()
    for k in range(n - 1):
        rates[k + 1] = rates[k] @ a.T + servo @ b + 0.01
        late = [max(k - whole - i, 0) for i in (0, 1)]
        command = (1 - share) * samples.commands[late[0]] + share * samples.commands[late[1]]
        servo = keep * servo + (1 - keep) * command
    return Samples(**(vars(samples) | {"rates": rates + noise * rng.standard_normal((n, 3))}))


def test_servo_lag_and_delay_are_found(changed):
    found = fit_output_error(fitting.fit_parts([lagged()]), [[0], [1]])
    assert found["servo_lag_s"] == pytest.approx(0.1, abs=0.02)
    assert found["delay_s"] == pytest.approx(0.13, abs=0.02)
    assert min(found["explained_of_windows_not_fitted"].values()) > 0.98
    assert found["shorter_than_can_be_told"] is False
    for what in ("servo_lag", "delay"):
        assert 0.0 < found[f"{what}_sd_s"] < 0.02
    assert not changed(
        {key: value if isinstance(value, int) else _short(value) for key, value in found.items()}
    )


def _short(value):
    return {k: _short(v) for k, v in value.items()} if isinstance(value, dict) else round(float(value), 5)


def test_a_servo_faster_than_the_rate_tells_is_said():
    found = fit_output_error(fitting.fit_parts([lagged(700, lag_s=5e-3, delay_s=0.2)]), [[0], [1]])
    assert found["shorter_than_can_be_told"] is True


@pytest.mark.parametrize(("lag_s", "short"), [(0.0099, True), (0.01, False), (0.019, False)])
def test_what_is_told_of_a_fit(monkeypatch, lag_s, short):
    """Of a fit that is given here: its errors are those of least squares, what it explains is told of every
    other window."""
    rng = np.random.default_rng(1)
    jac, fun, given = rng.standard_normal((1000, 20)), rng.standard_normal(1000), {}
    x = np.concatenate([[lag_s, 0.13], (0.7 * np.eye(3)).ravel(), *small.RESPONSE[:, 1], [0.0] * 3])

    def fitted(residual, start, **how):
        given.update(how, start=start, first=residual(x, *how["args"]))
        return SimpleNamespace(x=x, jac=jac, fun=fun)

    monkeypatch.setattr("scipy.optimize.least_squares", fitted)
    usable_flights = fitting.fit_parts([lagged(600)])
    found = fit_output_error(usable_flights, [[0], [1]])
    assert found["shorter_than_can_be_told"] is short
    errors = np.sqrt(np.diag(np.linalg.inv(jac.T @ jac)) * (fun @ fun) / 1000)
    assert [found["servo_lag_sd_s"], found["delay_sd_s"]] == pytest.approx(errors[:2])
    assert (found["servo_lag_s"], found["delay_s"]) == (lag_s, 0.13)
    commands, rates = identification._cut_windows(usable_flights, [[0], [1]], 20, 7)
    run = identification._simulate(x, commands, rates, 0.1)
    np.testing.assert_allclose(
        given["first"], ((run - rates) / rates.std(axis=(0, 1)))[::2].ravel(), rtol=1e-6
    )
    for axis, name in enumerate("pqr"):
        left, of = (run - rates)[1::2, :, axis], rates[1::2, :, axis]
        share = 1.0 - left.var() / of.var()
        assert found["explained_of_windows_not_fitted"][name] == pytest.approx(share)
    assert (given["loss"], given["max_nfev"]) == ("soft_l1", 40)
    start, low, high = identification._guess_and_bounds(2, 0.1)
    np.testing.assert_array_equal(given["start"], start)
    np.testing.assert_array_equal(given["bounds"], (low, high))


def test_too_few_windows_are_said():
    """Of 2 s, after 0.7 s of the past: 20 want 407 samples; windows that end with the log are not taken."""
    says = "too few gap-free windows in which every rate moves"
    samples = lagged(407, noise=0.01)
    found = fit_output_error([FitPart(samples, np.ones(407, dtype=bool))], [[0], [1]])
    assert found == {"windows": 19, "says": says}
    samples = lagged(408, noise=0.01)
    assert "delay_s" in fit_output_error([FitPart(samples, np.ones(408, dtype=bool))], [[0], [1]])
    samples.rates[:, 1] = 0.01
    still = fit_output_error([FitPart(samples, np.ones(408, dtype=bool))], [[0], [1]])
    assert still == {"windows": 20, "says": says}


def test_windows_with_their_past():
    """Three samples after two; none over a gap, a lost sample, or what is not known; commands as effective
    as the labels say."""
    n = 40
    commands = np.arange(2.0 * n).reshape(n, 2)
    rates = np.arange(3.0 * n).reshape(n, 3)
    labels = np.full((n, 2), np.nan)
    labels[:, 1] = 0.5
    run = np.where(np.arange(n) < 14, 0, 1)
    given = {"commands": commands, "rates": rates, "labels": labels, "stretch_number": run}
    samples = Samples(**(vars(small.flight(MODEL, n)) | given))
    use = np.ones(n, dtype=bool)
    use[22] = False
    rates[29, 1] = np.nan
    commands[35, 0] = np.nan
    found, measured = identification._cut_windows([FitPart(samples, use)], [[0], [1]], 3, 2)
    scaled = commands * [1.0, 0.5]
    lost = {
        *range(14, 18),
        *range(22, 27),
        *range(29, 34),
        *range(35, 40),
    }  # last samples of what is not whole
    ends = [end for end in range(5, n, 3) if end - 1 not in lost]
    np.testing.assert_array_equal(found, [scaled[end - 5 : end] for end in ends])
    np.testing.assert_array_equal(measured, [rates[end - 3 : end] for end in ends])
    together, _ = identification._cut_windows([FitPart(samples, use)], [[0, 1]], 3, 2)
    np.testing.assert_array_equal(together[:, :, 0], found.sum(axis=2))


@pytest.mark.parametrize(("n", "kept_of"), [(1601, 1), (1603, 2), (2404, 3)])
def test_of_many_windows_every_so_many_is_kept(n, kept_of):
    samples = small.flight(MODEL, n)
    commands, rates = identification._cut_windows(
        [FitPart(samples, np.ones(n, dtype=bool))], [[0], [1]], 2, 1
    )
    every = range(3, n, 2)
    np.testing.assert_array_equal(rates, [samples.rates[end - 2 : end] for end in every][::kept_of])
    assert len(commands) == len(rates)


def test_where_the_fit_begins_and_what_it_may_say():
    start, low, high = identification._guess_and_bounds(2, 0.05)
    assert start.tolist() == [
        0.1, 0.05, 0.7, 0, 0, 0, 0.7, 0, 0, 0, 0.7, *[0.01] * 6, 0, 0, 0,
    ]  # fmt: skip
    assert (low[:2].tolist(), high[:2].tolist()) == ([0.005, 0.0], [1.0, 0.6])
    assert (low[2:] == -np.inf).all()
    assert (high[2:] == np.inf).all()
    assert len(start) == len(low) == len(high) == 20


@pytest.mark.parametrize("delay_s", [0.0, 0.04, 0.1, 0.17, 0.35])
def test_a_free_run_is_the_equation_sample_by_sample(delay_s):
    """One window at a time, with commands interpolated in time."""
    rng = np.random.default_rng(5)
    commands, rates = rng.standard_normal((3, 9, 2)), rng.standard_normal((3, 5, 3))
    a, b, c = 0.4 * rng.standard_normal((3, 3)), rng.standard_normal((2, 3)), rng.standard_normal(3)
    parameters = np.concatenate([[0.08, delay_s], a.ravel(), b.ravel(), c])
    found = identification._simulate(parameters, commands, rates, 0.1)
    keep = np.exp(-0.1 / 0.08)
    for w in range(3):
        servo, x, expected = commands[w, 0], rates[w, 0], []
        for k in range(9):
            if k >= 4:
                expected.append(x)
                x = a @ x + b.T @ servo + c
            at = np.clip(k - delay_s / 0.1, 0, 8)
            command = [np.interp(at, np.arange(9), commands[w, :, g]) for g in (0, 1)]
            servo = keep * servo + (1 - keep) * np.array(command)
        np.testing.assert_allclose(found[w], expected, atol=1e-12)


def test_a_flight_without_a_healthy_sample_is_refused_by_its_name():
    model = small.model()
    lost = small.flight(model, 100, name="lost", rates=np.full((100, 3), np.nan))
    with pytest.raises(
        BadInput, match=r"^identify: lost: 0 samples known to be healthy, allowed: at least 2$"
    ):
        identification._choose_ma(lost, model.vehicle, (4, 4))


def test_the_remarks_on_the_rates_of_every_flight_are_in_the_error():
    notes = ("q_rad_s: in deg/s", "roll: of no use"), (), ("r_rad_s: late", "p_rad_s: late", "q_rad_s2: odd")
    flights = [SimpleNamespace(samples=SimpleNamespace(notes=of)) for of in notes]
    said = identification._mistakes_text(flights, MODEL)
    assert said == "; q_rad_s: in deg/s; r_rad_s: late; p_rad_s: late"


def scored(left_out, *values):
    return {"left_out": left_out, "samples": 9, "score": dict(zip(SCORES, values, strict=True))}


SCORES = ("classes", "healthy_or_faulty", "mean_error", "held_by_bounds", "side")
FOLDS = [
    scored("one", 0.9, 0.7, 0.05, 0.95, 0.1), {"left_out": "two", "samples": 0},
    scored("three", 0.6, 0.8, 0.01, 0.85, 0.2), scored("four", 0.75, 0.3, 0.03, 0.9, 0.3),
]  # fmt: skip


def test_what_is_to_be_expected_of_another_day_is_mean_and_worst_of_what_was_left_out(monkeypatch):
    """The worst is the least, of the error the most; alarms are counted where there is a tail and a
    threshold, by the rate that was asked for, none where none was; what a fit said of it comes along."""
    expected = {
        "classes": {"mean": pytest.approx(0.75), "worst": 0.6},
        "healthy_or_faulty": {"mean": pytest.approx(0.6), "worst": 0.3},
        "mean_error": {"mean": pytest.approx(0.03), "worst": 0.05},
        "held_by_bounds": {"mean": pytest.approx(0.9), "worst": 0.85},
    }
    assert identification.expect_another_day(FOLDS, MODEL) == expected
    assert identification.expect_another_day(FOLDS[1:2], MODEL) == {}
    tail = SimpleNamespace(healthy_minutes=11.5)
    monkeypatch.setattr(
        identification.extremes, "false_alarm_rate",
        lambda of, threshold: identification.extremes.FalseAlarmRate(
            threshold * of.healthy_minutes, 0.25, 6.5
        ),
    )  # fmt: skip
    monkeypatch.setattr(
        identification.extremes, "missing_healthy_minutes", lambda of, rate: 100.0 * rate + of.healthy_minutes
    )
    for rate, asked in ((3.0, 3.0), (None, 0.0)):
        settings = SimpleNamespace(alarm_threshold=2.0, false_alarms_per_hour=rate)
        model = SimpleNamespace(
            fitted_ranges=SimpleNamespace(alarm_peak_tail=tail), settings=settings,
            identification_results={"parts": 7, "alarmed": 2},
        )  # fmt: skip
        found = identification.expect_another_day(FOLDS, model)
        assert found == expected | {
            "false_alarms_per_hour": {"asked": asked, "value": 23.0, "low": 0.25, "high": 6.5},
            "minutes_left_out": 11.5, "minutes_missing": 100.0 * asked + 11.5, "parts": 7, "alarmed": 2,
        }  # fmt: skip
        for what in ("threshold", "tail", "ranges"):
            lacking = SimpleNamespace(**vars(model))
            if what == "threshold":
                lacking.settings = SimpleNamespace(alarm_threshold=None, false_alarms_per_hour=rate)
            else:
                lacking.fitted_ranges = SimpleNamespace(alarm_peak_tail=None) if what == "tail" else None
            assert identification.expect_another_day(FOLDS, lacking) == expected


def test_each_further_flight_has_its_commands_compared_with_those_of_the_first(monkeypatch):
    flights = [small.flight(MODEL, 80, seed=seed, name=f"flight {seed}") for seed in (1, 2, 3)]
    asked = []
    monkeypatch.setattr(identification.trust, "refuse_command_unit", lambda *these: asked.append(these))
    monkeypatch.setattr(identification.trust, "central_ranges", lambda values: values[:2].tolist())
    identification._check_units(flights, MODEL.vehicle)
    assert [name for name, *_ in asked] == ["flight 2", "flight 3"]
    for (_, commands, rates, ranges, surfaces), flight in zip(asked, flights[1:], strict=True):
        assert (commands is flight.commands, rates is flight.rates) == (True, True)
        assert ranges.command_ranges == flights[0].commands[:2].tolist()
        assert ranges.rate_ranges_rad_s == flights[0].rates[:2].tolist()
        assert surfaces == ["right", "left"]


def by_table(monkeypatch, criteria):
    """Criteria by the reference airspeed, and by the powers of right and left, instead of fits."""
    asked = []

    def least(flights, vehicle):
        if vehicle.reference_airspeed_mps is None:
            key = "plain"
        else:
            powers = tuple(vehicle.airspeed_powers.get(name, 2.0) for name in ("right", "left"))
            expected = (flights[0].airspeed[0] / vehicle.reference_airspeed_mps) ** np.array(powers)
            if not vehicle.moving_air:  # commands are scaled by what is tried
                np.testing.assert_allclose(flights[0].commands[0], FLOWN.commands[0] * expected)
            key = powers
        asked.append(key)
        return criteria[key]

    monkeypatch.setattr(identification, "_min_bic", least)
    return asked


FLOWN = replace(small.flight(MODEL, 60), airspeed=np.linspace(15.0, 25.0, 60))
SPEEDY = MODEL.vehicle.model_copy(update={"airspeed": "V"})


@pytest.mark.parametrize(("scaled", "taken"), [(90.0, True), (90.1, False), (110.0, False)])
def test_commands_are_scaled_where_that_explains_decisively_more(monkeypatch, scaled, taken):
    """By ten at least of the criterion; of a vehicle that leaves laws and air open they stay open."""
    asked = by_table(monkeypatch, {"plain": 100.0, (2.0, 2.0): scaled})
    (found,), vehicle = scale_if_better([FLOWN], SPEEDY)
    assert asked == ["plain", (2.0, 2.0)]
    assert vehicle.reference_airspeed_mps == (20.0 if taken else None)
    assert (vehicle.other_laws, vehicle.moving_air, vehicle.airspeed_powers) == (None, None, {})
    ratio = (FLOWN.airspeed / 20.0)[:, None] ** 2 if taken else 1.0
    np.testing.assert_allclose(found.commands, FLOWN.commands * ratio)


@pytest.mark.parametrize(("of_right", "of_left", "powers"), [
    ((45.0, 39.9, 39.8), (30.0, 39.9, 29.0), {"right": 3.0, "left": 3.0}),
    ((20.0, 25.0, 20.0), (20.5, 19.0, 19.5), {"right": 0.0, "left": 1.0}),
    ((40.0, 40.1, 60.0), (39.0, 40.0, 41.0), {"left": 0.0}),
    ((41.0, 42.0, 43.0), (44.0, 45.0, 46.0), {}),
])  # fmt: skip
def test_the_power_of_each_surface_is_the_best_of_those_that_are_decisively_better(
    monkeypatch, of_right, of_left, powers
):
    """Than the square, whose criterion is 50: of the powers 0, 1 and 3, the right surface first."""
    right = powers.get("right", 2.0)
    criteria = {(power, 2.0): of for power, of in zip((0.0, 1.0, 3.0), of_right, strict=True)}
    criteria |= {(right, power): of for power, of in zip((0.0, 1.0, 3.0), of_left, strict=True)}
    asked = by_table(monkeypatch, {"plain": 100.0, (2.0, 2.0): 50.0} | criteria)
    told = SPEEDY.model_copy(update={"other_laws": True, "moving_air": False})
    (found,), vehicle = scale_if_better([FLOWN], told)
    assert vehicle.airspeed_powers == powers
    assert asked == ["plain", (2.0, 2.0), (2.0, 2.0), *criteria]
    by = np.array([powers.get(name, 2.0) for name in ("right", "left")])
    np.testing.assert_allclose(found.commands, FLOWN.commands * (FLOWN.airspeed / 20.0)[:, None] ** by)
    assert (vehicle.other_laws, vehicle.moving_air, vehicle.reference_airspeed_mps) == (True, False, 20.0)


def test_in_moving_air_powers_are_compared_in_white_and_given_back_as_they_are(monkeypatch):
    """By the colour and the weight of each flight as it is with the square."""
    colours = {"a": ((1.0, 0.5), 1.5), "b": ((1.0, -0.8, 0.16), 0.75)}
    flights = [replace(FLOWN, name=name) for name in colours]
    monkeypatch.setattr(
        identification, "whiten_flights",
        lambda these, vehicle: [identification.whiten_samples(one, *colours[one.name]) for one in these],
    )  # fmt: skip
    seen = []

    def least(these, vehicle):
        seen.append([(one.noise_ma_coefficients, one.fit_weight) for one in these])
        return 100.0 if vehicle.reference_airspeed_mps is None else 50.0

    monkeypatch.setattr(identification, "_min_bic", least)
    told = SPEEDY.model_copy(update={"other_laws": True, "moving_air": True})
    found, vehicle = scale_if_better(flights, told)
    assert seen == [[((), 1.0)] * 2] * 2 + [[*colours.values()]] * 7
    assert (vehicle.airspeed_powers, [one.noise_ma_coefficients for one in found]) == ({}, [(), ()])
    np.testing.assert_allclose(found[1].commands, FLOWN.commands * (FLOWN.airspeed / 20.0)[:, None] ** 2)


def test_what_an_identification_is_of_goes_through_its_steps_in_order(monkeypatch):
    """Whitened flights are fitted, then checked, then measured for ranges; all that is said is of them."""
    its, flights = MODEL.vehicle.model_copy(update={"other_laws": True}), [FLOWN]
    steps, usable = [], [SimpleNamespace(samples=FLOWN, is_usable=np.arange(60) % 3 > 0)]

    def step(name, answer):
        def said(*these):
            steps.append((name, *these))
            return answer

        return said

    fitted, ranged = MODEL.model_copy(update={"rate_hz": 11.0}), MODEL.model_copy(update={"rate_hz": 12.0})
    heard = MODEL.model_copy(update={"rate_hz": 13.0, "identification_results": {"parts": 2}})
    monkeypatch.setattr(identification, "_check_units", step("units", None))
    monkeypatch.setattr(identification, "whiten_flights", step("white", ["white"]))
    monkeypatch.setattr(fitting, "fit_parts", step("usable", usable))
    monkeypatch.setattr(fitting, "fit_model", step("fit", fitted))
    monkeypatch.setattr(fitting, "fold_qualities", step("quality", ["quality"]))
    monkeypatch.setattr(identification, "check_explained", step("explained", None))
    monkeypatch.setattr(fitting, "add_ranges_and_threshold", step("ranges", ranged))
    monkeypatch.setattr(identification, "add_unseen_noise", step("unseen", heard))
    monkeypatch.setattr(fitting, "score_folds", step("folds", (["fold"], 0.875)))
    told = {
        "another_day": "expect_another_day", "collinear": "collinear_names",
        "colour": "median_inflation", "spectrum": "density_ratios",
        "output_error": "fit_output_error",
    }  # fmt: skip
    for key, function in told.items():
        monkeypatch.setattr(identification, function, step(key, f"said of {key}"))
    found = identify(flights, its)
    known = its.model_copy(update={"moving_air": False})
    assert steps == [
        ("units", flights, known), ("white", flights, known), ("usable", ["white"]), ("fit", usable, known),
        ("quality", usable, fitted), ("explained", ["quality"], usable, fitted), ("ranges", usable, fitted),
        ("unseen", ranged, flights), ("folds", usable, heard), ("another_day", ["fold"], heard),
        ("collinear", usable, heard), ("colour", usable, heard), ("spectrum", usable, heard),
        ("output_error", usable, [[0], [1]]),
    ]  # fmt: skip
    assert (found.rate_hz, found.settings.credible_mass) == (13.0, 0.875)
    assert found.settings == heard.settings.model_copy(update={"credible_mass": 0.875})
    assert found.identification_results == {
        "assumed": [
            "other_laws: true, as the vehicle file says",
            "moving_air: false, as fitted (labels show faults under it)",
            "reference_airspeed_mps: none, the airspeed explains no more",
        ],
        "flights": [{"name": "small", "samples": 40, "of": 60, "notes": []}], "tests": ["fold"],
        **{key: f"said of {key}" for key in told},
    }  # fmt: skip
