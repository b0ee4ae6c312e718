"""A long log is read in parts: memory does not grow with it, and what is said is what the whole says."""

import os
import struct
import subprocess
import sys
from itertools import pairwise

import numpy as np
import pyarrow as pa
import pytest
from pyarrow import csv, parquet

from beaver_ftc.documents.errors import BadInput
from beaver_ftc_logs import readers, samples
from beaver_ftc_logs.check import check_log
from beaver_ftc_logs.diagnose import diagnose
from beaver_ftc_logs.readers import read_flight, read_parts, table
from beaver_ftc_logs.recording import Column, RecordedFlight
from beaver_ftc_logs.vehicle import load_vehicle
from products.logs import synthetic

_PEAK = """
import sys
from pathlib import Path
from beaver_ftc.cli.main import main
sys.argv = ["beaver-ftc", *sys.argv[1:]]
try:
    main()
except SystemExit as ended:
    assert not ended.code, ended.code
print("PEAK", Path("/proc/self/status").read_text().partition("VmHWM:")[2].split()[0])
"""
"""The largest memory, kB, of this program alone: `ru_maxrss` counts the process that started it, too."""


@pytest.fixture
def parted(monkeypatch):
    """Parts of 500 rows, fits of 600 samples in stretches of 100."""
    monkeypatch.setattr(readers, "ROWS_PER_PART", 500)
    monkeypatch.setattr(samples, "MAX_FIT_SAMPLES", 600)
    monkeypatch.setattr(samples, "_FIT_SAMPLES", 100)


def write(path, columns):
    if path.suffix == ".csv":
        return synthetic.write_csv(path, columns)
    parquet.write_table(pa.table(columns), path)
    return path


@pytest.mark.parametrize("suffix", ["csv", "parquet"])
def test_parts_hold_every_row_once_and_a_tenth_again(tmp_path, parted, monkeypatch, suffix):
    monkeypatch.setattr("beaver_ftc_logs.readers.text._BLOCK_BYTES", 9000)
    monkeypatch.setattr("beaver_ftc_logs.readers.table._BATCH_ROWS", 70)
    path = write(tmp_path / f"long.{suffix}", synthetic.fly(240.0))
    whole, parts = read_flight(path).columns["q_rad_s"], list(read_parts(path, columns=["q_rad_s"]))
    assert [part.name for part in parts] == [f"long-part-{k}" for k in range(1, len(parts) + 1)]
    assert len(parts) == 5
    columns = [part.columns["q_rad_s"] for part in parts]
    new = [0, *(50 for _ in columns[1:])]
    np.testing.assert_array_equal(
        np.concatenate([one.values[k:] for one, k in zip(columns, new, strict=True)]), whole.values
    )
    for one, other in pairwise(columns):
        np.testing.assert_array_equal(one.t_s[-50:], other.t_s[:50])


@pytest.mark.parametrize(("n_rows", "parts"), [(120_000, [120_000]), (120_001, [100_000, 30_001])])
def test_a_table_of_more_than_120_000_rows_has_parts_of_100_000(tmp_path, n_rows, parts):
    """As docs/explanation/flight-logs.md has it; each begins with the last 10,000 of the one before."""
    stamps = np.arange(n_rows) / 100.0
    path = write(tmp_path / "long.parquet", {"t_s": stamps, "a": stamps})
    assert [len(part.columns["a"].t_s) for part in read_parts(path)] == parts


def test_a_short_log_is_no_part(tmp_path, parted):
    (one,) = read_parts(write(tmp_path / "short.csv", synthetic.fly(60.0)))
    assert one.name == "short"
    assert one.columns["p_rad_s"].t_s.size == 600


def test_what_is_wrong_is_said_by_its_row_in_the_file(tmp_path, parted, monkeypatch):
    monkeypatch.setattr("beaver_ftc_logs.readers.text._BLOCK_BYTES", 9000)
    path = write(tmp_path / "long.csv", synthetic.fly(240.0))
    lines = path.read_text().splitlines()
    lines[1501] = lines[1501].split(",")[0] + ",ERR," + lines[1501].split(",", 2)[2]
    lines[2002] = lines[2000]
    path.write_text("\n".join(lines) + "\n")
    said = []
    with pytest.raises(BadInput, match="t_s: row 2002: time does not increase"):
        said += [part.columns["p_rad_s"].note for part in read_parts(path)]
    notes = []
    for part in read_parts(path):
        notes.append(part.columns["p_rad_s"].note)
        if len(notes) == 4:
            break
    assert [note for note in notes if note] == [
        "p_rad_s: 1 cell holds no number, the first in row 1501: 'ERR'"
    ]


