"""Pieces of work that forked processes do, each with a copy of all that this process has at that moment.

A forked process inherits what can neither be sent to another process nor made again: a simulation in the
middle of a flight. If this process cannot fork, or has one core, it does the work itself.
"""

import multiprocessing
import signal
import warnings
from collections.abc import Callable
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from typing import Any, Self

from beaver_ftc.compiled.ahead import can_fork
from beaver_ftc.documents.errors import SimulationFailed
from beaver_ftc.studies.engine.processes import cores

Piece = Callable[[], Any]
KILLED = "a process that was forked for a part of the work has ended before it was done"


class Forks:
    """Pieces of work, as many at once as there are cores. `results` returns their results in order.

    wanted: whether other processes may do them. The changes that a piece makes to its copy of this process
    are lost.

    _busy: by connection, the place of the result and the process.
    """

    def __init__(self, wanted: bool = True) -> None:
        self._at_once = cores() if wanted and can_fork() else 0  # 0: this process does all pieces
        self._results: list[Any] = []
        self._busy: dict[Connection, tuple[int, BaseProcess]] = {}

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *raised: object) -> None:
        for _, process in self._busy.values():
            process.kill()
            process.join()

    def submit(self, piece: Piece, then_here: Callable[[], None] = lambda: None) -> None:
        """Do a piece, in a process that is forked now or in this one. Raises the exception of an earlier
        piece, or of this one if this process does it.

        then_here: called in this process if another one does the piece. It makes those changes of the piece
        with which later pieces begin.
        """
        if not self._at_once:
            self._results.append(piece())
            return
        self._wait(self._at_once - 1)
        self._fork(piece)
        self._results.append(None)  # until the process sends it
        then_here()

    def results(self) -> list[Any]:
        """The results of the pieces, in their order. Raises the exception of a piece, if one has failed."""
        self._wait(0)
        return self._results

    def _fork(self, piece: Piece) -> None:
        """Start a process for a piece, whose result is the next one."""
        fork = multiprocessing.get_context("fork")
        receiver, sender = fork.Pipe(duplex=False)
        process = fork.Process(target=_do, args=(piece, sender), daemon=True)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # Python warns of threads; those of our libraries allow a fork
            process.start()
        sender.close()
        self._busy[receiver] = len(self._results), process

    def _wait(self, left: int) -> None:
        """Wait until at most `left` processes are busy."""
        while len(self._busy) > left:
            for receiver in wait([*self._busy]):
                self._take(receiver)  # type: ignore[arg-type]  # a connection, as all of them

    def _take(self, receiver: Connection) -> None:
        """Receive the result of a process, or raise its exception."""
        place, process = self._busy.pop(receiver)
        with receiver:
            try:
                self._results[place], error = receiver.recv()
            except EOFError:
                error = SimulationFailed(KILLED)
        process.join()
        if error is not None:
            raise error


def _do(piece: Piece, sender: Connection) -> None:
    """Do the piece in the forked process, and send (result, None) or (None, exception). Signals end the
    process."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_DFL)
    try:
        sender.send((piece(), None))
    except Exception as error:
        sender.send((None, error))
