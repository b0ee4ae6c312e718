"""Reports of saved flights, drawn by another process, because their figures take seconds of processor time.

One process draws at a time, with a lower priority than the flight. It continues if the page ends.
"""

import contextlib
import json
import os
import subprocess
import sys
from collections import deque
from pathlib import Path

COURTESY = 10  # niceness that the process adds to its own
DRAW = "from beaver_ftc_live.page.reports import draw; draw()"


class Reports:
    """Result folders whose reports must be drawn, in their order."""

    def __init__(self) -> None:
        self._waiting: deque[Path] = deque()
        self._drawing: tuple[Path, subprocess.Popen[str]] | None = None

    def add(self, folder: Path) -> None:
        """Add a folder with log, scenario and metrics. Its report is drawn after those before it."""
        if folder not in self._waiting:
            self._waiting.append(folder)
        self._go_on()

    def news(self) -> list[str]:
        """A line for the report that has ended since the last call: its path, or the reason of its failure.
        No line if the same folder waits again."""
        if self._drawing is None or self._drawing[1].poll() is None:
            return []
        (folder, process), self._drawing = self._drawing, None
        errors = process.communicate()[1].strip().splitlines()
        saved_again = folder in self._waiting
        self._go_on()
        if saved_again:
            return []
        if process.returncode:
            return [f"{folder.name}: without a report: {errors[-1] if errors else 'its process has ended'}"]
        return [f"{folder.name}/report.html"]

    def leave(self) -> None:
        """Begin a process that draws all waiting reports after the page has ended."""
        if self._waiting:
            _begun(*self._waiting)

    def _go_on(self) -> None:
        """Begin the next report, if none is being drawn."""
        if self._drawing is None and self._waiting:
            folder = self._waiting.popleft()
            self._drawing = folder, _begun(folder)


def _begun(*folders: Path) -> "subprocess.Popen[str]":
    """A process that draws the reports of these folders. It ignores Ctrl-C of this terminal, and imports
    nothing from its working directory."""
    paths = [str(folder.resolve()) for folder in folders]
    return subprocess.Popen(
        [sys.executable, "-P", "-c", DRAW, *paths], text=True, start_new_session=True,
        stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE,
    )  # fmt: skip


def draw() -> None:
    """Draw the report of each folder in the arguments of this process. The process ends with the last
    failure."""
    from beaver_ftc.results import add_report

    if hasattr(os, "nice"):
        os.nice(COURTESY)
    failed = ""
    for folder in map(Path, sys.argv[1:]):
        with contextlib.suppress(FileNotFoundError):  # the folder was moved away
            document = json.loads((folder / "metrics.json").read_text(encoding="utf-8"))
            failed = add_report(folder, document) or failed
    sys.exit(failed or 0)
