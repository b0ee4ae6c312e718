"""A Parquet file is looked at before it is read: what a few bytes stand for is refused, or not read."""

import numpy as np
import pyarrow as pa
import pytest
from pyarrow import csv, parquet

from beaver_ftc.documents.errors import BadInput
from beaver_ftc_logs.readers import read_flight
from products.logs import limited, synthetic


def repeated(path, table, doublings):
    """A Parquet file whose footer lists its one row group many times over: so many rows in so few bytes."""
    parquet.write_table(table, path)
    metadata = parquet.read_metadata(path)
    for _ in range(doublings):
        metadata.append_row_groups(metadata)
    content = path.read_bytes()
    footer = path.with_suffix(".footer")
    metadata.write_metadata_file(footer)
    length = int.from_bytes(content[-8:-4], "little")
    path.write_bytes(content[: -8 - length] + footer.read_bytes()[4:])
    footer.unlink()
    return path


def test_billions_of_rows_in_a_tiny_file_are_one_line(tmp_path):
    vehicle = tmp_path / "wing.yaml"
    vehicle.write_text(synthetic.VEHICLE)
    names = [name for name in synthetic.fly(5.0) if name != "left_effectiveness"]
    table = pa.table({name: np.zeros(500_000, dtype=np.int8) for name in names})
    path = repeated(tmp_path / "bomb.parquet", table, 13)
    statuses, said = limited.run([["identify", path, "--vehicle", vehicle, "--out", tmp_path / "model.json"]])
    assert statuses == [2]
    assert said == f"{path}: has 4,096,000,000 rows, allowed: up to 10,000,000\n"


def test_a_table_too_wide_for_its_rows_is_one_line(tmp_path):
    table = pa.table({name: np.zeros(200_000, dtype=np.int8) for name in ("t_s", *map(str, range(39)))})
    path = repeated(tmp_path / "wide.parquet", table, 5)
    with pytest.raises(BadInput, match=r"holds 2\.0 GB of numbers, allowed: up to 2 GB"):
        read_flight(path)


def test_a_list_in_a_cell_is_not_read_and_a_cell_without_a_number_is_nan(tmp_path):
    """A column of lists beside the flight's: 5 GB of numbers if it were read. One of nulls is read as nan."""
    flown = pa.table(synthetic.fly(60.0))
    lengths = np.concatenate([[0], np.full(len(flown), 1_000_000)]).astype(np.int32)
    lists = pa.ListArray.from_arrays(pa.array(lengths), pa.array(np.zeros(1_000_000, dtype=np.int64)))
    nulls = pa.nulls(len(flown), pa.int8())
    path = synthetic.write_parquet(
        tmp_path / "lists.parquet", flown.append_column("lists", lists).append_column("nulls", nulls)
    )
    recording = read_flight(path)
    assert np.isnan([recording.columns[name].values for name in ("lists", "nulls")]).all()
    np.testing.assert_array_equal(recording.columns["p_rad_s"].values, flown["p_rad_s"].to_numpy())


@pytest.mark.parametrize("suffix", ["csv", "parquet"])
def test_a_doubled_column_is_one_line_if_it_is_used(tmp_path, suffix):
    columns = synthetic.fly(5.0)
    table = pa.table(columns).append_column("p_rad_s", pa.array(columns["p_rad_s"]))
    path = tmp_path / f"flight.{suffix}"
    {"csv": csv.write_csv, "parquet": parquet.write_table}[suffix](table, path)
    with pytest.raises(BadInput, match="has two columns p_rad_s, allowed: one of a name"):
        read_flight(path, columns=["q_rad_s", "p_rad_s"])
    others = read_flight(path, columns=["q_rad_s"])
    np.testing.assert_allclose(others.columns["q_rad_s"].values, columns["q_rad_s"])


@pytest.mark.parametrize("text", ["uint64_t timestamp;wide[60000] a;", "uint64_t timestamp;bomb a;"])
def test_a_ulog_whose_messages_hold_too_much_is_one_line(tmp_path, text):
    """60,000 times 60,000 fields, and a message in itself: pyulog writes each field out."""
    import struct

    pytest.importorskip("pyulog")
    path = tmp_path / "bomb.ulg"
    data = b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0)
    for kind, body in (
        ("F", b"wide:uint8_t[60000] b;"),
        ("F", f"bomb:{text}".encode()),
        ("A", struct.pack("<BH", 0, 0) + b"bomb"),
    ):
        data += struct.pack("<HB", len(body), ord(kind)) + body
    path.write_bytes(data)
    with pytest.raises(BadInput, match=r"is no ULog that can be read \(a message bomb"):
        read_flight(path)
