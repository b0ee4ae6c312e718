"""Kernels without a compiler, for a debugger: the same functions on records whose fields are attributes."""

import functools
from typing import Any

import numpy as np

# mypy: disable-error-code="attr-defined,method-assign,assignment"


def interpreted(function):
    """The function as it is, given records whose fields are attributes, as compiled code has them."""

    @functools.wraps(function)
    def call(*arguments):
        with np.errstate(all="ignore"):  # as compiled: inf and nan, and no word
            return function(*map(_with_attributes, arguments))

    call.py_func = function
    return call


_field, _fill = np.void.__getitem__, np.void.__setitem__


class _Record(np.void):  # type: ignore[misc]
    """A record whose fields come before what every scalar of NumPy has, such as `real`."""

    def __getattribute__(self, name):
        try:
            return _field(self, name)
        except (ValueError, KeyError):  # no field
            return super().__getattribute__(name)

    __setattr__ = _fill


@functools.cache
def _attributed(dtype):
    """The same type with records whose fields are attributes, at every depth."""
    if dtype.subdtype:
        of, shape = dtype.subdtype
        return np.dtype((_attributed(of), shape))
    if not dtype.names:
        return dtype
    fields = [dtype.fields[name] for name in dtype.names]
    layout: Any = {
        "names": dtype.names,
        "formats": [_attributed(of) for of, *_ in fields],
        "offsets": [offset for _, offset, *_ in fields],
        "itemsize": dtype.itemsize,
    }
    return np.dtype((_Record, np.dtype(layout)))


def _with_attributes(argument):
    """A record, or an array of records, whose fields can be written `record.field`."""
    if isinstance(argument, (np.ndarray, np.void)):
        of = argument.dtype
        if of.names and of.type is not _Record:
            return argument.view(_attributed(of))
    return argument
