"""Compiled code on the disk: what it follows from, how it is kept and loaded, and what is compiled ahead.

What machine code follows from is a kernel's instructions, its constants, and all that its names stand for.
Compiled code is kept under the digest of these, so an edit compiles again what it changes and nothing else.
Comments, docstrings and line numbers change no code. What is compiled by means of its own, an intrinsic, is
as its whole file.

Each kernel and set of argument types has a file: written once, loaded by all. It is loaded without making
Numba's compiler ready, which takes 0.25 s. It is pickled machine code, which runs when it is loaded: a file
that another user can write is not loaded.

LLVM asks for kept machine code by a Python function. A signal's handler that raises there, as that of Ctrl-C
does, raises inside of a call from C: the exception is lost, LLVM goes on without the code, and the process
crashes. So signals wait meanwhile.

A flight says what it will call (`expect`) and compiles nothing as long as all of it is kept. The first kernel
that is missing compiles all that are: here and in a second process, which is forked for it. Each takes the
next kernel that nobody else compiles, and both keep their code in the same folder. A second process that
fails, or that there is not, costs time alone.
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
import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from enum import EnumMeta
from multiprocessing import parent_process
from pathlib import Path
from types import CodeType, FunctionType, ModuleType
from typing import Any, NamedTuple

import numba
import numpy as np
from numba.core import serialize
from numba.core.compiler import CompileResult

from beaver_ftc.documents.errors import say_once
from beaver_ftc.documents.files import digest_of_files, read_own

BY_ADDRESS = "called_by_address"  # an attribute of a kernel that its callers look up by name when they run
COMPILING = "compiling flight code that is new to this machine, once: about {:.0f} s on an idle one"
PER_S = 17_000  # characters of `what_follows` compiled in a second: 11000 to 25000, by the kernel
PATIENCE_S = 1.0  # what takes less needs no word
MOST_BYTES = 500_000_000  # of code kept in a folder: some hundred versions of the flight code
_DIGEST_BYTES = 32  # before the code in a file
_LOCK = "lock"  # the name of the file that is locked
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


def digest_of(function: FunctionType) -> str:
    """A name for what a kernel's machine code follows from beside its arguments' types: its instructions,
    the constants in it, and what its names stand for now, kernels it calls included."""
    return hashlib.sha256(what_follows(function)).hexdigest()


def what_follows(function: FunctionType) -> bytes:
    """All that the digest is of. Its length says roughly how long it takes to compile."""
    return b"".join(part.encode() + b"\0" for part in _parts(function, {}))


def _parts(function: FunctionType, seen: dict[int, int]) -> Iterator[str]:
    if id(function) in seen:
        yield f"as before, {seen[id(function)]}"
        return
    seen[id(function)] = len(seen)
    yield str(function.__module__)  # which the kept code imports
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


@contextlib.contextmanager
def locked(folder: Path | None, place: int, wait: bool = True) -> Iterator[bool]:
    """Keep other processes from compiling the same kernel into this folder; place: its byte in the file that
    is locked. Whether it is locked: not, without waiting, while another process is at it."""
    with contextlib.ExitStack() as held:
        mine = True
        if folder is not None:
            with contextlib.suppress(ImportError, OSError):  # no lock: then several may compile
                import fcntl

                folder.mkdir(mode=0o700, parents=True, exist_ok=True)
                file = held.enter_context((folder / _LOCK).open("w"))
                try:
                    fcntl.lockf(file, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB), 1, place)
                except (BlockingIOError, PermissionError):
                    mine = False
        yield mine


_announcing: list[float] = []


@contextlib.contextmanager
def announced(size: float) -> Iterator[None]:
    """Say what takes so long, if it does; size: characters that the code to compile follows from.

    Garbage is not looked for meanwhile, nor soon in what the compiler leaves: there is little, and looking
    costs a quarter of its time.
    """
    if _announcing:  # inside of what is announced already
        yield
        return
    says = COMPILING.format(max(size / PER_S, 1.0))
    saying = threading.Timer(PATIENCE_S, say_once, [says])
    saying.start()
    _announcing.append(size)
    gc.disable()
    try:
        yield
    finally:
        gc.freeze()
        gc.unfreeze()  # into the oldest generation
        gc.enable()
        _announcing.pop()
        saying.cancel()
        atexit.register(gc.freeze)  # nor when the process ends


class CodeCache:
    """The machine code of one kernel on the disk: a file a set of argument types, behind its digest."""

    def __init__(self, folder: Path, function, for_size: bool = False) -> None:
        self._folder, self._function, self._for_size = folder, function, for_size
        self._name = f"{function.__module__}.{function.__qualname__}"

    @functools.cached_property
    def _of(self):
        """Found when code is first asked for: what is named in a kernel may be defined after it."""
        return self._name, digest_of(self._function), self._for_size, sys.version_info, numba.__version__

    def _path(self, types, codegen) -> Path:
        key = repr((*self._of, types, codegen.magic_tuple()))
        return self._folder / f"{self._name.rpartition('.')[2]}-{hashlib.sha256(key.encode()).hexdigest()}"

    def place(self, types, codegen) -> int:
        """The place of this code among all: see `locked`."""
        return int(self._path(types, codegen).name[-12:], 16)

    def has(self, types, codegen) -> bool:
        """Whether something is kept: `load` says whether it is sound."""
        return self._path(types, codegen).exists()

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
    files, total = [], 0
    for path in folder.glob("*-*"):
        with contextlib.suppress(FileNotFoundError):  # another process has removed it
            if path.is_file():
                at = path.stat()
                files.append((max(at.st_atime, at.st_mtime), at.st_size, path))
    for _, size, path in sorted(files, reverse=True):
        total += size
        if total > MOST_BYTES:
            path.unlink(missing_ok=True)


class Wanted(NamedTuple):
    """A kernel and the types of its arguments."""

    kernel: Any
    kinds: tuple[Any, ...]

    @classmethod
    def of(cls, kernel: Any, kinds: tuple[Any, ...]) -> "Wanted":
        """A kernel as it is named: of one that is called by its address, the code at that address."""
        return cls(getattr(kernel, "called", kernel), kinds)


_expected: list[Callable[[], Iterable[Wanted]]] = []  # of the flight in progress, until they are compiled


def expect(wanted: Callable[[], Iterable[Wanted]] | None) -> None:
    """From now on the first kernel that is not kept has these compiled too, longest first; None: nothing."""
    _expected[:] = [] if wanted is None else [wanted]


def compile_expected() -> None:
    """Compile what the flight in progress is expected to call; nothing if that was done."""
    if _expected:
        compile_missing(_expected.pop()())


def compile_missing(wanted: Iterable[Wanted]) -> int:
    """Compile those that are not kept; returns how many those were."""
    missing = [each for each in wanted if not each.kernel.is_kept(each.kinds)]
    if not missing:
        return 0
    kept = all(each.kernel.folder for each in missing)  # else the second process could not hand over
    helper = _fork(missing) if kept and len(missing) > 1 and can_fork() else None
    try:
        with announced(sum(each.kernel.size for each in missing) / (1.0 if helper is None else 1.7)):
            for each in missing:
                each.kernel.compile_unless_taken(each.kinds)
            _wait(helper)
    except BaseException:
        _end(helper)
        raise
    return len(missing)


def can_fork() -> bool:
    """Whether a second process is of use: two processors, and no thread that could hold a lock."""
    if sys.platform != "linux" or parent_process() is not None or threading.active_count() > 1:
        return False  # a worker has others beside it, which compile too
    return len(os.sched_getaffinity(0)) > 1


def _fork(missing: Sequence[Wanted]) -> int | None:
    """Start the second process; None where that is refused."""
    parent = os.getpid()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # Python's, of threads: a library's own know of a fork
            helper = os.fork()
    except OSError:
        return None
    if helper == 0:
        _help(missing, parent)
    return helper


def _help(missing: Sequence[Wanted], parent: int) -> None:
    """Be the second process: silent, ended by any signal, and not without the first."""
    try:
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            signal.signal(number, signal.SIG_DFL)
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, 1)
        os.dup2(nowhere, 2)
        for each in missing:
            if os.getppid() != parent:
                break
            each.kernel.compile_unless_taken(each.kinds)
    finally:
        os._exit(0)


def _wait(helper: int | None) -> None:
    if helper is not None:
        with contextlib.suppress(ChildProcessError):  # who ignores SIGCHLD has no child to wait for
            os.waitpid(helper, 0)


def _end(helper: int | None) -> None:
    if helper is not None:
        with contextlib.suppress(ProcessLookupError):
            os.kill(helper, signal.SIGKILL)
        _wait(helper)
