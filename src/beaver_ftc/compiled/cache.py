"""Compiled code on the disk: what it follows from, how it is kept and loaded, and signals meanwhile.

Signals that arrive while LLVM calls Python.

LLVM asks for kept machine code by a Python function. A signal's handler that raises there, as that of
Ctrl-C does, raises inside of a call from C: the exception is lost, LLVM goes on without the code, and the
process crashes.

What machine code follows from: a kernel's instructions, its constants, and all that its names stand for.

Compiled code is kept under this digest, so an edit compiles again what it changes and nothing else.
Comments, docstrings and line numbers change no code. What is compiled by means of its own, an intrinsic,
is as its whole file.

Compiled code on the disk, a file a kernel and set of argument types: written once, loaded by all.

It is loaded without making Numba's compiler ready, which takes 0.25 s. It is pickled machine code, which
runs when it is loaded: a file that another user can write is not loaded.
"""

import atexit
import contextlib
import functools
import gc
import hashlib
import os
import pickle
import signal
import sys
import threading
from collections.abc import Iterator
from enum import EnumMeta
from pathlib import Path
from types import CodeType, FunctionType, ModuleType
from typing import Any

import numba
import numpy as np
from numba.core import serialize
from numba.core.compiler import CompileResult

from beaver_ftc.documents.errors import say_once
from beaver_ftc.documents.files import digest_of_files, read_own

_HELD = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name))


