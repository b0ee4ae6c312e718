"""The values of the varied keys in each flight of a sweep. They depend on the sweep and the index of the
flight alone.

`linspace` keys, and all keys of a grid, take their values in turn, the last key fastest. The other keys are
*drawn*: a point of the unit cube has a number u for each, and its value is the inverse of its distribution
function at u. The sampling of the sweep (random, Latin hypercube, Sobol) determines the points.
"""

import math
import warnings
from collections.abc import Callable, Iterable, Sequence
from functools import lru_cache
from statistics import NormalDist
from typing import Any, NamedTuple

import numpy as np

from beaver_ftc.documents.files import Document
from beaver_ftc.scenario.sweeps import Sweep, SweepFile, Variation
from beaver_ftc.studies.engine.draws import generator_of

# Limits of u: the inverse of a normal distribution is infinite at 0 and 1.
MIN_U = 2.0**-53
MAX_U = 1.0 - MIN_U

# Random numbers of a sweep for different purposes have different spawn keys, which differ in a word or in
# their length:
#     (index,)                     the seed of a flight
#     (index, OF_VALUES)           the values of a flight
#     (0, OF_DESIGN)               the points of a Latin hypercube, or the scrambling of Sobol points
#     (generation, 0, OF_SEARCH)   a generation of a search
#     (0, 0, OF_RARE)              subset simulation
OF_VALUES, OF_DESIGN = 1, 2
OF_SEARCH, OF_RARE = 2, 3


class Assignment(NamedTuple):
    """One flight: its index and the value of each varied key."""

    run: int
    values: Document


class Round(NamedTuple):
    """Batches that may be flown in any order. batches: (number, runs) of each. cases_of: from runs to
    assignments."""

    batches: Sequence[tuple[int, range]]
    cases_of: Callable[[Sequence[int]], Sequence[Assignment]]


def flight_seed(sweep_seed: int, index: int) -> int:
    """The seed of one flight, 63 bits, from the seed of the sweep and the index of the flight."""
    words = np.random.SeedSequence(sweep_seed, spawn_key=(index,)).generate_state(1, np.uint64)
    return int(words[0] >> np.uint64(1))


def value_at(variation: Variation, u: float) -> Any:
    """The value of a variation at u in [0, 1): the inverse of its distribution function."""
    if variation.count is not None:
        return counted_value(variation, min(int(u * variation.count), variation.count - 1))
    first, second = getattr(variation, variation.kind)
    if variation.kind == "normal":
        return _normal(NormalDist(first, second), variation.within, u)
    if variation.kind == "uniform":
        return first + u * (second - first)
    return min(max(first * (second / first) ** u, first), second)


def _normal(distribution: NormalDist, within: tuple[float, float] | None, u: float) -> float:
    """The inverse at u of a normal distribution F that is truncated to an interval [low, high]:

    F^-1(F(low) + u (F(high) - F(low)))
    """
    low, high = within or (-math.inf, math.inf)
    below, above = distribution.cdf(low), distribution.cdf(high)
    share = min(max(below + u * (above - below), MIN_U), MAX_U)
    return min(max(distribution.inv_cdf(share), low), high)


def values_at(vary: Iterable[tuple[str, Variation]], point: Iterable[float]) -> Document:
    """The value of each key at a point of the unit cube."""
    return {key: value_at(variation, float(u)) for (key, variation), u in zip(vary, point, strict=True)}


def counted_value(variation: Variation, position: int) -> Any:
    """The value at a position of a `linspace` or `choice`. Both ends of a `linspace` are exact, and the only
    value of one is the first."""
    values = getattr(variation, variation.kind)
    if variation.kind == "choice":
        return values[position]
    first, last, count = values
    if position == 0:
        return first
    return last if position == count - 1 else first + position * (last - first) / (count - 1)


class Plan:
    """The values of each flight of a sweep. _in_turn, _drawn: the two kinds of keys."""

    def __init__(self, sweep: Sweep) -> None:
        self._file: SweepFile = sweep.file
        is_grid = sweep.file.sampling == "grid"
        vary = sweep.file.vary
        self._in_turn = {key: of for key, of in vary.items() if is_grid or of.linspace is not None}
        self._drawn = {key: of for key, of in vary.items() if key not in self._in_turn}

    def assignments(self, indices: Sequence[int]) -> list[Assignment]:
        """The values of these flights. indices: increasing."""
        points = self._points(np.array(indices))
        return [
            Assignment(index, self._values(index, point))
            for index, point in zip(indices, points, strict=True)
        ]

    def _points(self, indices: np.ndarray) -> np.ndarray:
        """Points of the unit cube, (flights, drawn keys)."""
        seed = self._file.seed
        dimensions = len(self._drawn)
        if not dimensions or not indices.size:
            return np.empty((indices.size, dimensions))
        if self._file.sampling == "lhs":
            return _latin_hypercube(seed, dimensions, self._file.flights)[indices]
        if self._file.sampling == "sobol":
            return _sobol(seed, dimensions, indices)
        return np.array(
            [generator_of(seed, index, OF_VALUES).random(dimensions) for index in indices.tolist()]
        )

    def _values(self, index: int, point: np.ndarray) -> Document:
        """The values of one flight. point: u of the drawn keys."""
        values = values_at(self._drawn.items(), point)
        for key, variation in reversed(self._in_turn.items()):
            index, position = divmod(index, variation.count or 1)
            values[key] = counted_value(variation, position)
        return {key: values[key] for key in self._file.vary}


@lru_cache(maxsize=1)  # every batch of a sweep uses it
def _latin_hypercube(seed: int, dimensions: int, flights: int) -> np.ndarray:
    """Points (flights, dimensions): in each dimension, one in each of `flights` equal intervals [McKay,
    Beckman, Conover 1979].

    `qmc.LatinHypercube` of scipy draws other numbers, and the flights of a seed must not change.
    """
    generator = generator_of(seed, 0, OF_DESIGN)
    columns = [
        (generator.permutation(flights) + generator.random(flights)) / flights for _ in range(dimensions)
    ]
    return np.column_stack(columns)


def _sobol(seed: int, dimensions: int, indices: np.ndarray) -> np.ndarray:
    """Scrambled Sobol points [Owen 1995] at increasing indices, (indices, dimensions). Each stretch of
    consecutive indices is drawn at once."""
    from scipy.stats import qmc

    engine = qmc.Sobol(dimensions, scramble=True, seed=generator_of(seed, 0, OF_DESIGN))
    points = []
    # scipy warns of a number of points that is no power of 2; the whole sweep may have one
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        for stretch in np.split(indices, np.flatnonzero(np.diff(indices) > 1) + 1):
            engine.reset()
            if stretch[0]:
                engine.fast_forward(int(stretch[0]))
            points.append(engine.random(stretch.size))
    return np.concatenate(points)
