"""A progress bar on standard error, for a run long enough to be waited for, on a terminal only."""

import contextlib
import sys
import time
from collections.abc import Callable, Iterator

PATIENCE_S = 1.0


@contextlib.contextmanager
def progress_bar(label: str) -> Iterator[Callable[[float], None] | None]:
    """Yield what a run calls with how far it has come (0 to 1); None where nobody would see it."""
    if not sys.stderr.isatty():
        yield None
        return
    with contextlib.ExitStack() as stack:
        yield _Bar(label, stack)


class _Bar:
    """Shows itself only once the run has taken longer than anyone waits without asking."""

    def __init__(self, label: str, stack: contextlib.ExitStack) -> None:
        self._label, self._stack = label, stack
        self._started = time.monotonic()
        self._advance: Callable[[float], None] | None = None

    def __call__(self, done: float) -> None:
        if self._advance is None and time.monotonic() - self._started > PATIENCE_S:
            self._advance = self._show()
        if self._advance:
            self._advance(done)

    def _show(self) -> Callable[[float], None]:
        from rich.console import Console
        from rich.progress import Progress

        progress = self._stack.enter_context(Progress(console=Console(stderr=True), transient=True))
        task = progress.add_task(self._label, total=1.0)
        return lambda done: progress.update(task, completed=done)
