"""Pictures of the report and of the live page, taken of a flight flown now: `python -m tools.docs screens`.

They want Chromium and playwright, which the tests of the live page want too.
"""

import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from beaver_ftc.documents.errors import BadInput
from tools.docs.pages import ROOT
from tools.docs.pictures import lighten

SCENARIO = "elevator-partial-loss"
ARGUMENTS = ["--no-sandbox", "--disable-gpu", "--enable-unsafe-swiftshader"]  # without a graphics card
COMPILED_WITHIN_S = 600.0
# Parts of the report with a number beside them, in the order of the table of docs/tutorials/verdict.md.
NUMBERED = ("table", "table:has(td.met)", "table:has(th[scope=col])", "#play", ".key", "#space")
_NUMBERS = """(parts) => parts.forEach((part, i) => {
  document.body.style.marginLeft = "24px";
  const at = document.querySelector(part).getBoundingClientRect();
  const badge = document.createElement("b");
  badge.textContent = i + 1;
  badge.style = `left: ${at.left - 26}px; top: ${at.top + scrollY - 2}px; position: absolute;
    width: 22px; height: 22px; border-radius: 11px; background: #7d0a1e; color: #fff;
    font: bold 14px/22px sans-serif;
    text-align: center; z-index: 9`;
  document.body.append(badge);
})"""
BREAK_AT_S, LOOK_AT_S = 12.0, 20.0


def screens() -> str:
    """Take the pictures of the pages again: the files."""
    return "\n".join(map(str, write_screens(ROOT / "docs" / "images")))


def write_screens(images: Path) -> Iterator[Path]:
    """Take both pictures into a folder; yield the files. Raises BadInput without a browser."""
    from playwright.sync_api import sync_playwright

    chromium = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
    if chromium is None:
        raise BadInput("there is no Chromium on this machine, and the pictures are taken with it")
    with sync_playwright() as driver, TemporaryDirectory() as folder:
        browser = driver.chromium.launch(executable_path=chromium, args=ARGUMENTS)
        yield _report(browser, Path(folder), images / "report.png")
        yield _live(browser, Path(folder), images / "live.png")
        browser.close()


def _report(browser: Any, folder: Path, path: Path) -> Path:
    """The first screen of the report of a run."""
    from beaver_ftc.results.writer import run
    from beaver_ftc.scenario.schema import load_scenario

    run(load_scenario(SCENARIO), folder)
    page = browser.new_page(viewport={"width": 1000, "height": 1150})
    page.goto((folder / SCENARIO / "report.html").as_uri())
    page.screenshot(path=path)
    page.evaluate(_NUMBERS, list(NUMBERED))
    page.screenshot(path=path.with_stem("report-annotated"))
    lighten(path.with_stem("report-annotated"))
    page.close()
    return lighten(path)


def _live(browser: Any, folder: Path, path: Path) -> Path:
    """The live page some seconds after the elevator has lost 40 %."""
    with _cockpit(folder) as address:
        page = browser.new_page(viewport={"width": 1280, "height": 720})
        page.goto(address)
        _until(page, "Boolean(window.cockpit && cockpit.flight.state)")
        _until(page, f"cockpit.value('t_s') > {BREAK_AT_S}")
        page.locator("fieldset[data-surface=elevator] >> text=lose 40 %").click()
        _until(page, f"cockpit.value('t_s') > {LOOK_AT_S}")
        page.screenshot(path=path)
        page.close()
    return lighten(path)


def _until(page: Any, condition: str) -> None:
    for _ in range(int(COMPILED_WITHIN_S / 0.05)):
        if page.evaluate(condition):
            return
        page.wait_for_timeout(50)
    raise BadInput(f"the live page did not come to: {condition}")


@contextmanager
def _cockpit(folder: Path) -> Iterator[str]:
    """The address of a running live page of a healthy flight."""
    code = "from beaver_ftc.cli.main import main; main()"
    command = [sys.executable, "-c", code, "live", "--out", str(folder)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    try:
        assert process.stdout is not None
        yield process.stdout.readline().split()[1]
    finally:
        process.send_signal(signal.SIGINT)
        process.wait(30)
