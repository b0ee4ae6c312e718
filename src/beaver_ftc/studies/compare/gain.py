"""`beaver-ftc compare --tune --draw N`: how much does a user gain who tunes a method again?

A method is tuned by the procedure of tune.py on draw N of the calibration sets, or on several from N on, with
seeds of their own, from the values that it ships with. Both settings then fly the next `JUDGED` draws. The
gain is the share by which the values found cost less there:

    gain = 1 - J(found) / J(built in)

Its interval is a bootstrap over the flights, in pairs [Efron1993]. The values found are judged even if they
cost so little less that tune.py keeps the built-in ones. If both are the same, the gain is 0.
"""

from collections.abc import Callable, Sequence

import numpy as np

from beaver_ftc.plugins import DETECTORS
from beaver_ftc.results.model import Document
from beaver_ftc.studies.compare.criteria import Cost, DetectorCost, LawCost, Values, flights
from beaver_ftc.studies.engine.statistics import CONFIDENCE, Estimate

JUDGED = 12  # draws on which both settings fly; with 4, the interval of a detector is 20 % wide to each side
RESAMPLES = 4000  # of the bootstrap
Size = Callable[..., np.ndarray]  # from the parts (..., n) of a cost, along an axis, to the cost (...)


def gain_of(group: str, name: str, grade: str, settings: Sequence[Values], first: int) -> Document:
    """The costs of two settings (built in, found), and the gain of the second, on `JUDGED` draws from the
    draw `first` on. judged: number of draws."""
    draws = range(first, first + JUDGED)
    costs: Sequence[Cost]
    size: Size
    if group == DETECTORS:
        cases = [case for draw in draws for case in flights(grade, None, draw)]
        costs = [DetectorCost(name, cases)]
        size = np.sum
    else:
        costs = [LawCost(name, grade, None, draw) for draw in draws]
        size = geometric_mean
    before, after = settings
    built_in = _parts(costs, before)
    retuned = built_in if after == before else _parts(costs, after)
    gain = relative_gain(built_in, retuned, size)
    return {
        "built_in": float(size(built_in, axis=-1)),
        "retuned": float(size(retuned, axis=-1)),
        "gain": gain.value,
        "gain_low": gain.low,
        "gain_high": gain.high,
        "flights": len(retuned),
        "judged": len(draws),
    }


def _parts(costs: Sequence[Cost], values: Values) -> np.ndarray:
    """The parts of all flights (n,) in these costs."""
    return np.concatenate([cost.parts(values) for cost in costs])


def relative_gain(before: np.ndarray, after: np.ndarray, size: Size) -> Estimate:
    """1 - size(after) / size(before) with its interval. before, after: parts (n,) of the same flights. Gain 0
    if both sizes are 0; -inf if only the first is."""
    from scipy.stats import bootstrap

    def gain(before: np.ndarray, after: np.ndarray, axis: int = -1) -> np.ndarray:
        """The gain of resampled parts (..., n), along an axis."""
        first, second = size(before, axis=axis), size(after, axis=axis)
        without_cost = np.where(second > 0.0, -np.inf, 0.0)
        return np.where(first > 0.0, 1.0 - second / np.where(first > 0.0, first, 1.0), without_cost)

    with np.errstate(invalid="ignore"):  # scipy's standard error of gains of -inf, which is not used here
        resampled = bootstrap(
            (before, after), gain, paired=True, n_resamples=RESAMPLES, confidence_level=CONFIDENCE,
            method="percentile", rng=1,
        )  # fmt: skip
    limits = resampled.confidence_interval
    return Estimate(float(gain(before, after)), float(limits.low), float(limits.high))


def geometric_mean(logs: np.ndarray, axis: int = -1) -> np.ndarray:
    """The geometric mean of numbers with these logarithms, along an axis."""
    return np.exp(np.mean(logs, axis=axis))
