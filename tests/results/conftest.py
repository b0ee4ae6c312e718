import pytest
from synthetic import Flight, rows

from beaver_ftc.results.log import ParquetLog


@pytest.fixture
def flight():
    return Flight()


@pytest.fixture
def log_path(tmp_path, flight):
    path = tmp_path / "log.parquet"
    with ParquetLog(path) as log:
        log.open(flight.columns)
        log.write(rows(flight))
    return path
