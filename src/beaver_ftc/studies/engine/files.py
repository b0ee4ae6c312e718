"""Files that are there whole or not at all, whatever happens meanwhile; folders locked while in use."""

import contextlib
import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import IO

from beaver_ftc.documents.errors import SimulationFailed

LOCK = ".lock"


def write_whole(path: Path, content: bytes) -> None:
    """Write a file so that after any crash it is there with all of its content, or as it was before."""
    replace_whole(path, lambda file: file.write(content))


def replace_whole(path: Path, fill: Callable[[IO[bytes]], object]) -> None:
    """The same for a file that `fill` writes."""
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
    sync_folder(path.parent)


def sync_folder(folder: Path) -> None:
    """Bring the names in a folder to the disk."""
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def remove_leftovers(folder: Path) -> None:
    """Remove what a process that was killed had half written."""
    for partial in folder.rglob(".*.partial"):
        partial.unlink(missing_ok=True)


@contextlib.contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Hold a folder for this process alone; what marks it goes with it, or with the process.

    Raises SimulationFailed where another process has it.
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
        (folder / LOCK).unlink(missing_ok=True)  # while it is held: the next one makes its own
        lock.release()


@contextlib.contextmanager
def clear_disk_errors(folder: Path, but: str = "") -> Iterator[None]:
    """Turn an operating system's error into one line, which may end with a word of comfort."""
    try:
        yield
    except OSError as error:
        reason = os.strerror(error.errno) if error.errno else str(error)
        raise SimulationFailed(f"cannot write {folder}: {reason[:1].lower()}{reason[1:]}{but}") from error
