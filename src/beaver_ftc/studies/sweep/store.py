"""The folder of a sweep: parts while it is flown, `results.parquet` at the end, and what is drawn from it."""

import contextlib
import json
import shutil
from collections.abc import Iterable, Sequence
from functools import cached_property
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any, Self

from beaver_ftc.documents.errors import BadInput, SimulationFailed
from beaver_ftc.results.folder import clear_disk_errors, refuse_foreign, sync
from beaver_ftc.results.model import Document
from beaver_ftc.scenario.sweeps import Sweep
from beaver_ftc.studies.engine import files, identity
from beaver_ftc.studies.engine.store import KEPT, Parts
from beaver_ftc.studies.engine.workers import Number
from beaver_ftc.studies.sweep.one_flight import schema_of, table_of

if TYPE_CHECKING:
    import pyarrow as pa


FOLDERS = frozenset({"parts", "figures", "flights"})
OWN_FILES = frozenset({
    files.LOCK, "sweep.json", "results.parquet", "summary.json", "report.html", *FOLDERS,
})  # fmt: skip
ROWS_PER_GROUP = 8192
# A sweep is read whole, so that statistics of row groups help nobody; most columns are numbers.
_WRITE_OPTIONS: dict[str, Any] = {"compression": "snappy", "write_statistics": False, "use_dictionary": False}
# Words, verdicts, and what the resolved base says better: no flight follows from them.
_NOT_FLOWN = ("description", "expect", "base", "set")


def identity_of(sweep: Sweep, search: str | None = None) -> Document:
    """The identity of a sweep on this machine, as in `sweep.json`."""
    file = sweep.file.model_dump(mode="json", exclude_none=True)
    asked = {key: value for key, value in file.items() if key not in _NOT_FLOWN}
    aircraft = identity.digest_of_aircraft(sweep.aircraft.folder)
    flown = {"runs": sweep.flights, "base": sweep.base, "aircraft": aircraft, "search": search}
    return identity.of("sweep", {**asked, **flown})


class RowsAsParquet:
    """A batch of a sweep as a table."""

    suffix = ".parquet"

    def __init__(self, sweep: Sweep) -> None:
        self.schema = schema_of(sweep)
        self._sweep = sweep

    def write(self, rows: Any, file: IO[bytes]) -> None:
        write_tables(file, [table_of(self._sweep, self.schema, rows)], self.schema)

    def read(self, path: Path, runs: Sequence[int]) -> "pa.Table | None":
        from pyarrow.parquet import read_table

        return self.if_of(runs, read_table(path))

    def if_of(self, runs: Sequence[int], table: "pa.Table") -> "pa.Table | None":
        """The table if it has these runs and the columns of the sweep."""
        same = table.schema.equals(self.schema) and table.column("run").to_pylist() == list(runs)
        return table if same else None


