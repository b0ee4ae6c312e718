"""Readers of recorded flights, by name. A new format is one file here and one line in `READER_NAMES`."""

from collections.abc import Collection, Iterator
from importlib import import_module
from pathlib import Path
from typing import Any

from beaver_ftc.documents import BadInput
from beaver_ftc_logs.recording import RecordedFlight

ROWS_PER_PART = 100_000
"""Rows of a part of a long table."""
READER_NAMES = ("table", "alfa", "ulog", "ardupilot")
NAMES_OF_READERS_OF_WANTED_COLUMNS = ("ulog", "ardupilot")
"""Of an autopilot's logs the columns that are wanted, the names alone where there are none of these."""
_READER_NAME_BY_SUFFIX = {
    ".csv": "table", ".tsv": "table", ".txt": "table", ".parquet": "table",
    ".ulg": "ulog", ".bin": "ardupilot", ".log": "ardupilot",
}  # fmt: skip


_TIME_COLUMN_AND_UNIT_BY_READER = {
    "alfa": ("%time", "ns"),
    "ulog": ("timestamp", "us"),
    "ardupilot": ("TimeUS", "us"),
}
"""Time column and its unit in formats that define them."""


def read_flight(
    path: Path,
    reader_name: str | None = None,
    time_column_and_unit: tuple[str, str] | None = None,
    columns: Collection[str] | None = None,
) -> RecordedFlight:
    """The recorded flight in a file or folder.

    reader_name: one of READER_NAMES; by the path's own form where None. time_column_and_unit: of a table.
    columns: those that a log is read for, and holds in memory, all where None. Raises BadInput with one line:
    why the log cannot be used.
    """
    return next(
        _read_with_reader(
            path, reader_name, time_column_and_unit, {"columns": columns, "rows_per_part": None}
        )
    )


def read_parts(
    path: Path,
    reader_name: str | None = None,
    time_column_and_unit: tuple[str, str] | None = None,
    columns: Collection[str] | None = None,
) -> Iterator[RecordedFlight]:
    """The same, a long table in parts."""
    return _read_with_reader(
        path, reader_name, time_column_and_unit, {"columns": columns, "rows_per_part": ROWS_PER_PART}
    )


def _read_with_reader(
    path: Path,
    reader_name: str | None,
    time_column_and_unit: tuple[str, str] | None,
    columns_and_rows_per_part: dict[str, Any],
) -> Iterator[RecordedFlight]:
    check_exists(path)
    reader_name = reader_name or reader_name_for_path(path)
    if reader_name not in READER_NAMES:
        raise BadInput(f"--reader {reader_name}: is not known, allowed: {', '.join(READER_NAMES)}")
    module = import_module(f"beaver_ftc_logs.readers.{reader_name}")
    if reader_name == "table":
        yield from module.read_parts(path, *(time_column_and_unit or ()), **columns_and_rows_per_part)
        return
    if (
        time_column_and_unit is not None
        and time_column_and_unit != _TIME_COLUMN_AND_UNIT_BY_READER[reader_name]
    ):
        format_time_column, format_time_unit = _TIME_COLUMN_AND_UNIT_BY_READER[reader_name]
        raise BadInput(
            f"{path}: time: {' in '.join(time_column_and_unit)} is not its time, "
            f"allowed: {format_time_column} in {format_time_unit}"
        )
    yield (
        module.read(path, columns_and_rows_per_part["columns"])
        if reader_name in NAMES_OF_READERS_OF_WANTED_COLUMNS
        else module.read(path)
    )


def check_exists(path: Path) -> None:
    """Raise BadInput where there is no log."""
    if not path.exists():
        raise BadInput(f"{path}: no such file or folder, allowed: a recorded flight")


def reader_name_for_path(path: Path) -> str:
    """The reader that a path asks for by its form. Raises BadInput where none does."""
    if path.is_dir():
        return "alfa"
    reader_name = _READER_NAME_BY_SUFFIX.get(path.suffix.lower())
    if reader_name is None:
        raise BadInput(
            f"{path}: what kind of log this is cannot be seen, allowed: "
            f"{', '.join(sorted(_READER_NAME_BY_SUFFIX))}, or --reader {', '.join(READER_NAMES)}"
        )
    return reader_name
