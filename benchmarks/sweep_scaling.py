"""How sweeps scale: workers side by side, what a sweep costs beside flying, memory, and Ray's share.

    python benchmarks/sweep_scaling.py [--flights 2000] [--workers 2] [--ray]

Bars: two workers at least 1.8 times one on 2000 flights; at most 5 % beside flying; 10,000 flights of 15 s in
under 5 minutes on 2 cores; memory flat in the number of flights. Speed-up wants an idle machine: rounds
alternate, and the best of each counts.
"""

import argparse
import multiprocessing
import os
import resource
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from beaver_ftc.scenario.sweep_loader import Sweep, load_sweep
from beaver_ftc.studies.sweep.flying import Job, fly_one, scenario_of
from beaver_ftc.studies.sweep.run import Options, Tally, run_sweep
from beaver_ftc.studies.sweep.sampling import Plan

FLIGHTS_ALONE = 200


def sweep_of(flights: int) -> Sweep:
    """The built-in sweep of 15 s flights, with so many of them."""
    sweep = load_sweep("elevator-effectiveness")
    return Sweep(sweep.file.model_copy(update={"runs": flights}), sweep.base)


def seconds(work: Callable[[], object]) -> float:
    """Wall time of some work."""
    begun = time.perf_counter()
    work()
    return time.perf_counter() - begun


def sweep_seconds(flights: int, **options: object) -> float:
    """Wall time of a sweep, summary and all, but without figures."""
    return seconds(lambda: _sweep(flights, lambda tally: None, **options))


def _sweep(flights: int, progress: Callable[[Tally], None], **options: object) -> None:
    with tempfile.TemporaryDirectory() as out:
        run_sweep(sweep_of(flights), Options(out=Path(out), report=False, **options), progress)  # type: ignore[arg-type]


def processor_seconds(flights: int) -> tuple[float, float]:
    """Processor time a sweep takes in (its worker, its own process); other work hardly shows."""
    spent: dict[int, float] = {}

    def note(tally: Tally) -> None:
        spent.update(
            {worker.pid: _processor_time(worker.pid) for worker in multiprocessing.active_children()}
        )

    before = time.process_time()
    _sweep(flights, note, workers=1)
    return sum(spent.values()), time.process_time() - before


def _processor_time(pid: int) -> float:
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def flight_seconds() -> tuple[float, float]:
    """(wall, processor) time of one flight by itself: `fly`, in a process that does nothing else."""
    from beaver_ftc.loop.loop import fly

    sweep = sweep_of(FLIGHTS_ALONE)
    flights = Plan(sweep).assignments(range(FLIGHTS_ALONE))
    scenarios = [scenario_of(sweep, flight) for flight in flights]
    for flight in flights[:2]:  # what the first of a process costs
        fly_one(Job(sweep), flight)
    before = time.process_time()
    wall = seconds(lambda: [fly(scenario) for scenario in scenarios])
    return wall / FLIGHTS_ALONE, (time.process_time() - before) / FLIGHTS_ALONE


def memory_mb() -> float:
    """The most memory this process has had."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def compare_workers(n: int, workers: int, rounds: int) -> float:
    """Print one worker beside several; return the time of several."""
    measured = [(sweep_seconds(n, workers=1), sweep_seconds(n, workers=workers)) for _ in range(rounds)]
    one, many = (min(column) for column in zip(*measured, strict=True))
    print(f"{n} flights, 1 worker     {one:8.2f} s   {n / one:6.1f}/s")
    print(f"{n} flights, {workers} workers    {many:8.2f} s   {n / many:6.1f}/s")
    print(f"speed-up                    {one / many:8.2f}     bar 1.8 for 2 workers on 2000 flights")
    print(f"10,000 flights of 15 s      {many * 10_000 / n:8.0f} s   bar 300 s on 2 cores")
    return many


def compare_costs(n: int) -> None:
    """Print what a sweep costs beside flying (timed before and after, as speed drifts), and memory."""
    before = flight_seconds()
    few = memory_mb()
    worker, own = processor_seconds(n)
    wall, alone = ((a + b) / 2 for a, b in zip(before, flight_seconds(), strict=True))
    beside = (worker + own) / (n * alone) - 1
    print(f"one flight alone            {1e3 * alone:8.2f} ms of processor, {1e3 * wall:.2f} ms of wall time")
    print(
        f"beside flying               {100 * beside:8.1f} %   bar 5 % (processor time, start and summary too)"
    )
    print(f"memory                      {few:8.0f} MB before, {memory_mb():.0f} MB after {n} flights")


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--flights", type=int, default=2000)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--ray", action="store_true")
    asked = parser.parse_args()
    sweep_seconds(32, workers=1)  # compile, if need be
    compare_costs(asked.flights)
    many = compare_workers(asked.flights, asked.workers, asked.rounds)
    if asked.ray:
        clustered = sweep_seconds(asked.flights, backend="ray")
        share = 100 * (clustered / many - 1)
        print(f"Ray on the same cores       {clustered:8.2f} s   {share:+.1f} % against local")


if __name__ == "__main__":
    main()
