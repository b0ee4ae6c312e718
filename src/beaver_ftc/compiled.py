"""How this package compiles its per-frame maths: once per machine, by fixed floating-point rules.

Division by zero gives inf or nan, as in NumPy and JSBSim: the loop looks for non-finite values once a frame
instead of every operation doing so. No fast-math: the same flight gives the same bits.

Compiled code is kept in the user's cache, each kernel under what its code follows from: an edit compiles
again what it changes. It also works where the package is read-only. Nobody else may write there: what is kept
is run.

Of the versions of Numba in `KNOWN` much is borrowed that Numba does not promise (numba_inside.py). With any
other, Numba compiles by its own means: flights are the same, the first of them takes minutes.
"""

# mypy: disable-error-code="attr-defined,method-assign,assignment"
import functools
import hashlib
import os
from functools import lru_cache
from pathlib import Path
from types import ModuleType
from typing import Any

import numba
import numpy as np
from numba.extending import overload

from beaver_ftc.documents.errors import say_once
from beaver_ftc.documents.paths import cache_of_version
from beaver_ftc.documents.sized import record, sized
from beaver_ftc.documents.sources import BY_ADDRESS, digest_of_files

__all__ = ["apart", "direct", "kernel", "plain", "record", "row_of", "sized"]

KNOWN = ("0.68",)  # versions whose inside numba_inside.py fits
VARIABLE = "BEAVER_FTC_COMPILER"  # `numba`: borrow nothing
PLAINLY = "numba {} is not known from inside: the first flight compiles for some minutes, allowed: numba {}"

_PACKAGE = Path(__file__).parent


@lru_cache(maxsize=1)
def cache_folder() -> Path | None:
    """Where compiled kernels are kept; None where nothing can be written: each process compiles its own.

    It is named after how code is compiled; which code is in a file, the file's name says.
    """
    how = ("compiled.py", "numba_inside.py", "numba_sized.py", "documents/sized.py", "documents/sources.py")
    return cache_of_version(digest_of_files(*(_PACKAGE / file for file in how)))


def kernel(function):
    """Compile a function of arrays, records and numbers; the plain form stays at `.py_func`."""
    return compile_into(cache_folder(), function)


def apart(function):
    """A kernel that returns nothing and that only some flights want: compiled when one of them calls it.

    Give it records and numbers: shapes and strides of arrays are no longer constants beyond such a call.
    """
    called, inside = kernel(function), _inside()
    if inside is None or numba.config.DISABLE_JIT:
        return called
    tag = called.folder.name if called.folder else ""
    caller = inside.stub((function.__module__, function.__qualname__, tag), called)
    compiled = compile_into(called.folder, caller)
    compiled.py_func = function
    setattr(compiled, BY_ADDRESS, f"{function.__module__}.{function.__qualname__}")
    return functools.update_wrapper(compiled, function)


def plain(function):
    """The uncompiled form of a kernel, which takes complex numbers and loads no compiler.

    Kernels it calls are compiled ones all the same: use it on those that call none.
    """
    return getattr(function, "py_func", function)


def compile_into(folder: Path | None, function):
    """Compile a function when it is first called, and keep its code in `folder`.

    With NUMBA_DISABLE_JIT=1 nothing is compiled: the same function, slow, for a debugger.
    """
    if numba.config.DISABLE_JIT:
        return _interpreted(function)
    numba.types.Record.mangling_args = property(_by_contents)
    inside = _inside()
    return inside.Kernel(folder, function) if inside else _by_numba_alone(folder, function)


@lru_cache(maxsize=1)
def _inside() -> ModuleType | None:
    """What is borrowed from inside this version of Numba, if it is known."""
    if os.environ.get(VARIABLE) == "numba" or not numba.__version__.startswith(tuple(f"{v}." for v in KNOWN)):
        return None
    from beaver_ftc import numba_inside

    return numba_inside


def _by_numba_alone(folder: Path | None, function):
    """A kernel of Numba's own; what has no file it cannot keep."""
    if folder is None or not any(folder.glob("*")):
        say_once(PLAINLY.format(numba.__version__, " or ".join(f"{version}.*" for version in KNOWN)))
    usual, numba.config.CACHE_DIR = numba.config.CACHE_DIR, str(folder or "")
    try:
        return numba.njit(error_model="numpy", cache=folder is not None)(function)
    except RuntimeError:
        return numba.njit(error_model="numpy")(function)
    finally:
        numba.config.CACHE_DIR = usual


@functools.cache
def _digest_of(record) -> str:
    return hashlib.sha256(repr(record).encode()).hexdigest()[:16]


def _by_contents(record):
    """In place of numba's: what a record's type is called in the names of compiled functions.

    Numba counts a process's types. Code that two processes have kept would then have the same names for
    records of two aircraft, and a third process that loads both would run the one for the other.
    """
    return type(record).__name__, (_digest_of(record),)


def direct(function: Any, *arguments: np.ndarray) -> Any:
    """The machine code of a kernel for arguments of these types, to be called with no others.

    The arguments are C-ordered arrays. It skips the look-up of their types, 0.1 to 0.2 us a call: worth it
    once a frame, nowhere else.
    """
    if not hasattr(function, "overloads"):
        return function  # NUMBA_DISABLE_JIT
    return _entry_point(function, tuple((argument.dtype, argument.ndim) for argument in arguments))


@lru_cache(maxsize=64)
def _entry_point(function, kinds):
    """The machine code for C-ordered arrays of these types and dimensions."""
    return _code(function, tuple(_array_of(dtype, dimensions) for dtype, dimensions in kinds))


@lru_cache(maxsize=64)
def _code(function, types):
    """The same for types of numba's: 9 ms to find, so kept."""
    found = function.stored(types) if _inside() else None
    if found is None:
        function.compile(types)
        found = function.overloads[types]
    return found.entry_point


def _array_of(dtype, dimensions):
    """The type of a C-ordered array; of records that have a size, theirs."""
    inside = _inside()
    sizeless = inside and inside.kind_of(dtype, dimensions)
    return sizeless or numba.types.Array(numba.from_dtype(dtype), dimensions, "C")


def row_of(array, i):
    """Row i of an array (m, n) that stays where it is for as long as the row is used.

    Compiled code counts who refers to a row, function by function, with instructions that wait until all
    that was written before has arrived: a tenth of a frame. Where Numba's inside is known, this row is not
    counted.
    """
    return array[i]


@overload(row_of)
def _row_of(array, i):
    inside = _inside()
    if inside is None:
        return lambda array, i: array[i]
    borrowed_row = inside.borrowed_row

    def row(array, i):
        return borrowed_row(array, i)

    return row


def _interpreted(function):
    """The function as it is, given records whose fields are attributes, as compiled code has them."""

    @functools.wraps(function)
    def call(*arguments):
        with np.errstate(all="ignore"):  # as compiled: inf and nan, and no word
            return function(*map(_with_attributes, arguments))

    call.py_func = function
    return call


class _Record(np.record):  # type: ignore[misc]
    """A record whose fields come before what every scalar of NumPy has, such as `real`."""

    def __getattribute__(self, name):
        fields = np.void.__getattribute__(self, "dtype").fields
        return _with_attributes(self[name]) if name in fields else super().__getattribute__(name)


def _with_attributes(argument):
    """A record, or an array of records, whose fields can be written `record.field`."""
    if isinstance(argument, np.void) and not isinstance(argument, _Record):
        return argument.view((_Record, argument.dtype))
    if isinstance(argument, np.ndarray) and argument.dtype.type is np.void and argument.dtype.names:
        return argument.view(np.dtype((_Record, argument.dtype)))
    return argument
