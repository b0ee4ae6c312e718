"""How this package compiles its per-frame maths: once per machine, with floating-point rules a flight can
rely on.

Division by zero gives inf or nan, as in NumPy and JSBSim: the loop looks for non-finite values once a frame
instead of every operation doing so. No fast-math: the same flight gives the same bits.

Compiled code is kept in the user's cache, in a folder named after the sources. Numba itself looks only at
the file of the outermost function: without this, a change in an inner kernel would leave an old outer one
in use. It also works where the package is read-only.
"""

import contextlib
import functools
import hashlib
import os
import pickle
import shutil
import sys
import tempfile
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path

import numba
import numpy as np
from numba.core.caching import FunctionCache, IndexDataCacheFile
from numba.core.dispatcher import Dispatcher
from numba.core.runtime import rtsys

_VERSIONS_KEPT = 5
_DIGEST_BYTES = 32

_PACKAGE = Path(__file__).parent
_SOURCES = (
    "aircraft/schema.py",
    "design/*.py",
    "diagnosis/*.py",
    "diagnosis/types/*.py",
    "control/*.py",
    "control/laws/*.py",
    "plant/channels.py",
    "plant/native.py",
    "plant/instruments.py",
    "compiled.py",
    "plant/sensing.py",
    "loop/frame.py",
    "loop/accounts.py",
    "loop/record.py",
    "loop/steps.py",
    "loop/watching.py",
)


def _candidates() -> Iterator[Path]:
    """Folders that may keep compiled code, best first."""
    if "NUMBA_CACHE_DIR" in os.environ:
        yield Path(os.environ["NUMBA_CACHE_DIR"])
    with contextlib.suppress(RuntimeError):  # no home at all
        yield Path(os.environ.get("XDG_CACHE_HOME") or Path("~/.cache").expanduser()) / "beaver-ftc"
    with contextlib.suppress(FileNotFoundError):  # nor anywhere for temporary files
        yield Path(tempfile.gettempdir()) / f"beaver-ftc-{_user()}"


def _user() -> int:
    return os.getuid() if hasattr(os, "getuid") else 0


def _is_writable(folder: Path) -> bool:
    """Whether the folder is ours to write. Code is loaded from it, so nobody else may own it."""
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        return os.access(folder, os.W_OK) and folder.stat().st_uid == _user()
    except OSError:
        return False


def _fingerprint() -> str:
    digest = hashlib.sha256()
    for pattern in _SOURCES:
        for source in sorted(_PACKAGE.glob(pattern)):
            digest.update(source.name.encode() + source.read_bytes())
    return digest.hexdigest()[:16]


@lru_cache(maxsize=1)
def cache_folder() -> Path | None:
    """Where compiled kernels are kept; None where nothing can be written, and each process then compiles
    its own."""
    base = next((folder for folder in _candidates() if _is_writable(folder)), None)
    if base is None:
        return None
    folder = base / _fingerprint()
    if not folder.exists():
        _discard_old(base)
    return folder


def _discard_old(base: Path) -> None:
    """Remove what earlier versions have left, but for the latest: someone may be flying with them."""
    folders = [folder for folder in base.glob("[0-9a-f]" * 16) if folder.is_dir()]
    folders.sort(key=lambda folder: folder.stat().st_mtime, reverse=True)
    for folder in folders[_VERSIONS_KEPT:]:
        shutil.rmtree(folder, ignore_errors=True)


def kernel(function):
    """Compile a function of arrays, records and numbers; the plain form stays at `.py_func`."""
    return compile_into(cache_folder(), function)


def plain(function):
    """The uncompiled form of a kernel, which takes complex numbers and loads no compiler.

    Kernels it calls are compiled ones all the same: use it on those that call none.
    """
    return getattr(function, "py_func", function)


def compile_into(folder: Path | None, function):
    """Compile a function when it is first called, and keep its code in `folder`.

    With NUMBA_DISABLE_JIT=1 nothing is compiled: the same function, slow, for a debugger.
    """
    if numba.config.DISABLE_JIT:  # type: ignore[attr-defined]
        return _interpreted(function)
    dispatcher = numba.njit(error_model="numpy")(function)
    if folder is not None:
        dispatcher._cache = _KernelCache(folder, function)  # type: ignore[attr-defined]
    return dispatcher


def _interpreted(function):
    """The function as it is, given records whose fields are attributes, as compiled code has them."""

    @functools.wraps(function)
    def call(*arguments):
        with np.errstate(all="ignore"):  # as compiled: inf and nan, and no word
            return function(*map(_with_attributes, arguments))

    call.py_func = function  # type: ignore[attr-defined]
    return call


