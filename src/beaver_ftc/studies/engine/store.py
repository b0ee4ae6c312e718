"""How a study keeps the rows of the flights that it has flown, so that a later start can resume it.

Files are written as a whole or not at all. A process locks the folder that it writes to. A study also keeps
its identity: the request, the versions and the code that its rows follow from. It resumes only if the
identity is the same, so that old and new rows may stand in one table.
"""

import contextlib
import hashlib
import json
import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import IO, Any, Protocol

from beaver_ftc.documents.errors import BadInput, SimulationFailed, say_once
from beaver_ftc.documents.files import data_root, read_json
from beaver_ftc.plugins import SERVICES, folders
from beaver_ftc.results.folder import clear_disk_errors, sync
from beaver_ftc.results.metrics import versions
from beaver_ftc.results.model import Document

LOCK = ".lock"
DAMAGED = ".damaged"  # at the end of the name of what was set aside
UNREADABLE = "is damaged and cannot be read"
KEPT = "; what has been flown is kept, go on with --resume"


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


def known(manifest: Path) -> Document | None:
    """The identity in a file; None if there is no such file, or if it cannot be read."""
    try:
        there = read_json(manifest)
    except (OSError, ValueError):
        return None
    is_one = isinstance(there, dict) and all(isinstance(value, dict) for value in there.values())
    return there if is_one else None


def remove_leftovers(folder: Path) -> None:
    """Remove incomplete files that a killed process has left."""
    for partial in folder.rglob(".*.partial"):
        partial.unlink(missing_ok=True)


@contextlib.contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Hold a folder for this process alone. The lock ends with the block or the process.

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


def set_aside(path: Path, why: str) -> Path:
    """Rename a damaged file, so that nothing of it is lost, and print one line. Returns its new path."""
    name = f"{path.name}{DAMAGED}"
    n = 1
    while (path.parent / name).exists():
        n += 1
        name = f"{path.name}{DAMAGED}-{n}"
    path.rename(path.parent / name)
    say_once(f"{path}: {why}: set aside as {name}; what was in it is flown again")
    return path.parent / name


class Codec(Protocol):
    """How the rows of a batch are written and read."""

    suffix: str

    def write(self, rows: Any, file: IO[bytes]) -> None:
        """Fill a file with rows."""

    def read(self, path: Path, runs: Sequence[int]) -> Any:
        """The rows of these runs; any exception, or None, for a file that holds anything else."""


@dataclass(frozen=True)
class Parts:
    """A folder of batches of rows, one file for each. kept: the end of the message about a full disk."""

    folder: Path
    codec: Codec
    kept: str = KEPT

    def __bool__(self) -> bool:
        """Whether the folder has at least one batch."""
        return self.folder.is_dir() and any(self.folder.glob(f"*{self.codec.suffix}"))

    def land(self, batch: int | str, rows: Any) -> None:
        """Write a batch. Raises SimulationFailed if the disk does not take it."""
        with clear_disk_errors(self.folder.parent, self.kept):
            replace_whole(self._path(batch), lambda file: self.codec.write(rows, file))

    def landed(self, batch: int | str, runs: Sequence[int]) -> Any:
        """The rows of a batch, None if it has no file. A file that cannot be read is set aside: None, too."""
        path = self._path(batch)
        rows = None
        if path.exists():
            with contextlib.suppress(Exception):
                rows = self.codec.read(path, runs)
            if rows is None:
                set_aside(path, UNREADABLE)
        return rows

    def remove(self) -> None:
        """Remove all parts."""
        for part in self.folder.glob(f"*{self.codec.suffix}"):
            part.unlink()
        with contextlib.suppress(OSError):
            self.folder.rmdir()

    def _path(self, batch: int | str) -> Path:
        return self.folder / f"{batch:0>6}{self.codec.suffix}"


