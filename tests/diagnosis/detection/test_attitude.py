"""With sensors in doubt, a surface is named once the attitude shows its turn; a broken gyro is no surface."""

from pathlib import Path

import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

import beaver_ftc as bf
from beaver_ftc.diagnosis.detection.attitude import attitude_dtype, compare_attitude, configure_attitude
from beaver_ftc.diagnosis.detection.blocks import LOSS, N_FILTER_BLOCKS, BlockCapacity, block_dtype
from beaver_ftc.scenario.declared import SensorErrors
from beaver_ftc.scenario.schema import Scenario

SWEEPS = Path(__file__).parents[3] / "scenarios" / "sweeps"
SWEEP = yaml.safe_load((SWEEPS / "robust-elevator-all.yaml").read_text(encoding="utf-8"))
DT_S, N = 0.01, 300
D = np.array([[5.0, 0.1, -2.0], [0.0, 3.0, 0.0], [0.3, 0.0, 0.7]])


ERRORS = SensorErrors(Scenario(name="x", sensors="tactical-grade").sensors)


def compared(gyro_error, fault, eta=0.0):
    """Largest score after each frame: gyro_error (N, 3) rad/s, fault (N, 3) rad/s2, bound eta rad/s2.

    Rates and attitude are exact but for the gyros; they follow x' = phi - D x."""
    capacity = BlockCapacity(1, 1)
    att, blocks = np.zeros(1, attitude_dtype(capacity)), np.zeros(N_FILTER_BLOCKS, block_dtype(capacity))
    configure_attitude(att[0], D, ERRORS, 16.0, DT_S)
    for block, axes in zip(blocks, ((1, 0), (0, 2), (0, 2)), strict=True):
        block["axes"], block["n"], block["a"] = axes, len(set(axes)), 1.0
        block["Q_d"], block["n_h"] = 1e-6 * np.eye(2), 1
        block["hypothesis"]["kind"], block["hypothesis"]["signature"] = LOSS, (1.0, -1.0)
    x, found = np.zeros(3), []
    for e, e_before, phi in zip(gyro_error, [np.zeros(3), *gyro_error[:-1]], fault, strict=True):
        read, x = x + e_before, x + DT_S * (phi - D @ x)
        nu = (x + e - read) / DT_S + D @ read
        att["turn"] = -DT_S * e_before
        blocks[0]["nu"][0], blocks[1]["nu"] = nu[1], nu[[0, 2]]
        records = att.view(np.recarray)[0], blocks.view(np.recarray)
        compare_attitude(*records, np.full(3, eta), read, DT_S, True)
        found.append((float(att["score"][0]), int(att["gyro"][0])))
    return np.array(found).T


@settings(max_examples=20, deadline=None)
@given(axis=st.integers(0, 2), size=st.floats(0.01, 0.3), onset=st.integers(5, 100),
       course=st.sampled_from(["step", "ramp", "sine", "noise"]))  # fmt: skip
def test_an_error_of_a_gyro_leaves_nothing_whatever_its_course(axis, size, onset, course):
    t = DT_S * np.arange(N - onset)
    e = np.zeros((N, 3))
    e[onset:, axis] = size * {
        "step": np.ones_like(t), "ramp": t, "sine": np.sin(6.0 * t),
        "noise": np.random.default_rng(onset).normal(size=t.size),
    }[course]  # fmt: skip
    score, gyro = compared(e, np.zeros((N, 3)))
    assert score.max() < 0.2
    assert set(gyro) == {-1, axis}


@pytest.mark.parametrize("axis", range(3))
def test_a_fault_of_a_surface_is_left_and_grows_with_its_turn(axis):
    phi = np.zeros((N, 3))
    phi[50:, axis] = 0.1
    score, gyro = compared(np.zeros((N, 3)), phi)
    assert set(gyro) == {-1}
    assert score[:50].max() < 1e-9
    assert score.max() > 1.0
    twice, _ = compared(np.zeros((N, 3)), 2.0 * phi)
    assert np.flatnonzero(twice > 1.0)[0] < np.flatnonzero(score > 1.0)[0]


@pytest.mark.parametrize("phi", [(0.1, 0.1, 0.1), (0.1, 0.1, -0.1)])
def test_what_is_within_the_bound_of_each_axis_is_no_fault(phi):
    score, _ = compared(np.zeros((N, 3)), np.tile(phi, (N, 1)), 0.1)
    assert score.max() < 0.01


