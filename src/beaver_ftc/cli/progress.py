"""How far a command has come, on standard error.

A run or a study: a bar on a terminal, once it takes long enough to be waited for. A sweep: a moving line.
Elsewhere, as in a log, both say a line now and then.
"""

import contextlib
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator

PATIENCE_S = 1.0
TERMINAL_S, LOG_S = 0.2, 30.0  # time between two lines
FIRST_S = 5.0  # before the first line of a log


@contextlib.contextmanager
def progress_bar(label: str) -> Iterator[Callable[[float], None]]:
    """Yield what a run calls with how far it has come (0 to 1)."""
    with contextlib.ExitStack() as stack:
        begin = (lambda: _bar(label, stack)) if sys.stderr.isatty() else (lambda: _lines(label))
        patience_s = PATIENCE_S if sys.stderr.isatty() else FIRST_S
        started, advance = time.monotonic(), None

        def show(done: float) -> None:
            """Shows itself only once the run has taken longer than anyone waits without asking."""
            nonlocal advance
            if advance is None and time.monotonic() - started > patience_s:
                advance = begin()
            if advance:
                advance(done)

        yield show


def _lines(label: str) -> Callable[[float], None]:
    started, first, next_s = time.monotonic(), None, 0.0

    def tell(done: float) -> None:
        nonlocal first, next_s
        first, passed_s = done if first is None else first, time.monotonic() - started
        if passed_s >= next_s and done < 1.0:
            next_s = passed_s + LOG_S
            to_come = f", {_span((1.0 - done) / (done - first) * passed_s)} left" if done > first else ""
            sys.stderr.write(f"{label}: {done:.0%}{to_come}\n")
            sys.stderr.flush()

    return tell


def _bar(label: str, stack: contextlib.ExitStack) -> Callable[[float], None]:
    from rich.console import Console
    from rich.progress import Progress

    progress = stack.enter_context(Progress(console=Console(stderr=True), transient=True))
    task = progress.add_task(label, total=1.0)
    return lambda done: progress.update(task, completed=done)


@contextlib.contextmanager
def live_progress(name: str) -> Iterator[Callable[[Counter[str]], None]]:
    """Yield what a sweep calls with its counts (campaign.run_sweep)."""
    progress = _Progress(name, sys.stderr.isatty())
    try:
        yield progress
    finally:
        progress.end()


@contextlib.contextmanager
def told() -> Iterator[Callable[[str], None]]:
    """Yield what a study calls with a line on how far it has come: shown on a terminal only."""
    shown = sys.stderr.isatty()

    def tell(line: str) -> None:
        if shown:
            sys.stderr.write(f"\r\033[K{line}")
            sys.stderr.flush()

    yield tell
    if shown:
        sys.stderr.write("\r\033[K")


class _Progress:
    def __init__(self, name: str, terminal: bool) -> None:
        self._name, self._terminal = name, terminal
        self._last = self._begun = time.monotonic()
        self._first: int | None = None
        self._shown = ""

    def __call__(self, counts: Counter[str]) -> None:
        now = time.monotonic()
        if self._first is None:
            self._first, self._begun = counts["done"], now
        if now - self._last < (TERMINAL_S if self._terminal else LOG_S):
            return
        self._last = now
        self._show(self.line(counts, now))

    def line(self, counts: Counter[str], now: float) -> str:
        """Done, rate, time left, running detection rate."""
        assert self._first is not None
        done, total = counts["done"], counts["total"]
        rate = (done - self._first) / max(now - self._begun, 1e-9)
        to_come = f", {_span((total - done) / rate)} left" if rate > 0 else ""
        parts = [f"{self._name}: {done} of {total} flights, {_rate(rate)}/s{to_come}"]
        if counts["faulted"]:
            parts.append(f"detected {counts['detected'] / counts['faulted']:.1%}")
        if counts["failed"]:
            parts.append(f"{counts['failed']} not flown")
        return ", ".join(parts)

    def _show(self, line: str) -> None:
        if self._terminal:
            sys.stderr.write("\r" + line.ljust(len(self._shown)))
            self._shown = line
        else:
            sys.stderr.write(line + "\n")
        sys.stderr.flush()

    def end(self) -> None:
        """Leave the terminal's line clean."""
        if self._shown:
            sys.stderr.write("\r" + " " * len(self._shown) + "\r")
            sys.stderr.flush()


def _rate(per_s: float) -> str:
    return f"{per_s:.0f}" if per_s >= 10.0 or per_s == 0.0 else f"{per_s:.2g}"


def _span(seconds: float) -> str:
    if seconds < 100:
        return f"{seconds:.0f} s"
    minutes = round(seconds / 60)
    return f"{minutes} min" if minutes < 100 else f"{minutes // 60} h {minutes % 60:02d} min"
