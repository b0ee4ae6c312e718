"""Types of records. A record with *room* has parts whose sizes an aircraft or a flight gives.

The fields whose size is fixed come first, always in the same places. Behind them are the parts: where each
begins and how long it is follows from the NumPy type of the record. Compiled code reads these numbers
(`places`) when Python calls it, and is the same for all sizes (sized_types.py).
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
    """A size that differs from record to record, so that it is no constant in compiled code. Sums, products
    and whole quotients of such a size are such sizes; other operations would give a constant."""

    def __add__(self, other: int) -> "Room":
        return Room(int(self) + int(other))

    def __mul__(self, other: int) -> "Room":
        return Room(int(self) * int(other))

    def __floordiv__(self, other: int) -> "Room":
        return Room(int(self) // int(other))

    __radd__, __rmul__ = __add__, __mul__


class Part(NamedTuple):
    """A field whose size differs from record to record: its name, the type of its elements (`of`), and, of an
    array, its dimensions, None for each that `places` says. An array of records with room has the one
    dimension None, also if its length is fixed."""

    name: str
    of: Union[np.dtype, "Shape"]
    dims: tuple[int | None, ...]

    @property
    def n_places(self) -> int:
        """How many numbers of `places` are about this part."""
        within = 0 if isinstance(self.of, np.dtype) else self.of.n_places + bool(self.dims)
        return 1 + sum(size is None for size in self.dims) + within


class Shape(NamedTuple):
    """What the records of one type have in common at all sizes: the type of the fixed fields, and the
    parts."""

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
    """A name for what a value prints. It is kept, since each use of a record asks for it while code is
    compiled, and the shape of a large record takes 2 ms."""
    return hashlib.sha256(repr(value).encode()).hexdigest()[:16]


_shapes: dict[np.dtype, Shape] = {}


def record(**fields: Any) -> np.dtype:
    """The type of a record. A field is `int`, `float` or the type of another record; or an array: the shape
    of one of floats, or (type, *shape). A size that is a Room makes its field a part, behind the fixed
    fields.

    record(n=int, share=float, decay=8, damping=(3, 3), fired=(int, 13), test=(TEST, 13), theta=Room(4))
    """
    given = {name: _kind_and_shape(field) for name, field in fields.items()}
    changing = [name for name, field in given.items() if _changes(*field)]
    order = [name for name in given if name not in changing] + changing
    formats = [np.dtype((given[name][0], tuple(map(int, given[name][1])))) for name in order]
    dtype = np.dtype({"names": order, "formats": formats}, align=True)
    if changing:
        dtype = _on_lines(dtype, changing)
        fixed = np.dtype([(name, *given[name]) for name in given if name not in changing], align=True)
        _shapes[dtype] = Shape(fixed, tuple(_part(name, *given[name]) for name in order if name in changing))
    return dtype


def _on_lines(dtype: np.dtype, parts: Collection[str]) -> np.dtype:
    """The same record, in which each of these parts that fills several lines of the processor's cache begins
    on one: otherwise many accesses of vector instructions touch two lines."""
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


def _kind_and_shape(field: Any) -> tuple[Any, tuple[int, ...]]:
    """The type of a field of `record`, and its shape, () for a single value."""
    items = field if isinstance(field, tuple) else (field,)
    return (float, items) if isinstance(items[0], int) else (items[0], items[1:])


def _changes(kind: Any, shape: tuple[int, ...]) -> bool:
    """Whether the size of a field differs from record to record."""
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
    """Decorate a function that returns the type of a record for sizes, numbers or named tuples of numbers.
    The sizes become Rooms, so compiled code for one type is compiled code for all. A type is kept."""
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
    """What the type of a record shares with those of other sizes; None for a type without room."""
    return _shapes.get(dtype) if isinstance(dtype, np.dtype) else None


def places(dtype: np.dtype) -> Iterator[int]:
    """The numbers by which compiled code finds the parts of a record, for each part:

    - its offset from the beginning of the record, bytes
    - each size whose dimension is None
    - of an array of records with room: the bytes from one to the next
    - of records with room: the places in the first of them
    """
    for part in _shapes[dtype].parts:
        field, offset = dtype.fields[part.name][:2]  # type: ignore[index]
        element, sizes = field.subdtype or (field, ())
        yield offset
        yield from (size for size, fixed in zip(sizes, part.dims, strict=True) if fixed is None)
        if isinstance(part.of, Shape):
            if part.dims:
                yield element.itemsize
            yield from places(element)


def fill(record: np.void, **values: Any) -> None:
    """Write these fields of a record."""
    for name, value in values.items():
        record[name] = value
