"""The measurement behind `beaver-ftc bench`."""

import platform
import tempfile
from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import dataclass
from importlib.metadata import version
from itertools import pairwise
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from beaver_ftc.commands import Reporter, StudyCommand
from beaver_ftc.loop.loop import fly
from beaver_ftc.plant import addresses
from beaver_ftc.results.log import ParquetLog
from beaver_ftc.results.model import Document
from beaver_ftc.scenario.schema import Scenario, load_scenario
from beaver_ftc.studies.bench.contenders import (
    Bare,
    ClosedLoop,
    Contender,
    InnovationDetector,
    ProportionalInversion,
    interleave,
    take_over,
)
from beaver_ftc.studies.bench.parts import PARTS, frame_with
from beaver_ftc.studies.bench.shown import text_of
from beaver_ftc.studies.bench.straightforward import Straightforward
from beaver_ftc.studies.bench.sweep_flights import by_kind
from beaver_ftc.studies.engine.processes import cores, environment

SCENARIO = "elevator-partial-loss"
BEFORE_ALARM_S, AFTER_ALARM_S = 1.0, 14.0  # the fault strikes at 12 s
# Frames timed at once: 6 ms, in which the machine keeps its speed; long against the clock. From
# BEFORE_ALARM_S on, they must end before the fault.
FRAMES = 1000
LONG_FLIGHT_S = 330.0  # three row groups of the log file

Say = Callable[[str], None]


