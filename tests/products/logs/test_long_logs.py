"""A long log is read in parts: memory does not grow with it, and mistakes are said by their row."""

import os
import subprocess
import sys

import numpy as np
import pyarrow as pa
import pytest
from pyarrow import csv, parquet

from beaver_ftc.documents.errors import BadInput
from beaver_ftc_logs import loading, readers
from beaver_ftc_logs.readers import read_parts
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
    monkeypatch.setattr(loading, "MAX_FIT_SAMPLES", 600)
    monkeypatch.setattr(loading, "_FIT_SAMPLES", 100)


def write(path, columns):
    if path.suffix == ".csv":
        return synthetic.write_csv(path, columns)
    parquet.write_table(pa.table(columns), path)
    return path


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
