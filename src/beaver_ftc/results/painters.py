"""Figures drawn by processes beside this one, which import matplotlib while the flight is flown.

The first is forked before anything heavy is there, and the second from the first, once it has imported
matplotlib: it is imported once. They end when the process that began them closes the connection, or ends.
The figures are drawn in this process, and are the same, where it cannot be forked, has one core or other
threads (whose locks a fork would copy), or where a painter has died.
"""

import gc
import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from multiprocessing.connection import Connection
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from beaver_ftc.results.figures import Picture

N_PAINTERS = 2  # one for each of two cores: the process that flies waits for them
Painters = Sequence[Connection]


@contextmanager
def painters() -> Iterator[Painters]:
    """Processes that draw until the end of the block; none where this process cannot be forked."""
    if not _can_fork():
        yield ()
        return
    fork = multiprocessing.get_context("fork")
    pairs = [fork.Pipe() for _ in range(N_PAINTERS)]
    ours, theirs = zip(*pairs, strict=True)
    first = fork.Process(target=_paint, args=(theirs, ours), daemon=True)
    first.start()
    for there in theirs:
        there.close()
    try:
        yield ours
    finally:
        for here in ours:
            here.close()
        first.kill()  # one that has just begun would still handle SIGTERM as this process does
        first.join()


def _can_fork() -> bool:
    """Whether painters can work beside this process, and a fork copies no lock that another thread holds."""
    if not sys.platform.startswith("linux") or len(os.sched_getaffinity(0)) < N_PAINTERS:
        return False
    return threading.active_count() == 1


@contextmanager
def drawing(pictures: "Sequence[Picture]", connections: Painters) -> Iterator[None]:
    """Have the pictures drawn during the block: they are there at its end. Raises what went wrong."""
    if not connections:
        yield
        save_all(pictures)
        return
    asked: list[tuple[Connection, list[Picture]]] = []
    left: list[Picture] = []
    for painter, own in zip(connections, shares_of_equal_work(pictures, len(connections)), strict=True):
        try:
            painter.send(own)
            asked.append((painter, own))
        except OSError:  # it was killed
            left += own
    failures = []
    try:
        yield
    finally:  # whatever fails meanwhile: nobody draws into a folder that is given up
        for painter, own in asked:
            try:
                failures.append(painter.recv())
            except (EOFError, OSError):  # it was killed
                left += own
    save_all(left)
    for failure in filter(None, failures):
        raise failure


def save_all(pictures: "Sequence[Picture]") -> None:
    """Draw pictures in this process."""
    if pictures:
        from beaver_ftc.results.figures import save

        for picture in pictures:
            save(picture)


def _paint(connections: Sequence[Connection], other_ends: Sequence[Connection]) -> None:
    """Import matplotlib, fork the other painters, and draw."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent process ends this one
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    for each in other_ends:
        each.close()
    gc.disable()  # a seventh of the time; what a dozen figures leave behind is small
    from beaver_ftc.results.figures import figure_class

    figure_class()
    own, *others = connections
    for other in others:
        if os.fork() == 0:
            own.close()
            try:
                _draw_until_closed(other)
            finally:
                os._exit(0)
        other.close()
    _draw_until_closed(own)


def _draw_until_closed(connection: Connection) -> None:
    """Draw what is asked for until the other end is closed: by its process, or with it."""
    while True:
        try:
            pictures = connection.recv()
        except (EOFError, OSError):
            return
        try:
            save_all(pictures)
            connection.send(None)
        except Exception as error:
            connection.send(error)


def shares_of_equal_work(pictures: "Sequence[Picture]", among: int) -> "list[list[Picture]]":
    """As much to draw for each. Greedy: the largest picture first, to the process that has least."""
    shares: list[list[Picture]] = [[] for _ in range(among)]
    for picture in sorted(pictures, key=lambda each: -len(each.view.panels)):
        min(shares, key=lambda given: sum(1 + len(each.view.panels) for each in given)).append(picture)
    return shares
