"""The folder of a sweep.

sweep.json         the identity: a folder with it belongs to a sweep
parts/             a table for each batch, until all flights are in results.parquet
results.parquet    the table of all flights, compacted from the parts
summary.json       the summary: a folder with it has a finished sweep
figures/, flights/, report.html    drawn from the results, and kept flights
"""

import contextlib
import json
import shutil
from collections.abc import Iterable, Sequence
from functools import cached_property
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any, Self

from beaver_ftc.documents.errors import BadInput, SimulationFailed
from beaver_ftc.documents.files import digest_of_aircraft
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
# The whole table is read, so that statistics of row groups are of no use. Most columns are numbers: no
# dictionaries.
_WRITE_OPTIONS: dict[str, Any] = {"compression": "snappy", "write_statistics": False, "use_dictionary": False}
# Keys of a sweep file that change no flight. `base` and `set` are replaced by the resolved base, without its
# description.
_NOT_FLOWN = ("description", "expect", "base", "set")


def identity_of(sweep: Sweep, search: str | None = None) -> Document:
    """The identity of a sweep on this machine, as in `sweep.json`."""
    file = sweep.file.model_dump(mode="json", exclude_none=True)
    of_file = {key: value for key, value in file.items() if key not in _NOT_FLOWN}
    base = {key: value for key, value in sweep.base.items() if key != "description"}
    aircraft = digest_of_aircraft(sweep.aircraft.folder)
    of_run = {"runs": sweep.flights, "base": base, "aircraft": aircraft, "search": search}
    return identity.of_request("sweep", {**of_file, **of_run})


class RowsAsParquet:
    """The codec of a batch of a sweep, a table in a parquet file."""

    suffix = ".parquet"

    def __init__(self, sweep: Sweep) -> None:
        self.schema = schema_of(sweep)
        self._sweep = sweep

    def write(self, rows: Any, file: IO[bytes]) -> None:
        """Write rows as a table."""
        write_tables(file, [table_of(self._sweep, self.schema, rows)], self.schema)

    def read(self, path: Path, runs: Sequence[int]) -> "pa.Table | None":
        """The table in a file if it has these runs."""
        from pyarrow.parquet import read_table

        return self.of_runs(runs, read_table(path))

    def of_runs(self, runs: Sequence[int], table: "pa.Table") -> "pa.Table | None":
        """The table if it has these runs and the columns of the sweep, otherwise None."""
        fits = table.schema.equals(self.schema) and table.column("run").to_pylist() == list(runs)
        return table if fits else None


