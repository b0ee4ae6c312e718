"""A long log is read in parts: memory does not grow with it, and what is said is what the whole says."""

import os
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
from products.logs import synthetic

_PEAK = """
import resource, sys
from beaver_ftc.cli.main import main
sys.argv = ["beaver-ftc", *sys.argv[1:]]
try:
    main()
except SystemExit as ended:
    assert not ended.code, ended.code
print("PEAK", resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
"""


@pytest.fixture
def parted(monkeypatch):
    """Parts of 500 rows, fits of 600 samples in stretches of 100."""
    monkeypatch.setattr(readers, "ROWS_PER_PART", 500)
    monkeypatch.setattr(samples, "MAX_FIT_SAMPLES", 600)
    monkeypatch.setattr(samples, "_FIT_STRETCH_SAMPLES", 100)


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
    _, parts = table._column_names_and_parts(path, None, 100)
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


def test_memory_does_not_grow_with_the_log(tmp_path):
    """40 MB with a jump of 1e6 s need hardly more than 10 MB; read whole, it was 130 MB more."""
    vehicle = tmp_path / "wing.yaml"
    vehicle.write_text(synthetic.VEHICLE)
    columns = {name: np.tile(values, 270) for name, values in synthetic.fly(240.0).items()}
    columns["t_s"] = np.arange(len(columns["t_s"])) / synthetic.RATE_HZ
    columns["t_s"][70_000:] += 1e6
    peaks_mb = []
    for rows in (162_000, 648_000):
        path = tmp_path / f"{rows}.csv"
        csv.write_csv(pa.table({name: np.round(values[:rows], 6) for name, values in columns.items()}), path)
        command = ["identify", "--check", str(path), "--vehicle", str(vehicle)]
        done = subprocess.run(
            [sys.executable, "-c", _PEAK, *command], check=True, capture_output=True, text=True,
            env=os.environ | {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"},
        )  # fmt: skip
        peaks_mb.append(int(done.stdout.split("PEAK")[1]) / 1024)
        assert "gaps: 1, the longest of 1e+06 s" in done.stdout
    assert peaks_mb[1] < peaks_mb[0] + 30.0
