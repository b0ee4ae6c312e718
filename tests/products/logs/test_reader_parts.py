"""What the readers make of small files: every column, event and refusal."""

import os
import sys
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from pyarrow import parquet

from beaver_ftc.documents.errors import BadInput
from beaver_ftc_logs.readers import alfa, ardupilot, read_flight, table, text
from beaver_ftc_logs.recording import columns_and_time_origin
from products.logs import synthetic

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
    for i, (topic, field, _) in enumerate(alfa._load_column_sources_and_failure_names()["columns"].values()):
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
    write(folder, "failure_status-rudder", (12.0, 1.0), (np.nan, 2.0), header=head)
    write(folder, "failure_status-elevator", header=head)
    write(folder, "failure_status-aileron", (9.0, 2.0), (9.5, 2.0), (10.0, 1.0), header=head)
    events = [(round(event.t_s, 6), event.surface) for event in read_flight(folder).logged_failures]
    assert events == [(8.0, "engine"), (9.0, "left_aileron"), (10.0, "right_aileron"), (12.0, "rudder")]


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


def test_two_columns_of_a_name_are_refused(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("t_s,p,p\n0,1,2\n1,2,3\n")
    with pytest.raises(BadInput, match="has two columns p, allowed: one of a name"):
        read_flight(path)


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
    assert {kind: table._is_integer_or_float_type(kind) for kind in kinds} == kinds


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
    assert columns_and_time_origin({"none": topics["none"]}, "us")[1] == 0.0


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
    assert {name: found for one in reversed(blocks) for name, found in one.text_cell_summaries.items()} == {
        "b": (1, 123, "odd"), "c": (1, 399, "last"),
    }  # fmt: skip
    whole = text.join_and_consume_blocks(blocks)
    assert whole.text_cell_summaries == {"b": (2, 123, "odd"), "c": (1, 399, "last")}
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
        assert table._check_size_and_list_parquet_columns(path, asked) == (list(columns), ["t", "a", "b"])
    assert seen == [["t", "a", "b"], ["t", "b"]]


def test_a_dataflash_log_has_the_name_of_its_file_without_the_ending(monkeypatch):
    monkeypatch.setattr(ardupilot, "_read_messages", lambda path, wanted: {"IMU": (path.name, wanted)})
    monkeypatch.setattr(
        ardupilot, "columns_and_time_origin", lambda messages, time: ((messages, time), "rest")
    )
    found = ardupilot.read(Path("logs/flight.2.bin"), ["GyrX"])
    assert (found.name, found.columns) == ("flight.2", ({"IMU": ("flight.2.bin", ["GyrX"])}, "TimeUS"))