class Store:
    """The folder of one sweep, which is locked within the context."""

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
        """Prepare the folder for this sweep. mine: its identity.

            in the folder                        without --resume     with --resume
            nothing                              begin                begin
            flights without sweep.json           BadInput             set aside, begin
            sweep.json that cannot be read       BadInput             set aside, begin
            a sweep without flights              remove, begin        continue if the identity is the same
            a sweep with flights, unfinished     BadInput             continue if the identity is the same
            a finished sweep, also another one   remove, begin        continue if the identity is the same

        With --resume, another identity raises BadInput.
        """
        earlier = identity.read_identity(self._manifest, "sweep")
        has_flights = self.results.exists() or bool(self.parts)
        if earlier is None and (has_flights or self._manifest.exists()):
            self._refuse_or_set_aside(resume)
        elif earlier is not None and resume:
            identity.refuse_other(mine, earlier, self.folder)
        elif has_flights and not (self.folder / "summary.json").exists():
            raise BadInput(
                f"{self.folder}: holds an unfinished sweep, allowed: --resume to go on with it, "
                "another --out, or to remove it first"
            )
        with clear_disk_errors(self.folder):
            if earlier is None or not resume:
                self._clear()
            self.parts.folder.mkdir(exist_ok=True)
            files.write_whole(self._manifest, json.dumps(mine, indent=2).encode() + b"\n")
            sync(self.folder.parent)
            files.remove_leftovers(self.folder)

    def landed(self, batch: Number, runs: Sequence[int]) -> "pa.Table | None":
        """The table of a batch from its part, or else from `results.parquet`; None if it has not landed."""
        table = self.parts.landed(batch, runs)
        if table is None and self._compacted is not None:
            return self._codec.of_runs(runs, self._compacted.slice(runs[0], len(runs)))
        return table

    @cached_property
    def _compacted(self) -> "pa.Table | None":
        """The table in `results.parquet`, or None. A file that cannot be read is set aside."""
        from pyarrow import ArrowException
        from pyarrow.parquet import read_table

        if not self.results.exists():
            return None
        try:
            # opened here: Arrow would read a folder as a table of many files
            with self.results.open("rb") as file:
                return read_table(file)
        except (ArrowException, OSError, ValueError):
            files.set_aside(self.results, files.UNREADABLE)
            return None

    def is_compacted(self, flights: int) -> bool:
        """Whether `results.parquet` has all flights and the columns of the sweep."""
        from pyarrow import ArrowException
        from pyarrow.parquet import ParquetFile

        try:
            with ParquetFile(self.results) as file:
                return file.metadata.num_rows == flights and file.schema_arrow.equals(self.schema)
        except (OSError, ArrowException):
            return False

    def compact(self, batches: Iterable["pa.Table"]) -> None:
        """Write `results.parquet` from all batches, in order. The parts stay."""
        with clear_disk_errors(self.folder, KEPT):
            files.replace_whole(self.results, lambda file: write_tables(file, batches, self.schema))

    def write(self, name: str, text: str) -> None:
        """Write a file of the folder, whole or not at all."""
        with clear_disk_errors(self.folder):
            files.write_whole(self.folder / name, text.encode("utf-8"))

    def _refuse_or_set_aside(self, resume: bool) -> None:
        """Raise BadInput, since the flights may belong to another sweep. If the sweep is resumed, set all
        files aside."""
        problem = files.UNREADABLE if self._manifest.exists() else "is not there"
        if not resume:
            raise BadInput(
                f"{self._manifest}: {problem}, allowed: --resume, which sets aside what is there and flies "
                "again, or another --out"
            )
        with clear_disk_errors(self.folder):
            for name in sorted(OWN_FILES - {files.LOCK}):
                if (self.folder / name).exists():
                    files.set_aside(self.folder / name, f"{self._manifest.name} {problem}")

    def _clear(self) -> None:
        """Remove the files of an earlier sweep; `sweep.json` last, since it marks the folder as that of a
        sweep.

        Files of the user in `figures` stay. Raises SimulationFailed if the folder of a kept flight has a file
        that is no result.
        """
        from beaver_ftc.studies.sweep.pictures import FIGURES

        for flight in (self.folder / "flights").glob("*"):
            refuse_foreign(flight)
        for folder in (self.folder / "flights", self.parts.folder):
            if folder.is_dir():
                shutil.rmtree(folder)
        for name in FIGURES:
            (self.folder / "figures" / f"{name}.png").unlink(missing_ok=True)
        with contextlib.suppress(OSError):  # a folder with other files stays
            (self.folder / "figures").rmdir()
        for name in sorted(OWN_FILES - FOLDERS - {files.LOCK, self._manifest.name}):
            (self.folder / name).unlink(missing_ok=True)
        self._manifest.unlink(missing_ok=True)


def write_tables(file: IO[bytes], tables: Iterable["pa.Table"], schema: "pa.Schema") -> None:
    """Write tables into a parquet file, in row groups of at least ROWS_PER_GROUP rows; the last may have
    fewer.

    Tables are joined as they come, so that only those of one row group are in memory.
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
    """Whether a file with this name is incomplete, or was set aside."""
    return name.endswith(".partial") or any(
        name.startswith(f"{name_of_file}{files.DAMAGED}") for name_of_file in OWN_FILES
    )


def _refuse_folder(folder: Path) -> None:
    """Raise SimulationFailed if the folder has a file that no sweep wrote, or no mark of a sweep: files could
    be lost."""
    if not folder.exists():
        return
    if not folder.is_dir():
        raise SimulationFailed(f"cannot write {folder}: it exists and is not a folder")
    names = sorted(entry.name for entry in folder.iterdir())
    foreign = [name for name in names if name not in OWN_FILES and not _is_leftover(name)]
    marks = {"sweep.json", files.LOCK, "flights"}  # kept flights exist before the first part
    is_marked = any(name in marks or _is_leftover(name) for name in names)
    if foreign or (names and not is_marked):
        why = f"{foreign[0]}, which is no part of a sweep" if foreign else "no sweep.json, but other files"
        raise SimulationFailed(
            f"will not write into {folder}: it holds {why}; move it away or choose another --out"
        )
