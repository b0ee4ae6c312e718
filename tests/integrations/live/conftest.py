"""One running cockpit for all tests of a module."""

import pytest
from live_cockpit import ended, started


@pytest.fixture(scope="module")
def cockpit(tmp_path_factory):
    """`beaver-ftc live`; it has to end without a word."""
    running = started(tmp_path_factory.mktemp("live"))
    yield running
    assert ended(running) == (0, "")
