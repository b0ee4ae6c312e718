"""How quick the live cockpit is: from command to moving aircraft, from click to surface, frames a second.

    python benchmarks/live.py [--seconds 10] [--width 1280 --height 720]
    python benchmarks/live.py --guests 30 [--seconds 10]

In a headless Chromium that draws in software. Needs Chromium on the path and the package's `dev` extra.
With --guests: what a class costs the flight and whoever flies, by turns without and with the guests. No
browser is needed: all pages are websockets of this process.
"""

import argparse
import asyncio
import contextlib
import json
import os
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
import urllib.request
from collections.abc import AsyncIterator
from http.cookiejar import CookieJar
from pathlib import Path

from playwright.sync_api import Page, sync_playwright
from websockets.asyncio.client import ClientConnection, connect
from websockets.typing import Origin

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
ARGUMENTS = ["--no-sandbox", "--disable-gpu", "--enable-unsafe-swiftshader"]  # as without a graphics card
COMMAND = [sys.executable, "-c", "from beaver_ftc.cli.main import main; main()", "live"]
CLICKS = 12
TURNS = 4  # without the guests and with them
BOTH = ("alone", "with them")

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
    parser.add_argument("--guests", type=int, default=0)
    given = parser.parse_args()
    if given.guests:
        asyncio.run(measure_class(given.guests, given.seconds))
        return
    assert CHROMIUM is not None, "there is no Chromium on this machine"
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


class Watcher:
    """A page without a browser: it counts the frames it is sent, and how late they are."""

    def __init__(self, link: str) -> None:
        jar = CookieJar()
        urllib.request.build_opener(urllib.request.HTTPCookieProcessor(jar)).open(link)
        (cookie,) = jar
        home = link.partition("?")[0]
        self._place, self._origin = home.replace("http", "ws", 1) + "socket", Origin(home.rsplit("/", 2)[0])
        self._headers = {"Cookie": f"{cookie.name}={cookie.value}"}
        self.forget()

    def forget(self) -> None:
        """Begin to count anew."""
        self.frames, self.bytes, self.jitter_ms = 0, 0, list[float]()

    @contextlib.asynccontextmanager
    async def looking_on(self) -> "AsyncIterator[None]":
        """Connected."""
        async with connect(self._place, origin=self._origin, additional_headers=self._headers) as socket:
            reading = asyncio.create_task(self._read(socket))
            yield
            reading.cancel()

    async def _read(self, socket: ClientConnection) -> None:
        async for told in socket:
            self.bytes += len(told)
            if told[:8] == '{"k":"f"':
                self.frames += 1
            elif told[:8] == '{"k":"s"':
                self.jitter_ms.append(json.loads(told)["jitter_ms"])


async def measure_class(guests: int, seconds: float) -> None:
    """Clock, frames and processor, by turns without and with the guests; medians, and their ratio."""
    with tempfile.TemporaryDirectory() as out:
        command = [*COMMAND, "--guests", str(guests), "--out", out]
        process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        assert process.stdout is not None
        try:
            flyer, *watchers = [Watcher(process.stdout.readline().split()[-1]) for _ in range(1 + guests)]
            async with flyer.looking_on():
                while not flyer.frames:  # the first flight on a machine is compiled
                    await asyncio.sleep(0.1)
                await asyncio.sleep(2.0)
                turns = [
                    (
                        await turn(flyer, [], process.pid, seconds),
                        await turn(flyer, watchers, process.pid, seconds),
                    )
                    for _ in range(TURNS)
                ]
        finally:
            process.terminate()
            process.wait()
    print(f"{f'{guests} guests':36} {BOTH[0]:>10} {BOTH[1]:>10} {'ratio':>7}")
    for what, unit in turns[0][1]:
        together = statistics.median(pair[1][what, unit] for pair in turns)
        alone = statistics.median(pair[0].get((what, unit), 0.0) for pair in turns)
        beside = (
            f"{alone:10.2f} {together:10.2f} {together / alone:7.2f}"
            if alone
            else f"{'':10} {together:10.2f} {'':7}"
        )
        print(f"{what:36} {beside}  {unit}")
    print(f"{'load of the machine':36} {os.getloadavg()[0]:10.1f}  on {os.cpu_count()} cores")


async def turn(
    flyer: Watcher, watchers: list[Watcher], pid: int, seconds: float
) -> dict[tuple[str, str], float]:
    """So many seconds with these looking on."""
    async with contextlib.AsyncExitStack() as there:
        for watcher in watchers:
            await there.enter_async_context(watcher.looking_on())
        await asyncio.sleep(1.0)
        for watcher in (flyer, *watchers):
            watcher.forget()
        start_s, worked_s = time.monotonic(), processor_s(pid)
        await asyncio.sleep(seconds)
        took_s, worked_s = time.monotonic() - start_s, processor_s(pid) - worked_s
        found = {
            ("frames to the pilot", "1/s"): flyer.frames / took_s,
            ("jitter of the flight's clock", "ms RMS"): statistics.median(flyer.jitter_ms),
            ("processor, server and flight", "cores"): worked_s / took_s,
        }
        rates = [watcher.frames / took_s for watcher in watchers]
        if rates:
            found["frames to a guest, median", "1/s"] = statistics.median(rates)
            found["frames to a guest, least", "1/s"] = min(rates)
            found["traffic to all guests", "kB/s"] = sum(watcher.bytes for watcher in watchers) / took_s / 1e3
    return found


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
    main()
