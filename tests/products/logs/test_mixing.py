"""Surfaces by the parameters of an autopilot's log, against surfaces calculated by hand."""

import json
import math

import numpy as np
import pytest

from beaver_ftc_logs.mixing import mixing_of_log
from beaver_ftc_logs.readers import read_flight
from beaver_ftc_logs.samples import resample
from beaver_ftc_logs.vehicle import Vehicle
from products.logs import synthetic
from products.logs.small import run
from products.logs.test_check import KINEMATIC

T_S = KINEMATIC["t_s"]
GYRO = {"t_s": T_S} | {
    f"Gyr{axis}": KINEMATIC[f"{rate}_rad_s"] for axis, rate in zip("XYZ", "pqr", strict=True)
}
GYRO_TOPIC = "vehicle_angular_velocity"


def servo(number, function, low_us=None, high_us=None, trim_us=None, reversed_=0):
    """Parameters of an ArduPilot output."""
    keys = "FUNCTION", "MIN", "MAX", "TRIM", "REVERSED"
    values = function, low_us, high_us, trim_us, reversed_
    return [(f"SERVO{number}_{key}", of) for key, of in zip(keys, values, strict=True) if of is not None]


def surface(number, kind, *torque):
    """Parameters of a PX4 surface; torque: in roll, pitch, yaw."""
    at = f"CA_SV_CS{number}_"
    return [(f"{at}TYPE", kind), *((f"{at}TRQ_{axis}", of) for axis, of in zip("RPY", torque, strict=False))]


ELEVONS = [
    *servo(1, 77, 1000, 2000, 1500, 1), *servo(2, 78, 1100, 1900, 1480), *servo(3, 70), *servo(4, 0),
    ("MIXING_GAIN", 0.5), ("MIXING_OFFSET", 0),
]  # fmt: skip
FIXED_WING = ("CA_AIRFRAME", 1)
PX4_ELEVONS = [
    FIXED_WING, ("CA_SV_CS_COUNT", 2), *surface(0, 5, -0.5, 0.5, 0.0), *surface(1, 6, 0.5, 0.5, 0.0),
]  # fmt: skip


def wave(low, high, rate_rad_s):
    """Commands that move between two values."""
    return 0.5 * (low + high) + 0.5 * (high - low) * np.sin(rate_rad_s * T_S)


def write_bin(path, outputs, parameters, message="RCOU"):
    """A dataflash log with a gyro, a message of outputs and parameters."""
    rows = [("PARM", {"TimeUS": 900_000, "Name": key.encode(), "Value": value}) for key, value in parameters]
    for k, t_s in enumerate(T_S):
        stamp = 1_000_000 + round(t_s * 1e6)
        rows.append(("IMU", {"TimeUS": stamp} | {key: GYRO[key][k] for key in GYRO if key != "t_s"}))
        rows.append((message, {"TimeUS": stamp} | {key: values[k] for key, values in outputs.items()}))
    return synthetic.write_dataflash(path, rows)


def write_px4(path, parameters, topics, changes=()):
    rates = {"t_s": T_S} | {f"xyz[{i}]": KINEMATIC[f"{axis}_rad_s"] for i, axis in enumerate("pqr")}
    further = {topic: {"t_s": T_S} | columns for topic, columns in topics.items()}
    return synthetic.write_ulog(path, rates, GYRO_TOPIC, further, parameters, changes)


def with_value(parameters, **values):
    """Parameters with other values; None leaves one out."""
    return [(key, values.get(key, value)) for key, value in parameters if values.get(key, value) is not None]


def proposed(path):
    document = json.loads(run("identify", "--check", path, "--format", "json").stdout)
    return document["vehicle"], document["logs"][0]["lines"]


def deflections(path, vehicle):
    """The deflection of each surface, as the fit receives it."""
    samples = resample(read_flight(path), Vehicle.model_validate(vehicle))
    return dict(zip(vehicle["surfaces"], samples.commands.T, strict=True))


def test_elevons_of_ardupilot_by_their_channels(tmp_path):
    """Of 500 us on either side of 1500, reversed, and of 400 us on either side of 1480."""
    pytest.importorskip("pymavlink")
    left, right = wave(1500.0, 2000.0, 1.1), wave(1080.0, 1880.0, 0.7)
    path = write_bin(
        tmp_path / "wing.bin", {"C1": left, "C2": right, "C3": wave(1200.0, 1300.0, 2.0)}, ELEVONS
    )
    vehicle, lines = proposed(path)
    assert vehicle["surfaces"] == {"left_elevon": {"RCOU.C1": 1.0}, "right_elevon": {"RCOU.C2": 1.0}}
    flown = deflections(path, vehicle)
    np.testing.assert_allclose(flown["left_elevon"], -(left - 1500.0) / 500.0, atol=1e-9)
    np.testing.assert_allclose(flown["right_elevon"], (right - 1480.0) / 400.0, atol=1e-9)
    assert lines[1].endswith("SERVO1_FUNCTION 77, 1000 to 2000 us, neutral at 1500 us, reversed")