class Store:
    """The folder of one sweep, locked; a context manager."""

    def __init__(self, folder: Path, sweep: Sweep) -> None:
        self._codec = RowsAsParquet(sweep)
        self.folder = folder
        self.schema = self._codec.schema
        self.parts = Parts(folder / "parts", self._codec)
        self.results = folder / "results.parquet"
        self._manifest = folder / "sweep.json"
        self._open = contextlib.ExitStack()

    def __enter__(self) -> Self:
        with clear_disk_errors(self.folder):
            _refuse_folder(self.folder)
            self.folder.mkdir(parents=True, exist_ok=True)
            self._open.enter_context(files.locked(self.folder))
        return self

    def __exit__(self, *_: object) -> None:
        self._open.close()

    def begin(self, mine: Document, resume: bool) -> None:
        """Make the folder this sweep's. Raises BadInput where flights in it would be lost or mixed.

        A finished sweep is replaced unless it is to be resumed; an unfinished one never is.
        """
        there = identity.known(self._manifest, "sweep")
        flown = self.results.exists() or bool(self.parts)
        if there is None and (flown or self._manifest.exists()):
            self._refuse_or_set_aside(resume)
        elif there is not None and resume:
            identity.refuse_other(mine, there, self.folder)
        elif flown and not (self.folder / "summary.json").exists():
            raise BadInput(
                f"{self.folder}: holds an unfinished sweep, allowed: --resume to go on with it, "
                "another --out, or to remove it first"
            )
        with clear_disk_errors(self.folder):
            if there is None or not resume:
                self._clear()
            self.parts.folder.mkdir(exist_ok=True)
            files.write_whole(self._manifest, json.dumps(mine, indent=2).encode() + b"\n")
            sync(self.folder.parent)
            files.remove_leftovers(self.folder)

    def landed(self, batch: Number, runs: Sequence[int]) -> "pa.Table | None":
        """The table of a batch if it has landed whole: of its part, or else of `results.parquet`."""
        table = self.parts.landed(batch, runs)
        if table is None and self._compacted is not None:
            return self._codec.if_of(runs, self._compacted.slice(runs[0], len(runs)))
        return table

    @cached_property
    def _compacted(self) -> "pa.Table | None":
        """`results.parquet` of an earlier start; one that cannot be read is set aside."""
        from pyarrow import ArrowException
        from pyarrow.parquet import read_table

        if not self.results.exists():
            return None
        try:
            with self.results.open("rb") as file:  # a folder Arrow would read as a table of many files
                return read_table(file)
        except (ArrowException, OSError, ValueError):
            files.set_aside(self.results, files.UNREADABLE)
            return None

    def is_compacted(self, flights: int) -> bool:
        """Whether `results.parquet` is there with all flights."""
        from pyarrow import ArrowException
        from pyarrow.parquet import ParquetFile

        try:
            with ParquetFile(self.results) as file:
                return file.metadata.num_rows == flights and file.schema_arrow.equals(self.schema)
        except (OSError, ArrowException):
            return False

    def compact(self, batches: Iterable["pa.Table"]) -> None:
        """Make `results.parquet` of all batches, in order; the parts are still there."""
        with clear_disk_errors(self.folder, KEPT):
            files.replace_whole(self.results, lambda file: write_tables(file, batches, self.schema))

    def write(self, name: str, text: str) -> None:
        """Write a file of the folder, whole or not at all."""
        with clear_disk_errors(self.folder):
            files.write_whole(self.folder / name, text.encode("utf-8"))

    def _refuse_or_set_aside(self, resume: bool) -> None:
        """Raise BadInput, since nothing says whose flights these are; if the sweep is resumed, rename all."""
        what = files.UNREADABLE if self._manifest.exists() else "is not there"
        if not resume:
            raise BadInput(
                f"{self._manifest}: {what}, allowed: --resume, which sets aside what is there and flies "
                "again, or another --out"
            )
        with clear_disk_errors(self.folder):
            for name in sorted(OWN_FILES - {files.LOCK}):
                if (self.folder / name).exists():
                    files.set_aside(self.folder / name, f"{self._manifest.name} {what}")

    def _clear(self) -> None:
        """Remove what an earlier sweep left; its identity last, by which it is known for ours.

        What a user has put into its folders stays: SimulationFailed for a kept flight that is no longer ours.
        """
        from beaver_ftc.studies.sweep.pictures import FIGURES

        for flight in (self.folder / "flights").glob("*"):
            refuse_foreign(flight)
        for folder in (self.folder / "flights", self.parts.folder):
            if folder.is_dir():
                shutil.rmtree(folder)
        for name in FIGURES:
            (self.folder / "figures" / f"{name}.png").unlink(missing_ok=True)
        with contextlib.suppress(OSError):  # not empty: somebody else's
            (self.folder / "figures").rmdir()
        for name in sorted(OWN_FILES - FOLDERS - {files.LOCK, self._manifest.name}):
            (self.folder / name).unlink(missing_ok=True)
        self._manifest.unlink(missing_ok=True)


def write_tables(file: IO[bytes], tables: Iterable["pa.Table"], schema: "pa.Schema") -> None:
    """Write tables one after the other into a parquet file, in row groups worth reading.

    They are joined into these as they come: the memory they take is bounded.
    """
    import pyarrow as pa
    from pyarrow.parquet import ParquetWriter

    waiting: list[pa.Table] = []
    with ParquetWriter(file, schema, **_WRITE_OPTIONS) as writer:
        for table in tables:
            waiting.append(table)
            if sum(map(len, waiting)) >= ROWS_PER_GROUP:
                writer.write_table(pa.concat_tables(waiting))
                waiting = []
        if waiting:
            writer.write_table(pa.concat_tables(waiting))


def _is_leftover(name: str) -> bool:
    """Whether a file of this name was half written, or set aside by us."""
    return name.endswith(".partial") or any(name.startswith(f"{own}{files.DAMAGED}") for own in OWN_FILES)


def _refuse_folder(folder: Path) -> None:
    """Raise SimulationFailed if the folder holds anything that no sweep wrote: it might be lost."""
    if not folder.exists():
        return
    if not folder.is_dir():
        raise SimulationFailed(f"cannot write {folder}: it exists and is not a folder")
    names = sorted(entry.name for entry in folder.iterdir())
    foreign = [name for name in names if name not in OWN_FILES and not _is_leftover(name)]
    marks = {"sweep.json", files.LOCK, "flights"}  # flights are kept before there is a part or a result
    is_marked = any(name in marks or _is_leftover(name) for name in names)
    if foreign or (names and not is_marked):
        why = f"{foreign[0]}, which is no part of a sweep" if foreign else "no sweep.json, but other files"
        raise SimulationFailed(
            f"will not write into {folder}: it holds {why}; move it away or choose another --out"
        )
