"""One running cockpit, and one browser, for all tests of a module."""

import pytest
from live_browser import ARGUMENTS, CHROMIUM
from live_cockpit import ended, started


@pytest.fixture(scope="module")
def cockpit(tmp_path_factory):
    """`beaver-ftc live`; it has to end without a word, if no test has ended it."""
    running = started(tmp_path_factory.mktemp("live"))
    yield running
    assert running.process.poll() is not None or ended(running) == (0, "")


@pytest.fixture(scope="module")
def chromium():
    playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    with playwright.sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=CHROMIUM, args=ARGUMENTS)
        yield browser
        browser.close()
