"""The probability of an event that is too rare to be seen in plain trials.

Subset simulation [AuBeck2001] needs a score that rises towards the event, which has a score of 0 or more.
Each level of the score is reached by a tenth of the flights that reached the level before. From these
flights, Markov chains in the space of standard normals give further flights above the level, by conditional
sampling [Papaioannou2015]. With the share p_j of flights that reach level j, the probability is the product
of all p_j.

This is done in independent runs. The mean of their probabilities is the estimate, and their spread gives the
interval, that of a lognormal mean [Cox, in Land1972].
"""

import math
from collections.abc import Callable

import numpy as np

from beaver_ftc.documents.files import Document
from beaver_ftc.studies.engine.draws import generator_of
from beaver_ftc.studies.engine.statistics import CONFIDENCE, binomial
from beaver_ftc.studies.sweep.sampling import OF_RARE

RUNS = 8  # independent runs
MEMBERS = 220  # flights of each run at a level: 10^-5 needs a hundredth of 10^6 flights
SHARE = 0.1  # of the flights of a level that reach the next one
STEP = 0.8  # correlation of the next point of a chain with the present one
MOST_LEVELS = 10  # for probabilities down to 10^-10

Scores = np.ndarray
FlyPoints = Callable[[np.ndarray], Scores]
"""From the points of a round (flights, keys), standard normals, to their scores (flights,)."""


class Chains:
    """Independent runs of subset simulation, level by level: points (runs, members, keys), scores (runs,
    members).

    - share (runs,): the product of p_j so far, the probability of the level that a run has reached.
    - reached (runs,): whether this level is the event. stuck: whether a run cannot continue.
    - flights, levels: numbers so far. failed: number of flights without a score (-inf).
    - plain: number of events and of flights in the first round, which is plain sampling.
    - design: of the event nearest to the origin, the likeliest one: distance, number of the flight, point.
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
        """Fly until every run has reached the event, until a run is stuck, or to level MOST_LEVELS."""
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
        """The next level of a run, at most 0: the score that the share SHARE of its flights reaches, or the
        next larger score if all flights reach this one. Multiplies `share` by the share that reaches the
        level, and sets `reached` and `stuck`."""
        scores = self.scores[run]
        level = float(np.sort(scores)[-max(1, round(SHARE * scores.size))])
        if level == scores.min() < 0.0:  # at least nine tenths are equal: chains would start no closer
            level = float(scores[scores > level].min(initial=math.inf))
        if level == math.inf:  # all scores are equal
            self.stuck = True
            return level
        level = min(level, 0.0)
        self.reached[run] = level == 0.0
        self.share[run] *= float((scores >= level).mean())
        return level

    def _continue(self, going: list[int], levels: np.ndarray, fly: FlyPoints) -> None:
        """Replace the flights of the runs `going` by Markov chains from flights that reached the level of
        their run, some of them more than once if these are few:

            x' = STEP x + sqrt(1 - STEP^2) e,  e standard normal;  x' is accepted if it reaches the level,
            else x' = x

        x (going, chains, keys): present points of the chains. levels (going,).
        """
        members = self.scores.shape[1]
        n_chains = max(1, round(SHARE * members))
        starts = [np.flatnonzero(self.scores[run] >= level) for run, level in zip(going, levels, strict=True)]
        chosen = np.array([self._generator.choice(i, n_chains, replace=i.size < n_chains) for i in starts])
        rows = np.array(going)[:, None]
        x = self.points[rows, chosen]
        scores = self.scores[rows, chosen]
        all_points = [x]
        all_scores = [scores]
        for _ in range(math.ceil(members / n_chains) - 1):
            x_new = STEP * x + math.sqrt(1.0 - STEP**2) * self._generator.standard_normal(x.shape)
            moved_scores = self._flown(fly, x_new)
            accepted = moved_scores >= levels[:, None]
            x = np.where(accepted[..., None], x_new, x)
            scores = np.where(accepted, moved_scores, scores)
            all_points.append(x)
            all_scores.append(scores)
        self.points[going] = np.concatenate(all_points, axis=1)[:, :members]
        self.scores[going] = np.concatenate(all_scores, axis=1)[:, :members]

    def _flown(self, fly: FlyPoints, points: np.ndarray) -> Scores:
        """The scores of points (..., keys), (...); counts the flights and notes the likeliest event."""
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
        """The result: the probability with its two-sided interval, and the numbers of flights. why: the
        reason if the probability is not known; the interval then ends at the largest `share` of the runs."""
        events, trials = self.plain
        if self.reached.all():
            probability, low, high = lognormal_mean(self.share)
            reason = ""
        else:
            probability, low, high = math.nan, 0.0, float(self.share.max())
            reason = (
                "the score stops rising before the event" if self.stuck else "too rare for so many levels"
            )
        return {
            "probability": probability, "low": low, "high": high,
            "flights": self.flights, "levels": self.levels,
            "plain": {"events": events, "of": trials, **vars(binomial(events, trials))}, "why": reason,
        }  # fmt: skip


def lognormal_mean(values: np.ndarray) -> tuple[float, float, float]:
    """Arithmetic mean of lognormal values (n,), and the two-sided interval of the mean, Cox's with Student's
    t, at most 1:

    exp(m + s/2 -+ t sqrt(s/n + s^2 / (2 (n - 1)))),  m, s: mean and variance of the logarithms
    """
    from scipy.stats import t

    logs = np.log(values)
    spread = float(logs.var(ddof=1))
    n = len(values)
    half = float(t.ppf(0.5 + 0.5 * CONFIDENCE, n - 1)) * math.sqrt(spread / n + spread**2 / (2 * (n - 1)))
    middle = float(logs.mean()) + 0.5 * spread
    return float(values.mean()), math.exp(middle - half), min(1.0, math.exp(middle + half))
