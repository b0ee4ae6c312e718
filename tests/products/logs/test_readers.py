"""Readers give what was written, and say in one line why a log cannot be used."""

import struct

import numpy as np
import pytest

from beaver_ftc.documents.errors import BadInput
from beaver_ftc_logs.readers import read_flight
from beaver_ftc_logs.recording import package_errors_as_bad_input
from beaver_ftc_logs.samples import _latest_and_age, load_flights_for_fit
from beaver_ftc_logs.vehicle import load_vehicle
from products.logs import synthetic


@pytest.mark.parametrize("suffix", ["csv", "parquet"])
def test_a_table_comes_back_as_it_was_written(tmp_path, suffix):
    columns = synthetic.fly(10.0)
    columns["left_effectiveness"][:5] = np.nan
    write = {"csv": synthetic.write_csv, "parquet": synthetic.write_parquet}[suffix]
    recording = read_flight(write(tmp_path / f"flight.{suffix}", columns))
    assert recording.name == "flight"
    for name, values in columns.items():
        if name != "t_s":
            np.testing.assert_array_equal(recording.columns[name].values, values)
            np.testing.assert_array_equal(recording.columns[name].t_s, columns["t_s"])


def test_an_alfa_folder(tmp_path):
    folder = synthetic.write_alfa(tmp_path / "carbonZ_left_aileron_failure", failure_s=40.0)
    recording = read_flight(folder)
    columns = recording.columns
    assert columns["p_rad_s"].t_s[:3] == pytest.approx([0.0, 0.1, 0.2], abs=1e-6)
    assert columns["roll_error_rad"].t_s[0] == pytest.approx(0.02, abs=1e-6)
    flown = synthetic.fly(60.0, seed=3, trim=(0.0, 0.0))
    np.testing.assert_allclose(columns["roll_error_rad"].values, flown["roll_command"], atol=1e-12)
    assert [(event.surface, round(event.t_s, 3)) for event in recording.logged_failures] == [
        ("left_aileron", 40.0)
    ]


def test_a_held_column_is_never_newer_than_its_row(tmp_path):
    folder = synthetic.write_alfa(tmp_path / "flight", duration_s=20.0)
    recording = read_flight(folder)
    held, age_s = _latest_and_age(recording.columns["roll_error_rad"], recording.columns["p_rad_s"].t_s)
    np.testing.assert_allclose(held[1:], recording.columns["roll_error_rad"].values[:-1])
    assert np.isnan(held[0])
    assert age_s == pytest.approx(0.08, abs=1e-6)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("time,p\n1,2\n2,3\n", "no column t_s"),
        ("t_s,p\n1,2\n1,3\n", "t_s: row 2: time does not increase"),
        ("t_s,p\n1,2\n", "has 1 rows, allowed: at least 2"),
        ("t_s,p\n1,2,3\n", "is no table that can be read"),
        ("", "is no table that can be read"),
    ],
)
def test_an_unusable_table_says_why(tmp_path, text, says):
    path = tmp_path / "flight.csv"
    path.write_text(text)
    with pytest.raises(BadInput, match=says):
        read_flight(path)


@pytest.mark.parametrize(
    ("name", "says"),
    [("missing.csv", "no such file or folder"), ("flight.xyz", "what kind of log this is cannot be seen")],
)
def test_a_path_that_is_no_log(tmp_path, name, says):
    (tmp_path / "flight.xyz").write_text("")
    with pytest.raises(BadInput, match=says):
        read_flight(tmp_path / name)


def test_a_log_without_a_named_column(tmp_path, wing):
    columns = synthetic.fly(20.0)
    del columns["roll_command"]
    path = synthetic.write_csv(tmp_path / "flight.csv", columns)
    with pytest.raises(BadInput, match="no column roll_command, allowed: a log that has it"):
        load_flights_for_fit([path], wing)


