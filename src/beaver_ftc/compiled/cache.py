"""Compiled code on the disk: how it is kept and loaded.

Code is kept under the digest of what it follows from (digest.py), so an edit compiles again what it changes
and nothing else.

Each kernel and set of argument types has a file: written once, loaded by all. It is loaded without making
Numba's compiler ready, which takes 0.25 s. It is pickled machine code, which runs when it is loaded: a file
that another user can write is not loaded.

LLVM asks for kept machine code by a Python function. A signal's handler that raises there, as that of Ctrl-C
does, raises inside of a call from C: the exception is lost, LLVM goes on without the code, and the process
crashes. So signals wait meanwhile.
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
from pathlib import Path

import numba
from numba.core import serialize
from numba.core.compiler import CompileResult

from beaver_ftc.compiled.digest import digest_of
from beaver_ftc.documents.errors import say_once
from beaver_ftc.documents.files import read_own

COMPILING = "compiling flight code that is new to this machine, once: about {:.0f} s on an idle one"
PER_S = 17_000  # characters of `digest.what_follows` compiled in a second: 11000 to 25000, by the kernel
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
