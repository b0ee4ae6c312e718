"""The folder of a sweep: what has been flown is there to stay, whatever happens next.

Flights land in batches, each one part file `parts/000123.parquet`, which is written beside its place, brought
to the disk and renamed: it is there whole or not at all. Which flights a batch holds follows from the sweep
alone. At the end the parts become `results.parquet`, in the same way, and go. The folder is locked while in
use.
"""

import contextlib
import errno
import json
import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any, Self

from beaver_ftc.errors import BadInput, SimulationFailed

try:
    import fcntl
except ImportError:  # not a POSIX system: nothing can be locked
    fcntl = None  # type: ignore[assignment]

if TYPE_CHECKING:
    import pyarrow as pa

    from beaver_ftc.studies.sweep.identity import Identity

OWN_FILES = frozenset({
    "lock", "sweep.json", "parts", "results.parquet", "summary.json", "report.html", "figures", "flights",
})  # fmt: skip
ROWS_PER_GROUP = 8192
_KEPT = "; what has been flown is kept, go on with --resume"
_WRITE_OPTIONS: dict[str, Any] = {"compression": "snappy", "write_statistics": False, "use_dictionary": False}


class Store:
    """The folder of one sweep, locked; a context manager."""

    def __init__(self, folder: Path, schema: "pa.Schema") -> None:
        self.folder, self.schema = folder, schema
        self.parts, self.results = folder / "parts", folder / "results.parquet"
        self._lock: IO[str] | None = None
        self._compacted: pa.Table | None = None

    def __enter__(self) -> Self:
        with clear_disk_errors(self.folder):
            _refuse_foreign(self.folder)
            self.folder.mkdir(parents=True, exist_ok=True)
            self._lock = _locked(self.folder)
        return self

    def __exit__(self, *_: object) -> None:
        if self._lock:
            self._lock.close()

    def begin(self, identity: "Identity", resume: bool) -> None:
        """Make the folder this sweep's. Raises BadInput where flights in it would be lost or mixed.

        A finished sweep is replaced unless it is to be resumed; an unfinished one never is.
        """
        there = self._identity()
        if there is not None and resume:
            identity.refuse_other(there, self.folder)
        elif there is not None and self.has_flights() and not (self.folder / "summary.json").exists():
            raise BadInput(
                f"{self.folder}: holds an unfinished sweep, allowed: --resume to go on with it, "
                "another --out, or to remove it first"
            )
        with clear_disk_errors(self.folder):
            if there is None or not resume:
                self._clear()
            self.parts.mkdir(exist_ok=True)
            write_whole(self.folder / "sweep.json", json.dumps(identity.document, indent=2).encode() + b"\n")
            _sync_folder(self.folder.parent)
            _remove_leftovers(self.folder)

    def has_flights(self) -> bool:
        """Whether anything has landed."""
        return self.results.exists() or (self.parts.is_dir() and any(self.parts.glob("*.parquet")))

    def landed(self, batch: int, runs: range) -> "pa.Table | None":
        """The table of a batch if it has landed whole; what cannot be read is removed, to be flown again."""
        from pyarrow import ArrowException
        from pyarrow.parquet import read_table

        path = self._part(batch)
        if not path.exists():
            return self._compacted_batch(runs)
        try:
            table = read_table(path)
            if table.schema.equals(self.schema) and table.column("run").to_pylist() == list(runs):
                return table
        except (ArrowException, OSError, KeyError):
            pass
        path.unlink()
        return None

    def _compacted_batch(self, runs: range) -> "pa.Table | None":
        from pyarrow.parquet import read_table

        if self._compacted is None and self.results.exists():
            self._compacted = read_table(self.results, schema=self.schema)
        return self._compacted and self._compacted.slice(runs.start, len(runs))

    def land(self, batch: int, table: "pa.Table") -> None:
        """Keep a batch. Raises SimulationFailed if the disk will not have it."""
        with clear_disk_errors(self.folder, _KEPT):
            write_parquet(self._part(batch), [table], self.schema)

    def is_compacted(self, flights: int) -> bool:
        """Whether `results.parquet` is there with all flights."""
        from pyarrow import ArrowException
        from pyarrow.parquet import ParquetFile

        try:
            with ParquetFile(self.results) as file:
                return file.metadata.num_rows == flights and file.schema_arrow.equals(self.schema)
        except (FileNotFoundError, ArrowException):
            return False

    def reopen(self) -> None:
        """There is still something to fly: let nobody take the sweep for finished."""
        (self.folder / "summary.json").unlink(missing_ok=True)

    def compact(self, batches: Iterator["pa.Table"]) -> None:
        """Make `results.parquet` of all batches, in order, and remove the parts."""
        with clear_disk_errors(self.folder, _KEPT):
            write_parquet(self.results, batches, self.schema)
            self.remove_parts()

    def remove_parts(self) -> None:
        """Remove the parts once `results.parquet` holds them all."""
        for part in self.parts.glob("*.parquet"):
            part.unlink()
        with contextlib.suppress(OSError):
            self.parts.rmdir()

    def write(self, name: str, text: str) -> None:
        """Write a file of the folder, whole or not at all."""
        with clear_disk_errors(self.folder):
            write_whole(self.folder / name, text.encode("utf-8"))

    def _part(self, batch: int) -> Path:
        return self.parts / f"{batch:06d}.parquet"

    def _identity(self) -> dict[str, Any] | None:
        try:
            return json.loads((self.folder / "sweep.json").read_text(encoding="utf-8"))
        except FileNotFoundError:
            return None
        except ValueError:
            raise BadInput(f"{self.folder / 'sweep.json'}: is not readable, allowed: another --out") from None

    def _clear(self) -> None:
        """Remove what an earlier sweep left; its identity last, by which it is known for ours."""
        import shutil

        for name in sorted(OWN_FILES - {"lock", "sweep.json"}):
            path = self.folder / name
            if path.is_dir():
                shutil.rmtree(path)
            else:
                path.unlink(missing_ok=True)
        (self.folder / "sweep.json").unlink(missing_ok=True)


