"""The varied keys that explain an outcome, by ranks: whatever the shape of the dependence on a key.

Explained is the share of the variance of the outcome's ranks that lies between groups of flights with similar
values of the key, corrected for chance (Kruskal and Wallis' epsilon squared). Its p-value is that of random
permutations.
"""

import numpy as np

from beaver_ftc.documents.files import Document

BINS = 8
MOST_FLIGHTS = 4000  # of more, evenly spaced ones are taken: the ranking does not need them all
PERMUTATIONS = 199

Ranking = list[Document]


def rank(keys: dict[str, np.ndarray], outcome: np.ndarray) -> Ranking:
    """The keys by how much of the outcome they explain, most first.

    keys: name -> values (n,), numbers or texts; outcome (n,), infinite allowed. Each entry: `key`,
    `explained` (share of rank variance), `rank_correlation` (Spearman's, null for names), `p_value`.
    """
    chosen = np.arange(0, outcome.size, max(1, -(-outcome.size // MOST_FLIGHTS)))
    ranks = ranks_of(outcome[chosen])
    if ranks.size < 2 * BINS or ranks.min() == ranks.max():
        return []
    found = [_entry(key, values[chosen], ranks) for key, values in keys.items()]
    return sorted(found, key=lambda entry: (-entry["explained"], entry["key"]))


def ranks_of(values: np.ndarray) -> np.ndarray:
    """Ranks from 0, equal values sharing the mean of theirs."""
    from scipy.stats import rankdata

    return rankdata(values) - 1.0


def _entry(key: str, values: np.ndarray, ranks: np.ndarray) -> Document:
    groups = _groups(values)
    share = _explained(groups, ranks)
    generator = np.random.default_rng(0)
    by_chance = sum(_explained(groups, generator.permutation(ranks)) >= share for _ in range(PERMUTATIONS))
    return {
        "key": key,
        "explained": round(max(share, 0.0), 6),
        "rank_correlation": _spearman(values, ranks),
        "p_value": (1 + by_chance) / (1 + PERMUTATIONS),
    }


def _groups(values: np.ndarray) -> np.ndarray:
    """Group number of each value: its level, or its bin where there are many levels."""
    levels, group = np.unique(values, return_inverse=True)
    if values.dtype == object or levels.size <= BINS:
        return group
    return np.minimum(ranks_of(values) * BINS // values.size, BINS - 1).astype(int)


def _explained(groups: np.ndarray, ranks: np.ndarray) -> float:
    """1 - (SSW / (n - k)) / (SST / (n - 1)) of n ranks in k groups; SSW, SST: sums of squares within
    the groups, and of all."""
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
    if values.dtype == object:
        return None
    own = ranks_of(values)
    if own.min() == own.max():
        return None
    return round(float(np.corrcoef(own, ranks)[0, 1]), 6)
