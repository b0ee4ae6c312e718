"""A flight step by step, with its log and its verdict so far."""

from collections.abc import Callable
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

from beaver_ftc.loop.simulation import Stepping
from beaver_ftc.results.flight import Flight, check_plug_in
from beaver_ftc.results.log import MemoryLog
from beaver_ftc.scenario.loader import ScenarioLike, load

if TYPE_CHECKING:
    from pandas import DataFrame

    from beaver_ftc.control.base import Law
    from beaver_ftc.diagnosis.base import Detector
    from beaver_ftc.plant.adapter import Plant


class Simulation(Stepping):
    """A flight in progress: step it, look, break and repair things, command it yourself.

        sim = Simulation("elevator-partial-loss")
        while not sim.done:
            sim.step()
        sim.land()

    scenario: a name, a path, a mapping or a Scenario. detector, law: plug-in objects to fly with. log: keep
    one row a frame in memory, or in the log given, for instance a SpooledLog. prepare: called with the
    trimmed plant before the flight. Frame 0, in which the trimmed flight is measured, is flown with the first
    step.
    """

    def __init__(
        self,
        scenario: ScenarioLike,
        *,
        detector: "Detector | None" = None,
        law: "Law | None" = None,
        log: bool | MemoryLog = True,
        prepare: "Callable[[Plant], None] | None" = None,
    ) -> None:
        check_plug_in("detector", detector)
        check_plug_in("law", law)
        self._kept = log if isinstance(log, MemoryLog) else MemoryLog() if log else None
        super().__init__(load(scenario), detector, law, self._kept, prepare)

    @property
    def log(self) -> "DataFrame":
        """The log so far, as `Flight.log`. Raises BadInput with log=False."""
        return self.land().log

    def land(self) -> Flight:
        """What the flight has yielded so far, as `fly` would say it; the flight may go on."""
        outcome = self._outcome()
        self._flush()
        return Flight.landed(outcome, self._kept and self._kept.so_far())

    def save(self, out: str | PathLike[str] = "runs", *, report: bool = True) -> Path:
        """Write what has been flown so far as a result folder; see `Flight.save`."""
        return self.land().save(out, report=report)
