"""What the acceptance tests share: the installed wheel, and an empty folder to use it in."""

from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import pytest

from .installation import Installation, installed

HERE = Path(__file__).parent


def pytest_collection_modifyitems(items):
    for item in items:
        if HERE in item.path.parents:
            item.add_marker(pytest.mark.acceptance)


@pytest.fixture(scope="session")
def started() -> Installation:
    """The wheel of this checkout, installed, its command started as it is."""
    return installed()


@pytest.fixture(scope="session")
def installation(started) -> Iterator[Installation]:
    """The same, its command forked from a process that has imported it."""
    with started.served() as served:
        yield served


@pytest.fixture
def beaver(installation, tmp_path) -> Callable:
    """Runs `beaver-ftc` with the arguments given, in the test's own empty folder."""
    return partial(installation.beaver, cwd=tmp_path)
