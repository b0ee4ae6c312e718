"""How an identification counts commands, finds a servo and runs freely: by equations of known flights."""

from dataclasses import replace

import numpy as np
import pytest

from beaver_ftc_logs.fit_parts import fit_parts
from beaver_ftc_logs.free_runs import fit_output_error
from beaver_ftc_logs.preparation import scale_if_better
from products.logs import small

MODEL = small.model()


def pressed(flight, powers=(2, 2)):
    """The flight as it would be at airspeeds of 15 to 25 m/s, if its commands stood at what they do."""
    speeds = 20.0 + 5.0 * np.sin(0.05 * np.arange(len(flight.t_s)) + 3)
    return replace(flight, airspeed=speeds, commands=flight.commands / (speeds[:, None] / 20.0) ** powers)


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


def test_each_group_takes_another_power_only_if_that_explains_decisively_more():
    """The left one has the power 2.55: the criterion of the power 3 is less than that of 2, but by 2 only."""
    vehicle = MODEL.vehicle.model_copy(update={"other_laws": True, "moving_air": False})
    flight = pressed(small.flight(MODEL, 1100), (1.0, 2.55))
    assert scale_if_better([flight], vehicle)[1].airspeed_powers == {"right": 1.0}


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
    return replace(samples, rates=rates + noise * rng.standard_normal((n, 3)))


def test_servo_lag_and_delay_are_found():
    found = fit_output_error(fit_parts([lagged()]), [[0], [1]])
    assert found["servo_lag_s"] == pytest.approx(0.1, abs=0.02)
    assert found["delay_s"] == pytest.approx(0.13, abs=0.02)
    assert min(found["explained_of_windows_not_fitted"].values()) > 0.98
    assert found["shorter_than_can_be_told"] is False
    for what in ("servo_lag", "delay"):
        assert 0.0 < found[f"{what}_sd_s"] < 0.02
