"""Which columns are commands, by tables of names; and times as people and programs write them."""

import numpy as np
import pytest

from beaver_ftc.documents.errors import BadInput
from beaver_ftc_logs.check import check_log
from beaver_ftc_logs.known_commands import is_command_name
from beaver_ftc_logs.readers import check_exists, read_parts, reader_name_for_path
from beaver_ftc_logs.readers.time_text import seconds_of_text
from beaver_ftc_logs.rotorcraft import multicopter_reason
from products.logs import synthetic
from products.logs.small import run
from products.logs.test_check import KINEMATIC, RATES, T_S, logged


@pytest.mark.parametrize("name", [
    "actuator_controls_0.control[0]", "actuator_servos.control[3]", "vehicle_torque_setpoint.xyz[2]",
    "AETR.Elev", "Aileron Command (norm)", "/fdm/jsbsim/fcs/elevator-cmd-norm", "____elev,yoke1", "servo[2]",
    "servo[2] (us)", "Left Elevon", "elevon_left", "rudder_cmd", "cmd_elevator_deg", "roll_cmd", "da",
    "delta_e", "servo3", "aileron_setpoint",
])  # fmt: skip
def test_known_names_are_commands(name):
    assert is_command_name(name)


@pytest.mark.parametrize("name", [
    "actuator_armed.armed", "actuator_armed.lockdown", "actuator_controls_0.timestamp_sample",
    "actuator_controls_0.control[3]", "actuator_motors.control[0]", "CMD.Lat", "CMD.Prm1", "command_count",
    "vehicle_command.param1", "servo_status.temperature", "Elevator Position (deg)", "elevator_feedback",
    "roll_rate_cmd", "pitch_setpoint", "roll_cmd_deg", "vehicle_attitude_setpoint.roll_body",
    "aileron_timestamp", "servo_armed", "motor[0]", "rcCommand[0]", "elevator_effectiveness",
    "estimator_innovations.airspeed", "elevator_rate", "fcs/elevator-pos-rad", "ATT.DesRoll",
])  # fmt: skip
def test_flags_stamps_positions_and_setpoints_of_others_are_none(name):
    assert not is_command_name(name)


def test_what_is_derived_from_a_quantity_is_not_the_quantity(tmp_path):
    columns = {
        "t_s": T_S, "state.roll_rate": RATES[0], "state.pitch_rate": RATES[1], "state.yaw_rate": RATES[2],
        "innov.airspeed": T_S, "wind.tas_innov": T_S, "elevator_cmd": KINEMATIC["pitch_cmd"],
    }  # fmt: skip
    vehicle = check_log(synthetic.write_csv(tmp_path / "a.csv", columns), None, None)["vehicle"]
    assert vehicle["surfaces"] == {"elevator_cmd": {"elevator_cmd": 1.0}}
    assert not {"attitude", "airspeed"} & set(vehicle)


@pytest.mark.parametrize(("parameters", "names", "said"), [
    ({"MAV_TYPE": (2.0,)}, ["actuator_controls_0.control[0]"], "MAV_TYPE 2, quadrotor"),
    ({"CA_AIRFRAME": (0.0,)}, [], "CA_AIRFRAME 0, multirotor"),
    ({"MOT_SPIN_ARM": (0.1,)}, ["RCOU.C1"], "MOT_SPIN_ARM of ArduCopter"),
    ({}, [f"motor[{k}]" for k in range(4)], "motor[0] to motor[3]"),
    ({"MAV_TYPE": (1.0,), "SYS_AUTOSTART": (2100.0,)}, [], None),
    ({}, ["motor[0]", "motor[1]", "servo[2]"], None),
])  # fmt: skip
def test_a_multicopter_is_called_one(parameters, names, said):
    reason = multicopter_reason(parameters, names)
    assert reason is None if said is None else said in reason


