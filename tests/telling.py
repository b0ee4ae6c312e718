"""Numbers on which two formulas cannot agree by chance, and a check that says where they could.

A symmetric range, a least value of zero, noise of nothing, one block, one gust: there a term that is dropped,
an index that is swapped and a factor that is forgotten leave the result as it was. What a fixture makes by
hand is filled from here, or held against `apart`.
"""

from collections.abc import Iterator
from itertools import pairwise

import numpy as np


def numbers(*shape, seed=0, size=1.0):
    """So many numbers between `size` and three times that, of both signs, no two of them of the same size."""
    rng, count = np.random.default_rng(seed), int(np.prod(shape))
    steps = 1.0 + 2.0 * (np.arange(count) + rng.uniform(0.2, 0.8, count)) / max(count, 1)
    signs = rng.choice([-1.0, 1.0], count)
    return (size * rng.permutation(steps) * signs).reshape(shape)


def fill(record, seed=0, size=1.0):
    """Fill every number of a record (a row of a structured array), flags and counts among them from 1 up."""
    places = [*_places(record)]
    values = iter(np.abs(numbers(sum(np.size(of[name]) for of, name in places), seed=seed, size=size)))
    whole = iter(range(1 + 7 * seed, 1_000_000))
    for of, name in places:
        shape, kind = np.shape(of[name]), np.asarray(of[name]).dtype.kind
        source = values if kind == "f" else whole
        of[name] = np.array([next(source) for _ in range(int(np.prod(shape)))]).reshape(shape)
    return record


def _places(record) -> Iterator:
    """Each number or array of numbers in a record: the record it is in, and its name."""
    for name in record.dtype.names:
        part = record[name]
        if part.dtype.names is None:
            yield record, name
        else:
            for place in np.ndindex(part.shape):
                yield from _places(part[place] if place else part)


def alike(values, zeros=False):
    """Where numbers would hide a mistake: zeros (unless they are meant), and pairs of one size."""
    flat = np.asarray(values, dtype=float).ravel()
    shape, size = np.shape(values), np.abs(flat)
    named = [str(list(map(int, np.unravel_index(place, shape)))) for place in range(flat.size)]
    found = [] if zeros else [f"{named[place]} is 0" for place in np.flatnonzero(size == 0.0)]
    order = np.argsort(size, kind="stable")
    for one, other in pairwise(order):
        if size[one] > 0.0 and np.isclose(size[one], size[other], rtol=1e-6, atol=0.0):
            found.append(f"{named[one]} and {named[other]} are of one size")
    return sorted(found)


def apart(zeros=(), **fixture):
    """Refuse a fixture whose numbers do not tell formulas apart, and say where. zeros: names in which a 0 is
    meant."""
    found = {name: alike(values, name in zeros) for name, values in fixture.items()}
    wrong = [f"{name}{where}" for name, places in found.items() for where in places]
    assert not wrong, "; ".join(wrong)


def bits(value):
    """Of every number in an array, also of records: not of the gaps between them, which a copy leaves."""
    names = value.dtype.names
    return value.tobytes() if names is None else b"".join(bits(value[name]) for name in names)
