"""Worst-case search: find the flight of a sweep with the worst outcome, in place of random flights.

Differential evolution [Storn1997], current-to-best/1/bin, on the unit cube of the varied keys. A generation
is a batch. It depends only on the seed and on the outcomes of earlier generations. An interrupted search
therefore continues exactly as without the interruption, and any number of workers finds the same flight.
`differential_evolution` of scipy calls the objective itself and keeps no state, so that it cannot be resumed.
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from operator import itemgetter
from pathlib import Path
from typing import Any

import numpy as np

from beaver_ftc.aircraft import AXES
from beaver_ftc.documents.errors import BadInput
from beaver_ftc.documents.files import Document
from beaver_ftc.scenario.sweeps import Sweep
from beaver_ftc.studies.engine.draws import generator_of
from beaver_ftc.studies.engine.store import batches_of
from beaver_ftc.studies.present.tables import finite
from beaver_ftc.studies.sweep.one_flight import DEPARTED
from beaver_ftc.studies.sweep.sampling import MAX_U, OF_SEARCH, Assignment, Round, values_at
from beaver_ftc.studies.sweep.store import Store

WEIGHT = 0.7  # [Storn1997] recommend 0.4 to 1
CROSSOVER = 0.9  # [Storn1997] recommend 0.9 for few dependent keys
DEPARTED_DEG_S = 1e6  # above all tracking errors: the score of a flight that loses the aircraft at its start

Row = Mapping[str, Any]
"""A flight of the table, by column."""


def delay_score(row: Row) -> float:
    """Detection delay, s; for a missed fault, the time until the end. Minus infinity without a fault, or
    after a false alarm."""
    at_s = row["fault.at_s"]
    if row["detection.delay_s"] is not None:
        return row["detection.delay_s"]
    if at_s is None or row["false_alarm"]:
        return -math.inf
    return row["flown_s"] - at_s


def tracking_score(row: Row) -> float:
    """Largest RMS tracking error after the fault, deg/s; minus infinity without a fault. A loss of the
    aircraft has a score above all errors, the larger the earlier it is."""
    if row["status"] == DEPARTED:
        return DEPARTED_DEG_S - row["flown_s"]
    rms_deg_s = [row[f"tracking.post_fault_rms_deg_s.{axis}"] for axis in AXES]
    return -math.inf if None in rms_deg_s else max(rms_deg_s)


OBJECTIVES: dict[str, Callable[[Row], float]] = {
    "delay": delay_score,
    "false_alarm": itemgetter("worst_residual_ratio"),  # above 1: a false alarm
    "tracking": tracking_score,
}


def score(objective: str, row: Row) -> float:
    """The number that the search maximises; minus infinity for a flight without metrics."""
    return -math.inf if row["frames"] is None else float(OBJECTIVES[objective](row))


def members(keys: int) -> int:
    """The number of flights in a generation, for so many varied keys."""
    return min(64, max(16, 4 * keys))


class Evolution:
    """The population: points of the unit cube (members, keys), and their scores (members,)."""

    def __init__(self, seed: int, keys: int) -> None:
        self.members = members(keys)
        self._seed = seed
        self._keys = keys
        self.generation = 0
        self._points = np.empty((0, keys))
        self._scores = np.empty(0)

    def trials(self) -> np.ndarray:
        """The points of this generation, (members, keys); of the first, a Latin hypercube."""
        generator = generator_of(self._seed, self.generation, 0, OF_SEARCH)
        if self.generation == 0:
            intervals = [generator.permutation(self.members) for _ in range(self._keys)]
            return (np.column_stack(intervals) + generator.random((self.members, self._keys))) / self.members
        return self._mutants(generator)

    def _mutants(self, generator: np.random.Generator) -> np.ndarray:
        """x + F (best - x) + F (x_a - x_b), reflected into the cube.

        x (members, keys): the points. best: the point with the largest score. a, b: two permutations of the
        points. F: WEIGHT. A key is changed with the probability CROSSOVER, and at least one key of each point
        is.
        """
        x = self._points
        n = self.members
        a, b = (generator.permutation(n) for _ in range(2))
        mutants = x + WEIGHT * (x[self._scores.argmax()] - x) + WEIGHT * (x[a] - x[b])
        taken = generator.random(x.shape) < CROSSOVER
        taken[np.arange(n), generator.integers(self._keys, size=n)] = True
        inside = np.abs(np.where(taken, mutants, x))
        return np.minimum(1.0 - np.abs(1.0 - inside % 2.0), MAX_U)

    def select(self, trials: np.ndarray, scores: np.ndarray) -> None:
        """Replace each point by its trial if this has at least the same score. The last generation may have
        fewer trials."""
        if self.generation == 0:
            self._points = trials
            self._scores = scores.copy()
        else:
            better = np.flatnonzero(scores >= self._scores[: scores.size])
            self._points[better] = trials[better]
            self._scores[better] = scores[better]
        self.generation += 1


def generations(sweep: Sweep, objective: str, store: Store) -> Iterator[Round]:
    """The rounds of the generations. The next one is made when the one before has landed in the store; there
    is none if it has not. Raises BadInput if no key varies."""
    if not sweep.keys:
        raise BadInput(f"{sweep.name}: vary: nothing varies, allowed in a search: at least one key")
    evolution = Evolution(sweep.file.seed, len(sweep.keys))
    for number, runs in batches_of(sweep.flights, evolution.members):
        trials = evolution.trials()[: len(runs)]
        values = [values_at(sweep.file.vary.items(), x) for x in trials]
        yield Round([(number, runs)], partial(_flights_of, dict(zip(runs, values, strict=True))))
        table = store.landed(number, runs)
        if table is None:
            return
        evolution.select(trials, np.array([score(objective, row) for row in table.to_pylist()]))


def _flights_of(values: Mapping[int, Document], runs: Sequence[int]) -> list[Assignment]:
    """The assignments of these runs. values: by run."""
    return [Assignment(run, values[run]) for run in runs]


def search_result(objective: str, results: Path, sweep: Sweep) -> Document:
    """The result of the search: the worst flight with its values, and the worst score so far after each
    generation."""
    from pyarrow.parquet import read_table

    rows = read_table(results).to_pylist()
    scores = np.array([score(objective, row) for row in rows])
    best = int(scores.argmax())
    ends = [runs[-1] for _, runs in batches_of(scores.size, members(len(sweep.keys)))]
    worst_scores = np.maximum.accumulate(scores)[ends]
    return {
        "objective": objective,
        "run": rows[best]["run"],
        "score": finite(float(scores[best])),
        "values": {key: rows[best][key] for key in sweep.keys},
        "history": [finite(value) for value in worst_scores.tolist()],
    }
