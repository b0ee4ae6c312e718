"""The map of isolability: the smallest loss of one surface that excludes another surface, and the delay.

A pair is a surface that loses effectiveness and another surface that could explain the innovation. Along a
flight, the map has for each pair the smallest loss for which the other surface is excluded in time, and the
time until a total loss excludes it. Both are given for every instant at which the loss may begin, and for
half of them. The map also has the doublet that is certain to distinguish losses of the two surfaces in
straight flight, as `separate` finds it.
"""

from itertools import permutations
from math import inf

import numpy as np

from beaver_ftc.plugins import offered
from beaver_ftc.results.model import Document
from beaver_ftc.scenario.schema import Scenario
from beaver_ftc.studies.engine.statistics import quantile
from beaver_ftc.studies.present.tables import finite

LOSS_COLUMNS = ("magnitude", "magnitude_median", "longest_s", "median_s")
DOUBLET_COLUMNS = ("doublet_deg", "doublet_s", "why")
NO_DOUBLETS = {"why": "no installed package offers 'doublets'"}
DISTINGUISHED_LOSS = 0.5  # share of effectiveness lost: of both losses that a doublet distinguishes


def loss_limits(excluded: np.ndarray, frames: int, dt: float) -> Document:
    """Limits of one pair along a flight, by LOSS_COLUMNS; None for a limit that no loss reaches.

    excluded (n,): smallest loss, 0 to 1, for which the frame alone excludes the other surface; infinite where
    no loss does. frames: number of frames within which the other surface has to be excluded. dt: length of a
    frame, s. A delay includes the frame in which the loss begins. A loss begins at least `frames` before the
    end.
    """
    smallest = least_in_window(excluded, frames)
    n = len(excluded)
    own = np.where(excluded <= 1.0, np.arange(n), n)
    # From each frame on: the first frame in which a total loss excludes the other surface, or n.
    next_exclusion = np.minimum.accumulate(own[::-1])[::-1]
    delay_s = np.where(next_exclusion < n, (next_exclusion - np.arange(n) + 1) * dt, inf)
    limits = (*largest_and_median(smallest), *largest_and_median(delay_s[: len(smallest)]))
    return dict(zip(LOSS_COLUMNS, limits, strict=True))


def least_in_window(values: np.ndarray, frames: int) -> np.ndarray:
    """The smallest of each `frames` successive values: (n,) to (n - frames + 1,); frames: at most n."""
    return np.lib.stride_tricks.sliding_window_view(values, frames).min(axis=1)


def largest_and_median(values: np.ndarray, most: float = inf) -> list[float | None]:
    """The largest of values (n,) and their median; None for one that is above `most` or infinite."""
    ordered = np.sort(values)
    both = float(ordered[-1]), quantile(ordered, 0.5)
    return [finite(value) if value <= most else None for value in both]


def smallest_doublets(scenario: Scenario, after_s: float) -> dict[tuple[str, str], Document]:
    """By (faulty, other surface): the doublet, flown after_s into a healthy flight, that distinguishes
    losses of DISTINGUISHED_LOSS of the two; or why there is none."""
    find = offered("doublets")
    pairs = permutations(scenario.airframe.class_of_losses, 2)
    return find(scenario, after_s, DISTINGUISHED_LOSS) if find else dict.fromkeys(pairs, NO_DOUBLETS)