def test_all_parts_together_count_the_lines_that_are_left_out(tmp_path, monkeypatch):
    monkeypatch.setattr("beaver_ftc_logs.readers.text._BLOCK_BYTES", 200)
    lines = ["t_s,p", *(f"{0.1 * k:.1f},{k}" for k in range(300))]
    for k in (20, 40, 150, 290):
        lines.insert(k, "1,2,3")
    path = tmp_path / "long.csv"
    path.write_text("\n".join(lines) + "\n")
    _, parts = table._names_and_parts(path, None, 100)
    counted = [[int(text.rpartition(" ")[2]) for _, text in said] for _, said, _ in parts]
    assert len(counted) == 3
    assert sum(map(sum, counted)) == 4


def test_a_fit_looks_at_stretches_that_are_spread_evenly(tmp_path, parted, wing):
    path = write(tmp_path / "long.csv", synthetic.fly(400.0))
    (found,) = samples.load_flights_for_fit([path], wing)
    assert found.n_log_parts > 1
    assert len(found.t_s) <= 600
    assert found.notes[0].startswith(
        f"a long log, read in {found.n_log_parts} parts: {len(found.t_s)} samples"
    )
    edges = found.t_s[np.flatnonzero(np.diff(found.stretch_number, prepend=-1))]
    assert np.diff(edges) == pytest.approx(80.0, abs=20.0)
    whole = read_flight(path).columns["q_rad_s"]
    np.testing.assert_array_equal(found.rates[:, 1], whole.values[np.searchsorted(whole.t_s, found.t_s)])


def test_parts_say_what_the_whole_says(tmp_path, parted, wing, wing_model):
    columns = synthetic.fly(240.0, parts=((100, 240, 1.0, 0.3),), seed=5)
    path = write(tmp_path / "long.csv", columns)
    whole = diagnose(samples.resample(read_flight(path), wing), wing_model)
    for part in samples.stream_flights([path], wing):
        rows = diagnose(part, wing_model)
        settled = rows.t_s > rows.t_s[0] + 25.0
        known = np.searchsorted(whole.t_s, rows.t_s[settled])
        assert (rows.isolated_surfaces[settled] == whole.isolated_surfaces[known]).mean() > 0.97
        assert np.abs(rows.effectiveness[settled] - whole.effectiveness[known]).mean() < 0.1


def test_check_looks_at_every_part(tmp_path, parted, wing):
    columns = synthetic.fly(240.0)
    columns["r_rad_s"][1700:1800] = columns["r_rad_s"][1700]
    found = check_log(write(tmp_path / "long.csv", columns), wing, None)
    frozen = [line for line in found["lines"] if "frozen" in line]
    assert frozen == ["part 4 of 5: r_rad_s: frozen, the same to the last bit for 9.9 s"]
    columns["q_rad_s"][2200:] *= 1e4
    found = check_log(write(tmp_path / "far.csv", columns), wing, None)
    assert not found["usable"]
    assert "column q_rad_s reaches" in found["lines"][-1]


