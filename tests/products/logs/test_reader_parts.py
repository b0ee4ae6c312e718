"""What the readers make of small files: every column, event and refusal."""

import os
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pyarrow as pa
import pytest
from pyarrow import parquet

from beaver_ftc.documents.errors import BadInput
from beaver_ftc_logs.readers import alfa, ardupilot, read_flight, table, text, ulog
from beaver_ftc_logs.recording import columns_and_time_origin
from products.logs import synthetic

GYRO_HEADER = "%time,field.angular_velocity.x"
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


def test_without_what_is_measured_there_is_no_error_of_attitude(folder):
    (folder / f"{folder.name}-mavros-nav_info-roll.csv").unlink()
    columns = read_flight(folder).columns
    assert "roll_error_rad" not in columns
    assert "pitch_error_rad" in columns


def test_failures_of_alfa_in_their_order(folder):
    head = "%time,field.data"
    write(folder, "failure_status-aileron", (9.0, 2.0), (9.5, 2.0), (10.0, 1.0), (11.0, "nan"), header=head)
    write(folder, "failure_status-engines", (8.0, 1.0), header=head)
    write(folder, "failure_status-rudder", (7.0, 1.0), (np.nan, 2.0), header=head)
    write(folder, "failure_status-elevator", header=head)
    write(folder, "failure_status-aileron", (9.0, 2.0), (9.5, 2.0), (10.0, 1.0), header=head)
    events = [(round(event.t_s, 6), event.surface) for event in read_flight(folder).logged_failures]
    assert events == [(7.0, "rudder"), (8.0, "engine"), (9.0, "left_aileron"), (10.0, "right_aileron")]


def test_time_of_alfa_counts_from_the_first_row_of_the_gyro_that_is_in_order(folder):
    """Whose own first row has a stamp from far ahead; a failure counts from there too."""
    write(folder, "mavros-imu-data_raw", (99.0, 1.0), (2.0, 2.0), (2.5, 3.0), header=GYRO_HEADER)
    write(folder, "failure_status-rudder", (9.0, 1.0), header="%time,field.data")
    recording = read_flight(folder)
    gyro, roll = recording.columns["p_rad_s"], recording.columns["roll_rad"]
    np.testing.assert_allclose(gyro.t_s, [0.0, 0.5], atol=1e-6)
    assert gyro.values.tolist() == [2.0, 3.0]
    assert gyro.note == "mavros-imu-data_raw: row 1: its stamp is out of order, the row is left out"
    np.testing.assert_allclose(roll.t_s, [-1.999, -1.499], atol=1e-6)
    assert [(round(event.t_s, 6), event.surface) for event in recording.logged_failures] == [(7.0, "rudder")]


def test_what_is_no_flight_of_alfa(tmp_path):
    (tmp_path / "empty").mkdir()
    with pytest.raises(
        BadInput, match="no mavros-imu-data_raw topic, allowed: a processed folder of the ALFA"
    ):
        alfa.read(tmp_path / "empty")
    (tmp_path / "file.csv").write_text("")
    with pytest.raises(BadInput, match="is a file, allowed: a folder of the ALFA"):
        alfa.read(tmp_path / "file.csv")


@pytest.mark.parametrize("module", ["pyulog", "pymavlink"])
def test_without_its_extra_a_log_says_what_to_install(tmp_path, monkeypatch, module):
    monkeypatch.setitem(sys.modules, module, None)
    path = tmp_path / ("a.ulg" if module == "pyulog" else "a.bin")
    path.write_bytes(b"x")
    with pytest.raises(BadInput, match=rf"needs {module}, allowed: pip install 'beaver-ftc\[flights\]'"):
        read_flight(path)


def test_how_a_log_is_read_shows_by_its_name(tmp_path):
    for name, says in (
        (
            "a.xyz",
            r"allowed: \.bin, \.csv, \.log, \.parquet, \.tsv, \.txt, \.ulg, or --reader table, alfa, ulog",
        ),
        ("a.CSV", "is no table"),
    ):
        (tmp_path / name).write_text("")
        with pytest.raises(BadInput, match=says):
            read_flight(tmp_path / name)
    with pytest.raises(
        BadInput, match="--reader tables: is not known, allowed: table, alfa, ulog, ardupilot"
    ):
        read_flight(tmp_path / "a.xyz", "tables")
    (tmp_path / "b.xyz").write_text("t_s,p\n0,1\n1,2\n")
    assert read_flight(tmp_path / "b.xyz", "table").columns["p"].values.tolist() == [1.0, 2.0]


