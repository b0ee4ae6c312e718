"""Files: where ours lie, how a third party's are read, and what is kept for later processes.

The aircraft and the built-in scenarios live in an installed wheel, or at the repository's root. A file
that a third party names is a regular one, of bounded size, UTF-8. Compiled code is kept where no other
user can write.
"""

import contextlib
import hashlib
import json
import os
import shutil
import stat
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

Document = dict[str, Any]


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


def put_folder(folder: Path, target: Path, compare_all_but: str = "") -> None:
    """Move a folder to the place of another, whole. One with the same files stays, since another process that
    made it may be reading it. compare_all_but: name of a file that may differ."""
    target.parent.mkdir(parents=True, exist_ok=True)
    if _content(folder, compare_all_but) == _content(target, compare_all_but):
        return
    beside = target.with_name(f".{target.name}-{os.getpid()}")
    shutil.move(folder, beside)  # from another file system file by file
    shutil.rmtree(target, ignore_errors=True)
    try:
        beside.rename(target)
    except OSError:
        shutil.rmtree(beside)
        if not target.is_dir():  # else another process was quicker
            raise


def _content(folder: Path, compare_all_but: str) -> dict[str, bytes]:
    """The files of a folder; empty if there is none."""
    return {
        str(file.relative_to(folder)): file.read_bytes()
        for file in folder.rglob("*")
        if file.is_file() and file.name != compare_all_but
    }


class UnreadableError(Exception):
    """The file cannot be used as text; the message says why and what is allowed, the line where: 0 if it is
    the file as a whole."""

    def __init__(self, reason: str, line: int = 0) -> None:
        super().__init__(reason)
        self.line = line


class AbsentFileError(UnreadableError):
    """There is no such file."""


def read_text(path: Path | str, max_bytes: int) -> str:
    """The whole of a regular UTF-8 file.

    Raises UnreadableError; never blocks on a pipe, never reads past max_bytes.
    """
    data = read_bytes(path, max_bytes)
    text, nul, _ = data.partition(b"\0")
    if nul:
        raise UnreadableError("is a binary file, allowed: UTF-8 text", 1 + text.count(b"\n"))
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        says = f"byte 0x{data[error.start]:02x} is not UTF-8, allowed: UTF-8 text"
        raise UnreadableError(says, 1 + data[: error.start].count(b"\n")) from None


def read_bytes(path: Path | str, max_bytes: int) -> bytes:
    """The same, of any bytes. It can grow while it is read, and a virtual file says that its size is 0."""
    flags = os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)
    try:
        with open(path, "rb", opener=lambda name, _: os.open(name, flags)) as file:
            _check_kind_and_size(os.fstat(file.fileno()), max_bytes)
            data = file.read(max_bytes + 1)
    except FileNotFoundError:
        raise AbsentFileError("no such file, allowed: the path of a text file") from None
    except IsADirectoryError:
        raise UnreadableError("is a folder, allowed: a text file") from None
    except (OSError, ValueError) as error:
        reason = (getattr(error, "strerror", None) or str(error)).lower()
        raise UnreadableError(f"cannot be read ({reason}), allowed: a readable text file") from None
    if len(data) > max_bytes:
        raise UnreadableError(f"is too large, allowed: at most {max_bytes / 1e6:g} MB")
    return data


def read_json(path: Path) -> Any:
    """The content of a JSON file of ours. Raises OSError, and ValueError if it is damaged."""
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except RecursionError:
        raise ValueError("is nested too deeply") from None


def _check_kind_and_size(status: os.stat_result, max_bytes: int) -> None:
    if not stat.S_ISREG(status.st_mode):
        raise UnreadableError("is a pipe or a device, allowed: a regular text file")
    if status.st_size > max_bytes:
        size = f"{status.st_size / 1e6:.3g} MB"
        raise UnreadableError(f"is too large ({size}), allowed: at most {max_bytes / 1e6:g} MB")


def digest_of_files(*files: Path) -> str:
    """A name for these files of the package as they are now."""
    digest = hashlib.sha256()
    for file in files:
        content = file.read_bytes()
        digest.update(f"{file.name} {len(content)} ".encode() + content)
    return digest.hexdigest()[:16]


def digest_of_aircraft(folder: Path) -> str:
    """Digest of the paths, sizes and contents of an aircraft's files, 32 hexadecimal digits."""
    digest = hashlib.sha256()
    for path in sorted(p for p in folder.rglob("*") if p.suffix in (".xml", ".yaml") and p.is_file()):
        content = path.read_bytes()
        digest.update(b"%b %d " % (os.fsencode(path.relative_to(folder)), len(content)) + content)
    return digest.hexdigest()[:32]
