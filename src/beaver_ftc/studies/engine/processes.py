"""Processes on this machine: how many, how they are started, their environment, and their output.

Where the system can, workers are forked from the fork server, a process that has imported the modules that
they need. These imports take half a second. If the server is started early, it imports while this process
still reads its input. This module imports nothing large.
"""

import contextlib
import multiprocessing
import os
import signal
from collections.abc import Iterator, Mapping
from multiprocessing import forkserver, resource_tracker
from typing import Any

# The modules that the fork server imports.
_PRELOAD = [
    f"{__package__}.workers",
    "beaver_ftc.studies.sweep.one_flight",
    "beaver_ftc.loop.loop",
    "beaver_ftc.results.metrics",
]
# Environment of a worker: one thread for linear algebra, because each core has a worker.
ONE_THREAD_EACH = dict.fromkeys(
    ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"), "1"
)


def cores() -> int:
    """The number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def context() -> Any:
    """The context of `multiprocessing` that starts workers: by the fork server, or as new processes if it
    does not exist."""
    if "forkserver" not in multiprocessing.get_all_start_methods():
        return multiprocessing.get_context("spawn")
    chosen = multiprocessing.get_context("forkserver")
    chosen.set_forkserver_preload(_PRELOAD)
    return chosen


def start_early() -> None:
    """Start the fork server, if workers are forked from it, so that it begins its imports."""
    if context().get_start_method() == "forkserver":
        with single_threaded():
            forkserver.ensure_running()


def kill_fork_server() -> None:
    """Kill the fork server after Ctrl-C. Otherwise it could fork one more worker, whose pipes are closed, and
    which then prints a traceback. The next study starts a new server."""
    pid = getattr(getattr(forkserver, "_forkserver", None), "_forkserver_pid", None)
    if pid is not None:
        with contextlib.suppress(ProcessLookupError):
            os.kill(pid, signal.SIGKILL)


@contextlib.contextmanager
def single_threaded() -> Iterator[None]:
    """Processes that start during the block have one thread each, and do not receive Ctrl-C from the
    terminal, not even while they import. This process receives it and ends them.
    """
    blocks = hasattr(signal, "pthread_sigmask")
    with environment(ONE_THREAD_EACH):
        if blocks:  # SIGINT is blocked during the block, and new processes inherit the mask
            resource_tracker.ensure_running()  # started before: its start would reset the mask
            old_mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            yield
        finally:
            if blocks:
                signal.pthread_sigmask(signal.SIG_SETMASK, old_mask)


@contextlib.contextmanager
def environment(values: Mapping[str, str]) -> Iterator[None]:
    """Set variables of the environment during the block."""
    old_values = {name: os.environ[name] for name in values if name in os.environ}
    os.environ.update(values)
    try:
        yield
    finally:
        for name in values:
            del os.environ[name]
        os.environ.update(old_values)


def silence_this_process() -> dict[int, int]:
    """Discard all output of this process on file descriptors 1 and 2, also that of C libraries. Returns a
    copy of each descriptor; a worker never uses them, `silence` restores and closes them."""
    copies = {stream: os.dup(stream) for stream in (1, 2)}
    nowhere = os.open(os.devnull, os.O_WRONLY)
    for stream in copies:
        os.dup2(nowhere, stream)
    os.close(nowhere)
    return copies


@contextlib.contextmanager
def silence() -> Iterator[None]:
    """Discard all output of this process during the block."""
    copies = silence_this_process()
    try:
        yield
    finally:
        for stream, copy in copies.items():
            os.dup2(copy, stream)
            os.close(copy)
