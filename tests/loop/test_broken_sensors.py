"""Flights in which an instrument breaks: it is named, or nothing; no surface is, nor another instrument."""

import numpy as np
import pytest

import beaver_ftc as bf
from beaver_ftc.diagnosis.monitors.numbering import ALPHA_TEST, BETA_TEST, RPM_TEST
from beaver_ftc.plant.instruments import AX, SENSORS
from beaver_ftc.scenario.schema import load
from flying import SINES
from given import given

GIVEN = given(__file__)

SWINGING = {
    "p": [{"sine": {"amplitude_deg_s": 4, "frequency_hz": 0.3}}],
    "q": [{"sine": {"amplitude_deg_s": 3, "frequency_hz": 0.2}}],
    "r": [{"sine": {"amplitude_deg_s": -4, "frequency_hz": 0.5, "phase_deg": 90}}],
}
ALL = {"fault_class": "all"}
WEIGHED = {**ALL, "statistical": {}}
SIZE = {"V": 4.0, "qdyn": 100.0, "altitude": 20.0, "engine_rpm": 100.0, "manifold_pressure": 2.0}
LIGHT = {"turbulence": "dryden", "severity": "light"}


def flight(*faults, fdi=None, **more):
    fdi = {"sensor_monitor": "always", **(fdi or {})}
    given = {"name": "x", "duration_s": 7, "reference": SINES, "faults": list(faults), "fdi": fdi}
    return load(given | more)


def fault(sensor, kind, at_s=5.0, magnitude=None):
    size = {"bias": SIZE.get(sensor, 1.5), "noise": SIZE.get(sensor, 1.5), "scale": 0.4}.get(kind)
    size = size if magnitude is None else magnitude
    return {"sensor": sensor, "type": kind, "at_s": at_s, **({} if size is None else {"magnitude": size})}


def names(scenario):
    """All that the diagnosis names, frame by frame, what it names before the alarm of the monitor too."""
    sim, named = bf.Simulation(scenario, log=False), set()
    while not sim.done:
        sim.step()
        named.add(sim.verdict.isolated)
    assert not sim.departed
    return named - {None}


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
    given = {"rate_hz": rate_hz, "substeps": substeps, "fdi": {"fault_class": fault_class}}
    assert names(flight(fault(sensor, "bias"), **given)) == {f"sensor {sensor}"}


@pytest.mark.parametrize("fdi", [{}, WEIGHED], ids=["worst-case", "statistical"])
@pytest.mark.parametrize("kind", ["bias", "noise", "scale", "freeze", "lost"])
@pytest.mark.parametrize("sensor", ["ax", "ay", "az"])
def test_a_broken_accelerometer_is_no_surface_and_no_other_instrument(sensor, kind, fdi):
    named = names(flight(fault(sensor, kind), fdi=fdi, duration_s=9))
    assert named
    assert named <= {f"sensor {sensor}", "unanticipated"}
    if sensor == "ax" or kind in ("lost", "freeze"):
        assert named == {f"sensor {sensor}"}


@pytest.mark.parametrize(("rate_hz", "substeps"), [(20, 1), (50, 5), (200, 1)])
@pytest.mark.parametrize("turbulence", ["none", "light"])
def test_an_accelerometer_with_errors_and_gusts_as_declared(rate_hz, substeps, turbulence):
    """Small faults, that the monitor may never see, stay without an alarm."""
    bounds = {"sensors": "tactical-grade", "turbulence": turbulence}
    air = LIGHT if turbulence == "light" else {}
    for i, size in enumerate((0.3, 3.0)):
        given = {"fdi": {**WEIGHED, "bounds": bounds}, "sensors": "tactical-grade", "environment": air}
        given |= {"rate_hz": rate_hz, "substeps": substeps, "seed": i, "duration_s": 9}
        assert names(flight(fault("az", "bias", magnitude=size), **given)) <= {"sensor az", "unanticipated"}