def test_a_v_tail_of_ardupilot_by_the_commands_before_the_mixer(tmp_path):
    """Half of the elevator more by MIXING_OFFSET -50, the rudder added on the left, taken on the right."""
    pytest.importorskip("pymavlink")
    axes = {
        "Ail": wave(-900.0, 1800.0, 0.9),
        "Elev": wave(-450.0, 900.0, 1.3),
        "Rudd": wave(-1800.0, 450.0, 0.4),
    }
    parameters = [*servo(2, 79), *servo(4, 80), *servo(1, 4), ("MIXING_GAIN", 0.6), ("MIXING_OFFSET", -50)]
    path = write_bin(tmp_path / "tail.bin", axes, parameters, "AETR")
    vehicle, _ = proposed(path)
    flown = deflections(path, vehicle)
    elevator, rudder = 1.5 * axes["Elev"] / 4500.0, axes["Rudd"] / 4500.0
    np.testing.assert_allclose(flown["aileron"], axes["Ail"] / 4500.0, atol=1e-9)
    np.testing.assert_allclose(flown["left_vtail"], 0.6 * (elevator + rudder), atol=1e-9)
    np.testing.assert_allclose(flown["right_vtail"], 0.6 * (elevator - rudder), atol=1e-9)


def test_nothing_is_said_of_a_mixer_that_moves_nothing(tmp_path):
    pytest.importorskip("pymavlink")
    path = write_bin(tmp_path / "plain.bin", {"C1": wave(1000.0, 2000.0, 1.1)}, servo(1, 4, 1000, 2000, 1500))
    assert [line for line in proposed(path)[1] if "mixer" in line] == []


def test_elevons_of_px4_by_servos_or_pulses(tmp_path):
    """Output 3, of the third bit, is reversed."""
    pytest.importorskip("pyulog")
    left, right = wave(-0.4, 0.9, 1.1), wave(-0.7, 0.2, 0.7)
    pulses = {"output[0]": 1400.0 + 400.0 * right, "output[2]": 1500.0 - 500.0 * left}
    parameters = (
        *PX4_ELEVONS, ("PWM_MAIN_FUNC3", 201), ("PWM_MAIN_FUNC1", 202), ("PWM_MAIN_REV", 4),
        ("PWM_MAIN_MIN3", 1000), ("PWM_MAIN_MAX3", 2000), ("PWM_MAIN_MIN1", 1000), ("PWM_MAIN_MAX1", 1800),
    )  # fmt: skip
    for topic, columns in (
        ("actuator_servos", {"control[0]": left, "control[1]": right}), ("actuator_outputs", pulses),
    ):  # fmt: skip
        path = write_px4(tmp_path / "wing.ulg", parameters, {topic: columns})
        flown = deflections(path, proposed(path)[0])
        np.testing.assert_allclose(flown["left_elevon"], left, atol=1e-9)
        np.testing.assert_allclose(flown["right_elevon"], right, atol=1e-9)


def test_a_v_tail_of_px4_by_the_torques(tmp_path):
    """The tail's torques are (0.5, 0.25) and (0.5, -0.25) in pitch and yaw: their inverse is 1 and 2."""
    pytest.importorskip("pyulog")
    parameters = [
        FIXED_WING, ("CA_SV_CS_COUNT", 4), *surface(0, 7, 0.0, 0.5, 0.25), *surface(1, 8, 0.0, 0.5, -0.25),
        *surface(2, 15, 0.8, 0.0, 0.0), *surface(3, 9),
    ]  # fmt: skip
    roll, pitch, yaw = (wave(-0.1 * k, 0.3, 0.5 * k) for k in (1, 2, 3))
    torques = {f"xyz[{i}]": values for i, values in enumerate((roll, pitch, yaw))}
    path = write_px4(tmp_path / "tail.ulg", parameters, {"vehicle_torque_setpoint": torques})
    vehicle, lines = proposed(path)
    flown = deflections(path, vehicle)
    np.testing.assert_allclose(flown["left_vtail"], pitch + 2.0 * yaw, atol=1e-9)
    np.testing.assert_allclose(flown["right_vtail"], pitch - 2.0 * yaw, atol=1e-9)
    np.testing.assert_allclose(flown["aileron"], roll / 0.8, atol=1e-9)
    assert lines[0] == "surface 3 stays out: CA_SV_CS3_TYPE 9 moves the aircraft about no axis"
    hovering = with_value(parameters, CA_AIRFRAME=2)
    says = proposed(write_px4(tmp_path / "vtol.ulg", hovering, {"vehicle_torque_setpoint": torques}))[1]
    assert says[1].endswith("its output is not in the log, and CA_AIRFRAME is not 1 (fixed wing)")


def ardupilot(parameters, *columns):
    return mixing_of_log("ardupilot", {key: (float(value),) for key, value in parameters}, columns)


def px4(parameters, *columns):
    return mixing_of_log("ulog", {key: (float(value),) for key, value in parameters}, columns)


