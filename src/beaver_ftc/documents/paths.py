"""Where the aircraft and the built-in scenarios live: in an installed wheel, or at the repository's root."""

import contextlib
import os
import shutil
import stat
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

_VERSIONS_KEPT = 5
_ROOT = 0
_OTHERS_WRITE = stat.S_IWGRP | stat.S_IWOTH
_REFUSED = "BEAVER_FTC_REFUSED"  # folders that were refused, and said so
PACKAGE = Path(__file__).resolve().parents[1]
_INSTALLED = PACKAGE / "data"


def data_root() -> Path:
    """The folder that holds `aircraft/` and `scenarios/`; JSBSim's root directory."""
    return _INSTALLED if _INSTALLED.is_dir() else PACKAGE.parents[1]


def inside(folder: Path, file: str) -> Path | None:
    """A file named in another one, resolved, if it lies in that one's folder or below; None if it does not.

    No absolute path, no `..`, no link that leads out.
    """
    root = folder.resolve()
    try:
        path = (root / file).resolve()
    except (OSError, ValueError, RuntimeError):
        return None
    outside = Path(file).is_absolute() or ".." in Path(file).parts or not path.is_relative_to(root)
    return None if outside else path


def cache_base() -> Path | None:
    """The user's folder for compiled code; None where nothing can be written."""
    return next(_bases(), None)


def cache_of_version(version: str) -> Path | None:
    """The folder of one version's code, made if need be: then old ones go. None where none can be trusted."""
    for base in _bases():
        if not (base / version).exists():
            _discard_old(base)
        if _is_ours(base / version):
            return base / version
    return None


def _bases() -> Iterator[Path]:
    return (folder for folder in _candidates() if _is_ours(folder, base=True))


def _candidates() -> Iterator[Path]:
    """Folders that may keep compiled code, best first."""
    if chosen := os.environ.get("NUMBA_CACHE_DIR"):  # empty: as if it were not set
        yield Path(chosen)
    with contextlib.suppress(RuntimeError):  # no home at all
        yield Path(os.environ.get("XDG_CACHE_HOME") or Path("~/.cache").expanduser()) / "beaver-ftc"
    with contextlib.suppress(FileNotFoundError):  # nor anywhere for temporary files
        yield Path(tempfile.gettempdir()) / f"beaver-ftc-{_user()}"


def _user() -> int:
    return os.getuid() if hasattr(os, "getuid") else 0


def _is_ours(folder: Path, base: bool = False) -> bool:
    """Whether the folder, made if need be, is one we can write and nobody else can: code is run from it.

    A refusal is said. base: the folder is one that holds the versions' folders.
    """
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        if not os.access(folder, os.W_OK):
            return False
        why = _not_ours(folder, base) if os.name == "posix" else ""
    except OSError:
        return False
    if why:
        _say_refused(folder, why)
    return not why


def _not_ours(folder: Path, base: bool) -> str:
    """Who else may put code into a folder, in words; nothing if nobody."""
    itself, status, trusted = folder.lstat(), folder.stat(), (_user(), _ROOT)
    if folder.is_symlink() and (itself.st_uid not in trusted or not base):
        return "it is a link"
    if base and status.st_mode & stat.S_ISVTX and status.st_uid in trusted:
        return ""  # as /tmp: what we make in it nobody else can replace
    return _other_writer(status)


def _other_writer(status: os.stat_result) -> str:
    """Who else can write a file or a folder, in words; nothing if nobody."""
    if status.st_uid != _user():
        return f"it belongs to user {status.st_uid}"
    return f"its mode is {status.st_mode & 0o7777:04o}" if status.st_mode & _OTHERS_WRITE else ""


def read_own(path: Path) -> tuple[bytes, str]:
    """The content of a file of compiled code, and why it must not be run: who else can write it, in words.

    Of a file that is refused nothing is read. Raises OSError.
    """
    flags = os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_BINARY", 0)
    with open(path, "rb", opener=lambda name, _: os.open(name, flags)) as file:
        why = _other_writer(os.fstat(file.fileno())) if os.name == "posix" else ""
        return (b"" if why else file.read()), why


def _say_refused(folder: Path, why: str) -> None:
    """One line a program: processes that are started later know what has been said."""
    said = os.environ.get(_REFUSED, "").split(os.pathsep)
    if str(folder) not in said:
        os.environ[_REFUSED] = os.pathsep.join([*filter(None, said), str(folder)])
        print(
            f"beaver-ftc: no compiled code is run from {folder}: {why}, "
            "allowed: a folder of your own that neither group nor others can write (chmod go-w)",
            file=sys.stderr, flush=True,
        )  # fmt: skip


def _discard_old(base: Path) -> None:
    """Remove what earlier versions have left, but for the latest: someone may be flying with them."""
    folders = [folder for folder in base.glob("[0-9a-f]" * 16) if folder.is_dir()]
    folders.sort(key=lambda folder: folder.stat().st_mtime, reverse=True)
    for folder in folders[_VERSIONS_KEPT:]:
        shutil.rmtree(folder, ignore_errors=True)
