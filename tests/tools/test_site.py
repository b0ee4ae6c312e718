"""The web site: every page, the generated reference, a flight to replay; offline, on desk and phone."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
needs_browser = pytest.mark.skipif(CHROMIUM is None, reason="no Chromium")
PHONE, DESK = {"width": 390, "height": 844}, {"width": 1400, "height": 1000}
pytest.importorskip("mkdocstrings")


def status():
    """What git would say of the clone; nothing where this is none."""
    asked = subprocess.run(
        ["git", "status", "--porcelain"], cwd=ROOT, capture_output=True, text=True, check=False
    )
    return asked.stdout


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """Built as `make site` does: a missing page, or a link that leads nowhere, ends it."""
    folder, before = tmp_path_factory.mktemp("site"), status()
    environment = {**os.environ, "NO_MKDOCS_2_WARNING": "1"}
    command = [sys.executable, "-m", "mkdocs", "build", "--quiet", "--strict", "--site-dir", folder]
    built = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, check=False)
    assert built.returncode == 0, built.stderr
    assert status() == before
    return folder


@pytest.fixture(scope="module")
def browser():
    from playwright.sync_api import sync_playwright

    with sync_playwright() as driver:
        opened = driver.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox", "--disable-gpu"])
        yield opened
        opened.close()


@pytest.fixture
def opened(browser, site):
    """Open a page from disk; whatever its console says, or it asks the network for, is trouble."""
    trouble, pages = [], []

    def open_page(name, viewport=DESK):
        page = browser.new_page(viewport=viewport)
        pages.append(page)
        for event in ("console", "pageerror", "requestfailed"):
            page.on(event, lambda said: trouble.append(str(said)))
        page.on("request", lambda asked: asked.url.startswith("http") and trouble.append(asked.url))
        page.goto((site / name).as_uri())
        return page

    yield open_page
    for page in pages:
        page.close()
    assert trouble == []


@needs_browser
def test_the_flight_on_the_front_page_can_be_replayed(opened):
    frame = opened("index.html").frame_locator(".replay")
    before = frame.locator("#clock").inner_text()
    frame.locator("#play").click()
    frame.locator("#play", has_text="pause").wait_for()
    frame.locator(f'#clock:not(:text-is("{before}"))').wait_for()
    assert frame.locator("#clock").inner_text() != before


@needs_browser
@pytest.mark.parametrize(
    "name",
    [
        "index",
        "reference/scenarios",
        "explanation/detection",
        "reference/scenario-keys",
        "notebooks/first-fault",
    ],
)
def test_a_page_is_no_wider_than_a_phone(opened, name):
    page = opened(f"{name}.html", PHONE)
    assert page.evaluate("document.documentElement.scrollWidth") <= PHONE["width"]
