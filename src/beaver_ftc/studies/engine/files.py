"""The files of the folder of a study. Each is written as a whole or not at all, by one process at a time."""

import contextlib
import os
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import IO

from beaver_ftc.documents.errors import SimulationFailed, say_once
from beaver_ftc.results.folder import sync

LOCK = ".lock"
DAMAGED = ".damaged"  # end of the name of a file that was set aside
UNREADABLE = "is damaged and cannot be read"


def write_whole(path: Path, content: bytes) -> None:
    """Write a file atomically: after a crash it has its new content or its old content."""
    replace_whole(path, lambda file: file.write(content))


def replace_whole(path: Path, fill: Callable[[IO[bytes]], object]) -> None:
    """Write a file atomically, as `write_whole` does: `fill` writes its content."""
    partial = path.with_name(f".{path.name}.partial")
    try:
        with partial.open("wb") as file:
            fill(file)
            file.flush()
            os.fsync(file.fileno())
        os.replace(partial, path)
    except BaseException:
        partial.unlink(missing_ok=True)
        raise
    sync(path.parent)


def remove_leftovers(folder: Path) -> None:
    """Remove incomplete files that a killed process has left."""
    for partial in folder.rglob(".*.partial"):
        partial.unlink(missing_ok=True)


def empty(folder: Path) -> None:
    """Remove the content of a locked folder, as far as possible, but not its lock, which must hold until the
    rest is removed."""
    with contextlib.suppress(OSError):
        for path in folder.iterdir():
            if path.is_dir():
                shutil.rmtree(path, ignore_errors=True)
            elif path.name != LOCK:
                path.unlink()


@contextlib.contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Lock a folder for this process during the block. The lock also ends with the process.

    Raises SimulationFailed if another process holds it.
    """
    from filelock import FileLock, Timeout

    lock = FileLock(folder / LOCK)
    try:
        lock.acquire(timeout=0)
    except Timeout:
        raise SimulationFailed(
            f"cannot write {folder}: another beaver-ftc is flying into it; "
            "wait for it or choose another --out"
        ) from None
    try:
        yield
    finally:
        (folder / LOCK).unlink(missing_ok=True)  # removed while locked: the next process makes a new file
        lock.release()


def set_aside(path: Path, why: str) -> None:
    """Rename a damaged file, so that its content is not lost, and print one line with the reason `why`."""
    name = f"{path.name}{DAMAGED}"
    n = 1
    while (path.parent / name).exists():
        n += 1
        name = f"{path.name}{DAMAGED}-{n}"
    path.rename(path.parent / name)
    say_once(f"{path}: {why}: set aside as {name}; what was in it is flown again")