@contextlib.contextmanager
def held() -> Iterator[None]:
    """Handle signals when this is over; what is done meanwhile lasts milliseconds, or cannot be interrupted.

    Python handles signals in the main thread alone. A signal that ends the process at once still does.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    arrived: list[int] = []
    handlers = {number: signal.getsignal(number) for number in _HELD}
    handlers = {number: handler for number, handler in handlers.items() if callable(handler)}
    for number in handlers:
        signal.signal(number, lambda number, _: arrived.append(number))
    try:
        yield
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)
        for number in arrived[:1]:
            signal.raise_signal(number)


BY_ADDRESS = "called_by_address"  # an attribute of a kernel that its callers look up by name when they run


def digest_of(function: FunctionType) -> str:
    """A name for what a kernel's machine code follows from beside its arguments' types: its instructions,
    the constants in it, and what its names stand for now, kernels it calls included."""
    digest = hashlib.sha256()
    for part in _parts(function, {}):
        digest.update(part.encode() + b"\0")
    return digest.hexdigest()


def _parts(function: FunctionType, seen: dict[int, int]) -> Iterator[str]:
    if id(function) in seen:
        yield f"as before, {seen[id(function)]}"
        return
    seen[id(function)] = len(seen)
    cells = zip(function.__code__.co_freevars, function.__closure__ or (), strict=True)
    known = {**function.__globals__, **{name: cell.cell_contents for name, cell in cells}}
    yield from _value(function.__defaults__ or (), seen)
    for code in _codes(function.__code__):
        yield code.co_code.hex()
        constants = code.co_consts[1:] if code.co_consts[:1] == (function.__doc__,) else code.co_consts
        yield from _value([each for each in constants if not isinstance(each, CodeType)], seen)
        for name in (*code.co_names, *code.co_freevars):
            yield name
            if name in known:
                yield from _named(known[name], code.co_names, seen, set())


def _named(value: Any, names: tuple[str, ...], seen: dict[int, int], passed: set[int]) -> Iterator[str]:
    """A value, and of a module whatever these names may stand for in it: a constant, a kernel, a module."""
    yield from _value(value, seen)
    if isinstance(value, ModuleType) and not _is_numeric(value.__name__) and id(value) not in passed:
        for below in names:
            yield from _named(vars(value).get(below), names, seen, passed | {id(value)})


def _is_numeric(module: str) -> bool:
    """Whether what is in a module belongs to a version that code is kept under anyhow."""
    return module.partition(".")[0] in ("math", "numba", "numpy")


def _codes(code: CodeType) -> Iterator[CodeType]:
    yield code
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _codes(constant)


def _value(value: Any, seen: dict[int, int]) -> Iterator[str]:
    plain = getattr(value, "py_func", value)
    defined_by = getattr(value, "_defn", None)  # of an intrinsic: what gives its instructions
    if hasattr(value, BY_ADDRESS):
        yield getattr(value, BY_ADDRESS)
    elif isinstance(value, EnumMeta):
        yield repr([*value])
    elif isinstance(defined_by, FunctionType):
        yield digest_of_files(Path(sys.modules[defined_by.__module__].__file__ or ""))
    elif isinstance(value, np.ndarray):
        yield f"{value.dtype} {value.shape} {value.tobytes().hex()}"
    elif isinstance(value, tuple | list):
        yield f"{len(value)}"
        for each in value:
            yield from _value(each, seen)
    elif isinstance(value, frozenset):
        yield repr(sorted(map(repr, value)))
    elif isinstance(value, bool | int | float | complex | str | bytes | np.generic | np.dtype | None):
        yield repr(value)
    elif isinstance(plain, FunctionType) and not _is_numeric(plain.__module__):
        yield from _parts(plain, seen)
    else:
        yield f"{type(value).__qualname__} {getattr(value, '__name__', '')}"


COMPILING = "compiling the flight code, once on this machine: some 20 s on an idle one"
MORE = "compiling what this flight is the first to use, once on this machine: 10 s to a minute on an idle one"
PATIENCE_S = 1.0  # what takes less needs no word

MOST_BYTES = 500_000_000  # of code kept in a folder: some hundred versions of the flight code

_DIGEST_BYTES = 32
_LOCK = "lock"


@contextlib.contextmanager
def locked(folder: Path | None) -> Iterator[None]:
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
    say_once(MORE if kept else COMPILING)


@contextlib.contextmanager
def announced(folder: Path | None) -> Iterator[None]:
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


class CodeCache:
    """The machine code of one kernel on the disk: a file a set of argument types, behind its digest."""

    def __init__(self, folder: Path, function) -> None:
        self._folder, self._function = folder, function
        self._name = f"{function.__module__}.{function.__qualname__}"

    @functools.cached_property
    def _of(self):
        """Found when code is first asked for: what is named in a kernel may be defined after it."""
        return self._name, digest_of(self._function), sys.version_info, numba.__version__

    def _path(self, types, codegen) -> Path:
        key = repr((*self._of, types, codegen.magic_tuple()))
        return self._folder / f"{self._name.rpartition('.')[2]}-{hashlib.sha256(key.encode()).hexdigest()}"

    def load(self, types, context):
        """What was kept, ready to run; None if there is nothing that is as this user has written it."""
        try:
            content, why_refused = read_own(self._path(types, context.codegen()))
        except OSError:
            return None
        digest, content = content[:_DIGEST_BYTES], content[_DIGEST_BYTES:]
        if not why_refused and hashlib.sha256(content).digest() != digest:
            why_refused = "it is damaged"
        if why_refused:
            say_once(
                f"a file of compiled code in {self._folder} is not run: {why_refused}; it is compiled again"
            )
            return None
        with held():
            return CompileResult._rebuild(context, *pickle.loads(content))

    def save(self, types, result) -> None:
        """Keep it; where that is impossible (a full disk), say so and fly without."""
        content = serialize.dumps(result._reduce())
        try:
            self._write(self._path(types, result.codegen), hashlib.sha256(content).digest() + content)
        except OSError as error:
            reason = (error.strerror or str(error)).lower()
            say_once(f"compiled code cannot be kept in {self._folder}: {reason}; each start compiles again")

    def _write(self, path: Path, content: bytes) -> None:
        self._folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        partial = path.with_name(f"{path.name}.{os.getpid()}")
        try:
            partial.write_bytes(content)
            partial.replace(path)
        finally:
            partial.unlink(missing_ok=True)
        discard_unused(self._folder)


def discard_unused(folder: Path) -> None:
    """Remove what was not used for longest, as far as a folder keeps more than `MOST_BYTES`."""
    files = [(max(at.st_atime, at.st_mtime), at.st_size, path) for path, at in _statuses(folder)]
    total = 0
    for _, size, path in sorted(files, reverse=True):
        total += size
        if total > MOST_BYTES:
            path.unlink(missing_ok=True)


def _statuses(folder: Path) -> Iterator[tuple[Path, os.stat_result]]:
    for path in folder.glob("*-*"):
        with contextlib.suppress(FileNotFoundError):  # another process has removed it
            if path.is_file():
                yield path, path.stat()
