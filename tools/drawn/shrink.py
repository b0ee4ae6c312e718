"""A smaller counterexample, which breaks the same promise."""

from collections.abc import Callable, Iterator, Sequence
from copy import deepcopy
from dataclasses import replace
from functools import reduce
from operator import getitem
from typing import Any

from tools.drawn.compose import Drawn
from tools.drawn.declare import Words

MOST_FLIGHTS = 150
KEPT = ("name", "seed")


def smaller(drawn: Drawn, broken: Sequence[str], flown: Callable[[Drawn], Sequence[str]]) -> Words:
    """The scenario without keys and entries that are not needed to break a promise of the same kind. The
    declaration stays as it is, so that the smaller scenario is declared as well as the large one.

    broken: promises that the flight breaks. flown: flies a scenario, and returns the broken promises.
    """
    kinds = {line.partition(":")[0] for line in broken}
    words, flights, again = drawn.words, 0, True
    while again:
        again = False
        for place in list(places(words)):
            if flights >= MOST_FLIGHTS:
                return words
            less = without(words, place)
            if less is None:
                continue
            flights += 1
            found = flown(replace(drawn, words=less))
            if kinds & {line.partition(":")[0] for line in found}:
                words, again = less, True
    return words


def places(node: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Yield the places of keys and entries that can be left out, large ones first."""
    inside = node.items() if isinstance(node, dict) else enumerate(node) if isinstance(node, list) else ()
    below = [(key, value) for key, value in inside if path or key not in KEPT]
    yield from ((*path, key) for key, _ in below)
    for key, value in below:
        yield from places(value, (*path, key))


def without(words: Words, place: tuple[Any, ...]) -> Words | None:
    """A copy without the entry at a place; None for an entry of the bounds, or one that is not there."""
    if place[:2] == ("fdi", "bounds") or "declared_sensors" in place:
        return None
    less = deepcopy(words)
    try:
        del reduce(getitem, place[:-1], less)[place[-1]]
    except LookupError:
        return None
    return less
