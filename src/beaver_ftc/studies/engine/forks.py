"""Work done beside this process by others, each forked for its piece with all that this one has just then.

Such a process inherits what can neither be sent nor made again alike: a simulation in the middle of a
flight. Where this process cannot be forked, or has one core, it does the work itself.
"""

import multiprocessing
import signal
import warnings
from collections.abc import Callable
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from typing import Any, Self

from beaver_ftc.compiled.cache import can_fork
from beaver_ftc.documents.errors import SimulationFailed
from beaver_ftc.studies.engine.workers import cores

Work = Callable[[], Any]
KILLED = "a process that was forked for a part of the work has ended before it was done"


class Forks:
    """Pieces of work, as many at once as there are cores; `results` has theirs, in the order given.

    wanted: whether other processes may do them. What a piece changes is lost with its process.
    """

    def __init__(self, wanted: bool = True) -> None:
        self._at_once = cores() if wanted and can_fork() else 0
        self._results: list[Any] = []
        self._busy: dict[Connection, tuple[int, BaseProcess]] = {}

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *raised: object) -> None:
        for _, process in self._busy.values():
            process.kill()
            process.join()

    def give(self, work: Work, instead: Callable[[], None] = lambda: None) -> None:
        """Have this done, as things are now. instead: what this process does of it where another does the
        work, so that later pieces find things as they would be. Raises what an earlier piece has raised."""
        if not self._at_once:
            self._results.append(work())
            return
        self._wait(self._at_once - 1)
        self._fork(work)
        self._results.append(None)
        instead()

    def results(self) -> list[Any]:
        """Those of all pieces. Raises what one has raised."""
        self._wait(0)
        return self._results

    def _fork(self, work: Work) -> None:
        fork = multiprocessing.get_context("fork")
        here, there = fork.Pipe(duplex=False)
        process = fork.Process(target=_do, args=(work, there), daemon=True)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # Python's, of threads: a library's own know of a fork
            process.start()
        there.close()
        self._busy[here] = len(self._results), process

    def _wait(self, left: int) -> None:
        """Until no more than so many are at work."""
        while len(self._busy) > left:
            for here in wait([*self._busy]):
                self._take(here)  # type: ignore[arg-type]  # a connection, as all of them

    def _take(self, here: Connection) -> None:
        place, process = self._busy.pop(here)
        with here:
            try:
                self._results[place], error = here.recv()
            except EOFError:
                error = SimulationFailed(KILLED)
        process.join()
        if error is not None:
            raise error


def _do(work: Work, there: Connection) -> None:
    """Be the forked process: ended by any signal without a word."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_DFL)
    try:
        there.send((work(), None))
    except Exception as error:
        there.send((None, error))
