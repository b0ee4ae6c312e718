"""How worker processes start: forked from a clean process that has everything imported.

Importing takes that process half a second; started early, it does so while this one still reads its input.
Nothing heavy is imported here.
"""

import contextlib
import multiprocessing
import os
import signal
from collections.abc import Iterator
from multiprocessing import forkserver, resource_tracker
from typing import Any

_PRELOAD = [
    "beaver_ftc.studies.engine.crew",
    "beaver_ftc.studies.sweep.flying",
    "beaver_ftc.loop.loop",
    "beaver_ftc.results.metrics",
]
_ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")


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


def one_thread_each() -> dict[str, str]:
    """Environment of a worker: one thread for linear algebra, since the cores are taken by the flights."""
    return dict.fromkeys(_ONE_THREAD, "1")


@contextlib.contextmanager
def single_threaded() -> Iterator[None]:
    """Processes started meanwhile have one thread each, and never hear the terminal's Ctrl-C, not even while
    they import: it is for the process that gives the orders.
    """
    before = {name: os.environ.get(name) for name in _ONE_THREAD}
    os.environ.update(one_thread_each())
    heard = _block_interrupt()
    try:
        yield
    finally:
        if heard is not None:
            signal.pthread_sigmask(signal.SIG_SETMASK, heard)
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


def _block_interrupt() -> set[int | signal.Signals] | None:
    """Leave Ctrl-C waiting, which what is started inherits; what was blocked before, where that exists."""
    if not hasattr(signal, "pthread_sigmask"):
        return None
    resource_tracker.ensure_running()  # it would unblock what is blocked here
    return signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
