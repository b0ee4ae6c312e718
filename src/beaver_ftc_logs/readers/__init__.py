"""Readers of recorded flights, by name. A new format is one file here and one line in `READERS`."""

from collections.abc import Collection, Iterator
from importlib import import_module
from pathlib import Path
from typing import Any

from beaver_ftc.documents import BadInput
from beaver_ftc_logs.recording import Recording

PART_ROWS = 100_000
"""Rows of a part of a long table."""
READERS = ("table", "alfa", "ulog", "ardupilot")
_BY_SUFFIX = {
    ".csv": "table", ".tsv": "table", ".txt": "table", ".parquet": "table",
    ".ulg": "ulog", ".bin": "ardupilot", ".log": "ardupilot",
}  # fmt: skip


_STAMPS = {"alfa": ("%time", "ns"), "ulog": ("timestamp", "us"), "ardupilot": ("TimeUS", "us")}
"""Where time stands in formats that say it themselves."""


def read_flight(
    path: Path,
    reader: str | None = None,
    time: tuple[str, str] | None = None,
    columns: Collection[str] | None = None,
) -> Recording:
    """The recorded flight in a file or folder.

    reader: one of READERS; by the path's own form where None. time: column and unit of a table's time.
    columns: those that a log is read for, all where None. Raises BadInput with one line: why the log cannot
    be used.
    """
    return next(_read(path, reader, time, {"columns": columns, "rows": None}))


def read_parts(
    path: Path,
    reader: str | None = None,
    time: tuple[str, str] | None = None,
    columns: Collection[str] | None = None,
) -> Iterator[Recording]:
    """The same, a long table in parts."""
    return _read(path, reader, time, {"columns": columns, "rows": PART_ROWS})


def _read(
    path: Path, reader: str | None, time: tuple[str, str] | None, of_table: dict[str, Any]
) -> Iterator[Recording]:
    check_exists(path)
    name = reader or evident(path)
    if name not in READERS:
        raise BadInput(f"--reader {name}: is not known, allowed: {', '.join(READERS)}")
    module = import_module(f"beaver_ftc_logs.readers.{name}")
    if name == "table":
        yield from module.read_parts(path, *(time or ()), **of_table)
        return
    if time is not None and time != _STAMPS[name]:
        column, unit = _STAMPS[name]
        raise BadInput(f"{path}: time: {' in '.join(time)} is not its time, allowed: {column} in {unit}")
    wanted = of_table["columns"] if name in ("ulog", "ardupilot") else None
    yield module.read(path, wanted) if wanted is not None else module.read(path)


def check_exists(path: Path) -> None:
    """Raise BadInput where there is no log."""
    if not path.exists():
        raise BadInput(f"{path}: no such file or folder, allowed: a recorded flight")


def evident(path: Path) -> str:
    """The reader that a path asks for by its form. Raises BadInput where none does."""
    if path.is_dir():
        return "alfa"
    name = _BY_SUFFIX.get(path.suffix.lower())
    if name is None:
        raise BadInput(
            f"{path}: what kind of log this is cannot be seen, allowed: {', '.join(sorted(_BY_SUFFIX))}, "
            f"or --reader {', '.join(READERS)}"
        )
    return name
