"""Records, and those of them that have room for as much as an aircraft or a flight needs.

What has the same size in each comes first in such a record, always in the same places. Behind it is what has
not: where each part begins and how long it is follows from the record's NumPy type. Compiled code asks for
these numbers (`places`) when Python calls it, and is the same for all sizes: sized_types.py.
"""

import functools
import hashlib
import inspect
from collections.abc import Callable, Collection, Iterator
from typing import Any, NamedTuple, Union

import numpy as np

LINE_BYTES = 64  # a line of a processor's cache
FEWEST_LINES = 4  # fewer are not worth the gap before them


class Room(int):
    """How many there is room for: in compiled code no constant."""

    def __add__(self, other: int) -> "Room":
        return Room(int(self) + int(other))

    def __mul__(self, other: int) -> "Room":
        return Room(int(self) * int(other))

    def __floordiv__(self, other: int) -> "Room":
        return Room(int(self) // int(other))

    __radd__, __rmul__ = __add__, __mul__


class Part(NamedTuple):
    """Of a record: what changes in size. dims: of an array, None where its size does."""

    name: str
    of: Union[np.dtype, "Shape"]
    dims: tuple[int | None, ...]

    @property
    def n_places(self) -> int:
        """How many of the numbers of `places` are about it: see there."""
        within = 0 if isinstance(self.of, np.dtype) else self.of.n_places + bool(self.dims)
        return 1 + sum(size is None for size in self.dims) + within


class Shape(NamedTuple):
    """What records of all sizes have in common: the type of what is the same in each, and the rest."""

    fixed: np.dtype
    parts: tuple[Part, ...]

    @property
    def n_places(self) -> int:
        return sum(part.n_places for part in self.parts)

    @property
    def digest(self) -> str:
        return short_digest(self)


@functools.cache
def short_digest(value: Any) -> str:
    """A name for what a value prints: of a large record's shape it takes 2 ms, and is asked for at each use
    of the record while code is compiled."""
    return hashlib.sha256(repr(value).encode()).hexdigest()[:16]


_shapes: dict[np.dtype, Shape] = {}


def record(**fields: Any) -> np.dtype:
    """The type of a record: what each field is, `int`, `float` or the type of another record, or, of an array
    of floats, its shape. Of other arrays what they are made of comes first.

    record(n=int, share=float, decay=8, damping=(3, 3), fired=(int, 13), test=(TEST, 13))
    """
    given = {name: _kind_and_shape(field) for name, field in fields.items()}
    changing = {name for name, field in given.items() if _changes(*field)}
    order = sorted(given, key=changing.__contains__)
    formats = [np.dtype((kind, tuple(map(int, shape)))) for kind, shape in map(given.__getitem__, order)]
    dtype = np.dtype({"names": order, "formats": formats}, align=True)
    if changing:
        dtype = _on_lines(dtype, changing)
        fixed = np.dtype([(name, *given[name]) for name in given if name not in changing], align=True)
        _shapes[dtype] = Shape(fixed, tuple(_part(name, *given[name]) for name in order if name in changing))
    return dtype


def _on_lines(dtype: np.dtype, parts: Collection[str]) -> np.dtype:
    """The same record, each of these parts on a line of the processor's cache if it fills several: of an
    array that begins between two, each access of a vector instruction touches both."""
    kinds = {name: dtype[name] for name in dtype.names or ()}
    offsets, end = [], 0
    for name, kind in kinds.items():
        large = name in parts and kind.itemsize >= FEWEST_LINES * LINE_BYTES
        offsets.append(_up_to(LINE_BYTES if large else kind.alignment, end))
        end = offsets[-1] + kind.itemsize
    size = _up_to(LINE_BYTES if end >= FEWEST_LINES * LINE_BYTES else dtype.alignment, end)
    layout: Any = {"names": [*kinds], "formats": [*kinds.values()], "offsets": offsets, "itemsize": size}
    return np.dtype(layout, align=True)


def _up_to(step: int, size: int) -> int:
    """The size, rounded up to a multiple of the step."""
    return -(-size // step) * step


def _kind_and_shape(given: Any) -> tuple[Any, tuple[int, ...]]:
    parts = given if isinstance(given, tuple) else (given,)
    return (float, parts) if isinstance(parts[0], int) else (parts[0], parts[1:])


def _changes(kind: Any, shape: tuple[int, ...]) -> bool:
    return any(isinstance(size, Room) for size in shape) or shape_of(kind) is not None


def _part(name: str, kind: Any, shape: tuple[int, ...]) -> Part:
    dims = tuple(None if isinstance(size, Room) else size for size in shape)
    within = shape_of(kind)
    if within is not None and len(dims) > 1:
        raise TypeError(
            f"{name}: of records that change in size there are no arrays of {len(dims)} dimensions"
        )
    return Part(name, within or np.dtype(kind), (None,) if within is not None and dims else dims)


def sized(function: Callable[..., np.dtype]) -> Callable[..., np.dtype]:
    """For a function that returns the type of a record for sizes, numbers or tuples of such: each type is
    made once, and compiled code of one is compiled code of all."""
    arguments = inspect.signature(function)

    @functools.lru_cache
    @functools.wraps(function)
    def of(*given: Any, **named: Any) -> np.dtype:
        bound = arguments.bind(*given, **named)
        bound.apply_defaults()
        return function(*map(_rooms, bound.args))

    return of


def _rooms(size: Any) -> Any:
    return type(size)(*map(_rooms, size)) if isinstance(size, tuple) else Room(size)


def shape_of(dtype: Any) -> Shape | None:
    """What a record's type shares with those of other sizes; None of one that has but one size."""
    return _shapes.get(dtype) if isinstance(dtype, np.dtype) else None


def places(dtype: np.dtype) -> Iterator[int]:
    """Of each part that changes in size: where it begins, bytes from the record's own beginning, each size
    that is not given, of several records the bytes from one to the next, and of records their own places."""
    for part in _shapes[dtype].parts:
        field, offset = dtype.fields[part.name][:2]  # type: ignore[index]
        element, sizes = field.subdtype or (field, ())
        yield offset
        yield from (size for size, given in zip(sizes, part.dims, strict=True) if given is None)
        if isinstance(part.of, Shape):
            if part.dims:
                yield element.itemsize
            yield from places(element)


def fill(record: np.void, **values: Any) -> None:
    """Write these fields of a record."""
    for name, value in values.items():
        record[name] = value
