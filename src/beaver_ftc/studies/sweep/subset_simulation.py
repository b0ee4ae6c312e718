"""The probability of an event that plain trials would have to be repeated a million times to see once.

Subset simulation [AuBeck2001]: levels of a score that rises towards the event, each reached by a tenth of the
flights that reached the one before; these are continued as Markov chains in the space of standard normals, by
conditional sampling [Papaioannou2015]. It is done in independent runs: their mean is the estimate, and what
they differ by the interval, that of a lognormal mean [Cox, in Land1972].
"""

import math
from collections.abc import Callable

import numpy as np

from beaver_ftc.documents.files import Document
from beaver_ftc.studies.engine.draws import generator_of
from beaver_ftc.studies.engine.statistics import CONFIDENCE, binomial
from beaver_ftc.studies.sweep.sampling import OF_RARE

RUNS = 8  # independent runs
MEMBERS = 220  # flights of each run a level: 10^-5 by a hundredth of 10^6 flights
SHARE = 0.1  # of the flights of a level that reach the next one
STEP = 0.8  # how much of a point a chain's next one keeps
MOST_LEVELS = 10  # down to 10^-10

Scores = np.ndarray
FlyPoints = Callable[[np.ndarray], Scores]
"""From a round's points (flights, keys), standard normals, to scores (flights,); events from 0."""


class Chains:
    """Independent runs of subset simulation abreast: points (runs, members, keys), scores (runs, members).

    share (runs,): probability of the level that a run has reached, the product of its shares so far. reached
    (runs,): whether that is the event. stuck: whether a run cannot go on. flights, levels: how many so far;
    failed: flights without a score (-inf).
    plain: events and flights of the first round. design: of the likeliest event its distance, flight, point.
    """

    def __init__(self, keys: int, seed: int, runs: int = RUNS, members: int = MEMBERS) -> None:
        self._generator = generator_of(seed, 0, 0, OF_RARE)
        self.points = self._generator.standard_normal((runs, members, keys))
        self.scores = np.full((runs, members), -math.inf)
        self.share = np.ones(runs)
        self.reached = np.zeros(runs, bool)
        self.stuck = False
        self.flights = 0
        self.failed = 0
        self.levels = 0
        self.design: tuple[float, int, np.ndarray] | None = None

    def go(self, fly: FlyPoints) -> None:
        """Fly until every run has reached the event, or cannot."""
        self.scores[:] = self._flown(fly, self.points)
        self.plain = int((self.scores >= 0.0).sum()), self.scores.size
        while True:
            levels = {run: self._level(run) for run in np.flatnonzero(~self.reached).tolist()}
            going = [run for run in levels if not self.reached[run]]
            if not going or self.stuck or self.levels == MOST_LEVELS:
                break
            self.levels += 1
            self._continue(going, np.array([levels[run] for run in going]), fly)

    def _level(self, run: int) -> float:
        """The next level of a run, whose share of flights goes into its probability."""
        scores = self.scores[run]
        level = float(np.sort(scores)[-max(1, round(SHARE * scores.size))])
        if not math.isfinite(level):  # too few have a score: nothing is known below the level before
            self.stuck = True
            return level
        level, self.reached[run] = min(level, 0.0), level >= 0.0
        share = float((scores >= level).mean())
        self.stuck |= share == 1.0 and not self.reached[run]  # all alike: nothing leads on
        self.share[run] *= share
        return level

    def _continue(self, going: list[int], levels: np.ndarray, fly: FlyPoints) -> None:
        """Chains from the flights that reached their level, all runs abreast:

            x' = STEP x + sqrt(1 - STEP^2) e,  e standard normal,  taken where it reaches the level, too

        x: the points `here` (runs, chains, keys); levels (runs,) of the runs `going`.
        """
        members = self.scores.shape[1]
        seeds = max(1, round(SHARE * members))
        at = np.array([
            self._generator.choice(np.flatnonzero(self.scores[run] >= level), seeds, replace=False)
            for run, level in zip(going, levels, strict=True)
        ])  # fmt: skip
        rows = np.array(going)[:, None]
        here = self.points[rows, at]
        scores = self.scores[rows, at]
        kept = [here]
        values = [scores]
        for _ in range(math.ceil(members / seeds) - 1):
            moved = STEP * here + math.sqrt(1.0 - STEP**2) * self._generator.standard_normal(here.shape)
            found = self._flown(fly, moved)
            better = found >= levels[:, None]
            here = np.where(better[..., None], moved, here)
            scores = np.where(better, found, scores)
            kept.append(here)
            values.append(scores)
        self.points[going] = np.concatenate(kept, axis=1)[:, :members]
        self.scores[going] = np.concatenate(values, axis=1)[:, :members]

    def _flown(self, fly: FlyPoints, points: np.ndarray) -> Scores:
        flat = points.reshape(-1, points.shape[-1])
        scores = fly(flat)
        for i in np.flatnonzero(scores >= 0.0).tolist():
            distance = float(np.linalg.norm(flat[i]))
            if self.design is None or distance < self.design[0]:
                self.design = distance, self.flights + i, flat[i].copy()
        self.flights += len(flat)
        self.failed += int(np.isneginf(scores).sum())
        return scores.reshape(points.shape[:-1])

    def estimate(self) -> Document:
        """The result of the runs: a probability with its two-sided interval; why: the reason if it is not
        known."""
        events, of = self.plain
        if self.reached.all():
            probability, low, high = lognormal_mean(self.share)
            why = ""
        else:
            probability, low, high = math.nan, 0.0, float(self.share.max())
            why = "the score stops rising before the event" if self.stuck else "too rare for so many levels"
        return {
            "probability": probability, "low": low, "high": high,
            "flights": self.flights, "levels": self.levels,
            "plain": {"events": events, "of": of, **vars(binomial(events, of))}, "why": why,
        }  # fmt: skip


def lognormal_mean(values: np.ndarray) -> tuple[float, float, float]:
    """Mean of some lognormal values (n,) and its two-sided interval, Cox's with Student's t:

    exp(m + s/2 -+ t sqrt(s/n + s^2 / (2 (n - 1)))),  m, s: mean and variance of the logarithms
    """
    from scipy.stats import t

    logs = np.log(values)
    spread = float(logs.var(ddof=1))
    n = len(values)
    half = float(t.ppf(0.5 + 0.5 * CONFIDENCE, n - 1)) * math.sqrt(spread / n + spread**2 / (2 * (n - 1)))
    middle = float(logs.mean()) + 0.5 * spread
    return float(values.mean()), math.exp(middle - half), min(1.0, math.exp(middle + half))
