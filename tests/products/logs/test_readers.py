"""Readers give what was written, and say in one line why a log cannot be used."""

import struct

import numpy as np
import pytest

from beaver_ftc.documents.errors import BadInput
from beaver_ftc_logs.loading import load_flights_for_fit
from beaver_ftc_logs.readers import read_flight
from products.logs import synthetic


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("time,p\n1,2\n2,3\n", "no column t_s"),
        ("t_s,p\n1,2\n1,3\n", "t_s: row 2: time does not increase"),
        ("t_s,p\n1,2\nx,2\n1,3\n", "t_s: row 3: time does not increase"),  # the row without a time counts
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


def test_every_unusable_log_is_named(tmp_path, wing):
    with pytest.raises(BadInput) as error:
        load_flights_for_fit([tmp_path / "a.csv", tmp_path / "b.csv"], wing)
    assert len(str(error.value).splitlines()) == 2


def test_a_fast_log_is_averaged_and_its_delay_said(tmp_path, wing):
    t_s = np.arange(0.0, 30.0, 0.01)
    columns = {name: np.sin(t_s) for name in synthetic.fly(5.0)} | {"t_s": t_s}
    samples = load_flights_for_fit([synthetic.write_csv(tmp_path / "fast.csv", columns)], wing)[0]
    assert samples.dt_s == pytest.approx(0.05)
    assert samples.held_age_s["p_rad_s"] == pytest.approx(0.025)
    late = np.sin(samples.t_s - 0.02)  # five stamps, 0 to 0.04 s old
    np.testing.assert_allclose(samples.rates[5:, 0], late[5:], atol=2e-3)
    unlabelled = dict(list(columns.items())[:-2])
    samples = load_flights_for_fit([synthetic.write_csv(tmp_path / "plain.csv", unlabelled)], wing)[0]
    assert samples.dt_s == pytest.approx(0.01)


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