def test_cells_that_hold_no_number(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("t_s,p,word\n0,1,a\n1,,b\n")
    columns = read_flight(path).columns
    np.testing.assert_array_equal(columns["p"].values, [1.0, np.nan])
    assert np.isnan(columns["word"].values).all()
    assert table.read_numbers(path, ["p", "q"]).keys() == {"p"}
    other = synthetic.write_parquet(tmp_path / "a.PARQUET", {"t_s": [0.0, 1.0], "p": [1, 2], "w": ["a", "b"]})
    found = table.read_numbers(other)
    assert found["p"].tolist() == [1.0, 2.0]
    assert found["p"].dtype == float
    assert np.isnan(found["w"]).tolist() == [True, True]
    assert list(table.read_numbers(other, ["w", "t_s"])) == ["t_s", "w"]


@pytest.mark.parametrize(
    ("name", "says"), [("a.csv", "is a directory"), ("no.csv", "no such file or directory")]
)
def test_why_the_system_does_not_open_a_table_is_said_without_its_numbers(tmp_path, name, says):
    (tmp_path / "a.csv").mkdir()
    with pytest.raises(BadInput) as caught:
        table.column_names(tmp_path / name)
    says = f"is no table that can be read ({says}), allowed: CSV or Parquet"
    assert str(caught.value) == f"{tmp_path / name}: {says}"


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


def test_a_tenth_of_the_lines_may_be_broken(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("t_s,p\n" + "".join(f"{k},1\n" for k in range(18)) + "18\n19,2,3\n")
    assert read_flight(path).notes == ("lines with too few or too many cells, left out: 2",)


@pytest.mark.parametrize(
    ("written", "unit", "says"),
    [
        (
            "ms,p\n1,2\n2,3\n2,4\n1,5\n", "ms",
            "ms: row 3: time does not increase, allowed: increasing seconds",
        ),
        ("ms,p\n1,2\n", "ms", "has 1 rows, allowed: at least 2"),
        ("ms,p\n,1\n,2\n3,4\n", "ms", "ms: 2 of 3 rows hold no number, allowed: increasing time"),
        (
            "time,p\n1,2\n2,3\n", "s",
            "no column ms, allowed: a table with t_s in seconds, or its `time` in the vehicle file; it has "
            "time, p",
        ),
    ],
)  # fmt: skip
def test_why_the_rows_of_a_table_cannot_be_used_is_said_whole(tmp_path, written, unit, says):
    path = tmp_path / "log.csv"
    path.write_text(written)
    with pytest.raises(BadInput) as refused:
        read_flight(path, None, ("ms", unit))
    assert str(refused.value) == f"{path}: {says}"


@pytest.mark.parametrize(("unit", "in_s"), [("s", 1.0), ("ms", 0.001), ("us", 0.000001), ("ns", 0.000000001)])
def test_the_time_of_a_table_is_in_its_unit_and_no_column_of_its_own(tmp_path, unit, in_s):
    (tmp_path / "log.tsv").write_text("clock\tp\n5\t2\n8\t3\n")
    found = read_flight(tmp_path / "log.tsv", None, ("clock", unit)).columns
    assert list(found) == ["p"]
    np.testing.assert_allclose(found["p"].t_s, [5.0 * in_s, 8.0 * in_s], rtol=1e-14)


@pytest.mark.parametrize("suffix", ["csv", "parquet"])
def test_a_table_of_more_rows_than_a_flight_has_is_refused_where_it_is_read_whole(
    tmp_path, monkeypatch, suffix
):
    monkeypatch.setattr(table, "_MAX_ROWS", 6)
    write = {"csv": synthetic.write_csv, "parquet": synthetic.write_parquet}[suffix]
    for rows in (6, 7):
        path = write(tmp_path / f"{rows}.{suffix}", {"t_s": np.arange(float(rows)), "p": np.ones(rows)})
        if rows == 6:
            assert len(read_flight(path).columns["p"].values) == 6
        else:
            with pytest.raises(BadInput, match=r"has (more than 6|7) rows, allowed: up to 6$"):
                read_flight(path)


def test_parts_of_a_stored_table_begin_a_tenth_before_and_say_the_row_in_the_file(tmp_path, monkeypatch):
    """In parts of 20 rows, read 7 at a time; 24 rows are one part, 25 are two."""
    monkeypatch.setattr(table, "_BATCH_ROWS", 7)
    for rows, begins in (
        (24, [(0, 24)]),
        (25, [(0, 20), (18, 25)]),
        (61, [(0, 20), (18, 38), (36, 56), (54, 61)]),
    ):
        t_s = np.arange(float(rows))
        path = synthetic.write_parquet(tmp_path / f"log{rows}.parquet", {"t_s": t_s, "p": 3.0 * t_s})
        parts = [*table.read_parts(path, part_rows=20)]
        names = (
            [f"log{rows}-part-{k}" for k in range(1, len(begins) + 1)] if len(begins) > 1 else [f"log{rows}"]
        )
        assert [part.name for part in parts] == names
        for part, (begin, end) in zip(parts, begins, strict=True):
            assert part.columns["p"].values.tolist() == [3.0 * k for k in range(begin, end)]
            assert part.columns["p"].t_s.tolist() == [float(k) for k in range(begin, end)]
    t_s[40] = t_s[45] = 1.0
    path = synthetic.write_parquet(tmp_path / "back.parquet", {"t_s": t_s, "p": t_s})
    with pytest.raises(BadInput, match=r"back\.parquet: t_s: row 41: time does not increase"):
        [*table.read_parts(path, part_rows=20)]


def test_two_columns_of_a_name_are_refused_if_used_and_have_their_places_as_names(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("t_s,p,p\n0,1,2\n1,2,3\n")
    with pytest.raises(BadInput, match="has two columns p, allowed: one of a name"):
        read_flight(path, columns=["p"])
    columns = read_flight(path).columns
    assert {name: column.values.tolist() for name, column in columns.items()} == {
        "p (column 2)": [1.0, 2.0], "p (column 3)": [2.0, 3.0],
    }  # fmt: skip


class Footer:
    """What a Parquet file says of itself: a row group with the bytes of each column."""

    num_row_groups = 2

    def __init__(self, rows, **stored):
        self.num_rows, self.stored = rows, stored

    def row_group(self, i):
        columns = [
            type("Chunk", (), {"path_in_schema": name, "total_uncompressed_size": size / 2})()
            for name, size in self.stored.items()
        ]
        return type("Group", (), {"num_columns": len(columns), "column": lambda self, k: columns[k]})()


@pytest.mark.parametrize(("footer", "says"), [
    (Footer(10_000_000, a=10), None),
    (Footer(10_000_001, a=10), "has 10,000,001 rows, allowed: up to 10,000,000"),
    (Footer(10, a=1e9, b=1e9, other=1e12), None),
    (Footer(10, a=1e9, b=1.1e9), r"holds 2\.1 GB of numbers, allowed: up to 2 GB"),
], ids=["rows", "too many", "bytes", "too much"])  # fmt: skip
def test_no_more_is_read_than_a_flight_has(tmp_path, footer, says):
    if says is None:
        assert table._check_parquet_size(tmp_path, footer, ["a", "b"]) is None
        return
    with pytest.raises(BadInput, match=says):
        table._check_parquet_size(tmp_path, footer, ["a", "b"])


def test_numbers_count_by_eight_bytes(tmp_path):
    """Of 10 million rows 25 columns are 2 GB, one more is too much."""
    footer = Footer(10_000_000, a=10)
    assert table._check_parquet_size(tmp_path, footer, ["a"] * 25) is None
    with pytest.raises(BadInput, match=r"holds 2\.1 GB"):
        table._check_parquet_size(tmp_path, footer, ["a"] * 26)


def test_what_counts_as_a_number():
    kinds = {
        pa.int8(): True,
        pa.float32(): True,
        pa.string(): False,
        pa.bool_(): False,
        pa.list_(pa.int8()): False,
    }
    assert {kind: table._is_numeric_type(kind) for kind in kinds} == kinds


def test_columns_of_topics_count_from_the_first_stamp_of_all():
    topics = {
        "late": {"us": [3_000_000, 3_500_000], "x": [1, 2]},
        "early": {
            "us": [np.nan, 2_000_000, 9_000_000, 2_250_000, 2_500_000],
            "y": [2, 3, 4, 5, 6],
            "z": [5, 6, 7, 8, 9],
        },
        "none": {"us": [np.nan, np.nan], "w": [1, 2]},
    }
    columns, origin_s = columns_and_time_origin(topics, "us")
    assert origin_s == pytest.approx(2.0)
    np.testing.assert_allclose(columns["late.x"].t_s, [1.0, 1.5])
    np.testing.assert_allclose(columns["early.z"].t_s, [0.0, 0.25, 0.5])
    assert columns["early.y"].values.tolist() == [3.0, 5.0, 6.0]
    assert columns["early.y"].note.startswith("early: row 1: its stamp is out of order")
    assert columns["late.x"].note == ""
    assert set(columns) == {"late.x", "early.y", "early.z", "none.w"}
    assert columns_and_time_origin({"none": {"us": [np.nan, np.nan], "w": [1, 2]}}, "us")[1] == 0.0
    early = {"early": {"us": [2_000_000, 2_500_000], "y": [2, 3]}}
    columns, origin_s = columns_and_time_origin(early, "us", [1_750_000.0, 2_250_000.0])
    assert origin_s == pytest.approx(1.75)
    np.testing.assert_allclose(columns["early.y"].t_s, [0.25, 0.75])


def test_the_bytes_of_a_message_are_those_of_all_that_is_in_it():
    """Three messages of five numbers, one number, and two of a message of five and one."""

    def of(*fields):
        return SimpleNamespace(fields=fields)

    formats = {
        "outer": of(("five", 3, "x"), ("uint8_t", 0, "y"), ("six", 2, "z")),
        "five": of(("float", 5, "u")),
        "six": of(("five", 0, "v"), ("int32_t", 1, "w")),
    }
    assert ulog._min_message_bytes(formats, "outer", ()) == 3 * 5 + 1 + 2 * (5 + 1)
    formats["five"].fields += (("outer", 0, "again"),)
    with pytest.raises(ValueError, match="a message outer holds itself"):
        ulog._min_message_bytes(formats, "outer", ())


def test_a_ulog_says_from_when_its_time_counts(tmp_path):
    pytest.importorskip("pyulog")
    columns = {name: values[:5] for name, values in synthetic.fly(2.0).items()}
    recording = read_flight(synthetic.write_ulog(tmp_path / "a.ulg", columns))
    assert recording.notes == ("time counts from 1.000 s of the autopilot's clock",)


def test_a_cell_of_text_is_counted_in_its_row_of_the_whole_table(tmp_path, monkeypatch):
    """Blocks of a few lines; of three columns one has text in two blocks, one in the last, one nowhere."""
    rows = [f"{k},{k + 0.5},{2 * k}" for k in range(1, 401)]
    rows[122], rows[310], rows[398] = "123,odd,246", "311,odder,622", "399,399.5,last"
    path = tmp_path / "log.csv"
    path.write_text("\n".join(["a,b,c", *rows]) + "\n")
    monkeypatch.setattr(text, "_BLOCK_BYTES", 600)
    blocks = [*text.read_cells(path, text.find_layout(path), ("a", "b", "c"))]
    assert len(blocks) > 5
    assert [one.n_rows_before for one in blocks] == [
        sum(each.n_rows for each in blocks[:k]) for k in range(len(blocks))
    ]
    assert {name: found for one in reversed(blocks) for name, found in one.text_cells.items()} == {
        "b": (1, 123, "odd"), "c": (1, 399, "last"),
    }  # fmt: skip
    whole = text.join_blocks(blocks)
    assert whole.text_cells == {"b": (2, 123, "odd"), "c": (1, 399, "last")}
    assert (whole.n_rows, np.isnan(whole.numbers["b"]).sum(), np.isnan(whole.numbers["a"]).sum()) == (
        400,
        2,
        0,
    )


def test_what_is_said_after_a_dataflash_log_is_heard_again(capfd):
    """By file descriptor too: the library behind pymavlink writes past Python."""
    os.write(2, b"before, ")
    with ardupilot._silence_stderr():
        os.write(2, b"within, ")
    os.write(2, b"after")
    assert capfd.readouterr().err == "before, after"


def test_of_a_stored_table_the_numbers_that_are_asked_for_count(tmp_path, monkeypatch):
    path, seen = tmp_path / "x.parquet", []
    columns = {"t": [0.0], "a": [1.0], "words": ["x"], "lists": [[1.0, 2.0]], "b": [3]}
    parquet.write_table(pa.table(columns), path)
    monkeypatch.setattr(table, "_check_parquet_size", lambda path, footer, names: seen.append(names))
    for asked in (None, {"t", "b", "words"}):
        assert table._parquet_columns(path, asked) == (list(columns), ["t", "a", "b"])
    assert seen == [["t", "a", "b"], ["t", "b"]]


def test_a_dataflash_log_has_the_name_of_its_file_without_the_ending(monkeypatch):
    """And its time counts from the stamps of messages that are not kept, too."""

    def read_messages(path, wanted):
        found = ardupilot._Messages(wanted, ())
        for kind, stamp in (("IMU", 2e6), ("IMU", 3e6), ("AHR", 1.5e6)):
            found.add(kind, ["TimeUS", "GyrX"], {"TimeUS": stamp, "GyrX": stamp + len(path.name)})
        return found

    monkeypatch.setattr(ardupilot, "_read_messages", read_messages)
    found = ardupilot.read(Path("logs/flight.2.bin"), ["IMU.GyrX"])
    assert (found.name, list(found.columns)) == ("flight.2", ["IMU.GyrX"])
    assert found.columns["IMU.GyrX"].values.tolist() == [2_000_012.0, 3_000_012.0]
    np.testing.assert_allclose(found.columns["IMU.GyrX"].t_s, [0.5, 1.5])
