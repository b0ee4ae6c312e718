"""Accelerometers with errors, and broken ones: no false alarm, no surface and no other instrument named."""

import pytest

import beaver_ftc as bf
from beaver_ftc.loop.loop import Loop
from beaver_ftc.scenario.schema import load

MOVING = {
    axis: [{"sine": {"amplitude_deg_s": 3, "frequency_hz": hz}}]
    for axis, hz in (("p", 0.25), ("q", 0.2), ("r", 0.3))
}
WEIGHED = {"fault_class": "all", "statistical": {}}
FORCES = ("ax", "ay", "az")
SIZE = {"bias": 1.5, "noise": 1.5, "scale": 0.4}
NOISY = {
    "ax": {"noise_std_mps2": 0.05, "bias_mps2": 0.3}, "ay": {"noise_std_mps2": 0.1, "bias_mps2": -0.2},
    "az": {"noise_std_mps2": 0.05, "scale_error": -0.02, "quantum_mps2": 0.1},
}  # fmt: skip

SOUND = {**WEIGHED, "sensor_monitor": "never"}


def flight(*faults, fdi=None, **more):
    fdi = {"sensor_monitor": "always", **(fdi or {})}
    return load(
        {"name": "x", "duration_s": 9, "reference": MOVING, "faults": list(faults), "fdi": fdi, **more}
    )


def fault(sensor, kind, at_s=5.0, **more):
    size = {"magnitude": SIZE[kind]} if kind in SIZE else {}
    return {"sensor": sensor, "type": kind, "at_s": at_s, **size, **more}


def names(scenario):
    """All that the diagnosis names, frame by frame, what it names before the alarm of the monitor too."""
    sim, named = bf.Simulation(scenario), set()
    while not sim.done:
        sim.step()
        named.add(sim.verdict.isolated)
    assert not sim._loop.frames[0]["fdi"]["sensor_monitor"]["output"]["had_surface"]
    assert not sim.departed
    return named - {None}


@pytest.mark.parametrize("fdi", [{}, WEIGHED], ids=["worst-case", "statistical"])
@pytest.mark.parametrize("kind", ["bias", "noise", "scale", "freeze", "lost"])
@pytest.mark.parametrize("sensor", FORCES)
def test_a_broken_accelerometer_is_no_surface_and_no_other_instrument(sensor, kind, fdi):
    named = names(flight(fault(sensor, kind), fdi=fdi))
    assert named
    assert named <= {f"sensor {sensor}", "unanticipated"}
    if sensor == "ax" or kind in ("lost", "freeze"):
        assert named == {f"sensor {sensor}"}


@pytest.mark.parametrize(("rate_hz", "substeps"), [(20, 1), (50, 5), (200, 1)])
@pytest.mark.parametrize("turbulence", ["none", "light"])
def test_with_errors_and_gusts_as_declared_it_is_neither(rate_hz, substeps, turbulence):
    """Small faults, that the monitor may never see, stay without an alarm."""
    bounds = {"sensors": "tactical-grade", "turbulence": turbulence}
    air = {"turbulence": "dryden", "severity": "light"} if turbulence == "light" else {}
    for i, size in enumerate((0.3, 3.0)):
        given = {"fdi": {**WEIGHED, "bounds": bounds}, "sensors": "tactical-grade", "environment": air}
        given |= {"rate_hz": rate_hz, "substeps": substeps, "seed": i}
        named = names(flight(fault("az", "bias", magnitude=size), **given))
        assert named <= {"sensor az", "unanticipated"}


def test_a_vane_that_jumps_is_named_at_once_and_one_that_sticks_soon():
    """As when accelerometers could not break; what they would have to do is beyond them."""
    for sensor in ("alpha", "beta", "V"):
        for kind, most_s in (("bias", 0.0), ("freeze", 0.1)):
            flown = bf.fly(flight(fault(sensor, kind)), log=False)
            assert flown.isolation.fault == f"sensor {sensor}"
            assert flown.isolation.delay_s <= most_s


@pytest.mark.parametrize(
    "sensors", ["tactical-grade", "consumer-grade", NOISY], ids=["tactical", "poor", "noisy"]
)
@pytest.mark.parametrize(("rate_hz", "substeps"), [(20, 1), (50, 4), (200, 1)])
@pytest.mark.parametrize("turbulence", ["none", "light"])
def test_sound_accelerometers_with_the_declared_errors_are_never_suspected(
    sensors, rate_hz, substeps, turbulence
):
    """The monitor's guarantee: worst-case bounds, whatever is drawn."""
    air = {"turbulence": "dryden", "severity": "light"} if turbulence == "light" else {}
    for seed in range(2):
        fdi = {"sensor_monitor": "always", "bounds": {"sensors": sensors, "turbulence": turbulence}}
        given = {"rate_hz": rate_hz, "substeps": substeps, "seed": seed, "duration_s": 20}
        loop = Loop(flight(sensors=sensors, environment=air, fdi=fdi, **given))
        for _ in loop.chunks():
            pass
        monitor = loop.frames[0]["fdi"]["sensor_monitor"]
        assert monitor["memory"]["stage"]
        assert not monitor["output"]["alarmed"]


def test_beyond_what_is_declared_they_are():
    """The bound is no wider than it takes: an accelerometer off by a few times as much is seen."""
    fdi = {"sensor_monitor": "always", "bounds": {"sensors": {"az": {"bias_mps2": 0.05}}}}
    for off, seen in ((0.05, False), (0.2, True)):
        loop = Loop(flight(sensors={"az": {"bias_mps2": off}}, fdi=fdi))
        for _ in loop.chunks():
            pass
        assert bool(loop.frames[0]["fdi"]["sensor_monitor"]["output"]["alarmed"]) == seen


@pytest.mark.parametrize(
    "sensors", ["tactical-grade", "consumer-grade", NOISY], ids=["tactical", "poor", "noisy"]
)
@pytest.mark.parametrize("turbulence", ["none", "light"])
def test_what_is_declared_of_them_raises_no_false_alarm(sensors, turbulence):
    """By the statistics, with forces weighed: unwatched, accelerometers taken at their word."""
    air = {"turbulence": "dryden", "severity": "light"} if turbulence == "light" else {}
    for seed in range(2):
        bounds = {"sensors": sensors, "turbulence": turbulence}
        scenario = flight(
            sensors=sensors, environment=air, seed=seed, duration_s=20, fdi={**SOUND, "bounds": bounds}
        )
        flown = bf.fly(scenario, log=False)
        assert flown.metrics["false_alarm"] is False
