"""Compilation ahead: all kernels of a flight, in two processes.

A flight says what it will call (`expect`) and compiles nothing as long as all of it is kept. The first kernel
that is missing compiles all that are: here and in a second process, which is forked for it. Each takes the
next kernel that nobody else compiles, and both keep their code in the same folder. A second process that
fails, or that there is not, costs time alone.
"""

import contextlib
import os
import signal
import sys
import threading
import warnings
from collections.abc import Callable, Iterable, Sequence
from multiprocessing import parent_process
from typing import Any, NamedTuple

from beaver_ftc.compiled.cache import announced


class Wanted(NamedTuple):
    """A kernel and the types of its arguments."""

    kernel: Any
    kinds: tuple[Any, ...]

    @classmethod
    def of(cls, kernel: Any, kinds: tuple[Any, ...]) -> "Wanted":
        """A kernel as it is named: of one that is called by its address, the code at that address."""
        return cls(getattr(kernel, "called", kernel), kinds)


_expected: list[Callable[[], Iterable[Wanted]]] = []  # of the flight in progress, until they are compiled


def expect(wanted: Callable[[], Iterable[Wanted]] | None) -> None:
    """From now on the first kernel that is not kept has these compiled too, longest first; None: nothing."""
    _expected[:] = [] if wanted is None else [wanted]


def compile_expected() -> None:
    """Compile what the flight in progress is expected to call; nothing if that was done."""
    if _expected:
        compile_missing(_expected.pop()())


def compile_missing(wanted: Iterable[Wanted]) -> int:
    """Compile those that are not kept; returns how many those were."""
    missing = [each for each in wanted if not each.kernel.is_kept(each.kinds)]
    if not missing:
        return 0
    kept = all(each.kernel.folder for each in missing)  # else the second process could not hand over
    helper = _fork(missing) if kept and len(missing) > 1 and can_fork() else None
    try:
        with announced(sum(each.kernel.size for each in missing) / (1.0 if helper is None else 1.7)):
            for each in missing:
                each.kernel.compile_unless_taken(each.kinds)
            _wait(helper)
    except BaseException:
        _end(helper)
        raise
    return len(missing)


def can_fork() -> bool:
    """Whether a second process is of use: two processors, and no thread that could hold a lock."""
    if sys.platform != "linux" or parent_process() is not None or threading.active_count() > 1:
        return False  # a worker has others beside it, which compile too
    return len(os.sched_getaffinity(0)) > 1


def _fork(missing: Sequence[Wanted]) -> int | None:
    """Start the second process; None where that is refused."""
    parent = os.getpid()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # Python's, of threads: a library's own know of a fork
            helper = os.fork()
    except OSError:
        return None
    if helper == 0:
        _help(missing, parent)
    return helper


def _help(missing: Sequence[Wanted], parent: int) -> None:
    """Be the second process: silent, ended by any signal, and not without the first."""
    try:
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            signal.signal(number, signal.SIG_DFL)
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, 1)
        os.dup2(nowhere, 2)
        for each in missing:
            if os.getppid() != parent:
                break
            each.kernel.compile_unless_taken(each.kinds)
    finally:
        os._exit(0)


def _wait(helper: int | None) -> None:
    if helper is not None:
        with contextlib.suppress(ChildProcessError):  # who ignores SIGCHLD has no child to wait for
            os.waitpid(helper, 0)


def _end(helper: int | None) -> None:
    if helper is not None:
        with contextlib.suppress(ProcessLookupError):
            os.kill(helper, signal.SIGKILL)
        _wait(helper)
