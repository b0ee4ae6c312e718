"""A counterexample with as much left out as still breaks the same promise."""

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
    """Keys, and entries of lists, left out one by one for as long as a promise of the same kind breaks. The
    declaration stays, so that what is left is as well declared as before.

    broken: what the flight breaks. flown: flies and says what breaks.
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
    """Where something may be left out, the large things first."""
    inside = node.items() if isinstance(node, dict) else enumerate(node) if isinstance(node, list) else ()
    below = [(key, value) for key, value in inside if path or key not in KEPT]
    yield from ((*path, key) for key, _ in below)
    for key, value in below:
        yield from places(value, (*path, key))


def without(words: Words, place: tuple[Any, ...]) -> Words | None:
    """A copy with one thing left out; nothing of the bounds, and not what is left out already."""
    if place[:2] == ("fdi", "bounds") or "declared_sensors" in place:
        return None
    less = deepcopy(words)
    try:
        del reduce(getitem, place[:-1], less)[place[-1]]
    except LookupError:
        return None
    return less
