"""The mismatch of a flight, frame by frame, split into its sources; a stretch of the log at a time."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from beaver_ftc.studies.mismatch.sources import SOURCES, Case, Contributions, instantaneous, integration
from beaver_ftc.studies.mismatch.states import Columns, States, joined, last_row, states_of

if TYPE_CHECKING:
    from beaver_ftc.scenario.schema import Scenario

UNEXPLAINED = "unexplained"


@dataclass(frozen=True)
class Stretch:
    """n frames of a flight; all accelerations (n, 3) rad/s2 over p, q, r.

    total: JSBSim's angular acceleration over each frame less the design model's f + G u. contributions:
    what each of SOURCES adds to it. parts: single faults and single coefficients, under the name of their
    source. eta_bar: the bound in force over the same frames. place (n, 3): airspeed m/s, altitude m,
    alpha rad.
    """

    t_s: np.ndarray
    total: np.ndarray
    contributions: Contributions
    parts: dict[str, Contributions]
    eta_bar: np.ndarray
    place: np.ndarray

    @property
    def unexplained(self) -> np.ndarray:
        """What no source accounts for, (n, 3) rad/s2."""
        return self.total - sum(self.contributions[name] for name in SOURCES)

    @property
    def uncertainty(self) -> np.ndarray:
        """The mismatch without the faults, (n, 3) rad/s2: the eta that eta_bar shall bound."""
        return self.total - self.contributions["fault"]


class Splitter:
    """Splits the mismatch of a flight while its log comes in, chunk by chunk, in time's order.

    The acceleration over a frame needs the frame's end, so the last row of a chunk waits for the next.
    """

    def __init__(self, scenario: "Scenario") -> None:
        self._scenario = scenario
        self._case: Case | None = None
        self._held: Columns | None = None

    def feed(self, chunk: Columns) -> Iterator[Stretch]:
        """Take in log columns (name -> (n,)); yields the frames that have ended."""
        if chunk["t_s"].size == 0:
            return
        log = joined(self._held, chunk)
        self._held = last_row(log)
        states = states_of(log)
        if self._case is None:
            self._case = Case.of(self._scenario, states[:1])
        if len(states) > 1:
            yield _over_frames(self._case, states)

    def end(self) -> Iterator[Stretch]:
        """The flight has ended: yields its last row."""
        if self._held is not None and self._case is not None:
            yield _at_end(self._case, states_of(self._held))


def split(scenario: "Scenario", chunks: Iterable[Columns]) -> Iterator[Stretch]:
    """Split the mismatch of the flight whose log comes in `chunks` of columns, in time's order."""
    splitter = Splitter(scenario)
    for chunk in chunks:
        yield from splitter.feed(chunk)
    yield from splitter.end()


def _over_frames(case: Case, states: States) -> Stretch:
    """All frames but the last, which has no end here yet."""
    here, following = states[:-1], states[1:]
    contributions, parts = instantaneous(case, here)
    contributions["integration"] = integration(case, here, following)
    flown = (following.x - here.x) * case.scenario.rate_hz
    return Stretch(
        here.t_s, flown - following.design_mean, contributions, parts, following.eta_bar, _place(here)
    )


def _place(states: States) -> np.ndarray:
    return np.column_stack([states.y[:, 2], states.altitude_m, states.y[:, 0]])


def _at_end(case: Case, states: States) -> Stretch:
    """The flight's last row: nothing follows, so JSBSim's acceleration then stands for the frame."""
    contributions, parts = instantaneous(case, states)
    contributions["integration"] = np.zeros_like(states.x)
    believed = case.belief.acceleration(states.x_measured, states.y_measured, states.u)
    return Stretch(states.t_s, states.xdot - believed, contributions, parts, states.eta_bar, _place(states))
