"""The result folder of a run: it appears whole or not at all.

Everything is written into a hidden sibling of the final folder, which is renamed into place at the end. A
killed run leaves only hidden folders, and the parents that it created. A hidden folder is locked while in
use: if the next run can lock it, it is stale, and the run removes it, or puts an old result back.
"""

import contextlib
import ctypes
import errno
import os
import shutil
from collections.abc import Iterable, Iterator
from itertools import takewhile
from pathlib import Path
from uuid import uuid4

from beaver_ftc.documents.errors import SimulationFailed

try:
    import fcntl
except ImportError:  # not a POSIX system: nothing can be locked or synced, and nothing is taken for stale
    fcntl = None  # type: ignore[assignment]

# The files of a run. Commands that write other files into a result folder declare these themselves.
FILES_OF_A_RUN = frozenset({
    "scenario.yaml", "log.parquet", "metrics.json", "report.html", "figures", "aircraft",
    "log.csv", "flight.acmi", "flight.csv", "flight.ulg", "flight.bin", "vehicle.yaml",
})  # fmt: skip
AIRCRAFT = "aircraft"  # folder with the copy of an own aircraft, to fly it again
MODEL_FILES = frozenset({".xml", ".yaml"})  # endings of the files of an aircraft
_RETIRED = "-replaced"  # end of the hidden name of an old result, until the new one is in its place
_PICTURE_END_BYTES = 2048  # read at each end of a picture: metadata come first, those of a PDF last
# Arguments of Linux' renameat2: paths are relative to the working directory; swap the two in one step.
_AT_FDCWD = -100
_RENAME_EXCHANGE = 2


@contextlib.contextmanager
def result_folder(out: Path, name: str, files: Iterable[str] = ()) -> Iterator[Path]:
    """Yield an empty folder to fill. On success it becomes `out/name`; on any failure it is removed, with the
    parents that were created for it.

    files: names that an earlier result of this kind may have. Raises SimulationFailed if the folder cannot be
    written, or if `out/name` is not a result of ours.
    """
    final = out / name
    _remove_stale(final)
    state = "the result that was there is as it was" if final.is_dir() else "nothing is left there"
    with clear_disk_errors(final, f"; {state}"):
        refuse_foreign(final, files)
        created = _make_parents(out)
        token = uuid4().hex
        unnamed = out / f".beaver-ftc-{token}"
        hidden = out / f"{partial_prefix(name)}{token}"
        unnamed.mkdir()
        try:
            # Lock first: under its hidden name, another run would take it for stale. A run that is killed
            # before the new name leaves an empty folder that no run removes.
            with locked(unnamed):
                unnamed.rename(hidden)
                yield hidden
                for path in (*hidden.rglob("*"), hidden):  # the content reaches the disk before the name
                    sync(path)
                _move_into_place(hidden, final, files)
        except BaseException:
            shutil.rmtree(hidden, ignore_errors=True)
            with contextlib.suppress(OSError):
                for folder in created:
                    folder.rmdir()
            raise


def refuse_foreign(folder: Path, files: Iterable[str] = ()) -> None:
    """Raise SimulationFailed if `folder` exists and holds a file that is no result: it would be lost.

    files: names of result files beside those that commands declare.
    """
    if not os.path.lexists(folder):
        return
    if folder.is_symlink() or not folder.is_dir():
        raise SimulationFailed(f"cannot write {folder}: it exists and is not a folder")
    foreign = _foreign_files_in(folder, files)
    if foreign:
        raise SimulationFailed(
            f"will not replace {folder}: it holds {foreign[0]}, which is no result of beaver-ftc; "
            "move it away or choose another --out"
        )


def _foreign_files_in(folder: Path, files: Iterable[str]) -> list[str]:
    """The files of a result folder that no command of ours writes: unknown names, all in `figures` that is no
    picture with our mark, and in the copy of the aircraft all that is no model file."""
    unknown = {entry.name for entry in folder.iterdir()} - FILES_OF_A_RUN - {*files}
    if unknown:
        from beaver_ftc.commands import files_of_commands

        unknown -= {*files_of_commands()}
    foreign = [path for path in (folder / "figures").rglob("*") if not _is_our_picture(path)]
    copied = (path for path in (folder / AIRCRAFT).rglob("*") if not path.is_dir())
    foreign += [path for path in copied if path.suffix not in MODEL_FILES]
    return sorted([*unknown, *(str(path.relative_to(folder)) for path in foreign)])


