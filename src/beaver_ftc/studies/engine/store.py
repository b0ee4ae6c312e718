"""How a study keeps the rows of its flights: a file for each batch of cases."""

import contextlib
import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any, Protocol

from beaver_ftc.documents.files import read_json
from beaver_ftc.results.folder import clear_disk_errors
from beaver_ftc.studies.engine.files import UNREADABLE, replace_whole, set_aside

KEPT = "; what has been flown is kept, go on with --resume"


class Codec(Protocol):
    """How the rows of a batch are written and read."""

    suffix: str

    def write(self, rows: Any, file: IO[bytes]) -> None:
        """Fill a file with rows."""

    def read(self, path: Path, runs: Sequence[int]) -> Any:
        """The rows of these runs. For a file with another content: None, or any exception."""


@dataclass(frozen=True)
class Parts:
    """A folder of batches of rows, one file for each. codec: format of the files. kept: end of the message
    about a full disk."""

    folder: Path
    codec: Codec
    kept: str = KEPT

    def __bool__(self) -> bool:
        """Whether the folder has at least one batch."""
        return self.folder.is_dir() and any(self.folder.glob(f"*{self.codec.suffix}"))

    def land(self, batch: int | str, rows: Any) -> None:
        """Write a batch. Raises SimulationFailed if the disk fails."""
        with clear_disk_errors(self.folder.parent, self.kept):
            replace_whole(self._path(batch), lambda file: self.codec.write(rows, file))

    def landed(self, batch: int | str, runs: Sequence[int]) -> Any:
        """The rows of a batch; None if it has no file. A file that cannot be read, or has other rows,
        is set aside, and gives None, too."""
        path = self._path(batch)
        rows = None
        if path.exists():
            with contextlib.suppress(Exception):
                rows = self.codec.read(path, runs)
            if rows is None:
                set_aside(path, UNREADABLE)
        return rows

    def remove(self) -> None:
        """Remove all parts, and the folder if nothing else is in it."""
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
    """(number, runs) of each batch of at most `size` cases, of `count` cases in all."""
    for number in range(-(-count // size)):
        yield number, range(number * size, min((number + 1) * size, count))