@pytest.mark.parametrize(("kind", "most_s"), [("bias", 0.0), ("freeze", 0.1)])
@pytest.mark.parametrize("sensor", ["alpha", "beta", "V"])
def test_a_vane_that_jumps_is_named_at_once_and_one_that_sticks_soon(sensor, kind, most_s):
    found = bf.fly(flight(fault(sensor, kind)), log=False).isolation
    assert found.fault == f"sensor {sensor}"
    assert found.delay_s <= most_s


AGAIN = [{"at_s": 1.3, "scheme": "adaptive-estimators"}]


@pytest.mark.parametrize(
    ("sensor", "kind", "magnitude", "at_s", "more"),
    GIVEN["one that is broken as the diagnosis begins"],
)
def test_one_that_is_broken_as_the_diagnosis_begins(sensor, kind, magnitude, at_s, more):
    given = {"duration_s": 4, "reference": {}} | more
    named = bf.fly(flight(fault(sensor, kind, at_s, magnitude), **given), log=False).isolation.fault
    assert named in (None, "unanticipated", f"sensor {sensor}")
    if sensor in "pq":
        assert named == f"sensor {sensor}", "all of a gyro's error shows at every look"


@pytest.mark.parametrize("substeps", [1, 2, 5])
@pytest.mark.parametrize(
    ("sensor", "kind", "tests"),
    [("beta", "lost", None), ("alpha", "bias", ALPHA_TEST), ("beta", "bias", BETA_TEST),
     ("engine_rpm", "bias", RPM_TEST)],
)  # fmt: skip
def test_it_is_found_when_it_breaks_in_verdict_and_log(sensor, kind, tests, substeps):
    size = {"engine_rpm": 50.0}.get(sensor, 2.0) if kind == "bias" else None
    given = {"substeps": substeps, "fdi": ALL, "reference": {}, "duration_s": 3}
    found = bf.fly(flight(fault(sensor, kind, 1.5, size), **given))
    assert not found.metrics["false_alarm"]
    assert found.metrics["detection"]["time_s"] == 1.5
    assert found.isolation.fault == f"sensor {sensor}"
    log = found.log
    assert (log["detected"] == (log["t_s"] >= 1.5 - 1e-9)).all()
    if tests is not None:
        first = int(np.argmax(log["watch_share"] > 1.0))
        assert log["t_s"][first] == 1.5
        assert log["watch_test"][first] == tests


def test_a_gyro_that_is_replaced_no_longer_misleads_the_law():
    sound = bf.fly(flight())
    broken = bf.fly(flight(fault("q", "bias")))
    trusted = bf.fly(flight(fault("q", "bias"), fdi={"sensor_monitor": "never"}))
    after = sound.log["t_s"].to_numpy() > 6.0
    error = [np.abs(flown.log["q_rad_s"] - sound.log["q_rad_s"])[after].max() for flown in (broken, trusted)]
    assert error[0] < 1e-3 < np.radians(1.0) < error[1]


@pytest.mark.parametrize("sensor", ["alpha", "beta", "V"])
def test_the_flight_goes_on_without_a_vane_or_the_airspeed(sensor):
    heading = [{"hold": True}, {"at_s": 10, "value": 20}]
    pilot = {"altitude_m": [{"hold": True}], "heading_deg": heading, "airspeed_mps": [{"value": 45}]}
    limits = {"altitude_within_m": 15, "airspeed_within_mps": 3, "heading_within_deg": 5}
    given = {
        "name": "x", "duration_s": 60, "faults": [fault(sensor, "lost")], "fdi": ALL, "autopilot": pilot,
        "expect": limits | {"stays_in_envelope": True},
    }  # fmt: skip
    assert bf.fly(load(given), log=False).passed


def test_a_surface_fault_is_no_instruments_fault_and_named_a_frame_later_at_most():
    loss = {"actuator": "elevator", "type": "loss_of_effectiveness", "magnitude": 0.5, "at_s": 4.0}
    plain, watched = (
        bf.fly(flight(loss, fdi={"sensor_monitor": watch}), log=False) for watch in ("never", "always")
    )
    assert plain.isolation.fault == watched.isolation.fault == "elevator"
    assert plain.detection.delay_s == watched.detection.delay_s
    assert 0.0 <= watched.isolation.delay_s - plain.isolation.delay_s <= 0.01 + 1e-9