def _is_our_picture(path: Path) -> bool:
    """Whether a file has the mark in its metadata with which all our pictures are saved."""
    from beaver_ftc.results.style import SOFTWARE_MARK

    if path.is_symlink() or not path.is_file():
        return False
    with path.open("rb") as file:
        head = file.read(_PICTURE_END_BYTES)
        file.seek(-min(_PICTURE_END_BYTES, path.stat().st_size), os.SEEK_END)
        return SOFTWARE_MARK.encode() in head + file.read()


@contextlib.contextmanager
def clear_disk_errors(folder: Path, ending: str = "") -> Iterator[None]:
    """Turn an error of the operating system into SimulationFailed with one line, which ends with `ending`."""
    try:
        yield
    except OSError as error:
        raise SimulationFailed(f"cannot write {folder}: {disk_error_text(error)}{ending}") from error


def disk_error_text(error: OSError) -> str:
    """The reason of an error, with a small first letter."""
    reason = os.strerror(error.errno) if error.errno else str(error)
    return f"{reason[:1].lower()}{reason[1:]}"


def partial_prefix(name: str) -> str:
    """The begin of the name of the hidden folders of a run."""
    return f".{name}.partial-"


def _make_parents(folder: Path) -> list[Path]:
    """Create `folder` with its parents; return those that were missing, deepest first."""
    missing_folders = list(takewhile(lambda parent: not parent.exists(), (folder, *folder.parents)))
    folder.mkdir(parents=True, exist_ok=True)
    return missing_folders


@contextlib.contextmanager
def locked(folder: Path) -> Iterator[bool]:
    """Lock a folder during the block; yield whether it is locked. False: another process holds it, or this
    system cannot lock."""
    if not fcntl:
        yield False
        return
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            is_locked = True
        except OSError:
            is_locked = False
        yield is_locked
    finally:
        os.close(descriptor)


def _remove_stale(final: Path) -> None:
    """Remove the hidden folders that killed runs of this result have left. If a run was killed after it had
    renamed the old result away, and nothing is in its place, put the old result back."""
    for leftover in final.parent.glob(f"{partial_prefix(final.name)}*"):
        with contextlib.suppress(OSError), locked(leftover) as stale:
            if stale and leftover.name.endswith(_RETIRED) and not final.exists():
                leftover.rename(final)
            elif stale:
                shutil.rmtree(leftover, ignore_errors=True)


def sync(path: Path) -> None:
    """Bring a file, or the names in a folder, to the disk, on a POSIX system."""
    if not fcntl:  # elsewhere, a folder cannot be opened, nor a file be synced that is open for reading
        return
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _move_into_place(hidden: Path, final: Path, files: Iterable[str]) -> None:
    """Rename the hidden folder; an older result is swapped with it, or renamed away, and then removed. If
    the hidden folder cannot be renamed, the older result gets its name back."""
    refuse_foreign(final, files)
    try:
        hidden.rename(final)  # without a test first: another run of this name may end in between
        return
    except OSError:
        if not final.exists():
            raise
    if _swap_folders(hidden, final):
        shutil.rmtree(hidden, ignore_errors=True)
    else:
        retired = hidden.with_name(f"{hidden.name}{_RETIRED}")
        with locked(final):  # under its hidden name, too
            final.rename(retired)
            try:
                hidden.rename(final)
            except OSError:
                retired.rename(final)
                raise
            shutil.rmtree(retired, ignore_errors=True)


def _swap_folders(first: Path, second: Path) -> bool:
    """Swap two folders in one step, which Linux can; False if the system or the file system cannot."""
    try:
        rename = ctypes.CDLL(None, use_errno=True).renameat2
    except (AttributeError, OSError, TypeError):
        return False
    swapped = rename(_AT_FDCWD, os.fsencode(first), _AT_FDCWD, os.fsencode(second), _RENAME_EXCHANGE) == 0
    if not swapped and ctypes.get_errno() not in (errno.ENOSYS, errno.EINVAL, errno.EOPNOTSUPP):
        raise OSError(ctypes.get_errno(), os.strerror(ctypes.get_errno()))
    return swapped
