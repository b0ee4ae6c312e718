"""Who flies: the contract of a backend, and the local one, a handful of processes.

A task is some flights of a batch. A crew flies tasks and hands back their rows, or says that the worker was
lost.
"""

import contextlib
import os
import signal
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from typing import Any, NamedTuple, Protocol

from beaver_ftc.errors import SimulationFailed
from beaver_ftc.studies.sweep import processes
from beaver_ftc.studies.sweep.flying import Job, fly_all, warm_up
from beaver_ftc.studies.sweep.sampling import Assignment
from beaver_ftc.studies.sweep.table import Row

_READY = "ready"


class Task(NamedTuple):
    """Flights to be flown one after the other by one worker."""

    batch: int
    flights: tuple[Assignment, ...]


class Outcome(NamedTuple):
    """What became of a task: its rows, or None if the worker was lost over it."""

    task: Task
    rows: list[Row] | None


class Crew(Protocol):
    """A backend."""

    @property
    def slots(self) -> int:
        """How many tasks to keep in its hands, so that no worker waits."""

    def submit(self, task: Task) -> None:
        """Take a task; never more at a time than `slots`."""

    def outcomes(self, timeout_s: float) -> list[Outcome]:
        """The tasks that have ended, as soon as there is one, or none when the time is over."""

    def close(self) -> None:
        """Send everybody home, whatever they are doing."""


@dataclass(eq=False)
class _Worker:
    process: Any
    connection: Connection
    ready: bool = False
    task: Task | None = None


class LocalCrew:
    """Processes on this machine. One that dies is replaced, and its task handed back as lost."""

    def __init__(self, job: Job, workers: int) -> None:
        self._job = job
        self._context = processes.context()
        self._workers = [self._hire()]
        wait(
            [self._workers[0].connection]
        )  # the first compiles, should that be needed; the others find it done
        self._workers += [self._hire() for _ in range(workers - 1)]

    @property
    def slots(self) -> int:
        return len(self._workers)

    def submit(self, task: Task) -> None:
        worker = next(worker for worker in self._workers if worker.task is None)
        worker.task = task
        with contextlib.suppress(OSError):  # dead already: seen when its outcome is waited for
            worker.connection.send(task.flights)

    def outcomes(self, timeout_s: float) -> list[Outcome]:
        heard = wait([worker.connection for worker in self._workers], timeout_s)
        spoken = [worker for worker in self._workers if worker.connection in heard]
        return [outcome for worker in spoken if (outcome := self._hear(worker))]

    def close(self) -> None:
        for worker in self._workers:
            worker.connection.close()
            worker.process.terminate()
        for worker in self._workers:
            worker.process.join()

    def _hire(self) -> _Worker:
        ours, theirs = self._context.Pipe()
        process = self._context.Process(target=serve, args=(theirs, self._job), daemon=True)
        with processes.single_threaded():
            process.start()
        theirs.close()
        return _Worker(process, ours)

    def _hear(self, worker: _Worker) -> Outcome | None:
        try:
            said = worker.connection.recv()
        except (EOFError, OSError):
            return self._lost(worker)
        if said == _READY:
            worker.ready = True
            return None
        if isinstance(said, Exception):
            raise SimulationFailed(f"a worker cannot go on: {said}")
        task, worker.task = worker.task, None
        assert task is not None
        return Outcome(task, said)

    def _lost(self, worker: _Worker) -> Outcome | None:
        worker.process.join()
        worker.connection.close()
        if not worker.ready:
            raise SimulationFailed(f"a worker process cannot start (exit status {worker.process.exitcode})")
        self._workers[self._workers.index(worker)] = self._hire()
        return Outcome(worker.task, None) if worker.task else None


def serve(connection: Connection, job: Job) -> None:
    """The life of a worker process: fly what comes until nobody is there any more."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the terminal's Ctrl-C is for the one who gives the orders
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    with silence(), contextlib.suppress(EOFError, OSError):
        warm_up(job)
        connection.send(_READY)
        while True:
            connection.send(_flown(job, connection.recv()))


def _flown(job: Job, flights: Sequence[Assignment]) -> list[Row] | Exception:
    try:
        return fly_all(job, flights)
    except Exception as error:  # not a flight's: those are in their rows
        return SimulationFailed(str(error))


@contextlib.contextmanager
def silence() -> Iterator[None]:
    """Whatever a library prints meanwhile, on whatever level, goes nowhere: the output is the sweep's own."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    kept = {stream: os.dup(stream) for stream in (1, 2)}
    for stream in kept:
        os.dup2(nowhere, stream)
    try:
        yield
    finally:
        for stream, copy in kept.items():
            os.dup2(copy, stream)
            os.close(copy)
        os.close(nowhere)
