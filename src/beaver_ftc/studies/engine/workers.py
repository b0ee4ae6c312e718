"""Workers that fly: the contract of a backend, worker processes on this machine, and this process as a
worker.

A task is a batch, or some of its cases. Workers fly tasks and return their rows, or report that a worker was
lost.

Each worker is a process pool with one process. In a pool of several processes, Python's or loky's, a killed
process ends the tasks of all others (loky: TerminatedWorkerError in each), so that the case that kills cannot
be found.
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

MAX_JOIN_S = 5.0  # longest wait for the thread of a pool, which ends milliseconds after its worker
# Pauses before the attempts to start a worker, in case the fork server is killed. A killed server closes its
# pipe before the system reports its end, so that an attempt without a pause would use it again.
STARTS_AFTER_S = (0.0, 0.1, 1.0)

Row = Any
Number = int | str  # of a batch; it names its file


class Batch(NamedTuple):
    """Cases that land together, or a task: some of these cases, which one worker flies in turn. runs: their
    numbers."""

    number: Number
    runs: Sequence[int]
    cases: Sequence[Any]


class Outcome(NamedTuple):
    """The outcome of a task: its rows, or None if its worker was lost."""

    task: Batch
    rows: list[Row] | None


class Work(NamedTuple):
    """The work of a worker. fly: from a case to its row. warm_up: called once before the first case. Both can
    be pickled."""

    fly: Callable[[Any], Row]
    warm_up: Callable[[], None] | None = None

    def all(self, cases: Sequence[Any]) -> list[Row]:
        """Fly cases in turn."""
        return [self.fly(case) for case in cases]


class Workers(Protocol):
    """A backend: workers that fly tasks."""

    @property
    def slots(self) -> int:
        """The largest number of submitted tasks; with so many, no worker waits."""

    def submit(self, task: Batch) -> None:
        """Take a task. The caller submits at most `slots` at a time."""

    def outcomes(self, timeout_s: float) -> list[Outcome]:
        """The outcomes of tasks that have ended: waits for the first one, but at most timeout_s."""

    def close(self) -> None:
        """Terminate all workers, whatever they are doing."""


@dataclass
class ThisProcess:
    """This process as the only worker. A case that kills its process kills the study."""

    work: Work
    slots = 1

    def submit(self, task: Batch) -> None:
        self._task = task

    def outcomes(self, timeout_s: float) -> list[Outcome]:
        """Fly the task, however long it takes."""
        return [Outcome(self._task, self.work.all(self._task.cases))]

    def close(self) -> None:
        """There is no other process to terminate."""


class _Worker:
    """A worker process with a pool of its own."""

    def __init__(self, work: Work) -> None:
        for pause_s in STARTS_AFTER_S:
            time.sleep(pause_s)
            self._pool = ProcessPoolExecutor(
                1, mp_context=context(), initializer=_become_worker, initargs=(work,)
            )
            with contextlib.suppress(EOFError, ConnectionError):  # the fork server was killed: try again
                self.pid = self._started()
                return
        raise SimulationFailed("a worker process cannot start: what it is forked from is ended, each time")

    def _started(self) -> "Future[int]":
        """The process id of the started worker. Ctrl-C while this process waits kills the fork server, which
        itself ignores Ctrl-C."""
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
        """Terminate the process, started or not.

        Futures are not cancelled: a broken pool prints a traceback if it cannot fail a cancelled future. The
        thread of the pool is joined: an interpreter that exits while this thread closes its pipe prints a
        traceback, too.
        """
        running = [*(self._pool._processes or {}).values()]
        thread: Any = self._pool._executor_manager_thread
        self._pool.shutdown(wait=False)
        for process in running:
            process.terminate()
        if thread is not None:
            thread.join(MAX_JOIN_S)


class LocalWorkers:
    """Processes on this machine. A process that dies is replaced, and its task is returned as lost."""

    def __init__(self, work: Work, workers: int) -> None:
        self._work = work
        self.slots = workers
        self._busy: dict[Future[list[Row]], tuple[_Worker, Batch]] = {}
        self._idle: list[_Worker] = []
        try:
            for n in range(workers):
                self._idle.append(_Worker(work))  # one at a time: `close` ends those that have started
                # the first one compiles the kernels, if necessary, before the others start
                if n == 0 and self._idle[0].pid.exception():
                    raise SimulationFailed("a worker process cannot start: it ended before its first flight")
        except BaseException as error:
            if not isinstance(error, Exception):  # Ctrl-C, or the end of this process
                kill_fork_server()
            self.close()
            raise

    def submit(self, task: Batch) -> None:
        """Give a task to an idle worker."""
        worker = self._idle.pop()
        try:
            flying = worker.fly(task)
        except BrokenProcessPool as error:  # it died while idle
            flying = Future()
            flying.set_exception(error)
        self._busy[flying] = worker, task

    def outcomes(self, timeout_s: float) -> list[Outcome]:
        done, _ = wait(self._busy, timeout_s, FIRST_COMPLETED)
        return [self._outcome(future) for future in done]

    def close(self) -> None:
        for worker in (*self._idle, *(worker for worker, _ in self._busy.values())):
            worker.end()

    def _outcome(self, future: "Future[list[Row]]") -> Outcome:
        """The outcome of a task that has ended; its worker, or a new one, is idle again."""
        worker, task = self._busy.pop(future)
        rows = None
        try:
            rows = future.result()
        except BrokenProcessPool:
            worker = _Worker(self._work)
        except Exception as error:  # of the worker; the error of a flight is in its row
            raise SimulationFailed(f"a worker cannot go on: {error}") from error
        finally:
            self._idle.append(worker)
        return Outcome(task, rows)


_WORK: list[Work] = []  # in a worker process, its work


def _become_worker(work: Work) -> None:
    """Make this process a worker: without output and Ctrl-C of the terminal, ending with its parent, and
    warm."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the parent, which ends its workers
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    silence_this_process()
    _WORK[:] = [work]
    if work.warm_up:
        work.warm_up()


def _end_with_parent() -> None:
    """Wait for the end of the parent process, then end this process."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def _fly(cases: Sequence[Any]) -> list[Row]:
    return _WORK[0].all(cases)
