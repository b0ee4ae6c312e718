"""How long a person waits: each wait by the wall and by the processor, beside its bar.

    python benchmarks/waits.py [--rounds 5] [--long] [--beside REVISION]

Every wait is a whole process of its own, and the processor time is that of the process and of all that it
starts. A wait that compiles begins each time with a cache of its own: empty, or as a first flight leaves it.
What a flight costs beside JSBSim's frames alone is measured by `flight_cost.py`. `--long` takes also what
needs minutes or the network (`matrix`, `detectability --grid`, rare events, `reproduce`, `make demo` from a
fresh clone); `import gtm` needs the folder `BEAVER_FTC_GTM`. The processor time of a study includes its
workers, on Linux: they are no children of the command, and become this process's when it ends.

`--beside REVISION` measures in pairs: the code of that revision and today's, in turn, and prints the medians
of both and of their ratio, which a busy machine changes little.
"""

import argparse
import asyncio
import ctypes
import os
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
import tomllib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

ROOT = Path(__file__).resolve().parents[1]
ADOPT_ORPHANS = 36  # prctl(2): PR_SET_CHILD_SUBREAPER
FAULT = "elevator-partial-loss"  # 30 s at 100 Hz
OTHER_AIRCRAFT, OTHER_KIND = "mission-split-elevator-lost", "elevator-loss-in-turbulence"
RARE = "elevator-effectiveness"
DATABASE = "T2_polynomial_aerodatabase.mat"
HALF_HOUR = """\
name: half-hour
duration_s: 1800
rate_hz: 50
initial: {airspeed_mps: 45, altitude_m: 1800}
autopilot: {altitude_m: [{hold: true}], heading_deg: [{hold: true}], airspeed_mps: [{hold: true}]}
"""


class Taken(NamedTuple):
    """Seconds by the wall and of the processor, and the largest process."""

    wall: float
    processor: float
    peak_mb: float


@dataclass(frozen=True)
class Place:
    """Where a wait is measured: the code, and a folder for results and kept kernels."""

    tree: Path
    folder: Path

    @cached_property
    def body(self) -> str:
        """What the installed command of the tree does: each revision has an entry point of its own."""
        project = tomllib.loads((self.tree / "pyproject.toml").read_text(encoding="utf-8"))["project"]
        module, _, function = project["scripts"]["beaver-ftc"].partition(":")
        return f"from {module} import {function}; {function}()"

    def environment(self, cache: str) -> dict[str, str]:
        """The code of the tree, and a cache by its name."""
        own = {"PYTHONPATH": str(self.tree / "src"), "XDG_CACHE_HOME": str(self.folder / cache)}
        return {k: v for k, v in os.environ.items() if k != "NUMBA_CACHE_DIR"} | own

    def taken(self, command: list[str], cache: str = "warm") -> Taken:
        """What a process takes, with all that it starts."""
        began = time.perf_counter()
        with tempfile.TemporaryFile() as said:
            process = subprocess.Popen(
                command, cwd=self.folder, env=self.environment(cache), stdout=said, stderr=said
            )
            taken = ended(process, began)
            said.seek(0)
            if process.returncode not in (0, 1):  # 1: an expectation of a flight failed
                raise SystemExit(
                    f"{' '.join(command)} ended with {process.returncode}:\n{said.read().decode()}"
                )
        return taken

    def said(self, *words: str, cache: str = "warm") -> Taken:
        """What a command of beaver-ftc takes."""
        return self.taken([sys.executable, "-c", self.body, *words], cache)

    def without(self, name: str) -> str:
        """The name of a folder, which is removed."""
        shutil.rmtree(self.folder / name, ignore_errors=True)
        return name


def ended(process: "subprocess.Popen[Any]", began: float, wall_s: float | None = None) -> Taken:
    """Wait for the end of a process, and read what it used, with all that it has started and waited for."""
    _, status, used = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    peak_mb = used.ru_maxrss / (2**20 if sys.platform == "darwin" else 2**10)
    return Taken(wall_s or time.perf_counter() - began, used.ru_utime + used.ru_stime, peak_mb)


