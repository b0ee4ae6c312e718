"""How an identification counts commands, finds a servo and runs freely: by equations of known flights."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from beaver_ftc.documents import BadInput
from beaver_ftc_logs import fitting, identification
from beaver_ftc_logs.identification import (
    fit_output_error,
    scale_if_better,
)
from beaver_ftc_logs.samples import Samples, scale_by_airspeed
from products.logs import small

MODEL = small.model()


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


def test_where_the_airspeed_is_unknown_commands_count_as_they_are():
    flight = replace(small.flight(MODEL, 100), airspeed=np.where(np.arange(100) < 50, np.nan, 10.0))
    found = scale_by_airspeed(flight, 20.0)
    assert found.commands[:50] == pytest.approx(flight.commands[:50])
    assert found.commands[50:] == pytest.approx(flight.commands[50:] / 4.0)
    stopped = scale_by_airspeed(replace(flight, airspeed=np.zeros(100)), 20.0)
    assert stopped.commands == pytest.approx(0.1 * flight.commands)
    assert (found.signals[:50] == 0.0).all()
    assert found.signals[50:] == pytest.approx(-0.5 * flight.rates[50:])


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
