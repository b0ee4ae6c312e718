"""Healthy flights in declared turbulence: strong, and down to the ground."""

import pytest

from beaver_ftc.loop.loop import fly
from flying import scenario


def in_air(severity, **keys):
    air = {"turbulence": "dryden", "severity": severity}
    fdi = {"bounds": {"turbulence": severity}, **keys.pop("fdi", {})}
    return fly(scenario(environment=air, fdi=fdi, **keys))


@pytest.mark.parametrize("seed", [25, 88])
def test_severe_turbulence_raises_no_alarm_in_any_class(seed):
    flight = in_air(
        "severe", seed=seed, rate_hz=50, duration_s=45, fdi={"fault_class": "all", "statistical": {}}
    )
    assert flight.detection_time_s is None


@pytest.mark.parametrize("statistical", [None, {}])
def test_a_descent_to_the_ground_raises_no_alarm(statistical):
    legs = [{"value": 120}, {"at_s": 1, "value": 12, "climb_mps": 5}]
    autopilot = {"altitude_m": legs, "airspeed_mps": [{"value": 45}], "heading_deg": [{"hold": True}]}
    flight = in_air(
        "light", duration_s=60, autopilot=autopilot, sensors="tactical-grade",
        initial={"airspeed_mps": 45, "altitude_m": 120},
        fdi={"bounds": {"turbulence": "light", "sensors": "tactical-grade"}, "statistical": statistical},
    )  # fmt: skip
    assert flight.detection_time_s is None