def test_every_unusable_log_is_named(tmp_path, wing):
    with pytest.raises(BadInput) as error:
        load_flights_for_fit([tmp_path / "a.csv", tmp_path / "b.csv"], wing)
    assert len(str(error.value).splitlines()) == 2


def test_rates_logged_too_slowly(tmp_path, wing):
    columns = {name: values[::5] for name, values in synthetic.fly(60.0).items()}
    with pytest.raises(BadInput, match="rates are logged at 2 Hz, allowed: at least 4 Hz"):
        load_flights_for_fit([synthetic.write_csv(tmp_path / "slow.csv", columns)], wing)


def test_a_fast_log_is_averaged_and_its_delay_said(tmp_path, wing):
    t_s = np.arange(0.0, 30.0, 0.01)
    columns = {name: np.sin(t_s) for name in synthetic.fly(5.0)} | {"t_s": t_s}
    samples = load_flights_for_fit([synthetic.write_csv(tmp_path / "fast.csv", columns)], wing)[0]
    assert samples.dt_s == pytest.approx(0.05)
    assert samples.held_age_s["p_rad_s"] == pytest.approx(0.025)
    late = np.sin(samples.t_s - 0.02)  # five stamps, 0 to 0.04 s old
    np.testing.assert_allclose(samples.rates[5:, 0], late[5:], atol=2e-3)


def test_a_ulog_comes_back_as_it_was_written(tmp_path):
    pytest.importorskip("pyulog")
    columns = synthetic.fly(10.0)
    recording = read_flight(synthetic.write_ulog(tmp_path / "flight.ulg", columns))
    for name in ("p_rad_s", "roll_command"):
        read = recording.columns[f"vehicle_rates.{name}"]
        np.testing.assert_allclose(read.t_s, columns["t_s"], atol=1e-6)
        np.testing.assert_array_equal(read.values, columns[name])


def test_an_ardupilot_log_comes_back_as_it_was_written(tmp_path):
    pytest.importorskip("pymavlink")
    columns = synthetic.fly(10.0)
    recording = read_flight(synthetic.write_ardupilot(tmp_path / "flight.log", columns))
    read = recording.columns["RATE.roll_command"]
    np.testing.assert_allclose(read.t_s, columns["t_s"], atol=1e-6)
    np.testing.assert_array_equal(read.values, columns["roll_command"])


@pytest.mark.parametrize(("name", "module"), [("a.ulg", "pyulog"), ("a.bin", "pymavlink")])
def test_a_damaged_log_says_so(tmp_path, name, module):
    pytest.importorskip(module)
    (tmp_path / name).write_bytes(b"not a log of any kind")
    with pytest.raises(BadInput, match=r"is no .* that can be read|holds no message"):
        read_flight(tmp_path / name)


def test_a_log_in_another_format_gives_the_same_samples(tmp_path, wing):
    pytest.importorskip("pyulog")
    columns = synthetic.fly(20.0)
    text = synthetic.VEHICLE
    for name in ("p_rad_s", "q_rad_s", "r_rad_s", "roll_command", "pitch_command"):
        text = text.replace(f": {name}", f": vehicle_rates.{name}").replace(
            f"[{name}", f"[vehicle_rates.{name}"
        )
    text = text.replace(", pitch_command]", ", vehicle_rates.pitch_command]")
    for name in ("roll_command", "pitch_command"):
        text = text.replace(f"{{{name}:", f"{{vehicle_rates.{name}:").replace(
            f" {name}: ", f" vehicle_rates.{name}: "
        )
    (tmp_path / "px4.yaml").write_text(text)
    path = synthetic.write_ulog(tmp_path / "flight.ulg", columns)
    one = load_flights_for_fit([path], load_vehicle(tmp_path / "px4.yaml"))[0]
    other = load_flights_for_fit([synthetic.write_csv(tmp_path / "flight.csv", columns)], wing)[0]
    np.testing.assert_array_equal(one.commands, other.commands)
    np.testing.assert_array_equal(one.rates, other.rates)


