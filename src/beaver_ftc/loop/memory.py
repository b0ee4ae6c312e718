"""Memory of flights that are over, for the records and logs of others: fresh pages of both cost 0.3 ms."""

import numpy as np

from beaver_ftc.compiled.records import LINE_BYTES

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
    return np.ndarray(shape, kind, _new_memory(n_bytes))


def _new_memory(n_bytes: int) -> np.ndarray:
    """New bytes, from the beginning of a line of the processor's cache: see compiled/records.py."""
    bytes_and_gap = np.empty(n_bytes + LINE_BYTES, np.uint8)
    gap = -bytes_and_gap.__array_interface__["data"][0] % LINE_BYTES
    return np.frombuffer(bytes_and_gap.data, np.uint8, n_bytes, gap)


def taken_empty(shape: tuple[int, ...], dtype: np.dtype) -> np.ndarray:
    """The same, every byte of it zero."""
    array = taken(shape, dtype)
    assert array.base is not None
    array.base[:] = 0
    return array


def copied(record: np.ndarray) -> np.ndarray:
    """A copy of what `taken` gave, byte by byte: field by field it takes a hundred times as long."""
    copy = taken(record.shape, record.dtype)
    assert copy.base is not None
    assert record.base is not None
    copy.base[: record.nbytes] = record.base[: record.nbytes]
    return copy


def give_back(array: np.ndarray) -> None:
    """Return the buffer to the pool; no view of it may be used afterwards."""
    memory = array
    while isinstance(memory.base, np.ndarray):
        memory = memory.base
    if len(_spare) < _MOST and memory.dtype == np.uint8 and all(memory is not other for other in _spare):
        _spare.append(memory)
        _spare.sort(key=len)
