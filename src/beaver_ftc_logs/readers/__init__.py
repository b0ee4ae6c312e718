"""Readers of recorded flights, by name. A new format is one file here and one line in `READER_NAMES`."""

import re
from collections.abc import Collection, Iterator
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from beaver_ftc.documents import BadInput
from beaver_ftc_logs.recording import Column, Floats, RecordedFlight

ROWS_PER_PART = 100_000
"""Rows of a part of a long table."""
SAMPLES_PER_PART = 400_000
"""Samples of a part of another long log, 67 min at 100 Hz: `diagnose` needs 1 GB for a part of 480,000."""
LAST_PART_FACTOR, PART_OVERLAP_SHARE = 1.2, 0.1
"""So many times the rows of a part has the last at most; their share with which the next begins once more."""
READER_NAMES = ("table", "alfa", "ulog", "ardupilot")
SELECTIVE_READERS = ("ulog", "ardupilot")
"""Of an autopilot's logs the columns that are wanted, the names alone where there are none of these."""
_READER_OF_SUFFIX = {
    ".csv": "table", ".tsv": "table", ".txt": "table", ".parquet": "table",
    ".ulg": "ulog", ".bin": "ardupilot", ".log": "ardupilot",
}  # fmt: skip


_BLACKBOX_PHRASE = (
    "a raw blackbox log of Betaflight or INAV, allowed: a table of it, which `blackbox_decode FILE` writes"
)
_WAYS_TO_TABLE = {
    ".tlog": "a telemetry log (MAVLink messages that a ground station received), allowed: the autopilot's "
    "own log (.bin, .ulg), or a table of the telemetry, which pymavlink writes: `mavlogdump.py --format csv "
    "--types ATTITUDE,SERVO_OUTPUT_RAW FILE > FILE.csv`",
    ".bbl": _BLACKBOX_PHRASE, ".bfl": _BLACKBOX_PHRASE,
}  # fmt: skip
"""Logs that another program turns into a table: what they are, and how."""
_POINTER_BYTES = 200
_LARGE_FILE_STORES = {
    rb"version https?://(git-lfs|hawser)\.github\.com/spec/": ("Git LFS", "git lfs pull"),
    rb"(\.\./|/)*(\.git/)?annex/objects/": ("git-annex", "git annex get FILE"),
}
"""How pointers begin: the name of the store, and the command that fetches the file."""

_OWN_TIMES = {"alfa": ("%time", "ns"), "ulog": ("timestamp", "us"), "ardupilot": ("TimeUS", "us")}
"""Time column and its unit in formats that define them."""


def read_flight(
    path: Path,
    reader: str | None = None,
    time: tuple[str, str] | None = None,
    columns: Collection[str] | None = None,
) -> RecordedFlight:
    """The recorded flight in a file or folder.

    reader: one of READER_NAMES; by the path's own form where None. time: of a table.
    columns: those that a log is read for, and holds in memory, all where None. Raises BadInput with one line:
    why the log cannot be used.
    """
    return next(_read_with_reader(path, reader, time, {"columns": columns, "part_rows": None}))


def read_parts(
    path: Path,
    reader: str | None = None,
    time: tuple[str, str] | None = None,
    columns: Collection[str] | None = None,
) -> Iterator[RecordedFlight]:
    """The same, a long table in parts."""
    return _read_with_reader(path, reader, time, {"columns": columns, "part_rows": ROWS_PER_PART})


def _read_with_reader(
    path: Path, reader: str | None, time: tuple[str, str] | None, options: dict[str, Any]
) -> Iterator[RecordedFlight]:
    check_exists(path)
    reader = reader or reader_name_for_path(path)
    if reader not in READER_NAMES:
        raise BadInput(f"--reader {reader}: is not known, allowed: {', '.join(READER_NAMES)}")
    module = import_module(f"beaver_ftc_logs.readers.{reader}")
    if reader == "table":
        yield from module.read_parts(path, *(time or ()), **options)
        return
    if time is not None and time != _OWN_TIMES[reader]:
        column, unit = _OWN_TIMES[reader]
        raise BadInput(f"{path}: time: {' in '.join(time)} is not its time, allowed: {column} in {unit}")
    yield (module.read(path, options["columns"]) if reader in SELECTIVE_READERS else module.read(path))


def split_long_recording(log: RecordedFlight, stamps: Floats, ratio: float) -> Iterator[RecordedFlight]:
    """A log in parts as those of a long table: numbered, each begins with the end of the one before.

    stamps: of the rows that are counted, increasing, of which so many are one sample later. A column of
    a part begins with its last value before, if it has no value at the first of these rows.
    """
    part_rows = round(SAMPLES_PER_PART * ratio)
    if len(stamps) <= LAST_PART_FACTOR * part_rows:
        yield log
        return
    begin, part, is_last = 0, 1, False
    while not is_last:
        is_last = len(stamps) - begin <= LAST_PART_FACTOR * part_rows
        end = len(stamps) if is_last else begin + part_rows
        period = stamps[begin], stamps[end - 1]
        columns = {name: _select_period(column, *period) for name, column in log.columns.items()}
        yield replace(log, name=f"{log.name}-part-{part}", columns=columns)
        begin, part = end - round(PART_OVERLAP_SHARE * part_rows), part + 1


def _select_period(column: Column, begin_s: float, end_s: float) -> Column:
    first = max(int(np.searchsorted(column.t_s, begin_s, side="right")) - 1, 0)
    end_row = int(np.searchsorted(column.t_s, end_s, side="right"))
    return Column(column.t_s[first:end_row], column.values[first:end_row], column.note)


def check_exists(path: Path) -> None:
    """Raise BadInput where there is no log, or only a pointer to one."""
    if not path.exists():
        raise BadInput(f"{path}: no such file or folder, allowed: a recorded flight")
    check_is_log_itself(path)


def check_is_log_itself(path: Path) -> None:
    """Raise BadInput for the few bytes that stand in a repository for a large file kept elsewhere."""
    if not path.is_file():
        return
    with path.open("rb") as file:
        head = file.read(_POINTER_BYTES)
    for pattern, (store, command) in _LARGE_FILE_STORES.items():
        if re.match(pattern, head):
            allowed = f"the log itself, which `{command}` fetches"
            raise BadInput(
                f"{path}: is a pointer of a large-file store ({store}), not the log, allowed: {allowed}"
            )


def reader_name_for_path(path: Path) -> str:
    """The reader that a path asks for by its form. Raises BadInput where none does."""
    if path.is_dir():
        return "alfa"
    if path.suffix.lower() in _WAYS_TO_TABLE:
        raise BadInput(f"{path}: is {_WAYS_TO_TABLE[path.suffix.lower()]}")
    reader = _READER_OF_SUFFIX.get(path.suffix.lower())
    if reader is None:
        allowed = f"{', '.join(sorted(_READER_OF_SUFFIX))}, or --reader {', '.join(READER_NAMES)}"
        raise BadInput(f"{path}: what kind of log this is cannot be seen, allowed: {allowed}")
    return reader