@pytest.mark.parametrize("number", ["I", "C", "Instance"])
def test_two_instances_of_a_message_are_two_sets_of_columns(tmp_path, number):
    """Two gyros that log in turn, the second with its own bias, a tenth of a step later."""
    pytest.importorskip("pymavlink")
    t_s = np.arange(80) * 0.1
    rows = [
        ("IMU", {"TimeUS": round((t + 1.0 + 0.01 * i) * 1e6), number: i, "GyrX": np.sin(t) + 0.5 * i})
        for t in t_s
        for i in (0, 1)
    ]
    columns = read_flight(synthetic.write_dataflash(tmp_path / "flight.bin", rows)).columns
    for i, name in enumerate(("IMU.GyrX", "IMU1.GyrX")):
        np.testing.assert_allclose(columns[name].t_s, t_s + 0.01 * i, atol=1e-6)
        np.testing.assert_array_equal(columns[name].values, np.sin(t_s) + 0.5 * i)
        assert columns[name].note == ""


def ulog_message(kind, body):
    return struct.pack("<HB", len(body), ord(kind)) + body


ULOG_HEAD = b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0)


@pytest.mark.parametrize(
    ("wanted", "kept", "begins_s"),
    [
        (None, {"gyro.x", "gyro.n", "gyro_1.x", "gyro_1.n", "baro_2.x", "baro_2.n"}, 2.0),
        (["gyro_1.x", "baro_2.n", "baro_2.y"], {"gyro_1.x", "baro_2.n"}, 2.0),
        (["baro_2.x"], {"baro_2.x"}, 2.02),
    ],
)
def test_every_instance_of_a_topic_of_a_ulog_and_of_each_what_is_wanted(tmp_path, wanted, kept, begins_s):
    """Two gyros and a topic whose own name ends in a number, interleaved; a whole number beside a float. Time
    counts from the first message of the topics that are read."""
    pytest.importorskip("pyulog")
    layout = "uint64_t timestamp;double x;int32_t n;"
    data = ULOG_HEAD + b"".join(ulog_message("F", f"{name}:{layout}".encode()) for name in ("gyro", "baro_2"))
    topics = (("gyro", 0, "gyro"), ("gyro", 1, "gyro_1"), ("baro_2", 0, "baro_2"))
    for number, (name, instance, _) in enumerate(topics):
        data += ulog_message("A", struct.pack("<BH", instance, number) + name.encode())
    for k in range(3):
        for number in range(len(topics)):
            stamp = 2_000_000 + 100_000 * k + 10_000 * number
            data += ulog_message(
                "D", struct.pack("<HQdi", number, stamp, 7.5 + k + 10 * number, 3 + k - 20 * number)
            )
    path = tmp_path / "flight.ulg"
    path.write_bytes(data)
    recording = read_flight(path, columns=wanted)
    assert (recording.name, set(recording.columns)) == ("flight", kept)
    assert recording.notes == (f"time counts from {begins_s:.3f} s of the autopilot's clock",)
    for number, (*_, name) in enumerate(topics):
        for field, begins, step in (("x", 7.5, 10), ("n", 3, -20)):
            if (column := recording.columns.get(f"{name}.{field}")) is not None:
                assert column.values.tolist() == [begins + k + step * number for k in range(3)]
                at_s = 2.0 - begins_s + 0.01 * number
                np.testing.assert_allclose(column.t_s, [at_s, at_s + 0.1, at_s + 0.2], atol=1e-9)


