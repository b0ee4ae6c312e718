"""Outputs to deflections: signs, stops, mixes and what no pulse means."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from beaver_ftc.aircraft import load
from beaver_ftc.aircraft.schema import OutputSection
from beaver_ftc.documents.errors import BadInput
from beaver_ftc_links.sitl.outputs import Outputs, power_range, share_of_pulse
from trainer import trainer

BEAVER = load()
# aileron left, elevator down, rudder left, flap up: as the Beaver's signs are [SPEC 1]
G = np.array([[-6.5, 0.0, 0.5, 0.0], [0.0, -10.0, 0.0, 2.0], [0.3, 0.0, -2.5, 0.0]])
TRIM = np.array([0.01, -0.05, -0.02, 0.3])
TRAVEL = np.array([[-0.52, -0.49, -0.44, -0.1], [0.52, 0.49, 0.44, 1.03]])


def outputs(aircraft=BEAVER, pulses=True, G=G):
    return Outputs(aircraft, G, TRIM[: aircraft.n], TRAVEL[:, : aircraft.n], pulses)


def test_more_output_rolls_right_pitches_up_and_yaws_right():
    """Full pulses on the usual channels, on an aircraft whose file says nothing of them."""
    given_us = [2000, 2000, 1500, 2000] + [0] * 12
    full = outputs().deflections(given_us)
    assert np.allclose(full, [-0.52, -0.49, -0.44, 0.3])
    p, q, r = G @ (full - [0, 0, 0, 0.3])
    assert min(p, q, r) > 0
    assert np.allclose(outputs().deflections([1000, 1000, 1500, 1000]), [0.52, 0.49, 0.44, 0.3])


def test_no_pulse_leaves_the_trim_and_the_engine():
    assert np.array_equal(outputs().deflections([0] * 16), TRIM)
    assert np.array_equal(outputs().deflections([]), TRIM)
    assert outputs().power([0] * 16) is None


def test_the_throttle_goes_from_end_to_end_of_the_lever():
    low, high = power_range(BEAVER)
    assert (low, high) == (10.0, 36.5)
    settings = [outputs().power([1500, 1500, pulse, 1500]) for pulse in (1000, 1500, 2000, 2400)]
    assert settings == pytest.approx([10.0, 23.25, 36.5, 36.5])
    assert outputs(pulses=False).power([0, 0, 0.25, 0]) == pytest.approx(10.0 + 0.25 * 26.5)


ELEVONS = {
    "surfaces": {
        "aileron": [{"channel": 1, "share": 0.5}, {"channel": 2, "share": -0.5}],
        "elevator": [{"channel": 1, "share": 0.5}, {"channel": 2, "share": 0.5}],
    },
    "throttle": {"channel": 3, "reversed": True},
}


@given(left=st.floats(1000, 2000), right=st.floats(1000, 2000))
def test_elevons_are_half_the_sum_and_half_the_difference(left, right):
    aircraft = trainer(channels=ELEVONS)
    mixed = Outputs(aircraft, np.zeros((3, aircraft.n)), *_flat(aircraft), pulses=True)
    places = [aircraft.surfaces.index(name) for name in ("aileron", "elevator")]
    roll, pitch = mixed.deflections([left, right, 0])[places] / 0.4
    one, other = (left - 1500) / 500, (right - 1500) / 500
    assert roll == pytest.approx((one - other) / 2, abs=1e-12)
    assert pitch == pytest.approx((one + other) / 2, abs=1e-12)


def _flat(aircraft):
    return np.zeros(aircraft.n), np.array([[-0.4] * aircraft.n, [0.4] * aircraft.n])


def test_a_reversed_throttle_is_closed_by_a_long_pulse():
    aircraft = trainer(channels=ELEVONS)
    low, high = power_range(aircraft)
    settings = [
        Outputs(aircraft, np.zeros((3, aircraft.n)), *_flat(aircraft), pulses=True).power([0, 0, pulse])
        for pulse in (1000, 2000)
    ]
    assert settings == [high, low]


@given(
    pulse=st.floats(501, 2499), trim=st.floats(1001, 1999), low=st.floats(900, 1000), reverse=st.booleans()
)
def test_a_pulse_is_a_share_that_rises_from_end_to_end(pulse, trim, low, reverse):
    output = OutputSection(channel=1, pwm_us=(low, 2000.0), reversed=reverse)
    sign = -1.0 if reverse else 1.0
    share = sign * share_of_pulse(output, pulse, trim)
    assert -1.0 <= share <= 1.0
    assert share <= sign * share_of_pulse(output, pulse + 10.0, trim) + 1e-12
    assert [sign * share_of_pulse(output, end, trim) for end in (low, trim, 2000.0)] == [-1.0, 0.0, 1.0]


@given(values=st.lists(st.floats(allow_nan=True, allow_infinity=True), min_size=16, max_size=16))
def test_whatever_a_peer_says_stays_within_the_stops(values):
    deflections = outputs(pulses=False).deflections(values)
    assert np.array_equal(deflections, deflections.clip(*TRAVEL))
    assert 10.0 <= outputs(pulses=False).power(values) <= 36.5


def test_packets_that_have_too_few_outputs_are_refused():
    far = {"surfaces": {"elevator": [{"channel": 20}]}}
    aircraft = trainer(channels=far)
    mixed = Outputs(aircraft, np.zeros((3, aircraft.n)), *_flat(aircraft), pulses=True)
    mixed.check(32)
    with pytest.raises(BadInput, match="channels: 20 is asked for, allowed: 1 to 16 of these packets"):
        mixed.check(16)
