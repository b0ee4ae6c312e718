"""Where a model was measured, in words; the standard atmosphere by its published table."""

import re

import pytest

from beaver_ftc.design import altitude_of, standard_density
from beaver_ftc.scenario.declared import (
    ALTITUDE,
    BETWEEN,
    LATE,
    in_words,
    lies_outside,
    measured_spans,
    outside,
    percent,
    quantities,
)
from beaver_ftc.scenario.schema import Scenario
from trainer import trainer

# Density by altitude [ISA], m and kg/m3.
TABLE = [(0, 1.225), (1000, 1.1116), (2000, 1.0065), (5000, 0.73612), (11000, 0.36392), (15000, 0.19367)]


@pytest.mark.parametrize(("altitude_m", "density"), TABLE)
def test_density_and_altitude_are_the_tables(altitude_m, density):
    assert standard_density(altitude_m) == pytest.approx(density, rel=2e-4)
    assert altitude_of(density) == pytest.approx(altitude_m, abs=3.0)


def box(**ends):
    """A box of the trainer's map."""
    errors = {f"error_{axis}_rad_s2": [[0.01, 0.02], [0.03, 0.04]] for axis in "pqr"}
    flow = {
        "p_rad_s": [-0.3, 0.2], "q_rad_s": [-0.1, 0.15], "r_rad_s": [-0.25, 0.35], "alpha_rad": [0.02, 0.21],
        "beta_rad": [-0.12, 0.11], "airspeed_mps": [20.0, 31.5], "density_kg_m3": [0.99, 1.11],
    }  # fmt: skip
    return flow | errors | ends


@pytest.fixture(scope="module")
def mapped():
    signals = trainer().signals
    boxes = [
        box(signals={name: [0.1, 0.4] for name in signals}),
        box(
            airspeed_mps=[22.0, 37.0],
            density_kg_m3=[0.90912, 1.05],
            signals={name: [0.0, 0.3] for name in signals},
        ),
    ]
    return trainer(model_error_map={"travel_share": [0.5, 1.0], "until_s": [120, 900], "boxes": boxes})


def test_what_was_measured_is_what_all_boxes_span(mapped):
    spans = measured_spans(mapped)
    assert list(spans) == [*quantities(mapped), LATE]
    assert spans["airspeed_mps"] == (20.0, 37.0)
    assert spans[ALTITUDE] == pytest.approx((1015.0, 3000.0), abs=15.0)  # densities 1.11 and 0.90912
    assert spans[LATE] == (0.0, 900.0)
    assert measured_spans(trainer()) == {}


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


def test_the_share_of_frames_and_each_reason_are_said():
    altitude = {
        "quantity": ALTITUDE,
        "share": 0.5,
        "measured": [100, 3100],
        "flown": [3105.0, 3240.0],
        "says": "A",
    }
    late = {"quantity": LATE, "share": 0.125, "measured": [0, 900], "flown": [900.0, 950.0], "says": "B"}
    whole = {"share": 0.5, "from_s": 12.5, "reasons": [altitude, late]}
    assert in_words(whole) == (
        "nothing can be concluded in 50 % of the frames from 12.50 s on: A, flown 3,100 to 3,240 m; "
        "B, flown 900 to 950 s (12 %)"
    )
    always = {"share": 1.0, "from_s": 0.0, "reasons": [altitude | {"share": 1.0, "flown": None}]}
    assert in_words(always) == "nothing can be concluded in 100 % of the frames: A"


@pytest.mark.parametrize(
    ("share", "says"),
    [(0.0, "0 %"), (0.0012, "0.12 %"), (0.47, "47 %"), (0.999, "more than 99 %"), (1.0, "100 %")],
)
def test_only_all_frames_are_100_per_cent(share, says):
    assert percent(share) == says


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
