"""Reports of saved flights, drawn by a process beside: their figures take seconds of processor, in which the
flight would stand still.

One process at a time, which gives way to the flight, and goes on when the page ends meanwhile.
"""

import contextlib
import json
import os
import subprocess
import sys
from collections import deque
from pathlib import Path

COURTESY = 10  # what a process adds to its niceness
DRAW = "from beaver_ftc_live.page.reports import draw; draw()"


class Reports:
    """Result folders whose reports are to be drawn, in their order."""

    def __init__(self) -> None:
        self._waiting: deque[Path] = deque()
        self._drawing: tuple[Path, subprocess.Popen[str]] | None = None

    def add(self, folder: Path) -> None:
        """Have its report drawn, after what is being drawn. It has log, scenario and metrics."""
        if folder not in self._waiting:
            self._waiting.append(folder)
        self._go_on()

    def news(self) -> list[str]:
        """What has become of reports since the last call, a line each; costs nothing while there are none."""
        if self._drawing is None or self._drawing[1].poll() is None:
            return []
        (folder, process), self._drawing = self._drawing, None
        said = process.communicate()[1].strip().splitlines()
        saved_again = folder in self._waiting
        self._go_on()
        if saved_again:
            return []
        if process.returncode:
            return [f"{folder.name}: without a report: {said[-1] if said else 'its process has ended'}"]
        return [f"{folder.name}/report.html"]

    def leave(self) -> None:
        """Nobody will listen any more; what waits is drawn all the same."""
        if self._waiting:
            _begun(*self._waiting)

    def _go_on(self) -> None:
        if self._drawing is None and self._waiting:
            folder = self._waiting.popleft()
            self._drawing = folder, _begun(folder)


def _begun(*folders: Path) -> "subprocess.Popen[str]":
    """A process that ignores Ctrl-C of this terminal, and imports nothing from the folder it starts in."""
    paths = [str(folder.resolve()) for folder in folders]
    return subprocess.Popen(
        [sys.executable, "-P", "-c", DRAW, *paths], text=True, start_new_session=True,
        stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE,
    )  # fmt: skip


def draw() -> None:
    """What that process does: draw the report of each folder it is given; the last failure is its end."""
    from beaver_ftc.results import add_report

    if hasattr(os, "nice"):
        os.nice(COURTESY)
    failed = ""
    for folder in map(Path, sys.argv[1:]):
        with contextlib.suppress(FileNotFoundError):  # somebody has moved it away
            document = json.loads((folder / "metrics.json").read_text(encoding="utf-8"))
            failed = add_report(folder, document) or failed
    sys.exit(failed or 0)
