"""Contenders that fly from take-over to landing, everything included: loading, trim, the loop, the log."""

from pathlib import Path

from beaver_ftc.bench.contenders import Bare
from beaver_ftc.loop import fly
from beaver_ftc.results.log import ParquetLog
from beaver_ftc.scenario.schema import Scenario


class BareFlight(Bare):
    """JSBSim alone, for as many frames."""

    def __init__(self, scenario: Scenario) -> None:
        super().__init__(scenario, at_s=0.0)


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