def with_workers(measure: Callable[[], Taken]) -> Taken:
    """What a process takes with the workers that it leaves behind, which end after it: adopted meanwhile."""
    if not sys.platform.startswith("linux"):
        return measure()
    ctypes.CDLL(None).prctl(ADOPT_ORPHANS, 1, 0, 0, 0)
    try:
        taken, left_s, peak_mb = measure(), 0.0, 0.0
        while True:
            try:
                _, _, used = os.wait3(0)
            except ChildProcessError:  # none is left
                break
            left_s, peak_mb = left_s + used.ru_utime + used.ru_stime, max(peak_mb, used.ru_maxrss / 2**10)
    finally:
        ctypes.CDLL(None).prctl(ADOPT_ORPHANS, 0, 0, 0, 0)
    return Taken(taken.wall, taken.processor + left_s, max(taken.peak_mb, peak_mb))


def after_a_first_flight(place: Place, scenario: str) -> Taken:
    """A first flight of another aircraft or kind, with what the published flight has compiled."""
    first = place.folder / "first-flight"
    if not first.exists():
        place.said("run", FAULT, "--no-report", cache=first.name)
    shutil.copytree(first, place.folder / place.without("other"))
    return place.said("run", scenario, "--no-report", cache="other")


def fresh_install(place: Place) -> Taken:
    """The first run ever."""
    return place.said("run", FAULT, "--no-report", cache=place.without("empty"))


def import_gtm(place: Place) -> Taken | None:
    """NASA's Generic Transport Model, into a folder."""
    there = os.environ.get("BEAVER_FTC_GTM")
    return place.said("import", "gtm", str(Path(there, DATABASE)), "--out", "imported") if there else None


def diagnose(place: Place) -> Taken:
    """A recorded flight of half an hour at 50 Hz, by the aircraft's own model."""
    if not (place.folder / "runs/half-hour").exists():
        (place.folder / "half-hour.yaml").write_text(HALF_HOUR, encoding="utf-8")
        place.said("run", "half-hour.yaml", "--no-report", "--as", "table")
    return place.said("diagnose", "runs/half-hour/flight.csv", "--aircraft", "beaver")


def live(place: Place) -> Taken:
    """From the command until the page has been sent frames of a flight that moves."""
    from live import Watcher

    began = time.perf_counter()
    command = [sys.executable, "-c", place.body, "live", "--out", "cockpit"]
    process = subprocess.Popen(
        command, cwd=place.folder, env=place.environment("warm"), stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL, text=True,
    )  # fmt: skip
    assert process.stdout is not None

    async def until_it_flies(link: str) -> None:
        page = Watcher(link)
        async with page.looking_on():
            while page.frames < 2:
                await asyncio.sleep(0.005)

    try:
        asyncio.run(until_it_flies(process.stdout.readline().split()[-1]))
        wall_s = time.perf_counter() - began
    finally:
        process.terminate()
    return ended(process, began, wall_s)


def demo(place: Place) -> Taken:
    """A clone of the repository, and `make demo` in it, with an empty cache: needs the network."""
    clone = f"git clone -q {ROOT} {place.without('clone')} && make -C clone demo"
    return place.taken(["sh", "-c", clone], place.without("empty"))


@dataclass(frozen=True)
class Wait:
    """A row: its name, the bar (None: there is none), how it is measured.

    fresh: what compiles is a part of it, so that nothing is warmed up before, and it is measured once.
    long: only when asked for.
    """

    name: str
    bar: float | None
    measure: Callable[[Place], Taken | None]
    fresh: bool = False
    long: bool = False


def command(*words: str) -> Callable[[Place], Taken]:
    """The wait for a command."""
    return lambda place: place.said(*words)


def study(*words: str) -> Callable[[Place], Taken]:
    """The wait for a study that begins anew: it would go on where an earlier one has ended."""

    return lambda place: with_workers(lambda: place.said(*words, "--out", place.without("study")))


def another(scenario: str) -> Callable[[Place], Taken]:
    """The wait for a first flight of this scenario."""
    return lambda place: after_a_first_flight(place, scenario)