@pytest.mark.parametrize("names", [
    "t; P (deg/s); Q (deg/s); R (deg/s); Aileron Command (norm); Phi (deg)",
    "_real,_time; ____P,rad/s; ____Q,rad/s; ____R,rad/s; ailrn,yoke1; _roll,__deg",
    "Time [ms]; gyroADC[0]; gyroADC[1]; gyroADC[2]; servo[3]; roll_deg",
    "time (ms); s.gyro_rad[0]; s.gyro_rad[1]; s.gyro_rad[2]; da; phi_deg",
    "t_ms; attitude.rollspeed; attitude.pitchspeed; attitude.yawspeed; aileron; phi_deg",
    "Time / ms; Gyro x [rad/s]; Gyro y [rad/s]; Gyro z [rad/s]; aileron; phi_deg",
    "Timestamp [ms]; roll rate [rad/s]; pitch rate [rad/s]; yaw rate [rad/s]; aileron; phi_deg",
    "time; ang_vel_x; ang_vel_y; ang_vel_z; aileron; phi_deg",
])  # fmt: skip
def test_tables_of_known_programs_are_recognised_with_their_units(tmp_path, names):
    """The throttle stands first and increases as a time does, but its name is none of a time."""
    time, *rates, command, roll = names = names.split("; ")
    in_deg, in_ms = any(name in rates[0] for name in ("deg/s", "ADC", "ang_vel")), "ms" in time
    size = 180.0 / np.pi if in_deg else 1.0
    columns = [T_S, T_S * (1e3 if in_ms else 1.0), *(size * rate for rate in RATES), KINEMATIC["roll_cmd"],
               np.rad2deg(KINEMATIC["roll_rad"])]  # fmt: skip
    rows = ["|".join(f"{cell:.9g}" for cell in row) for row in zip(*columns, strict=True)]
    (tmp_path / "a.csv").write_text("\n".join(["throttle|" + "|".join(names), *rows]) + "\n")
    vehicle = check_log(tmp_path / "a.csv", None, None)["vehicle"]
    assert vehicle["time"] == {"column": time, "unit": "ms" if in_ms else "s"}
    units = [entry["unit"] if isinstance(entry, dict) else "rad/s" for entry in vehicle["rates"].values()]
    assert units == ["deg/s" if in_deg else "rad/s"] * 3
    assert [*vehicle["surfaces"].values()] == [{command: 1.0}]
    assert vehicle["attitude"]["roll"] == {"column": roll, "unit": "deg"}


@pytest.mark.parametrize(("text", "seconds"), [
    ("0.05 sec", 0.05), ("50 ms", 0.05), ("2 min", 120.0), ("12:30:01.25", 45001.25), ("01:02", 62.0),
    ("1970-01-02T00:00:01.5Z", 86401.5), ("1970-01-01 02:00:00+02:00", 0.0), ("19700101T000010Z", 10.0),
])  # fmt: skip
def test_times_in_words_are_seconds(text, seconds):
    assert seconds_of_text(text) == pytest.approx(seconds, abs=1e-9)


@pytest.mark.parametrize(
    "text", ["", "AUTO", "3.2 deg", "12:61:99", "12:75:00", "1970-13-01T00:00:00", "7 ticks"]
)
def test_other_words_are_no_time(text):
    assert np.isnan(seconds_of_text(text))


def test_a_clock_that_passes_midnight_goes_on(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("UTC,p\n23:59:59.5,1\n23:59:59.9,2\n00:00:00.3,3\n00:00:00.7,4\n")
    stamps = next(read_parts(path, None, ("UTC", "s"))).columns["p"].t_s
    np.testing.assert_allclose(np.diff(stamps), 0.4, atol=1e-9)


def test_a_cell_that_is_no_clock_does_not_hide_midnight(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("UTC,p,clock\n0,1,23:59:59\n1,2,23:59:75\n2,3,00:00:01\n")
    clock = next(read_parts(path, None, ("UTC", "s"))).columns["clock"].values
    np.testing.assert_array_equal(clock, [86399.0, np.nan, 86401.0])


def test_a_time_that_cannot_be_read_is_quoted_and_warns_of_nothing(tmp_path, recwarn):
    path = tmp_path / "a.csv"
    path.write_text("Time,p\n0 ticks,1\n1 ticks,2\n")
    with pytest.raises(BadInput, match=r"no column of time .Time holds text such as '0 ticks'"):
        run("identify", "--check", path)
    assert not recwarn.list


@pytest.mark.parametrize("suffix", ["bin", "ulg", "csv", "parquet"])
def test_a_pointer_of_a_large_file_store_is_said_as_such(tmp_path, suffix):
    path = tmp_path / f"a.{suffix}"
    path.write_text("version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 9\n")
    with pytest.raises(BadInput, match=r"is a pointer of a large-file store .Git LFS., not the log"):
        check_exists(path)


def test_telemetry_is_refused_with_the_way_to_a_table(tmp_path):
    with pytest.raises(BadInput, match=r"is a telemetry log .*mavlogdump.py --format csv"):
        reader_name_for_path(logged(tmp_path / "a.tlog"))
