"""What a class costs the flight on the live page and whoever flies, by turns without and with the guests.

    python -m benchmarks.live --guests 30

No browser is needed: all pages are websockets of this process.
"""

import argparse
import asyncio
import contextlib
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
import urllib.request
from collections.abc import AsyncIterator
from http.cookiejar import CookieJar
from pathlib import Path

from websockets.asyncio.client import ClientConnection, connect
from websockets.typing import Origin

COMMAND = [sys.executable, "-c", "from beaver_ftc.cli.main import main; main()", "live"]
TURNS, TURN_S = 4, 10.0  # without the guests and with them; of a turn


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


async def measure_class(guests: int) -> None:
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
                    (await turn(flyer, [], process.pid), await turn(flyer, watchers, process.pid))
                    for _ in range(TURNS)
                ]
        finally:
            process.terminate()
            process.wait()
    print(f"{f'{guests} guests':36} {'alone':>10} {'with them':>10} {'ratio':>7}")
    for what, unit in turns[0][1]:
        alone, together = (
            statistics.median(of.get((what, unit), 0.0) for of in turn) for turn in zip(*turns, strict=True)
        )
        before, ratio = (f"{alone:.2f}", f"{together / alone:.2f}") if alone else ("", "")
        print(f"{what:36} {before:>10} {together:10.2f} {ratio:>7}  {unit}")
    print(f"{'load of the machine':36} {os.getloadavg()[0]:10.1f}  on {os.cpu_count()} cores")


async def turn(flyer: Watcher, watchers: list[Watcher], pid: int) -> dict[tuple[str, str], float]:
    """So many seconds with these looking on."""
    async with contextlib.AsyncExitStack() as there:
        for watcher in watchers:
            await there.enter_async_context(watcher.looking_on())
        await asyncio.sleep(1.0)
        for watcher in (flyer, *watchers):
            watcher.forget()
        start_s, worked_s = time.monotonic(), processor_s(pid)
        await asyncio.sleep(TURN_S)
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


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--guests", type=int, default=30)
    given = parser.parse_args()
    asyncio.run(measure_class(given.guests))


if __name__ == "__main__":
    main()
