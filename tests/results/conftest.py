import json

import pytest

import beaver_ftc as bf
from beaver_ftc.results.model import Metrics


@pytest.fixture(scope="session")
def folder(tmp_path_factory):
    """The result of the published elevator case, without report."""
    return bf.fly("elevator-partial-loss").save(tmp_path_factory.mktemp("runs"), report=False)


@pytest.fixture(scope="session")
def log_path(folder):
    return folder / "log.parquet"


@pytest.fixture(scope="session")
def found(folder):
    """Its metrics."""
    return Metrics.of(json.loads((folder / "metrics.json").read_text()))
