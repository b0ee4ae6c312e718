"""How an identification counts commands: by equations of known flights."""

from dataclasses import replace

import numpy as np
import pytest

from beaver_ftc_logs.identification import scale_if_better
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