def scenario(fault, **more):
    """The declared errors of robust-elevator-all, with sensors in doubt."""
    given = {key: of for key, of in SWEEP["set"].items() if key not in ("expect", "uncertainty")}
    data = bf.load(SWEEP["base"]).model_dump(mode="json", by_alias=True, exclude_unset=True)
    data = {**data, **given, "expect": {}, "duration_s": 14, "faults": [fault | {"at_s": 5.0}], **more}
    return bf.load(data | {"fdi": given["fdi"] | {"sensor_monitor": "always"}})


@pytest.mark.parametrize(("surface", "magnitude"), [("elevator", 0.4), ("rudder", 0.8), ("rudder", 0.45)])
def test_a_loss_is_named_in_turbulence_with_sensors_in_doubt(surface, magnitude):
    loss = {"type": "loss_of_effectiveness", "actuator": surface, "magnitude": magnitude}
    assert bf.fly(scenario(loss, seed=3)).metrics["isolation"]["fault"] == surface


@pytest.mark.parametrize("seed", [5, 9])
def test_a_small_loss_is_told_from_the_flap_with_accelerometers_in_doubt(seed):
    loss = {"type": "loss_of_effectiveness", "actuator": "elevator", "magnitude": 0.41}
    flight = bf.fly(scenario(loss, seed=seed).with_({"fdi.fault_class": "all"}))
    assert flight.metrics["isolation"]["names"] == ["elevator"]


@pytest.mark.parametrize("seed", [12, 19])
def test_a_frozen_accelerometer_is_no_flap(seed):
    freeze = {"type": "freeze", "sensor": "az"}
    flight = bf.fly(scenario(freeze, seed=seed).with_({"fdi.fault_class": "all"}))
    assert "flap" not in flight.metrics["isolation"]["names"]


@pytest.mark.parametrize("sensor", ["ay", "az"])
def test_no_alarm_rests_on_accelerometers_in_doubt(sensor):
    """Before any alarm, a flight with a broken one differs by the monitor's own test alone."""
    noise = {"type": "noise", "sensor": sensor, "magnitude": 0.3}
    broken = scenario(noise, seed=12).with_({"fdi.fault_class": "all", "duration_s": 8.0})
    found, sound = (bf.fly(each).log for each in (broken, broken.with_({"faults": []})))
    assert found["detected"].max() == 0.0
    other = [name for name in found if not np.array_equal(found[name], sound[name], equal_nan=True)]
    assert other == ["watch_share"]


BROKEN = [(gyro, size) for gyro in "pqr" for size in (0.5, 2.0)] + [("alpha", 2.0), ("beta", 2.0)]


@pytest.mark.parametrize(("sensor", "magnitude"), BROKEN)
def test_a_broken_sensor_is_named_and_is_no_surface(sensor, magnitude):
    fault = {"type": "bias", "sensor": sensor, "magnitude": magnitude}
    flight = bf.fly(scenario(fault, seed=11))
    isolation = flight.metrics["isolation"]
    assert not {"elevator", "rudder", "aileron", "flap"} & {*isolation["names"]}
    assert isolation["fault"] == f"sensor {sensor}"
    assert isolation["delay_s"] < 5.0


@pytest.mark.parametrize("pairs", [False, True])
def test_nothing_is_concluded_while_a_gyro_may_be_the_cause(pairs):
    """A gyro reads a fifth too much, and the attitude is too noisy to show whether the aircraft turned."""
    noisy = {angle: {"noise_std_deg": 0.3} for angle in ("phi", "theta", "psi")}
    scenario = bf.load(
        {
            "name": "gyro-in-doubt",
            "duration_s": 12,
            "seed": 79,
            "reference": {axis: [{"sine": {"amplitude_deg_s": 4, "frequency_hz": 0.25}}] for axis in "pqr"},
            "sensors": noisy,
            "faults": [{"sensor": "q", "type": "scale", "magnitude": 0.207, "at_s": 5}],
            "fdi": {"fault_class": "all", "pairs": pairs, "bounds": {"sensors": noisy}},
        }
    )
    metrics = bf.fly(scenario).metrics
    assert metrics["detection"]["detected"]
    assert metrics["isolation"]["names"] == []