def test_flaperons_follow_what_is_left_without_flaps():
    """Flaps are added on one side and taken on the other: half the sum of the two is the aileron."""
    found = ardupilot([*servo(1, 24), *servo(6, 25)], "RCOU.C1", "RCOU.C6")
    halves = {"RCOU.C1": 0.5, "RCOU.C6": 0.5}
    assert found.surfaces == {"left_flaperon": halves, "right_flaperon": halves}


BAD = [
    ("SERVO1_FUNCTION", math.nan, "channel 1 stays out: SERVO1_FUNCTION is nan, allowed: -1 to 1000"),
    ("SERVO1_FUNCTION", 4.5, "channel 1 stays out: SERVO1_FUNCTION is 4.5, allowed: a whole number"),
    ("SERVO1_FUNCTION", 94, "channel 1 stays out: SERVO1_FUNCTION 94 is no surface"),
    ("SERVO1_MAX", None, "range and sign stay out (SERVO1_MAX is not in the log, allowed: 800 to 2200 us)"),
    ("SERVO1_MIN", 2100, "range and sign stay out (SERVO1_MIN, _TRIM, _MAX are 2100, 1500, 2000 us, allowed"),
    ("SERVO1_TRIM", 65535, "range and sign stay out (SERVO1_TRIM is 65535, allowed: 800 to 2200 us)"),
    ("SERVO1_REVERSED", 7, "range and sign stay out (SERVO1_REVERSED is 7, allowed: 0 to 1)"),
    ("MIXING_GAIN", math.nan, "elevons and V-tail stays out: MIXING_GAIN is nan, allowed: 0.05 to 5"),
    ("CA_SV_CS_COUNT", None, "CA_SV_CS_COUNT is not in the log, allowed: 1 to 8"),
    ("CA_SV_CS_COUNT", 1_000_000, "CA_SV_CS_COUNT is 1e+06, allowed: 1 to 8"),
    ("CA_SV_CS0_TYPE", math.nan, "surface 0 stays out: CA_SV_CS0_TYPE is nan, allowed: 0 to 1000"),
    ("CA_SV_CS0_TRQ_R", math.nan, "the mix of torques stays out: CA_SV_CS0_TRQ_R is nan, allowed: -1000 to"),
]  # fmt: skip


@pytest.mark.parametrize(("name", "value", "says"), BAD)
def test_a_bad_parameter_is_one_line(name, value, says):
    of, sound, columns = ardupilot, ELEVONS, ("RCOU.C1", "RCOU.C2")
    if name.startswith("CA_"):
        of, sound, columns = px4, PX4_ELEVONS, [f"actuator_servos.control[{i}]" for i in (0, 1)]
    found = of(with_value(sound, **{name: value}), *columns)
    assert sum(says in line for line in found.lines) == 1
    assert found.surfaces.get("right_elevon") == (None if "COUNT" in name else {columns[1]: 1.0})
    assert ("left_elevon" in found.surfaces) == (
        "channel 1 stays" not in says and found.surfaces != {}
    ) or "CS0" in name
    if "range" in says:
        assert found.commands[0] == {"column": "RCOU.C1", "scale": 0.0025, "offset": -3.75}


@pytest.mark.parametrize("suffix", ["bin", "log"])
def test_parameters_of_a_dataflash_log(tmp_path, suffix):
    pytest.importorskip("pymavlink")
    parameters = (*servo(1, 77), *(("SERVO1_TRIM", trim_us) for trim_us in (1500, 1500, 1520)))
    read_as = {"SERVO1_FUNCTION": (77.0,), "SERVO1_TRIM": (1500.0, 1520.0), "SERVO1_REVERSED": (0.0,)}
    if suffix == "bin":
        path = write_bin(tmp_path / "a.bin", {"C1": wave(1200.0, 1700.0, 0.8)}, parameters)
    else:
        path = synthetic.write_ardupilot(tmp_path / "a.log", GYRO, "IMU", parameters)
    for wanted in (None, (), ["IMU.GyrX"]):
        read = read_flight(path, columns=wanted)
        assert read.parameters == read_as
        assert not any("PARM" in name for name in read.columns)


def test_parameters_of_a_ulog_and_their_changes(tmp_path):
    pytest.importorskip("pyulog")
    path = write_px4(
        tmp_path / "a.ulg",
        (("CA_SV_CS_COUNT", 2), ("CA_SV_CS0_TRQ_R", 0.5), ("BAD", math.nan)),
        {"actuator_servos": {"control[0]": wave(-0.1, 0.1, 0.8)}},
        (("CA_SV_CS_COUNT", 3), ("BAD", math.nan)),
    )
    for wanted in (None, (), [f"{GYRO_TOPIC}.xyz[0]"]):
        read = read_flight(path, columns=wanted).parameters
        assert (read["CA_SV_CS_COUNT"], read["CA_SV_CS0_TRQ_R"]) == ((2.0, 3.0), (0.5,))
        assert len(read["BAD"]) == 1
    lines = mixing_of_log("ulog", read_flight(path).parameters, ()).lines
    assert "CA_SV_CS_COUNT changes in the log: its last value, 3, is used" in lines