@pytest.mark.parametrize("suffix", ["bin", "BIN"])
@pytest.mark.parametrize(
    ("wanted", "kept"),
    [
        (None, {"IMU.GyrX", "IMU.Count", "IMU.I", "IMU1.GyrX", "IMU1.Count", "IMU1.I", "AHR.GyrX"}),
        (["IMU1.Count", "AHR.GyrX", "PARM.Value"], {"IMU1.Count", "AHR.GyrX"}),
    ],
)
def test_every_message_of_a_dataflash_log_that_is_of_the_flight(tmp_path, suffix, wanted, kept):
    """With a stamp, whole numbers too; parameters and texts are none, wherever a stamp stands in them."""
    pytest.importorskip("pymavlink")
    rows = [("PARM", {"TimeUS": 1_000_000, "Value": 5.0}), ("MSG", {"TimeUS": 1_100_000, "Value": 6.0})]
    for k in range(3):
        for i in (0, 1):
            stamp = 3_000_000 + 100_000 * k + 10_000 * i
            rows.append(("IMU", {"TimeUS": stamp, "I": i, "GyrX": 0.5 * k + i, "Count": k - 7 * i}))
        rows.append(("AHR", {"TimeUS": 3_050_000 + 100_000 * k, "GyrX": -2.0 * k}))
        rows.append(("OLD", {"GyrX": 9.0}))
    recording = read_flight(synthetic.write_dataflash(tmp_path / f"flight.{suffix}", rows), columns=wanted)
    assert (recording.name, set(recording.columns), recording.notes) == ("flight", kept, ())
    expected = {
        "IMU.GyrX": [0.0, 0.5, 1.0], "IMU.Count": [0, 1, 2], "IMU.I": [0] * 3, "IMU1.GyrX": [1.0, 1.5, 2.0],
        "IMU1.Count": [-7, -6, -5], "IMU1.I": [1] * 3, "AHR.GyrX": [0.0, -2.0, -4.0],
    }  # fmt: skip
    for name, column in recording.columns.items():
        assert column.values.tolist() == expected[name]
        late_s = {"IMU": 0.0, "IMU1": 0.01, "AHR": 0.05}[name.partition(".")[0]]
        np.testing.assert_allclose(column.t_s, [late_s, late_s + 0.1, late_s + 0.2], atol=1e-9)


def test_a_field_that_a_later_message_lacks_is_no_number_there(tmp_path):
    """As in a log as text, whose writer says the format of a message again, with fewer fields."""
    pytest.importorskip("pymavlink")
    lines = [
        "FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format,Columns",
        "FMT, 140, 19, RATE, Qff, TimeUS,P,Q",
        "RATE, 1000000, 1.5, 2.5",
        "FMT, 140, 15, RATE, Qf, TimeUS,Q",
        "RATE, 1100000, 4.5",
        "RATE, 1200000, 5.5",
    ]
    path = tmp_path / "flight.LOG"
    path.write_text("\n".join(lines) + "\n")
    columns = read_flight(path).columns
    assert columns.keys() == {"RATE.P", "RATE.Q"}
    np.testing.assert_array_equal(columns["RATE.P"].values, [1.5, np.nan, np.nan])
    assert columns["RATE.Q"].values.tolist() == [2.5, 4.5, 5.5]


@pytest.mark.parametrize(
    ("suffix", "own"), [("ulg", ("timestamp", "us")), ("log", ("TimeUS", "us")), ("alfa", ("%time", "ns"))]
)
def test_a_log_that_says_its_time_itself_may_be_told_that_time_and_no_other(tmp_path, suffix, own):
    pytest.importorskip("pyulog"), pytest.importorskip("pymavlink")
    columns = {name: values[:5] for name, values in synthetic.fly(2.0).items()}
    path = tmp_path / f"flight.{suffix}"
    if suffix == "alfa":
        synthetic.write_alfa(path, duration_s=2.0)
    else:
        {"ulg": synthetic.write_ulog, "log": synthetic.write_ardupilot}[suffix](path, columns)
    told, plain = read_flight(path, None, own), read_flight(path)
    assert list(told.columns) == list(plain.columns)
    assert plain.columns
    for other in ((own[0], "ms"), ("t", own[1])):
        with pytest.raises(BadInput) as refused:
            read_flight(path, None, other)
        says = f"{path}: time: {other[0]} in {other[1]} is not its time, allowed: {own[0]} in {own[1]}"
        assert str(refused.value) == says


