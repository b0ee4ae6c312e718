import contextlib

import numpy as np
import pandas as pd
import pytest

from beaver_ftc.results.log import ParquetLog, SpooledLog, column_names, read, read_chunks, row_count

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


def test_long_flight_is_kept_in_bounded_row_groups(tmp_path):
    path = tmp_path / "log.parquet"
    _write(path, np.zeros((100, 3)), 100, 32)
    assert [chunk["t_s"].size for chunk in read_chunks(path)] == [32, 32, 32, 4]
    assert row_count(path) == 100


def test_reads_only_the_columns_asked_for(log_path, flight):
    assert column_names(log_path) == flight.columns
    columns = read(log_path, ["q_rad_s", "t_s"])
    assert list(columns) == ["q_rad_s", "t_s"]
    np.testing.assert_allclose(np.diff(columns["t_s"]), 0.01)


def test_flight_of_no_rows_is_a_readable_log(tmp_path):
    path = tmp_path / "log.parquet"
    _write(path, np.zeros((0, 3)), 1, 8)
    assert read(path)["q_rad_s"].size == 0


def test_log_that_failed_is_not_mistaken_for_a_whole_one(tmp_path):
    path = tmp_path / "log.parquet"
    with contextlib.suppress(RuntimeError), ParquetLog(path, 8) as log:
        log.open(COLUMNS)
        log.write(np.ones((12, 3)))
        raise RuntimeError
    assert row_count(path) == 8


def test_a_spooled_log_is_kept_in_a_file_and_reads_as_it_was(tmp_path):
    rows = np.random.default_rng(2).standard_normal((40, 3))
    log = SpooledLog()
    log.open(COLUMNS)
    assert log.frozen_copy().row_count() == 0
    buffer = rows[:25].copy()
    log.write(buffer)
    buffer[:] = -1.0  # the loop reuses its buffer
    then = log.frozen_copy()
    log.write(rows[25:])
    now = log.frozen_copy()
    log.open(COLUMNS)  # a new flight
    log.write(rows[:3])
    assert then.rows.tobytes() == rows[:25].tobytes()
    assert now.rows.tobytes() == rows.tobytes()
    now.copy_to(tmp_path / "log.parquet")
    assert np.array_equal(read(tmp_path / "log.parquet")["q_rad_s"], rows[:, 1])
