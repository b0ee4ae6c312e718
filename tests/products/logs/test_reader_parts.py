"""What the readers of ALFA and of tables make of small files: every column, event and refusal."""

import numpy as np
import pytest

from beaver_ftc.documents.errors import BadInput
from beaver_ftc_logs.readers import alfa, read_flight

ORIGIN_NS = 1_538_768_543_780_097_959


def write(folder, topic, *rows, header="%time,field.x"):
    stamps = ["nan" if np.isnan(t_s) else str(ORIGIN_NS + round(t_s * 1e9)) for t_s, *_ in rows]
    lines = [",".join([at, *map(str, cells)]) for at, (_, *cells) in zip(stamps, rows, strict=True)]
    (folder / f"{folder.name}-{topic}.csv").write_text("\n".join([header, *lines]) + "\n")


@pytest.fixture
def folder(tmp_path):
    """Two samples of every topic, each field another number."""
    root = tmp_path / "carbonZ"
    root.mkdir()
    topics = {}
    for i, (topic, field, _) in enumerate(alfa._alfa_names()["columns"].values()):
        topics.setdefault(topic, []).append((field, 1500.0 + 10.0 * i if "channels" in field else 1.0 + i))
    for k, (topic, fields) in enumerate(topics.items()):
        header = ",".join(["%time", *(field for field, _ in fields)])
        begin = 0.001 * k
        write(root, topic, *((t, *(v + t for _, v in fields)) for t in (begin, begin + 0.5)), header=header)
    return root


def test_every_column_of_alfa(changed, folder):
    """In SI: attitudes in radians, pulses as shares of 400 us about 1500."""
    columns = read_flight(folder).columns
    assert not changed({name: [column.t_s, column.values, column.note] for name, column in columns.items()})
    error = columns["roll_command_rad"].values - columns["roll_rad"].values
    np.testing.assert_array_equal(columns["roll_error_rad"].values, error)
    assert columns["elevator_output"].values[0] == pytest.approx(
        (140.0 + columns["elevator_output"].t_s[0]) / 400.0
    )
    assert columns["pitch_rad"].values[0] == pytest.approx(np.deg2rad(10.0 + columns["pitch_rad"].t_s[0]))


def test_failures_of_alfa_in_their_order(folder):
    head = "%time,field.data"
    write(folder, "failure_status-aileron", (9.0, 2.0), (9.5, 2.0), (10.0, 1.0), (11.0, "nan"), header=head)
    write(folder, "failure_status-engines", (8.0, 1.0), header=head)
    write(folder, "failure_status-rudder", (7.0, 1.0), (np.nan, 2.0), header=head)
    write(folder, "failure_status-elevator", header=head)
    write(folder, "failure_status-aileron", (9.0, 2.0), (9.5, 2.0), (10.0, 1.0), header=head)
    events = [(round(event.t_s, 6), event.surface) for event in read_flight(folder).logged_failures]
    assert events == [(7.0, "rudder"), (8.0, "engine"), (9.0, "left_aileron"), (10.0, "right_aileron")]


def test_what_is_no_flight_of_alfa(tmp_path):
    (tmp_path / "empty").mkdir()
    with pytest.raises(
        BadInput, match="no mavros-imu-data_raw topic, allowed: a processed folder of the ALFA"
    ):
        alfa.read(tmp_path / "empty")
    (tmp_path / "file.csv").write_text("")
    with pytest.raises(BadInput, match="is a file, allowed: a folder of the ALFA"):
        alfa.read(tmp_path / "file.csv")