def write_whole(path: Path, content: bytes) -> None:
    """Write a file so that after any crash it is there with all of its content, or as it was before."""
    _replace(path, lambda file: file.write(content))


def write_parquet(path: Path, tables: "Iterator[pa.Table] | list[pa.Table]", schema: "pa.Schema") -> None:
    from pyarrow.parquet import ParquetWriter

    def fill(file: IO[bytes]) -> None:
        with ParquetWriter(file, schema, **_WRITE_OPTIONS) as writer:
            for group in _grouped(iter(tables)):
                writer.write_table(group)

    _replace(path, fill)


def _grouped(tables: "Iterator[pa.Table]") -> "Iterator[pa.Table]":
    """Tables joined into row groups worth reading, the memory they take bounded."""
    import pyarrow as pa

    waiting: list[pa.Table] = []
    for table in tables:
        waiting.append(table)
        if sum(len(part) for part in waiting) >= ROWS_PER_GROUP:
            yield pa.concat_tables(waiting)
            waiting = []
    if waiting:
        yield pa.concat_tables(waiting)


def _replace(path: Path, fill: Callable[[IO[bytes]], object]) -> None:
    partial = path.with_name(f".{path.name}.partial")
    try:
        with partial.open("wb") as file:
            fill(file)
            file.flush()
            os.fsync(file.fileno())
        partial.replace(path)
    except BaseException:
        partial.unlink(missing_ok=True)
        raise
    _sync_folder(path.parent)


def _sync_folder(folder: Path) -> None:
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _remove_leftovers(folder: Path) -> None:
    for partial in folder.rglob(".*.partial"):
        partial.unlink(missing_ok=True)


def _refuse_foreign(folder: Path) -> None:
    """Raise SimulationFailed if the folder holds anything that no sweep wrote: it might be lost."""
    if not folder.exists():
        return
    if not folder.is_dir():
        raise SimulationFailed(f"cannot write {folder}: it exists and is not a folder")
    names = sorted(entry.name for entry in folder.iterdir())
    strangers = [name for name in names if name not in OWN_FILES and not name.endswith(".partial")]
    if strangers or (names and not {"sweep.json", "lock", "flights"} & set(names)):
        raise SimulationFailed(
            f"will not write into {folder}: it holds {(strangers or names)[0]}, which is no part of a sweep; "
            "move it away or choose another --out"
        )


def _locked(folder: Path) -> IO[str]:
    """Lock the folder for as long as the file stays open; the system lets go of it when the process dies."""
    file = (folder / "lock").open("a")
    if fcntl is None:
        return file
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        file.close()
        raise SimulationFailed(
            f"cannot write {folder}: another beaver-ftc is flying this sweep there; "
            "wait for it or choose another --out"
        ) from None
    except OSError as error:
        if error.errno not in (errno.ENOLCK, errno.ENOSYS, errno.EOPNOTSUPP):
            raise
    return file


@contextlib.contextmanager
def clear_disk_errors(folder: Path, but: str = "") -> Iterator[None]:
    """Turn an operating system's error into one line, which may end with a word of comfort."""
    try:
        yield
    except OSError as error:
        reason = os.strerror(error.errno) if error.errno else str(error)
        raise SimulationFailed(f"cannot write {folder}: {reason[:1].lower()}{reason[1:]}{but}") from error
