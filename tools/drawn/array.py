"""A covering array: rows in which every pair of levels of any two factors stands together at least once.

The algorithm is greedy. A row begins with a pair that no row has yet, and each further cell takes the level
that adds the most new pairs. The number of rows is a few dozen more than the product of the two largest
factors.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

Row = dict[str, str]
Forbidden = Callable[[str, str, str, str], bool]
USUAL = 0.5
TRIES = 20  # rows begun for a pair before it is said to be impossible


@dataclass(frozen=True)
class Factor:
    """A factor and its levels. needs: levels that another factor must have for this factor to mean something;
    a profile needs a fault, for example."""

    name: str
    levels: tuple[str, ...]
    needs: Mapping[str, frozenset[str]] = field(default_factory=dict)


class CoveringArray:
    """The rows for some factors. impossible: pairs that no row can have, as far as they were found.

    forbidden(factor, level, other factor, other level): whether two levels may not stand together.
    """

    def __init__(self, factors: Sequence[Factor], forbidden: Forbidden, rng: np.random.Generator) -> None:
        self.factors, self._rng = {factor.name: factor for factor in factors}, rng
        self.cells = [(factor.name, level) for factor in factors for level in factor.levels]
        self._at = {cell: i for i, cell in enumerate(self.cells)}
        self._of = {f.name: np.array([self._at[f.name, level] for level in f.levels]) for f in factors}
        self.impossible: list[tuple[tuple[str, str], tuple[str, str]]] = []
        self._clash = self._clashes(forbidden)
        self._open = ~self._clash
        for places in self._of.values():
            self._open[np.ix_(places, places)] = False

    def _clashes(self, forbidden: Forbidden) -> np.ndarray:
        """(cells, cells) bool: pairs that may not both count in one row."""
        n = len(self.cells)
        clash = np.zeros((n, n), dtype=bool)

        def excludes(one: tuple[str, str], other: tuple[str, str]) -> bool:
            name, level = other
            needed = self.factors[one[0]].needs.get(name, (level,))
            return level not in needed or forbidden(*one, *other)

        for i, one in enumerate(self.cells):
            for j, other in enumerate(self.cells[:i]):
                clash[i, j] = clash[j, i] = excludes(one, other) or excludes(other, one)
        return clash

    def rows(self) -> Iterator[Row]:
        """Yield rows until no pair is left. A row has no cell that means nothing in it."""
        while (left := np.argwhere(np.triu(self._open))).size:
            pair = left[self._rng.integers(len(left))]
            for _ in range(TRIES):
                chosen = self._row(pair)
                if chosen is not None:
                    break
            else:
                self._open[pair[0], pair[1]] = self._open[pair[1], pair[0]] = False
                self.impossible.append((self.cells[pair[0]], self.cells[pair[1]]))
                continue
            self._open[np.ix_(chosen, chosen)] = False
            yield dict(self.cells[i] for i in chosen)

    def _row(self, pair: np.ndarray) -> list[int] | None:
        """The cells of a row with this pair; None if the row cannot be completed."""
        chosen: dict[str, int] = {}
        for i in pair:
            if not self._put(int(i), chosen):
                return None
        names = [name for name in self.factors if name not in chosen]
        self._rng.shuffle(names)
        names.sort(key=lambda name: len(self.factors[name].needs))  # what others need comes first
        for name in names:
            if name in chosen or not self._means_something(name, chosen):
                continue
            taken = list(chosen.values())
            places = self._of[name]
            free = places[~self._clash[places][:, taken].any(axis=1)]
            if not free.size:
                return None
            gain = self._open[free][:, taken].sum(axis=1) + self._rng.random(free.size)
            gain[free == places[0]] += USUAL  # the first level, where others bring no more
            chosen[name] = int(free[np.argmax(gain)])
        return list(chosen.values())

    def _put(self, place: int, chosen: dict[str, int]) -> bool:
        """Add a cell, and cells that it needs. Returns whether that was possible."""
        name, _ = self.cells[place]
        if name in chosen:
            return chosen[name] == place
        if self._clash[place, list(chosen.values())].any():
            return False
        chosen[name] = place
        for other, levels in self.factors[name].needs.items():
            if other in chosen:
                continue  # no clash, so it is one of them
            free = [self._at[other, level] for level in self.factors[other].levels if level in levels]
            free = [i for i in free if not self._clash[i, list(chosen.values())].any()]
            if not free or not self._put(int(self._rng.choice(free)), chosen):
                return False
        return True

    def _means_something(self, name: str, chosen: dict[str, int]) -> bool:
        return all(
            other in chosen and self.cells[chosen[other]][1] in levels
            for other, levels in self.factors[name].needs.items()
        )
