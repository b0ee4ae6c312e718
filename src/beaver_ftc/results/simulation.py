"""A flight step by step, with its log and its verdict so far."""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Self, cast

from beaver_ftc.documents.errors import BadInput
from beaver_ftc.loop.simulation import Asked, Stepping
from beaver_ftc.results.flight import Flight, check_plug_in
from beaver_ftc.results.log import MemoryLog
from beaver_ftc.scenario.schema import ScenarioLike, load

if TYPE_CHECKING:
    from pandas import DataFrame

    from beaver_ftc.control import Law
    from beaver_ftc.diagnosis import Detector
    from beaver_ftc.plant.adapter import Plant

PLUGS = ("detector", "law")


class Simulation(Stepping):
    """A flight in progress, frame by frame, with your own commands, faults and repairs.

        sim = Simulation("elevator-partial-loss")
        while not sim.done:
            sim.step()
        sim.land()

    scenario: a name, a path, a mapping or a Scenario. detector, law: plug-in objects to fly with. log: keep
    one row for each frame in memory, or in the given log. prepare: called with the trimmed plant before the
    flight. The first step also flies frame 0, which measures the trimmed flight.

    `done`, `t_s`, `mode`, `measured` and `verdict` tell the present state. `readout` has further values of
    the frame just flown, with names and units.
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

    def snapshot(self) -> "Snapshot":
        """The present state of the flight. It can be continued any number of times, each time to the bit."""
        plugged = tuple(name for name, of in zip(PLUGS, self._plug_ins, strict=True) if of is not None)
        made = partial(type(self), self._given, log=self._kept is not None, prepare=self._prepare)
        return Snapshot(self.frames, self.t_s, tuple(self._asked), made, plugged)

    def clone(self) -> Self:
        """A second flight in the same state, independent of the first: `snapshot().resume()`."""
        return cast("Self", self.snapshot().resume())

    def land(self) -> Flight:
        """The flight so far, as `fly` would return it; the flight may continue."""
        outcome = self._outcome()
        self._flush()
        return Flight.landed(outcome, self._kept and self._kept.so_far())

    def save(self, out: str | PathLike[str] = "runs", *, report: bool = True) -> Path:
        """Write the flight so far as a result folder; see `Flight.save`."""
        return self.land().save(out, report=report)


@dataclass(frozen=True)
class Snapshot:
    """A flight at an instant, kept as what was asked of it until then.

    JSBSim keeps filters, delays, integrators and engines where no property shows them, so its state cannot be
    written back. `resume` flies the flight again to this instant, which is exact for every aircraft and
    sensor: about 1 ms for each second of flight at 100 Hz. To fork the process costs as much as 8 s of that.

    frames, t_s: how much of the flight. plugged: which plug-ins the flight has, of `detector` and `law`.
    """

    frames: int
    t_s: float
    _asked: tuple[Asked, ...] = field(repr=False)
    _made: Callable[..., Simulation] = field(repr=False)
    plugged: tuple[str, ...] = ()

    def resume(self, **plug_ins: "Detector | Law") -> Simulation:
        """A new flight in this state. plug_ins: for a flight with `detector` or `law` objects, new ones.

        Raises BadInput where those are missing, or given to a flight without them.
        """
        if set(plug_ins) != set(self.plugged):
            asked = " and ".join(self.plugged) or "no plug-in"
            raise BadInput(f"resume: a flight with {asked} is resumed, allowed: new objects of just that")
        flight = self._made(**plug_ins)
        flight._do_again(self._asked, self.frames)
        return flight
