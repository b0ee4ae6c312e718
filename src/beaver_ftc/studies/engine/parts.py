"""What has been flown is there to stay: rows in files, a batch each, whole or not at all."""

import contextlib
import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import IO, Any, Protocol

from beaver_ftc.studies.engine.files import clear_disk_errors, replace_whole

KEPT = "; what has been flown is kept, go on with --resume"


class Codec(Protocol):
    """How the rows of a batch are written and read."""

    suffix: str

    def write(self, rows: Any, file: IO[bytes]) -> None:
        """Fill a file with rows."""

    def read(self, path: Path, runs: Sequence[int]) -> Any:
        """The rows of these runs; any exception, or None, for a file that holds anything else."""


class Parts:
    """A folder of batches that have landed. kept: what a message about a full disk ends with."""

    def __init__(self, folder: Path, codec: Codec, kept: str = KEPT) -> None:
        self.folder, self._codec, self._kept = folder, codec, kept

    def __bool__(self) -> bool:
        """Whether anything has landed."""
        return self.folder.is_dir() and any(self.folder.glob(f"*{self._codec.suffix}"))

    def land(self, batch: int, rows: Any) -> None:
        """Keep a batch. Raises SimulationFailed if the disk will not have it."""
        with clear_disk_errors(self.folder.parent, self._kept):
            replace_whole(self._path(batch), lambda file: self._codec.write(rows, file))

    def landed(self, batch: int, runs: Sequence[int]) -> Any:
        """The rows of a batch if it has landed whole; what cannot be read is removed, to be flown again."""
        path = self._path(batch)
        if not path.exists():
            return None
        with contextlib.suppress(Exception):
            rows = self._codec.read(path, runs)
            if rows is not None:
                return rows
        path.unlink()
        return None

    def remove(self) -> None:
        """Remove all parts."""
        for part in self.folder.glob(f"*{self._codec.suffix}"):
            part.unlink()
        with contextlib.suppress(OSError):
            self.folder.rmdir()

    def _path(self, batch: int) -> Path:
        return self.folder / f"{batch:06d}{self._codec.suffix}"


class RowsAsJson:
    """Rows of one type, a dataclass or a dictionary, as JSON; numbers may be infinite."""

    suffix = ".json"

    def __init__(self, row: Any) -> None:
        from pydantic import TypeAdapter

        self._adapter = TypeAdapter(list[row])

    def write(self, rows: Any, file: IO[bytes]) -> None:
        file.write(json.dumps(self._adapter.dump_python(rows), default=_plain).encode())

    def read(self, path: Path, runs: Sequence[int]) -> Any:
        rows = self._adapter.validate_python(json.loads(path.read_text(encoding="utf-8")))
        return rows if len(rows) == len(runs) else None


def _plain(value: Any) -> Any:
    """A number of NumPy's as Python's."""
    return value.item()


def batches_of(count: int, size: int) -> Iterator[tuple[int, range]]:
    """(number, runs) of each batch of `size` of so many cases."""
    for number in range(-(-count // size)):
        yield number, range(number * size, min((number + 1) * size, count))
