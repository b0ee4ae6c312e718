"""Compiled code on the disk, a file a kernel and set of argument types: written once, loaded by all.

It is loaded without making Numba's compiler ready, which takes 0.25 s. It is pickled machine code, which runs
when it is loaded: a file that another user can write is not loaded.
"""

import atexit
import contextlib
import functools
import gc
import hashlib
import os
import pickle
import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import numba
from numba.core import serialize
from numba.core.compiler import CompileResult

from beaver_ftc.compiled import interrupts
from beaver_ftc.compiled.sources import digest_of
from beaver_ftc.documents.errors import say_once
from beaver_ftc.documents.files import read_own

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
        with interrupts.held():
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
