"""What of all there is to see is found: beside a test that is told everything of a loss but when it strikes.

`python -m tools.docs table unknown-instant` prints it for aircraft of the jsbsim package.

Page's test [Page1954]: the largest log likelihood ratio of "this fault, since some instant" that any instant
has. Where observations have one distribution before and one after, no test has a shorter worst mean delay at
the same mean time between false alarms. It is told surface, magnitude and the design model, and the noise by
the truth's own innovations: a vector autoregression of ORDER frames, fitted to what the design model leaves
of the healthy flights, whitens them and the fault's signature. Errors of the model, gusts and gyros are in it
as they are, not as they are declared. Instants are 0.05 s apart and at most 10 s back.

Flights are those of `beaver-ftc detectability --grid`. What is declared is what is there: sensors, air, and
the error of the aircraft's own model, at the measured pace. It is known within an envelope alone; outside
nothing is concluded, and losses within a second of which the aircraft is outside are left out.

Each surface is lost by 40 and 100 % at 3 and 6 deg/s. Counted are the losses found within 1 s by Page's test
and by our two detectors, first with levels that give at most 20 false alarms per hour on the healthy flights,
then at the level that follows from the declaration, 0.001 an hour: Page's level is raised by the logarithm of
how much rarer its false alarms are to be, which is what it takes of the greatest of many likelihood ratios
[Lorden1971]. Intervals: 95 % of RESAMPLED draws of flights, a flight's losses kept together, and of the
healthy flights, from which levels are taken anew.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from math import log
from pathlib import Path
from typing import NamedTuple

import numpy as np

from beaver_ftc.diagnosis.rivals.gust import VaneGust
from beaver_ftc.scenario.airframe import find_aircraft
from beaver_ftc.studies.compare.replay import Recording, Trace, record, trace
from beaver_ftc.studies.detectability.probabilities import level_for
from beaver_ftc.studies.detectability.schemes import (
    BOTH,
    WATCHED_S,
    Block,
    Condition,
    loss,
    scenario_of,
    strikes_at_s,
    with_fdi,
)

MAGNITUDES, EXCITATIONS_DEG_S = (0.4, 1.0), (3.0, 6.0)
PER_H, EVERY, FURTHEST = 20.0, 5, 1000  # false alarms; frames between instants, and back
ORDER, SETTLED, WITHIN_S = 20, 100, 1.0  # frames of the autoregression, and before it is fitted
SHIPPED, SHIPPED_PER_H = 1.0, 1e-3  # our statistic's own alarm level, and the false alarms it declares
RESAMPLED, PERCENT = 400, (2.5, 97.5)
NONE = dict.fromkeys("pqr", 0.0)
OWN_ALONE = {
    "fdi.bounds.constant_rad_s2": NONE, "fdi.bounds.inertia_coupling": NONE,
    "fdi.statistical.uncertainty_rad_s": 5.0,
}  # fmt: skip


class Whitener(NamedTuple):
    """What is known of noise: from frames before each, (3 ORDER, 3), and the rest's inverse root (3, 3)."""

    before: np.ndarray
    root: np.ndarray

    def respond(self, z: np.ndarray) -> np.ndarray:
        """Accelerations z (n, 3) rad/s2 as they are in the white noise of variance one."""
        return self.responses(z)[ORDER]

    def responses(self, z: np.ndarray) -> np.ndarray:
        """The same, (ORDER + 1, n, 3), of accelerations that began so many frames before each; the last: or
        more."""
        rest = np.repeat(z[None], ORDER + 1, axis=0)
        for j, part in enumerate(self.before.reshape(ORDER, 3, 3), start=1):
            rest[j:, j:] -= z[:-j] @ part
        return rest @ self.root


def fitted(unexplained: list[np.ndarray]) -> Whitener:
    """Of healthy flights, (n, 3) rad/s2 each."""
    past = np.vstack([_past(z)[SETTLED:] for z in unexplained])
    now = np.vstack([z[SETTLED:] for z in unexplained])
    before = np.linalg.lstsq(past, now, rcond=None)[0]
    rest = now - past @ before
    return Whitener(before, np.linalg.inv(np.linalg.cholesky(rest.T @ rest / len(rest))).T)


def _past(z: np.ndarray) -> np.ndarray:
    """The ORDER frames before each, (n, 3 ORDER), the latest first."""
    return np.hstack([np.vstack((np.zeros((j, 3)), z[:-j])) for j in range(1, ORDER + 1)])


def unexplained(recording: Recording) -> np.ndarray:
    """What design model and vanes' gust leave of each frame's acceleration, (frames - 1, 3) rad/s2."""
    gust = VaneGust(recording.context)
    seen = [gust.subtracted(measured) for measured, _ in recording.seen]
    x, expected = (
        np.array([getattr(measured, of_it) for measured in seen]) for of_it in ("x", "acceleration")
    )
    return np.diff(x, axis=0) / recording.context.dt_s - expected[1:]


