"""The measurement behind `beaver-ftc bench`."""

import os
import platform
import tempfile
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from beaver_ftc.plant import addresses
from beaver_ftc.scenario.loader import load_scenario
from beaver_ftc.scenario.schema import Scenario
from beaver_ftc.studies.bench.contenders import Bare, ClosedLoop, take_over
from beaver_ftc.studies.bench.flights import by_kind
from beaver_ftc.studies.bench.parts import PARTS, frame_with
from beaver_ftc.studies.bench.plugged import InnovationDetector, ProportionalInversion
from beaver_ftc.studies.bench.stopwatch import Contender, Timing, interleave
from beaver_ftc.studies.bench.straightforward import Straightforward
from beaver_ftc.studies.bench.whole_flight import WholeFlight
from beaver_ftc.studies.engine.workers import cores

SCENARIO = "elevator-partial-loss"
BEFORE_ALARM_S, AFTER_ALARM_S = 1.0, 14.0  # the fault strikes at 12 s
FRAMES = 1000  # a block: 6 ms, short against changes of its pace, long against the clock
LONG_FLIGHT_S = 330.0  # two row groups of the log file

Say = Callable[[str], None]
Document = dict[str, Any]


def bench(rounds: int = 60, with_parts: bool = True, say: Say = lambda text: None) -> Document:
    """Time everything; the document of `bench --format json`. `say` is told what is being done.

    The figures at the top are those after the alarm: every estimator, the network and the fault-tolerant law
    at work.
    """
    scenario = load_scenario(SCENARIO)
    say("the closed loop after the alarm, part by part")
    after = _phase(scenario, AFTER_ALARM_S, rounds, with_parts)
    say("the same before the alarm")
    before = _phase(scenario, BEFORE_ALARM_S, rounds, with_parts)
    say("other ways to write the loop")
    alternatives = _alternatives(scenario, max(rounds // 6, 3))
    say("whole flights, with and without a log file")
    flights = _whole_flights(scenario, max(rounds // 10, 3))
    say("flights of sweeps, taken apart, in four kinds")
    kinds = by_kind(rounds)
    return {
        **after,
        "before_alarm": before,
        "alternatives": alternatives,
        "whole_flight": flights,
        "sweep_flights": kinds,
        "scenario": SCENARIO,
        "rounds": rounds,
        "frames_a_round": FRAMES,
        "machine": machine(),
    }


def machine() -> dict[str, Any]:
    """The kind of machine, without its name."""
    return {
        "processor": _processor(),
        "cores": cores(),
        "python": platform.python_version(),
        **{package: version(package) for package in ("jsbsim", "numba", "numpy")},
        "native_properties": addresses.available(),
    }


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.machine()
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.machine()


def _phase(scenario: Scenario, at_s: float, rounds: int, with_parts: bool) -> Document:
    """The bare aircraft, the loop, the loop with ever more of its parts; all in one aircraft, one memory."""
    names = ["calling", *(part.name for part in PARTS)] if with_parts else []
    whole = ClosedLoop(scenario, at_s)
    stages = [whole.with_frame(frame_with(i)) for i in range(len(names))]
    us = interleave([Bare(whole.moment, scenario.substeps), whole, *stages], rounds, FRAMES)
    bare, loop, steps = us[:, 0], us[:, 1], us[:, 2:]
    before = np.column_stack([bare, steps[:, :-1]]) if with_parts else steps
    return {
        **_against(bare, loop),
        "parts": {
            name: _figures("us", us) | _figures("adds_us", us - less) | _figures("ratio", us / bare)
            for name, us, less in zip(names, steps.T, before.T, strict=True)
        },
    }


def _against(bare: np.ndarray, loop: np.ndarray) -> Document:
    """Two contenders side by side, (rounds,) each: their times, and the ratio formed round by round."""
    return {**_figures("bare_us", bare), **_figures("closed_loop_us", loop), **_figures("ratio", loop / bare)}


def _figures(name: str, values: np.ndarray) -> dict[str, Any]:
    """The median over the rounds, and the quartiles as `<name>_quartiles`."""
    timing = Timing.of(values)
    return {name: round(timing.median, 4), f"{name}_quartiles": [round(timing.low, 4), round(timing.high, 4)]}


def _alternatives(scenario: Scenario, rounds: int) -> Document:
    """The loop as a user might write it, and the loop with a user's detector or law in it."""
    at_s = AFTER_ALARM_S
    contenders: dict[str, Contender] = {
        "straightforward": Straightforward(scenario, at_s, FRAMES),
        "python_detector": ClosedLoop(scenario, at_s, detector=InnovationDetector()),
        "python_law": ClosedLoop(scenario, at_s, law=ProportionalInversion()),
        "python_detector_and_law": ClosedLoop(
            scenario, at_s, detector=InnovationDetector(), law=ProportionalInversion()
        ),
        "properties_through_python": _without_native(lambda: ClosedLoop(scenario, at_s)),
    }
    bare = Bare(take_over(scenario, at_s), scenario.substeps)
    us = interleave([bare, *contenders.values()], rounds, FRAMES)
    return {
        name: {**_figures("us", column), **_figures("ratio", column / us[:, 0])}
        for name, column in zip(contenders, us[:, 1:].T, strict=True)
    }


def _without_native(make: Callable[[], Contender]) -> Contender:
    """A contender whose loop reads and writes every property through JSBSim's Python binding."""
    before = os.environ.get("BEAVER_FTC_NATIVE")
    os.environ["BEAVER_FTC_NATIVE"] = "0"
    try:
        return make()
    finally:
        if before is None:
            del os.environ["BEAVER_FTC_NATIVE"]
        else:
            os.environ["BEAVER_FTC_NATIVE"] = before


def _whole_flights(scenario: Scenario, rounds: int) -> Document:
    """From loading the aircraft to the last row of the log, over tens of thousands of frames."""
    long = scenario.model_copy(update={"duration_s": LONG_FLIGHT_S, "faults": ()})
    frames = round(LONG_FLIGHT_S * scenario.rate_hz)
    with tempfile.TemporaryDirectory() as folder:
        with_file = WholeFlight(long, Path(folder) / "log.parquet")
        bare = Bare(take_over(long, 0.0), long.substeps)
        us = interleave([bare, WholeFlight(long), with_file], rounds, frames)
    return {
        "frames": frames,
        **_against(us[:, 0], us[:, 1]),
        **_figures("with_log_file_us", us[:, 2]),
        **_figures("with_log_file_ratio", us[:, 2] / us[:, 0]),
    }