def bench(rounds: int, with_parts: bool, say: Say = lambda text: None) -> Document:
    """Time everything; the document of `bench --format json`. say: takes a line for each step.

    The numbers at the top level are those after the alarm, when all estimators, the network and the
    fault-tolerant law work.
    """
    scenario = load_scenario(SCENARIO)
    say("the closed loop after the alarm, part by part")
    document = _phase(scenario, AFTER_ALARM_S, rounds, with_parts)
    say("the same before the alarm")
    document["before_alarm"] = _phase(scenario, BEFORE_ALARM_S, rounds, with_parts)
    say("other ways to write the loop")
    document["alternatives"] = _alternatives(scenario, max(rounds // 6, 3))
    say("whole flights, with and without a log file")
    document["whole_flight"] = _whole_flights(scenario, max(rounds // 10, 3))
    say("flights of sweeps, taken apart, by kind")
    document["sweep_flights"] = by_kind(rounds)
    return document | {
        "scenario": SCENARIO, "rounds": rounds, "frames_a_round": FRAMES, "machine": machine()
    }  # fmt: skip


def machine() -> Document:
    """The kind of machine, without its name."""
    return {
        "processor": _processor(),
        "cores": cores(),
        "python": platform.python_version(),
        **{package: version(package) for package in ("jsbsim", "numba", "numpy")},
        "native_properties": addresses.available(),
    }


def _processor() -> str:
    """Name of the processor on Linux; elsewhere its architecture."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.machine()
    names = (line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    return next(names, platform.machine())


def _phase(scenario: Scenario, at_s: float, rounds: int, with_parts: bool) -> Document:
    """Time of the bare aircraft, of the loop, and of the loop with one more part at each step, first without
    any ("calling"). All fly the same aircraft in the same memory.

    us, us_without (rounds,): time of a frame, microseconds, with the parts up to a part, and without this
    part.
    """
    names = ["calling", *PARTS] if with_parts else []
    whole_loop = ClosedLoop(scenario, at_s)
    stages = [whole_loop.with_frame(frame_with(i)) for i in range(len(names))]
    contenders: list[Contender] = [Bare(whole_loop.moment, scenario.substeps), whole_loop, *stages]
    bare, loop, *steps = interleave(contenders, rounds, FRAMES).T
    parts = {
        name: _figures("us", us) | _figures("adds_us", us - us_without) | _figures("ratio", us / bare)
        for name, (us_without, us) in zip(names, pairwise([bare, *steps]), strict=True)
    }
    return _against(bare, loop) | {"parts": parts}


def _against(bare: np.ndarray, loop: np.ndarray) -> Document:
    """Medians of two times (rounds,), microseconds, and of their ratio in each round."""
    return {**_figures("bare_us", bare), **_figures("closed_loop_us", loop), **_figures("ratio", loop / bare)}


def _figures(name: str, values: np.ndarray) -> Document:
    """The median over the rounds, and the quartiles as `<name>_quartiles`."""
    low, median, high = np.quantile(values, (0.25, 0.5, 0.75)).round(4).tolist()
    return {name: median, f"{name}_quartiles": [low, high]}


def _alternatives(scenario: Scenario, rounds: int) -> Document:
    """Times of a loop as a user might write it, and of our loop with a detector or law in Python, or with all
    properties through Python."""
    at_s = AFTER_ALARM_S
    contenders: dict[str, Contender] = {
        "straightforward": Straightforward(scenario, at_s, FRAMES),
        "python_detector": ClosedLoop(scenario, at_s, detector=InnovationDetector()),
        "python_law": ClosedLoop(scenario, at_s, law=ProportionalInversion()),
        "python_detector_and_law": ClosedLoop(scenario, at_s, InnovationDetector(), ProportionalInversion()),
    }
    with environment({"BEAVER_FTC_NATIVE": "0"}):  # every property through JSBSim's Python binding
        contenders["properties_through_python"] = ClosedLoop(scenario, at_s)
    bare = Bare(take_over(scenario, at_s), scenario.substeps)
    bare_us, *others = interleave([bare, *contenders.values()], rounds, FRAMES).T
    return {
        name: _figures("us", us) | _figures("ratio", us / bare_us)
        for name, us in zip(contenders, others, strict=True)
    }


def _whole_flights(scenario: Scenario, rounds: int) -> Document:
    """Time of whole flights, from loading the aircraft to the last row of the log."""
    long_flight = scenario.model_copy(update={"duration_s": LONG_FLIGHT_S, "faults": ()})
    frames = round(LONG_FLIGHT_S * scenario.rate_hz)
    with tempfile.TemporaryDirectory() as folder:
        with_file = WholeFlight(long_flight, Path(folder) / "log.parquet")
        bare_aircraft = Bare(take_over(long_flight, 0.0), long_flight.substeps)
        bare, loop, logged = interleave(
            [bare_aircraft, WholeFlight(long_flight), with_file], rounds, frames
        ).T
    figures = _figures("with_log_file_us", logged) | _figures("with_log_file_ratio", logged / bare)
    return {"frames": frames, **_against(bare, loop), **figures}


@dataclass(frozen=True)
class WholeFlight:
    """A flight by `fly`. log: the file of its log; None for no log."""

    scenario: Scenario
    log: Path | None = None

    def prepare(self) -> None:
        """There is no state to return to: every flight is a new one."""

    def fly(self, frames: int) -> None:
        """Fly the scenario, which must last that many frames."""
        with ParquetLog(self.log) if self.log else nullcontext() as log:
            fly(self.scenario, log)


@dataclass(frozen=True)
class Bench(StudyCommand):
    """Time the closed loop against the bare aircraft.

    The command times the loop and the bare aircraft in turn. It also times the parts of the loop: it switches
    them on one after another and measures what each adds. In the first run, the code of a frame is compiled
    again for each part. This compilation takes about two minutes.

    Examples:
      beaver-ftc bench --no-parts

    rounds: Number of repetitions of each measurement of the loop. The alternatives take a sixth of them, and
      whole flights a tenth, at least 3.
    no_parts: Time only the whole loop, not its parts.
    """

    rounds: Annotated[int, typer.Option(min=3, max=10000)] = 60
    no_parts: bool = False

    PLUGINS = False

    def run(self, reporter: Reporter) -> Document:
        """Time everything."""
        return bench(self.rounds, not self.no_parts, say=lambda step: reporter.say(f"timing {step}"))

    def as_text(self, document: Document, colour: bool) -> str:
        """The times."""
        return text_of(document)
