"""Losses that our detectors find, beside those of a test that knows the loss, but not its instant.

`python -m tools.docs table unknown-instant` prints the comparison for aircraft of the jsbsim package.

The test is Page's (page_test.py). It knows the surface, the magnitude, the design model and the noise.
Instants are 0.05 s apart and at most 10 s back.

The flights are those of `beaver-ftc detectability --grid`. The declaration equals the truth: sensors, air,
and the error of the aircraft's own model at its measured rate of change. That error is known only within an
envelope. Outside of it, the diagnosis concludes nothing; a loss is left out if the aircraft leaves the
envelope within a second of it.

Each surface loses 40 and 100 % at 3 and 6 deg/s. The table counts the losses that Page's test and our two
detectors find within 1 s: first at levels that give at most 20 false alarms per hour on the healthy flights,
then at the default level, 0.001 an hour. For this, the level of Page's test is raised by the logarithm of the
ratio of the two rates [Lorden1971]. The intervals hold 95 % of RESAMPLED draws: of the faulty flights, with
the losses of a flight kept together, and of the healthy flights, which give the levels.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from math import log
from pathlib import Path

import numpy as np
from benchmarks.page_test import Whitener, fitted, largest_ratios, unexplained

from beaver_ftc.scenario.airframe import find_aircraft
from beaver_ftc.studies.compare.replay import Recording, Trace, record, trace
from beaver_ftc.studies.detectability.grid import WATCHED_S, Block, Condition
from beaver_ftc.studies.detectability.levels import level_for
from beaver_ftc.studies.detectability.schemes import BOTH, loss, scenario_of, strikes_at_s, with_fdi

MAGNITUDES, EXCITATIONS_DEG_S = (0.4, 1.0), (3.0, 6.0)
PER_H, EVERY, WITHIN_S = 20.0, 5, 1.0  # false alarms; frames between instants
SHIPPED, SHIPPED_PER_H = 1.0, 1e-3  # our statistic's own alarm level, and the false alarms it declares
RESAMPLED, PERCENT = 400, (2.5, 97.5)
NONE = dict.fromkeys("pqr", 0.0)
OWN_ALONE = {
    "fdi.bounds.constant_rad_s2": NONE, "fdi.bounds.inertia_coupling": NONE,
    "fdi.statistical.uncertainty_rad_s": 5.0,
}  # fmt: skip


def ratios(recording: Recording, surface: str, noise: Whitener) -> dict[float, np.ndarray]:
    """By magnitude: the largest log likelihood ratio at every frame, (n,)."""
    place = recording.context.surfaces.index(surface)
    does = -np.array([measured.contribution[:, place] for measured, _ in recording.seen[1:]])  # a total loss
    return largest_ratios(recording, does, noise, MAGNITUDES, EVERY)


@dataclass(frozen=True)
class Survey:
    """The flights of one aircraft in one kind of air. flights: number for each cell; healthy: number without
    a fault; seed: of the first flight."""

    aircraft: str
    turbulence: str
    flights: int
    healthy: int
    seed: int

    def flown(self, block: Block, duration_s: float, faults: list[dict]) -> Recording:
        """A flight, recorded as a plug-in sees it."""
        flight = scenario_of(block, duration_s, faults, {"aircraft": self.aircraft})
        return record(with_fdi(flight, BOTH).with_(OWN_ALONE))

    def block(self, excitation_deg_s: float, number: int) -> Block:
        return Block(Condition("tactical-grade", self.turbulence), excitation_deg_s, self.seed + number)

    def in_health(self) -> list[Recording]:
        """Flights without a fault."""
        speeds = EXCITATIONS_DEG_S * self.healthy
        return [self.flown(self.block(speeds[i], 100_000 + i), 18.0, []) for i in range(self.healthy)]

    def lost(self, surface: str) -> Iterator[tuple[float, Recording]]:
        """Yield the magnitude of each loss of a surface, and its flight."""
        for excitation in EXCITATIONS_DEG_S:
            for number in range(self.flights):
                block = self.block(excitation, 1000 * int(excitation) + number)
                at_s = strikes_at_s(block)
                for magnitude in MAGNITUDES:
                    yield magnitude, self.flown(block, at_s + WATCHED_S, [loss(surface, magnitude, at_s)])


def is_known(recording: Recording) -> bool:
    """Whether the model's error is known until WITHIN_S after the fault struck."""
    t = np.array([measured.t_s for measured, _ in recording.seen])
    soon = np.abs(t - recording.fault_at_s - 0.5 * WITHIN_S) <= 0.5 * WITHIN_S + 1e-9
    return bool(recording.known[soon].all())


