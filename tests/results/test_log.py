import contextlib

import numpy as np
import pandas as pd
import pyarrow as pa
import pytest
from pyarrow import parquet

from beaver_ftc.documents.errors import BadInput
from beaver_ftc.results.log import ParquetLog, StoredLog

COLUMNS = ("t_s", "q_rad_s", "residual_rad_s")


def _write(path, rows, chunk, rows_per_group):
    with ParquetLog(path, rows_per_group) as log:
        log.open(COLUMNS)
        for start in range(0, len(rows), chunk):
            buffer = rows[start : start + chunk].copy()
            log.write(buffer)
            buffer[:] = -1.0  # the loop reuses its buffer


@pytest.mark.parametrize(("chunk", "rows_per_group"), [(1, 7), (100, 7), (7, 100), (50, 50), (13, 50)])
def test_reads_back_bit_for_bit_however_it_is_cut(tmp_path, chunk, rows_per_group):
    rows = np.random.default_rng(1).standard_normal((103, 3))
    rows[5, 2], rows[6, 1] = np.nan, -0.0
    path = tmp_path / "log.parquet"
    _write(path, rows, chunk, rows_per_group)
    back = pd.read_parquet(path)
    assert list(back.columns) == list(COLUMNS)
    assert back.to_numpy().tobytes() == rows.tobytes()


def test_flight_of_no_rows_is_a_readable_log(tmp_path):
    path = tmp_path / "log.parquet"
    _write(path, np.zeros((0, 3)), 1, 8)
    assert StoredLog(path).read()["q_rad_s"].size == 0


def test_log_that_failed_is_not_mistaken_for_a_whole_one(tmp_path):
    path = tmp_path / "log.parquet"
    with contextlib.suppress(RuntimeError), ParquetLog(path, 8) as log:
        log.open(COLUMNS)
        log.write(np.ones((12, 3)))
        raise RuntimeError
    assert StoredLog(path).row_count() == 8


def test_other_numbers_than_a_run_writes_are_refused(tmp_path):
    parquet.write_table(pa.table({"t_s": pa.array([0, 1])}), tmp_path / "log.parquet")
    with pytest.raises(BadInput, match="has other numbers than a run writes, allowed: float64 alone"):
        StoredLog(tmp_path / "log.parquet")


@pytest.mark.parametrize(("rows", "allowed"), [(1_000_000, True), (1_000_001, False)])
def test_a_row_group_of_a_million_rows_at_most_is_read(tmp_path, rows, allowed):
    table = pa.table({"t_s": pa.array(np.zeros(rows))})
    parquet.write_table(table, tmp_path / "log.parquet", row_group_size=rows)
    if allowed:
        assert StoredLog(tmp_path / "log.parquet").row_count() == rows
        return
    with pytest.raises(BadInput, match=r"has 1,000,001 rows in a row group, allowed: up to 1,000,000"):
        StoredLog(tmp_path / "log.parquet").row_count()
