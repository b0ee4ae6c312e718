"""How sweeps scale: workers side by side, what a sweep costs beside flying, memory, disk, and Ray's share.

    python benchmarks/sweep_scaling.py [--flights 2000] [--workers 2] [--ray]
    python benchmarks/sweep_scaling.py --flights 10000 --once       # one sweep, its seconds, nothing else

Bars: two workers at least 1.8 times one on 2000 flights; at most 5 % beside flying; 10,000 flights of 15 s in
under 60 s on 2 cores; memory flat in the number of flights. Speed-up wants an idle machine: rounds
alternate, and the best of each counts. `--ray` goes on with clusters of one CPU up to `--workers`, started on
this machine, and with what a batch of a million flights costs the one process that hands out and lands.
"""

import argparse
import multiprocessing
import os
import pickle
import resource
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from functools import partial
from pathlib import Path

from beaver_ftc.scenario.sweeps import Sweep, load_sweep
from beaver_ftc.studies.engine.store import Parts
from beaver_ftc.studies.engine.workers import ONE_THREAD_EACH, Batch, Row, Work, Workers
from beaver_ftc.studies.sweep.campaign import Options, run_sweep
from beaver_ftc.studies.sweep.one_flight import fly_one, scenario_of
from beaver_ftc.studies.sweep.sampling import Assignment, Plan
from beaver_ftc.studies.sweep.store import RowsAsParquet, batch_size

FLIGHTS_ALONE = 200
LONG = 1_000_000  # flights of the sweep whose batches are weighed
BATCHES = 40


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
    return seconds(lambda: _sweep(flights, lambda counts: None, **options))


def _sweep(flights: int, progress: Callable[[Counter[str]], None], **options: object) -> None:
    with tempfile.TemporaryDirectory() as out:
        run_sweep(sweep_of(flights), Options(out=Path(out), report=False, **options), progress)  # type: ignore[arg-type]


def processor_seconds(flights: int) -> tuple[float, float]:
    """Processor time a sweep takes in (its worker, its own process); other work hardly shows."""
    spent: dict[int, float] = {}

    def note(counts: Counter[str]) -> None:
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
        fly_one(sweep, flight)
    before = time.process_time()
    wall = seconds(lambda: [fly(scenario) for scenario in scenarios])
    return wall / FLIGHTS_ALONE, (time.process_time() - before) / FLIGHTS_ALONE


def memory_mb() -> float:
    """The most memory this process has had."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def compare_workers(n: int, workers: int, rounds: int) -> None:
    """Print one worker beside several."""
    measured = [(sweep_seconds(n, workers=1), sweep_seconds(n, workers=workers)) for _ in range(rounds)]
    one, many = (min(column) for column in zip(*measured, strict=True))
    print(f"{n} flights, 1 worker     {one:8.2f} s   {n / one:6.1f}/s")
    print(f"{n} flights, {workers} workers    {many:8.2f} s   {n / many:6.1f}/s")
    print(f"speed-up                    {one / many:8.2f}     bar 1.8 for 2 workers on 2000 flights")
    print(f"10,000 flights of 15 s      {many * 10_000 / n:8.0f} s   bar 60 s on 2 cores")


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


def compare_ray(n: int, workers: int) -> None:
    """Print flights a second with Ray clusters of one CPU up to `workers`, and what starting one takes."""
    import ray

    os.environ.setdefault("RAY_worker_niceness", "0")  # as local ones; Ray's default is 15
    for cpus in range(1, workers + 1):
        options = {"runtime_env": {"env_vars": ONE_THREAD_EACH}, "include_dashboard": False}
        started = seconds(lambda: ray.init(num_cpus=cpus, log_to_driver=False, **options))  # noqa: B023
        ready = seconds(lambda: sweep_seconds(4 * cpus, backend="ray"))  # noqa: B023 : each worker loads the code
        flying = sweep_seconds(n, backend="ray")
        print(
            f"{n} flights, Ray, {cpus} CPU    {flying:7.2f} s   {n / flying:6.1f}/s   "
            f"start {started:.1f} s, first flights {ready:.1f} s"
        )
        if cpus == workers:
            weigh_batches()
        ray.shutdown()


def weigh_batches() -> None:
    """What a batch of a million flights costs beside flying it: Ray's way there and back, landing, bytes.

    The rows are of real flights, flown beforehand: a task only gives them back.
    """
    from beaver_ftc.studies.engine.ray_workers import RayWorkers

    sweep = sweep_of(LONG)
    size = batch_size(sweep)
    cases = tuple(Plan(sweep).assignments(range(size)))
    rows = [fly_one(sweep, case) for case in cases]
    workers = RayWorkers(Work(partial(_flown_before, rows)), None, None)
    _through(workers, cases, 4)  # a worker's first task loads the code
    print(f"batch of {size} there and back {_each(lambda: _through(workers, cases, BATCHES))}")
    workers.close()
    with tempfile.TemporaryDirectory() as folder:
        parts = Parts(Path(folder), RowsAsParquet(sweep))
        print(f"landing it                  {_each(lambda: [parts.land(k, rows) for k in range(BATCHES)])}")
        held = sum(path.stat().st_size for path in Path(folder).iterdir()) / BATCHES / size
    there, back = (len(pickle.dumps(what)) / size for what in (cases, rows))
    print(f"bytes a flight              {there:8.0f} to a worker, {back:.0f} back, {held:.0f} on disk landed")
    print(f"memory of this process      {memory_mb():8.0f} MB at most")


def _flown_before(rows: list[Row], case: Assignment) -> Row:
    return rows[case.run]


def _each(work: Callable[[], object]) -> str:
    """The time of each of the BATCHES that this work does."""
    before = time.process_time()
    wall, own = seconds(work), time.process_time() - before
    return f"{1e3 * wall / BATCHES:8.1f} ms, {1e3 * own / BATCHES:.1f} ms of this process's processor"


def _through(workers: Workers, cases: tuple[Assignment, ...], batches: int) -> None:
    """Send batches through workers, as many at a time as a campaign does."""
    sent = back = 0
    while back < batches:
        while sent < batches and sent - back < workers.slots:
            workers.submit(Batch(sent, cases))
            sent += 1
        back += len(workers.outcomes(1.0))


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--flights", type=int, default=2000)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--ray", action="store_true")
    parser.add_argument("--once", action="store_true")
    asked = parser.parse_args()
    sweep_seconds(32, workers=1)  # compile, if need be
    if asked.once:
        took = sweep_seconds(asked.flights, workers=asked.workers)
        load = os.getloadavg()[0]
        print(f"{asked.flights} flights, {asked.workers} workers {took:8.1f} s, load average {load:.1f}")
        return
    compare_costs(asked.flights)
    compare_workers(asked.flights, asked.workers, asked.rounds)
    if asked.ray:
        compare_ray(asked.flights, asked.workers)


if __name__ == "__main__":
    main()
