"""A headless Chromium: just enough to open a page, act on it and look."""

import shutil
from pathlib import Path
from typing import Any

PROGRAM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")


class Browser:
    """One page. `trouble` collects everything that the page's console says, and every error in it."""

    def __init__(self, profile: Path) -> None:
        from playwright.sync_api import sync_playwright

        self._driver = sync_playwright().start()
        self._context = self._driver.chromium.launch_persistent_context(
            profile,
            executable_path=PROGRAM,
            headless=True,
            args=["--no-sandbox", "--disable-gpu"],
            viewport={"width": 1300, "height": 1000},
        )
        self._page = self._context.new_page()
        self._session = self._context.new_cdp_session(self._page)
        self.trouble: list[Any] = []
        for event in ("console", "pageerror", "requestfailed"):
            self._page.on(event, self._note)

    def _note(self, said: Any) -> None:
        self.trouble.append(said)

    def call(self, method: str, **parameters: Any) -> Any:
        """Call a method of the browser's debugging protocol, for what Playwright has no word for."""
        return self._session.send(method, parameters)

    def evaluate(self, script: str) -> Any:
        """The value of a JavaScript expression, a promise awaited."""
        return self._page.evaluate(script)

    def open(self, page: Path) -> None:
        """Open a file and wait until it has drawn itself."""
        self._page.goto(page.as_uri())
        self.settle()

    def settle(self) -> None:
        """Wait for two frames: one to be asked for, one to be drawn."""
        self.evaluate(
            "new Promise((done) => "
            "requestAnimationFrame(() => requestAnimationFrame(() => setTimeout(done, 60))))"
        )

    def mouse(self, kind: str, x: float, y: float) -> None:
        """Press, move or release the left button at a point of the window."""
        self.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", buttons=1, clickCount=1)

    def screenshot(self) -> bytes:
        """The window as PNG."""
        return self._page.screenshot()

    def close(self) -> None:
        """End the browser."""
        self._context.close()
        self._driver.stop()