def _with_attributes(argument):
    """A record, or an array of records, whose fields can be written `record.field`."""
    if isinstance(argument, np.void) and not isinstance(argument, np.record):
        return argument.view((np.record, argument.dtype))
    if isinstance(argument, np.ndarray) and argument.dtype.type is np.void and argument.dtype.names:
        return argument.view(np.dtype((np.record, argument.dtype)))
    return argument


class _KernelCache(FunctionCache):
    """Numba's cache of one kernel, in a folder of our own; what is damaged in it is compiled anew.

    Numba is told of the folder for this function only: others' functions keep to their own.
    """

    def __init__(self, folder: Path, function) -> None:
        others = numba.config.CACHE_DIR  # type: ignore[attr-defined]
        numba.config.CACHE_DIR = str(folder)  # type: ignore[attr-defined]
        try:
            super().__init__(function)
        finally:
            numba.config.CACHE_DIR = others  # type: ignore[attr-defined]
        stamp, base = self._cache_file._source_stamp, self._impl.filename_base
        self._cache_file = _CheckedFiles(self._cache_path, base, stamp)

    def save_overload(self, sig, data) -> None:
        """Keep it; where that is impossible (a full disk), say so and fly without."""
        try:
            super().save_overload(sig, data)
        except OSError as error:
            reason = (error.strerror or str(error)).lower()
            _say_once(
                f"compiled code cannot be kept in {self._cache_path}: {reason}; each start compiles anew"
            )


class _CheckedFiles(IndexDataCacheFile):
    """Index and data of one kernel, each behind its digest: machine code that is damaged must not run."""

    def _load_index(self):
        content = self._checked(self._index_path)
        if content is None:
            return {}
        version, stamp, overloads = pickle.loads(content)
        return overloads if (version, stamp) == (self._version, self._source_stamp) else {}

    def _save_index(self, overloads) -> None:
        self._write(self._index_path, self._dump((self._version, self._source_stamp, overloads)))

    def _load_data(self, name):
        content = self._checked(self._data_path(name))
        if content is None:
            raise FileNotFoundError(name)  # numba compiles it anew, and writes over it
        return pickle.loads(content)

    def _save_data(self, name, data) -> None:
        self._write(self._data_path(name), self._dump(data))

    def _write(self, path: str, content: bytes) -> None:
        with self._open_for_write(path) as file:
            file.write(hashlib.sha256(content).digest() + content)

    def _checked(self, path: str) -> bytes | None:
        """The content of a file; None if there is no such file, or it is not as it was written."""
        try:
            content = Path(path).read_bytes()
        except FileNotFoundError:
            return None
        digest, content = content[:_DIGEST_BYTES], content[_DIGEST_BYTES:]
        if hashlib.sha256(content).digest() == digest:
            return content
        _say_once(f"compiled code in {self._cache_path} is damaged; it is compiled anew")
        return None


@functools.cache
def _say_once(text: str) -> None:
    print(f"beaver-ftc: {text}", file=sys.stderr, flush=True)


def direct(function, *arguments):
    """The machine code of a kernel for arguments of these types, to be called with no others.

    The arguments are C-ordered arrays. It skips the look-up of their types, 0.1 to 0.2 us a call: worth it
    once a frame, nowhere else.
    """
    if not isinstance(function, Dispatcher):
        return function  # NUMBA_DISABLE_JIT
    return _entry_point(function, tuple((argument.dtype, argument.ndim) for argument in arguments))


@lru_cache(maxsize=64)
def _entry_point(function, kinds):
    """The machine code for C-ordered arrays of these types and dimensions: 9 ms to find, so kept."""
    types = tuple(numba.types.Array(numba.from_dtype(dtype), dimensions, "C") for dtype, dimensions in kinds)
    stored = _stored(function, types)
    if stored is not None:
        return stored
    function.compile(types)
    return function.overloads[types].entry_point


def _stored(function, types):
    """The machine code an earlier process has kept, or None.

    Numba itself would first make ready to compile, which takes 0.25 s and imports SciPy, and then find that
    there is nothing to compile. What is used here is not a promise of Numba's: on any surprise, the long way.
    """
    try:
        rtsys.initialize(function.targetctx)
        found = function._cache._load_overload(types, function.targetctx)
    except Exception:
        return None
    return found.entry_point if found is not None else None