NAN = np.nan
TABLES = {
    "numbers as they may be written": (
        "t_s,p,q\n+0.5,.5,5.\n1,-1.5e3,+2E-2\n2, 7 ,inf\n3,nan,-8\n",
        {"p": [0.5, -1500.0, 7.0, NAN], "q": [5.0, 0.02, NAN, -8.0]},
        [0.5, 1.0, 2.0, 3.0], (), {},
    ),
    "a mark and a mark of bytes before the names": (
        "\ufeff# t_s , p \n1,2\n2,3\n", {"p": [2.0, 3.0]}, [1.0, 2.0], (), {},
    ),
    "bars": (
        "t_s|p, of roll|word\n1|2|a\n2|3|b\n", {"p, of roll": [2.0, 3.0], "word": [NAN, NAN]}, [1.0, 2.0],
        ("cells are parted by bars",), {},
    ),
    "a decimal comma below other lines, with text and a short line": (
        "a logger; of 3\n\nt_s;p;q\n1,5;oops, a word longer than thirty letters;3\n2,75;3,5;worse\n"
        + "".join(f"{k};{k},25;{-k}\n" for k in range(3, 12))
        + "12;4,5\n",
        {"p": [NAN, 3.5, *(k + 0.25 for k in range(3, 12))], "q": [3.0, NAN, *range(-3, -12, -1)]},
        [1.5, 2.75, *range(3, 12)],
        (
            "names are in line 3, what is above is left out",
            "cells are parted by semicolons, with a decimal comma",
            "lines with too few or too many cells, left out: 1",
        ),
        {
            "p": "p: 1 cell holds no number, the first in row 1: 'oops. a word longer than thirt'",
            "q": "q: 1 cell holds no number, the first in row 2: 'worse'",
        },
    ),
    "two rows of units below the names, of a table with tabs": (
        "t_s\tp\ns\trad/s\n-\t-\n1\t2\n2\t3\n3\t4\n4\t5\n", {"p": [2.0, 3.0, 4.0, 5.0]}, [1.0, 2.0, 3.0, 4.0],
        ("cells are parted by tabs", "t_s: rows without a number, left out: 2 of 6"),
        {"p": "p: 2 cells hold no number, the first in row 1: 'rad/s'"},
    ),
    "more commas in a line of text than names below it": (
        "made by a, b, c, d\nt_s;p\n1;2\n2;3\n", {"p": [2.0, 3.0]}, [1.0, 2.0],
        ("names are in line 2, what is above is left out", "cells are parted by semicolons"), {},
    ),
    "as many rows without a time as with one": (
        "t_s,p\n,1\n1,2\n,3\n2,4\n", {"p": [2.0, 4.0]}, [1.0, 2.0],
        ("t_s: rows without a number, left out: 2 of 4",), {},
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", TABLES)
def test_a_table_is_read_whole_as_it_is_written(tmp_path, name):
    """Every column but the time, the stamps, and each remark on the whole and on a column."""
    written, columns, t_s, notes, remarks = TABLES[name]
    (tmp_path / "log.txt").write_text(written)
    found = read_flight(tmp_path / "log.txt")
    assert (found.name, found.notes, list(found.columns)) == ("log", notes, list(columns))
    for column_name, column in found.columns.items():
        np.testing.assert_array_equal(column.values, columns[column_name])
        np.testing.assert_array_equal(column.t_s, t_s)
        assert column.note == remarks.get(column_name, "")


NO_TABLES = {
    "UTF-16 of the other order": (
        b"\xfe\xff" + "t_s,p\n1,2\n".encode("utf-16-be"), "is written in UTF-16, not in UTF-8",
    ),
    "nothing": (b"  \n\n", "it is empty"),
    "numbers alone": (b"1;2;3\n2;3;4\n", "its first line holds numbers and no names: '1;2;3'"),
    "more than a tenth broken": (
        b"t_s,p\n" + b"".join(b"%d,1\n" % k for k in range(17)) + b"18\n19,a line of " + 60 * b"x" + b",3\n",
        "2 of 19 lines have another number of cells than the header, 2: the first '18'",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", NO_TABLES)
def test_what_is_no_table_is_told_by_what_it_is(tmp_path, name):
    content, says = NO_TABLES[name]
    path = tmp_path / "log.csv"
    path.write_bytes(content)
    with pytest.raises(BadInput) as refused:
        read_flight(path)
    assert str(refused.value) == f"{path}: is no table that can be read ({says}), allowed: CSV or Parquet"
