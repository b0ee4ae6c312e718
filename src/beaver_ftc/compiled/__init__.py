"""How this package compiles its per-frame maths: once per machine, by fixed floating-point rules.

Division by zero gives inf or nan, as in NumPy and JSBSim: the loop looks for non-finite values once a
frame instead of every operation doing so. No fast-math: on one machine and build the same flight
gives the same bits.

Compiled code is kept in the user's cache, each kernel under what its code follows from: an edit compiles
again what it changes. It also works where the package is read-only. Nobody else may write there: what is
kept is run.

target.py and what it imports use parts of Numba that are known from inside. With a version that is not in
`KNOWN`, or with BEAVER_FTC_COMPILER=numba, Numba compiles by its own means, again in each process; flights
are the same.

Compiled code calls only kernels that it can name. `one_of` names each kernel of a table in turn, so the
caller's code does not depend on how many rows there are. Give it lazy kernels (`apart`): a flight then
compiles the rows that it uses.
"""

import contextlib
import functools
import os
from collections.abc import Callable, Mapping
from pathlib import Path
from types import ModuleType
from typing import Any

import numba
import numpy as np

from beaver_ftc.compiled.digest import BY_ADDRESS
from beaver_ftc.compiled.interpreted import interpreted
from beaver_ftc.compiled.records import fill, record, sized
from beaver_ftc.documents.errors import say_once
from beaver_ftc.documents.files import cache_of_version, digest_of_files

# mypy: disable-error-code="attr-defined,method-assign,assignment"


__all__ = ["apart", "copy", "direct", "fill", "kernel", "plain", "record", "sized"]

KNOWN = ("0.68",)  # versions of Numba whose inside is as we have found it
VARIABLE = "BEAVER_FTC_COMPILER"  # `numba`: as with a version that is not known
ALONE = "numba {} compiles by its own means: each start takes minutes, known from inside: numba {}"

_FOLDER = Path(__file__).parent


@functools.cache
def cache_folder() -> Path | None:
    """Where compiled kernels are kept; None where nothing can be written: each process compiles its own.

    It is named after how code is compiled; which code is in a file, the file's name says.
    """
    return cache_of_version(digest_of_files(*sorted(_FOLDER.glob("*.py"))))


def kernel(function=None, **options):
    """Compile a function of arrays, records and numbers; the plain form stays at `.py_func`.

    options: see `compile_into`.
    """
    if function is None:
        return functools.partial(kernel, **options)
    return compile_into(cache_folder(), function, **options)


def apart(function=None, *, long_loops=False):
    """A kernel that returns nothing and that only some flights want: compiled when one of them calls it.

    Give it records and numbers: shapes and strides of arrays are no longer constants beyond such a call.
    long_loops: whether its loops are longer than a few numbers; else its code is optimised for size.
    """
    if function is None:
        return functools.partial(apart, long_loops=long_loops)
    called = kernel(function, for_size=not long_loops)
    if numba.config.DISABLE_JIT or not borrows():
        return called
    from beaver_ftc.compiled.by_address import stub

    tag = called.folder.name if called.folder else ""
    caller = stub((function.__module__, function.__qualname__, tag), called)
    compiled = compile_into(called.folder, caller)
    compiled.py_func = function
    setattr(compiled, BY_ADDRESS, f"{function.__module__}.{function.__qualname__}")
    compiled.called = called
    return functools.update_wrapper(compiled, function)


def plain(function):
    """The uncompiled form of a kernel, which takes complex numbers and loads no compiler.

    Kernels it calls are compiled ones all the same: use it on those that call none.
    """
    return getattr(function, "py_func", function)


def compile_into(folder: Path | None, function, *, for_size=False, allocates=False):
    """Compile a function when it is first called, and keep its code in `folder`.

    for_size: whether its code is optimised for size. Between two frames JSBSim displaces code and data from
    the processor's fast caches, so that short code whose loops are a few numbers long runs sooner. Long loops
    take a quarter longer. allocates: whether it makes or returns arrays, whose users only then are counted;
    such a kernel takes no row of records that have a size.

    With NUMBA_DISABLE_JIT=1 nothing is compiled: the same function, slow, for a debugger.
    """
    if numba.config.DISABLE_JIT:
        return interpreted(function)
    target = _own_target()
    if target is None:
        return numba.njit(error_model="numpy")(function)
    return target.Kernel(folder, function, for_size, allocates)


@functools.cache
def _own_target() -> ModuleType | None:
    """Our own target of the compiler; None if this version of Numba is not known from inside, or lacks a part
    all the same."""
    known = numba.__version__.startswith(tuple(f"{version}." for version in KNOWN))
    if known and os.environ.get(VARIABLE) != "numba":
        with contextlib.suppress(ImportError, AttributeError, TypeError):
            from beaver_ftc.compiled import target

            return target
    say_once(ALONE.format(numba.__version__, ", ".join(f"{version}.*" for version in KNOWN)))
    return None


def borrows() -> bool:
    """Whether kernels are compiled by parts that Numba does not promise."""
    return _own_target() is not None


def direct(function: Any, *arguments: np.ndarray) -> Any:
    """The machine code of a kernel for arguments of these types, to be called with no others.

    The arguments are C-ordered arrays. It skips the look-up of their types, 0.1 to 0.2 us a call: worth it
    once a frame, nowhere else.
    """
    if not hasattr(function, "overloads"):
        return function  # NUMBA_DISABLE_JIT
    return _entry_point(function, tuple((argument.dtype, argument.ndim) for argument in arguments))


@functools.cache
def _entry_point(function, kinds):
    """The machine code for C-ordered arrays of these types and dimensions; of records that have a size,
    theirs."""
    if borrows():
        from beaver_ftc.compiled.sized_types import array_type

        return function.result(tuple(array_type(*kind) for kind in kinds)).entry_point
    types = tuple(numba.types.Array(numba.from_dtype(dtype), dimensions, "C") for dtype, dimensions in kinds)
    function.compile(types)
    return function.overloads[types].entry_point


Kernel = Callable[..., Any]


def one_of(kernels: Mapping[int, Kernel], otherwise: Kernel) -> Kernel:
    """A kernel (number, *arguments) that returns what the kernel of this number, or `otherwise`, returns for
    these arguments."""

    @kernel
    def call(number: int, *arguments: Any) -> Any:
        return otherwise(*arguments)

    for own, each in kernels.items():
        call = _one_or(own, each, call)
    return call


def _one_or(own: int, each: Kernel, others: Kernel) -> Kernel:
    @kernel
    def call(number: int, *arguments: Any) -> Any:
        return each(*arguments) if number == own else others(number, *arguments)

    return call


@kernel
def copy(source, target):
    """Write each number of an array into another one of the same shape, which shares no memory with it.

    `target[:] = source` has code besides for two arrays that share some: it allocates.
    """
    for i in range(target.size):
        target.flat[i] = source.flat[i]
