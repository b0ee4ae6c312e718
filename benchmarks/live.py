"""How quick the live cockpit is: from command to moving aircraft, from click to surface, frames a second.

    python benchmarks/live.py [--seconds 10] [--width 1280 --height 720]

In a headless Chromium that draws in software. Needs Chromium on the path and the package's `dev` extra.
"""

import argparse
import os
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from playwright.sync_api import Page, sync_playwright

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
ARGUMENTS = ["--no-sandbox", "--disable-gpu", "--enable-unsafe-swiftshader"]  # as without a graphics card
COMMAND = [sys.executable, "-c", "from beaver_ftc.cli.main import main; main()", "live"]
CLICKS = 12

# From the press of a button to the first frame message in which that surface stands off its command, ms.
CLICK_TO_SURFACE = """(label) => new Promise((done) => {
  const group = document.querySelector("fieldset[data-surface=rudder]");
  const button = [...group.querySelectorAll("[data-label]")].find((each) => each.dataset.label === label);
  const start = performance.now();
  button.click();
  const look = () => {
    const off = Math.abs(cockpit.value("rudder_effective_rad") - cockpit.value("rudder_cmd_rad"));
    if (off > 1e-4) done(performance.now() - start); else setTimeout(look, 0);
  };
  look();
})"""

# Frames a second and the share of intervals longer than one and a half of a 60th.
FRAMES = """(seconds) => new Promise((done) => {
  const at = [], start = performance.now();
  const look = (now) => {
    at.push(now);
    if (now - start < 1000 * seconds) { requestAnimationFrame(look); return; }
    const gaps = at.slice(1).map((t, i) => t - at[i]);
    const late = gaps.filter((gap) => gap > 25).length / gaps.length;
    done({ fps: 1000 * gaps.length / (at.at(-1) - at[0]), late });
  };
  requestAnimationFrame(look);
})"""


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--width", type=int, default=1280)
    parser.add_argument("--height", type=int, default=720)
    given = parser.parse_args()
    with sync_playwright() as driver, tempfile.TemporaryDirectory() as out:
        browser = driver.chromium.launch(executable_path=CHROMIUM, args=ARGUMENTS)
        page = browser.new_page(viewport={"width": given.width, "height": given.height})
        start_s = time.perf_counter()
        process = subprocess.Popen([*COMMAND, "--out", out], stdout=subprocess.PIPE, text=True)
        try:
            measure(page, process, start_s, given.seconds)
        finally:
            browser.close()
            start_s = time.perf_counter()
            process.terminate()
            process.wait()
            say("from SIGTERM to the end", time.perf_counter() - start_s, "s")


def measure(page: Page, process: "subprocess.Popen[str]", start_s: float, seconds: float) -> None:
    """One flight, looked at from outside."""
    assert process.stdout is not None
    address = process.stdout.readline().split()[1]
    say("from command to address", time.perf_counter() - start_s, "s")
    page.goto(address)
    until(page, "Boolean(window.cockpit && cockpit.value('t_s') > 0.05 && cockpit.drawn.frames > 1)")
    say("from command to moving aircraft", time.perf_counter() - start_s, "s")
    say("of it processor, server and flight", processor_s(process.pid), "s")
    page.wait_for_timeout(3000)
    frames = page.evaluate(FRAMES, seconds)
    say("frames drawn", frames["fps"], "1/s")
    say("frames later than 25 ms", 100 * frames["late"], "%")
    say(
        "drawing, this page's own part",
        page.evaluate("cockpit.drawn.ms / cockpit.drawn.frames"),
        "ms a frame",
    )
    say("jitter of the flight's clock", page.evaluate("cockpit.flight.state.jitter_ms"), "ms RMS")
    messages = page.evaluate("[cockpit.traffic.frames, cockpit.traffic.bytes, cockpit.value('t_s')]")
    say("messages", messages[0] / messages[2], "1/s")
    say("traffic", messages[1] / messages[2] / 1e3, "kB/s")
    clicks = [click(page) for _ in range(CLICKS)]
    say("from click to surface, median", statistics.median(clicks), "ms")
    say("from click to surface, longest", max(clicks), "ms")
    print(f"{'load of the machine':36} {os.getloadavg()[0]:8.1f}  on {os.cpu_count()} cores")


def processor_s(pid: int) -> float:
    """Processor time of a process and of those it started, s; not a number where there is no /proc."""
    try:
        times = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[11:13]
        children = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
    except OSError:
        return float("nan")
    return sum(map(int, times)) / os.sysconf("SC_CLK_TCK") + sum(
        processor_s(int(child)) for child in children
    )


def click(page: Page) -> float:
    """Bias the rudder, repair it; ms until it showed."""
    took_ms = float(page.evaluate(CLICK_TO_SURFACE, "bias"))
    page.wait_for_timeout(200)
    page.evaluate("document.querySelector('#repair-all').click()")
    page.wait_for_timeout(400)
    return took_ms


def until(page: Page, condition: str) -> None:
    """Wait for a condition in the page."""
    while not page.evaluate(condition):
        page.wait_for_timeout(10)


def say(what: str, value: float, unit: str) -> None:
    """One line."""
    print(f"{what:36} {value:8.2f}  {unit}", flush=True)


if __name__ == "__main__":
    assert CHROMIUM is not None, f"there is no Chromium on this machine ({Path(__file__).name} needs one)"
    main()
