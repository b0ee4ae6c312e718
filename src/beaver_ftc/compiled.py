"""How this package compiles its per-frame maths: once per machine, by fixed floating-point rules.

Division by zero gives inf or nan, as in NumPy and JSBSim: the loop looks for non-finite values once a frame
instead of every operation doing so. No fast-math: the same flight gives the same bits.

Compiled code is kept in the user's cache, in a folder named after the sources: a change makes a new one. It
also works where the package is read-only. Nobody else may write there: what is kept is run.

A kernel that another one calls is only translated: to optimise is done once, for the outermost one and all
it calls (translation.py). Of the largest, another process translates a half meanwhile (second_process.py).
"""

# mypy: disable-error-code="attr-defined"
import atexit
import contextlib
import functools
import gc
import hashlib
import os
import pickle
import sys
import threading
from collections.abc import Callable, Iterator
from functools import lru_cache
from pathlib import Path

import numba
import numpy as np
from numba.core import serialize, sigutils
from numba.core.compiler import CompileResult
from numba.core.compiler_lock import global_compiler_lock
from numba.core.registry import CPUDispatcher
from numba.core.types import unliteral

from beaver_ftc.documents.paths import cache_of_version
from beaver_ftc.documents.sources import digest_of, fingerprint
from beaver_ftc.second_process import Helper, Part
from beaver_ftc.translation import Inner, lighten, nesting, stub

COMPILING = "compiling the flight code, once for this version on this machine: some 10 s on an idle one"
MORE = "making ready what this flight is the first to use, once for this version on this machine: some 10 s"
PATIENCE_S = 1.0  # what takes less needs no word

_DIGEST_BYTES = 32
_LOCK = "lock"

_PACKAGE = Path(__file__).parent
Halves = Callable[..., tuple[list[Part], list[Part]]]


@lru_cache(maxsize=1)
def cache_folder() -> Path | None:
    """Where compiled kernels are kept; None where nothing can be written: each process compiles its own."""
    return cache_of_version(fingerprint(_PACKAGE))


def kernel(function):
    """Compile a function of arrays, records and numbers; the plain form stays at `.py_func`."""
    return compile_into(cache_folder(), function)


def apart(function):
    """A kernel that returns nothing and that only some flights want: compiled when one of them calls it.

    Give it records and numbers: shapes and strides of arrays are no longer constants beyond such a call.
    """
    called = kernel(function)
    if not isinstance(called, _Kernel):
        return called
    tag = called.folder.name if called.folder else ""
    caller = compile_into(called.folder, stub((function.__module__, function.__qualname__, tag), called))
    caller.py_func = function
    return functools.update_wrapper(caller, function)


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
    return _Kernel(folder, function)


def in_two(whole, halves: Halves) -> None:
    """Say of what a kernel mostly consists, so that two processes share the work of its first compilation.

    halves: from the types of its arguments to kernels with theirs; the first for the other process, the
    second for this one.
    """
    if isinstance(whole, _Kernel):
        whole.halves = halves


class _Kernel(CPUDispatcher):
    """A compiled function: kept by itself if Python calls it, and a part of the kernels that call it."""

    def __init__(self, folder: Path | None, function) -> None:
        super().__init__(function, targetoptions={"nopython": True, "error_model": "numpy"})
        self.folder, self._store = folder, folder and _Store(folder, function)
        self.halves: Halves | None = None

    def compile(self, sig):
        """Machine code for arguments of these types; inside another kernel only what stands for it."""
        types, _ = sigutils.normalize_signature(sig)
        types = tuple(map(unliteral, types))  # a number in the text makes no other function of it
        with global_compiler_lock, self._compiling_counter:
            there = self.overloads.get(tuple(types))
            if there is not None and (nesting or not isinstance(there.entry_point, Inner)):
                return there.entry_point
            if nesting:
                return self._translated(types, inner=True)
            return self._loaded(types) or self._compiled(types)

    def stored(self, types):
        """The code an earlier process has kept, or None."""
        return self._store and self._store.load(tuple(types), self.targetctx)

    def result(self, types):
        """The code with what is known of it; where it has been kept, without making ready to compile."""
        found = self.stored(types)
        if found is None:
            self.compile(types)
            found = self.overloads[types]
        return found

    def _loaded(self, types):
        self.targetctx.refresh()
        found = self.stored(types)
        if found is None:
            return None
        self._cache_hits[types] += 1
        self.targetctx.insert_user_function(found.entry_point, found.fndesc, [found.library])
        self.add_overload(found)
        return found.entry_point

    def _compiled(self, types):
        """Compile, one process at a time, and keep the code."""
        lighten()
        with _alone(self.folder), _announced(self.folder):
            if entry_point := self._loaded(types):
                return entry_point  # another process came first
            self.overloads.pop(tuple(types), None)
            entry_point = self._translated(types, inner=False)
            if self._store:
                self._store.save(tuple(types), self.overloads[tuple(types)])
        return entry_point

    def _translated(self, types, inner: bool):
        wrappers = {"no_cpython_wrapper": inner, "no_cfunc_wrapper": True}
        nesting.append(self)
        try:
            if not inner and self.halves is not None:
                self._translate_halves(*self.halves(*types))
            self._compiler.targetoptions = self.targetoptions | wrappers
            result = self._compiler.compile(types, None)
        finally:
            nesting.pop()
        self.add_overload(result)
        return result.entry_point

    def _translate_halves(self, there: list[Part], here: list[Part]) -> None:
        """What another process cannot translate is left: it is then translated where it is called."""
        with Helper(there) as helper:
            for kernel, types in here:
                kernel.compile(types)
            for (kernel, types), result in zip(there, helper.results(self.targetctx), strict=False):
                if tuple(types) not in kernel.overloads:
                    self.targetctx.insert_user_function(result.entry_point, result.fndesc, [result.library])
                    kernel.add_overload(result)


