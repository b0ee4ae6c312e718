"""Figures drawn by processes beside this one, which import matplotlib while the flight is flown.

The first painter is forked before this process has imported anything large. It imports matplotlib, and the
second painter is forked from it, so that matplotlib is imported once. Painters end when the process that
started them closes the connection, or ends.

This process draws the same figures itself if it cannot be forked, has one core or several threads (a fork
would copy locks that they hold), or if a painter has died.
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
    from beaver_ftc.results.pictures import Picture

N_PAINTERS = 2  # one for each of two cores: the process that flies waits while they draw
Painters = Sequence[Connection]


@contextmanager
def painters() -> Iterator[Painters]:
    """Yield connections to processes that draw until the end of the block; none if this process cannot
    fork."""
    if not _can_fork():
        yield ()
        return
    fork = multiprocessing.get_context("fork")
    pairs = [fork.Pipe() for _ in range(N_PAINTERS)]
    ours, theirs = zip(*pairs, strict=True)
    first = fork.Process(target=_paint, args=(theirs, ours), daemon=True)
    first.start()
    for end in theirs:
        end.close()
    try:
        yield ours
    finally:
        for connection in ours:
            connection.close()
        first.kill()  # not SIGTERM: a painter that has just begun still has the handlers of this process
        first.join()


def _can_fork() -> bool:
    """Whether painters can work beside this process, and a fork copies no lock that another thread holds."""
    is_alone = threading.active_count() == 1
    return is_alone and sys.platform.startswith("linux") and len(os.sched_getaffinity(0)) >= N_PAINTERS


@contextmanager
def drawing(pictures: "Sequence[Picture]", connections: Painters) -> Iterator[None]:
    """Let painters draw pictures during the block. At its end all files are written. Raises the exception of
    a painter."""
    if not connections:
        yield
        save_all(pictures)
        return
    sent: list[tuple[Connection, list[Picture]]] = []
    not_drawn: list[Picture] = []
    for painter, share in zip(connections, shares_of_equal_work(pictures, len(connections)), strict=True):
        try:
            painter.send(share)
            sent.append((painter, share))
        except OSError:  # it was killed
            not_drawn += share
    failures = []
    try:
        yield
    finally:  # also if the block fails: wait, so that no painter writes into a folder that is removed
        for painter, share in sent:
            try:
                failures.append(painter.recv())
            except (EOFError, OSError):  # it was killed
                not_drawn += share
    save_all(not_drawn)
    for failure in filter(None, failures):
        raise failure


def save_all(pictures: "Sequence[Picture]") -> None:
    """Draw pictures in this process."""
    if pictures:
        from beaver_ftc.results.pictures import save

        for picture in pictures:
            save(picture)


def _paint(connections: Sequence[Connection], other_ends: Sequence[Connection]) -> None:
    """Import matplotlib, fork the other painters, and draw."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent process ends this one
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    for end in other_ends:
        end.close()
    gc.disable()  # saves a seventh of the time; the garbage of a dozen figures is small
    from beaver_ftc.results.figures import figure_class

    figure_class()
    first, *others = connections
    for other in others:
        if os.fork() == 0:
            first.close()
            try:
                _draw_until_closed(other)
            finally:
                os._exit(0)
        other.close()
    _draw_until_closed(first)


def _draw_until_closed(connection: Connection) -> None:
    """Draw each list of pictures that is received, and send None or the exception, until the other end is
    closed."""
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
    """Divide pictures among so many processes. Greedy: each picture, the largest first, goes to the process
    with the least work; the work of a picture is 1 + its number of panels."""
    shares: list[list[Picture]] = [[] for _ in range(among)]
    for picture in sorted(pictures, key=lambda picture: -len(picture.view.panels)):
        min(shares, key=lambda share: sum(1 + len(own.view.panels) for own in share)).append(picture)
    return shares
