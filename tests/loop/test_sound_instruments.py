"""Sound instruments, their errors declared, never make the watch speak; a broken one does when it breaks, and
the log says so as the verdict does."""

import numpy as np
import pytest

import beaver_ftc as bf
from beaver_ftc.diagnosis.monitors.redundancy import ALPHA_TEST, BETA_TEST, RPM_TEST
from beaver_ftc.scenario.schema import load
from beaver_ftc.scenario.sensors import PRESETS

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


def test_a_heading_that_leaps_past_north_is_sound_while_a_blurred_bank_swings():
    """A scale error of the heading comes and goes there, and turns each time about another axis."""
    errors = has(psi={"scale_error": 0.01}, phi={"noise_std_deg": 0.01})
    errors["fdi"]["bounds"]["turbulence"] = "moderate"
    air = {"turbulence": "dryden", "severity": "moderate"}
    for seed in range(40):
        flight = flown(duration_s=0.3, rate_hz=92, seed=seed, environment=air, **errors)
        assert not flight.metrics["detection"]["detected"], seed


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


def test_a_gyro_that_the_rates_see_first_leaves_its_alarm_in_the_log():
    broken = {"sensor": "p", "type": "bias", "magnitude": 4, "at_s": 1.0}
    found = flown(faults=[broken], duration_s=2, fdi={"fault_class": "all"})
    log = found.log
    assert found.isolation.fault == "sensor p"
    assert (log["detected"] == (log["t_s"] >= found.metrics["detection"]["time_s"] - 1e-9)).all()


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


def test_without_a_watch_there_is_no_column_of_it_and_before_one_no_number():
    plain = bf.fly(load({"name": "x", "duration_s": 1})).log
    assert not [name for name in plain.columns if name.startswith("watch")]
    other = {"scheme": "none", "sensor_monitor": "always"}
    late = bf.fly(load({"name": "x", "duration_s": 2, "fdi": other,
                        "changes": [{"at_s": 1.0, "scheme": "adaptive-estimators"}]})).log  # fmt: skip
    assert late["watch_share"][:100].isna().all()
    assert late["watch_share"][100:].between(0.0, 1.0).all()


def test_an_angle_that_freezes_in_noise_is_no_gyros_fault():
    """It stands still for two looks when the alarm comes: a third has to say whether it is frozen."""
    turning = {axis: [{"sine": {"amplitude_deg_s": 3, "frequency_hz": 0.4}}] for axis in "pqr"}
    grade = {"sensors": "tactical-grade", "fdi": {"bounds": {"sensors": "tactical-grade"}}}
    frozen = {"sensor": "psi", "type": "freeze"}
    names = {
        bf.fly(
            load({"name": "x", "duration_s": 5, "rate_hz": 50, "seed": seed, "reference": turning,
                  "faults": [{**frozen, "at_s": 2.0 + 0.26 * seed}], **grade}), log=False
        ).isolation.fault
        for seed in range(10)
    }  # fmt: skip
    assert names <= {"sensor psi", "unanticipated", None}


@pytest.mark.parametrize(
    ("seed", "rate_hz", "broken", "coarse", "swings"),
    [
        (4, 100, ("psi", 1.2437), {"alpha": 0.0392, "beta": 0.4518, "p": 0.0039, "phi": 0.01303},
         {"p": (0.245, 0.451), "q": (1.83, 0.571), "r": (0.034, 0.233)}),
        (128, 30, ("theta", 1.6477),
         {"beta": 0.0507, "p": 0.0294, "psi": 0.51137, "r": 0.0996, "theta": 0.06574},
         {"p": (4.653, 0.989), "q": (2.7, 0.412), "r": (0.385, 0.813)}),
    ],
)  # fmt: skip
def test_no_other_is_named_for_a_frozen_angle_that_its_own_test_still_hides(
    seed, rate_hz, broken, coarse, swings
):
    sensors = {name: dict(errors) for name, errors in PRESETS["tactical-grade"].items()}
    for name, quantum in coarse.items():
        sensors[name]["quantum_deg_s" if name in "pqr" else "quantum_deg"] = quantum
    sines = {
        axis: [{"sine": {"amplitude_deg_s": size, "frequency_hz": f}}] for axis, (size, f) in swings.items()
    }
    flight = bf.fly({
        "name": "hidden", "duration_s": broken[1] + 0.6, "rate_hz": rate_hz, "seed": seed, "reference": sines,
        "environment": {"turbulence": "dryden", "severity": "severe"}, "sensors": sensors,
        "fdi": {"fault_class": "all", "bounds": {"sensors": sensors, "turbulence": "severe"}},
        "faults": [{"sensor": broken[0], "type": "freeze", "at_s": broken[1]}],
    }, log=False)  # fmt: skip
    assert flight.detection.detected
    assert flight.isolation.fault in (None, f"sensor {broken[0]}")
