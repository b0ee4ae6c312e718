"""Flights with the statistical detector: what it finds under noise, and what it leaves alone."""

import pytest

from flying import flown, loss

NOISY = {
    "sensors": "tactical-grade",
    "environment": {"turbulence": "dryden", "severity": "light"},
}
DECLARED = {"sensors": "tactical-grade", "turbulence": "light"}
AT_WORK = {  # enough for the ailerons to stand out against the rolling gust
    "p": [{"sine": {"amplitude_deg_s": 12, "frequency_hz": 0.5}}],
    "q": [{"sine": {"amplitude_deg_s": 4, "frequency_hz": 0.3}}],
    "r": [{"sine": {"amplitude_deg_s": 5, "frequency_hz": 0.4}}],
}


def _fdi(authority="either", bounds=None, **more):
    return {"statistical": {}, "authority": authority, "bounds": bounds or {}, **more}


@pytest.mark.parametrize("fault", [{"type": "hardover", "direction": 1}, {"type": "float"}])
@pytest.mark.parametrize("thresholds", ["published", "interval"])
def test_statistics_alone_name_the_elevator_whatever_the_thresholds_of_the_sets(thresholds, fault):
    """In the frame of the alarm each surface's own direction is asked: no surface may be without one."""
    flight, _ = flown(
        duration_s=6, sensors="tactical-grade", faults=[{**fault, "actuator": "elevator", "at_s": 3}],
        fdi=_fdi("statistical", {"sensors": "tactical-grade"}, fault_class="all", thresholds=thresholds),
    )  # fmt: skip
    assert flight.isolated == "elevator"


@pytest.mark.parametrize(("surface", "magnitude"), [("elevator", 0.3), ("aileron", 0.8), ("rudder", 0.6)])
def test_losses_are_found_named_and_estimated_under_noise_servos_turbulence_and_tolerances(
    surface, magnitude
):
    flight, _ = flown(
        duration_s=16, seed=2, reference=AT_WORK, actuators="servo",
        faults=[loss(surface, magnitude, at_s=4)],
        fdi=_fdi(bounds={**DECLARED, "coefficients": 0.05}), **NOISY,
    )  # fmt: skip
    assert flight.isolated == surface
    assert 4.0 < flight.detection_time_s <= flight.isolation_time_s
    assert flight.estimate == pytest.approx(-magnitude, abs=0.25)
    assert flight.statistical["time_s"] == flight.detection_time_s


@pytest.mark.parametrize(
    ("rate_hz", "substeps", "seed", "severity", "turn_deg_s", "start_s", "airspeed_mps", "altitude_m"),
    [
        (265, 8, 934, "light", -19.874, 0.16, 42.5454, 2446.33),
        (197, 1, 4162, "moderate", -69.012, 0.947, 42.3832, 1333.13),
    ],
)
def test_a_dive_past_the_vertical_is_no_fault(
    rate_hz, substeps, seed, severity, turn_deg_s, start_s, airspeed_mps, altitude_m
):
    """The gusts turn round with the heading: within a frame, or from one to the next."""
    flight, log = flown(
        rate_hz=rate_hz, substeps=substeps, seed=seed, duration_s=6,
        initial={"airspeed_mps": airspeed_mps, "altitude_m": altitude_m},
        reference={"q": [{"step": {"amplitude_deg_s": turn_deg_s, "start_s": start_s}}]},
        environment={"turbulence": "dryden", "severity": severity}, uncertainty={},
        fdi=_fdi(bounds={"turbulence": severity}), control={"law": "fault-tolerant"},
    )  # fmt: skip
    assert log["theta_rad"].min() < -1.56
    assert flight.detection_time_s is None


@pytest.mark.parametrize("substeps", [1, 3])
@pytest.mark.parametrize("authority", ["either", "statistical"])
def test_a_small_loss_that_nobody_sees_until_it_ends_is_not_taken_for_an_unanticipated_fault(
    authority, substeps
):
    """In trim, where nothing moves, its end is a step such as many a fault would be."""
    fault = loss("elevator", 0.15, at_s=0.9, end_s=3.8, profile="incipient", kappa_per_s=5.0)
    flight, _ = flown(
        duration_s=6, rate_hz=250, substeps=substeps, initial={"airspeed_mps": 44.8, "altitude_m": 1600},
        reference={}, uncertainty={}, faults=[fault], fdi=_fdi(authority, {"coefficients": 0.05}),
    )  # fmt: skip
    assert flight.detection_time_s > 3.8
    assert flight.isolated in ("elevator", None)
    assert "elevator" in (*flight.candidates, flight.isolated)


