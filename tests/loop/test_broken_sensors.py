"""Flights in which an instrument breaks: named as that, never as a surface; and the aircraft is kept."""

import numpy as np
import pytest

import beaver_ftc as bf
from beaver_ftc.plant.instruments import AX, SENSORS
from beaver_ftc.scenario.schema import load

MOVING = {
    axis: [{"sine": {"amplitude_deg_s": 3, "frequency_hz": hz}}]
    for axis, hz in (("p", 0.25), ("q", 0.2), ("r", 0.3))
}
SIZE = {"V": 4.0, "qdyn": 100.0, "altitude": 20.0, "engine_rpm": 100.0, "manifold_pressure": 2.0}


def flight(*faults, fdi=None, **more):
    fdi = {"sensor_monitor": "always", **(fdi or {})}
    return load(
        {"name": "x", "duration_s": 7, "reference": MOVING, "faults": list(faults), "fdi": fdi, **more}
    )


def fault(sensor, kind, at_s=5.0):
    size = {"bias": SIZE.get(sensor, 1.5), "noise": SIZE.get(sensor, 1.5), "scale": 0.4}.get(kind)
    return {"sensor": sensor, "type": kind, "at_s": at_s, **({} if size is None else {"magnitude": size})}


@pytest.mark.parametrize("kind", ["bias", "noise", "scale", "lost"])
@pytest.mark.parametrize("sensor", SENSORS[:AX])
def test_a_broken_sensor_is_named(sensor, kind):
    flown = bf.fly(flight(fault(sensor, kind)), log=False)
    assert flown.isolation.fault == f"sensor {sensor}"
    assert flown.isolation.delay_s <= 0.1
    assert flown.isolation.correct
    assert not flown.metrics["false_alarm"]
    assert flown.departure is None


@pytest.mark.parametrize(("rate_hz", "substeps"), [(20, 1), (50, 5), (200, 2)])
@pytest.mark.parametrize("fault_class", ["published", "all"])
@pytest.mark.parametrize("sensor", ["p", "q", "r", "alpha", "theta"])
def test_at_any_rate_and_no_surface_is_named_for_a_frame(sensor, rate_hz, substeps, fault_class):
    scenario = flight(
        fault(sensor, "bias"), rate_hz=rate_hz, substeps=substeps, fdi={"fault_class": fault_class}
    )
    sim, named = bf.Simulation(scenario), set()
    while not sim.done:
        sim.step()
        named.add(sim.verdict.isolated)
    assert named == {None, f"sensor {sensor}"}


def test_a_gyro_that_is_replaced_no_longer_misleads_the_law():
    sound = bf.fly(flight())
    broken = bf.fly(flight(fault("q", "bias")))
    trusted = bf.fly(flight(fault("q", "bias"), fdi={"sensor_monitor": "never"}))
    after = sound.log["t_s"].to_numpy() > 6.0
    error = [np.abs(flown.log["q_rad_s"] - sound.log["q_rad_s"])[after].max() for flown in (broken, trusted)]
    assert error[0] < 1e-3 < np.radians(1.0) < error[1]


@pytest.mark.parametrize("sensor", ["alpha", "beta", "V"])
def test_the_flight_goes_on_without_a_vane_or_the_airspeed(sensor):
    scenario = load(
        {
            "name": "x", "duration_s": 60, "faults": [fault(sensor, "lost")], "fdi": {"fault_class": "all"},
            "autopilot": {"altitude_m": [{"hold": True}],
                          "heading_deg": [{"hold": True}, {"at_s": 10, "value": 20}],
                          "airspeed_mps": [{"value": 45}]},
            "expect": {"altitude_within_m": 15, "airspeed_within_mps": 3, "heading_within_deg": 5,
                       "stays_in_envelope": True},
        }
    )  # fmt: skip
    assert bf.fly(scenario, log=False).passed


def test_a_surface_fault_is_no_instruments_fault_and_named_a_frame_later_at_most():
    loss = {"actuator": "elevator", "type": "loss_of_effectiveness", "magnitude": 0.5, "at_s": 4.0}
    plain, watched = (
        bf.fly(flight(loss, fdi={"sensor_monitor": watch}), log=False) for watch in ("never", "always")
    )
    assert plain.isolation.fault == watched.isolation.fault == "elevator"
    assert plain.detection.delay_s == watched.detection.delay_s
    assert 0.0 <= watched.isolation.delay_s - plain.isolation.delay_s <= 0.01 + 1e-9
