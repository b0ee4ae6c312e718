"""Sound instruments, their errors declared, never make the watch speak; a broken one does when it breaks, and
the log says so as the verdict does."""

import numpy as np
import pytest

import beaver_ftc as bf
from beaver_ftc.diagnosis.monitors.redundancy import ALPHA_TEST, BETA_TEST, RPM_TEST
from beaver_ftc.scenario.schema import load

SWINGING = {
    "p": [{"sine": {"amplitude_deg_s": 10, "frequency_hz": 0.5}}],
    "q": [{"sine": {"amplitude_deg_s": 5, "frequency_hz": 0.4}}],
    "r": [{"sine": {"amplitude_deg_s": 10, "frequency_hz": 0.65}}],
}
ROLLED = {"p": [{"doublet": {"amplitude_deg_s": 10, "start_s": 0.5}}]}
FAST = {"p": [{"sine": {"amplitude_deg_s": 3, "frequency_hz": 7}}]}
GRADE = "consumer-grade"


def has(**errors):
    """Errors of instruments, and the same declared by their sizes."""
    sizes = {sensor: {key: abs(value) for key, value in of.items()} for sensor, of in errors.items()}
    return {"sensors": errors, "fdi": {"sensor_monitor": "always", "bounds": {"sensors": sizes}}}


def flown(**words):
    fdi = {"sensor_monitor": "always", **words.pop("fdi", {})}
    return bf.fly(load({"name": "x", "duration_s": 3, **words, "fdi": fdi}))


@pytest.mark.parametrize(
    "words",
    [
        {"reference": ROLLED, **has(p={"scale_error": 0.02})},
        {"reference": FAST, "rate_hz": 23, **has(p={"scale_error": -0.02})},
        {"reference": FAST, "rate_hz": 20, "substeps": 3, **has(r={"scale_error": 0.05})},
        {"duration_s": 26, "rate_hz": 30, **has(q={"bias_deg_s": -1.0})},
        {"environment": {"wind_mps": [-19, 6, 1]}},
        {"environment": {"wind_mps": [0, 0, -1]}, "reference": SWINGING, "rate_hz": 20},
        {"reference": SWINGING, "duration_s": 10, **has(theta={"drift_deg_h": -3600.0})},
        {"reference": SWINGING, "duration_s": 6, **has(qdyn={"bias_pa": 150.0}, V={"bias_mps": -4.0})},
        {"reference": SWINGING, "rate_hz": 50, "duration_s": 6,
         "changes": [{"at_s": 5.3, "scheme": "adaptive-estimators"}]},
        {"reference": SWINGING, "substeps": 4, "duration_s": 6, "sensors": GRADE,
         "fdi": {"bounds": {"sensors": GRADE}}, "changes": [{"at_s": 2.0, "sensors": "ideal"},
                                                            {"at_s": 4.0, "sensors": GRADE}]},
        {"reference": SWINGING, "rate_hz": 71, "duration_s": 6,
         "fdi": {"statistical": {}, "fault_class": "all"},
         "changes": [{"at_s": 2.0, "sensors": GRADE, "declared_sensors": GRADE},
                     {"at_s": 4.0, "sensors": "ideal", "declared_sensors": "ideal"}]},
    ],
    ids=["slope", "low rate", "low rate, substeps", "bias", "wind", "swinging in wind", "drift", "dense",
         "anew", "others within the declaration", "another grade"],
)  # fmt: skip
def test_sound_declared_instruments_are_never_suspected(words):
    found = flown(**words)
    assert not found.metrics["false_alarm"]
    assert found.log["watch_share"].max() <= 1.0
    assert found.log["detected"].max() == 0.0


@pytest.mark.parametrize("substeps", [1, 2, 5])
@pytest.mark.parametrize(
    ("sensor", "kind", "tests"),
    [("beta", "lost", None), ("alpha", "bias", ALPHA_TEST), ("beta", "bias", BETA_TEST),
     ("engine_rpm", "bias", RPM_TEST)],
)  # fmt: skip
def test_a_broken_instrument_is_found_when_it_breaks_in_verdict_and_log(sensor, kind, tests, substeps):
    size = {} if kind == "lost" else {"magnitude": 50.0 if sensor == "engine_rpm" else 2.0}
    broken = {"sensor": sensor, "type": kind, "at_s": 1.5, **size}
    found = flown(faults=[broken], substeps=substeps, fdi={"fault_class": "all"})
    assert not found.metrics["false_alarm"]
    assert found.metrics["detection"]["time_s"] == 1.5
    assert found.isolation.fault == f"sensor {sensor}"
    log = found.log
    since = log["t_s"] >= 1.5 - 1e-9
    assert (log["detected"] == since).all()
    if tests is not None:
        first = int(np.argmax(log["watch_share"] > 1.0))
        assert log["t_s"][first] == 1.5
        assert log["watch_test"][first] == tests


@pytest.mark.parametrize("fault_class", ["published", "all"])
@pytest.mark.parametrize(("at_s", "name"), [(0.0, None), (0.01, None), (1.01, "elevator")])
def test_a_surface_broken_from_the_start_is_no_instruments_fault(at_s, name, fault_class):
    """Nor is it a surface's for certain: a vane that is off from the start looks like one."""
    broken = {"actuator": "elevator", "type": "bias", "bias_deg": 4, "at_s": at_s}
    if fault_class == "published":
        broken = {"actuator": "elevator", "type": "loss_of_effectiveness", "magnitude": 0.6, "at_s": at_s}
    found = flown(faults=[broken], reference=SWINGING, fdi={"fault_class": fault_class})
    assert found.detection.detected
    assert found.isolation.fault == name
    assert found.log["watch_share"].max() <= 1.0
