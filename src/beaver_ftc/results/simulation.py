"""A flight step by step, with its log and its verdict up to the last frame."""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Self, cast

from beaver_ftc.documents.errors import BadInput
from beaver_ftc.loop.simulation import Asked, Stepping
from beaver_ftc.results.flight import Flight, check_plug_in
from beaver_ftc.results.log import MemoryLog, SpooledLog
from beaver_ftc.scenario.schema import ScenarioLike, load

if TYPE_CHECKING:
    from pandas import DataFrame

    from beaver_ftc.control import Law
    from beaver_ftc.diagnosis import Detector
    from beaver_ftc.plant.adapter import Plant

PLUG_IN_NAMES = ("detector", "law")


class Simulation(Stepping):
    """A flight that you advance frame by frame, with your own commands, faults and repairs.

        sim = Simulation("elevator-partial-loss")
        while not sim.done:
            sim.step()
        flight = sim.land()

    - `scenario`: a built-in name, the path of a file, a mapping or a `Scenario`.
    - `detector`, `law`: plug-in objects that replace the detector and the law of the scenario.
    - `log`: if True, the log is kept in memory, with one row for each frame. You can also give a `MemoryLog`,
      in which the rows are then stored.
    - `prepare`: a function that is called once before the flight. Its argument is the plant (the simulated
      aircraft) in trim.

    Attributes:

    - `t_s`: time of the last frame, s. `frames`: number of frames flown. `rate_hz`: frames in a second.
    - `done`: True after the last frame or after the loss of the aircraft. `departed`: True after the loss.
    - `mode`: mode of the supervisor. `inconclusive`: reason why the diagnosis can conclude nothing; otherwise
      an empty text.
    - `measured`, `verdict`: the last `Measured` and `Verdict`.
    - `columns`: names of the columns of the log. `values` (columns,): row of the last frame. `rows` (frames,
      columns): rows of the last call of `step`. `log`: a DataFrame with all rows up to the last frame.
    - `trim_rad` (surfaces,) rad: deflections of the surfaces in trim. `travel_rad` (2, surfaces) rad: their
      lower and upper stops.
    - `readout`: further values of the last frame, with names and units, for example `readout.G`.

    The first call of `step` also flies frame 0. In this frame the sensors measure the aircraft in trim.
    """

    def __init__(
        self,
        scenario: ScenarioLike,
        *,
        detector: "Detector | None" = None,
        law: "Law | None" = None,
        log: bool | MemoryLog | SpooledLog = True,
        prepare: "Callable[[Plant], None] | None" = None,
    ) -> None:
        check_plug_in("detector", detector)
        check_plug_in("law", law)
        self._kept = log if isinstance(log, MemoryLog | SpooledLog) else MemoryLog() if log else None
        super().__init__(load(scenario), detector, law, self._kept, prepare)

    @property
    def log(self) -> "DataFrame":
        """The log up to the last frame, as `Flight.log`. Raises BadInput with log=False."""
        return self.land().log

    def snapshot(self) -> "Snapshot":
        """The present state of the flight. Its method `resume` returns a new `Simulation` in this state.

        You can resume a snapshot any number of times. All resumed flights have exactly the same
        numbers.
        """
        plugged = tuple(
            name for name, plug_in in zip(PLUG_IN_NAMES, self._plug_ins, strict=True) if plug_in is not None
        )
        make_simulation = partial(type(self), self._given, log=self._kept is not None, prepare=self._prepare)
        return Snapshot(self.frames, self.t_s, tuple(self._asked), make_simulation, plugged)

    def clone(self) -> Self:
        """A second flight in the same state, independent of the first flight. The call is the same as
        `snapshot().resume()`.
        """
        return cast("Self", self.snapshot().resume())

    def land(self) -> Flight:
        """The flight up to the last frame, as a `Flight`. The simulation can continue afterwards."""
        outcome = self._outcome()
        self._flush()
        return Flight.landed(outcome, None if self._kept is None else self._kept.frozen_copy())

    def save(self, out: str | PathLike[str] = "runs", *, report: bool = True) -> Path:
        """Write a result folder of the flight up to the last frame, and return the path of the folder. See
        `Flight.save`.
        """
        return self.land().save(out, report=report)


@dataclass(frozen=True)
class Snapshot:
    """A flight at one instant. `Simulation.snapshot` returns it, and `resume` continues the flight from it.

    - `frames`: number of frames flown until this instant.
    - `t_s`: time of this instant, s.
    - `plugged`: which plug-in objects the flight has: `detector`, `law`, both or none.

    The snapshot stores the commands and injected faults up to this instant. It does not store the state of
    JSBSim, because no property gives the states of its filters, delays, integrators and engines. `resume`
    therefore flies the flight again up to this instant. The repeated flight is exact for every aircraft and
    sensor. The repetition takes about 1 ms for each second of flight at 100 Hz.
    """

    frames: int
    t_s: float
    _asked: tuple[Asked, ...] = field(repr=False)
    _make_simulation: Callable[..., Simulation] = field(repr=False)
    plugged: tuple[str, ...] = ()

    def resume(self, **plug_ins: "Detector | Law") -> Simulation:
        """Return a new `Simulation` in the state of the snapshot.

        - `plug_ins`: new plug-in objects as `detector=` and `law=`, if the flight has such objects.

        Raises BadInput if you leave out an object that the flight needs, or give an object that it does not
        use.
        """
        if set(plug_ins) != set(self.plugged):
            needed = " and ".join(self.plugged) or "no plug-in"
            raise BadInput(f"resume: a flight with {needed} is resumed, allowed: new objects of just that")
        flight = self._make_simulation(**plug_ins)
        flight._do_again(self._asked, self.frames)
        return flight