@dataclass(frozen=True)
class Seen:
    """The values of a statistic that decide about alarms at any level. before, soon (n,): of each loss, the
    largest value before it, and from then until WITHIN_S later; healthy: traces of the healthy flights."""

    before: np.ndarray
    soon: np.ndarray
    healthy: list[Trace]

    @classmethod
    def of(cls, losses: list[Trace], healthy: list[Trace]) -> "Seen":
        """The values of these traces."""
        soon = [max((v for t, v in one.records if t <= WITHIN_S + 1e-9), default=0.0) for one in losses]
        return cls(np.array([one.before for one in losses]), np.array(soon), healthy)

    def level(self, drawn: np.ndarray) -> float:
        """The level with PER_H false alarms an hour on the healthy flights drawn."""
        return level_for([self.healthy[i] for i in drawn], PER_H)

    def found(self, level: float) -> np.ndarray:
        """Which losses (n,) are found in time, and no alarm was raised before."""
        return (self.soon > level) & (self.before <= level)


@dataclass(frozen=True)
class Cell:
    """The losses of one surface of an aircraft: the flight and the magnitude of each, (n,); the statistic of
    Page's test by magnitude, and ours."""

    aircraft: str
    surface: str
    flight: np.ndarray
    magnitude: np.ndarray
    page: dict[float, Seen]
    ours: Seen

    def counts(self, drawn: np.ndarray, losses: np.ndarray) -> np.ndarray:
        """Numbers of losses (5,): all, those that Page's test finds, those that ours finds, and the same two
        at the default level. A loss may be drawn repeatedly."""
        page, shipped = np.zeros((2, len(self.flight)), dtype=bool)
        for magnitude, seen in self.page.items():
            level, of_it = seen.level(drawn), self.magnitude == magnitude
            page[of_it] = seen.found(level)[of_it]
            shipped[of_it] = seen.found(level + log(PER_H / SHIPPED_PER_H))[of_it]
        ours = self.ours.found(self.ours.level(drawn))
        columns = np.ones(len(page)), page, ours, shipped, self.ours.found(SHIPPED)
        return np.array([column[losses].sum() for column in columns])


def cell_of(survey: Survey, surface: str, healthy: list[Recording], noise: Whitener) -> Cell:
    """Fly a surface's losses and show them to both tests."""
    losses = enumerate(survey.lost(surface))
    known = [(at // len(MAGNITUDES), m, one) for at, (m, one) in losses if is_known(one)]
    flights = np.array([flight for flight, *_ in known], dtype=int)
    magnitudes = np.array([m for _, m, _ in known])
    both = [one for *_, one in known], healthy
    by_page = [[ratios(recording, surface, noise) for recording in of] for of in both]
    page = {
        m: Seen.of(*(
            [trace(one, ratio[m]) for one, ratio in zip(of, found, strict=True)]
            for of, found in zip(both, by_page, strict=True)
        ))
        for m in MAGNITUDES
    }  # fmt: skip
    ours = Seen.of(*([trace(one, one.built_in) for one in of] for of in both))
    return Cell(survey.aircraft, surface, flights, magnitudes, page, ours)


def counted(cells: list[Cell]) -> tuple[np.ndarray, np.ndarray]:
    """Counts as of `Cell.counts` of cells together, (5,), and of RESAMPLED draws (RESAMPLED, 5)."""
    rng, total, draws = np.random.default_rng(0), np.zeros(5), np.zeros((RESAMPLED, 5))
    for aircraft in dict.fromkeys(cell.aircraft for cell in cells):
        of_it = [cell for cell in cells if cell.aircraft == aircraft]
        healthy = len(of_it[0].ours.healthy)
        flights = 1 + max(int(cell.flight.max(initial=0)) for cell in of_it)
        places = [[np.flatnonzero(cell.flight == f) for f in range(flights)] for cell in of_it]
        total += sum(cell.counts(np.arange(healthy), np.arange(cell.flight.size)) for cell in of_it)
        for i in range(RESAMPLED):
            drawn, again = rng.integers(healthy, size=healthy), rng.integers(flights, size=flights)
            for cell, place in zip(of_it, places, strict=True):
                draws[i] += cell.counts(drawn, np.concatenate([place[f] for f in again]))
    return total, draws


def shares_of(cells: list[Cell]) -> tuple[int, list[list[float]]]:
    """The number of losses; at equal rates, then at the default level: the share that Page's test finds, the
    share that ours finds, the ratio of both, and the ends of its interval."""
    total, draws = counted(cells)
    found = []
    for page, ours in ((1, 2), (3, 4)):
        with np.errstate(divide="ignore", invalid="ignore"):
            share, spread = total[ours] / total[page], draws[:, ours] / draws[:, page]
            ends = np.nanpercentile(spread, PERCENT)
        found.append([total[page] / total[0], total[ours] / total[0], share, *ends])
    return int(total[0]), found


def cells_of(survey: Survey) -> list[Cell]:
    """The cells of all surfaces of an aircraft."""
    healthy = survey.in_health()
    noise = fitted([unexplained(one) for one in healthy])
    known = find_aircraft(survey.aircraft, Path()).class_of_losses
    return [cell_of(survey, surface, healthy, noise) for surface in known]
