"""Where a model was measured, in words; the standard atmosphere by its published table."""

import re

import pytest

from beaver_ftc.design.atmosphere import altitude_of, standard_density
from beaver_ftc.scenario.measured_range import (
    ALTITUDE,
    BETWEEN,
    LATE,
    lies_outside,
    outside,
)
from beaver_ftc.scenario.schema import Scenario

# Density by altitude [ISA], m and kg/m3.
TABLE = [(0, 1.225), (1000, 1.1116), (2000, 1.0065), (5000, 0.73612), (11000, 0.36392), (15000, 0.19367)]


@pytest.mark.parametrize(("altitude_m", "density"), TABLE)
def test_density_and_altitude_are_the_tables(altitude_m, density):
    assert standard_density(altitude_m) == pytest.approx(density, rel=2e-4)
    assert altitude_of(density) == pytest.approx(altitude_m, abs=3.0)


def test_what_lies_outside():
    spans = {"a": (1.0, 2.0), "b": (-3.0, -1.0)}
    assert lies_outside({"a": 2.5, "b": -1.0, "c": 9.0}, spans) == ["a"]
    assert lies_outside({"a": 1.0, "b": 0.0}, spans) == ["b"]


@pytest.mark.parametrize(
    ("quantity", "measured", "says"),
    [
        (ALTITUDE, (871.0, 2104.0), "outside the altitudes at which this model was measured: 870 to 2,100 m"),
        ("airspeed_mps", (93.23, 145.7), "outside the airspeeds .*: 93.23 to 145.7 m/s"),
        ("alpha_rad", (0.05, 0.25), "outside the angles of attack .*: 2.86 to 14.3 deg"),
        ("r_rad_s", (-0.35, 0.35), "outside the yaw rates .*: -20.1 to 20.1 deg/s"),
        ("dpt", (0.1, 0.45), "outside the values of dpt .*: 0.1 to 0.45"),
        (LATE, (0.0, 7200.0), "later than this model was measured: after 7,200 s of flight"),
        (BETWEEN, None, "in a combination of speeds, angles and rates at which this model was not measured"),
    ],
)
def test_why_nothing_can_be_concluded(quantity, measured, says):
    assert re.fullmatch(says, outside(quantity, measured))


def test_an_expectation_that_no_diagnosis_can_meet_is_warned_of():
    fault = {"type": "stuck", "actuator": "elevator", "at_s": 3}
    text = {
        "name": "x",
        "faults": [fault],
        "fdi": {"scheme": "none"},
        "expect": {"detected_within_s": 1, "no_departure": True},
    }
    assert [line for line in Scenario.model_validate(text).warnings() if "expect" in line] == [
        "expect.detected_within_s: cannot be met, fdi.scheme is none: no diagnosis runs"
    ]
    assert not [w for w in Scenario.model_validate(text | {"fdi": {}}).warnings() if "expect" in w]