def stumble(error):
    print("what a package prints stays here")
    raise error


@pytest.mark.parametrize(
    ("error", "reason"),
    [
        (ValueError("a header\n  of no\tsense"), "a header of no sense"),
        (struct.error(""), "error"),
        (KeyError(140), "140"),
    ],
)
def test_what_a_package_stumbles_over_is_one_line(tmp_path, capsys, error, reason):
    with (
        pytest.raises(BadInput) as refused,
        package_errors_as_bad_input(tmp_path, "logbook", "pylogbook", "a .book of a ship"),
    ):
        stumble(error)
    says = f"{tmp_path}: is no logbook that can be read ({reason}), allowed: a .book of a ship"
    assert str(refused.value) == says
    assert capsys.readouterr().out == ""


def test_a_ulogs_messages_without_a_stamp_are_left_out(tmp_path):
    """Of three one has no stamp, and one never came."""
    pytest.importorskip("pyulog")

    data = ULOG_HEAD
    names = {"good": "uint64_t timestamp;", "timeless": "", "silent": "uint64_t timestamp;"}
    for name, stamp in names.items():
        data += ulog_message("F", f"{name}:{stamp}double x;".encode())
    for number, name in enumerate(names):
        data += ulog_message("A", struct.pack("<BH", 0, number) + name.encode())
    for k in range(3):
        data += ulog_message("D", struct.pack("<HQd", 0, 1_000_000 + 100_000 * k, 7.0 + k))
    data += ulog_message("D", struct.pack("<Hd", 1, 9.0))
    path = tmp_path / "flight.ulg"
    path.write_bytes(data)
    (column,) = read_flight(path).columns.values()
    assert column.values.tolist() == [7.0, 8.0, 9.0]
    assert column.t_s == pytest.approx([0.0, 0.1, 0.2])


@pytest.mark.parametrize("suffix", ["ulg", "bin", "log"])
def test_a_log_without_any_wanted_column_says_which_it_has(tmp_path, suffix):
    pytest.importorskip("pyulog"), pytest.importorskip("pymavlink")
    path = tmp_path / f"flight.{suffix}"
    columns = {"t_s": np.arange(3) / 10.0, "P": np.ones(3), "Q": np.ones(3)}
    if suffix == "bin":
        synthetic.write_dataflash(path, [("RATE", {"TimeUS": k, "P": 1.0, "Q": 1.0}) for k in range(3)])
    else:
        {"ulg": synthetic.write_ulog, "log": synthetic.write_ardupilot}[suffix](path, columns, "RATE")
    for nothing in ((), ["ATT.Roll"]):
        found = read_flight(path, columns=nothing).columns
        assert list(found) == ["RATE.P", "RATE.Q"]
        assert not any(column.t_s.size or column.values.size for column in found.values())
    (tmp_path / "wing.yaml").write_text(synthetic.vehicle("ATT"))
    with pytest.raises(BadInput, match=r"no column ATT\.p_rad_s, .* it has RATE\.P, RATE\.Q$"):
        load_flights_for_fit([path], load_vehicle(tmp_path / "wing.yaml"))


