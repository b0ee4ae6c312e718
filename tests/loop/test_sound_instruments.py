"""Sound instruments, their errors declared, never make the sensor monitor alarm, nor the statistics."""

import pytest

import beaver_ftc as bf
from beaver_ftc.scenario.schema import load
from flying import SINES
from given import given

GIVEN = given(__file__)

SWINGING = {
    "p": [{"sine": {"amplitude_deg_s": 10, "frequency_hz": 0.5}}],
    "q": [{"sine": {"amplitude_deg_s": 5, "frequency_hz": 0.4}}],
    "r": [{"sine": {"amplitude_deg_s": 10, "frequency_hz": 0.65}}],
}
ROLLED = {"p": [{"doublet": {"amplitude_deg_s": 10, "start_s": 0.5}}]}
FAST = {"p": [{"sine": {"amplitude_deg_s": 3, "frequency_hz": 7}}]}
GRADE = "consumer-grade"
GRADES = {
    "tactical": "tactical-grade", "poor": GRADE,
    "noisy": {
        "ax": {"noise_std_mps2": 0.05, "bias_mps2": 0.3}, "ay": {"noise_std_mps2": 0.1, "bias_mps2": -0.2},
        "az": {"noise_std_mps2": 0.05, "scale_error": -0.02, "quantum_mps2": 0.1},
    },
}  # fmt: skip


def has(**errors):
    """Errors of instruments, and the same declared by their sizes."""
    sizes = {sensor: {key: abs(value) for key, value in of.items()} for sensor, of in errors.items()}
    return {"sensors": errors, "fdi": {"bounds": {"sensors": sizes}}}


def accelerometers(grade, turbulence, fdi, seed, **more):
    """A flight of 20 s with their errors, in still air or light turbulence, both declared."""
    air = {"turbulence": "dryden", "severity": "light"} if turbulence == "light" else {}
    fdi = {**fdi, "bounds": {"sensors": GRADES[grade], "turbulence": turbulence}}
    given = {"sensors": GRADES[grade], "environment": air, "fdi": fdi, "seed": seed, "duration_s": 20}
    return {"reference": SINES, **given, **more}


FLOWN = GIVEN["flown"]  # fmt: skip


def suspected(words):
    """Whether the flight has an alarm, or a test of the sensor monitor exceeds its bound."""
    fdi = {"sensor_monitor": "always", **words.get("fdi", {})}
    found = bf.fly(load({"name": "x", "duration_s": 3, **words, "fdi": fdi}))
    alarmed = found.metrics["false_alarm"] or found.log["detected"].max() > 0.0
    return alarmed or not found.log["watch_share"].max() <= 1.0


@pytest.mark.parametrize("name", FLOWN)
def test_sound_declared_instruments_are_never_suspected(name):
    assert not suspected(FLOWN[name])


@pytest.mark.parametrize("grade", GRADES)
@pytest.mark.parametrize(("rate_hz", "substeps"), [(20, 1), (50, 4), (200, 1)])
@pytest.mark.parametrize("turbulence", ["none", "light"])
@pytest.mark.parametrize("seed", [0, 1])
def test_sound_accelerometers_are_never_suspected(grade, turbulence, rate_hz, substeps, seed):
    assert not suspected(accelerometers(grade, turbulence, {}, seed, rate_hz=rate_hz, substeps=substeps))


@pytest.mark.parametrize("grade", GRADES)
@pytest.mark.parametrize("turbulence", ["none", "light"])
@pytest.mark.parametrize("seed", [0, 1])
def test_what_is_declared_of_accelerometers_raises_no_false_alarm_by_the_statistics(grade, turbulence, seed):
    fdi = {"fault_class": "all", "statistical": {}, "sensor_monitor": "never"}
    words = accelerometers(grade, turbulence, fdi, seed)
    assert not bf.fly(load({"name": "x", **words}), log=False).metrics["false_alarm"]


@pytest.mark.parametrize(("off_mps2", "seen"), [(0.05, False), (0.2, True)])
def test_an_accelerometer_is_suspected_beyond_what_is_declared(off_mps2, seen):
    """The bound is no wider than it takes."""
    fdi = {"sensor_monitor": "always", "bounds": {"sensors": {"az": {"bias_mps2": 0.05}}}}
    given = {"name": "x", "duration_s": 9, "reference": SINES, "fdi": fdi}
    found = bf.fly(load(given | {"sensors": {"az": {"bias_mps2": off_mps2}}}))
    assert (found.log["watch_share"].max() > 1.0) == seen


@pytest.mark.parametrize("fault_class", ["published", "all"])
@pytest.mark.parametrize(("at_s", "name"), [(0.0, None), (0.01, None), (1.01, "elevator")])
def test_a_surface_broken_from_the_start_is_no_instruments_fault(at_s, name, fault_class):
    """Nor is it a surface's for certain: a vane that is off from the start looks like one."""
    broken = {"actuator": "elevator", "type": "bias", "bias_deg": 4, "at_s": at_s}
    if fault_class == "published":
        broken = {"actuator": "elevator", "type": "loss_of_effectiveness", "magnitude": 0.6, "at_s": at_s}
    fdi = {"sensor_monitor": "always", "fault_class": fault_class}
    words = {"name": "x", "duration_s": 3, "faults": [broken], "reference": SWINGING, "fdi": fdi}
    found = bf.fly(load(words))
    assert found.detection.detected
    assert found.isolation.fault == name
    assert found.log["watch_share"].max() <= 1.0
