"""A headless Chromium, and how to wait for what its page shows."""

import json
import shutil

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
ARGUMENTS = (  # as on a machine without a graphics card
    "--no-sandbox", "--disable-gpu", "--enable-unsafe-swiftshader", "--enable-precise-memory-info",
    "--js-flags=--expose-gc",
)  # fmt: skip
WAIT_S, COMPILED_WITHIN_S = 60.0, 600.0


def until(page, condition, wait_s=WAIT_S):
    """Wait for a condition in the page. Not Playwright's own: the page's policy forbids evaluating text."""
    for _ in range(int(wait_s / 0.05)):
        if page.evaluate(condition):
            return True
        page.wait_for_timeout(50)
    raise AssertionError(f"not in {wait_s:g} s: {condition}")


def shows(page, selector, part):
    """Whether an element comes to show a text: the page draws a frame only when the screen next asks."""
    return until(
        page, f"document.querySelector({json.dumps(selector)})?.textContent.includes({json.dumps(part)})"
    )