class RowsAsJson:
    """Rows of one type, a dataclass or a dictionary, as JSON; numbers may be infinite."""

    suffix = ".json"

    def __init__(self, row: Any) -> None:
        from pydantic import TypeAdapter

        self._adapter = TypeAdapter(list[row])

    def write(self, rows: Any, file: IO[bytes]) -> None:
        plain = json.dumps(self._adapter.dump_python(rows), default=lambda number: number.item())  # of NumPy
        file.write(plain.encode())

    def read(self, path: Path, runs: Sequence[int]) -> Any:
        rows = self._adapter.validate_python(read_json(path))
        return rows if len(rows) == len(runs) else None


def batches_of(count: int, size: int) -> Iterator[tuple[int, range]]:
    """(number, runs) of each batch of `size` of so many cases."""
    for number in range(-(-count // size)):
        yield number, range(number * size, min((number + 1) * size, count))


PACKAGE = Path(__file__).resolve().parents[2]
# Folders and modules of a package whose code starts studies or prints rows: no number in a row depends on it.
NO_ROWS = ("cli", "commands", "pytest_plugin")


def identity(what: str, asked: Document) -> Document:
    """The identity of a study: the resolved request `asked` under the key `what`, then the versions of this
    machine's packages and the fingerprint of its code."""
    document = {what: asked, "versions": {**versions(), **plug_ins(), "flight code": fingerprint()}}
    return json.loads(json.dumps(document))


def refuse_other(mine: Document, there: Document, folder: Path) -> None:
    """Raise BadInput if the flights in a folder follow from another identity than mine."""
    what = next(iter(mine))
    changed = differences(there.get(what, {}), mine[what])
    if changed:
        raise BadInput(
            f"{folder}: the {what} file has changed since these flights ({', '.join(changed)}): "
            f"resuming would mix two {what}s, allowed: the unchanged file, or another --out"
        )
    then = there.get("versions", {})
    now = mine["versions"]
    changed = [f"{name} {then.get(name)} then, {now.get(name)} now" for name in differences(then, now)]
    if changed:
        raise BadInput(
            f"{folder}: flown by other versions ({', '.join(changed)}): resuming would mix them, "
            "allowed: the same versions, or another --out"
        )


def differences(then: Document, now: Document) -> list[str]:
    """The keys whose values differ, those that have gone included."""
    return [name for name in dict.fromkeys([*now, *then]) if then.get(name) != now.get(name)]


def plug_ins() -> dict[str, str]:
    """Versions of the other packages whose detectors and laws may fly."""
    from importlib.metadata import PackageNotFoundError, version

    from beaver_ftc.plugins import DETECTORS, LAWS, OURS, registered

    packages = {entry.package for group in (DETECTORS, LAWS) for entry in registered(group).values()}
    found = {}
    for package in sorted(packages - {OURS, ""}):
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            found[package] = "unknown"
    return found


def hashed_files() -> list[Path]:
    """The sources and data that rows may depend on: those of the core and of each package that offers it a
    service, without NO_ROWS, and all files of the aircraft."""
    sources = [
        path
        for package in (PACKAGE, *folders(SERVICES))
        for path in package.rglob("*")
        if path.suffix in (".py", ".json", ".yaml")
        and path.relative_to(package).with_suffix("").parts[0] not in NO_ROWS
    ]
    aircraft = [path for path in (data_root() / "aircraft").rglob("*") if path.is_file()]
    return sorted({*sources, *aircraft})


@cache
def fingerprint() -> str:
    """A digest of `hashed_files`, because a version number does not change with an edit."""
    return digest(hashed_files())[:16]


def digest_of_aircraft(folder: Path) -> str:
    """A digest of an aircraft's files: another aircraft of the same name has another digest."""
    return digest(
        path for path in sorted(folder.rglob("*")) if path.suffix in (".xml", ".yaml") and path.is_file()
    )


def digest(paths: Iterable[Path]) -> str:
    """A digest of files, names and contents."""
    found = hashlib.sha256()
    for path in paths:
        found.update(path.name.encode() + path.read_bytes())
    return found.hexdigest()
