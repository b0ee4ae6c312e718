"""Who flies: the contract of a backend, worker processes on this machine, and this very process.

A task is some cases of a batch. A crew flies tasks and hands back their rows, or says that the worker was
lost.
"""

import contextlib
import multiprocessing
import os
import signal
import threading
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from typing import Any, NamedTuple, Protocol

from beaver_ftc.documents.errors import SimulationFailed
from beaver_ftc.studies.engine import processes

LEAVES_S = 5.0  # a pool's thread, once its workers have ended: milliseconds

Row = Any
Nothing = Callable[[], None]


class Case(NamedTuple):
    """One case of a study: its place in it, and what there is to fly."""

    run: int
    what: Any


class Task(NamedTuple):
    """Cases to be flown one after the other by one worker; each has a `run`."""

    batch: int
    cases: tuple[Any, ...]


class Outcome(NamedTuple):
    """What became of a task: its rows, or None if the worker was lost over it."""

    task: Task
    rows: list[Row] | None


class Work(NamedTuple):
    """What a worker does: fly a case; and once, before its first, what warms it up. Both can be pickled."""

    fly: Callable[[Any], Row]
    warm_up: Nothing | None = None

    def all(self, cases: Sequence[Any]) -> list[Row]:
        """Fly one after the other."""
        return [self.fly(case) for case in cases]


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
        """Terminate all workers, whatever they are doing."""


class ThisProcess:
    """A crew of one that needs no other process, and so does not survive a flight that kills it."""

    slots = 1

    def __init__(self, work: Work) -> None:
        self._work = work
        self._tasks: deque[Task] = deque()

    def submit(self, task: Task) -> None:
        self._tasks.append(task)

    def outcomes(self, timeout_s: float) -> list[Outcome]:
        task = self._tasks.popleft()
        return [Outcome(task, self._work.all(task.cases))]

    def close(self) -> None:
        self._tasks.clear()


class _Worker:
    """A process of its own: one that dies takes nobody else's task with it."""

    def __init__(self, work: Work) -> None:
        self._pool = ProcessPoolExecutor(
            1, mp_context=processes.context(), initializer=_begin, initargs=(work,)
        )
        with processes.single_threaded():
            self.pid: Future[int] = self._pool.submit(os.getpid)

    def fly(self, task: Task) -> "Future[list[Row]]":
        return self._pool.submit(_fly, task.cases)

    def started(self) -> bool:
        return self.pid.done() and self.pid.exception() is None

    def end(self) -> None:
        """Terminate it, started or not. Its futures are left to fail: a pool that breaks cannot fail
        cancelled ones, and says so in a traceback. Its thread is waited for: an interpreter that exits while
        the thread closes its pipe writes to that, and says so too.
        """
        running = [*(self._pool._processes or {}).values()]
        thread: Any = self._pool._executor_manager_thread
        self._pool.shutdown(wait=False)
        for process in running:
            process.terminate()
        if thread is not None:
            thread.join(LEAVES_S)


class LocalCrew:
    """Processes on this machine. One that dies is replaced, and its task handed back as lost."""

    def __init__(self, work: Work, workers: int) -> None:
        self._work, self.slots = work, workers
        self._idle = [_Worker(work)]
        wait([self._idle[0].pid])  # the first compiles, should that be needed; the others find it done
        self._idle += [_Worker(work) for _ in range(workers - 1)]
        self._busy: dict[Future[list[Row]], tuple[_Worker, Task]] = {}

    def submit(self, task: Task) -> None:
        worker = self._idle.pop()
        try:
            flying = worker.fly(task)
        except BrokenProcessPool as error:  # it died while idle
            flying = Future()
            flying.set_exception(error)
        self._busy[flying] = worker, task

    def outcomes(self, timeout_s: float) -> list[Outcome]:
        done, _ = wait(self._busy, timeout_s, FIRST_COMPLETED)
        return [self._outcome(flown) for flown in done]

    def close(self) -> None:
        for worker in (*self._idle, *(worker for worker, _ in self._busy.values())):
            worker.end()

    def _outcome(self, flown: "Future[list[Row]]") -> Outcome:
        worker, task = self._busy.pop(flown)
        try:
            rows = flown.result()
        except BrokenProcessPool:
            self._idle.append(self._replacement(worker))
            return Outcome(task, None)
        except Exception as error:  # not a flight's: those are in their rows
            self._idle.append(worker)
            raise SimulationFailed(f"a worker cannot go on: {error}") from error
        self._idle.append(worker)
        return Outcome(task, rows)

    def _replacement(self, lost: _Worker) -> _Worker:
        if not lost.started():
            raise SimulationFailed("a worker process cannot start: it ended before its first flight")
        return _Worker(self._work)


_OF_THIS_PROCESS: list[Work] = []  # a worker's only one


def _begin(work: Work) -> None:
    """Make this process a worker: silent, deaf to the terminal's Ctrl-C, and warm."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # it is for the process that gives the orders
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    _silence()
    _OF_THIS_PROCESS[:] = [work]
    if work.warm_up:
        work.warm_up()


def _end_with_parent() -> None:
    """A worker whose parent has been killed has nobody to fly for."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def _fly(cases: Sequence[Any]) -> list[Row]:
    return _OF_THIS_PROCESS[0].all(cases)


def _silence() -> dict[int, int]:
    """Send whatever a library prints, on whatever level, nowhere; the streams as they were."""
    kept = {stream: os.dup(stream) for stream in (1, 2)}
    nowhere = os.open(os.devnull, os.O_WRONLY)
    for stream in kept:
        os.dup2(nowhere, stream)
    os.close(nowhere)
    return kept


@contextlib.contextmanager
def silence() -> Iterator[None]:
    """Whatever a library prints meanwhile goes nowhere: the output is the study's own."""
    kept = _silence()
    try:
        yield
    finally:
        for stream, copy in kept.items():
            os.dup2(copy, stream)
            os.close(copy)