WAITS = (
    Wait("import beaver_ftc", 0.05, lambda place: place.taken([sys.executable, "-c", "import beaver_ftc"])),
    Wait("--help", 0.15, command("--help")),
    Wait("list", 0.3, command("list")),
    Wait("validate", 0.3, command("validate", FAULT)),
    Wait("run --no-report", 1.0, command("run", FAULT, "--no-report")),
    Wait("run", 2.0, command("run", FAULT)),
    Wait("live, until the page flies", 3.0, live),
    Wait("derive a JSBSim aircraft", 4.0, command("derive", "jsbsim:c310", "--out", "derived")),
    Wait("import gtm", 8.0, import_gtm),
    Wait("diagnose, 30 min at 50 Hz", 5.0, diagnose),
    Wait("first run of a fresh install", 12.0, fresh_install, fresh=True),
    Wait("first flight of another aircraft", 2.0, another(OTHER_AIRCRAFT), fresh=True),
    Wait("first flight of another kind", 2.0, another(OTHER_KIND), fresh=True),
    Wait("matrix", None, study("matrix"), fresh=True, long=True),
    Wait("detectability --grid", None, study("detectability", "--grid", "quick"), fresh=True, long=True),
    Wait("rare events", None, study("sweep", RARE, "--rare", "no_departure"), fresh=True, long=True),
    Wait("reproduce", 60.0, study("reproduce"), fresh=True, long=True),
    Wait("make demo from a fresh clone", 45.0, demo, fresh=True, long=True),
)  # fmt: skip


def measured(wait: Wait, places: Sequence[Place], rounds: int) -> list[list[Taken]]:
    """What a wait takes in each place, round after round; nothing where it cannot be measured.

    The first process warms up what is kept on purpose; places take turns to go first.
    """
    if not wait.fresh:
        for place in places:
            wait.measure(place)
    found = []
    for k in range(rounds):
        taken = {place: wait.measure(place) for place in (places if k % 2 else places[::-1])}
        found.append([of for place in places if (of := taken[place])])
    return found if all(found) else []


def alone(wait: Wait, found: list[list[Taken]]) -> list[str]:
    """Wall, processor, memory and bar of a wait: medians, and the largest of the peaks."""
    bar = "-" if wait.bar is None else f"{wait.bar:.2f}"
    if not found:
        return ["-", "-", "-", bar]
    wall, processor, peaks = zip(*(taken for (taken,) in found), strict=True)
    return [f"{statistics.median(wall):.2f}", f"{statistics.median(processor):.2f}", f"{max(peaks):.0f}", bar]


def in_pairs(wait: Wait, found: list[list[Taken]]) -> list[str]:
    """Then, now, and the median of their ratios, by the processor."""
    rows = [(then.processor, now.processor, now.processor / then.processor) for then, now in found]
    return [f"{statistics.median(of):.2f}" for of in zip(*rows, strict=True)]


def printed(name: str, cells: Sequence[str]) -> None:
    """A line of the table."""
    print(f"{name:34}" + "".join(f"{cell:>14}" for cell in cells), flush=True)


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--long", action="store_true", help="also what needs minutes or the network")
    parser.add_argument("--beside", metavar="REVISION", help="in pairs with the code of a revision")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        places, cells = [Place(ROOT, Path(folder, "now"))], alone
        if given.beside:
            import flight_cost  # not above: a process begins as large as the one it is forked from

            tree = flight_cost.unpack(given.beside, Path(folder, "code"))
            places, cells = [Place(tree, Path(folder, "then")), *places], in_pairs
            printed("processor, s", (given.beside, "now", "now/then"))
        else:
            printed("", ("wall, s", "processor, s", "peak, MB", "bar, s"))
        for place in places:
            place.folder.mkdir()
        for wait in WAITS:
            if given.long or not wait.long:
                rounds = len(places) if wait.fresh else given.rounds
                printed(wait.name, cells(wait, measured(wait, places, rounds)))
    return 0


if __name__ == "__main__":
    sys.exit(main())
