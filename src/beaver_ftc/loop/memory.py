"""Memory of flights that are over, for those to come: fresh pages of a record and a log cost 0.3 ms."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

_PIECE = 1024  # bytes
_MOST = 4  # kept: more flights are hardly ever in progress at the same time
_spare: list[np.ndarray] = []


def taken(shape: tuple[int, ...], dtype: np.dtype | type = np.float64) -> np.ndarray:
    """An array of this shape and type, C-ordered, of whatever is in that memory.

    On a buffer, not as a view: of a record's bytes NumPy would look for objects, field by field.
    """
    kind = np.dtype(dtype)
    n_bytes = kind.itemsize * int(np.prod(shape))
    for i, memory in enumerate(_spare):
        if memory.size >= n_bytes:
            return np.ndarray(shape, kind, _spare.pop(i))
    return np.ndarray(shape, kind, np.empty(n_bytes, np.uint8))


def taken_empty(shape: tuple[int, ...], dtype: np.dtype | type = np.float64) -> np.ndarray:
    """The same, every byte of it zero."""
    array = taken(shape, dtype)
    assert array.base is not None
    array.base[:] = 0
    return array


@dataclass(frozen=True)
class Packed:
    """A structured array of which most is zero: what is not, and where; and what has to be zero for it."""

    shape: tuple[int, ...]
    dtype: np.dtype
    pieces: tuple[tuple[slice, np.ndarray], ...]
    cleared: tuple[slice, ...]


def packed(record: np.ndarray, idle: Sequence[Sequence[str]] = ()) -> Packed:
    """A record (1,) kept for copies, as bytes: field by field a copy takes a hundred times as long.

    idle: paths of fields that are zero and that nobody reads before writing them; copies have anything there.
    """
    content = record.view(np.uint8)
    whole = content.size - content.size % _PIECE
    used = np.append(content[:whole].reshape(-1, _PIECE).any(axis=1), content[whole:].any())
    ends = _PIECE * np.flatnonzero(np.diff(used, prepend=False, append=False)).reshape(-1, 2)
    places = [slice(first, min(last, content.size)) for first, last in ends.tolist()]
    spared = sorted(_place(record.dtype, path) for path in idle)
    edges = [0, *(edge for span in spared for edge in span), content.size]
    cleared = tuple(slice(*span) for span in zip(edges[::2], edges[1::2], strict=True))
    pieces = tuple((place, content[place].copy()) for place in places)
    give_back(record)
    return Packed(record.shape, record.dtype, pieces, cleared)


def _place(dtype: np.dtype, path: Sequence[str]) -> tuple[int, int]:
    """The bytes of a field, from and to."""
    start = 0
    for name in path:
        assert dtype.fields is not None
        dtype, offset = dtype.fields[name][:2]
        start += offset
    return start, start + dtype.itemsize


def unpacked(kept: Packed) -> np.ndarray:
    """A new record as the one that was packed."""
    record = taken(kept.shape, kept.dtype)
    content = record.base
    assert content is not None
    for place in kept.cleared:
        content[place] = 0
    for place, piece in kept.pieces:
        content[place] = piece
    return record


def give_back(array: np.ndarray) -> None:
    """Whoever took it, or a copy, has done with it and with every view of it."""
    memory = array
    while isinstance(memory.base, np.ndarray):
        memory = memory.base
    if len(_spare) < _MOST and memory.dtype == np.uint8 and all(memory is not other for other in _spare):
        _spare.append(memory)
        _spare.sort(key=len)
