"""The published scheme in flight: its threshold by another road, its options, and what it must not do."""

from itertools import product

import numpy as np
import pytest

from beaver_ftc.loop.loop import fly
from beaver_ftc.scenario.schema import load_text
from flying import PUBLISHED_UNCERTAINTY, flown, loss, scenario

SCHEME = {"scheme": "zhang2005", "thresholds": "published"}
POLE, DT = 10.0, 0.01


def test_residual_and_threshold_of_the_fdae_by_hand_from_the_log():
    """By Euler's steps from what the log has of the rates, the design model and the declared bound."""
    flight, log = flown(fdi=SCHEME, duration_s=4.0)
    assert flight.detection_time_s is None
    for axis in "pqr":
        x, F = log[f"{axis}_measured_rad_s"], log[f"{axis}_design_rad_s2"]
        xhat, threshold = np.empty(len(x)), np.zeros(len(x))
        xhat[0] = x[0]
        for k in range(len(x) - 1):
            xhat[k + 1] = xhat[k] + DT * (F[k + 1] - POLE * (xhat[k] - x[k]))
            threshold[k + 1] = threshold[k] + DT * (
                log[f"{axis}_eta_bar_rad_s2"][k + 1] - POLE * threshold[k]
            )
        np.testing.assert_allclose(log[f"{axis}_residual_rad_s"], x - xhat, atol=1e-12)
        # what the model neglects of the round Earth and of rounding is admitted, too
        assert (log[f"{axis}_threshold_rad_s"] >= threshold - 1e-12).all()
        np.testing.assert_allclose(log[f"{axis}_threshold_rad_s"], threshold, rtol=1e-6, atol=1e-9)
        assert not log[f"{axis}_network_rad_s2"].any()


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


@pytest.mark.parametrize(
    ("options", "found"),
    [
        ({"leave_out": 2}, "unanticipated"),
        ({"adaptive_threshold": 0}, "unanticipated"),
        ({"adaptation_gain": 0.0}, "elevator"),
    ],
)
def test_what_a_part_is_good_for_shows_without_it(options, found):
    flight, _ = flown(fdi=SCHEME | {"options": options}, faults=[loss(at_s=4.0)], duration_s=8.0)
    assert flight.isolated == found
    assert found == "unanticipated" or flight.estimate == 0.0


def test_without_the_dead_zone_the_network_learns_of_healthy_flight():
    _, log = flown(fdi=SCHEME | {"options": {"dead_zone": 0}}, duration_s=3.0)
    assert np.abs(log["q_network_rad_s2"]).max() > 1e-3


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


def test_it_takes_over_in_flight_from_a_scheme_with_more():
    document = {"fault_class": "all", "statistical": {}}
    changed = scenario(
        fdi=document, changes=[{"at_s": 2.0, "scheme": "zhang2005"}], faults=[loss(at_s=4.0)], duration_s=6.0
    )
    flight = fly(changed)
    assert flight.isolated == "elevator"
    assert 4.0 < flight.detection_time_s < 4.5
