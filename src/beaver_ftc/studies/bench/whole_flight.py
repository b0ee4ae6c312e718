"""A contender that flies from loading to landing, everything included: trim, the loop, the log."""

from pathlib import Path

from beaver_ftc.loop.loop import fly
from beaver_ftc.results.log import ParquetLog
from beaver_ftc.scenario.schema import Scenario


class WholeFlight:
    """`fly`, with the log in memory or, given a file, on disk."""

    def __init__(self, scenario: Scenario, log: Path | None = None) -> None:
        self._scenario, self._log = scenario, log

    def prepare(self) -> None:
        """Every flight is new."""

    def fly(self, frames: int) -> None:
        """Fly the scenario, which must last that many frames."""
        if self._log is None:
            fly(self._scenario)
        else:
            with ParquetLog(self._log) as log:
                fly(self._scenario, log)