def ratios(recording: Recording, surface: str, noise: Whitener) -> dict[float, np.ndarray]:
    """Of each magnitude the largest log likelihood ratio, at every frame (n,)."""
    place = recording.context.surfaces.index(surface)
    does = -np.array([measured.contribution[:, place] for measured, _ in recording.seen[1:]])  # a total loss
    return largest_ratios(recording, does, noise, MAGNITUDES, EVERY)


def largest_ratios(
    recording: Recording, does: np.ndarray, noise: Whitener, sizes: tuple[float, ...] = (1.0,),
    every: int = 1,
) -> dict[float, np.ndarray]:  # fmt: skip
    """The same of accelerations (n, 3) rad/s2 times each size, since instants so many frames apart."""
    g, n = noise.respond(unexplained(recording)), len(does)
    k, since = np.arange(n), np.arange(0, n, every)
    response = noise.responses(does)
    age = k[:, None] - since
    began = np.clip(age, 0, ORDER), k[:, None]
    late = (age >= 0) & (age < FURTHEST)
    N, D = (
        np.cumsum(np.where(age >= 0, seen.sum(axis=2)[began], 0.0), axis=0)
        for seen in (response * g, np.square(response))
    )
    return {
        m: np.concatenate(([0.0], np.where(late, m * N - 0.5 * m * m * D, 0.0).max(axis=1, initial=0.0)))
        for m in sizes
    }


@dataclass(frozen=True)
class Survey:
    """Which aircraft in which air, how many flights a cell and in health; flights' seeds begin at `seed`."""

    aircraft: str
    turbulence: str
    flights: int
    healthy: int
    seed: int

    def flown(self, block: Block, duration_s: float, faults: list[dict]) -> Recording:
        """A flight as shown to plug-ins."""
        flight = scenario_of(block, duration_s, faults, {"aircraft": self.aircraft})
        return record(with_fdi(flight, BOTH).with_(OWN_ALONE))

    def block(self, excitation_deg_s: float, number: int) -> Block:
        return Block(Condition("tactical-grade", self.turbulence), excitation_deg_s, self.seed + number)

    def in_health(self) -> list[Recording]:
        """Flights without a fault."""
        speeds = EXCITATIONS_DEG_S * self.healthy
        return [self.flown(self.block(speeds[i], 100_000 + i), 18.0, []) for i in range(self.healthy)]

    def lost(self, surface: str) -> Iterator[tuple[float, Recording]]:
        """Magnitude of the loss and the flight."""
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
    """What of a statistic decides about alarms at any level: of each loss (n,) its largest value before, and
    from then until WITHIN_S after; of healthy flights, their traces."""

    before: np.ndarray
    soon: np.ndarray
    healthy: list[Trace]

    @classmethod
    def of(cls, losses: list[Trace], healthy: list[Trace]) -> "Seen":
        """Of traces."""
        soon = [max((v for t, v in one.records if t <= WITHIN_S + 1e-9), default=0.0) for one in losses]
        return cls(np.array([one.before for one in losses]), np.array(soon), healthy)

    def level(self, drawn: np.ndarray) -> float:
        """Of PER_H false alarms, of the healthy flights drawn."""
        return level_for([self.healthy[i] for i in drawn], PER_H)

    def found(self, level: float) -> np.ndarray:
        """Which losses (n,) are found in time, and no alarm was raised before."""
        return (self.soon > level) & (self.before <= level)


@dataclass(frozen=True)
class Cell:
    """A surface of an aircraft: of each loss (n,) its flight and magnitude; what Page's test, of each
    magnitude, and ours made of it."""

    aircraft: str
    surface: str
    flight: np.ndarray
    magnitude: np.ndarray
    page: dict[float, Seen]
    ours: Seen

    def counts(self, drawn: np.ndarray, losses: np.ndarray) -> np.ndarray:
        """Of the losses, which may be drawn repeatedly: how many count, found by Page's test, by ours, and
        at the level as shipped by Page's, by ours."""
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
    """Losses that count; at equal rates, then as shipped, the share that Page's test finds, ours, ours over
    its, and the ends of that."""
    total, draws = counted(cells)
    found = []
    for page, ours in ((1, 2), (3, 4)):
        with np.errstate(divide="ignore", invalid="ignore"):
            share, spread = total[ours] / total[page], draws[:, ours] / draws[:, page]
            ends = np.nanpercentile(spread, PERCENT)
        found.append([total[page] / total[0], total[ours] / total[0], share, *ends])
    return int(total[0]), found


def cells_of(survey: Survey) -> list[Cell]:
    """All cells of an aircraft."""
    healthy = survey.in_health()
    noise = fitted([unexplained(one) for one in healthy])
    known = find_aircraft(survey.aircraft, Path()).class_of_losses
    return [cell_of(survey, surface, healthy, noise) for surface in known]