@pytest.mark.parametrize("suffix", ["ulg", "bin"])
@pytest.mark.parametrize(
    ("wanted", "kept"),
    [
        (["RATE.P", "RATE.X"], ["RATE.P"]),  # one field is misspelt
        (["RATE.P", "ACC.Z"], ["RATE.P"]),  # a whole topic is missing
        (["RATE.X", "RATE.Y"], []),  # the topic is there, no field of it
    ],
)
def test_a_log_that_lacks_a_wanted_column_gives_the_names_of_all(tmp_path, suffix, wanted, kept):
    """Two topics, of which one may be not wanted."""
    pytest.importorskip("pyulog"), pytest.importorskip("pymavlink")
    path, topics = tmp_path / f"flight.{suffix}", {"RATE": ("P", "Q"), "BARO": ("Alt", "Temp")}
    if suffix == "bin":
        stamps = enumerate([1_000_000, 1_100_000, 1_200_000])
        rows = [(topic, {"TimeUS": at, **dict.fromkeys(topics[topic], k + 0.5)})
                for k, at in stamps for topic in topics]  # fmt: skip
        synthetic.write_dataflash(path, rows)
    else:
        data = ULOG_HEAD
        for topic, fields in topics.items():
            layout = "".join(f"double {field};" for field in fields)
            data += ulog_message("F", f"{topic}:uint64_t timestamp;{layout}".encode())
        for number, topic in enumerate(topics):
            data += ulog_message("A", struct.pack("<BH", 0, number) + topic.encode())
        for k in range(3):
            for number in range(len(topics)):
                data += ulog_message(
                    "D", struct.pack("<HQdd", number, 1_000_000 + 100_000 * k, k + 0.5, k + 0.5)
                )
        path.write_bytes(data)
    found = read_flight(path, columns=wanted)
    names = {f"{topic}.{field}" for topic, fields in topics.items() for field in fields}
    assert {*found.columns, *found.unread_column_names} == names
    assert [name for name, column in found.columns.items() if column.values.size] == kept
    for name in kept:
        assert found.columns[name].values.tolist() == [0.5, 1.5, 2.5]
    wing = synthetic.vehicle("RATE", {"p_rad_s": "P"})
    (tmp_path / "wing.yaml").write_text(wing)
    it_has = r"no column RATE\.q_rad_s, .* it has (?=.*RATE\.Q)(?=.*BARO\.Alt)(?=.*RATE\.P)"
    with pytest.raises(BadInput, match=it_has):
        load_flights_for_fit([path], load_vehicle(tmp_path / "wing.yaml"))


def test_a_ulog_without_a_message_of_the_wanted_topic_gives_the_names_of_others(tmp_path):
    """The format of the wanted topic is in the log's head, as autopilots write it for every topic."""
    pytest.importorskip("pyulog")
    data = ULOG_HEAD
    for topic in ("RATE", "BARO"):
        data += ulog_message("F", f"{topic}:uint64_t timestamp;double P;".encode())
    data += ulog_message("A", struct.pack("<BH", 0, 0) + b"BARO")
    data += ulog_message("D", struct.pack("<HQd", 0, 1_000_000, 2.5))
    path = tmp_path / "flight.ulg"
    path.write_bytes(data)
    assert list(read_flight(path, columns=["RATE.P"]).columns) == ["BARO.P"]


@pytest.mark.parametrize("block_bytes", [1, 100, 240])
def test_a_ulog_in_blocks_is_the_ulog(tmp_path, monkeypatch, block_bytes):
    """Blocks of one message, of some, and one that ends before the log does; rows of 24 bytes."""
    pytest.importorskip("pyulog")
    from beaver_ftc_logs.readers import ulog_blocks

    columns = {"t_s": np.arange(25) / 10.0, "P": np.arange(25) * 0.1, "Q": -np.arange(25.0)}
    path = synthetic.write_ulog(tmp_path / "flight.ulg", columns, "RATE")
    monkeypatch.setattr(ulog_blocks, "_BLOCK_BYTES", block_bytes)
    for wanted in (None, ["RATE.Q"]):
        found = read_flight(path, columns=wanted).columns
        assert list(found) == (wanted or ["RATE.P", "RATE.Q"])
        for name, column in found.items():
            assert column.values.tolist() == columns[name[-1]].tolist()
            np.testing.assert_allclose(column.t_s, columns["t_s"], atol=1e-9)