@contextlib.contextmanager
def _alone(folder: Path | None) -> Iterator[None]:
    """Wait until no other process compiles into this folder: it may be the very same."""
    with contextlib.ExitStack() as held:
        if folder is not None:
            with contextlib.suppress(OSError, ImportError):  # no lock: then several may compile
                import fcntl

                folder.mkdir(mode=0o700, parents=True, exist_ok=True)
                fcntl.flock(held.enter_context((folder / _LOCK).open("w")), fcntl.LOCK_EX)
        yield


@functools.cache
def _say_compiling(folder: Path | None) -> None:
    """A word a process: of all the flight code, or of the part that earlier flights have had no use for."""
    kept = folder is not None and any(path.name != _LOCK for path in folder.glob("*"))
    _say_once(MORE if kept else COMPILING)


@contextlib.contextmanager
def _announced(folder: Path | None) -> Iterator[None]:
    """Say what takes so long, if it does. Garbage is not looked for meanwhile, nor soon in what the compiler
    leaves: there is little, and looking costs a quarter of its time."""
    saying = threading.Timer(PATIENCE_S, _say_compiling, [folder])
    saying.start()
    gc.disable()
    try:
        yield
    finally:
        gc.freeze()
        gc.unfreeze()  # into the oldest generation
        gc.enable()
        saying.cancel()
        atexit.register(gc.freeze)  # nor when the process ends


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


class _Store:
    """The machine code of one kernel on the disk: a file a set of argument types, behind its digest."""

    def __init__(self, folder: Path, function) -> None:
        self._folder, self._function = folder, function
        self._name = f"{function.__module__}.{function.__qualname__}"

    @functools.cached_property
    def _of(self):
        """Found when code is first asked for: what is named in a kernel may be defined after it."""
        line = self._function.__code__.co_firstlineno
        return self._name, line, digest_of(self._function), sys.version_info, numba.__version__

    def _path(self, types, codegen) -> Path:
        key = repr((*self._of, types, codegen.magic_tuple()))
        return self._folder / f"{self._name.rpartition('.')[2]}-{hashlib.sha256(key.encode()).hexdigest()}"

    def load(self, types, context):
        """What was kept, ready to run; None if there is nothing, or it is not as it was written."""
        try:
            content = self._path(types, context.codegen()).read_bytes()
        except OSError:
            return None
        digest, content = content[:_DIGEST_BYTES], content[_DIGEST_BYTES:]
        if hashlib.sha256(content).digest() != digest:  # damaged machine code must not run
            _say_once(f"compiled code in {self._folder} is damaged; it is compiled anew")
            return None
        return CompileResult._rebuild(context, *pickle.loads(content))

    def save(self, types, result) -> None:
        """Keep it; where that is impossible (a full disk), say so and fly without."""
        content = serialize.dumps(result._reduce())
        try:
            self._write(self._path(types, result.codegen), hashlib.sha256(content).digest() + content)
        except OSError as error:
            reason = (error.strerror or str(error)).lower()
            _say_once(f"compiled code cannot be kept in {self._folder}: {reason}; each start compiles anew")

    def _write(self, path: Path, content: bytes) -> None:
        self._folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        partial = path.with_name(f"{path.name}.{os.getpid()}")
        try:
            partial.write_bytes(content)
            partial.replace(path)
        finally:
            partial.unlink(missing_ok=True)


@functools.cache
def _say_once(text: str) -> None:
    print(f"beaver-ftc: {text}", file=sys.stderr, flush=True)
