"""Who flies: the contract of a backend, worker processes on this machine, and this very process.

A task is a batch, or some of its cases. Workers fly tasks and hand back their rows, or say that one was lost
over it.

Processes are forked from a clean one that has everything imported. Importing takes that process half a
second; started early, it does so while this one still reads its input. Nothing heavy is imported here.

Each worker is a pool of its own. In one pool of several, Python's or loky's, one that is killed takes the
tasks of all the others with it (loky: TerminatedWorkerError in each), so nothing tells which case kills.
"""

import contextlib
import multiprocessing
import os
import signal
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import forkserver, resource_tracker
from typing import Any, NamedTuple, Protocol

from beaver_ftc.documents.errors import SimulationFailed

LEAVES_S = 5.0  # a pool's thread, once its workers have ended: milliseconds
# Starts of a worker, each later, should the process that it is forked from be killed meanwhile: one that is
# killed closes its pipe before the system says that it has ended, so what comes at once finds it still there.
STARTS_AFTER_S = (0.0, 0.1, 1.0)

Row = Any
Number = int | str  # of a batch: what its file is called
Nothing = Callable[[], None]


class Batch(NamedTuple):
    """Cases that land together, or those of them that one worker flies in turn; runs: their places."""

    number: Number
    runs: Sequence[int]
    cases: Sequence[Any]


class Outcome(NamedTuple):
    """What became of a task: its rows, or None if the worker was lost over it."""

    task: Batch
    rows: list[Row] | None


class Work(NamedTuple):
    """What a worker does: fly a case; and once, before its first, what warms it up. Both can be pickled."""

    fly: Callable[[Any], Row]
    warm_up: Nothing | None = None

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


class ThisProcess:
    """The one worker that needs no other process, and so does not survive a flight that kills it."""

    slots = 1

    def __init__(self, work: Work) -> None:
        self._work = work
        self._tasks: deque[Batch] = deque()

    def submit(self, task: Batch) -> None:
        self._tasks.append(task)

    def outcomes(self, timeout_s: float) -> list[Outcome]:
        task = self._tasks.popleft()
        return [Outcome(task, self._work.all(task.cases))]

    def close(self) -> None:
        self._tasks.clear()


class _Worker:
    """A process of its own: one that dies takes nobody else's task with it."""

    def __init__(self, work: Work) -> None:
        self.pid: Future[int] = Future()
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
            _begin_no_more()
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
            thread.join(LEAVES_S)


class LocalWorkers:
    """Processes on this machine. One that dies is replaced, and its task handed back as lost."""

    def __init__(self, work: Work, workers: int) -> None:
        self._work, self.slots = work, workers
        self._busy: dict[Future[list[Row]], tuple[_Worker, Batch]] = {}
        self._idle = [_Worker(work)]
        try:
            # the first compiles, should that be needed; the others find it done
            if self._idle[0].pid.exception():
                raise SimulationFailed("a worker process cannot start: it ended before its first flight")
            self._idle += [_Worker(work) for _ in range(workers - 1)]
        except (KeyboardInterrupt, SystemExit):
            _begin_no_more()
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


_PRELOAD = [
    "beaver_ftc.studies.engine.workers",
    "beaver_ftc.studies.sweep.one_flight",
    "beaver_ftc.loop.loop",
    "beaver_ftc.results.metrics",
]
# Environment of a worker: one thread for linear algebra, since the cores are taken by the flights.
ONE_THREAD_EACH = dict.fromkeys(
    ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"), "1"
)


def cores() -> int:
    """The cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def context() -> Any:
    """The way to start workers here; where they cannot be forked, they start afresh."""
    if "forkserver" not in multiprocessing.get_all_start_methods():
        return multiprocessing.get_context("spawn")
    chosen = multiprocessing.get_context("forkserver")
    chosen.set_forkserver_preload(_PRELOAD)
    return chosen


def start_early() -> None:
    """Let the process that workers are forked from begin its imports."""
    if context().get_start_method() == "forkserver":
        with single_threaded():
            forkserver.ensure_running()


def _begin_no_more() -> None:
    """End the process that workers are forked from: one that is forked when nobody waits for it any more
    finds its pipes gone, and says so in a traceback. The next study starts another."""
    pid = getattr(getattr(forkserver, "_forkserver", None), "_forkserver_pid", None)
    if pid is not None:
        with contextlib.suppress(ProcessLookupError):
            os.kill(pid, signal.SIGKILL)


@contextlib.contextmanager
def single_threaded() -> Iterator[None]:
    """Processes started meanwhile have one thread each, and never hear the terminal's Ctrl-C, not even while
    they import: it is for the process that gives the orders.
    """
    blocks = hasattr(signal, "pthread_sigmask")
    with environment(ONE_THREAD_EACH):
        if blocks:  # Ctrl-C waits meanwhile, which what is started inherits
            resource_tracker.ensure_running()  # it would unblock what is blocked here
            before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            yield
        finally:
            if blocks:
                signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextlib.contextmanager
def environment(values: Mapping[str, str]) -> Iterator[None]:
    """These variables of the environment meanwhile have these values."""
    before = {name: os.environ[name] for name in values if name in os.environ}
    os.environ.update(values)
    try:
        yield
    finally:
        for name in values:
            del os.environ[name]
        os.environ.update(before)