@pytest.mark.parametrize(
    ("stamps_us", "origin_us"),
    [
        ([500_000, 700_000, 700_000, 900_000], 500_000),  # a stamp twice is no damage
        ([9_000_000, 600_000, 700_000, 800_000], 600_000),  # the first is damaged
        ([500_000, 100_000, 600_000, 700_000], 500_000),  # one comes late
        ([2_500_000, 400_000, 450_000, 2_600_000, 300_000], 400_000),  # the first and the last are damaged
    ],
)
@pytest.mark.parametrize("wanted", [None, ["RATE.P"]])
def test_time_counts_from_the_first_message_in_order_of_those_that_are_not_wanted_too(
    tmp_path, stamps_us, origin_us, wanted
):
    pytest.importorskip("pymavlink")
    rows = [("IMU", {"TimeUS": stamp, "G": 1.0}) for stamp in stamps_us]
    rows += [("RATE", {"TimeUS": 2_000_000 + 100_000 * k, "P": 1.0 * k}) for k in range(3)]
    found = read_flight(synthetic.write_dataflash(tmp_path / "flight.bin", rows), columns=wanted)
    expected_s = (np.array([2_000_000, 2_100_000, 2_200_000]) - origin_us) * 1e-6
    np.testing.assert_allclose(found.columns["RATE.P"].t_s, expected_s, atol=1e-9)


def dataflash_format(number, size, name, codes, fields):
    return b"\xa3\x95\x80" + struct.pack("<BB4s16s64s", number, size, name, codes, fields)


def test_a_dataflash_log_with_numbers_in_hundredths_words_and_damage(tmp_path):
    """Messages before their format, and bytes of none between messages; the last one is cut off."""
    pytest.importorskip("pymavlink")
    data = b""
    for k in range(4):
        body = struct.pack("<Q4shBi", 1_000_000 + 100_000 * k, b"word", -150 + k, 7, 473_000_000 + k)
        data += b"\xa3\x95\x82" + body + (b"\xa3\x95\x00junk" if k == 1 else b"")
    data = dataflash_format(0x80, 89, b"FMT", b"BBnNZ", b"Type,Length,Name,Format,Columns") + data
    data += dataflash_format(0x82, 3 + 19, b"POS", b"QncML", b"TimeUS,Name,Roll,Mode,Lat")
    path = tmp_path / "flight.bin"
    path.write_bytes(data + b"\xa3\x95\x82" + bytes(10))
    for wanted in (None, ["POS.Lat", "POS.Mode", "POS.Roll"]):
        columns = read_flight(path, columns=wanted).columns
        assert list(columns) == ["POS.Roll", "POS.Mode", "POS.Lat"]
        assert columns["POS.Roll"].values.tolist() == [-1.5, -1.49, -1.48, -1.47]
        assert columns["POS.Mode"].values.tolist() == [7.0] * 4
        assert columns["POS.Lat"].values == pytest.approx([47.3 + 1e-7 * k for k in range(4)], abs=1e-12)
        np.testing.assert_allclose(columns["POS.Lat"].t_s, [0.0, 0.1, 0.2, 0.3], atol=1e-9)


@pytest.mark.parametrize(
    ("size", "codes", "says"),
    [
        (20, b"QY", "Unsupported format char: 'Y' in message ODD"),
        (2, b"", "a message ODD would have 2 bytes"),
    ],
)
def test_a_format_of_no_sense_is_one_line(tmp_path, size, codes, says):
    pytest.importorskip("pymavlink")
    path = synthetic.write_dataflash(tmp_path / "flight.bin", [("RATE", {"TimeUS": 1, "P": 1.0})])
    path.write_bytes(path.read_bytes() + dataflash_format(200, size, b"ODD", codes, b"TimeUS,Y"))
    with pytest.raises(BadInput, match=rf"is no dataflash log that can be read \({says}\)"):
        read_flight(path)