@pytest.mark.parametrize("authority", ["either", "statistical"])
@pytest.mark.parametrize("kappa", [0.1, 0.5, 5.0])
@pytest.mark.parametrize("surface", ["elevator", "rudder"])
def test_a_loss_that_grows_is_never_taken_for_something_else(surface, kappa, authority):
    """Nor is one named already given up while its evidence fades, for what goes along with the commands."""
    fault = loss(surface, 0.6, at_s=4, profile="incipient", kappa_per_s=kappa)
    flight, _ = flown(duration_s=40, faults=[fault], fdi=_fdi(authority))
    assert flight.isolated == surface or (flight.detection_time_s is None and authority == "statistical")


@pytest.mark.parametrize(
    ("severity", "keys"),
    [
        ("light", {}),
        ("moderate", {"initial": {"airspeed_mps": 38}}),
        ("severe", {"initial": {"airspeed_mps": 52}}),
        ("light", {"rate_hz": 200, "duration_s": 20}),
        ("light", {"substeps": 4, "duration_s": 30}),
        ("light", {"sensors": "consumer-grade"}),
    ],
)
def test_no_false_alarm_in_moving_air(severity, keys):
    environment = {"turbulence": "dryden", "severity": severity, "wind_mps": [4, -3, 0]}
    keys = {"duration_s": 60, "seed": 4, "sensors": "tactical-grade", "environment": environment} | keys
    bounds = {"sensors": keys["sensors"], "turbulence": severity}
    flight, _ = flown(fdi=_fdi("statistical", bounds), **keys)
    assert flight.detection_time_s is None
    assert 0.2 < flight.statistical["closest_approach"] < 1.0


@pytest.mark.parametrize(
    ("surface", "amplitude_deg", "frequency_rad_s"), [("elevator", 0.6, 8.3), ("rudder", 2.5, 5.9)]
)
def test_small_oscillations_are_heard_and_named_in_turbulence(surface, amplitude_deg, frequency_rad_s):
    fault = {
        "actuator": surface, "type": "oscillatory", "at_s": 4,
        "amplitude_deg": amplitude_deg, "frequency_rad_s": frequency_rad_s,
    }  # fmt: skip
    flight, _ = flown(
        duration_s=16, seed=2, actuators="servo", faults=[fault],
        fdi=_fdi(bounds={**DECLARED, "coefficients": 0.05}, fault_class="all"), **NOISY,
    )  # fmt: skip
    assert flight.detection_time_s > 4.0
    assert flight.isolated == surface
    assert any("oscillatory" in candidate for candidate in (flight.isolation_type or "", *flight.candidates))


_HIDING = {
    "sensors": {},
    "constant_rad_s2": {"p": 0.0, "q": 0.0073, "r": 0.0},
}  # and gusts


@pytest.mark.parametrize("authority", ["either", "statistical"])
@pytest.mark.parametrize("severity", ["light", "moderate"])
@pytest.mark.parametrize("sensor", ["alpha", "beta"])
def test_an_error_of_a_vane_that_a_gust_may_hide_is_no_surfaces(sensor, severity, authority):
    watched = _fdi(authority, {**_HIDING, "turbulence": severity}, sensor_monitor="always")
    for size_deg in (0.5, 1.2, -0.8, -2.5):
        broken = {"sensor": sensor, "type": "bias", "magnitude": size_deg, "at_s": 1, "end_s": 2.2}
        flight, _ = flown(duration_s=4, uncertainty={}, faults=[broken], fdi=watched)
        assert flight.isolated in (None, "unanticipated", f"sensor {sensor}"), size_deg


@pytest.mark.parametrize("fault_class", ["published", "all"])
@pytest.mark.parametrize(
    ("noisy", "law"),
    [
        ({"qdyn": {"noise_std_pa": 3}}, "nominal"),
        ({"alpha": {"noise_std_deg": 0.3}}, "fault-tolerant"),
        ({"V": {"noise_std_mps": 0.3}}, "indi"),
        ({"alpha": {"noise_std_deg": 0.3}}, "indi"),
    ],
)
def test_what_a_law_makes_of_noisy_air_data_is_no_fault(noisy, law, fault_class):
    """With gyros without noise: all that the law does, it does for what the readings are off by. Of every
    type the forces are asked as well: what noise does to them, by the slipstream too, is no fault either.
    """
    declared = {"sensors": noisy, "constant_rad_s2": {"p": 0.0, "q": 0.0, "r": 0.0}}
    flight, log = flown(
        duration_s=4, uncertainty={}, reference={}, sensors=noisy, control={"law": law},
        initial={"airspeed_mps": 41}, fdi=_fdi("either", declared, fault_class=fault_class),
    )  # fmt: skip
    assert flight.detection_time_s is None
    shares = [log[column].max() for column in log.columns if column.endswith("likelihood_share")]
    assert max(shares) < 0.75