def peak_mb_of_check(path, vehicle):
    """The largest memory of `identify --check` in a process of its own, MB, and what it prints."""
    command = ["identify", "--check", str(path), "--vehicle", str(vehicle)]
    done = subprocess.run(
        [sys.executable, "-c", _PEAK, *command], check=True, capture_output=True, text=True,
        env=os.environ | {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"},
    )  # fmt: skip
    return int(done.stdout.split("PEAK")[1]) / 1024, done.stdout


def test_memory_does_not_grow_with_the_log(tmp_path):
    """40 MB with a jump of 1e6 s need 35 MB more than 10 MB, as 160 MB do; read whole, it was 130 MB more."""
    vehicle = tmp_path / "wing.yaml"
    vehicle.write_text(synthetic.VEHICLE)
    columns = {name: np.tile(values, 270) for name, values in synthetic.fly(240.0).items()}
    columns["t_s"] = np.arange(len(columns["t_s"])) / synthetic.RATE_HZ
    columns["t_s"][70_000:] += 1e6
    peaks_mb = []
    for rows in (162_000, 648_000):
        path = tmp_path / f"{rows}.csv"
        csv.write_csv(pa.table({name: np.round(values[:rows], 6) for name, values in columns.items()}), path)
        peak_mb, says = peak_mb_of_check(path, vehicle)
        peaks_mb.append(peak_mb)
        assert "gaps: 1, the longest of 1e+06 s" in says
    assert peaks_mb[1] < peaks_mb[0] + 60.0


RATES_AND_COMMANDS = ("t_s", "p_rad_s", "q_rad_s", "r_rad_s", "roll_command", "pitch_command")


def ulog_with_ballast(path, columns, n_messages):
    """And a second instance of the topic that is wanted, 240 bytes a message."""
    wide = columns | {f"more_{k}": np.zeros(len(columns["t_s"])) for k in range(23)}
    synthetic.write_ulog(path, wide, "RATE")
    with path.open("ab") as file:
        file.write(struct.pack("<HBBH", 7, ord("A"), 1, 1) + b"RATE")
        body = struct.pack("<HQ28d", 1, 1_000_000, *range(28))
        file.write((struct.pack("<HB", len(body), ord("D")) + body) * n_messages)


def dataflash_with_ballast(path, columns, n_messages):
    """And another message, 91 bytes each."""
    rows = [
        ("RATE", {"TimeUS": round(t_s * 1e6) + 1_000_000} | dict(zip("PQRAE", row, strict=True)))
        for t_s, *row in zip(*columns.values(), strict=True)
    ]
    last = len(synthetic.write_dataflash(path, rows).read_bytes())
    other = ("IMU", {"TimeUS": 1_000_000} | dict.fromkeys("abcdefghij", 0.5))
    message = synthetic.write_dataflash(path, [*rows, other]).read_bytes()[last + 89 :]
    with path.open("ab") as file:
        file.write(message * (n_messages - 1))


def text_with_ballast(path, columns, n_messages):
    """The same as text, 91 bytes a line."""
    names = dict(zip(RATES_AND_COMMANDS, ("t_s", *"PQRAE"), strict=True))
    synthetic.write_ardupilot(path, {names[name]: values for name, values in columns.items()})
    with path.open("a") as file:
        file.write("FMT, 141, 51, IMU, Qffffffffff, TimeUS,a,b,c,d,e,f,g,h,i,j\n")
        file.write(("IMU, 1000000" + ", 0.12345" * 8 + ", 0.5, 1\n") * n_messages)


@pytest.fixture
def parted_log(tmp_path, monkeypatch):
    """A ULog of 2400 rows at 10 Hz in parts of 500 samples, whose vehicle file may say a lower rate."""
    pytest.importorskip("pyulog")
    monkeypatch.setattr(readers, "SAMPLES_PER_PART", 500)
    columns = synthetic.fly(240.0, parts=((100, 240, 1.0, 0.3),), seed=5)
    return synthetic.write_ulog(tmp_path / "long.ulg", columns, "RATE")


def wing_of_topic(tmp_path, further_keys=""):
    (tmp_path / "wing.yaml").write_text(synthetic.vehicle("RATE") + further_keys)
    return load_vehicle(tmp_path / "wing.yaml")


def test_a_long_log_of_an_autopilot_has_parts_that_share_a_tenth(tmp_path, parted_log):
    vehicle = wing_of_topic(tmp_path)
    whole = samples.read_vehicle_columns(parted_log, vehicle)
    parts = list(samples.read_vehicle_parts(parted_log, vehicle))
    assert [part.name for part in parts] == [f"long-part-{k}" for k in range(1, 6)]
    assert {part.notes for part in parts} == {whole.notes}
    for name, column in whole.columns.items():
        rows = [len(part.columns[name].t_s) for part in parts]
        assert rows == [500, 500, 500, 500, 600]  # of 2400, 50 of them twice at each of four borders
        for k, part in enumerate(parts):
            np.testing.assert_array_equal(part.columns[name].t_s, column.t_s[450 * k : 450 * k + rows[k]])
            np.testing.assert_array_equal(part.columns[name].values, column.values[450 * k :][: rows[k]])


def test_parts_of_a_log_that_is_averaged_have_so_many_samples_of_the_average(tmp_path, parted_log):
    """At 5 Hz the 2400 rows are 1200 samples."""
    vehicle = wing_of_topic(tmp_path, "max_rate_hz: 5.0\n")
    parts = [samples.resample(part, vehicle) for part in samples.read_vehicle_parts(parted_log, vehicle)]
    assert [len(part.t_s) for part in parts] == pytest.approx([500, 500, 300], abs=1)
    assert all(part.dt_s == pytest.approx(0.2) for part in parts)


def test_a_part_begins_with_the_last_value_of_a_slower_column(monkeypatch):
    monkeypatch.setattr(readers, "SAMPLES_PER_PART", 10)
    stamps = np.arange(25.0)
    slow = Column(np.array([0.0, 8.5, 30.0]), np.array([1.0, 2.0, 3.0]), "a note")
    late = Column(np.array([20.0]), np.array([4.0]))
    whole = RecordedFlight("f", {"slow": slow, "late": late})
    parts = list(readers.split_long_recording(whole, stamps, 1.0))
    assert [part.columns["slow"].values.tolist() for part in parts] == [[1.0, 2.0], [2.0], [2.0]]
    assert [part.columns["late"].values.tolist() for part in parts] == [[], [], [4.0]]
    assert parts[1].columns["slow"].note == "a note"
    assert list(readers.split_long_recording(whole, stamps, 2.5)) == [whole]


@pytest.mark.parametrize(("n_rows", "parts"), [(480_000, [480_000]), (480_001, [400_000, 120_001])])
def test_a_log_of_more_than_eighty_minutes_at_100_hz_has_parts_of_400_000_samples(n_rows, parts):
    """As docs/explanation/flight-logs.md has it; each begins with the last 40,000 of the one before."""
    stamps = np.arange(n_rows) / 100.0
    whole = RecordedFlight("f", {"a": Column(stamps, stamps)})
    split = readers.split_long_recording(whole, stamps, 1.0)
    assert [len(part.columns["a"].t_s) for part in split] == parts


def test_parts_of_a_ulog_say_what_the_whole_says(tmp_path, parted_log, wing_model):
    vehicle = wing_of_topic(tmp_path)
    whole = diagnose(samples.resample(samples.read_vehicle_columns(parted_log, vehicle), vehicle), wing_model)
    parts = list(samples.stream_flights([parted_log], vehicle))
    assert len(parts) == 5
    for part in parts:
        rows = diagnose(part, wing_model)
        settled = rows.t_s > rows.t_s[0] + 25.0
        known = np.searchsorted(whole.t_s, rows.t_s[settled])
        assert (rows.isolated_surfaces[settled] == whole.isolated_surfaces[known]).mean() > 0.97


@pytest.mark.parametrize(
    ("suffix", "write_log", "message_bytes"),
    [("ulg", ulog_with_ballast, 237), ("bin", dataflash_with_ballast, 91), ("log", text_with_ballast, 93)],
)
def test_memory_does_not_grow_with_what_an_autopilot_logs_besides(tmp_path, suffix, write_log, message_bytes):
    """Four times as large a log needs hardly more. By the packages alone it needed 41 MB more of a ULog, of
    which they keep all messages of a topic, and 49 and 35 MB of dataflash logs, which they map and index."""
    pytest.importorskip("pyulog"), pytest.importorskip("pymavlink")
    columns = {name: synthetic.fly(60.0)[name] for name in RATES_AND_COMMANDS}
    short = dict(zip(RATES_AND_COMMANDS[1:], "PQRAE", strict=True))
    vehicle = tmp_path / "wing.yaml"
    vehicle.write_text(synthetic.vehicle("RATE", None if suffix == "ulg" else short))
    peaks_mb = []
    for megabytes in (10, 40):
        path = tmp_path / f"{megabytes}.{suffix}"
        write_log(path, columns, megabytes * 1_000_000 // message_bytes)
        assert path.stat().st_size == pytest.approx(megabytes * 1e6, rel=0.05)
        peak_mb, says = peak_mb_of_check(path, vehicle)
        peaks_mb.append(peak_mb)
        assert "600 samples at 10 Hz over 59.9 s" in says
    assert peaks_mb[1] < peaks_mb[0] + 10.0
