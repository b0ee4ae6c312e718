"""Servos that are not as known: where their surfaces can be, and what that covers in flight."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import beaver_ftc as bf
from beaver_ftc.diagnosis import model_prediction
from beaver_ftc.scenario.declared import Declared
from beaver_ftc.scenario.schema import Scenario

BOUND = {"bandwidth": 0.3, "rate_limit": 0.2, "dead_band_deg": 0.4}
OFF = {"slow": {"bandwidth": 0.8}, "fast": {"bandwidth": 1.2}, "dead band": {"dead_band_deg": 0.1},
       "low rate": {"rate_limit": 0.8}}  # fmt: skip
shares = st.floats(-1.0, 1.0)


@settings(max_examples=60, deadline=None)
@given(
    servo=st.fixed_dictionaries({
        "bandwidth_rad_s": st.sampled_from([0.0, 5.0, 40.0]),
        "rate_limit_deg_s": st.sampled_from([0.0, 30.0]),
    }),
    off=st.tuples(shares, shares, st.floats(0.0, 1.0)),
    commands=st.lists(st.floats(-0.6, 0.6), min_size=2, max_size=40),
)  # fmt: skip
def test_every_servo_that_is_declared_stays_between_the_ends(servo, off, commands):
    """A servo with any error within its bound, from a start within its dead band, moved step by step."""
    said = {"name": "x", "rate_hz": 50, "actuators": servo, "fdi": {"bounds": {"actuators": BOUND}}}
    declared, stops = Declared.of(Scenario.model_validate(said)), np.array([[-0.4] * 4, [0.4] * 4])
    pred = np.zeros(1, model_prediction.prediction_dtype(4)).view(np.recarray)[0]
    model_prediction.configure_prediction(pred, declared, stops)
    w, r = (servo[key] * (1.0 + share * BOUND[name]) for key, share, name in zip(
        ("bandwidth_rad_s", "rate_limit_deg_s"), off[:2], ("bandwidth", "rate_limit"), strict=True
    ))  # fmt: skip
    band, step = np.radians(BOUND["dead_band_deg"]), np.radians(r) / 50.0 or np.inf
    pred["u_lo"], pred["u_hi"] = -band, band
    true, share = band * off[0], 1.0 - np.exp(-w / 50.0) if w else 1.0
    for command in commands:
        model_prediction.move_surfaces(pred, np.full(4, command))
        e = np.clip(command, -0.4, 0.4) - true
        e -= np.clip(e, -off[2] * band, off[2] * band)
        true += np.clip(share * e, -step, step)
        for position in (true, pred["u"]):
            assert (pred["u_lo"] - 1e-12 <= position).all()
            assert (position <= pred["u_hi"] + 1e-12).all()


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
