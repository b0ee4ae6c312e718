"""The published scheme in flight: its threshold by another road, its options, and what it must not do."""

from itertools import product

import numpy as np
import pytest

from beaver_ftc.loop.loop import fly
from beaver_ftc.scenario.schema import load_text
from flying import PUBLISHED_UNCERTAINTY, flown, loss, scenario

SCHEME = {"scheme": "zhang2005", "thresholds": "published"}


@pytest.mark.parametrize(("surface", "at_s"), [("aileron", 5.0), ("elevator", 4.0), ("rudder", 4.0)])
def test_the_class_is_detected_isolated_and_sized(surface, at_s):
    flight, log = flown(
        fdi=SCHEME, control={"law": "zhang2005"}, faults=[loss(surface, at_s=at_s)], duration_s=14.0
    )
    assert flight.detection_time_s - at_s <= 0.5
    assert flight.isolated == surface
    assert flight.estimate == pytest.approx(-0.4, abs=0.03)
    for axis in "pqr":  # the norm bound mu is symmetric
        np.testing.assert_array_equal(
            log[f"fie_{surface}_{axis}_lower_rad_s"], -log[f"fie_{surface}_{axis}_upper_rad_s"]
        )
    assert not log[f"fie_{surface}_excluded"].any()


CORNERS = [
    {**PUBLISHED_UNCERTAINTY, "inertia_coupling": dict(zip("pqr", theta, strict=True))}
    for theta in product((-0.25, 0.25), repeat=3)
]


@pytest.mark.parametrize("uncertainty", CORNERS)
def test_no_corner_of_the_published_uncertainty_alarms(uncertainty):
    flight = fly(scenario(fdi=SCHEME, uncertainty=uncertainty, duration_s=8.0))
    assert flight.detection_time_s is None


def mistake(fdi):
    with pytest.raises(Exception, match=r".*") as caught:
        load_text(f"name: x\nfdi: {fdi}\n", source="s.yaml")
    return str(caught.value)


@pytest.mark.parametrize(
    ("fdi", "says"),
    [
        ("options: {gain: 3}", "options.gain: zhang2005 has no such option"),
        ("options: {leave_out: 1.5}", "options.leave_out: 1.5, allowed: whole numbers from 0 to 3"),
        ("options: {network_gain: -1}", "options.network_gain: -1, allowed: numbers from 0 to 10000"),
        ("fault_class: all", "fault_class: zhang2005 is the paper's alone, allowed: published"),
        ("statistical: {}", "statistical: zhang2005 is the paper's alone, allowed: null"),
        ("thresholds: interval", "thresholds: zhang2005 is the paper's alone, allowed: published"),
        ("sharpen: all", "sharpen: zhang2005 is the paper's alone, allowed: none"),
    ],
)
def test_what_it_has_not_is_refused_in_a_line(fdi, says):
    line = mistake(f"{{scheme: zhang2005, {fdi}}}")
    assert line.startswith("s.yaml:2: fdi." + says)
    assert "\n" not in line
