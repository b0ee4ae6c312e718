"""Workers that fly: the contract of a backend, worker processes on this machine, and this very process.

A task is a batch, or some of its cases. Workers fly tasks and hand back their rows, or say that one was lost
over it.

Each worker is a pool of its own. In one pool of several, Python's or loky's, one that is killed takes the
tasks of all the others with it (loky: TerminatedWorkerError in each), so nothing tells which case kills.
"""

import contextlib
import multiprocessing
import os
import signal
import threading
import time
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

from beaver_ftc.documents.errors import SimulationFailed
from beaver_ftc.studies.engine.processes import (
    context,
    kill_fork_server,
    silence_this_process,
    single_threaded,
    start_early,
)

MAX_JOIN_S = 5.0  # how long to wait for a pool's thread; it ends milliseconds after its worker
# Starts of a worker, each later, should the process that it is forked from be killed meanwhile: one that is
# killed closes its pipe before the system says that it has ended, so what comes at once finds it still there.
STARTS_AFTER_S = (0.0, 0.1, 1.0)

Row = Any
Number = int | str  # of a batch: what its file is called


class Batch(NamedTuple):
    """Cases that land together, or those of them that one worker flies in turn; runs: their places."""

    number: Number
    runs: Sequence[int]
    cases: Sequence[Any]


class Outcome(NamedTuple):
    """The outcome of a task: its rows, or None if the worker was lost over it."""

    task: Batch
    rows: list[Row] | None


class Work(NamedTuple):
    """The work of a worker: to fly a case; and once, before its first, to warm up. Both can be pickled."""

    fly: Callable[[Any], Row]
    warm_up: Callable[[], None] | None = None

    def all(self, cases: Sequence[Any]) -> list[Row]:
        """Fly one after the other."""
        return [self.fly(case) for case in cases]


class Workers(Protocol):
    """A backend."""

    @property
    def slots(self) -> int:
        """How many tasks to keep in its hands, so that no worker waits."""

    def submit(self, task: Batch) -> None:
        """Take a task; never more at a time than `slots`."""

    def outcomes(self, timeout_s: float) -> list[Outcome]:
        """The tasks that have ended, as soon as there is one, or none when the time is over."""

    def close(self) -> None:
        """Terminate all workers, whatever they are doing."""


@dataclass
class ThisProcess:
    """The one worker that needs no other process, and so does not survive a flight that kills it."""

    work: Work
    slots = 1

    def submit(self, task: Batch) -> None:
        self._task = task

    def outcomes(self, timeout_s: float) -> list[Outcome]:
        return [Outcome(self._task, self.work.all(self._task.cases))]

    def close(self) -> None:
        """There is no other process to terminate."""


class _Worker:
    """A process of its own: one that dies takes nobody else's task with it."""

    def __init__(self, work: Work) -> None:
        for pause_s in STARTS_AFTER_S:
            time.sleep(pause_s)
            self._pool = ProcessPoolExecutor(1, mp_context=context(), initializer=_begin, initargs=(work,))
            with contextlib.suppress(EOFError, ConnectionError):  # what it is forked from was killed: again
                self.pid = self._started()
                return
        raise SimulationFailed("a worker process cannot start: what it is forked from is ended, each time")

    def _started(self) -> "Future[int]":
        # What the worker is forked from is deaf to Ctrl-C; to wait for it, for its imports, is not.
        start_early()
        forked = context().get_start_method() == "forkserver"
        try:
            with contextlib.nullcontext() if forked else single_threaded():
                return self._pool.submit(os.getpid)
        except (KeyboardInterrupt, SystemExit):
            kill_fork_server()
            raise

    def fly(self, task: Batch) -> "Future[list[Row]]":
        return self._pool.submit(_fly, task.cases)

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
            thread.join(MAX_JOIN_S)


class LocalWorkers:
    """Processes on this machine. One that dies is replaced, and its task handed back as lost."""

    def __init__(self, work: Work, workers: int) -> None:
        self._work = work
        self.slots = workers
        self._busy: dict[Future[list[Row]], tuple[_Worker, Batch]] = {}
        self._idle: list[_Worker] = []
        try:
            for n in range(workers):
                self._idle.append(_Worker(work))  # one by one: an exception ends those that are there
                # the first compiles, should that be needed; the others find it done
                if n == 0 and self._idle[0].pid.exception():
                    raise SimulationFailed("a worker process cannot start: it ended before its first flight")
        except BaseException as error:
            if not isinstance(error, Exception):  # Ctrl-C, or the end of this process
                kill_fork_server()
            self.close()
            raise

    def submit(self, task: Batch) -> None:
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
        rows = None
        try:
            rows = flown.result()
        except BrokenProcessPool:
            worker = _Worker(self._work)
        except Exception as error:  # not a flight's: those are in their rows
            raise SimulationFailed(f"a worker cannot go on: {error}") from error
        finally:
            self._idle.append(worker)
        return Outcome(task, rows)


_OF_THIS_PROCESS: list[Work] = []  # a worker's only one


def _begin(work: Work) -> None:
    """Make this process a worker: silent, deaf to the terminal's Ctrl-C, and warm."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # it is for the process that gives the orders
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    silence_this_process()
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
