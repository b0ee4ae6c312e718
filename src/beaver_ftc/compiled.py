"""How this package compiles its per-frame maths: once per machine, with floating-point rules a flight can
rely on.

Division by zero gives inf or nan, as in NumPy and JSBSim: the loop looks for non-finite values once a frame
instead of every operation doing so. No fast-math: the same flight gives the same bits.

Compiled code is kept in the user's cache, in a folder named after the sources. Numba itself looks only at
the file of the outermost function: without this, a change in an inner kernel would leave an old outer one
in use. It also works where the package is read-only.
"""

import hashlib
import os
import tempfile
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path

import numba
from numba.core.dispatcher import Dispatcher
from numba.core.runtime import rtsys

_PACKAGE = Path(__file__).parent
_SOURCES = (
    "design/*.py",
    "diagnosis/*.py",
    "control/*.py",
    "plant/native.py",
    "channels.py",
    "compiled.py",
    "frame.py",
    "stages.py",
    "supervisor.py",
)


def _candidates() -> Iterator[Path]:
    """Folders that may keep compiled code, best first."""
    if "NUMBA_CACHE_DIR" in os.environ:
        yield Path(os.environ["NUMBA_CACHE_DIR"])
    yield Path(os.environ.get("XDG_CACHE_HOME") or Path("~/.cache").expanduser()) / "beaver-ftc"
    yield Path(tempfile.gettempdir()) / f"beaver-ftc-{os.getuid()}"


def _is_writable(folder: Path) -> bool:
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        return os.access(folder, os.W_OK) and folder.stat().st_uid == os.getuid()
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
    return base / _fingerprint() if base else None


def kernel(function):
    """Compile a function of arrays, records and numbers; the plain form stays at `.py_func`."""
    folder = cache_folder()
    if folder is not None:
        numba.config.CACHE_DIR = str(folder)  # type: ignore[attr-defined]
    return numba.njit(cache=folder is not None, error_model="numpy")(function)


def direct(function, *arguments):
    """The machine code of a kernel for arguments of these types, to be called with no others.

    The arguments are C-ordered arrays. It skips the look-up of their types, 0.1 to 0.2 us a call: worth it
    once a frame, nowhere else.
    """
    if not isinstance(function, Dispatcher):
        return function  # NUMBA_DISABLE_JIT: the plain form
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
