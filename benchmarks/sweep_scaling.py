"""How sweeps scale: workers side by side, what a sweep costs beside flying, memory, and Ray's share.

    python benchmarks/sweep_scaling.py [--flights 2000] [--workers 2] [--ray]

Bars: two workers at least 1.8 times one on 2000 flights; at most 5 % beside flying; 10,000 flights of 15 s in
under 5 minutes on 2 cores; memory flat in the number of flights. Wants an idle machine. Rounds alternate, and
each figure is the best of its rounds, which is what an idle machine would give.
"""

import argparse
import resource
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from beaver_ftc.scenario.sweep_loader import Sweep, load_sweep
from beaver_ftc.sweep.flying import Job, fly_all, scenario_of
from beaver_ftc.sweep.run import Options, run_sweep
from beaver_ftc.sweep.sampling import Plan

ROUNDS = 3
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
    with tempfile.TemporaryDirectory() as out:
        return seconds(lambda: run_sweep(sweep_of(flights), Options(out=Path(out), report=False, **options)))  # type: ignore[arg-type]


def flight_seconds() -> float:
    """Time of one flight by itself: `fly`, in a process that does nothing else."""
    from beaver_ftc.loop import fly

    sweep = sweep_of(FLIGHTS_ALONE)
    flights = Plan(sweep).assignments(range(FLIGHTS_ALONE))
    scenarios = [scenario_of(sweep, flight) for flight in flights]
    fly_all(Job(sweep), flights[:2])
    return seconds(lambda: [fly(scenario) for scenario in scenarios]) / FLIGHTS_ALONE


def parent_memory_mb() -> float:
    """The most memory this process has had."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def worker_memory_mb() -> float:
    """The most memory any worker has had."""
    return resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--flights", type=int, default=2000)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--rounds", type=int, default=ROUNDS)
    parser.add_argument("--ray", action="store_true")
    asked = parser.parse_args()
    n, workers = asked.flights, asked.workers
    sweep_seconds(32, workers=1)  # compile, if need be
    before = parent_memory_mb()
    rounds = [
        (flight_seconds(), sweep_seconds(n, workers=1), sweep_seconds(n, workers=workers))
        for _ in range(asked.rounds)
    ]
    alone, one, many = (min(column) for column in zip(*rounds, strict=True))
    print(f"one flight alone          {1e3 * alone:8.2f} ms")
    print(f"{n} flights, 1 worker   {one:8.2f} s   {n / one:6.1f}/s")
    print(f"{n} flights, {workers} workers  {many:8.2f} s   {n / many:6.1f}/s")
    print(f"speed-up                  {one / many:8.2f}     bar 1.8 for 2 workers")
    print(f"beside flying, 1 worker   {100 * (1 - n * alone / one):8.1f} %   bar 5 %")
    print(f"10,000 flights of 15 s    {many * 10_000 / n:8.0f} s   bar 300 s on 2 cores")
    few = parent_memory_mb()
    print(f"parent's memory           {before:8.0f} MB after 32 flights, {few:.0f} MB after {n}")
    print(f"worker's memory           {worker_memory_mb():8.0f} MB at most")
    if asked.ray:
        clustered = sweep_seconds(n, backend="ray")
        print(
            f"Ray on the same cores     {clustered:8.2f} s   {100 * (clustered / many - 1):+.1f} % against local"
        )


if __name__ == "__main__":
    main()
