"""The varied keys that explain an outcome, by ranks, so that the shape of the dependence on a key does not
matter.

`explained` is the share of the variance of the ranks of the outcome between groups of flights with similar
values of the key, corrected for chance (Kelley's epsilon squared, of the ranks). Its p-value is from random
permutations of the outcome. It is adjusted for the number of keys: the share is compared with the largest
share of all keys in each permutation [WestfallYoung1993].
"""

import numpy as np

from beaver_ftc.documents.files import Document

BINS = 8  # groups of a number with more values
MOST_FLIGHTS = 4000  # of more flights, every n-th one is used, at most so many: enough for a ranking
PERMUTATIONS = 199

Ranking = list[Document]


def rank(keys: dict[str, np.ndarray], outcome: np.ndarray) -> Ranking:
    """The keys, ordered by the share of the outcome that they explain, the largest first.

    keys: by name, values (n,), numbers, or texts as an array of objects. outcome (n,), which may be infinite.
    An entry has `key`, `explained` (share of the variance of ranks, at least 0), `rank_correlation`
    (Spearman's, null for texts) and

        p_value = (1 + permutations in which any key explains as much) / (1 + permutations)

    The list is empty for fewer than 2 BINS flights, and if all outcomes are equal.
    """
    chosen = np.arange(0, outcome.size, max(1, -(-outcome.size // MOST_FLIGHTS)))
    ranks = ranks_of(outcome[chosen])
    if ranks.size < 2 * BINS or ranks.min() == ranks.max():
        return []
    groups_of = {key: _groups(values[chosen]) for key, values in keys.items()}
    generator = np.random.default_rng(0)
    largest_by_chance = np.array([
        max((_explained(groups, shuffled) for groups in groups_of.values()), default=0.0)
        for shuffled in (generator.permutation(ranks) for _ in range(PERMUTATIONS))
    ])  # fmt: skip
    entries = []
    for key, groups in groups_of.items():
        share = _explained(groups, ranks)
        entries.append({
            "key": key,
            "explained": round(max(share, 0.0), 6),
            "rank_correlation": _spearman(keys[key][chosen], ranks),
            "p_value": (1 + int((largest_by_chance >= share).sum())) / (1 + PERMUTATIONS),
        })  # fmt: skip
    return sorted(entries, key=lambda entry: (-entry["explained"], entry["key"]))


def ranks_of(values: np.ndarray) -> np.ndarray:
    """Ranks from 0; equal values have the mean of their ranks."""
    from scipy.stats import rankdata

    return rankdata(values) - 1.0


def _groups(values: np.ndarray) -> np.ndarray:
    """The number of the group of each value: its level, or its bin if a number has many levels."""
    levels, group = np.unique(values, return_inverse=True)
    if values.dtype == object or levels.size <= BINS:
        return group
    return np.minimum(ranks_of(values) * BINS // values.size, BINS - 1).astype(int)


def _explained(groups: np.ndarray, ranks: np.ndarray) -> float:
    """1 - (SSW / (n - k)) / (SST / (n - 1)) of n ranks in k groups; SSW, SST: sums of squares within
    the groups, and of all. 0 with one group, or with one rank in each."""
    counts = np.bincount(groups)
    used = counts > 0
    means = np.bincount(groups, ranks)[used] / counts[used]
    total = ((ranks - ranks.mean()) ** 2).sum()
    between = (counts[used] * (means - ranks.mean()) ** 2).sum()
    n = ranks.size
    k = int(used.sum())
    if k < 2 or n <= k:
        return 0.0
    return float(1.0 - (total - between) / (n - k) / (total / (n - 1)))


def _spearman(values: np.ndarray, ranks: np.ndarray) -> float | None:
    """Rank correlation of a key with the outcome; None for texts, and for a constant key."""
    if values.dtype == object:
        return None
    key_ranks = ranks_of(values)
    if key_ranks.min() == key_ranks.max():
        return None
    return round(float(np.corrcoef(key_ranks, ranks)[0, 1]), 6)
