"""Servos that are not as known: where their surfaces can be, and what that covers in flight."""

import pytest
from hypothesis import strategies as st

import beaver_ftc as bf

BOUND = {"bandwidth": 0.3, "rate_limit": 0.2, "dead_band_deg": 0.4}
OFF = {"slow": {"bandwidth": 0.8}, "fast": {"bandwidth": 1.2}, "dead band": {"dead_band_deg": 0.1},
       "low rate": {"rate_limit": 0.8}}  # fmt: skip
shares = st.floats(-1.0, 1.0)


PUBLISHED = bf.load("elevator-partial-loss").with_({"actuators": "servo", "expect": {}})
HEALTHY = PUBLISHED.with_({"faults": [], "duration_s": 12})


@pytest.mark.parametrize("off", OFF.values(), ids=OFF)
def test_a_servo_off_by_what_is_declared_raises_no_alarm_and_without_does(off):
    flown = HEALTHY.with_({"uncertainty.actuators": off})
    bound = {"bandwidth": 0.2, "rate_limit": 0.2, "dead_band_deg": 0.1}
    assert bf.fly(flown, log=False).false_alarm
    assert not bf.fly(flown.with_({"fdi.bounds.actuators": bound}), log=False).false_alarm


def test_a_loss_is_found_in_spite_of_them():
    errors = {"uncertainty.actuators": {"bandwidth": 0.8}, "fdi.bounds.actuators": {"bandwidth": 0.2}}
    flight = bf.fly(PUBLISHED.with_(errors), log=False)
    assert flight.isolation.correct
    assert flight.detection.delay_s <= 0.05
