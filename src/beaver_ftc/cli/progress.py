"""The progress of a command on standard error.

On a terminal, a run or a study that takes longer than a second shows a bar, and a sweep a line that is
written again; elsewhere, as in a log, both print a line from time to time.
"""

import contextlib
import math
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator
from functools import partial

PATIENCE_S = 1.0  # duration of a run after which a terminal shows the bar
FIRST_LINE_S = 5.0  # duration of a run after which the first line is printed elsewhere
TERMINAL_S, LOG_S = 0.2, 30.0  # least time between two lines on a terminal and elsewhere


@contextlib.contextmanager
def progress_bar(label: str) -> Iterator[Callable[[float], None]]:
    """Yield the function that a run calls with the share of its work that is done, 0 to 1."""
    with contextlib.ExitStack() as stack:
        begin, patience_s = (_bar, PATIENCE_S) if sys.stderr.isatty() else (_lines, FIRST_LINE_S)
        started_s = time.monotonic()
        advance = None

        def show(done: float) -> None:
            """Show progress, if the run has taken longer than `patience_s`."""
            nonlocal advance
            if advance is None and time.monotonic() - started_s > patience_s:
                advance = begin(label, stack)
            if advance:
                advance(done)

        yield show


def _bar(label: str, stack: contextlib.ExitStack) -> Callable[[float], None]:
    """Begin a bar, which ends with `stack`. Returns the function that shows a share, 0 to 1."""
    from rich.console import Console
    from rich.progress import Progress

    progress = stack.enter_context(Progress(console=Console(stderr=True), transient=True))
    task = progress.add_task(label, total=1.0)
    return lambda done: progress.update(task, completed=done)


def _lines(label: str, stack: contextlib.ExitStack) -> Callable[[float], None]:
    """The same as `_bar` with lines. The time left follows from the shares since the first line."""
    write_line = stack.enter_context(progress_lines(log_s=LOG_S))
    started_s = time.monotonic()
    first = None

    def show(done: float) -> None:
        nonlocal first
        first = done if first is None else first
        left = ""
        if done > first:
            left_s = (1.0 - done) / (done - first) * (time.monotonic() - started_s)
            left = f", {_duration_text(left_s)} left"
        if done < 1.0:
            write_line(f"{label}: {done:.0%}{left}")

    return show


@contextlib.contextmanager
def progress_lines(terminal_s: float = 0.0, log_s: float = math.inf) -> Iterator[Callable[[str], None]]:
    """Yield the function that a study calls with a line of progress. On a terminal, a line replaces the one
    before. terminal_s, log_s: least time between two lines there and elsewhere; infinite: no lines."""
    is_terminal = sys.stderr.isatty()
    every_s = terminal_s if is_terminal else log_s
    last_s = -math.inf
    write = partial(print, end="", file=sys.stderr, flush=True)

    def write_line(line: str) -> None:
        nonlocal last_s
        if math.isfinite(every_s) and time.monotonic() - last_s >= every_s:
            last_s = time.monotonic()
            write(f"\r\033[K{line}" if is_terminal else f"{line}\n")

    try:
        yield write_line
    finally:
        if is_terminal:
            write("\r\033[K")


@contextlib.contextmanager
def sweep_progress(name: str) -> Iterator[Callable[[Counter[str]], None]]:
    """Yield the function that a sweep calls with its counts (campaign.run_sweep). The rate of flights counts
    from the first call on."""
    first = None
    begun_s = 0.0

    def show(counts: Counter[str]) -> None:
        nonlocal first, begun_s
        now_s = time.monotonic()
        if first is None:
            first = counts["done"]
            begun_s = now_s
        elif now_s - begun_s >= (TERMINAL_S if sys.stderr.isatty() else LOG_S):
            write_line(_counts_text(name, counts, (counts["done"] - first) / (now_s - begun_s)))

    with progress_lines(TERMINAL_S, LOG_S) as write_line:
        yield show


def _counts_text(name: str, counts: Counter[str], rate: float) -> str:
    """The counts of a sweep in a line, with the time left. rate: flights in a second."""
    done = counts["done"]
    total = counts["total"]
    left = f", {_duration_text((total - done) / rate)} left" if rate > 0 else ""
    rate_text = f"{rate:.0f}" if rate >= 10.0 or rate == 0.0 else f"{rate:.2g}"
    parts = [f"{name}: {done} of {total} flights, {rate_text}/s{left}"]
    if counts["faulted"]:
        parts.append(f"detected {counts['detected'] / counts['faulted']:.1%}")
    if counts["failed"]:
        parts.append(f"{counts['failed']} not flown")
    return ", ".join(parts)


def _duration_text(seconds: float) -> str:
    """A duration in s, min, or h and min."""
    if seconds < 100:
        return f"{seconds:.0f} s"
    minutes = round(seconds / 60)
    return f"{minutes} min" if minutes < 100 else f"{minutes // 60} h {minutes % 60:02d} min"
