"""Processes on this machine: how many, how they are started, their environment, and their output.

Workers are forked from a clean process that has everything imported, the fork server. Importing takes it half
a second; started early, it does so while this process still reads its input. Nothing heavy is imported here.
"""

import contextlib
import multiprocessing
import os
import signal
from collections.abc import Iterator, Mapping
from multiprocessing import forkserver, resource_tracker
from typing import Any

# What the process that workers are forked from imports; this process need not.
_PRELOAD = [
    f"{__package__}.workers",
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


def kill_fork_server() -> None:
    """Kill the process that workers are forked from, after Ctrl-C: else it still forks a worker for which
    nothing waits, and that prints a traceback, since its pipes are closed. The next study starts another."""
    pid = getattr(getattr(forkserver, "_forkserver", None), "_forkserver_pid", None)
    if pid is not None:
        with contextlib.suppress(ProcessLookupError):
            os.kill(pid, signal.SIGKILL)


@contextlib.contextmanager
def single_threaded() -> Iterator[None]:
    """Processes started meanwhile have one thread each, and do not receive Ctrl-C from the terminal, not even
    while they import: this process does, and ends them.
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


def silence_this_process() -> dict[int, int]:
    """Send whatever a library prints, on whatever level, nowhere. Returns copies of the two streams."""
    kept = {stream: os.dup(stream) for stream in (1, 2)}
    nowhere = os.open(os.devnull, os.O_WRONLY)
    for stream in kept:
        os.dup2(nowhere, stream)
    os.close(nowhere)
    return kept


@contextlib.contextmanager
def silence() -> Iterator[None]:
    """Whatever a library prints meanwhile goes nowhere: the output is the study's own."""
    kept = silence_this_process()
    try:
        yield
    finally:
        for stream, copy in kept.items():
            os.dup2(copy, stream)
            os.close(copy)
